"""`motionary duplicates`: the same motion in different files."""

from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli import STOPPED_BY_KEYBOARD, screen
from motionary.cli.options import AsJson, LibraryDefault
from motionary.cli.recordings import IndexOptions, Opener, read_recording
from motionary.cli.workers import WorkOptions
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.retrieval.duplicates import DuplicateResult, Occurrence

_COLUMNS = (
    ">bits", ">agreement", "recording", ">start_s", ">end_s", "other", ">start_s", ">end_s", "",
)  # fmt: skip


def duplicates(
    folder: Annotated[str, typer.Argument(metavar="A", help="Folder or file of recordings.")],
    other: Annotated[
        str | None,
        typer.Argument(metavar="B", help="Recordings to compare with; those of A if left out."),
    ] = None,
    as_json: AsJson = False,
    *,
    least_bits: Annotated[
        float,
        typer.Option(
            "--bits",
            min=0.0,
            metavar="BITS",
            default_factory=LibraryDefault(
                "motionary.retrieval.duplicates:Comparing", "least_bits"
            ),
            help="Least self-information of what two recordings have in common.",
        ),
    ],
    index: IndexOptions,
    work: WorkOptions,
    reading: ReadOptions,
) -> int:
    """Find the same motion in different files: on other rigs, at other rates, cut, mirrored.

    Bits say how improbable it is that the features of both change together by chance; where
    hardly anything changes there are none. Agreement, at most 1, is that of the
    accelerations: it tells a copy from a motion that somebody did twice.

    motionary duplicates recordings/
    motionary duplicates new-delivery/ archive/
    """
    from motionary.features import FULL_BODY
    from motionary.retrieval.duplicates import Comparing, find_duplicates

    with work.open() as workers:
        opener = Opener(reading=reading, feature_set=FULL_BODY, jobs=workers)
        sides = [opener.open([side], index) for side in (folder, other) if side is not None]
        left, right = sides[0], sides[-1]
        result = find_duplicates(
            left.collection,
            right.collection if other else None,
            # Workers of a cluster run in other folders.
            read=partial(read_recording, reading=reading.absolute()),
            comparing=Comparing(least_bits=least_bits),
            locate=lambda name: left.files[name].absolute(),
            locate_right=(lambda name: right.files[name].absolute()) if other else None,
            jobs=workers,
        )
    if as_json:
        _say_json(result)
    else:
        _say(result)
    for failure in result.failures:
        screen.warn(f"{failure.item}: {failure.error}")
    if any(side.is_stopped for side in sides):
        return STOPPED_BY_KEYBOARD
    is_complete = all(side.is_complete for side in sides) and not result.failures
    return 0 if is_complete and result.duplicates else 1


def _say_json(result: "DuplicateResult") -> None:
    for found in result.duplicates:
        screen.print_json(
            {
                **_to_json(found.left, ""),
                **_to_json(found.right, "other_"),
                "mirrored": found.is_mirrored,
                "bits": round(found.bits, 1),
                "agreement": round(found.agreement, 4),
            }
        )


def _to_json(found: "Occurrence", prefix: str) -> dict[str, object]:
    return {
        f"{prefix}recording": found.recording.name,
        f"{prefix}start_s": found.segment.start_s,
        f"{prefix}end_s": found.segment.end_s,
    }


def _say(result: "DuplicateResult") -> None:
    rows = []
    for found in result.duplicates:
        places = [
            text
            for recording, (start_s, end_s) in (found.left, found.right)
            for text in (recording.name, f"{start_s:.2f}", f"{end_s:.2f}")
        ]
        side = "mirrored" if found.is_mirrored else ""
        rows.append((f"{found.bits:.0f}", f"{found.agreement:.2f}", *places, side))
    if rows:
        screen.print_table(_COLUMNS, rows)
    else:
        screen.say("no motion is in two of these recordings")
    if result.n_alike:
        screen.say(f"{result.n_alike} further pairs change alike, each performed on its own")
    if result.still:
        screen.say(f"{len(result.still)} recordings change too little to be told apart")
