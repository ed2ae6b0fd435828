"""`motionary duplicates`: which files hold the same motion?"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli import STOPPED_BY_KEYBOARD, screen
from motionary.cli.indexed import IndexOptions, Opened, open_recordings
from motionary.cli.inputs import read_as_told
from motionary.cli.options import AsJson, Jobs, LibraryDefault, ReadingOptions

if TYPE_CHECKING:
    from motionary.io import ReadOptions
    from motionary.motion import Motion
    from motionary.retrieval.duplicates import DuplicateResult, Stretch

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
            help="Least surprise of what two recordings share.",
        ),
    ],
    index: IndexOptions,
    jobs: Jobs,
    reading: ReadingOptions,
) -> int:
    """Find the same motion in different files: on other rigs, at other rates, cut, mirrored.

    Bits say how surprising it is that the relations of both change together; where hardly
    anything changes there are none. Agreement, at most 1, is that of the accelerations: it
    tells a copy from a motion that somebody did twice.

    motionary duplicates recordings/
    motionary duplicates new-delivery/ archive/
    """
    from motionary.features import FULL_BODY
    from motionary.retrieval.duplicates import Comparing, find_duplicates

    told = reading.reading()
    sides = [
        open_recordings([side], index, reading=told, feature_set=FULL_BODY, jobs=jobs)
        for side in (folder, other)
        if side is not None
    ]
    readers = [_reader(side, told) for side in sides]
    result = find_duplicates(
        sides[0].collection,
        sides[1].collection if other else None,
        read=readers[0],
        read_right=readers[-1],
        comparing=Comparing(least_bits=least_bits),
    )
    if as_json:
        _say_json(result)
    else:
        _say(result)
    for failure in result.failures:
        screen.warn(f"{failure.item}: {failure.error}")
    if any(side.is_stopped for side in sides):
        return STOPPED_BY_KEYBOARD
    complete = all(side.is_complete for side in sides) and not result.failures
    return 0 if complete and result.duplicates else 1


def _reader(opened: Opened, reading: "ReadOptions") -> "Callable[[str], Motion]":
    return lambda name: read_as_told(opened.files[name], reading)


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


def _to_json(segment: "Stretch", prefix: str) -> dict[str, object]:
    return {
        f"{prefix}recording": segment.recording,
        f"{prefix}start_s": segment.start_s,
        f"{prefix}end_s": segment.end_s,
    }


def _say(result: "DuplicateResult") -> None:
    rows = []
    for found in result.duplicates:
        places = [
            text
            for segment in (found.left, found.right)
            for text in (segment.recording, f"{segment.start_s:.2f}", f"{segment.end_s:.2f}")
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
