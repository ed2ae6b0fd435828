"""`motionary render`: a recording as a moving picture, over its labels."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli import screen
from motionary.cli.options import REQUIRED, Force, check_target, option, wrong
from motionary.cli.query import Start, Stop, check_part
from motionary.cli.recordings import read_recording
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions
from motionary.tables import enumerate_names

if TYPE_CHECKING:
    from motionary.labels import LabelTrack
    from motionary.motion import Motion


@dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """What of a recording is drawn, and where it goes."""

    output: str = option("--output -o FILE", "A .gif, or .mp4 by ffmpeg.", REQUIRED)
    labels: str | None = option("--labels LABELS", "Labels to show below, in any format.")
    start: Start = None
    stop: Stop = None
    pictures: float = option("--pictures HZ", "Pictures a second.", 12.5, min=1.0, max=120.0)
    dpi: int = option("--dpi", "Pixels an inch: 100 is about 480 wide.", 100, min=20, max=400)
    force: Force = False


def render(
    file: Annotated[str, typer.Argument(metavar="RECORDING", help="The recording to draw.")],
    options: RenderOptions,
    *,
    reading: ReadOptions,
) -> None:
    """Draw a recording as a moving picture for a mail or a slide, over its labels.

    motionary render take.bvh -o take.gif
    motionary render take.bvh --labels labels.csv --from 1.5 --to 0:08 -o take.gif
    """
    from motionary.plots import check_moving
    from motionary.plots import render as render_motion

    try:
        check_moving(options.output)
    except InvalidInput as error:
        raise wrong("--output", str(error)) from error
    check_target(options.output, replace=options.force)
    path = Path(file)
    motion = read_recording(path, reading).renamed(path.name)
    track = None if options.labels is None else _read_track(options.labels, motion)
    start_s, stop_s = check_part(motion.recording, options.start, options.stop)
    render_motion(
        motion, options.output, track,
        start_s=start_s, stop_s=stop_s, pictures_per_s=options.pictures, dpi=options.dpi,
    )  # fmt: skip
    screen.say_size(options.output)


def _read_track(path: str, motion: "Motion") -> "LabelTrack":
    from motionary.io import match_recording, read_labels
    from motionary.labels import of_recording

    name = motion.recording.name
    tracks = read_labels(path, recordings={name: motion.recording})
    found = [key for key in tracks if match_recording(key, [name])]
    if len(found) != 1:
        problem = "several may be meant" if found else f"has no labels of {name}"
        there = enumerate_names(sorted(found or tracks))
        raise InvalidInput(f"{problem}; has labels of {there}", file=path)
    return of_recording(tracks[found[0]], motion.recording)
