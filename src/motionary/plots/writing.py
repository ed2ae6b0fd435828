"""Pictures in files: PNG, SVG and PDF, and recordings as moving pictures, in GIF or MP4.

Moving ones show stick figures over their labels, for a mail or a slide. The figure is seen from
its right side and a little from the front, as on sheets, and followed sideways; marks on the
ground a metre apart show how it travels. Points that are no known body are drawn as points.

Conventions: times and frames are those of the whole recording, also of a part; a GIF shows each
picture for a whole number of hundredths of a second.
"""

import math
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnwritableFile
from motionary.files import write_atomically
from motionary.labels import LabelTrack
from motionary.motion import Motion
from motionary.plots import style
from motionary.plots.figures import SIDES, legend_of_sides, poses, project
from motionary.plots.style import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Suffixes of moving pictures.
MOVING = (".gif", ".mp4")
#: A GIF of more pictures is too large for a mail.
MOST_PICTURES = 1500

_TURN_DEG = 20.0
_DPI = 100
_WIDTH = 4.6
_HEIGHT = 3.0
_LANE = 0.2
_MOST_LANES = 6
_NAME_IN = 1.3
_COLOURS = 32
_MARGIN_M = 0.12
_SMOOTH_S = 0.8

# The same picture gives the same bytes: no date, no version, no random names.
_METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": "motionary"},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}

Image = NDArray[np.uint8]


@style.house_style()
def render(
    motion: Motion,
    path: str | Path,
    track: LabelTrack | None = None,
    *,
    start_s: float = 0.0,
    stop_s: float | None = None,
    pictures_per_s: float = 12.5,
    dpi: int = _DPI,
) -> None:
    """Write a motion as a moving picture; the suffix of the name says how: .gif or .mp4.

    Parameters
    ----------
    motion : metres, y up
    path : file to write; is replaced only once the new one is complete
    track : labels of the motion, times from its first frame
    start_s, stop_s : the part to draw, from the first frame, half-open; by default all of it
    pictures_per_s : of a GIF at most 50
    dpi : pixels per inch: 100 makes pictures about 480 pixels wide

    Raises
    ------
    InvalidInput
        If the suffix is another one, the motion ends before the part, the part is too long for a
        GIF, `ffmpeg` is missing for MP4, or a number makes no sense.
    UnwritableFile
        If the file cannot be written.
    """
    check_moving(path)
    if not 1 <= pictures_per_s <= 120:
        raise InvalidInput(f"pictures_per_s must be 1 to 120, got {pictures_per_s:g}")
    if not 20 <= dpi <= 400:
        raise InvalidInput(f"dpi must be 20 to 400, got {dpi}")
    stop_s = motion.duration_s if stop_s is None else min(stop_s, motion.duration_s)
    if not 0 <= start_s < stop_s:
        raise InvalidInput(
            "a part needs 0 <= start_s < stop_s, in a motion of "
            f"{motion.duration_s:.2f} s, got {start_s:g} to {stop_s:g}",
            file=motion.source or "motion",
        )
    suffix = Path(path).suffix.lower()
    hundredths = max(round(100 / pictures_per_s), 2)
    rate_hz = 100 / hundredths if suffix == ".gif" else pictures_per_s
    times = start_s + np.arange(0.0, stop_s - start_s - 1e-9, 1 / rate_hz)
    if suffix == ".gif" and len(times) > MOST_PICTURES:
        raise InvalidInput(
            f"a GIF of {stop_s - start_s:.0f} s would be too large "
            f"for most programs; choose {MOST_PICTURES / rate_hz:.0f} s at most (--from, --to), "
            "fewer pictures a second, or write .mp4",
            file=motion.source or "motion",
        )
    images = _draw_all(motion, track, times, stop_s=stop_s, dpi=dpi)
    with write_atomically(path) as beside:
        if suffix == ".gif":
            _write_gif(images, beside, hundredths=hundredths)
        else:
            _write_mp4(images, beside, rate_hz=rate_hz)


def check_moving(path: str | Path) -> None:
    """Refuse names of files that no moving picture can be written to here.

    Raises
    ------
    InvalidInput
    """
    suffix = Path(path).suffix.lower()
    if suffix not in MOVING:
        raise InvalidInput(
            f"moving pictures are written as {', '.join(MOVING)}, got "
            f"{Path(path).suffix!r}; give the file one of these suffixes",
            file=Path(path).name,
        )
    if suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise InvalidInput(
            "MP4 needs the program ffmpeg, which is not there; install it, or write .gif",
            file=Path(path).name,
        )


def _draw_all(
    motion: Motion, track: LabelTrack | None, times: Floats, *, stop_s: float, dpi: int
) -> Iterator[Image]:
    """Pictures, shape (height, width, 3), both even."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    start_s = float(times[0])
    shown = [x for x in track or () if x.start_s < stop_s and x.end_s > start_s]
    names = sorted({label.name for label in shown})[:_MOST_LANES]
    heights = (_HEIGHT, *([_LANE * len(names)] if names else []))
    layout = style.Layout(
        left=_NAME_IN if names else 0.0, width=_WIDTH - (_NAME_IN if names else 0.0),
        heights=heights, gap=0.12, below=0.36 if names else 0.1,
    )  # fmt: skip
    figure, (axes,) = style.new_page(layout, title=motion.source or "motion")
    figure.set_dpi(dpi)
    if names and track is not None:
        # The figure takes the width of the names, too.
        box = axes[0].get_position()
        left = axes[1].get_position().x0 - layout.left / layout.page_width
        axes[0].set_position((left, box.y0, box.x1 - left, box.height))
        _draw_lanes(axes[1], names, track, start_s=start_s, stop_s=stop_s)
        cursor = axes[1].axvline(start_s, color=style.BLACK, linewidth=1.0)
    style.add_legend(figure, legend_of_sides())
    first = min(int(start_s * motion.rate_hz + 1e-6), motion.n_frames - 1)
    stop = max(math.ceil(stop_s * motion.rate_hz - 1e-6), first + 1)
    part = motion.cut(first, stop)
    body = _Body(axes[0], part)
    clock = axes[0].text(
        0.99, 0.98, "", transform=axes[0].transAxes, ha="right", va="top", color=style.TRUNK
    )
    canvas = FigureCanvasAgg(figure)
    for time_s in times.tolist():
        frame = min(int(time_s * motion.rate_hz + 1e-6) - first, part.n_frames - 1)
        body.show(frame)
        clock.set_text(f"{time_s:.1f} s, frame {part.first_frame + frame}")
        if names:
            cursor.set_xdata([time_s, time_s])
        canvas.draw()  # type: ignore[no-untyped-call]
        image = np.asarray(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]
        yield image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2].copy()


def _draw_lanes(
    axes: "Axes", names: list[str], track: LabelTrack, *, start_s: float, stop_s: float
) -> None:
    """A lane a class, in the colour of labels."""
    for row, name in enumerate(names):
        own = [label for label in track if label.name == name]
        style.draw_blocks(axes, own, low=row - 0.3, height=0.6, colour=style.LABEL, stop_s=stop_s)
    if track.unassessed:
        style.hatch(axes, track.unassessed)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_yticks(range(len(names)), labels=[style.fit(x, _NAME_IN - 0.1) for x in names])
    axes.tick_params(axis="y", length=0)
    style.mark_seconds([axes], stop_s, start_s=start_s)


class _Body:
    """A body in axes, at one frame after the other."""

    def __init__(self, axes: "Axes", motion: Motion) -> None:
        from matplotlib.collections import LineCollection
        from matplotlib.patches import Circle

        self._axes = axes
        self._is_body = motion.mapping is not None
        if self._is_body:
            self._positions = motion.generic_positions()
            self._views = project(self._positions, turn_deg=_TURN_DEG)
        else:
            self._positions = motion.positions
            self._views = self._positions[..., [2, 1]]
        self._centres = _follow(self._views[..., 0], motion.rate_hz)
        self._lines: dict[str, LineCollection] = {}
        for part, colour in SIDES.items():
            lines = LineCollection([], colors=colour, linewidths=2.2, capstyle="round")
            self._lines[part] = axes.add_collection(lines, autolim=False)  # type: ignore[assignment]
        (self._points,) = axes.plot([], [], ".", color=style.TRUNK, markersize=3)
        self._head = axes.add_patch(Circle((0.0, 0.0), 0.1, color=style.TRUNK))
        self._ground = axes.add_collection(
            LineCollection([], colors=style.RULE, linewidths=0.8), autolim=False
        )
        self._set_limits()

    def _set_limits(self) -> None:
        heights = self._views[..., 1][np.isfinite(self._views[..., 1])]
        # A point that flies off must not shrink the rest.
        low, high = np.percentile(heights, [0.2, 99.8]) if len(heights) else (0.0, 1.0)
        low = 0.0 if 0 <= low < high - low else float(low)
        tall = max(float(high) - low, 1e-6) * (1 + 2 * _MARGIN_M)
        box = self._axes.get_position()
        figure = self._axes.get_figure(root=True)
        across, up = (1.0, 1.0) if figure is None else figure.get_size_inches()
        self._floor = low
        self._half_width = tall * box.width * across / (box.height * up) / 2
        self._axes.set(ylim=(low - _MARGIN_M * tall / 2, low + tall), xticks=[], yticks=[])
        self._axes.axis("off")

    def show(self, frame: int) -> None:
        """Draw a frame."""
        centre = float(self._centres[frame])
        ends = centre - self._half_width, centre + self._half_width
        self._axes.set_xlim(*ends)
        marks = [(x, self._floor) for x in np.arange(np.ceil(ends[0]), ends[1])]
        tall = 0.03 * self._half_width
        self._ground.set_segments(  # type: ignore[attr-defined]
            [[(ends[0], self._floor), (ends[1], self._floor)],
             *([(x, y - tall), (x, y + tall)] for x, y in marks)]
        )  # fmt: skip
        if not self._is_body:
            self._points.set_data(*self._views[frame].T)
            return
        (pose,) = poses(self._positions, self._views, [frame])
        for part, lines in self._lines.items():
            lines.set_segments(list(getattr(pose, part)))
        is_seen = not np.isnan(pose.head).any()
        self._head.set_visible(is_seen)
        if is_seen:
            self._head.set(center=tuple(pose.head), radius=pose.head_radius)


def _follow(across: Floats, rate_hz: float) -> Floats:
    """Where the camera looks, shape (frames,): the middle of the body, smoothed."""
    seen = ~np.isnan(across).all(axis=1)
    if not seen.any():
        return np.zeros(len(across))
    middles = np.full(len(across), np.nan)
    middles[seen] = np.nanmedian(across[seen], axis=1)
    frames = np.arange(len(across))
    middles = np.interp(frames, frames[seen], middles[seen])
    width = max(round(_SMOOTH_S * rate_hz) | 1, 1)
    padded = np.pad(middles, width // 2, mode="edge")
    return np.convolve(padded, np.full(width, 1 / width), mode="valid")


def _write_gif(images: Iterator[Image], path: Path, *, hundredths: int) -> None:
    from PIL import Image as Images

    first, *rest = (Images.fromarray(image) for image in images)
    # One palette for all: what stays the same between pictures takes no room.
    palette = first.quantize(_COLOURS)
    frames = [one.quantize(palette=palette, dither=Images.Dither.NONE) for one in (first, *rest)]
    frames[0].save(
        path, format="GIF", save_all=True, append_images=frames[1:], duration=10 * hundredths,
        loop=0, optimize=True, disposal=1,
    )  # fmt: skip


def _write_mp4(images: Iterator[Image], path: Path, *, rate_hz: float) -> None:
    first = next(images)
    height, width, _ = first.shape
    command = [
        "ffmpeg", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s",
        f"{width}x{height}", "-r", f"{rate_hz:g}", "-i", "-", "-an", "-pix_fmt", "yuv420p",
        "-f", "mp4", str(path),
    ]  # fmt: skip
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL
    ) as process:
        # What ffmpeg cannot take it says at its end.
        with suppress(BrokenPipeError):
            for image in chain([first], images):
                process.stdin.write(image.tobytes())  # type: ignore[union-attr]
        _, said = process.communicate()
    if process.returncode:
        reason = said.decode("utf-8", "replace").strip().splitlines()[-1:] or ["no reason"]
        raise UnwritableFile(f"ffmpeg could not write it: {reason[0][:200]}", file=path.name)


def save_pages(figures: "Iterable[Figure]", path: str | Path) -> list[Path]:
    """Write pictures, the second as `name-2.png` and so on; their paths come back."""
    first, paths = Path(path), []
    for number, figure in enumerate(figures, start=1):
        paths.append(first if number == 1 else first.with_stem(f"{first.stem}-{number}"))
        save(figure, paths[-1])
    return paths


@style.house_style()
def save(figure: "Figure", path: str | Path) -> None:
    """Write a picture; the suffix of the name says how: png, svg or pdf.

    Parameters
    ----------
    figure : from any function of this package
    path : file to write; is replaced only once the new one is complete

    Raises
    ------
    InvalidInput
        If the suffix is another one.
    UnwritableFile
        If the file cannot be written.
    """
    kind = Path(path).suffix.lower().lstrip(".")
    if kind not in _METADATA:
        raise InvalidInput(
            "pictures are written as .png, .svg or .pdf, got "
            f"{Path(path).suffix!r}; give the file one of these suffixes",
            file=Path(path).name,
        )
    from matplotlib import rc_context

    with write_atomically(path) as beside, rc_context({"svg.hashsalt": "motionary"}):
        figure.savefig(beside, format=kind, metadata=_METADATA[kind])
