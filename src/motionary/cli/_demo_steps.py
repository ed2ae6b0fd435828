"""Steps that both demonstrations share."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motionary.evaluation import Scores, evaluate
from motionary.features import FeatureSequence
from motionary.io import write_labels
from motionary.labels import Label, LabelTrack
from motionary.models.library import ClassLibrary
from motionary.motion import Motion
from motionary.plots import plot_annotation, plot_sheet, plot_template, save
from motionary.retrieval.annotation import annotate
from motionary.retrieval.explanation import explain
from motionary.retrieval.search import Hit, QueryExpansion, SearchResult


def show_hits(
    query: tuple[str, Motion], result: SearchResult, motions: Mapping[str, Motion], folder: Path
) -> Iterator[str]:
    """The hits as a table, and pictures of them and of the grown template."""
    for rank, hit in enumerate(result, start=1):
        yield (
            f"  {rank:2}  {hit.recording.name:52} {hit.start_s:5.1f}–{hit.end_s:4.1f} s"
            f"  cost {hit.cost:.3f}"
        )
    title, motion = query
    others = [hit for hit in result if hit.recording.name != motion.source]
    strips = [(hit_title(hit), cut(motions[hit.recording.name], hit)) for hit in others[:5]]
    save(plot_sheet((title, motion.generic_positions()), strips), folder / "hits.png")
    template = result.templates[0]
    save(plot_template(template, tolerance=QueryExpansion().tolerance), folder / "template.png")
    yield f"  pictures: {folder / 'hits.png'}, {folder / 'template.png'}"


def hit_title(hit: Hit) -> str:
    """What stands above a hit's stick figures."""
    return f"{hit.recording}  {hit.start_s:.1f}–{hit.end_s:.1f} s  cost {hit.cost:.3f}"


def cut(motion: Motion, hit: Hit) -> NDArray[np.float64]:
    """Generic positions of a hit."""
    first = hit.start_frame - motion.first_frame
    return motion.cut(first, hit.end_frame - motion.first_frame + 1).generic_positions()


def label(recordings: Sequence[FeatureSequence], library: ClassLibrary) -> dict[str, LabelTrack]:
    """Labels of every recording, by its name."""
    return {sequence.source: annotate(sequence, library) for sequence in recordings}


def write_results(
    tracks: Mapping[str, LabelTrack],
    truth: Mapping[str, Sequence[Label]],
    folder: Path,
) -> Iterator[str]:
    """Labels as a table, and a picture of each recording's labels against the truth."""
    write_labels(tracks.values(), folder / "labels.csv")
    yield f"  labels: {folder / 'labels.csv'}"
    for name, track in tracks.items():
        path = folder / f"labels-{Path(name).stem}.png"
        against = LabelTrack(track.recording, tuple(truth[name]))
        save(plot_annotation(track, against), path)
        yield f"  picture: {path}"


def rename(track: LabelTrack, names: Mapping[str, str]) -> LabelTrack:
    """The track with the truth's names for its classes."""
    labels = tuple(replace(x, name=names.get(x.name, x.name)) for x in track)
    return replace(track, labels=labels)


def show_scores(
    tracks: Mapping[str, LabelTrack],
    truth: Mapping[str, Sequence[Label]],
    classes: Sequence[str],
) -> Iterator[str]:
    """Scores of the labels beside those of a labeller that always says the same."""
    durations = {name: track.duration_s or 0.0 for name, track in tracks.items()}

    def score(labels: Mapping[str, Sequence[Label]]) -> Scores:
        return evaluate(labels, truth, durations_s=durations, missing="empty", classes=classes)

    known = [x for labels in truth.values() for x in labels if x.name in classes]
    lengths: dict[str, float] = {}
    for x in known:
        lengths[x.name] = lengths.get(x.name, 0.0) + x.end_s - x.start_s
    most = max(lengths, key=lambda name: lengths[name])
    trivial = {name: [Label(most, 0.0, end)] for name, end in durations.items()}
    yield f"  {'':26}  frames: P1   R1   F1    segments: P2   R2   F2"
    for title, labels in (
        ("motionary", {name: list(track) for name, track in tracks.items()}),
        (f"everything is {most!r}", trivial),
    ):
        scores = score(labels).concatenated
        a, b = scores.frames, scores.segments
        yield (
            f"  {title:26}        {a.precision:.2f} {a.recall:.2f} {a.f:.2f}"
            f"              {b.precision:.2f} {b.recall:.2f} {b.f:.2f}"
        )


def explain_two(tracks: Mapping[str, LabelTrack]) -> Iterator[str]:
    """Why the cheapest label, and why the dearest."""
    labels = sorted((x for track in tracks.values() for x in track), key=lambda x: x.cost or 0.0)
    for x in labels[:1] + labels[1:][-1:]:
        yield f"  {x.evidence.sequence.source}: {explain(x)}"
