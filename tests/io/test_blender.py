"""Blender itself, where it is: markers stand at the frames of their labels, and come back.

Runs in the Python that has `bpy`: this one, or the one that MOTIONARY_BLENDER names.
"""

import importlib.util
import json
import os
import subprocess
import sys

import numpy as np
import pytest

from cli_cases import write_bvh
from motionary.io import read, read_labels, write_labels
from motionary.labels import Label, LabelTrack
from motionary.samples import synthetic_motion

PYTHON = os.environ.get("MOTIONARY_BLENDER", "")
if not PYTHON and importlib.util.find_spec("bpy") is not None:
    PYTHON = sys.executable

pytestmark = pytest.mark.skipif(
    not PYTHON, reason="bpy is not there: MOTIONARY_BLENDER names no Python that has it"
)

SCRIPT = """
import json, os, sys
folder = sys.argv[1]
sys.path.insert(0, folder)
import bpy
import motionary_markers
motionary_markers.register()
armature = motionary_markers.load(folder + "/take.json")
scene, markers = bpy.context.scene, armature.animation_data.action.pose_markers
found = []
for marker in markers:
    scene.frame_set(marker.frame)
    found.append([marker.name, marker.frame, list(armature.pose.bones[0].head)])
motionary_markers.save(armature, folder + "/back.json")
said = {"fps": scene.render.fps / scene.render.fps_base, "markers": found}
print("@" + json.dumps(said), flush=True)
# The module bpy may crash when Python takes it down, after all is done.
os._exit(0)
"""


@pytest.mark.parametrize("rate", [30, 50])
def test_markers_stand_at_the_frames_of_their_labels(tmp_path, rate):
    write_bvh(synthetic_motion("squat", seed=0, rate_hz=rate), tmp_path / "take.bvh")
    motion = read(tmp_path / "take.bvh")
    labels = (Label("down", 4 / rate, 20 / rate), Label("up", 20 / rate, 41 / rate))
    track = LabelTrack(motion.recording, labels)
    out = tmp_path / "out"
    out.mkdir()
    write_labels(track, out / "take.json", to="blender", recording=tmp_path / "take.bvh")
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    ran = subprocess.run(
        [PYTHON, script, out], capture_output=True, text=True, timeout=300, check=False
    )
    assert ran.returncode == 0, ran.stderr
    said = json.loads(next(x[1:] for x in ran.stdout.splitlines() if x.startswith("@")))
    assert said["fps"] == pytest.approx(rate, rel=1e-3)
    assert {(name, frame) for name, frame, _ in said["markers"]} == {
        ("down start", 5), ("down end", 20), ("up start", 21), ("up end", 41)
    }  # fmt: skip
    for _, frame, (x, y, z) in said["markers"]:
        # Blender has z up, and the file's centimetres; its frames count from 1.
        root = 100 * motion.positions[frame - 1, 0]
        assert np.allclose([x, z, -y], root, atol=0.01)
    again = read_labels(out / "back.json")["take.bvh"]
    assert [(x.name, round(x.start_s * rate), round(x.end_s * rate)) for x in again] == [
        ("down", 4, 20), ("up", 20, 41)
    ]  # fmt: skip
