"""The demonstration on real recordings: HDM05 clips teach, other takes are labelled."""

import time
from collections.abc import Iterator
from pathlib import Path

from motionary.cli import _demo_steps as steps
from motionary.features import FeatureSequence, compute_features
from motionary.io import match_recording, read, read_labels
from motionary.labels import Label
from motionary.models.library import ClassLibrary, TrainingOptions, learn_classes
from motionary.retrieval.index import Collection, collect
from motionary.retrieval.search import search

EXAMPLE = "squat1Reps/HDM_mm_squat1Reps_037_120.amc"
UNSEEN_ACTOR = "bd"
TAKES = ("hdm05_takes/HDM_bd_03-03_01_120.amc", "cmu/86_01.amc", "cmu/01_01.amc")
LICENCE = "CC BY-SA 3.0"
CITATION = (
    "Müller, Röder, Clausen, Eberhardt, Krüger, Weber: Documentation Mocap Database HDM05, "
    "CG-2007-2, Universität Bonn, 2007"
)

#: What the thesis' annotators call the classes of the clips.
NAMES = {
    "depositFloorR": "grabDepR",
    "grabHighR": "grabDepR",
    "elbowToKnee1RepsLelbowStart": "exercise",
    "squat1Reps": "exercise",
    "hopBothLegs1hops": "jump",
    "jogLeftCircle4StepsRstart": "move",
    "sneak2StepsLStart": "move",
    "kickLFront1Reps": "kick",
    "lieDownFloor": "sitLieDown",
    "rotateArmsBothBackward1Reps": "rotateArms",
    "throwBasketball": "throwR",
}


def run(data: Path, output: Path, jobs: int) -> Iterator[str]:
    """Lines that tell what happens, while it happens."""
    began = time.perf_counter()
    clips = collect(data / "hdm05", jobs=jobs)
    seconds = sum(s.duration_s for s in clips.sequences)
    yield (
        f"Read {len(clips)} real clips of HDM05 ({seconds / 60:.1f} min) in "
        f"{time.perf_counter() - began:.1f} s. {LICENCE}; {CITATION}."
    )
    yield ""
    yield from _search(data, clips, output)
    yield ""
    library = _train(clips)
    library.save(output / "library")
    yield (
        f"2. Teach: {len(library)} classes and their mirror images from four of the five "
        f"actors, into {output / 'library'}"
    )
    for c in library:
        template = c.prototypes[0].template
        yield f"  {c.name:30} {template.n_examples:2} examples, {template.n_columns:3} columns"
    yield ""
    yield from _label(data, library, output)
    yield f"All in {time.perf_counter() - began:.1f} s."


def _search(data: Path, clips: Collection, output: Path) -> Iterator[str]:
    yield f"1. Search by one example, without any class: {EXAMPLE}"
    example = read(data / "hdm05" / EXAMPLE).renamed(EXAMPLE)
    began = time.perf_counter()
    result = search(example, clips, limit=12)
    took = time.perf_counter() - began
    yield f"  {len(result)} best hits among {len(clips)} recordings, {took:.2f} s"
    motions = {name: read(data / "hdm05" / name) for name in {hit.recording.name for hit in result}}
    yield from steps.show_hits((f"example: {EXAMPLE}", example), result, motions, output)


def _train(clips: Collection) -> ClassLibrary:
    examples: dict[str, dict[str, list[FeatureSequence]]] = {}
    for sequence in clips.sequences:
        folder, file = sequence.source.split("/")
        if file.split("_")[1] != UNSEEN_ACTOR:
            examples.setdefault(folder, {}).setdefault(folder, []).append(sequence)
    training = TrainingOptions(
        mirror=True, provenance=f"HDM05, actors other than {UNSEEN_ACTOR}. {CITATION}",
        licence=LICENCE,
    )  # fmt: skip
    return learn_classes(examples, training=training)


def _label(data: Path, library: ClassLibrary, output: Path) -> Iterator[str]:
    yield "3. Label recordings that were never seen: an actor left out, and two of CMU"
    began = time.perf_counter()
    takes = [compute_features(read(data / take)) for take in TAKES]
    tracks = steps.label(takes, library)
    seconds = sum(s.duration_s for s in takes)
    yield f"  {seconds:.0f} s of motion read and labelled in {time.perf_counter() - began:.1f} s"
    table = read_labels(data / "truth" / "annotation_2009.csv")
    truth: dict[str, list[Label]] = {}
    for name in tracks:
        row = match_recording(name, table)
        truth[name] = list(table[row]) if row else []
    named = {name: steps.rename(track, NAMES) for name, track in tracks.items()}
    yield from steps.write_results(named, truth, output)
    yield ""
    yield "4. Score against the labels of the thesis (classes that both know)"
    yield from steps.show_scores(named, truth, sorted(set(NAMES.values())))
    yield ""
    yield "5. Explain the surest and the least sure label"
    yield from steps.explain_two(tracks)
    yield ""
