"""Where poses come from: lines of a file or a pipe, websockets, or messages of OSC.

A source gives lines and takes events. What arrives faster than it is labelled waits in a
queue of bounded length; a websocket's sender then has to wait, messages of OSC are lost, and
either is told once. Nobody waits for a listener: events that it does not take are lost to it,
which is told once, too.
"""

import errno
import ipaddress
import json
import logging
import queue
import re
import socket
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from typing import IO, Any, Protocol

from motionary.errors import InvalidInput
from motionary.live.poses import LONGEST_LINE

#: Lines, and events of one listener, that wait at most.
MOST_WAITING = 256
#: Of a sender that is silent for longer, what is left becomes final.
SILENT_S = 10.0
#: What is wrong with a sender's lines is told so often, then only counted.
MOST_TOLD = 5
#: This computer's own address: nobody else can send there.
LOOPBACK = "127.0.0.1"
#: Whether all is well is looked at so often.
TICK_S = 0.5
# A longer message is no pose, nor several.
_LONGEST = 1_000_000
_CLOSING_S = 2.0
# A page of any other origin that a browser shows could read what a body does.
ORIGINS = (None, re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?"))

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


class WebSocketSource:
    """Lines that arrive by websockets; events go to all that are connected.

    Parameters
    ----------
    port : 0 takes a free one
    address : this computer's own unless another is asked for
    tell : is given what happens: who comes and goes, that a sender is too fast

    Attributes
    ----------
    port : the one that is listened to

    Raises
    ------
    InvalidInput
        If the package websockets is not installed, the port is taken, or the address is
        none of this computer.
    """

    def __init__(self, port: int, *, address: str = LOOPBACK, tell: Tell) -> None:
        try:
            from websockets.sync.server import serve
        except ImportError as error:
            raise InvalidInput(
                f"poses by websocket need the package websockets ({error}); "
                "pip install 'motionary[live]', or send lines of JSON to stdin"
            ) from error
        self._tell = tell
        self._listeners: dict[int, Listener] = {}
        self._lock = threading.Lock()
        self._n_connections = 0
        logger = logging.Logger("motionary.live", logging.DEBUG)
        logger.addHandler(Failures(tell))
        try:
            self._server = serve(
                self._receive, address, port, max_size=_LONGEST, origins=ORIGINS, logger=logger
            )
        except OSError as error:
            raise InvalidInput(describe_place(error, address, port)) from error
        bound, self.port = self._server.socket.getsockname()[:2]
        self._waiting = Waiting(
            tell,
            f"nothing has come to port {self.port} so far; do poses go there, by ws:// and not by wss://?",
        )
        tell_if_open(bound, address, tell)
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def lines(self, awaited: Collection[str] = ()) -> Iterator[Arrival]:
        """Sender and line, until this is closed; no line: it has gone or is silent."""
        return self._waiting.take(awaited)

    def send(self, event: Mapping[str, Any]) -> None:
        """Give an event to all that are connected."""
        text = json.dumps(event, allow_nan=False)
        with self._lock:
            listeners = list(self._listeners.values())
        for listener in listeners:
            listener.offer(text)

    def close(self) -> None:
        """Give what waits to those that are connected, and listen no more."""
        self._waiting.close()
        with self._lock:
            listeners = list(self._listeners.values())
        for listener in listeners:
            listener.end()
        for listener in listeners:
            listener.thread.join(_CLOSING_S)
        # It waits for connections that may never answer.
        closing = threading.Thread(target=self._server.shutdown, daemon=True)
        closing.start()
        closing.join(_CLOSING_S)

    def _receive(self, connection: Any) -> None:
        from websockets.exceptions import ConnectionClosed

        with self._lock:
            self._n_connections += 1
            number = self._n_connections
            listener = self._listeners[number] = Listener(
                connection, f"sender {number}", self._tell
            )
        self._tell(f"sender {number} is connected")
        reason = ""
        try:
            for message in connection:
                # Several poses may come in one message.
                for line in message.split(b"\n" if isinstance(message, bytes) else "\n"):
                    if line.strip():
                        self._waiting.put((str(number), line[: LONGEST_LINE + 1]))
        except ConnectionClosed as error:
            reason = f" ({error})"
        finally:
            with self._lock:
                del self._listeners[number]
            listener.end()
            self._waiting.put((str(number), None))
            self._tell(f"sender {number} is gone{reason}")


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
                self._arrivals.put(arrival, timeout=TICK_S)
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
                sender, line = self._arrivals.get(timeout=TICK_S)
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


class Listener:
    """Texts on their way to one connection, by a thread of their own."""

    def __init__(self, connection: Any, name: str, tell: Tell) -> None:
        self._connection, self._name, self._tell = connection, name, tell
        self._events = queue.Queue[str | None](MOST_WAITING)
        self._is_slow = False
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def offer(self, text: str) -> None:
        """Let a text wait to be sent, if there is room."""
        try:
            self._events.put_nowait(text)
        except queue.Full:
            if not self._is_slow:
                self._is_slow = True
                self._tell(
                    f"{self._name} does not read its events: those that do not wait for "
                    "it are lost to it"
                )

    def end(self) -> None:
        """Let the thread end when what waits has been sent."""
        # Where there is no room, the thread ends by the connection's end.
        with suppress(queue.Full):
            self._events.put_nowait(None)

    def _run(self) -> None:
        # Who has gone has gone; the others are still there.
        with suppress(Exception):
            while (text := self._events.get()) is not None:
                self._connection.send(text)


class Failures(logging.Handler):
    """Tells of connections that did not come about, in a line each."""

    def __init__(self, tell: Tell) -> None:
        super().__init__()
        self._tell, self._last = tell, ""

    def emit(self, record: logging.LogRecord) -> None:
        """Tell what a record of the log says of a connection."""
        from websockets.exceptions import InvalidHandshake

        # Refusals are logged for those only who trace everything.
        error = record.exc_info[1] if record.exc_info else None
        if not isinstance(error, ValueError | InvalidHandshake):
            return
        text = (
            f"a connection failed ({error}); programs connect by ws://, "
            "without TLS, and pages of a browser from this computer only"
        )
        # One that tries for hours is told once.
        if text != self._last:
            self._last = text
            self._tell(text)


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
