"""Are moving pictures as long as the motion, with its labels, and is what cannot be drawn told?"""

import shutil
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from cli_cases import write_bvh
from motionary.errors import InvalidInput
from motionary.io import write_labels
from motionary.labels import Label, LabelTrack
from motionary.plots import render, style
from motionary.recording import Segment
from motionary.samples import synthetic_motion

SMALL = {"dpi": 30, "pictures_per_s": 5}


@pytest.fixture(scope="module")
def motion():
    whole = synthetic_motion("squat", seed=0, rate_hz=30)
    return whole.cut(0, 40).renamed("take.bvh")


def frames_of(path):
    with Image.open(path) as image:
        for i in range(image.n_frames):
            image.seek(i)
            yield np.asarray(image.convert("RGB")).astype(int)


def orange(picture):
    red, green, blue = picture[..., 0], picture[..., 1], picture[..., 2]
    return (red > 180) & (green < 140) & (blue < 60)


def test_a_gif_runs_as_long_as_the_motion(motion, tmp_path):
    render(motion, tmp_path / "a.gif", **SMALL)
    with Image.open(tmp_path / "a.gif") as image:
        assert image.n_frames == 7
        assert image.info["duration"] == 200
        assert image.info["loop"] == 0
    pictures = list(frames_of(tmp_path / "a.gif"))
    assert all(np.abs(one - other).max() > 50 for one, other in pairwise(pictures))
    for name in ("b.gif", "c.gif"):
        render(motion.cut(0, 10), tmp_path / name, **SMALL)
    assert (tmp_path / "b.gif").read_bytes() == (tmp_path / "c.gif").read_bytes()


def test_labels_stand_below(motion, tmp_path):
    track = LabelTrack(motion.recording, (Label("down", 0.2, 0.6),), (Segment(0.8, 1.0),))
    render(motion, tmp_path / "with.gif", track, **SMALL)
    render(motion, tmp_path / "without.gif", **SMALL)
    (with_labels, *_), (without, *_) = (
        list(frames_of(tmp_path / name)) for name in ("with.gif", "without.gif")
    )
    assert with_labels.shape[0] > without.shape[0]
    lane = orange(with_labels[-25:])
    assert lane.sum() > 20
    assert not orange(without[-25:]).any()


def test_what_was_not_seen_and_unknown_points_are_drawn(motion, tmp_path):
    positions = motion.positions.copy()
    positions[:20] = np.nan
    render(replace(motion, positions=positions), tmp_path / "gap.gif", **SMALL)
    names = tuple(f"p{i}" for i in range(len(motion.names)))
    points = replace(motion, names=names, mapping=None, skeleton=None, rotations=None)
    render(points, tmp_path / "points.gif", **SMALL)
    dark = [(one < 100).all(axis=-1).sum() for one in frames_of(tmp_path / "points.gif")]
    assert min(dark) > 20


def test_what_cannot_be_written_is_told(motion, tmp_path, monkeypatch):
    with pytest.raises(InvalidInput, match=r"written as \.gif, \.mp4, got '\.avi'"):
        render(motion, tmp_path / "a.avi")
    with pytest.raises(InvalidInput, match="pictures_per_s must be"):
        render(motion, tmp_path / "a.gif", pictures_per_s=0)
    with pytest.raises(InvalidInput, match="dpi must be"):
        render(motion, tmp_path / "a.gif", dpi=4)
    long = replace(motion, positions=np.tile(motion.positions, (100, 1, 1)), rotations=None)
    with pytest.raises(InvalidInput, match=r"GIF of 13. s would be too large.*\.mp4"):
        render(long, tmp_path / "a.gif")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InvalidInput, match="MP4 needs the program ffmpeg"):
        render(motion, tmp_path / "a.mp4")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not there")
def test_ffmpeg_writes_mp4(motion, tmp_path):
    render(motion, tmp_path / "a.mp4", **SMALL)
    assert (tmp_path / "a.mp4").read_bytes()[4:8] == b"ftyp"


def test_a_part_shows_the_times_and_frames_of_the_recording(motion, tmp_path):
    render(motion, tmp_path / "whole.gif", **SMALL)
    render(motion, tmp_path / "part.gif", start_s=0.6, stop_s=1.0, **SMALL)
    whole, part = (list(frames_of(tmp_path / name)) for name in ("whole.gif", "part.gif"))
    height, width, _ = whole[0].shape
    clock = slice(height // 5, height // 4), slice(width // 2, width)
    assert len(part) == 2
    for shown, same in zip(part, whole[3:5], strict=True):
        assert np.abs(shown[clock] - same[clock]).max() < 40
    assert np.abs(part[0][clock] - whole[0][clock]).max() > 100


def test_the_axis_of_a_part_has_the_times_of_the_recording():
    _, ((axes,),) = style.new_page(style.Layout(left=0.5, width=5, heights=(1,)), title="a")
    style.mark_seconds([axes], 35.5, start_s=24.6)
    assert axes.get_xlim() == (24.6, 35.5)
    assert [text.get_text() for text in axes.get_xticklabels()][:2] == ["26", "28"]


def test_the_command_draws_a_part_with_its_labels(motionary, tmp_path):
    moves = synthetic_motion("squat", seed=0, rate_hz=30)
    write_bvh(moves, tmp_path / "take.bvh")
    track = LabelTrack(moves.renamed("take.bvh").recording, (Label("down", 0.2, 0.6),))
    write_labels(track, tmp_path / "labels.csv")
    given = (tmp_path / "take.bvh", "--labels", tmp_path / "labels.csv", "--pictures", 5)
    small = ("--dpi", 30, "-o", tmp_path / "a.gif")
    ran = motionary("render", *given, "--from", "0.2", "--to", "24f", *small)
    assert ran.code == 0, ran.err
    assert len(list(frames_of(tmp_path / "a.gif"))) == 4
    assert motionary("render", *given, "--from", "99", *small, "--force").code == 2
    assert motionary("render", *given, "-o", tmp_path / "a.png").code == 2
    (tmp_path / "labels.csv").write_text("recording,label,start_s,end_s\nother,x,0,1\n")
    ran = motionary("render", *given, *small, "--force")
    assert ran.code == 1
    assert "has no labels of take.bvh" in ran.err
