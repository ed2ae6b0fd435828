"""Are bones of FBX files where they turn, and is a crash of their reader an error?"""

import sys

import numpy as np
import pytest

from evidence import other_readers
from motionary.errors import InvalidInput, UnreadableFile
from motionary.io import read, write
from oracles.fbx_files import fbx_text

BONES = [("Hips", -1, (0, 100, 0)), ("Leg", 0, (0, -50, 0)), ("Foot", 1, (0, -40, 0))]


def make(folder, **options):
    n = 7
    turns = [[5.0 * i for i in range(n)], [-8.0 * i for i in range(n)], [0.0] * n]
    (folder / "a.fbx").write_text(fbx_text(BONES, turns, [2.0 * i for i in range(n)], **options))
    return folder / "a.fbx", np.radians(turns)


@pytest.mark.parametrize(("unit_cm", "up"), [(1.0, "y"), (2.54, "y"), (1.0, "z")])
def test_bones_turn_as_the_curves_say(tmp_path, unit_cm, up):
    pytest.importorskip("ufbx")
    path, turns = make(tmp_path, unit_cm=unit_cm, up=up)
    motion = read(path)
    assert motion.names == ("Hips", "Leg", "Foot")
    assert (motion.rate_hz, motion.n_frames) == (30, 7)
    for i in range(7):
        place, angle = np.array([2.0 * i, 100.0, 0.0]), turns[0, i]
        places = [place]
        for joint, length in ((1, 50), (2, 40)):
            place = place + length * np.array([np.sin(angle), -np.cos(angle), 0])
            places.append(place)
            angle += turns[joint, i]
        x, y, z = np.transpose(places) * unit_cm / 100
        expected = np.stack((x, y, z) if up == "y" else (x, z, -y), axis=1)
        np.testing.assert_allclose(motion.positions[i], expected, atol=1e-6)


def test_what_was_read_can_be_written_as_bvh(tmp_path):
    pytest.importorskip("ufbx")
    motion = read(make(tmp_path)[0])
    write(motion, tmp_path / "a.bvh")
    again = read(tmp_path / "a.bvh", unit="cm")
    assert again.names == motion.names
    np.testing.assert_allclose(again.positions, motion.positions, atol=1e-6)


def test_damaged_files_are_errors(tmp_path):
    pytest.importorskip("ufbx")
    path, _ = make(tmp_path)
    content = path.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(4):
        broken = bytearray(content)
        for place in rng.integers(len(broken), size=40):
            broken[place] = rng.integers(256)
        path.write_bytes(bytes(broken[: rng.integers(100, len(broken))]))
        if (reason := why_unreadable(path)) is not None:
            assert "a.fbx" in reason
            assert "\n" not in reason


def why_unreadable(path):
    """The words of the error, or None of a file that was read after all."""
    try:
        motion = read(path)
    except UnreadableFile as error:
        return str(error)
    return None if np.isfinite(motion.positions).all() else "not finite"


def test_a_crash_is_an_error(tmp_path, monkeypatch):
    pytest.importorskip("ufbx")
    path, _ = make(tmp_path)
    # Another program in the place of Python: one that is ended by a signal.
    crashing = tmp_path / "python"
    crashing.write_text("#!/bin/sh\nkill -SEGV $$\n")
    crashing.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(crashing))
    with pytest.raises(UnreadableFile, match="crashed on it"):
        read(path)
    crashing.write_text("#!/bin/sh\necho 'it went wrong' >&2\nexit 1\n")
    with pytest.raises(UnreadableFile, match="cannot be read as FBX: it went wrong"):
        read(path)


def test_without_its_reader_the_error_is_a_recipe(tmp_path, monkeypatch):
    path, _ = make(tmp_path)
    monkeypatch.setitem(sys.modules, "ufbx", None)
    with pytest.raises(UnreadableFile, match=r"motionary\[fbx\].*blender --background .*a\.bvh"):
        read(path)


# ---- takes


def with_empty_takes(path, *names):
    """The file with takes before its own, in which nothing moves."""
    text = path.read_text()
    for i, name in enumerate(names):
        stack, layer = 910 + 2 * i, 911 + 2 * i
        lines = [f'\tAnimationStack: {stack}, "AnimStack::{name}", "" {{', "\t\tProperties70:  {"]
        lines += ['\t\t\tP: "LocalStop", "KTime", "Time", "",153953860000', "\t\t}", "\t}"]
        lines += [f'\tAnimationLayer: {layer}, "AnimLayer::{name}", "" {{', "\t}", ""]
        at = text.index("\tAnimationStack: 900")
        text = text[:at] + "\n".join(lines) + text[at:]
        text = text.replace("Connections:  {", f'Connections:  {{\n\tC: "OO",{layer},{stack}', 1)
    path.write_text(text)


def test_the_take_that_moves_is_read_and_all_are_listed(tmp_path):
    pytest.importorskip("ufbx")
    path, _ = make(tmp_path)
    alone = read(path)
    assert not any("take" in note for note in alone.notes)
    with_empty_takes(path, "Take 001", "Take 002")
    motion = read(path)
    np.testing.assert_array_equal(motion.positions, alone.positions)
    assert any(
        note.startswith("take take, the first that moves, of 3 (Take 001, Take 002, take)")
        for note in motion.notes
    )


@pytest.mark.parametrize(
    ("take", "moves"), [("take", True), (3, True), ("3", True), ("Take 001", False), (2, False)]
)
def test_a_take_is_named_or_numbered(tmp_path, take, moves):
    pytest.importorskip("ufbx")
    path, _ = make(tmp_path)
    with_empty_takes(path, "Take 001", "Take 002")
    assert (np.ptp(read(path, take=take).positions, axis=0).max() > 0.1) == moves


@pytest.mark.parametrize("take", ["walk", 4, 0, "take "])
def test_a_take_that_is_not_there_is_refused_with_those_that_are(tmp_path, take):
    pytest.importorskip("ufbx")
    path, _ = make(tmp_path)
    with_empty_takes(path, "Take 001")
    with pytest.raises(
        InvalidInput, match=r"fbx: has no take .*; it has Take 001, take \(2 in all\)$"
    ):
        read(path, take=take)


# ---- the world as ufbx itself has it


# Scale is handed down in four ways, one of which shears: these files have all of them.
RIGS = (
    "danielrmz18+threejs-3d-model-personalized/Flair.fbx",
    "JLPM22+MotionMatching/HipHopDancing.fbx",
    "ufbx+ufbx/maya_character_7500_binary.fbx",
    "ufbx+ufbx/blender_293_barbarian_7400_binary.fbx",
    "keijiro+CMUMocap/Base.fbx",
)


@pytest.mark.parametrize("name", RIGS)
def test_places_equal_ufbx_own_world(data, name, monkeypatch):
    pytest.importorskip("ufbx")
    monkeypatch.setattr(other_readers, "FRAMES", 3)
    path = data / "wild" / name
    result = other_readers.compare(data, [path], other_readers.by_ufbx)
    assert result["agree"] == 1, result
