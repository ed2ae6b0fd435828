"""`motionary live` and `motionary replay`: labels while a motion goes on."""

import sys
import time
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli import screen
from motionary.cli.options import wrong
from motionary.cli.recordings import read_recording
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.live import LivePeople, PersonEvent, Source

# What is wrong with a sender's lines is told so often, then only counted.
_MOST_TOLD = 5
_LOOPBACK = "127.0.0.1"


@dataclass(frozen=True, kw_only=True)
class LiveOptions:
    """What poses are labelled with, and where they come from."""

    library: Annotated[
        str,
        typer.Option(
            metavar="LIB",
            help="A folder that `motionary learn` wrote; everyday is the library that ships.",
        ),
    ] = "everyday"
    rate_hz: Annotated[
        float | None,
        typer.Option(
            "--rate-hz", min=1.0, metavar="HZ", help="Poses a second, where no line says it."
        ),
    ] = None
    skeleton: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Skeleton of poses that list joints without names: smpl, ..."
        ),
    ] = None
    at_most_false: Annotated[
        float | None,
        typer.Option(
            metavar="PER_MINUTE",
            help="With the threshold at which so many false labels a minute are expected.",
        ),
    ] = None
    final: Annotated[
        bool, typer.Option("--final", help="Print labels only once they are final.")
    ] = False
    port: Annotated[
        int | None,
        typer.Option(
            min=0, max=65535, metavar="N", help="Take poses by websockets; 0 is any free port."
        ),
    ] = None
    address: Annotated[
        str,
        typer.Option(metavar="IP", help="Listen there; by default only to this computer."),
    ] = _LOOPBACK


def live(options: LiveOptions) -> int:
    """Label motion while it goes on: poses in as lines of JSON, events out as lines of JSON.

    Events are "provisional" when a label is foreseen, "revised", "withdrawn", and "final";
    "unassessed" tells of a segment of which too little was seen to judge.

    motionary replay take.bvh | motionary live
    motionary live --port 8765
    """
    from motionary.live import LivePeople, PipeSource, WebSocketSource
    from motionary.models.library import open_library
    from motionary.skeletons import named_mapping

    if options.port is None and options.address != _LOOPBACK:
        raise wrong("--address", "needs --port: from stdin nobody else can send")
    if options.skeleton is not None:
        named_mapping(options.skeleton)
    people = LivePeople(
        open_library(options.library),
        rate_hz=options.rate_hz,
        skeleton=options.skeleton,
        at_most_false_per_min=options.at_most_false,
    )
    source: Source
    if options.port is None:
        if sys.stdin.isatty():
            screen.warn("waiting for poses from stdin, lines of JSON; Ctrl-D ends")
        # Bytes that are no text end no stream.
        source = PipeSource(getattr(sys.stdin, "buffer", sys.stdin))
    else:
        source = WebSocketSource(options.port, address=options.address, tell=screen.warn)
        screen.warn(f"listening to ws://{options.address}:{source.port}; Ctrl-C ends")
    return _run(people, source, final_only=options.final)


def replay(
    recording: Annotated[str, typer.Argument(metavar="RECORDING", help="The recording to play.")],
    speed: Annotated[
        float, typer.Option(min=0.0, metavar="TIMES", help="How fast; 0 is as fast as possible.")
    ] = 1.0,
    *,
    reading: ReadOptions,
) -> None:
    """Send a recording as poses, at its own speed, as `motionary live` takes them.

    motionary replay take.bvh | motionary live
    """
    from pathlib import Path

    from motionary.live import write_lines

    motion = read_recording(Path(recording), reading)
    begin = time.monotonic()
    for i, line in enumerate(write_lines(motion)):
        # The first line says what all poses have in common.
        due = begin + max(i - 1, 0) / (motion.rate_hz * speed) if speed else begin
        time.sleep(max(0.0, due - time.monotonic()))
        sys.stdout.write(line + "\n")
        sys.stdout.flush()


def _run(people: "LivePeople", source: "Source", *, final_only: bool) -> int:
    """Label what a source gives until it ends; 1 if some lines were of no use."""
    wrong: Counter[str] = Counter()
    n_wrong = 0

    def give(events: "list[PersonEvent]") -> None:
        for event in events:
            if final_only and event.event.status not in ("final", "unassessed"):
                continue
            content = event.as_json()
            screen.print_json(content)
            source.send(content)
        sys.stdout.flush()

    try:
        for sender, line in source.lines():
            if line is None:
                give(people.leave(sender))
                wrong.pop(sender, None)
                continue
            try:
                give(people.push(line, sender=sender))
            except InvalidInput as error:
                n_wrong += 1
                wrong[sender] += 1
                if wrong[sender] <= _MOST_TOLD:
                    screen.warn(f"{f'sender {sender}' if sender else 'a line'}: {error}")
    except KeyboardInterrupt:
        screen.warn("stopped; what is left becomes final")
    give(people.finish())
    source.close()
    if n_wrong:
        screen.warn(f"{n_wrong} line{' was' if n_wrong == 1 else 's were'} of no use")
    return 1 if n_wrong else 0
