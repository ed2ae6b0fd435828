"""Calibrations of all formats, written here after their published layouts."""

import numpy as np
import pytest

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.cameras import read_cameras
from motionary.multiview import project, undistort
from view_cases import FOCAL, HEIGHT, WIDTH, pinhole, ring, rodrigues, write_toml

POINTS = np.random.default_rng(1).uniform(-0.8, 0.8, (20, 3)) + np.array([0, 0, 0.9])


def write_qualisys(path, cameras):
    rows = []
    for k, (turn, move) in enumerate(cameras):
        place = -turn.T @ move * 1000
        axes = np.diag([1, -1, -1]) @ turn
        cells = " ".join(f'r{i + 1}{j + 1}="{axes[i, j]!r}"' for i in range(3) for j in range(3))
        rows.append(
            f'<camera active="1" serial="{26000 + k}" model="Miqus Video" avg-residual="0.5">'
            f'<fov_video left="0" top="0" right="{WIDTH - 1}" bottom="{HEIGHT - 1}"/>'
            f'<transform x="{place[0]!r}" y="{place[1]!r}" z="{place[2]!r}" {cells}/>'
            f'<intrinsic focallength="9" focalLengthU="{FOCAL * 64}" focalLengthV="{FOCAL * 64}" '
            f'centerPointU="{WIDTH / 2 * 64}" centerPointV="{HEIGHT / 2 * 64}" skew="0" '
            'radialDistortion1="0" radialDistortion2="0" radialDistortion3="0" '
            'tangentalDistortion1="0" tangentalDistortion2="0"/></camera>'
        )
    rows.append('<camera active="1" serial="9" model="Miqus M3"/>')
    text = "".join(rows).replace("np.float64(", "").replace(')"', '"')
    path.write_text(f"<calibration><cameras>{text}</cameras></calibration>")


def matrix_block(key, values):
    shape = np.atleast_2d(values).shape
    numbers = ", ".join(f"{value:.16e}" for value in np.ravel(values))
    return (
        f"{key}: !!opencv-matrix\n   rows: {shape[0]}\n   cols: {shape[1]}\n   dt: d\n"
        f"   data: [ {numbers} ]\n"
    )


def intrinsics():
    return np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])


def write_easymocap(folder, cameras):
    names = [f"{k + 1:02d}" for k in range(len(cameras))]
    head = "%YAML:1.0\n---\nnames:\n" + "".join(f'   - "{name}"\n' for name in names)
    inner = "".join(
        matrix_block(f"K_{name}", intrinsics()) + matrix_block(f"dist_{name}", np.zeros((1, 5)))
        for name in names
    )
    outer = "".join(
        matrix_block(f"R_{name}", np.reshape(rodrigues(turn), (3, 1)))
        + matrix_block(f"Rot_{name}", turn) + matrix_block(f"T_{name}", move.reshape(3, 1))
        for name, (turn, move) in zip(names, cameras, strict=True)
    )  # fmt: skip
    folder.mkdir()
    (folder / "intri.yml").write_text(head + inner)
    (folder / "extri.yml").write_text(head + outer)


def write_xml(folder, cameras):
    folder.mkdir()
    for k, (turn, move) in enumerate(cameras):
        parts = {"CameraMatrix": intrinsics(), "DistortionCoeffs": np.zeros(5),
                 "Rotation": rodrigues(turn), "Translation": move}  # fmt: skip
        text = "".join(
            f'<{key} type_id="opencv-matrix"><rows>1</rows><cols>1</cols><dt>d</dt><data>\n'
            + " ".join(f"{value:.16e}" for value in np.ravel(values)) + f"</data></{key}>"
            for key, values in parts.items()
        )  # fmt: skip
        (folder / f"cam{k + 1}.xml").write_text(
            f'<?xml version="1.0"?><opencv_storage>{text}</opencv_storage>'
        )


WRITERS = {
    "calib.toml": write_toml,
    "session.qca.txt": write_qualisys,
    "easymocap": write_easymocap,
    "xml": write_xml,
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_the_cameras_that_were_written(tmp_path, name):
    cameras = ring()
    WRITERS[name](tmp_path / name, cameras)
    read = read_cameras(tmp_path / name)
    assert len(read) == 4
    for one, written in zip(read, cameras, strict=True):
        assert project(one, POINTS) == pytest.approx(pinhole(written, POINTS), abs=1e-6)
        assert one.size in (None, (WIDTH, HEIGHT))


def oracle_lens(flat, lens, fisheye):
    """Distortion of OpenCV, point by point, as its manual defines it."""
    result = []
    for x, y in flat:
        r = np.hypot(x, y)
        if fisheye:
            angle = np.arctan(r)
            bent = angle * (1 + sum(k * angle ** (2 * i + 2) for i, k in enumerate(lens)))
            result.append((x * bent / r, y * bent / r))
        else:
            k1, k2, p1, p2, k3 = lens
            factor = 1 + k1 * r**2 + k2 * r**4 + k3 * r**6
            result.append((x * factor + 2 * p1 * x * y + p2 * (r**2 + 2 * x**2),
                           y * factor + p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y))  # fmt: skip
    return np.array(result)


@pytest.mark.parametrize(
    ("lens", "fisheye"),
    [([-0.37, 0.2, 3e-4, 2e-5, -0.07], False), ([0.05, -0.01, 0.002, -0.0005], True)],
)
def test_lenses_are_those_of_opencv_and_are_undone(tmp_path, lens, fisheye):
    write_toml(tmp_path / "calib.toml", ring(2))
    text = (tmp_path / "calib.toml").read_text()
    text = text.replace("[ 0.0, 0.0, 0.0, 0.0,]", str(lens))
    (tmp_path / "calib.toml").write_text(text.replace("false", str(fisheye).lower()))
    camera = read_cameras(tmp_path / "calib.toml")[0]
    seen = POINTS @ camera.rotation.T + camera.translation
    flat = seen[:, :2] / seen[:, 2:]
    expected = oracle_lens(flat, lens, fisheye) * FOCAL + [WIDTH / 2, HEIGHT / 2]
    assert project(camera, POINTS) == pytest.approx(expected, abs=1e-9)
    assert undistort(camera, expected) == pytest.approx(flat, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.toml", "[metadata]\nx = 1", "holds no camera"),
        ("a.toml", "[cam]\nmatrix = [[1,0,0],[0,1,0],[0,0,1]]", "lacks a rotation"),
        ("a.toml", "[c]\nmatrix = [1, 2]\nrotation = [0, 0, 0]\ntranslation = [0, 0, 0]", "3 x 3"),
        ("a.yml", "nothing", "no YAML of OpenCV"),
        ("a.xml", "<a>", "no XML of OpenCV"),
        ("a.xml", "<!DOCTYPE a><a/>", "entities"),
        ("a.qca.txt", "<calibration/>", "needs cameras"),
        ("a.pdf", "", "is no calibration"),
    ],
)
def test_what_is_no_calibration_is_refused(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises((UnreadableFile, InvalidInput), match=message):
        read_cameras(tmp_path / name)
