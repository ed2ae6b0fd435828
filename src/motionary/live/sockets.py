"""Websockets: poses that arrive by them, and the live page that they reach.

The page is a player in a browser, which poses and labels reach by websocket. One port serves it
and what it shows, to browsers of this computer only: a page from elsewhere may not connect.
"""

import json
import logging
import queue
import re
import secrets
import threading
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from motionary.errors import InvalidInput
from motionary.live.poses import LONGEST_LINE
from motionary.live.sources import (
    LOOPBACK,
    MOST_WAITING,
    Arrival,
    Tell,
    Waiting,
    describe_place,
    tell_if_open,
)

if TYPE_CHECKING:
    from motionary.features.body import Floats
    from motionary.live.people import PersonPose

# A longer message is no pose, nor several.
_LONGEST = 1_000_000
_CLOSING_S = 2.0
# A page of any other origin that a browser shows could read what a body does.
_ORIGINS = (None, re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?"))
# What a page that is opened later is told of the past.
_MOST_PAST = 1000
# Bodies that are remembered; who comes after takes the place of who came first.
_MOST_BODIES = 64
# Times of poses are sums of parts of a second.
_SLACK_S = 1e-3


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
        _check_installed("poses by websocket need", ", or send lines of JSON to stdin")
        self._tell = tell
        self._connections = _Connections("sender", tell)
        bound, self.port = self._connections.serve(
            self._receive, address, port, "--port", max_size=_LONGEST
        )
        self._waiting = Waiting(
            tell,
            f"nothing has come to port {self.port} so far; do poses go there, by ws:// and not by wss://?",
        )
        tell_if_open(bound, address, tell)
        self._connections.begin()

    def lines(self, awaited: Collection[str] = ()) -> Iterator[Arrival]:
        """Sender and line, until this is closed; no line: it has gone or is silent."""
        return self._waiting.take(awaited)

    def send(self, event: Mapping[str, Any]) -> None:
        """Give an event to all that are connected."""
        self._connections.send(json.dumps(event, allow_nan=False))

    def close(self) -> None:
        """Give what waits to those that are connected, and listen no more."""
        self._waiting.close()
        self._connections.close(waits_s=_CLOSING_S)

    def _receive(self, connection: Any) -> None:
        from websockets.exceptions import ConnectionClosed

        number, reason = 0, ""
        try:
            with self._connections.enter(connection) as number:
                self._tell(f"sender {number} is connected")
                for message in connection:
                    # Several poses may come in one message.
                    for line in message.split(b"\n" if isinstance(message, bytes) else "\n"):
                        if line.strip():
                            self._waiting.put((str(number), line[: LONGEST_LINE + 1]))
        except ConnectionClosed as error:
            reason = f" ({error})"
        finally:
            self._waiting.put((str(number), None))
            self._tell(f"sender {number} is gone{reason}")


class PageServer:
    """A page for browsers of this computer that shows poses and labels as they come.

    Parameters
    ----------
    port : 0 takes a free one
    tell : is given what happens

    Attributes
    ----------
    port : the one that is listened to

    Raises
    ------
    InvalidInput
        If the package websockets is not installed, or the port is taken.
    """

    def __init__(self, port: int, *, tell: Tell) -> None:
        _check_installed("a live page needs")
        # Late, as further down: it loads all that searches.
        from motionary.reporting import build_page

        self._connections = _Connections("page", tell)
        self._run = secrets.token_hex(4)
        self._bodies: dict[int, _Body] = {}
        self._past = deque[str](maxlen=_MOST_PAST)
        _, self.port = self._connections.serve(
            self._receive, LOOPBACK, port, "--page", process_request=self._respond
        )
        address = f"ws://{LOOPBACK}:{self.port}/watch"
        self._page = build_page({"features": []}, [], title="motionary live", live=address).text
        self._connections.begin()

    def show(self, pose: "PersonPose") -> None:
        """Give a pose to all pages, at most so many a second as they draw."""
        from motionary.reporting import PAGE_HZ, UNIT_M

        body = self._bodies.get(pose.recording)
        if body is None:
            body = _Body()
            # Pages that connect meanwhile read them in a thread of their own.
            with self._connections.lock:
                if len(self._bodies) >= _MOST_BODIES:
                    del self._bodies[next(iter(self._bodies))]
                self._bodies[pose.recording] = body
        elif pose.time_s - body.shown_s < 1 / PAGE_HZ - _SLACK_S:
            return
        body.shown_s = pose.time_s
        if body.sees_more(pose.positions):
            body.description = _describe(pose, body.first)
            self._connections.send(body.description)
        if not body.description:
            return
        known = np.asarray(np.isfinite(pose.positions).all(axis=1)).tolist()
        rows = np.rint(np.nan_to_num(pose.positions) / UNIT_M).astype(int).tolist()
        seen = [row if one else None for row, one in zip(rows, known, strict=True)]
        self._connections.send(_text({"pose": [pose.recording, round(pose.time_s, 3), seen]}))

    def send_event(self, event: Mapping[str, Any]) -> None:
        """Give an event to all pages, as `motionary live` prints it."""
        text = _text({"event": event})
        # At once: who connects meanwhile gets it from the past or now, not twice.
        with self._connections.lock:
            # Lengths of time that were not seen are of the past, too.
            if event["event"] in ("final", "unassessed"):
                self._past.append(text)
            self._connections.send(text)

    def close(self) -> None:
        """Serve the page no more."""
        self._connections.close()

    def _respond(self, connection: Any, request: Any) -> Any:
        """The page, to whoever asks for it; None lets a websocket begin."""
        path = request.path.partition("?")[0]
        if path == "/watch":
            return None
        if path != "/":
            return connection.respond(204 if path == "/favicon.ico" else 404, "")
        response = connection.respond(200, self._page)
        del response.headers["Content-Type"]
        response.headers["Content-Type"] = "text/html; charset=utf-8"
        response.headers["Cache-Control"] = "no-store"
        response.headers["X-Frame-Options"] = "DENY"
        return response

    def _receive(self, connection: Any) -> None:
        from websockets.exceptions import ConnectionClosed

        # A page has nothing to say.
        with suppress(ConnectionClosed), self._connections.enter(connection, self._tell_past):
            for _ in connection:
                pass

    def _tell_past(self) -> str:
        """One message: what comes meanwhile has room to wait, and comes after."""
        known = [body.description for body in self._bodies.values() if body.description]
        return f"[{','.join((_text({'live': self._run}), *known, *self._past))}]"


class _Body:
    """What pages know of one recording's body."""

    def __init__(self) -> None:
        self.shown_s = 0.0
        self.description = ""
        #: Of each joint, where it was first seen.
        self.first: Floats = np.empty(0)

    def sees_more(self, positions: "Floats") -> bool:
        """Whether a pose shows joints that were not seen before."""
        if not len(self.first):
            self.first = np.full_like(positions, np.nan)
        new = np.isnan(self.first).any(axis=1) & ~np.isnan(positions).any(axis=1)
        self.first[new] = positions[new]
        return bool(new.any())


def _describe(pose: "PersonPose", first: "Floats") -> str:
    """The body of a recording as a page has it."""
    from motionary.reporting import describe_body

    name = pose.person or (f"sender {pose.sender}" if pose.sender else "motion")
    content = {"number": pose.recording, "name": name, "rate_hz": pose.rate_hz}
    return _text({"recording": content | describe_body(first[np.newaxis])})


def _text(message: Mapping[str, Any]) -> str:
    return json.dumps(message, allow_nan=False, separators=(",", ":"))


# -- one port -------------------------------------------------------------------------------


def _check_installed(need: str, otherwise: str = "") -> None:
    try:
        import websockets.sync.server  # noqa: F401
    except ImportError as error:
        raise InvalidInput(
            f"{need} the package websockets ({error}); pip install 'motionary[live]'{otherwise}"
        ) from error


class _Connections:
    """Connections to one port, counted from 1, and texts that go to all of them.

    Parameters
    ----------
    called : what connects, in what is told
    """

    def __init__(self, called: str, tell: Tell) -> None:
        self._called, self._tell = called, tell
        self._listeners: dict[int, _Listener] = {}
        self._n_connections = 0
        #: Is held while listeners come and go; texts may be sent within.
        self.lock = threading.RLock()

    def serve(
        self, receive: Any, address: str, port: int, option: str, **settings: Any
    ) -> tuple[str, int]:
        """Take a port, for `begin` to listen to; its address and number come back."""
        from websockets.sync.server import serve

        logger = logging.Logger("motionary.live", logging.DEBUG)
        logger.addHandler(_Failures(self._tell))
        try:
            self._server = serve(
                receive, address, port, origins=_ORIGINS, logger=logger, **settings
            )
        except OSError as error:
            raise InvalidInput(describe_place(error, address, port, option)) from error
        bound, own = self._server.socket.getsockname()[:2]
        return bound, int(own)

    def begin(self) -> None:
        """Listen, in a thread."""
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    @contextmanager
    def enter(self, connection: Any, greet: Callable[[], str] | None = None) -> Iterator[int]:
        """Number of a connection, which gets what is sent, after a greeting, until it leaves."""
        with self.lock:
            self._n_connections += 1
            number = self._n_connections
            listener = _Listener(connection, f"{self._called} {number}", self._tell)
            if greet is not None:
                listener.offer(greet())
            self._listeners[number] = listener
        try:
            yield number
        finally:
            with self.lock:
                del self._listeners[number]
            listener.end()

    def send(self, text: str) -> None:
        """Give a text to all that are connected."""
        with self.lock:
            for listener in self._listeners.values():
                listener.offer(text)

    def close(self, *, waits_s: float = 0.0) -> None:
        """Listen no more; what waits has so long to be sent."""
        with self.lock:
            listeners = list(self._listeners.values())
        for listener in listeners:
            listener.end()
        for listener in listeners:
            listener.thread.join(waits_s)
        # It waits for connections that may never answer.
        closing = threading.Thread(target=self._server.shutdown, daemon=True)
        closing.start()
        closing.join(waits_s)


class _Listener:
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


class _Failures(logging.Handler):
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
