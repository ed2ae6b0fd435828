"""Two recordings compared: aligned by their features, played in step, differences in words.

Features of both, smoothed in time, are aligned from beginning to end by dynamic time warping
(steps (1, 0), (0, 1), (1, 1)). A difference is an episode in which a feature holds in one of
them: longer or shorter in the other, or not there at all.

Conventions: frames at 30 Hz; the other recording is said to differ from the reference; times
on the axis of the page are the reference's.
"""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.features import FULL_BODY, SEQUENCE_HZ, FeatureSequence, compute_features
from motionary.models.templates import PairCost, align_batched
from motionary.motion import Motion
from motionary.recording import Segment, find_runs
from motionary.reporting.contents import PAGE_HZ, describe_features, estimate_bytes, make_clip
from motionary.reporting.html import (
    Block,
    Page,
    build_page,
    check_bytes,
    check_rate,
    encode_states,
)

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: Differences below are those of any two performances: three frames.
LEAST_S = 0.1
#: So are those below a twentieth of how long a feature holds.
LEAST_FRACTION = 0.05
#: Cells of an alignment; longer recordings are aligned at fewer frames a second.
MOST_CELLS = 12_000_000

_SMOOTH_FRAMES = 3.0
_WARP_SMOOTH_FRAMES = 7
_UNKNOWN = 0.5
# Breaks of an episode that are not counted as breaks: four frames.
_MOST_BREAK = 4
_MOST_LINES = 14
_GROUPS = {"upper": "upper", "lower": "lower", "mix": "whole"}
_NEITHER, _BOTH, _UNSEEN, _REFERENCE_ONLY, _OTHER_ONLY = range(5)


class Difference(NamedTuple):
    """An episode in which a feature holds longer, shorter, or in one recording only."""

    feature: int  # its number in the set
    reference_s: float  # how long it holds in both
    other_s: float
    here: Segment  # the episode in the reference, and in the other
    there: Segment
    excess_s: float  # how much longer it holds in the other than their tempo explains

    @property
    def kind(self) -> str:
        """How the other differs."""
        if self.reference_s == 0:
            return "only"
        if self.other_s == 0:
            return "never"
        return "longer" if self.other_s > self.reference_s else "shorter"


def report_comparison(
    reference: Motion,
    other: Motion,
    path: str | Path | None = None,
    *,
    rate_hz: float = PAGE_HZ,
    title: str = "",
) -> Page:
    """A page that plays two recordings in step and says in words where they differ.

    Parameters
    ----------
    reference, other : of which the second is compared with the first
    path : file to write, .html; otherwise `Page.save` does, and notebooks show the page
    rate_hz : most frames a second that are kept
    title : of the page; by default the recordings' names

    Raises
    ------
    InvalidInput
        If joints of one are unknown.
    UnwritableFile
    """
    check_rate(rate_hz)
    check_bytes(sum(estimate_bytes(one, rate_hz=rate_hz) for one in (reference, other)))
    first, second = compute_features(reference), compute_features(other)
    warp = align_recordings(first, second)
    differences = find_differences(first, second, warp)
    names = short_names(reference.source, other.source)
    content, blocks = make_clip(reference, key="r0", rate_hz=rate_hz)
    clip, own = make_clip(other, key="r1", rate_hz=rate_hz)
    content["short"], clip["short"] = names
    content["other"] = {"clip": clip, "warp": _sparse(warp), "summary": summarise(
        differences, names, (first.duration_s, second.duration_s)
    )}  # fmt: skip
    strip = Block("r0-features", encode_states(_states(first, second, warp)))
    content["strip"] = {"block": strip.name, "n_frames": len(first)}
    content["lanes"] = _lanes(differences, names[1])
    shown = {"features": describe_features(FULL_BODY), "recordings": [content]}
    called = title or " and ".join(names)
    return build_page(shown, [*blocks, *own, strip], title=called, path=path)


def align_recordings(reference: FeatureSequence, other: FeatureSequence) -> Floats:
    """Seconds of the other at each frame of the reference, shape (frames,), not decreasing."""
    # Late: needed for two recordings only.
    from scipy.ndimage import gaussian_filter1d, uniform_filter1d
    from scipy.spatial.distance import cdist

    every = max(1, int(np.ceil(np.sqrt(len(reference) * len(other) / MOST_CELLS))))
    both = [
        gaussian_filter1d(_values(one), _SMOOTH_FRAMES, axis=0, mode="nearest")[::every]
        for one in (reference, other)
    ]
    cost = cdist(both[0], both[1], "cityblock")
    met = align_batched(iter([PairCost(cost, 0, len(both[0]))]))
    forward = met.reference < len(both[0])
    rows, columns = met.reference[forward], met.warped[forward] - len(both[0])
    sums = np.bincount(rows, weights=columns, minlength=len(both[0]))
    means = sums / np.bincount(rows, minlength=len(both[0]))
    frames = np.interp(np.arange(len(reference)) / every, np.arange(len(means)), means) * every
    # Steps are evened out against a straight line, which keeps both ends where they are.
    line = np.linspace(0.0, len(other) - 1.0, len(reference))
    even = line + uniform_filter1d(frames - line, _WARP_SMOOTH_FRAMES, mode="constant")
    seconds: Floats = np.maximum.accumulate(np.clip(even, 0.0, line[-1])) / SEQUENCE_HZ
    return seconds


def find_differences(
    reference: FeatureSequence, other: FeatureSequence, warp: Floats
) -> list[Difference]:
    """Episodes that differ, by start; both over the same features, aligned by a warp."""
    rows, columns = _cells(warp, len(other))
    known = reference.known_features[rows] & other.known_features[columns] != 0
    here, there = reference.features[rows] != 0, other.features[columns] != 0
    tempo = len(other) / len(reference)
    found = []
    for feature in range(len(reference.feature_set)):
        holds = (here[:, feature] | there[:, feature]) & known[:, feature]
        for start, stop in _episodes(holds):
            cells = slice(start, stop)
            reference_s, other_s = (
                len(np.unique(frames[cells][own[cells, feature]])) / SEQUENCE_HZ
                for frames, own in ((rows, here), (columns, there))
            )
            excess_s = other_s - reference_s * tempo
            least_s = max(LEAST_S, LEAST_FRACTION * reference_s * tempo)
            if min(abs(excess_s), abs(other_s - reference_s)) < least_s:
                continue
            here_s = (rows[start] / SEQUENCE_HZ, (rows[stop - 1] + 1) / SEQUENCE_HZ)
            there_s = (columns[start] / SEQUENCE_HZ, (columns[stop - 1] + 1) / SEQUENCE_HZ)
            episodes = Segment(*here_s), Segment(*there_s)
            found.append(Difference(feature, reference_s, other_s, *episodes, excess_s))
    return sorted(found, key=lambda one: one.here.start_s)


def short_names(reference: str, other: str) -> tuple[str, str]:
    """What tells two recordings apart: the ends of their names, or the folders before them."""
    first, second = (PurePosixPath(name or "motion") for name in (reference, other))
    while first.name == second.name and first.parent.name and second.parent.name:
        first, second = first.parent, second.parent
    if first.name == second.name:
        return f"{first.name} (first)", f"{second.name} (second)"
    return first.name, second.name


def summarise(
    differences: Sequence[Difference],
    names: tuple[str, str],
    durations_s: tuple[float, float],
) -> list[str]:
    """What differs most, a line a feature, under how long both last."""
    lasts = (
        f"{name} lasts {length:.1f} s" for name, length in zip(names, durations_s, strict=True)
    )
    lines = [", ".join(lasts)]
    groups: list[tuple[float, str]] = []
    ordered = sorted(differences, key=lambda one: (one.feature, one.kind))
    for _, group in groupby(ordered, key=lambda one: (one.feature, one.kind)):
        several = list(group)
        text = _phrase(several, names[1])
        groups.append((-sum(abs(one.excess_s) for one in several), text))
    lines += [text for _, text in sorted(groups)[:_MOST_LINES]]
    return lines if groups else [*lines, "no feature differs by a tenth of a second or more"]


def _phrase(several: Sequence[Difference], other: str) -> str:
    """A line on the differences of one kind in one feature."""
    name = FULL_BODY.features[several[0].feature].name
    total = abs(sum(one.other_s - one.reference_s for one in several))
    what = {
        "longer": f"{name} {total:.1f} s longer in {other}",
        "shorter": f"{name} {total:.1f} s shorter in {other}",
        "only": f"{name} for {total:.1f} s in {other} only",
        "never": f"{name} for {total:.1f} s, not so in {other}",
    }[several[0].kind]
    return what if len(several) == 1 else f"{what} ({len(several)} times)"


def _lanes(differences: Sequence[Difference], other: str) -> list[dict[str, Any]]:
    """Differences as labels, a lane for each part of the body, with what stands beside them."""
    lanes = []
    for group, name in _GROUPS.items():
        rows: list[list[Any]] = []
        whys: list[dict[str, Any]] = []
        for one in differences:
            if FULL_BODY.features[one.feature].group != group:
                continue
            start, end = round(float(one.here.start_s), 3), round(float(one.here.end_s), 3)
            rows.append([_phrase([one], other), start, end, None, None, None, len(whys)])
            lines = [
                f"holds for {one.reference_s:.2f} s of {start:.2f}–{end:.2f} s",
                f"in {other} for {one.other_s:.2f} s of "
                f"{one.there.start_s:.2f}–{one.there.end_s:.2f} s",
            ]
            failed = [[one.feature, 1, start, end, 1.0]]
            whys.append({"lines": lines, "held": [], "failed": failed})
        lanes.append(
            {"name": f"{name} differs", "truth": False, "labels": rows, "unassessed": [],
             "nearest": "", "whys": whys}
        )  # fmt: skip
    return lanes


# -- along the alignment ------------------------------------------------------------------


def _values(sequence: FeatureSequence) -> Floats:
    """Features as numbers, shape (frames, features): unknown ones are near both."""
    return np.where(sequence.known_features != 0, sequence.features, _UNKNOWN).astype(float)


def _cells(warp: Floats, n_other: int) -> tuple[Integers, Integers]:
    """Pairs of frames that meet, so that each frame of both is in one."""
    at = np.rint(warp * SEQUENCE_HZ).astype(np.int64)
    stops = np.append(at[1:], n_other)
    n_cells = np.maximum(stops - at, 1)
    rows = np.repeat(np.arange(len(at)), n_cells)
    offsets = np.arange(len(rows)) - np.repeat(np.cumsum(n_cells) - n_cells, n_cells)
    return rows, np.minimum(at[rows] + offsets, n_other - 1)


def _episodes(holds: Bools) -> list[tuple[int, int]]:
    """Runs of True, over short breaks."""
    joined: list[tuple[int, int]] = []
    for start, stop in find_runs(holds).tolist():
        if joined and start - joined[-1][1] <= _MOST_BREAK:
            joined[-1] = (joined[-1][0], stop)
        else:
            joined.append((start, stop))
    return joined


def _states(reference: FeatureSequence, other: FeatureSequence, warp: Floats) -> Integers:
    """Per feature and frame of the reference in which of both it holds, (features, frames)."""
    at = np.minimum(np.rint(warp * SEQUENCE_HZ).astype(np.int64), len(other) - 1)
    here, there = reference.features != 0, other.features[at] != 0
    states = np.select([here & there, here, there], [_BOTH, _REFERENCE_ONLY, _OTHER_ONLY], _NEITHER)
    known = (reference.known_features != 0) & (other.known_features[at] != 0)
    states[~known] = _UNSEEN
    return states.T.astype(np.int64)


def _sparse(warp: Floats) -> list[list[float]]:
    """Seconds of both, every tenth of a second."""
    at = np.unique(np.append(np.arange(0, len(warp), 3), len(warp) - 1))
    points: list[list[float]] = np.round(np.column_stack([at / SEQUENCE_HZ, warp[at]]), 3).tolist()
    return points
