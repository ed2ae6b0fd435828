"""The live page: a player in a browser, which poses and labels reach by websocket.

One port serves the page and what it shows, to browsers of this computer only: a page from
elsewhere may not connect.
"""

import json
import logging
import secrets
import threading
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from motionary.errors import InvalidInput
from motionary.features.body import Floats
from motionary.live.people import PersonPose
from motionary.live.sources import (
    LOOPBACK,
    ORIGINS,
    Failures,
    Listener,
    Tell,
    describe_place,
)
from motionary.reporting import PAGE_HZ, UNIT_M, build_page, describe_body

# What a page that is opened later is told of the past.
_MOST_PAST = 1000
# Bodies that are remembered; who comes after takes the place of who came first.
_MOST_BODIES = 64
# Times of poses are sums of parts of a second.
_SLACK_S = 1e-3


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
        try:
            from websockets.sync.server import serve
        except ImportError as error:
            raise InvalidInput(
                f"a live page needs the package websockets ({error}); pip install 'motionary[live]'"
            ) from error
        self._tell = tell
        self._listeners: dict[int, Listener] = {}
        self._lock = threading.Lock()
        self._n_connections = 0
        self._run = secrets.token_hex(4)
        self._bodies: dict[int, _Body] = {}
        self._past = deque[str](maxlen=_MOST_PAST)
        logger = logging.Logger("motionary.live", logging.DEBUG)
        logger.addHandler(Failures(tell))
        try:
            self._server = serve(
                self._receive,
                LOOPBACK,
                port,
                origins=ORIGINS,
                process_request=self._respond,
                logger=logger,
            )
        except OSError as error:
            raise InvalidInput(describe_place(error, LOOPBACK, port, "--page")) from error
        self.port = int(self._server.socket.getsockname()[1])
        address = f"ws://{LOOPBACK}:{self.port}/watch"
        self._page = build_page({"features": []}, [], title="motionary live", live=address).text
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def show(self, pose: PersonPose) -> None:
        """Give a pose to all pages, at most so many a second as they draw."""
        body = self._bodies.get(pose.recording)
        if body is None:
            body = _Body()
            # Pages that connect meanwhile read them in a thread of their own.
            with self._lock:
                if len(self._bodies) >= _MOST_BODIES:
                    del self._bodies[next(iter(self._bodies))]
                self._bodies[pose.recording] = body
        elif pose.time_s - body.shown_s < 1 / PAGE_HZ - _SLACK_S:
            return
        body.shown_s = pose.time_s
        if body.sees_more(pose.positions):
            body.description = _describe(pose, body.first)
            self._send(body.description)
        if not body.description:
            return
        known = np.asarray(np.isfinite(pose.positions).all(axis=1)).tolist()
        rows = np.rint(np.nan_to_num(pose.positions) / UNIT_M).astype(int).tolist()
        seen = [row if one else None for row, one in zip(rows, known, strict=True)]
        self._send(_text({"pose": [pose.recording, round(pose.time_s, 3), seen]}))

    def send_event(self, event: Mapping[str, Any]) -> None:
        """Give an event to all pages, as `motionary live` prints it."""
        text = _text({"event": event})
        # Lengths of time that were not seen are of the past, too.
        self._send(text, is_kept=event["event"] in ("final", "unassessed"))

    def close(self) -> None:
        """Serve the page no more."""
        with self._lock:
            listeners = list(self._listeners.values())
        for listener in listeners:
            listener.end()
        threading.Thread(target=self._server.shutdown, daemon=True).start()

    def _send(self, text: str, *, is_kept: bool = False) -> None:
        # At once: who connects meanwhile gets it from the past or now, not twice.
        with self._lock:
            if is_kept:
                self._past.append(text)
            listeners = list(self._listeners.values())
        for listener in listeners:
            listener.offer(text)

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

        with self._lock:
            self._n_connections += 1
            number = self._n_connections
            listener = Listener(connection, f"page {number}", self._tell)
            known = [body.description for body in self._bodies.values() if body.description]
            # One message: what comes meanwhile has room to wait, and comes after.
            listener.offer(f"[{','.join((_text({'live': self._run}), *known, *self._past))}]")
            self._listeners[number] = listener
        try:
            # A page has nothing to say.
            for _ in connection:
                pass
        except ConnectionClosed:
            pass
        finally:
            with self._lock:
                del self._listeners[number]
            listener.end()


class _Body:
    """What pages know of one recording's body."""

    def __init__(self) -> None:
        self.shown_s = 0.0
        self.description = ""
        #: Of each joint, where it was first seen.
        self.first: Floats = np.empty(0)

    def sees_more(self, positions: Floats) -> bool:
        """Whether a pose shows joints that were not seen before."""
        if not len(self.first):
            self.first = np.full_like(positions, np.nan)
        new = np.isnan(self.first).any(axis=1) & ~np.isnan(positions).any(axis=1)
        self.first[new] = positions[new]
        return bool(new.any())


def _describe(pose: PersonPose, first: Floats) -> str:
    """The body of a recording as a page has it."""
    name = pose.person or (f"sender {pose.sender}" if pose.sender else "motion")
    content = {"number": pose.recording, "name": name, "rate_hz": pose.rate_hz}
    return _text({"recording": content | describe_body(first[np.newaxis])})


def _text(message: Mapping[str, Any]) -> str:
    return json.dumps(message, allow_nan=False, separators=(",", ":"))
