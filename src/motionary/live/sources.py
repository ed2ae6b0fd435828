"""Where poses come from and events go: lines of a file or a pipe, messages of OSC over UDP.

A source gives lines and takes events. What arrives faster than it is labelled waits in a
queue of bounded length; a websocket's sender (`sockets`) then has to wait, messages of OSC are
lost, and either is told once. Nobody waits for a listener: events that it does not take are lost
to it, which is told once, too.

By Open Sound Control poses of VMC come in and go out. Each event is a message /motionary/final (or
/provisional, /revised, /withdrawn, /unassessed) with label, id, number of the recording, start and
end in seconds, probability (-1 if unknown), sender and person.
"""

import errno
import ipaddress
import queue
import socket
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import IO, Any, Protocol

from motionary.errors import InvalidInput
from motionary.live.poses import LONGEST_LINE
from motionary.live.vmc import Message, VmcReader

#: Lines, and events of one listener, that wait at most.
MOST_WAITING = 256
#: Of a sender that is silent for longer, what is left becomes final.
SILENT_S = 10.0
#: This computer's own address: nobody else can send there.
LOOPBACK = "127.0.0.1"
# What is wrong with a sender's messages is told so often, then only counted.
_MOST_TOLD = 5
# Whether all is well is looked at so often.
_TICK_S = 0.5
# UDP takes no more in one piece.
_LONGEST = 65_536
_MOST_SENDERS = 256
# Messages of a bundle: more would not fit into one packet of a network.
_IN_BUNDLE = 12

Tell = Callable[[str], None]
#: Sender and line; None instead of a line if the sender has gone or is silent.
Arrival = tuple[str, str | bytes | None]


class Source(Protocol):
    """Lines of poses, each with the name of its sender, and a way back for events."""

    def lines(self, awaited: Collection[str] = ()) -> Iterator[Arrival]:
        """Sender and line, until no more come; no line: it has gone or is silent.

        Parameters
        ----------
        awaited : senders that were there before, and are expected to go on
        """

    def send(self, event: Mapping[str, Any]) -> None:
        """Give an event to whoever listens."""

    def close(self) -> None:
        """Give what waits to whoever listens, and end."""


class PipeSource:
    """Lines of a file or a pipe.

    Parameters
    ----------
    file : gives lines, of bytes or text
    """

    def __init__(self, file: IO[str] | IO[bytes]) -> None:
        self._file = file

    def lines(self, awaited: Collection[str] = ()) -> Iterator[Arrival]:
        """Sender and line; there is one sender."""
        # A file without line ends must not be read as a whole.
        while line := self._file.readline(LONGEST_LINE + 1):
            yield "", line

    def send(self, event: Mapping[str, Any]) -> None:
        """Nobody else listens."""

    def close(self) -> None:
        """Nothing waits."""


class Waiting:
    """Lines on their way from senders to who labels them, no more than a bounded number.

    Parameters
    ----------
    tell : is given what happens
    silence : what to tell when nothing has come for a while
    """

    def __init__(self, tell: Tell, silence: str) -> None:
        self._tell, self._silence = tell, silence
        self._arrivals = queue.Queue[Arrival](MOST_WAITING)
        self._is_slow = self.is_closed = False

    def put(self, arrival: Arrival) -> None:
        """Let a line wait for its turn, and its sender for room."""
        if self._arrivals.full():
            self._tell_slow("senders have to wait")
        while not self.is_closed:
            with suppress(queue.Full):
                self._arrivals.put(arrival, timeout=_TICK_S)
                return

    def offer(self, arrival: Arrival) -> None:
        """Let a line wait for its turn if there is room."""
        try:
            self._arrivals.put_nowait(arrival)
        except queue.Full:
            self._tell_slow("those that find no room are lost")

    def take(self, awaited: Collection[str]) -> Iterator[Arrival]:
        """Sender and line, until this is closed; no line: it has gone or is silent."""
        begin = time.monotonic()
        heard = dict.fromkeys(awaited, begin)
        has_any = False
        while not self.is_closed:
            # Without a limit of time no Ctrl-C would be heard on Windows.
            with suppress(queue.Empty):
                sender, line = self._arrivals.get(timeout=_TICK_S)
                has_any = True
                yield sender, line
                heard[sender] = time.monotonic()
                if line is None:
                    del heard[sender]
            now = time.monotonic()
            if not has_any and now - begin > SILENT_S:
                has_any = True
                self._tell(self._silence)
            for sender in [one for one, last in heard.items() if now - last > SILENT_S]:
                del heard[sender]
                yield sender, None

    def close(self) -> None:
        """End."""
        self.is_closed = True

    def _tell_slow(self, what: str) -> None:
        if not self._is_slow:
            self._is_slow = True
            self._tell(
                f"poses come faster than they can be labelled: {what}; send fewer a second, or "
                "one person only"
            )


def tell_if_open(bound: str, address: str, tell: Tell) -> None:
    """Tell that an address can be reached by others, where it can."""
    if not ipaddress.ip_address(bound).is_loopback:
        tell(
            f"{address} is open to the network: whoever reaches this computer there can send "
            "poses and read labels"
        )


def describe_place(error: OSError, address: str, port: int, option: str = "--port") -> str:
    """What is wrong with a place that cannot be listened to."""
    remedy = f"give another with {option}, or 0 for any that is free"
    if isinstance(error, socket.gaierror) or error.errno == errno.EADDRNOTAVAIL:
        remedy = "give an address of this computer with --address"
    reason = error.strerror or error
    return f"port {port} of {address} cannot be listened to ({reason}); {remedy}"


class OscSource:
    """Lines of poses of VMC, whose messages arrive by OSC over UDP; a sender is an address.

    Parameters
    ----------
    port : 0 takes a free one
    address : this computer's own unless another is asked for
    tell : is given what happens: wrong messages, that a sender is too fast

    Attributes
    ----------
    port : the one that is listened to

    Raises
    ------
    InvalidInput
        If the package python-osc is not installed, the port is taken, or the address is
        none of this computer.
    """

    def __init__(self, port: int, *, address: str = LOOPBACK, tell: Tell) -> None:
        _check_installed()
        self._tell, self._n_wrong = tell, 0
        self._socket = socket.socket(_family_of(address), socket.SOCK_DGRAM)
        try:
            self._socket.bind((address, port))
        except OSError as error:
            self._socket.close()
            raise InvalidInput(describe_place(error, address, port, "--osc")) from error
        self._socket.settimeout(_TICK_S)
        bound, self.port = self._socket.getsockname()[:2]
        tell_if_open(bound, address, tell)
        self._waiting = Waiting(
            tell, f"no pose has come to port {self.port} so far; does the sender send VMC there?"
        )
        threading.Thread(target=self._receive, daemon=True).start()

    def lines(self, awaited: Collection[str] = ()) -> Iterator[Arrival]:
        """Sender and line, until this is closed; no line: it is silent."""
        return self._waiting.take(awaited)

    def send(self, event: Mapping[str, Any]) -> None:
        """Whoever sends poses by OSC waits for no answer."""

    def close(self) -> None:
        """Listen no more."""
        self._waiting.close()
        self._socket.close()
        if self._n_wrong > _MOST_TOLD:
            self._tell(f"{self._n_wrong} messages were of no use")

    def _receive(self) -> None:
        readers: dict[str, VmcReader] = {}
        while not self._waiting.is_closed:
            try:
                content, (host, port, *_) = self._socket.recvfrom(_LONGEST)
            except OSError:
                # Silence; on Windows also that whoever was sent to has gone.
                continue
            sender = f"{host}:{port}"
            if sender not in readers and len(readers) >= _MOST_SENDERS:
                del readers[next(iter(readers))]
            reader = readers.setdefault(sender, VmcReader())
            try:
                for address, values in _parse(content):
                    for line in reader.push(address, values, arrived_s=time.monotonic()):
                        self._waiting.offer((sender, line))
            except InvalidInput as error:
                self._n_wrong += 1
                if self._n_wrong <= _MOST_TOLD:
                    self._tell(f"sender {sender}: {error}")


class OscSender:
    """Messages to programs that take OSC.

    Parameters
    ----------
    port, address : where they listen
    tell : is given that nobody takes them, once

    Attributes
    ----------
    is_refused : whether it is known that nobody took some of them

    Raises
    ------
    InvalidInput
        If the package python-osc is not installed, or there is no such address.
    """

    def __init__(self, port: int, *, address: str = LOOPBACK, tell: Tell) -> None:
        _check_installed()
        self._tell, self._place = tell, f"{address}:{port}"
        self._socket = socket.socket(_family_of(address), socket.SOCK_DGRAM)
        try:
            # Connected, it learns on most systems that nobody listens.
            self._socket.connect((address, port))
        except OSError as error:
            self._socket.close()
            raise InvalidInput(
                f"OSC cannot be sent to {self._place} ({error.strerror or error}); give an "
                "address and port of a program that takes it"
            ) from error
        self.is_refused = False

    def send(self, messages: Sequence[Message]) -> None:
        """Send messages, as bundles where there are several."""
        for start in range(0, len(messages), _IN_BUNDLE):
            try:
                self._socket.send(_build(messages[start : start + _IN_BUNDLE]))
            except OSError as error:
                if not self.is_refused:
                    self.is_refused = True
                    self._tell(
                        f"nobody takes OSC at {self._place} ({error.strerror or error}); is the "
                        "port right, and the program running?"
                    )

    def send_event(self, event: Mapping[str, Any]) -> None:
        """Send an event, as `motionary live` prints it."""
        probability = -1.0 if event["probability"] is None else float(event["probability"])
        values = [event["label"], event["id"], event["recording"]]
        values += [float(event["start_s"]), float(event["end_s"]), probability]
        self.send([(f"/motionary/{event['event']}", [*values, event["sender"], event["person"]])])

    def close(self) -> None:
        """Send no more."""
        self._socket.close()


def _check_installed() -> None:
    try:
        import pythonosc.osc_packet  # noqa: F401
    except ImportError as error:
        raise InvalidInput(
            f"OSC needs the package python-osc ({error}); pip install 'motionary[live]', or send "
            "lines of JSON to stdin"
        ) from error


def _parse(content: bytes) -> Iterator[Message]:
    """Messages of a packet: address and values."""
    from pythonosc.osc_packet import OscPacket

    try:
        messages = [one.message for one in OscPacket(content).messages]
    except Exception as error:
        # Strangers' bytes; the package raises what its parts raise.
        raise InvalidInput(f"no message of OSC, got {content[:40]!r}") from error
    for message in messages:
        yield message.address, list(message.params)


def _build(messages: Sequence[Message]) -> bytes:
    """A packet of one message, or a bundle of several."""
    from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
    from pythonosc.osc_message_builder import OscMessageBuilder

    built = []
    for address, values in messages:
        builder = OscMessageBuilder(address)
        for value in values:
            builder.add_arg(value)
        built.append(builder.build())
    if len(built) == 1:
        return built[0].dgram
    bundle = OscBundleBuilder(IMMEDIATELY)
    for one in built:
        bundle.add_content(one)
    return bundle.build().dgram


def _family_of(address: str) -> socket.AddressFamily:
    return socket.AF_INET6 if ":" in address else socket.AF_INET
