"""Depth recordings: folders, npz, mat, what they say of the camera, and what is refused."""

import json

import numpy as np
import pytest
from PIL import Image
from scipy.io import savemat

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.depth_images import read_depth

TOLD = {"focal": [40.0, 41.0], "centre": [16.0, 12.0], "rate_hz": 15}


def write_folder(path, images, told=TOLD, names="{:03d}.png"):
    path.mkdir()
    for number, image in enumerate(images):
        Image.fromarray(image).save(path / names.format(number))
    if told is not None:
        (path / "camera.json").write_text(json.dumps(told), "utf-8")
    return path


def ramp(n=3, shape=(24, 32)):
    images = np.full((n, *shape), 2000, np.uint16)
    images[:, :, 0] = 0
    images[:, 0, 1] = 1500
    return images


def test_a_folder_of_images_is_read_in_metres(tmp_path):
    recording = read_depth(write_folder(tmp_path / "a", ramp()))
    assert (recording.width, recording.height, recording.rate_hz) == (32, 24, 15)
    assert recording.focal == (40.0, 41.0)
    images = list(recording.images())
    assert len(recording) == len(images) == 3
    assert np.isnan(images[0][:, 0]).all()
    assert images[0][0, 1] == 1.5
    assert images[0][5, 5] == 2.0


def test_images_come_in_the_sequence_of_their_numbers_or_times(tmp_path):
    images = np.arange(1000, 1012, dtype=np.uint16)[:, None, None] + np.zeros((24, 32), np.uint16)
    recording = read_depth(write_folder(tmp_path / "a", images, names="take_{}.png"))
    assert [round(1000 * one[5, 5]) for one in recording.images()] == list(range(1000, 1012))
    timed = write_folder(tmp_path / "b", images[:2], names="7.{}.png")
    (timed / "7.0.png").rename(timed / "7.5.png")
    (timed / "7.1.png").rename(timed / "7.45.png")
    recording = read_depth(timed)
    assert [round(1000 * one[5, 5]) for one in recording.images()] == [1001, 1000]
    assert recording.rate_hz == pytest.approx(20)


def test_intrinsics_may_have_other_names_and_come_with_the_call(tmp_path):
    folder = write_folder(tmp_path / "a", ramp(), told=None)
    with pytest.raises(InvalidInput, match=r"intrinsics are missing: focal .* and centre \(cx"):
        read_depth(folder)
    with pytest.raises(InvalidInput, match=r"missing: centre \(cx, cy\) of the depth camera"):
        read_depth(folder, intrinsics={"focal": [40, 41]})
    other = {"fx": 40, "fy": 41, "ppx": 16, "ppy": 12, "depth_scale": 0.0005}
    recording = read_depth(folder, intrinsics=other)
    assert recording.centre == (16.0, 12.0)
    assert next(recording.images())[5, 5] == 1.0
    assert "assumed" in recording.notes[0]


def test_mirrored_images_are_turned_back_and_it_is_told(tmp_path):
    folder = write_folder(tmp_path / "a", ramp(), told={**TOLD, "mirrored": True})
    recording = read_depth(folder)
    assert recording.centre == (15.0, 12.0)
    assert next(recording.images())[0, 30] == 1.5
    assert any("mirrored" in note for note in recording.notes)
    assert read_depth(folder, mirrored=False).centre == (16.0, 12.0)


def test_arrays_and_a_mat_are_read(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, depth=ramp() / 1000.0, focal=40.0, centre=[16.0, 12.0], rate_hz=30)
    recording = read_depth(path)
    assert recording.focal == (40.0, 40.0)
    assert next(recording.images())[5, 5] == 2.0
    # As UTD-MHAD's: the images are mirrored, and their camera is known.
    mat = tmp_path / "a1_s1_t1_depth.mat"
    savemat(mat, {"d_depth": np.moveaxis(ramp(shape=(240, 320)), 0, 2)})
    recording = read_depth(mat)
    assert recording.mirrored
    assert recording.centre == (159.0, 120.0)
    assert next(recording.images())[0, 318] == 1.5


def test_missing_time_is_told(tmp_path):
    told = {**TOLD, "times_s": [0.0, 0.1, 0.2, 0.9, 1.0]}
    recording = read_depth(write_folder(tmp_path / "a", ramp(5), told))
    assert recording.gaps == (3,)
    assert recording.rate_hz == pytest.approx(10)
    assert "1 gaps in time, up to 0.70 s" in recording.notes
    named = write_folder(tmp_path / "b", ramp(3), {**TOLD}, names="100.{}5.png")
    assert read_depth(named).rate_hz == pytest.approx(10)
    (named / "camera.json").write_text(json.dumps({**TOLD, "times_s": [0, 1]}), "utf-8")
    with pytest.raises(InvalidInput, match="for each of the 3 images"):
        read_depth(named)


@pytest.mark.parametrize(
    ("images", "told", "match"),
    [
        ((ramp() // 10).astype(np.uint8), TOLD, "16 bits"),
        (ramp(), {**TOLD, "unit": "m"}, 'perhaps "unit": "mm"'),
        (ramp() // 1000, TOLD, 'perhaps "unit": "m"'),
        (ramp(), {**TOLD, "unit": "inch"}, "unit: choose"),
        (ramp(), {**TOLD, "focal": [4000, 4000]}, "do not belong to images of 32 x 24"),
        (ramp(), {**TOLD, "centre": [160, 120]}, "do not belong to images of 32 x 24"),
        (ramp(), {**TOLD, "width": 640}, "intrinsics are for a width of 640"),
        (ramp(), {**TOLD, "rate_hz": 0}, "images a second"),
        ([*ramp(2), ramp(1, (30, 32))[0]], TOLD, "002.png: has another size"),
    ],
)
def test_what_is_no_depth_is_refused(tmp_path, images, told, match):
    folder = write_folder(tmp_path / "a", images, told)
    with pytest.raises(InvalidInput, match=match):
        list(read_depth(folder).images())


def test_what_cannot_be_read_is_told(tmp_path):
    with pytest.raises(UnreadableFile, match="no such file or folder"):
        read_depth(tmp_path / "none")
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(UnreadableFile, match="holds no PNG"):
        read_depth(empty)
    for name, content in (("a.npz", b"x"), ("a.mat", b"x" * 200), ("a.bag", b"x")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(UnreadableFile, match=name):
            read_depth(tmp_path / name)
    np.savez(tmp_path / "b.npz", other=1)
    with pytest.raises(UnreadableFile, match="`depth`"):
        read_depth(tmp_path / "b.npz")
    folder = write_folder(tmp_path / "c", ramp())
    (folder / "000.png").write_bytes(b"no image")
    with pytest.raises(UnreadableFile, match=r"000\.png"):
        read_depth(folder)
    (folder / "camera.json").write_text("{", "utf-8")
    with pytest.raises(UnreadableFile, match=r"camera\.json"):
        read_depth(folder)
    (folder / "camera.json").write_text("[]", "utf-8")
    with pytest.raises(InvalidInput, match=r"camera\.json: needs"):
        read_depth(folder)


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
def test_damaged_files_of_images_are_refused_in_words(tmp_path, suffix):
    images = np.full((2, 30, 40), 1000, dtype=np.uint16)
    whole = tmp_path / "whole.npz"
    np.savez_compressed(whole, depth=images)
    array = tmp_path / "array.npy"
    np.save(array, images)
    content = whole.read_bytes()
    for damaged in (b"", b"PK", content[: len(content) // 2], array.read_bytes(), b"\x00" * 900):
        path = tmp_path / f"damaged{suffix}"
        path.write_bytes(damaged)
        with pytest.raises(UnreadableFile, match=rf"damaged\{suffix}: cannot be read"):
            read_depth(path)
