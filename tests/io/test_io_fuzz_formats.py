"""Does every broken file of the further formats end in an error of ours or a valid motion?

As `test_io_fuzz`, for C3D, TRC, OpenSim's tables, arrays and pickles.
"""

import pickle
import struct
import time
import tracemalloc

import numpy as np
import pytest
from test_io_fuzz import variants

from motionary.errors import MotionaryError
from motionary.io import read, write
from motionary.motion import Event, Motion
from motionary.recording import Recording
from motionary.samples import synthetic_motion

pytestmark = pytest.mark.filterwarnings("error")

# A few of each kind of change; `make fuzz` makes them by the thousand.
VARIANTS = 40
HEADS = 24


def check_motion(path, **options):
    """1 if the file was read, 0 if it was refused."""
    try:
        motion = read(path, **options)
    except MotionaryError as error:
        if "\n" in str(error):
            raise
        return 0
    assert motion.n_frames > 0
    assert 0 < motion.rate_hz < 1e6
    # What was not seen is NaN in all three coordinates.
    gaps = np.isnan(motion.positions)
    assert (gaps.all(axis=2) == gaps.any(axis=2)).all()
    if motion.rotations is not None:
        assert np.isfinite(motion.rotations).all()
    return 1


def small_motion():
    motion = synthetic_motion("squat", seed=0, rate_hz=60).cut(0, 8)
    positions = motion.positions.copy()
    positions[2, 4] = np.nan
    events = (Event("Foot Strike", "left", 0.05),)
    return Motion(
        motion.names,
        positions,
        Recording(rate_hz=60.0, first_frame=3),
        motion.mapping,
        events=events,
    )


def make_sto(path):
    rows = "\n".join(f"{i / 50}\t1.5,2,3\t4,5.25,6" for i in range(8))
    path.write_text(f"x\nDataType=Vec3\nversion=3\nendheader\ntime\ta\tb\n{rows}\n")


def make_amass(path):
    rng = np.random.default_rng(2)
    poses, trans = rng.normal(size=(4, 66)), rng.normal(size=(4, 3))
    np.savez(path, poses=poses, trans=trans, fps=np.array(60.0))


def make_pickle(path):
    array = np.random.default_rng(3).normal(size=(4, 17, 3))
    path.write_bytes(pickle.dumps({"keypoints3d": array}))


FILES = {
    "a.c3d": lambda path: write(small_motion(), path),
    "a.trc": lambda path: write(small_motion(), path),
    "a.trc.gz": lambda path: write(small_motion(), path),
    "own.npz": lambda path: write(small_motion(), path),
    "amass.npz": make_amass,
    "a.npy": lambda path: np.save(path, small_motion().positions),
    "a.pkl": make_pickle,
    "a.sto": make_sto,
}
OPTIONS = {"a.npy": {"rate_hz": 60}}


@pytest.mark.parametrize("name", FILES)
def test_broken_files(tmp_path, name):
    path = tmp_path / name
    FILES[name](path)
    content = path.read_bytes()
    read_well = 0
    for changed in variants(content, VARIANTS):
        path.write_bytes(changed)
        read_well += check_motion(path, **OPTIONS.get(name, {}))
    # Packed files carry check sums: hardly any change goes unnoticed.
    assert read_well < VARIANTS
    assert read_well > 0 or name.endswith((".gz", ".npz"))


@pytest.mark.parametrize("name", ["cmu/85_02.c3d", "hdm05_takes/HDM_dg_06-03_03_120.c3d"])
def test_heads_of_recordings(data, tmp_path, name):
    # Every kind of number in header and parameters, on files of Vicon.
    content = (data / name).read_bytes()
    path = tmp_path / "a.c3d"
    read_well = 0
    for seed in range(HEADS):
        rng = np.random.default_rng(seed)
        changed = bytearray(content)
        for place in rng.integers(6000, size=rng.integers(1, 6)):
            changed[place] = rng.integers(256)
        path.write_bytes(bytes(changed))
        started = time.process_time()
        read_well += check_motion(path)
        assert time.process_time() - started < 5
    assert 0 < read_well < HEADS


def patched(content, place, layout, *values):
    changed = bytearray(content)
    struct.pack_into(layout, changed, place, *values)
    return bytes(changed)


HUGE = {
    "points": (2, "<H", 65535),
    "analog values": (4, "<H", 65535),
    "last frame": (8, "<H", 65535),
    "place of the frames": (16, "<H", 65535),
    "place of the parameters": (0, "<B", 255),
    "blocks of parameters": (514, "<B", 255),
    "length of a name": (516, "<b", 127),
    "a jump": (523, "<h", 32767),
    "a jump back": (523, "<h", -32768),
}


@pytest.mark.parametrize("what", HUGE)
def test_huge_counts_in_a_c3d_cost_neither_time_nor_memory(tmp_path, what):
    path = tmp_path / "a.c3d"
    write(small_motion(), path)
    place, layout, value = HUGE[what]
    path.write_bytes(patched(path.read_bytes(), place, layout, value))
    tracemalloc.start()
    started = time.process_time()
    check_motion(path)
    seconds = time.process_time() - started
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert seconds < 5
    assert peak < 100e6
