"""Small inputs with one fault each: read right, told, or refused with place and remedy.

The inputs lie in `faults/` of the recordings, named after the fault.
"""

import json
import os
import re
import subprocess
import sys
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import motionary as mo
from reading_cases import Case, Read, Refused, case, check_case

#: Runs a command in this process.
Command = Callable[..., Any]
COMMAND = [sys.executable, "-m", "motionary"]
PATIENCE_S = 30

ANALOG = "faults/c3d_ezc3d_valid_with_analog.c3d"
REFERENCE = "faults/c3d_reference.c3d"
AXIS_ANGLE = "faults/smpl_axis_angle.npz"

SAME_AS_REFERENCE = Read(frames=6, joints=4, rate_hz=100, same_as=REFERENCE, farthest_m=10)
SAME_WITH_ANALOG = Read(frames=200, joints=3, rate_hz=100, same_as=ANALOG, farthest_m=10)
SAME_BODY = Read(frames=30, joints=25, rate_hz=30, features=40, same_as=AXIS_ANGLE)
# What is no place is told in words; which words is free.
UNSEEN = r"9999999|(?i:sentinel|not seen|unknown|no place|too far)"
NO_LENGTH, MANY = r"(without|no|zero) length", r"(lknee|\b23\b|\ball\b)"
HELD = r"(held|frozen|constant|same place|not move)"
ABOUT_GAP = r"(?i)\bgaps?\b|drop|missing frames|\bmissing\b.*frames|uneven|not evenly|jump"

READING = [
    # Arrays.
    case(
        "faults/array_joints_xyz_frames.npy",
        # All its numbers are zero: the layout is told by the shape alone.
        Read(frames=90, joints=22, notes=(r"joints, (3|xyz), frames",)),
        Refused(r"\(joints, (3|xyz), frames\)"),
    ),
    case(
        "faults/array_zero_frames.npy",
        Read(
            frames=90,
            joints=22,
            rate_hz=20,
            features=34,
            leg_m=(0.7, 1.0),
            unknown=tuple((frame, "*") for frame in range(0, 90, 10)),
            notes=(r"(?i)zero",),
        ),
    ),
    # BVH. Position channels of zero replace OFFSETs.
    case(
        "faults/bvh_body_collapsed.bvh",
        Read(
            frames=33,
            joints=24,
            rate_hz=30,
            root_m=(0.5, 1.5),
            notes=(rf"(?i){NO_LENGTH}.*{MANY}|{MANY}.*{NO_LENGTH}",),
        ),
        Refused(r"(?i)(bone|joint|body|position channel).*(length|collapse|one point|offset)"),
    ),
    case(
        "faults/bvh_one_leg_collapsed_unit_becomes_inch.bvh",
        Read(
            frames=33,
            joints=24,
            rate_hz=30,
            leg_m=(0.8, 1.0),
            root_m=(0.5, 1.5),
            notes=(r"unit cm", r"(?i)lknee.*length|length.*lknee"),
        ),
    ),
    case(
        "faults/bvh_zero_position_channels.bvh",
        Read(frames=2, joints=3, rate_hz=30, notes=(r"(?i)Spine.*length|length.*Spine",)),
        Refused(r"(?i)Spine.*(length|offset)|(length|offset).*Spine"),
    ),
    case(
        "faults/bvh_frame_time_0.033.bvh", Read(frames=2, joints=3, rate_hz=30, notes=(r"\b30\b",))
    ),
    # C3D. Parameters and the size of the file count.
    case(REFERENCE, Read(frames=6, joints=4, rate_hz=100, farthest_m=10)),
    case(ANALOG, Read(frames=200, joints=3, rate_hz=100, farthest_m=10)),
    case("faults/c3d_ezc3d_header_analog_0.c3d", SAME_WITH_ANALOG),
    case("faults/c3d_ezc3d_header_analog_0_0.c3d", SAME_WITH_ANALOG),
    case("faults/c3d_analog_header_channels_not_samples.c3d", SAME_AS_REFERENCE),
    case("faults/c3d_analog_header_zero.c3d", SAME_AS_REFERENCE),
    case("faults/c3d_header_data_block_zero_param_right.c3d", SAME_AS_REFERENCE),
    case("faults/c3d_point_rate_zero_header_100.c3d", SAME_AS_REFERENCE),
    case("faults/c3d_param_first_bytes_zero.c3d", SAME_WITH_ANALOG),
    case(
        "faults/c3d_point_used_too_small.c3d",
        SAME_AS_REFERENCE,
        Refused(r"(?i)POINT:USED|number of points|size of the file"),
    ),
    case(
        "faults/c3d_9999999.c3d",
        Read(
            frames=6,
            joints=4,
            rate_hz=100,
            unknown=((2, "B"), (3, "B")),
            same_as=REFERENCE,
            farthest_m=10,
            notes=(UNSEEN,),
        ),
    ),
    case(
        "faults/c3d_all_residuals_minus1.c3d",
        Read(frames=6, joints=4, rate_hz=100, notes=(r"unseen.*--trust-points",)),
        Refused(r"unseen.*--trust-points"),
    ),
    case(
        "faults/c3d_rotations_only.c3d",
        Read(frames=6, rate_hz=100),
        Refused(r"(?i)rotation"),
    ),
    # Names of joints.
    case(
        "faults/names_openpose_MidHip_ok.trc",
        Read(frames=67, joints=22, rate_hz=60, features=34, leg_m=(0.7, 1.0)),
    ),
    case(
        "faults/names_pose2sim_halpe26_Hip.trc",
        Read(frames=67, joints=22, rate_hz=60, features=34, generic=("root", "belly", "chest")),
    ),
    case(
        "faults/names_opencap_augmented.trc",
        Read(frames=67, joints=23, rate_hz=60, features=34, generic=("root", "belly", "chest")),
    ),
    # SMPL: the representation of turns is told by shape and value.
    case(AXIS_ANGLE, Read(frames=30, joints=25, rate_hz=30, features=40, farthest_m=10)),
    case("faults/smpl_quat_24x4.npz", SAME_BODY),
    case("faults/smpl_rotmat_24x9.npz", SAME_BODY),
    case("faults/smpl_rotmat_flat.npz", SAME_BODY),
    case(
        "faults/smpl_trans_mm.npz",
        Read(frames=30, notes=(r"(?i)\bmm\b|millimet|9[45]\d m\b",)),
        Refused(r"(?i)\bmm\b|millimet|9[45]\d m\b"),
    ),
    # Tables of OpenSim.
    case("faults/sto_cut_off_nrows_100.sto", Refused(r"\b100\b.*\b10\b|\b10\b.*\b100\b")),
    case("faults/sto_times_four_decimals_120hz.sto", Read(frames=240, joints=1, rate_hz=120)),
    # TRC.
    case(
        "faults/trc_no_rate_times_four_decimals_120hz.trc", Read(frames=60, joints=2, rate_hz=120)
    ),
    case("faults/trc_times_three_decimals_120hz.trc", Read(frames=24, joints=2, rate_hz=120)),
    case(
        "faults/trc_header_30_times_29.476.trc",
        Read(
            frames=60,
            joints=2,
            rate_hz=29.476,
            notes=(r"\b30\b.*\b29\.4[78]|\b29\.4[78]\d*.*\b30\b",),
        ),
    ),
    case(
        "faults/trc_dropped_frames.trc", Read(frames=10, joints=2, rate_hz=100, notes=(ABOUT_GAP,))
    ),
    case("faults/trc_time_runs_backward.trc", Refused(r"(?i)backward|go back|decreas|run back")),
    case(
        "faults/trc_9999999.trc",
        Read(frames=2, joints=2, rate_hz=100, unknown=((0, "B"),), farthest_m=1, notes=(UNSEEN,)),
    ),
    case(
        "faults/trc_nan_ind.trc",
        Read(frames=2, joints=2, rate_hz=100, unknown=((0, "B"),), farthest_m=1),
    ),
    case(
        "faults/trc_marker_held.trc",
        Read(
            frames=111,
            joints=24,
            rate_hz=100,
            features=40,
            notes=(rf"(?i)lwrist.*{HELD}|{HELD}.*lwrist",),
        ),
    ),
    case(
        "faults/trc_blanks_for_tabs.trc",
        Read(frames=4, joints=2, rate_hz=100, farthest_m=1),
        Refused(r"(?i)\btabs?\b|\bblanks?\b|\bspaces?\b"),
    ),
    case(
        "faults/trc_decimal_comma.trc",
        Read(frames=4, joints=2, rate_hz=100, farthest_m=1),
        Refused(r"(?i)decimal comma|comma.*'0,00'|'0,00'.*comma"),
    ),
    case(
        "faults/trc_names_over_each_column.trc",
        Read(frames=4, joints=2, rate_hz=100, farthest_m=1),
        Refused(r"(?i)name.*column"),
    ),
]


@pytest.mark.parametrize("one", READING, ids=str)
def test_input_is_read_right_told_or_refused(data: Path, one: Case) -> None:
    check_case(data, one)


def test_every_input_has_a_case(data: Path) -> None:
    named = {one.file for one in READING} | {f"faults/{name}" for name in LABELS}
    named |= {f"faults/hostile/{name}" for name in HOSTILE} | {f"faults/hostile/{WIDE}"}
    there = {
        path.relative_to(data).as_posix()
        for path in (data / "faults").rglob("*")
        if path.is_file() and path.suffix not in (".md", ".sh")
    }
    assert there == named


def test_dropped_frames_are_filled_with_even_times_on_request(data: Path) -> None:
    motion = mo.read(data / "faults/trc_dropped_frames.trc", even_times=True)
    assert motion.positions.shape == (45, 2, 3)
    assert motion.rate_hz == 100
    # Marker A moves 1 mm a frame: what was seen stands at its own time.
    a = motion.positions[:, 0, 0]
    np.testing.assert_allclose(a[[0, 4, 40, 44]], [0, 0.004, 0.040, 0.044], atol=1e-9)


def test_points_that_are_marked_unseen_are_read_on_request(data: Path) -> None:
    path = data / "faults/c3d_all_residuals_minus1.c3d"
    trusted = mo.read(path, trust_points=True)
    np.testing.assert_array_equal(trusted.positions, mo.read(data / REFERENCE).positions)


# Tables of labels: recording, label, start and end of each row.
LABELS = {
    "labels_cp1252.csv": [("x", "kick – “left”", 1, 2)],
    "labels_nfc.csv": [("x", "é", 1, 2)],
    "labels_nfd.csv": [("x", "é", 1, 2)],
    "labels_quote_swallows_rows.csv": [("x", '"b', 3, 4), ("x", "mid", 4, 5), ("x", 'c"', 5, 6)],
    "labels_text_like_number_rewritten.csv": [("1,2", "0,5", 1, 2)],
    "labels_two_empty_columns.csv": [("x", "a", 1, 2)],
}  # fmt: skip


@pytest.mark.parametrize("name", LABELS)
def test_table_of_labels_is_read_as_it_stands(data: Path, name: str) -> None:
    tracks = mo.read_labels(data / "faults" / name)
    rows = [
        (recording, unicodedata.normalize("NFC", label.name), label.start_s, label.end_s)
        for recording, track in tracks.items()
        for label in track
    ]
    assert rows == LABELS[name]
    assert not any("" in label.extra for track in tracks.values() for label in track)


def test_further_columns_of_text_stay_as_they_are(data: Path) -> None:
    tracks = mo.read_labels(data / "faults/labels_text_like_number_rewritten.csv")
    # `note` is a column of one number: with semicolons its comma may be a decimal one.
    (label,) = next(iter(tracks.values()))
    assert label.extra["note"] in ("3,4", "3.4")


def test_unicode_forms_of_one_label_are_the_same_label(data: Path) -> None:
    composed = mo.read_labels(data / "faults/labels_nfc.csv")
    decomposed = mo.read_labels(data / "faults/labels_nfd.csv")
    scores = mo.evaluate(composed, decomposed)
    assert scores.concatenated.frames.f == 1.0
    assert scores.concatenated.segments.f == 1.0


# Hostile files are read in a process of their own, with limits.
_CHILD = """
import json, sys, time
limit, path, options = int(sys.argv[1]), sys.argv[2], json.loads(sys.argv[3])
import motionary
from motionary.io import read
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
except ImportError:
    peak = lambda: 0
try:  # Modules that are loaded late are no part of what a file costs.
    read(sys.argv[4])
except motionary.MotionaryError:
    pass
before, start = peak(), time.process_time()
result = {}
try:
    motion = motionary.read(path, **options)
    result["shape"] = motion.positions.shape
except motionary.MotionaryError as error:
    result["refused"] = str(error)
except BaseException as error:
    result["raised"] = repr(error)[:300]
result["cpu_s"], result["more_kb"] = time.process_time() - start, peak() - before
print(json.dumps(result))
"""

WIDE = "wide600.bvh"
HOSTILE = {
    "amass_shapes.npz": r"root_orient|pose_body|trans|shape|length|frames",
    "event_times.c3d": r"EVENT|event",
    "bytearray8_bomb.pkl": r"damaged|pickle|longer than the file|size|cut off",
    "hash_bomb.pkl": r"damaged|pickle|tuple|nest|key",
    "h_two_dots.amc": r"line 5\b.*'12\.345678\.901234'",
    "two_dots.bvh": r"line 136\b.*'12\.345678\.901234'",
}
_OTHER_FILE = {
    ".pkl": "faults/labels_nfc.csv", ".bvh": "faults/bvh_frame_time_0.033.bvh",
    ".amc": "faults/bvh_frame_time_0.033.bvh", ".npz": AXIS_ANGLE, ".c3d": REFERENCE,
}  # fmt: skip


def _read_apart(data: Path, path: Path, **options: str) -> dict:
    warm = data / _OTHER_FILE[path.suffix]
    command = [
        sys.executable,
        "-c",
        _CHILD,
        str(4 << 30),
        str(path),
        json.dumps(options),
        str(warm),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 0, done.stderr[-500:]
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_file_is_refused_at_once(data: Path, name: str) -> None:
    options = {"asf": str(data / "hdm05/HDM_bd.asf")} if name.endswith(".amc") else {}
    result = _read_apart(data, data / "faults/hostile" / name, **options)
    assert "refused" in result, result
    message = result["refused"]
    assert name in message
    assert "\n" not in message
    assert len(message) < 500
    assert re.search(HOSTILE[name], message.replace(name, "")), message
    assert "MemoryError" not in message
    assert result["cpu_s"] < 2
    assert result["more_kb"] < 100_000


def test_wide_tree_is_read_in_linear_time(data: Path) -> None:
    result = _read_apart(data, data / "faults/hostile" / WIDE)
    assert result.get("shape") == [3, 601, 3], result
    assert result["cpu_s"] < 0.5


@pytest.mark.parametrize("name", ["amass_shapes.npz", "event_times.c3d", "two_dots.bvh"])
@pytest.mark.parametrize("jobs", ["1", "2"])
@pytest.mark.usefixtures("two_processes")
def test_one_hostile_file_does_not_end_a_batch(
    data: Path, tmp_path: Path, motionary: Command, name: str, jobs: str
) -> None:
    folder = tmp_path / "mixed"
    folder.mkdir()
    for source in (data / "faults/hostile" / name, data / "faults/bvh_frame_time_0.033.bvh"):
        (folder / source.name).write_bytes(source.read_bytes())
    done = motionary("info", folder, "--json", "--jobs", jobs)
    rows = [json.loads(line) for line in done.out.splitlines()]
    assert {row["recording"] for row in rows} == {name, "bvh_frame_time_0.033.bvh"}
    assert done.code == 1


# Each line of links_and_outputs.sh.
def _run(*arguments: str, **options: object) -> subprocess.CompletedProcess:
    return subprocess.run(
        [*COMMAND, *arguments],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False, **options,  # type: ignore[call-overload]
    )  # fmt: skip


@pytest.fixture(scope="module")
def take(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("takes") / "take.bvh"
    path.write_bytes((data / "wild/20tab+bvh-python/test_mocapbank.bvh").read_bytes())
    return path


@pytest.fixture(scope="module")
def library(take: Path) -> Path:
    folder = take.parent / "examples" / "bow"
    folder.mkdir(parents=True)
    for number in (1, 2):
        (folder / f"{number}.bvh").write_bytes(take.read_bytes())
    mo.learn(folder.parent).save(take.parent / "lib")
    return take.parent / "lib"


def test_link_to_itself_hides_no_other_file(take: Path, tmp_path: Path, motionary: Command) -> None:
    folder = tmp_path / "d"
    folder.mkdir()
    (folder / "take.bvh").write_bytes(take.read_bytes())
    (folder / "self.bvh").symlink_to("self.bvh")
    done = motionary("info", folder)
    assert "take.bvh" in done.out
    assert "self.bvh" in done.out + done.err


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_named_pipe_is_passed_over_and_told(take: Path, tmp_path: Path, motionary: Command) -> None:
    folder = tmp_path / "e"
    folder.mkdir()
    (folder / "take.bvh").write_bytes(take.read_bytes())
    os.mkfifo(folder / "pipe.bvh")
    done = motionary("info", folder)
    assert "take.bvh" in done.out
    assert "pipe.bvh" in done.out + done.err
    # In a process of its own, which can be ended where it waits for ever.
    alone = _run("info", str(folder / "pipe.bvh"))
    assert alone.returncode == 1
    assert "Traceback" not in alone.stderr


def test_output_through_a_link_is_written_where_it_leads(
    take: Path, library: Path, tmp_path: Path, motionary: Command
) -> None:
    target, link = tmp_path / "target.csv", tmp_path / "out.csv"
    target.write_text("old\n")
    link.symlink_to("target.csv")
    arguments = ["annotate", take, "--library", library, "-o", link]
    # A table that is there is kept unless its loss is asked for.
    refused = motionary(*arguments)
    assert refused.code != 0
    assert target.read_text() == "old\n"
    assert link.is_symlink()
    assert "--force" in refused.err
    done = motionary(*arguments, "--force")
    assert done.code == 0, done.err
    assert link.is_symlink()
    assert target.read_text().startswith("recording,label")


def test_read_only_output_is_refused(
    take: Path, library: Path, tmp_path: Path, motionary: Command
) -> None:
    kept = tmp_path / "ro.csv"
    kept.write_text("old\n")
    kept.chmod(0o444)
    done = motionary("annotate", take, "--library", library, "-o", kept, "--force")
    assert done.code == 1
    assert "ro.csv" in done.err
    assert kept.read_text() == "old\n"
    assert kept.stat().st_mode & 0o777 == 0o444


def test_output_keeps_the_mode_of_the_file_it_replaces(
    take: Path, library: Path, tmp_path: Path, motionary: Command
) -> None:
    kept = tmp_path / "private.csv"
    kept.write_text("old\n")
    kept.chmod(0o600)
    done = motionary("annotate", take, "--library", library, "-o", kept, "--force")
    assert done.code == 0, done.err
    assert kept.stat().st_mode & 0o777 == 0o600


def test_dash_is_standard_output(take: Path, library: Path, tmp_path: Path) -> None:
    done = _run("annotate", str(take), "--library", str(library), "-o", "-", cwd=tmp_path)
    assert "recording,label" in done.stdout
    assert not (tmp_path / "-").exists()


@pytest.mark.skipif(os.name != "posix", reason="closes a stream as a shell of POSIX does")
def test_closed_standard_output_is_no_traceback(take: Path) -> None:
    line = " ".join(f'"{part}"' for part in [*COMMAND, "info", str(take)]) + " >&-"
    done = subprocess.run(
        ["/bin/sh", "-c", line], stderr=subprocess.PIPE, text=True, timeout=PATIENCE_S, check=False
    )
    assert "Traceback" not in done.stderr
