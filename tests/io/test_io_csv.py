"""Tables of points: Motive's and Nexus' layouts, written here after what they document."""

import re

import numpy as np
import pytest

from motionary import read
from motionary.errors import InvalidInput, UnreadableFile

MOTIVE = (
    "Format Version,1.23,Take Name,t,Capture Frame Rate,120,Export Frame Rate,120,"
    "Length Units,Meters,Coordinate Space,Global\n"
    "\n"
    ",Type,Bone,Bone,Bone,Bone,Bone,Bone,Bone,Marker,Marker,Marker\n"
    ",Name,S:Hip,S:Hip,S:Hip,S:Hip,S:Hip,S:Hip,S:Hip,S:m1,S:m1,S:m1\n"
    ",ID,1,1,1,1,1,1,1,2,2,2\n"
    ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Position,Position,Position\n"
    "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,X,Y,Z\n"
    "0,0.000000,0,0,0,1,0.1,0.9,0.2,5,5,5\n"
    "1,0.008333,0,0,0,1,,,,5,5,5\n"
)
NEXUS = (
    "Trajectories\n100\n,,P:LASI,,,P:RASI,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n"
    "5,0,100,200,900,300,200,900\n6,0,101,200,900,,,\n"
)


def put(folder, text, name="points.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_motive_gives_bones_in_metres(tmp_path):
    motion = read(put(tmp_path, MOTIVE))
    assert (motion.names, motion.rate_hz, motion.n_frames) == (("Hip",), 120, 2)
    np.testing.assert_allclose(motion.positions[0, 0], [0.1, 0.9, 0.2])
    assert np.isnan(motion.positions[1]).all()


def test_nexus_gives_markers_in_its_unit(tmp_path):
    motion = read(put(tmp_path, NEXUS), up="y")
    assert (motion.names, motion.rate_hz, motion.first_frame) == (("LASI", "RASI"), 100, 5)
    np.testing.assert_allclose(motion.positions[0, 0], [0.1, 0.2, 0.9])
    assert np.isnan(motion.positions[1, 1]).all()


@pytest.mark.parametrize(
    ("head", "separator", "point"),
    [
        ("time,hip_x,hip_y,hip_z", ",", "."),
        ("timestamp_ms,hip.X,hip.Y,hip.Z", ",", "."),
        ("t;hip x;hip y;hip z", ";", ","),
        ("time\thip:z\thip:y\thip:x", "\t", "."),
    ],
)
def test_plain_tables(tmp_path, head, separator, point):
    scale = 1000 if "ms" in head else 1
    order = (2, 1, 0) if head.endswith("x") and "\t" in head else (0, 1, 2)
    rows = []
    for i in range(4):
        places = [1.5, 2.5, 3.5 + i]
        cells = [i / 50 * scale, *(places[k] for k in order)]
        rows.append(separator.join(str(c).replace(".", point) for c in cells))
    motion = read(put(tmp_path, "\n".join([head, *rows])), unit="m", up="y")
    assert (motion.names, motion.rate_hz) == (("hip",), 50)
    np.testing.assert_allclose(motion.positions[:, 0, 2], [3.5, 4.5, 5.5, 6.5])


def test_what_is_missing_is_said(tmp_path):
    with pytest.raises(UnreadableFile, match="columns such as hip_x, hip_y, hip_z"):
        read(put(tmp_path, "recording,label,start_s,end_s\nx,a,1,2\n"))
    with pytest.raises(InvalidInput, match="without times has no rate; pass the rate"):
        read(put(tmp_path, "frame,hip_x,hip_y,hip_z\n1,1,2,3\n"))
    with pytest.raises(UnreadableFile, match=r"points.csv, line 2: expected a number, got 'b'"):
        read(put(tmp_path, "time,hip_x,hip_y,hip_z\n0,1,b,3\n"))


@pytest.mark.parametrize(
    ("name", "way_out"),
    [
        ("a.pt", "torch.load"),
        ("a.PTH", "torch.load"),
        ("a.usd", "blender --background .*usd_import.*'a.usd'.*'a.bvh'"),
        ("a.dae", "blender --background .*collada_import"),
        ("a.blend", "blender --background .*open_mainfile"),
        ("it's $(x).usda", "usd_import.*filepath='FILE.usda'"),
        ("a.abc", "without joints"),
        ("a.xlsx", "as CSV"),
    ],
)
def test_formats_that_are_not_read_name_the_way_out(tmp_path, name, way_out):
    with pytest.raises(UnreadableFile, match=rf"{re.escape(name)}: .*{way_out}") as caught:
        read(put(tmp_path, "x", name))
    assert len(str(caught.value).replace(str(tmp_path), "")) < 500
