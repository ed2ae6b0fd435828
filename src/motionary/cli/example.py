"""Which stretch of which recording is the example of a search?"""

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import typer

from motionary.cli.inputs import read_as_told

if TYPE_CHECKING:
    from motionary.features import FeatureSequence
    from motionary.io import ReadOptions
    from motionary.motion import Motion

#: Nine packed: below, hardly a relation changes, and everything is like everything.
SHORTEST_S = 0.3

# A duration is read off a table or a player, rounded.
_ROUNDING_S = 0.05


class Example(NamedTuple):
    """An example: its words, measured within the whole recording, and its frames."""

    packed: "FeatureSequence"
    motion: "Motion"

    @property
    def title(self) -> str:
        """Recording and seconds."""
        packed = self.packed
        start_s = (packed.recording.first_frame - self.motion.first_frame) / self.motion.rate_hz
        return f"{packed.source} {start_s:.2f}–{start_s + packed.duration_s:.2f} s"


def read_example(
    path: Path, *, from_s: float | None, to_s: float | None, reading: "ReadOptions"
) -> Example:
    """The stretch of a recording from one second to another; to its ends where left out."""
    from motionary.features import SEQUENCE_HZ, compute_features

    motion = read_as_told(path, reading).renamed(path.name)
    start_s, stop_s = _check(motion, from_s, to_s)
    packed = compute_features(motion)
    stop = min(round(stop_s * SEQUENCE_HZ), len(packed))
    start = min(round(start_s * SEQUENCE_HZ), stop - 1)
    return Example(packed.part(start, stop), motion)


def _check(motion: "Motion", from_s: float | None, to_s: float | None) -> tuple[float, float]:
    length = motion.duration_s
    start_s, stop_s = 0.0 if from_s is None else from_s, length if to_s is None else to_s
    inside = f"{motion.source} lasts from 0 to {length:.2f} s"
    if not 0 <= start_s < length:
        raise _wrong("--from", f"{inside}, got {start_s:g}")
    if not start_s < stop_s:
        raise _wrong("--to", f"must come after --from, got {start_s:g} to {stop_s:g}; {inside}")
    if stop_s > length + _ROUNDING_S:
        raise _wrong("--to", f"{inside}, got {stop_s:g}")
    stop_s = min(stop_s, length)
    if stop_s - start_s < SHORTEST_S:
        raise _wrong(
            "--from, --to",
            f"an example needs at least {SHORTEST_S:g} s to tell one motion from another, got "
            f"{stop_s - start_s:.2f} s; {inside}",
        )
    return start_s, stop_s


def _wrong(option: str, problem: str) -> typer.BadParameter:
    return typer.BadParameter(problem, param_hint=option)
