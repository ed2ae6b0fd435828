"""The page of a motion tracked in views of several cameras, to be seen through each of them.

What no view tells is drawn as unseen, where it is held to be. Where images are given they stand
behind the body. Lenses are taken for straight: near the edges of bent images both differ.
"""

import base64
import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FULL_BODY, compute_features
from motionary.io.cameras import CalibratedCamera, natural
from motionary.labels import Label, LabelTrack
from motionary.multiview import Tracking
from motionary.reporting.clips import PAGE_HZ, make_clip
from motionary.reporting.html import Block, Page, build_page
from motionary.reporting.lanes import Lane, describe_features, make_lanes, make_strip
from motionary.reporting.recordings import check_rate

_IMAGES = (".jpg", ".jpeg", ".png")
# Images of a page: so many a second, so wide, and so good.
_IMAGE_HZ, _WIDTH, _QUALITY = 10.0, 480, 60
# A point of which views tell less is drawn as unseen.
_SEEN_FROM = 0.05


def report_tracking(
    tracking: Tracking,
    path: str | Path | None = None,
    *,
    images: str | Path | None = None,
    rate_hz: float = PAGE_HZ,
    title: str = "",
) -> Page:
    """A page that plays what was tracked, from any side and as each camera saw it.

    Parameters
    ----------
    tracking : from `track`
    path : file to write, .html; otherwise `Page.save` does, and notebooks show the page
    images : a folder with a folder for each camera, of its name, that holds a .jpg or .png for
        each frame; they are kept small
    rate_hz : most frames a second that are kept
    title : of the page; by default the recording's name

    Raises
    ------
    InvalidInput
        If images are not as many as frames.
    """
    check_rate(rate_hz)
    motion = tracking.motion
    is_seen = tracking.confidence > _SEEN_FROM
    seen = replace(motion, positions=np.where(is_seen[..., None], motion.positions, np.nan))
    content, blocks = make_clip(motion, key="r0", rate_hz=rate_hz, seen=seen)
    content["strip"], strip = make_strip(compute_features(seen), key="r0")
    content["lanes"], whys = make_lanes(_lanes(tracking), key="r0")
    content["views"] = []
    pictures: list[Block] = []
    for k, (camera, late) in enumerate(zip(tracking.cameras, tracking.offsets, strict=True)):
        own: list[Block] = []
        if images is not None:
            files = _find_images(Path(images) / camera.name, motion.n_frames)
            own = _embed(files, motion.rate_hz, late, key=f"r0-view{k}")
        content["views"].append(_describe(camera, own))
        pictures += own
    page = build_page(
        {"features": describe_features(FULL_BODY), "recordings": [content]},
        [*blocks, strip, *whys, *pictures],
        title=title or motion.recording.name or "tracked motion",
    )
    if path is not None:
        page.save(path)
    return page


def _lanes(tracking: Tracking) -> list[Lane]:
    """What was recognised, which priors were taken, and where sides were exchanged."""
    recording = tracking.motion.recording
    lanes = []
    if tracking.labels is not None:
        lanes.append(Lane("recognised", tracking.labels))
        taken = tuple(
            Label(one.name, one.first / recording.rate_hz, one.stop / recording.rate_hz)
            for one in tracking.priors
            if one.kept
        )
        lanes.append(Lane("priors taken", LabelTrack(recording, taken)))
    named = tuple(
        replace(one, name=f"{one.name}, {one.extra['camera']}") for one in tracking.exchanges
    )
    return [*lanes, Lane("sides", LabelTrack(recording, named))]


def _describe(camera: CalibratedCamera, images: Sequence[Block]) -> dict[str, Any]:
    """A camera as the page has it: place, axes to the right, up and back, and its lens."""
    across, down, ahead = camera.rotation
    size = camera.size or tuple(2 * camera.matrix[:2, 2])
    return {
        "name": camera.name,
        "place": [round(float(one), 4) for one in camera.position],
        "axes": [[round(float(one), 6) for one in axis] for axis in (across, -down, -ahead)],
        "focal": [float(camera.matrix[0, 0]), float(camera.matrix[1, 1])],
        "centre": [float(one) for one in camera.matrix[:2, 2]],
        "size": [float(one) for one in size],
        "images": [block.name for block in images],
        "images_hz": _IMAGE_HZ,
    }


def _find_images(folder: Path, n_frames: int) -> list[Path]:
    try:
        found = [one for one in folder.iterdir() if one.suffix.lower() in _IMAGES]
    except OSError as error:
        raise UnreadableFile(
            "no folder of images there; give one for each camera, of its name", file=folder
        ) from error
    if len(found) != n_frames:
        raise InvalidInput(
            f"needs an image for each of {n_frames} frames, got {len(found)}", file=folder
        )
    return sorted(found, key=lambda one: natural(one.stem))


def _embed(files: Sequence[Path], rate_hz: float, late: int, *, key: str) -> list[Block]:
    """Small images at the page's rate, each a block of base64."""
    from PIL import Image, UnidentifiedImageError

    blocks = []
    for number in range(int(np.ceil(len(files) / rate_hz * _IMAGE_HZ))):
        frame = min(max(round(number / _IMAGE_HZ * rate_hz) + late, 0), len(files) - 1)
        try:
            with Image.open(files[frame]) as image:
                small = image.convert("RGB")
        except (OSError, UnidentifiedImageError) as error:
            raise UnreadableFile("is no image that can be read", file=files[frame]) from error
        small.thumbnail((_WIDTH, _WIDTH))
        buffer = io.BytesIO()
        small.save(buffer, "JPEG", quality=_QUALITY)
        blocks.append(Block(f"{key}-{number}", base64.b64encode(buffer.getvalue()).decode()))
    return blocks
