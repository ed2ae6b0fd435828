"""The demonstration without recordings: synthetic motions, called so in every line."""

from collections.abc import Iterator
from pathlib import Path

from motionary.cli import _demo_steps as steps
from motionary.features import compute_features
from motionary.labels import Label
from motionary.models.library import TrainingOptions, learn
from motionary.retrieval.index import Collection
from motionary.retrieval.search import search
from motionary.samples import SYNTHETIC_CLASSES, synthetic_motion, synthetic_stream

EXAMPLES = 6


def run(data: Path, output: Path, jobs: int) -> Iterator[str]:
    """Lines that tell what happens, while it happens."""
    for line in _run(output):
        yield f"[synthetic] {line}" if line else ""


def _run(output: Path) -> Iterator[str]:
    yield (
        "No recordings at hand (set MOTIONARY_DATA to a folder of them): all motions, numbers "
        "and pictures here are synthetic and say nothing of real ones."
    )
    yield ""
    motions = {
        f"{name}-{seed}": synthetic_motion(name, seed=seed).renamed(f"{name}-{seed}")
        for name in SYNTHETIC_CLASSES
        for seed in range(EXAMPLES)
    }
    clips = Collection(tuple(compute_features(motion) for motion in motions.values()))
    name = SYNTHETIC_CLASSES[0]
    yield f"1. Search by one synthetic example: {name}"
    example = synthetic_motion(name, seed=99).renamed(f"synthetic {name}")
    result = search(example, clips, limit=8)
    yield from steps.show_hits((f"synthetic example: {name}", example), result, motions, output)
    yield ""
    library = learn(
        {
            name: [motions[f"{name}-{seed}"] for seed in range(EXAMPLES)]
            for name in SYNTHETIC_CLASSES
        },
        training=TrainingOptions(provenance="synthetic motions of motionary", licence="Apache-2.0"),
    )
    library.save(output / "library")
    yield f"2. Taught {len(library)} classes of synthetic motions, into {output / 'library'}"
    yield ""
    stream, segments = synthetic_stream(list(SYNTHETIC_CLASSES), seed=7)
    sequence = compute_features(stream).renamed("synthetic-stream")
    tracks = steps.label([sequence], library)
    truth = {sequence.source: [Label(*segment) for segment in segments]}
    yield f"3. Label a synthetic stream of {sequence.duration_s:.0f} s"
    yield from steps.write_results(tracks, truth, output)
    yield ""
    yield "4. Score against the plan of the synthetic stream"
    yield from steps.show_scores(tracks, truth, library.names)
    yield ""
    yield "5. Explain two synthetic labels"
    yield from steps.explain_two(tracks)
