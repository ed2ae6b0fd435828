"""Pages of many short clips side by side, played in step: hits of a search, examples of a class.

Clips are kept in step by their matches: each says at which of its seconds it meets which
column of the template, and the page plays all by the columns.

Conventions: a *phase* is a place in a template, 0 its first column and 1 its last.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence, compute_features
from motionary.io import ReadOptions, name_recordings, read
from motionary.matching import Alignment, Pattern, align, distance_function
from motionary.models.templates import QuantisedTemplate
from motionary.motion import Motion
from motionary.recording import find_runs
from motionary.reporting.contents import PAGE_HZ, describe_features, make_clip
from motionary.reporting.html import Block, Page, build_page, check_rate
from motionary.retrieval.explanation import describe_comparison, explain
from motionary.retrieval.index import Index
from motionary.retrieval.search import Hit, SearchResult

Floats = NDArray[np.float64]

#: More clips than this are not looked at side by side.
MOST_CLIPS = 60

#: Motions by the names of their recordings, or folders and files to read them from.
Motions = Mapping[str, Motion] | Iterable[Motion | str | Path] | Index | str | Path

_MOST_FAILED = 3
_MOST_QUANTITIES = 2
_MOST_KEPT = 8


class Judging(NamedTuple):
    """How a person says of hits whether they are right.

    Attributes
    ----------
    command : that searches again; the page adds `--relevant` and `--irrelevant`
    ranks : of each hit in the search without them, from 1; 0 where it had none
    relevant, irrelevant : such ranks that were given before
    """

    command: str
    ranks: Sequence[int]
    relevant: Sequence[int] = ()
    irrelevant: Sequence[int] = ()


class Cell(NamedTuple):
    """A clip among others, cut to what is shown."""

    title: str
    detail: str  # a line above the clip, as the title
    motion: Motion
    warp: Floats  # shape (points, 2): phases, and the seconds of the clip that meet them
    start_s: float = 0.0  # seconds of the recording at which it begins
    notes: Sequence[str] = ()  # lines below it
    is_query: bool = False  # whether the others are compared with it


def report_hits(
    result: SearchResult,
    motions: Motions,
    path: str | Path | None = None,
    *,
    query: Motion | None = None,
    judging: Judging | None = None,
    rate_hz: float = PAGE_HZ,
    title: str = "hits",
) -> Page:
    """A page that plays the hits of a search side by side, in step with each other.

    Parameters
    ----------
    result : of `search`; the first 60 hits are shown
    motions : the recordings that were searched: by name, or where they are
    path : file to write, .html; otherwise `Page.save` does, and notebooks show the page
    query : the example, cut to the motion itself
    judging : how a person says which hits are right
    rate_hz : most frames a second that are kept
    title : of the page

    Raises
    ------
    InvalidInput
        If there are neither hits nor a query, or a recording is not among the motions.
    UnwritableFile
    """
    check_rate(rate_hz)
    hits = result.hits[:MOST_CLIPS]
    cells = [] if query is None else [_cell_of_query(query, hits)]
    found = find_motions(motions)
    for rank, hit in enumerate(hits, start=1):
        name = hit.recording.name
        if name not in found:
            raise InvalidInput(f"{name!r} is not among the motions; give those that were searched")
        cells.append(cell_of_hit(rank, hit, found[name]))
    if not cells:
        raise InvalidInput(f"there is nothing to show: {result.nearest or 'no hits'}")
    gallery, blocks = make_gallery(cells, key="g0", rate_hz=rate_hz)
    gallery["duration_s"] = round(cells[0].motion.duration_s, 4)
    gallery["name"] = title
    gallery["facts"] = [_count(len(result), len(hits))] if hits else [result.nearest]
    if hits and len(result.templates) == 1:
        gallery["template"] = describe_template(hits[0].evidence.template)
    if judging is not None:
        said = {name: list(getattr(judging, name)) for name in ("ranks", "relevant", "irrelevant")}
        gallery["judging"] = {"command": judging.command, **said}
    features = describe_features(hits[0].evidence.sequence.feature_set) if hits else []
    content = {"features": features, "galleries": [gallery]}
    return build_page(content, blocks, title=title, path=path)


def rank_among(hits: Sequence[Hit], first: Sequence[Hit]) -> list[int]:
    """Rank of each hit in a first search, from 1; 0 where it has none of most of its frames."""
    return [
        next((rank for rank, other in enumerate(first, start=1) if _is_same(hit, other)), 0)
        for hit in hits
    ]


def _is_same(hit: Hit, other: Hit) -> bool:
    if hit.recording.name != other.recording.name:
        return False
    common = min(hit.end_s, other.end_s) - max(hit.start_s, other.start_s)
    return 2 * common > max(hit.end_s - hit.start_s, other.end_s - other.start_s)


def make_gallery(
    cells: Sequence[Cell], *, key: str, rate_hz: float
) -> tuple[dict[str, Any], list[Block]]:
    """What the page has of clips side by side."""
    blocks: list[Block] = []
    contents = []
    for number, cell in enumerate(cells):
        clip, own = make_clip(cell.motion, key=f"{key}-{number}", rate_hz=rate_hz)
        blocks += own
        contents.append(
            {
                "title": cell.title,
                "detail": cell.detail,
                "start_s": cell.start_s,
                "notes": list(cell.notes),
                "query": cell.is_query,
                "warp": np.round(cell.warp, 4).tolist(),
                "clip": clip,
            }
        )
    return {"cells": contents}, blocks


def describe_template(template: QuantisedTemplate) -> list[list[float]]:
    """What a template asks for: feature, whether it is to hold, and the phases between which."""
    edges = _edges(template.weights)
    rows: list[list[float]] = []
    for feature in np.flatnonzero(template.fixed.any(axis=0)).tolist():
        for holds in (True, False):
            asked = template.fixed[:, feature] & (template.values[:, feature] == holds)
            for start, stop in find_runs(asked).tolist():
                phases = [round(float(edges[at]), 4) for at in (start, stop)]
                rows.append([feature, int(holds), *phases])
    return rows


def warp_of(alignment: Alignment, weights: Floats, *, start_frame: int) -> Floats:
    """Phases of a match and its seconds since a frame of its sequence, shape (points, 2)."""
    columns, frames = alignment.path.T
    edges = _edges(weights)
    middles = (edges[:-1] + edges[1:]) / 2
    span = max(middles[-1] - middles[0], 1e-9)
    phases = (middles[columns] - middles[0]) / span
    seconds: Floats = (frames - start_frame) / 30.0
    return np.column_stack([phases, seconds])


def warp_by(pattern: Pattern, sequence: FeatureSequence, motion: Motion) -> Floats:
    """Where a clip meets the columns of a pattern; evenly where it does not fit into the clip."""
    distance = distance_function(pattern, sequence.packed, sequence.known)
    if not np.isfinite(distance).any():
        return _whole_warp(motion)
    (best,) = align(pattern, sequence.packed, sequence.known, [int(np.argmin(distance))])
    return warp_of(best, pattern.weights, start_frame=0)


def _whole_warp(motion: Motion) -> Floats:
    """A clip from its beginning to its end."""
    return np.array([[0.0, 0.0], [1.0, motion.duration_s]])


def _edges(weights: Floats) -> Floats:
    """Phases at which columns begin, and the end, shape (columns + 1,)."""
    ends = np.cumsum(weights)
    edges: Floats = np.concatenate([[0.0], ends / ends[-1]])
    return edges


def _count(n_hits: int, n_shown: int) -> str:
    text = "1 hit" if n_hits == 1 else f"{n_hits} hits"
    return text if n_hits == n_shown else f"{text}, the first {n_shown} of them here"


def _cell_of_query(query: Motion, hits: Sequence[Hit]) -> Cell:
    warp = _whole_warp(query)
    if hits:
        evidence = hits[0].evidence
        sequence = compute_features(query, feature_set=evidence.sequence.feature_set)
        warp = warp_by(evidence.pattern, sequence, query)
    last = query.first_frame + query.n_frames - 1
    detail = f"{query.duration_s:.2f} s, frames {query.first_frame}–{last}"
    return Cell(query.source or "query", detail, query, warp, is_query=True)


def cell_of_hit(rank: int, hit: Hit, motion: Motion) -> Cell:
    """The clip of a hit, with what failed, or what is like the example and what is not."""
    first = max(hit.start_frame - motion.first_frame, 0)
    stop = min(max(hit.end_frame + 1 - motion.first_frame, first + 1), motion.n_frames)
    part = motion.cut(first, stop).renamed(motion.source)
    evidence, found = hit.evidence, hit.comparison
    if found is None:
        alignment = evidence.alignment
        warp = warp_of(alignment, evidence.pattern.weights, start_frame=alignment.start)
        notes = [f"failed: {one}" for one in explain(evidence).worst()[:_MOST_FAILED]]
    else:
        published = found.found.leading(evidence.sequence.feature_set)
        warp = warp_by(evidence.pattern, published, part)
        notes = describe_comparison(found, most=_MOST_QUANTITIES)
    seen = "" if hit.known >= 1 else f", {int(100 * hit.known)} % seen"
    detail = f"{hit.start_s:.2f}–{hit.end_s:.2f} s, cost {hit.cost:.3f}{seen}"
    title = f"{rank}  {Path(hit.recording.name).name}"
    return Cell(title, detail, part, warp, round(hit.start_s, 4), notes)


class MotionFiles(Mapping[str, Motion]):
    """Motions by name, read when they are asked for; the last few are kept."""

    def __init__(self, files: Mapping[str, Path], reading: ReadOptions | None = None) -> None:
        self._files = files
        self._reading = reading or ReadOptions()
        self._kept: dict[str, Motion] = {}

    def __getitem__(self, name: str) -> Motion:
        if name not in self._kept:
            path = self._files[name]
            if len(self._kept) >= _MOST_KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[name] = read(path, self._reading.for_file(path)).renamed(name)
        return self._kept[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __len__(self) -> int:
        return len(self._files)


def find_motions(motions: Motions) -> Mapping[str, Motion]:
    """Motions by the names of their recordings.

    Raises
    ------
    InvalidInput
        If there are features among them, which have no positions.
    """
    if isinstance(motions, Mapping):
        return motions
    if isinstance(motions, Index):
        reading = motions.reading
        files = name_recordings(motions.folder, split=reading.take is None)
        return MotionFiles(files, reading)
    if isinstance(motions, str | Path):
        return MotionFiles(name_recordings(motions))
    given = list(motions) if isinstance(motions, Iterable) else [motions]
    if given and all(isinstance(one, str | Path) for one in given):
        return MotionFiles(name_recordings([one for one in given if isinstance(one, str | Path)]))
    named = {one.source: one for one in given if isinstance(one, Motion)}
    if len(named) < len(given):
        raise InvalidInput(
            "features have no positions to show; give the recordings: motions, a folder or files"
        )
    return named
