"""Where poses come from: lines of a file or a pipe, or a websocket.

A source gives lines and takes events. What arrives faster than it is labelled waits in a
queue of bounded length; a websocket's sender then has to wait, which is told once.
"""

import json
import queue
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Protocol

from motionary.errors import InvalidInput

#: Lines that wait at most.
MOST_WAITING = 256
# A longer message is no pose.
_LONGEST = 1_000_000
_LOOPBACK = "127.0.0.1"

Tell = Callable[[str], None]


class Source(Protocol):
    """Lines of poses, each with the name of its sender, and a way back for events."""

    def lines(self) -> Iterator[tuple[str, str | bytes]]:
        """Sender and line, until no more come."""

    def send(self, event: Mapping[str, Any]) -> None:
        """Give an event to whoever listens."""


class PipeSource:
    """Lines of a file or a pipe.

    Parameters
    ----------
    file : gives lines
    """

    def __init__(self, file: Iterable[str]) -> None:
        self._file = file

    def lines(self) -> Iterator[tuple[str, str | bytes]]:
        """Sender and line; there is one sender."""
        return (("", line) for line in self._file)

    def send(self, event: Mapping[str, Any]) -> None:
        """Nobody else listens."""


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
        If the package websockets is not installed, or the port is taken.
    """

    def __init__(self, port: int, *, address: str = _LOOPBACK, tell: Tell) -> None:
        try:
            from websockets.sync.server import serve
        except ImportError as error:
            raise InvalidInput(
                f"poses by websocket need the package websockets ({error}); "
                "pip install 'motionary[live]', or send lines of JSON to stdin"
            ) from error
        self._tell, self._waiting = tell, queue.Queue[tuple[str, str | bytes]](MOST_WAITING)
        self._listeners: dict[int, Any] = {}
        self._lock = threading.Lock()
        self._n_connections, self._is_slow = 0, False
        try:
            self._server = serve(self._receive, address, port, max_size=_LONGEST)
        except OSError as error:
            raise InvalidInput(
                f"port {port} of {address} cannot be listened to ({error.strerror or error}); "
                "give another with --port, or 0 for any that is free"
            ) from error
        self.port = int(self._server.socket.getsockname()[1])
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def lines(self) -> Iterator[tuple[str, str | bytes]]:
        """Sender and line, for as long as this is listened to."""
        while True:
            yield self._waiting.get()

    def send(self, event: Mapping[str, Any]) -> None:
        """Give an event to all that are connected."""
        text = json.dumps(event, allow_nan=False)
        with self._lock:
            listeners = list(self._listeners.values())
        for listener in listeners:
            # Who has gone has gone; the others are still there.
            try:
                listener.send(text)
            except Exception as error:
                self._tell(f"an event did not reach a listener: {error}")

    def close(self) -> None:
        """Listen no more."""
        self._server.shutdown()

    def _receive(self, connection: Any) -> None:
        from websockets.exceptions import ConnectionClosed

        with self._lock:
            self._n_connections += 1
            number = self._n_connections
            self._listeners[number] = connection
        self._tell(f"sender {number} is connected")
        try:
            for message in connection:
                # Several poses may come in one message.
                for line in message.splitlines():
                    self._wait_for_room()
                    self._waiting.put((str(number), line))
        except ConnectionClosed:
            pass
        finally:
            with self._lock:
                del self._listeners[number]
            self._tell(f"sender {number} is gone")

    def _wait_for_room(self) -> None:
        if self._waiting.full() and not self._is_slow:
            self._is_slow = True
            self._tell(
                "poses come faster than they can be labelled: senders have to wait; send fewer a "
                "second, or one person only"
            )
