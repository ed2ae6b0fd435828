"""Pages: one file of HTML with its style, its script and its data, and nothing from outside.

A content security policy names the one style and the one script by their hashes and allows
no other, no connection, no form and no frame; a live page has one connection. Data stand in
elements that no browser executes, as JSON without `<` or as base64; names reach the page as text
only.

Conventions: a block is base64 of a zlib stream of variable-length integers (seven bits a byte,
low ones first); signed ones are folded (0, -1, 1, -2, ... become 0, 1, 2, 3, ...). Over time,
differences are written. `page/decoding.js` is the other half.
"""

import base64
import hashlib
import html
import json
import re
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary import __version__
from motionary.errors import InvalidInput
from motionary.files import write_atomically
from motionary.motion import GENERIC_JOINTS
from motionary.recording import split_runs

#: Browsers give up on files beyond this.
MOST_BYTES = 400_000_000
#: Further frames a second tell nothing to eyes, and fill the page.
MOST_HZ = 240.0

_SCRIPTS = (
    "words.js", "decoding.js", "stage.js", "view.js", "timeline.js", "why.js", "labels.js",
    "clock.js", "player.js", "gallery.js",
)  # fmt: skip
_LIVE, _START = "live.js", "start.js"
_POLICY = (
    "default-src 'none'; script-src '{script}'; style-src '{style}'; img-src data: blob:; "
    "connect-src {connect}; form-action 'none'; base-uri 'none'; "
    "require-trusted-types-for 'script'"
)
# Characters that end an element or, in old browsers, a line of a script.
_ESCAPED = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026"}
#: Height of a page in the cell of a notebook.
_CELL_PX = 640

#: Unit of positions in a page, metres: they are off by half of it at most.
UNIT_M = 0.001

Integers = NDArray[np.int64]


class Block(NamedTuple):
    """Base64 text under the name by which the page asks for it."""

    name: str
    text: str


@dataclass(frozen=True, slots=True)
class Page:
    """A page that stands alone; notebooks show it in the cell, without a network.

    Attributes
    ----------
    title : of the window
    text : the file of HTML
    """

    title: str
    text: str = field(repr=False)

    def save(self, path: str | Path) -> None:
        """Write the page; what was there stays until the new one is complete.

        Raises
        ------
        InvalidInput
            If the name is no HTML file's.
        UnwritableFile
        """
        if Path(path).suffix.lower() not in (".html", ".htm"):
            raise InvalidInput(
                "pages are written as .html; give it that suffix", file=Path(path).name
            )
        with write_atomically(path) as beside:
            beside.write_text(self.text, encoding="utf-8", newline="\n")

    def _repr_html_(self) -> str:
        # The frame has no rights in the notebook: names in it come from files of strangers.
        return (
            f'<iframe title="{html.escape(_printable(self.title))}" sandbox="allow-scripts '
            f'allow-downloads" srcdoc="{html.escape(self.text)}" '
            f'style="width: 100%; height: {_CELL_PX}px; border: 1px solid #999"></iframe>'
        )


def build_page(
    content: Mapping[str, Any],
    blocks: Iterable[Block],
    *,
    title: str,
    path: str | Path | None = None,
    live: str = "",
) -> Page:
    """The whole page.

    Parameters
    ----------
    content : what the page shows, as JSON has it
    blocks : further data, by the names that `content` gives them
    title : of the window
    path : file to write
    live : the address of a websocket, the only one that the page may connect to

    Raises
    ------
    InvalidInput
        If the page would be larger than browsers open.
    """
    style, script = "\n" + _read("style.css"), _script(bool(live))
    pieces = [_element("text/plain", block.name, block.text) for block in blocks if block.text]
    shared = {"version": __version__, "unit_m": UNIT_M, "joints": GENERIC_JOINTS}
    shared |= {"live": live} if live else {}
    data = _element("application/json", "content", _to_json({**shared, **content}))
    check_bytes(len(data) + sum(map(len, pieces)))
    policy = _POLICY.format(
        script=_hash(script), style=_hash(style), connect=live if live else "'none'"
    )
    values = {
        "POLICY": policy,
        "TITLE": html.escape(_printable(title)),
        "STYLE": style,
        "DATA": data,
        "SCRIPT": script,
        # The script is at work while the browser still reads these.
        "BLOCKS": "\n".join(pieces),
    }
    # Split before anything is filled in: a title may look like one of the names.
    parts = re.split(r"\[\[([A-Z]+)\]\]", _read("page.html"))
    text = "".join(values[part] if i % 2 else part for i, part in enumerate(parts))
    page = Page(title, text)
    if path is not None:
        page.save(path)
    return page


def check_rate(rate_hz: float) -> None:
    """Raise InvalidInput unless a page can keep so many frames a second."""
    if not 1 <= rate_hz <= MOST_HZ:
        raise InvalidInput(f"rate_hz must be from 1 to {MOST_HZ:g}, got {rate_hz}")


def check_bytes(n_bytes: float) -> None:
    """Raise InvalidInput if a page of so many bytes is larger than browsers open."""
    if n_bytes > MOST_BYTES:
        raise InvalidInput(
            f"the page would have about {n_bytes / 1e6:.0f} MB, more than the "
            f"{MOST_BYTES / 1e6:.0f} MB that browsers open; give fewer or shorter recordings, or "
            "keep fewer frames a second (--keep, rate_hz)"
        )


@cache
def _read(name: str) -> str:
    return resources.files("motionary.reporting").joinpath("page", name).read_text("utf-8")


@cache
def _script(is_live: bool) -> str:
    further = [_LIVE] if is_live else []
    own = "\n".join(_read(name) for name in (*_SCRIPTS, *further, _START))
    return f'\n{_read("three.min.js")}\n(() => {{\n"use strict";\n{own}\n}})();\n'


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _element(kind: str, name: str, text: str) -> str:
    return f'<script type="{kind}" id="{name}">{text}</script>'


def _to_json(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    for letter, escape in _ESCAPED.items():
        text = text.replace(letter, escape)
    return text


def _printable(text: str) -> str:
    return "".join(letter if letter.isprintable() else " " for letter in text).strip()


# -- numbers as text ----------------------------------------------------------------------


_LEVEL = 7
_BITS = 7
_MOST_BYTES = 10


def encode_positions(positions: NDArray[np.float64], known: NDArray[np.bool_]) -> str:
    """Positions (frames, joints, 3), finite, and which of them were seen (frames, joints).

    Joint by joint, coordinate by coordinate: the first value, then differences; after all
    joints, per joint, the lengths of runs of seen and unseen frames in turn, seen first.
    """
    n_frames, n_joints, _ = positions.shape
    values = np.rint(positions / UNIT_M).astype(np.int64)
    rows = values.transpose(1, 2, 0).reshape(n_joints * 3, n_frames)
    runs: list[int] = []
    for joint in known.T:
        # Of a joint that is not seen at first a run of none comes before.
        runs += [] if joint[0] else [0]
        runs += [run.n_frames for run in split_runs(joint)]
    return _deflate(_differences(rows) + _varints(np.array(runs, dtype=np.int64)))


def encode_series(values: NDArray[np.int64]) -> str:
    """Whole numbers over time, shape (rows, frames), by their differences."""
    return _deflate(_differences(values))


def encode_states(states: NDArray[np.int64]) -> str:
    """Rows of up to 8 states over time, shape (rows, frames): 8 x length + state of each run."""
    parts: list[int] = []
    for row in states:
        runs = split_runs(row)
        parts.append(len(runs))
        parts += [8 * run.n_frames + int(row[run.start]) for run in runs]
    return _deflate(_varints(np.array(parts, dtype=np.int64)))


def encode_json(content: Any) -> str:
    """Any JSON, deflated."""
    return _deflate(json.dumps(content, separators=(",", ":"), allow_nan=False).encode("ascii"))


def _differences(rows: Integers) -> bytes:
    """Folded differences along each row."""
    steps = np.diff(rows, axis=1, prepend=0).ravel()
    return _varints(np.where(steps < 0, -2 * steps - 1, 2 * steps))


def _varints(values: Integers) -> bytes:
    """Variable-length integers of numbers of at least 0."""
    if not len(values):
        return b""
    n_bytes = np.ones(len(values), dtype=np.int64)
    for k in range(1, _MOST_BYTES - 1):
        n_bytes += values >= 1 << (_BITS * k)
    places = np.concatenate([[0], np.cumsum(n_bytes)[:-1]])
    out = np.empty(int(n_bytes.sum()), dtype=np.uint8)
    for k in range(int(n_bytes.max())):
        here = n_bytes > k
        low = (values[here] >> (_BITS * k)) & 0x7F
        out[places[here] + k] = low | np.where(n_bytes[here] > k + 1, 0x80, 0)
    return out.tobytes()


def _deflate(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content, _LEVEL)).decode("ascii")
