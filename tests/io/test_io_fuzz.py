"""Does every broken file end in an error of ours or in a valid motion?

Seeded variants of small files and of one recording: cut off, bits flipped, bytes and
lines deleted, doubled or exchanged, numbers made huge. Nothing else may come out: no other
exception, no warning, no number that is not finite, no hang, no memory out of proportion.
"""

import re
import time
import tracemalloc

import numpy as np
import pytest

from motionary.errors import MotionaryError
from motionary.io import read, read_labels
from oracles import motion_files as files

pytestmark = pytest.mark.filterwarnings("error")

VARIANTS = 56
HUGE = (b"999999999", b"-1", b"1e308", b"nan", b"inf", b"0", b"", b"1e-320", b"9" * 400, b"\xff")


def truncate(rng, content):
    return content[: rng.integers(len(content) + 1)]


def flip_bits(rng, content):
    changed = np.frombuffer(content, dtype=np.uint8).copy()
    places = rng.integers(len(changed), size=rng.integers(1, 6))
    changed[places] ^= 1 << rng.integers(8, size=len(places), dtype=np.uint8)
    return changed.tobytes()


def delete_bytes(rng, content):
    start = rng.integers(len(content))
    return content[:start] + content[start + rng.integers(1, 40) :]


def delete_lines(rng, content):
    lines = content.split(b"\n")
    start = rng.integers(len(lines))
    del lines[start : start + rng.integers(1, 4)]
    return b"\n".join(lines)


def double_lines(rng, content):
    lines = content.split(b"\n")
    start = rng.integers(len(lines))
    lines[start:start] = lines[start : start + rng.integers(1, 4)]
    return b"\n".join(lines)


def exchange_lines(rng, content):
    lines = content.split(b"\n")
    a, b = rng.integers(len(lines), size=2)
    lines[a], lines[b] = lines[b], lines[a]
    return b"\n".join(lines)


def change_numbers(rng, content):
    numbers = list(re.finditer(rb"-?[0-9.]+", content[:3000]))
    if not numbers:
        return content
    number = numbers[rng.integers(len(numbers))]
    return content[: number.start()] + HUGE[rng.integers(len(HUGE))] + content[number.end() :]


CHANGES = (
    truncate,
    flip_bits,
    delete_bytes,
    delete_lines,
    double_lines,
    exchange_lines,
    change_numbers,
)


def variants(content, count=VARIANTS):
    for seed in range(count):
        rng = np.random.default_rng(seed)
        changed = CHANGES[seed % len(CHANGES)](rng, content)
        if seed % 3 == 0 and changed:
            changed = CHANGES[rng.integers(len(CHANGES))](rng, changed)
        yield changed


def check_motion(path, **options):
    """1 if the file was read, 0 if it was refused."""
    try:
        motion = read(path, **options)
    except MotionaryError:
        return 0
    assert motion.n_frames > 0
    assert 0 < motion.rate_hz < 1e6
    assert np.isfinite(motion.positions).all()
    assert np.isfinite(motion.rotations).all()
    np.testing.assert_allclose(np.linalg.norm(motion.rotations, axis=-1), 1, atol=1e-9)
    return 1


@pytest.fixture
def acclaim(tmp_path):
    rng = np.random.default_rng(21)
    bones, children = files.random_acclaim(rng)
    asf, amc = tmp_path / "a.asf", tmp_path / "a_1.amc"
    asf.write_text(files.asf_text(bones, children))
    amc.write_text(files.amc_text(bones, files.random_values(rng, bones, 8)))
    return asf, amc


@pytest.fixture
def bvh(tmp_path):
    rng = np.random.default_rng(22)
    nodes = files.random_bvh(rng)
    width = sum(len(channels) for *_, channels in nodes)
    path = tmp_path / "a.bvh"
    path.write_text(files.bvh_text(nodes, rng.uniform(-99, 99, (8, width)).round(3)))
    return path


@pytest.mark.parametrize("which", [0, 1])
def test_broken_acclaim_files(acclaim, which):
    content = acclaim[which].read_bytes()
    read_well = 0
    for changed in variants(content):
        acclaim[which].write_bytes(changed)
        read_well += check_motion(acclaim[1])
    # Some changes do no harm (a comment, a digit); most must be noticed.
    assert 0 < read_well < VARIANTS


def test_broken_bvh_files(bvh):
    content = bvh.read_bytes()
    read_well = 0
    for changed in variants(content):
        bvh.write_bytes(changed)
        read_well += check_motion(bvh)
    assert 0 < read_well < VARIANTS


@pytest.mark.parametrize(
    "name", ["cmu/neutral_16_000.bvh", "hdm05/squat1Reps/HDM_bd_squat1Reps_001_120.amc"]
)
def test_broken_recordings(data, tmp_path, name):
    content = (data / name).read_bytes()
    path = tmp_path / name.rpartition("/")[2]
    asf = data / "hdm05" / "HDM_bd.asf" if path.suffix == ".amc" else None
    read_well = 0
    for changed in variants(content, 28):
        path.write_bytes(changed)
        read_well += check_motion(path, asf=asf)
    assert 0 < read_well < 28


def test_broken_tables_of_labels(tmp_path):
    path = tmp_path / "labels.csv"
    rows = [f'"take {i}",walk,{i},{i + 1.5},{120 * i},0.0{i},"a, b"' for i in range(9)]
    header = "recording,label,start_s,end_s,start_frame,cost,note"
    content = "\n".join([header, *rows, ""]).encode()
    read_well = 0
    for changed in variants(content):
        path.write_bytes(changed)
        try:
            tracks = read_labels(path)
        except MotionaryError:
            continue
        read_well += 1
        for track in tracks.values():
            for label in track:
                assert label.name
                assert -np.inf < label.start_s <= label.end_s < np.inf
    assert 0 < read_well < VARIANTS


BOMBS = {
    "frames": ("Frames: 8", "Frames: 999999999"),
    "more frames": ("Frames: 8", "Frames: " + "9" * 5000),
    "channels": ("CHANNELS ", "CHANNELS 999999999"),
    "blanks": ("MOTION", "MOTION" + " \n" * 200_000),
    "blank words": ("Frame Time", " " * 200_000 + "Frame Time"),
    "a long name": ("ROOT ", "ROOT " + "x" * 200_000),
    "deep": ("MOTION", "ROOT a\n{\n" + "JOINT a\n{\n" * 2000 + "}\n" * 2001 + "MOTION"),
    "a long number": ("Frame Time: 0", "Frame Time: 0." + "0" * 100_000),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_huge_counts_cost_neither_time_nor_memory(bvh, bomb):
    text = bvh.read_text()
    old, new = BOMBS[bomb]
    bvh.write_text(text.replace(old, new, 1))
    tracemalloc.start()
    started = time.process_time()
    check_motion(bvh)
    seconds = time.process_time() - started
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert seconds < 5
    assert peak < 100e6


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("\n8\n", "\n999999999\n"),
        ("\n1\n", "\n" + "9" * 5000 + "\n"),
        ("\n1\n", "\n1\n" + "\n" * 200_000),
        ("\nroot ", "\nroot" + " 1" * 200_000 + " "),
        (":DEGREES", ":" + "x" * 200_000),
        (":DEGREES", ":x\n" * 200_000),
    ],
)
def test_huge_acclaim_files_cost_neither_time_nor_memory(acclaim, old, new):
    text = acclaim[1].read_text()
    acclaim[1].write_text(text.replace(old, new, 1))
    tracemalloc.start()
    started = time.process_time()
    check_motion(acclaim[1])
    seconds = time.process_time() - started
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert seconds < 5
    assert peak < 100e6
