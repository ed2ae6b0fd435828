"""The main job, once through, on real recordings where they are at hand.

With recordings, clips of HDM05 train classes and other takes are labelled. Without, all motions
are synthetic, and every line says so.
"""

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from motionary.text_tables import align

if TYPE_CHECKING:
    from motionary.features import FeatureSequence
    from motionary.labels import Label, LabelTrack
    from motionary.models.library import ClassLibrary
    from motionary.motion import Motion
    from motionary.retrieval.index import Collection
    from motionary.retrieval.search import SearchResult

DATA = "MOTIONARY_DATA"
EXAMPLE = "squat1Reps/HDM_mm_squat1Reps_037_120.amc"
UNSEEN_ACTOR = "bd"
TAKES = ("hdm05_takes/HDM_bd_03-03_01_120.amc", "cmu/86_01.amc", "cmu/01_01.amc")
#: Nobody in it taught the library that ships.
UNTRAINED = "cmu/86_01.amc"
LICENCE = "CC BY-SA 3.0"
CITATION = (
    "Müller, Röder, Clausen, Eberhardt, Krüger, Weber: Documentation Mocap Database HDM05, "
    "CG-2007-2, Universität Bonn, 2007"
)
SYNTHETIC_EXAMPLES = 6

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

_SCORES = ("", ">P1", ">R1", ">F1", ">P2", ">R2", ">F2")


def demonstrate(output: Path, *, jobs: int) -> Iterator[str]:
    """Lines that say what happens, while it happens: on recordings if there are some."""
    folder = os.environ.get(DATA, "")
    if folder and Path(folder, "hdm05").is_dir():
        return run_on_recordings(Path(folder), output, jobs)
    return (f"[synthetic] {line}" if line else "" for line in run_on_synthetic(output))


# -- on real recordings -----------------------------------------------------------------


def run_on_recordings(data: Path, output: Path, jobs: int) -> Iterator[str]:
    """Lines that say what happens, while it happens."""
    from motionary.retrieval.index import collect

    began = time.perf_counter()
    clips = collect(data / "hdm05", jobs=jobs)
    seconds = sum(s.duration_s for s in clips.sequences)
    yield (
        f"Read {len(clips)} real clips of HDM05 ({seconds / 60:.1f} min) in "
        f"{time.perf_counter() - began:.1f} s. {LICENCE}; {CITATION}."
    )
    yield ""
    yield from _label_untrained(data, output)
    yield ""
    yield from _search(data, clips, output)
    yield ""
    library = _train(clips)
    library.save(output / "library")
    yield (
        f"3. Train {len(library)} classes and their mirror images by four of the five actors, "
        f"into {output / 'library'}"
    )
    templates = [(c.name, c.prototypes[0].template) for c in library]
    yield from _indent(
        ("class", ">examples", ">columns"),
        [(name, str(one.n_examples), str(one.n_columns)) for name, one in templates],
    )
    yield ""
    yield from _label_takes(data, library, output)
    yield f"All in {time.perf_counter() - began:.1f} s."


def _label_untrained(data: Path, output: Path) -> Iterator[str]:
    from motionary.features import compute_features
    from motionary.io import read

    yield f"1. Label {UNTRAINED} with the library that ships, without training"
    yield from _show_labels(compute_features(read(data / UNTRAINED)), output)


def _search(data: Path, clips: "Collection", output: Path) -> Iterator[str]:
    from motionary.io import read
    from motionary.retrieval.search import search

    yield f"2. Search by one example, without any class: {EXAMPLE}"
    example = read(data / "hdm05" / EXAMPLE).renamed(EXAMPLE)
    began = time.perf_counter()
    result = search(example, clips, limit=12)
    took = time.perf_counter() - began
    yield f"  {len(result)} best hits among {len(clips)} recordings, {took:.2f} s"
    motions = {name: read(data / "hdm05" / name) for name in {hit.recording.name for hit in result}}
    yield from _show_hits((f"example: {EXAMPLE}", example), result, motions, output)


def _train(clips: "Collection") -> "ClassLibrary":
    from motionary.models.library import TrainingOptions, learn

    examples: dict[str, list[FeatureSequence]] = {}
    for sequence in clips.sequences:
        folder, file = sequence.source.split("/")
        if file.split("_")[1] != UNSEEN_ACTOR:
            examples.setdefault(folder, []).append(sequence)
    training = TrainingOptions(
        mirror=True, provenance=f"HDM05, actors other than {UNSEEN_ACTOR}. {CITATION}",
        licence=LICENCE,
    )  # fmt: skip
    return learn(examples, training=training)


def _label_takes(data: Path, library: "ClassLibrary", output: Path) -> Iterator[str]:
    from motionary.features import compute_features
    from motionary.io import match_recording, read, read_labels
    from motionary.retrieval.annotation import annotate

    yield "4. Label recordings that were never seen: an actor left out, and two of CMU"
    began = time.perf_counter()
    takes = [compute_features(read(data / take)) for take in TAKES]
    tracks = {take.source: annotate(take, library, assignment="published") for take in takes}
    seconds = sum(s.duration_s for s in takes)
    yield f"  {seconds:.0f} s of motion read and labelled in {time.perf_counter() - began:.1f} s"
    table = read_labels(data / "truth" / "annotation_2009.csv")
    truth: dict[str, list[Label]] = {}
    for name in tracks:
        row = match_recording(name, table)
        truth[name] = list(table[row]) if row else []
    named = {
        name: replace(
            track, labels=tuple(replace(x, name=NAMES.get(x.name, x.name)) for x in track)
        )
        for name, track in tracks.items()
    }
    yield from _write_results(named, truth, output)
    yield ""
    yield "5. Score against the labels of the thesis (classes that both know)"
    yield from _show_scores(named, truth, sorted(set(NAMES.values())))
    yield ""
    yield "6. Explain the surest and the least sure label"
    yield from _explain_two(tracks)
    yield ""


# -- on synthetic motions ---------------------------------------------------------------


def run_on_synthetic(output: Path) -> Iterator[str]:
    """Lines that say what happens, while it happens."""
    from motionary.features import compute_features
    from motionary.labels import Label
    from motionary.models.library import TrainingOptions, learn
    from motionary.retrieval.annotation import annotate
    from motionary.retrieval.index import Collection
    from motionary.retrieval.search import search
    from motionary.samples import SYNTHETIC_CLASSES, synthetic_motion, synthetic_stream

    yield (
        f"No recordings at hand (set {DATA} to a folder of them): all motions, numbers "
        "and pictures here are synthetic and say nothing of real ones."
    )
    yield ""
    motions = {
        f"{name}-{seed}": synthetic_motion(name, seed=seed).renamed(f"{name}-{seed}")
        for name in SYNTHETIC_CLASSES
        for seed in range(SYNTHETIC_EXAMPLES)
    }
    clips = Collection(tuple(compute_features(motion) for motion in motions.values()))
    stream, segments = synthetic_stream(list(SYNTHETIC_CLASSES), seed=7)
    sequence = compute_features(stream).renamed("synthetic-stream")
    yield "1. Label a synthetic stream with the library that ships, without training"
    yield from _show_labels(sequence, output)
    yield ""
    name = SYNTHETIC_CLASSES[0]
    yield f"2. Search by one synthetic example: {name}"
    example = synthetic_motion(name, seed=99).renamed(f"synthetic {name}")
    result = search(example, clips, limit=8)
    yield from _show_hits((f"synthetic example: {name}", example), result, motions, output)
    yield ""
    examples: dict[str, list[Motion]] = {}
    for title, motion in motions.items():
        examples.setdefault(title.rpartition("-")[0], []).append(motion)
    training = TrainingOptions(provenance="synthetic motions of motionary", licence="Apache-2.0")
    library = learn(examples, training=training)
    library.save(output / "library")
    yield f"3. Train {len(library)} classes by synthetic motions, into {output / 'library'}"
    yield ""
    tracks = {sequence.source: annotate(sequence, library, assignment="published")}
    truth = {sequence.source: [Label(*segment) for segment in segments]}
    yield f"4. Label a synthetic stream of {sequence.duration_s:.0f} s"
    yield from _write_results(tracks, truth, output)
    yield ""
    yield "5. Score against the plan of the synthetic stream"
    yield from _show_scores(tracks, truth, library.names)
    yield ""
    yield "6. Explain two synthetic labels"
    yield from _explain_two(tracks)


# -- steps of both ----------------------------------------------------------------------


def _show_labels(sequence: "FeatureSequence", folder: Path) -> Iterator[str]:
    """Labels of the library that ships as a table, counted, and drawn."""
    from motionary.labels import count
    from motionary.plots import plot_annotation, save
    from motionary.retrieval.annotation import annotate

    track = annotate(sequence)
    rows = [
        (x.name, f"{x.start_s:.1f}", f"{x.end_s:.1f}", f"{x.score:.1f}", f"{x.probability:.0%}")
        for x in track
    ]
    yield from _indent(("label", ">start_s", ">end_s", ">score", ">right"), rows)
    counted = ", ".join(f"{one.name} {one.number}" for one in count(track))
    yield f"  counted: {counted or 'nothing'}"
    save(plot_annotation(track), folder / "labels-untrained.png")
    yield f"  picture: {folder / 'labels-untrained.png'}"


def _show_hits(
    query: "tuple[str, Motion]",
    result: "SearchResult",
    motions: "Mapping[str, Motion]",
    folder: Path,
) -> Iterator[str]:
    """The hits as a table, and pictures of them and of the learned template."""
    from motionary.plots import plot_sheet, plot_template, save
    from motionary.retrieval.search import QueryExpansion, cut_frames

    rows = [
        (str(rank), hit.recording.name, f"{hit.start_s:.1f}", f"{hit.end_s:.1f}", f"{hit.cost:.3f}")
        for rank, hit in enumerate(result, start=1)
    ]
    yield from _indent((">rank", "recording", ">start_s", ">end_s", ">cost"), rows)
    title, motion = query
    others = [hit for hit in result if hit.recording.name != motion.source]
    strips = []
    for hit in others[:5]:
        place = f"{hit.recording.name}  {hit.start_s:.1f}–{hit.end_s:.1f} s"
        motion_of_hit = motions[hit.recording.name]
        frames = cut_frames(motion_of_hit, hit.start_frame, hit.end_frame)
        strips.append((f"{place}  cost {hit.cost:.3f}", *frames))
    last = motion.first_frame + motion.n_frames - 1
    example = (title, *cut_frames(motion, motion.first_frame, last))
    save(plot_sheet(example, strips), folder / "hits.png")
    template = result.templates[0]
    save(plot_template(template, tolerance=QueryExpansion().tolerance), folder / "template.png")
    yield f"  pictures: {folder / 'hits.png'}, {folder / 'template.png'}"


def _write_results(
    tracks: "Mapping[str, LabelTrack]", truth: "Mapping[str, Sequence[Label]]", folder: Path
) -> Iterator[str]:
    """Labels as a table, and a picture of each recording's labels against the truth."""
    from motionary.io import write_labels
    from motionary.plots import plot_annotation, save

    write_labels(tracks.values(), folder / "labels.csv")
    yield f"  labels: {folder / 'labels.csv'}"
    for name, track in tracks.items():
        path = folder / f"labels-{Path(name).stem}.png"
        against = replace(track, labels=tuple(truth[name]), unassessed=())
        save(plot_annotation(track, against), path)
        yield f"  picture: {path}"


def _show_scores(
    tracks: "Mapping[str, LabelTrack]",
    truth: "Mapping[str, Sequence[Label]]",
    classes: Sequence[str],
) -> Iterator[str]:
    """Scores of the labels beside those of a labeller that always says the same."""
    from motionary.evaluation import evaluate
    from motionary.labels import Label

    durations = {name: track.duration_s or 0.0 for name, track in tracks.items()}
    lengths = dict.fromkeys(classes, 0.0)
    for x in (x for labels in truth.values() for x in labels if x.name in lengths):
        lengths[x.name] += x.end_s - x.start_s
    most = max(lengths, key=lambda name: lengths[name])
    rows = []
    for title, labels in (
        ("motionary", {name: list(track) for name, track in tracks.items()}),
        (f"everything is {most!r}", {n: [Label(most, 0.0, end)] for n, end in durations.items()}),
    ):
        scores = evaluate(
            labels, truth, durations_s=durations, missing="empty", classes=classes
        ).concatenated
        rows.append((title, *(f"{value:.2f}" for value in (*scores.frames, *scores.segments))))
    yield "  precision, recall and F of frames (P1, R1, F1) and of segments (P2, R2, F2)"
    yield from _indent(_SCORES, rows)


def _explain_two(tracks: "Mapping[str, LabelTrack]") -> Iterator[str]:
    """Why the label of the lowest cost was given, and why that of the highest."""
    from motionary.retrieval.explanation import explain

    labels = sorted((x for track in tracks.values() for x in track), key=lambda x: x.cost or 0.0)
    for x in labels[:1] + labels[1:][-1:]:
        yield f"  {x.evidence.sequence.source}: {explain(x)}"


def _indent(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Lines of a table, indented."""
    return (f"  {line}" for line in align(columns, rows))
