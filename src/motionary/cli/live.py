"""`motionary live` and `motionary replay`: labels while a motion goes on."""

import signal
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

from motionary.cli import screen
from motionary.cli.options import argument, declare, flag, option, wrong
from motionary.cli.recordings import open_library, read_recording
from motionary.errors import InvalidInput, UnwritableFile
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.live import LivePeople, OscSender, PageServer, PersonEvent, Source

# What is wrong with a sender's lines is told so often, then only counted.
_MOST_TOLD = 5
_LOOPBACK = "127.0.0.1"
# State is written so often, in seconds: a power cut loses no more.
_SAVED_EACH_S = 60.0

Sent = TypeVar("Sent")


@dataclass(frozen=True, kw_only=True)
class LiveOptions:
    """What poses are labelled with, and where they come from."""

    library: str = option(
        "--library LIB",
        "A folder that `motionary learn` wrote; everyday is the library that ships.",
        "everyday",
    )
    rate_hz: float | None = option("--rate HZ", "Poses a second, where no line says it.", min=1.0)
    skeleton: str | None = option(
        "--skeleton NAME", "Skeleton of poses that list joints without names: smpl, ..."
    )
    at_most_false: float | None = option(
        "--at-most-false PER_MINUTE",
        "With the threshold at which so many false labels a minute are expected.",
    )
    page: int | None = option(
        "--page N",
        "Show poses and labels in a browser of this computer, at http://127.0.0.1:N/; 0 is any "
        "free port.",
        min=0,
        max=65535,
    )
    state: Path | None = option(
        "--state FILE",
        "Go on from there if it exists; keep there, each minute and at the end, what is not final.",
    )
    final: bool = flag("--final", "Print labels only once they are final.")
    port: int | None = option(
        "--port N", "Take poses by websockets; 0 is any free port.", min=0, max=65535
    )
    osc: int | None = option(
        "--osc N",
        "Take poses of VMC, by OSC; avatar programs send them to port 39539.",
        min=0,
        max=65535,
    )
    osc_to: str | None = option(
        "--osc-to [IP:]N", "Send events by OSC to a program that listens at this port."
    )
    address: str = option(
        "--address IP", "Listen there; by default only to this computer.", _LOOPBACK
    )


def live(options: LiveOptions) -> int:
    """Label motion while it goes on: poses in as lines of JSON, events out as lines of JSON.

    Events are "provisional" when a label is foreseen, "revised", "withdrawn", and "final";
    "unassessed" tells of a segment of which too little was seen to judge.

    motionary replay take.bvh | motionary live
    motionary live --port 8765
    motionary live --osc 39539 --osc-to 9000 --page 8080
    """
    from motionary.live import VMC_HZ, LivePeople, OscSender, PageServer
    from motionary.skeletons import named_mapping

    if options.port is None and options.osc is None and options.address != _LOOPBACK:
        raise wrong("--address", "needs --port or --osc: from stdin nobody else can send")
    if options.port is not None and options.osc is not None:
        raise wrong("--osc", "poses come by OSC or by websockets; give --osc or --port")
    if options.skeleton is not None:
        named_mapping(options.skeleton)
    people = LivePeople(
        open_library(options.library),
        rate_hz=options.rate_hz or (VMC_HZ if options.osc is not None else None),
        skeleton=options.skeleton,
        at_most_false_per_min=options.at_most_false,
    )
    if options.state is not None and options.state.exists():
        people.resume(options.state)
    listeners: list[OscSender | PageServer] = []
    if options.osc_to is not None:
        listeners.append(_osc_sender(options.osc_to, "--osc-to"))
    page = None if options.page is None else PageServer(options.page, tell=screen.warn)
    if page is not None:
        screen.warn(f"the page is http://{_LOOPBACK}:{page.port}/")
        listeners.append(page)
    labelling = _Labelling(
        people, _open(options), listeners, page, final_only=options.final, state=options.state
    )
    return labelling.run()


def _open(options: LiveOptions) -> "Source":
    """Where poses come from."""
    from motionary.live import OscSource, PipeSource, WebSocketSource

    if options.osc is not None:
        by_osc = OscSource(options.osc, address=options.address, tell=screen.warn)
        screen.warn(f"listening to OSC at {options.address}:{by_osc.port}; Ctrl-C ends")
        return by_osc
    if options.port is None:
        if sys.stdin.isatty():
            screen.warn("waiting for poses from stdin, lines of JSON; Ctrl-D ends")
        # Bytes that are no text end no stream.
        return PipeSource(getattr(sys.stdin, "buffer", sys.stdin))
    source = WebSocketSource(options.port, address=options.address, tell=screen.warn)
    screen.warn(f"listening to ws://{options.address}:{source.port}; Ctrl-C ends")
    return source


def _osc_sender(place: str, option: str) -> "OscSender":
    """What sends OSC to a port, of this computer unless an address stands before it."""
    from motionary.live import OscSender

    address, _, port = place.rpartition(":")
    if not (port.isdecimal() and 0 < int(port) < 65536):
        raise wrong(option, f"a port from 1 to 65535, or an address and one (IP:N), got {place!r}")
    return OscSender(int(port), address=address.strip("[]") or _LOOPBACK, tell=screen.warn)


def replay(
    recording: Annotated[str, argument("RECORDING", "The recording to play.")],
    speed: Annotated[
        float, declare("--speed TIMES", "How fast; 0 is as fast as possible.", min=0.0)
    ] = 1.0,
    to: Annotated[
        Literal["lines", "osc"],
        declare("--to", "Lines of JSON to stdout, or messages of VMC by OSC."),
    ] = "lines",
    port: Annotated[
        str | None, declare("--port [IP:]N", "Where OSC is taken; 39539 of this computer.")
    ] = None,
    *,
    reading: ReadOptions,
) -> int:
    """Send a recording as poses, at its own speed, as `motionary live` takes them.

    motionary replay take.bvh | motionary live
    motionary replay take.bvh --to osc
    """
    from motionary.live import VMC_PORT, write_lines, write_messages

    if to == "lines" and port is not None:
        raise wrong("--port", "goes with --to osc: lines are written to stdout")
    if to == "osc" and not speed:
        raise wrong("--speed", "OSC takes no more than arrives in time; give one above 0")
    motion = read_recording(Path(recording), reading)
    if to == "lines":
        # The first line says what all poses have in common.
        for line in _paced(write_lines(motion), motion.rate_hz * speed, n_before=1):
            sys.stdout.write(line + "\n")
            sys.stdout.flush()
        return 0
    sender = _osc_sender(port or str(VMC_PORT), "--port")
    for messages in _paced(write_messages(motion), motion.rate_hz * speed):
        sender.send(messages)
    sender.close()
    return 1 if sender.is_refused else 0


def _paced(things: "Iterable[Sent]", hz: float, *, n_before: int = 0) -> "Iterator[Sent]":
    """Things, so many a second after the first few; as fast as possible if that is 0."""
    begin = time.monotonic()
    for i, one in enumerate(things):
        if hz:
            time.sleep(max(0.0, begin + max(i - n_before, 0) / hz - time.monotonic()))
        yield one


class _Interrupts:
    """Ctrl-C between lines: what is half done can neither be kept nor become final.

    A second one waits for nothing.
    """

    def __init__(self) -> None:
        self._is_busy = self._is_due = False

    @contextmanager
    def taken(self, *, by_system: bool) -> Iterator[None]:
        """Take Ctrl-C, and what ends a service in the same way, where something is to be kept."""
        signals = [signal.SIGINT, signal.SIGTERM] if by_system else [signal.SIGINT]
        before = {
            # Ignored, as by `nohup`, they stay so.
            one: signal.signal(one, self._stop)
            for one in signals
            if signal.getsignal(one) is not signal.SIG_IGN
        }
        try:
            yield
        finally:
            for one, handler in before.items():
                signal.signal(one, handler)

    @contextmanager
    def held(self) -> Iterator[None]:
        """Let what is done here be done before the end."""
        self._is_busy = True
        try:
            yield
        finally:
            self._is_busy = False
        if self._is_due:
            raise KeyboardInterrupt

    def _stop(self, *_: object) -> None:
        if not self._is_busy or self._is_due:
            raise KeyboardInterrupt
        self._is_due = True


class _Labelling:
    """Labels of what a source gives, printed and given to who listens.

    Parameters
    ----------
    people : label what comes
    source : gives it
    listeners : get each event
    page : gets each pose
    final_only : whether what is not final is kept back
    state : file that keeps what is not final
    """

    def __init__(
        self,
        people: "LivePeople",
        source: "Source",
        listeners: "Sequence[OscSender | PageServer]",
        page: "PageServer | None",
        *,
        final_only: bool,
        state: Path | None,
    ) -> None:
        self._people, self._source, self._listeners = people, source, listeners
        self._page, self._final_only, self._state = page, final_only, state
        self._saved_s = time.monotonic()
        self._lines: Counter[str] = Counter()
        self._wrong: Counter[str] = Counter()
        self._n_wrong = 0

    def run(self) -> int:
        """Label until no more comes; 1 if some lines were of no use."""
        # Where it cannot be written one learns so before the work.
        self._save()
        interrupts = _Interrupts()
        try:
            with interrupts.taken(by_system=self._state is not None):
                for sender, line in self._source.lines(self._people.senders):
                    with interrupts.held():
                        self._take(sender, line)
                    if time.monotonic() - self._saved_s > _SAVED_EACH_S:
                        self._save_or_warn()
        except KeyboardInterrupt:
            what = "becomes final" if self._state is None else f"is kept in {self._state}"
            screen.warn(f"stopped; what is left {what}")
        if self._state is None:
            self._give(self._people.finish())
        self._save()
        self._source.close()
        for one in self._listeners:
            one.close()
        n = self._n_wrong
        if n:
            screen.warn(f"{n} line{' was' if n == 1 else 's were'} of no use")
        return 1 if n else 0

    def _save(self) -> None:
        if self._state is not None:
            self._people.save(self._state)
            self._saved_s = time.monotonic()

    def _save_or_warn(self) -> None:
        """Labels go on while a disk is full; the state is written again when it is due again."""
        try:
            self._save()
        except UnwritableFile as error:
            screen.warn(f"{error}; labels go on, the state is written again later")
            self._saved_s = time.monotonic()

    def _take(self, sender: str, line: "str | bytes | None") -> None:
        if line is None:
            self._give(self._people.leave(sender))
            self._wrong.pop(sender, None)
            self._lines.pop(sender, None)
            return
        self._lines[sender] += 1
        try:
            events = self._people.push(line, sender=sender)
            if self._page is not None and self._people.pose is not None:
                self._page.show(self._people.pose)
            self._give(events)
        except InvalidInput as error:
            self._n_wrong += 1
            self._wrong[sender] += 1
            if self._wrong[sender] <= _MOST_TOLD:
                place = f"line {self._lines[sender]}"
                screen.warn(f"{f'sender {sender}, {place}' if sender else place}: {error}")

    def _give(self, events: "list[PersonEvent]") -> None:
        for event in events:
            if self._final_only and event.event.status not in ("final", "unassessed"):
                continue
            content = event.as_json()
            screen.print_json(content)
            self._source.send(content)
            for one in self._listeners:
                one.send_event(content)
        sys.stdout.flush()
