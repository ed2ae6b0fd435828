"""Recordings of sensors as their programs write them; synthetic files but for the last test."""

import numpy as np
import pytest

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.sensor_recordings import fill_packets
from motionary.io.sensors import (
    SensorRecording,
    read_sensor_file,
    read_sensors,
    write_mtw,
    write_orientations,
)

MTW = """// Start Time: Unknown
// Update Rate: 100.0Hz
PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z,Mag_X,Mag_Y,Mag_Z,Quat_q0,Quat_q1,Quat_q2,Quat_q3
65534,,0,0,9.8,0.1,0,0,1,0,0,1,0,0,0
65535,,0,0,9.8,0.2,0,0,1,0,0,1,0,0,0
1,,0,0,9.8,0.4,0,0,1,0,0,0,1,0,0
"""
DOT = """sep=,
PacketCounter,SampleTimeFine,Quat_W,Quat_X,Quat_Y,Quat_Z,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z,
0,100000,1,0,0,0,0,0,9.8,90,0,0,
1,116667,1,0,0,0,0,0,9.8,180,0,0,
2,133333,1,0,0,0,0,0,9.8,0,0,0,
"""
STO = """DataRate=60.0
DataType=Quaternion
version=3
endheader
time\tpelvis_imu\ttibia_l_imu
0\t1,0,0,0\t0,1,0,0
0.016667\t1,0,0,0\t0,1,0,0
0.033333\t0.7071068,0.7071068,0,0\t0,1,0,0
"""


def put(folder, name, text):
    path = folder / name
    path.write_text(text, "utf-8")
    return path


def test_xsens_text_with_missing_packets(tmp_path):
    (sensor,) = read_sensor_file(put(tmp_path, "Walk-000_00B40C45.txt", MTW))
    assert (sensor.name, sensor.rate_hz, sensor.n_frames) == ("00B40C45", 100.0, 4)
    np.testing.assert_allclose(sensor.gyr[:, 0], [0.1, 0.2, np.nan, 0.4])
    assert "1 packets are missing" in sensor.notes
    np.testing.assert_allclose(sensor.orientations[3], [0, 1, 0, 0])


def test_movella_dot_in_degrees(tmp_path):
    (sensor,) = read_sensor_file(put(tmp_path, "Fuß links.csv", DOT))
    assert sensor.name == "Fuß links"
    assert sensor.rate_hz == pytest.approx(60, abs=0.01)
    np.testing.assert_allclose(sensor.gyr[:, 0], [np.pi / 2, np.pi, 0])


def test_opensense_there_and_back(tmp_path):
    pelvis, shank = read_sensor_file(put(tmp_path, "o.sto", STO))
    assert (pelvis.name, shank.name) == ("pelvis", "tibia_l")
    assert pelvis.rate_hz == pytest.approx(60, abs=0.01)
    np.testing.assert_allclose(
        pelvis.orientations[2], [np.sqrt(0.5), np.sqrt(0.5), 0, 0], atol=1e-6
    )
    gap = pelvis.orientations.copy()
    gap[1] = np.nan
    write_orientations(tmp_path / "back.sto", {"a": gap, "b": shank.orientations[:2]}, 60.0)
    a, b = read_sensor_file(tmp_path / "back.sto")
    np.testing.assert_allclose(a.orientations[[0, 1, 2]], pelvis.orientations[[0, 0, 2]], atol=1e-6)
    assert b.n_frames == 3


def test_any_table_by_a_map_of_columns(tmp_path):
    path = put(
        tmp_path,
        "phone.csv",
        "t;wx;wy;wz;qx;qy;qz;qw\n0;57.3;0;0;0;0;0;1\n0.02;0;0;0;0;0;0;1\n0.04;0;0;0;0;0;0;1\n",
    )
    columns = {
        "gyr": ["wx", "wy", "wz"],
        "quaternion": ["qx", "qy", "qz", "qw"],
        "order": "xyzw",
        "units": {"gyr": "°/s"},
        "time": "t",
    }
    (sensor,) = read_sensor_file(path, columns=columns)
    assert sensor.rate_hz == pytest.approx(50)
    assert sensor.gyr[0, 0] == pytest.approx(1, abs=1e-3)
    np.testing.assert_allclose(sensor.orientations[0], [1, 0, 0, 0])
    toml = put(tmp_path, "map.toml", 'gyr = ["wx", "wy", "wz"]\nrate_hz = 50\n')
    assert read_sensors(path, columns=toml)[0].rate_hz == 50
    for text in ("gyr =", "rate_hz = " + "9" * 5000):
        with pytest.raises(UnreadableFile, match=r"map\.toml: is no TOML"):
            read_sensors(path, columns=put(tmp_path, "map.toml", text))
    for change, message in (
        ({"order": "wzyx"}, "wxyz or xyzw"),
        ({"gyr": ["a", "b", "c"]}, "needs 3 of the columns"),
        ({"units": {"gyr": "furlong"}}, "units of gyr"),
        ({"speed": 1}, "no key 'speed'"),
        ({"time": None}, "needs rate_hz"),
    ):
        with pytest.raises(UnreadableFile, match=message):
            read_sensor_file(path, columns=columns | change)


def test_hdf5_of_apdm_and_of_broad(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "apdm.h5", "w") as file:
        group = file.create_group("Sensors/1234")
        group["Time"] = np.arange(10) * 7812.5
        group["Gyroscope"] = np.ones((10, 3))
        group["Accelerometer"] = np.ones((10, 3))
        group.create_group("Configuration").attrs["Label 0"] = b"Left Shank"
        file["Processed/1234/Orientation"] = np.tile([1.0, 0, 0, 0], (10, 1))
    (sensor,) = read_sensor_file(tmp_path / "apdm.h5")
    assert (sensor.name, sensor.rate_hz, sensor.n_frames) == ("Left Shank", 128.0, 10)
    with h5py.File(tmp_path / "trial.hdf5", "w") as file:
        for key in ("gyr", "acc", "mag"):
            file[f"imu_{key}"] = np.ones((5, 3))
        file.attrs["sampling_rate"] = 285.7
    assert read_sensor_file(tmp_path / "trial.hdf5")[0].rate_hz == pytest.approx(285.7)
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    put(tmp_path, "no.h5", "no")
    for name, message in (("other.h5", "holds x"), ("no.h5", "no HDF5")):
        with pytest.raises(UnreadableFile, match=message):
            read_sensor_file(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.txt", "", "no rows"),
        ("a.txt", "x,y\n1,2\n3,4\n", "no known layout"),
        ("a.txt", MTW.replace("0.2,0", "abc,0"), "abc"),
        ("a.txt", MTW.replace("0.2,0", "abc,0"), "line 5: expected a number"),
        ("a.txt", MTW.replace("\n1,,", "\n40000,,"), "counted backwards"),
        ("a.txt", MTW.replace(",1,0,0,0\n", ",7,0,0,0\n"), "length is 7"),
        ("a.sto", STO.replace("endheader", "end"), "endheader"),
        ("a.sto", STO.replace("Quaternion", "double"), "DataType=Quaternion"),
        ("a.sto", STO.replace("0,1,0,0", "0,1,0"), "four numbers"),
        ("a.pdf", "x", "are .txt"),
    ],
)
def test_damaged_files_are_refused_with_what_was_expected(tmp_path, name, text, message):
    with pytest.raises(UnreadableFile, match=message):
        read_sensor_file(put(tmp_path, name, text))


def test_a_folder_reads_what_it_can_and_tells_copies(tmp_path):
    put(tmp_path, "a_00B40C45.txt", MTW)
    put(tmp_path, "a_00B40C46.txt", MTW)
    put(tmp_path, "broken.txt", "nothing")
    (sensor,) = read_sensors(tmp_path)
    assert any("00B40C46 holds the same numbers" in note for note in sensor.notes)
    assert any("not read: broken.txt" in note for note in sensor.notes)
    (tmp_path / "empty").mkdir()
    with pytest.raises(UnreadableFile, match="no recordings of sensors"):
        read_sensors(tmp_path / "empty")


def test_impossible_values_and_units(tmp_path):
    text = MTW.replace("0.2,0,0", "900,0,0").replace("9.8", "1.0")
    (sensor,) = read_sensor_file(put(tmp_path, "a.txt", text))
    assert np.isnan(sensor.gyr[1, 0])
    assert sensor.acc[0, 2] == pytest.approx(9.81)
    assert any("multiples of g" in note for note in sensor.notes)
    with pytest.raises(InvalidInput, match="neither"):
        SensorRecording("x", 100.0)
    with pytest.raises(InvalidInput, match="1 to 10000 Hz"):
        SensorRecording("x", float("nan"), orientations=np.zeros((3, 4)))
    with pytest.raises(InvalidInput, match="backwards"):
        fill_packets(np.array([5.0, 4.0]), np.zeros((2, 1)))


def test_what_is_written_as_xsens_text_reads_back(tmp_path):
    rng = np.random.default_rng(0)
    made = SensorRecording("S", 100.0, rng.normal(size=(5, 3)), rng.normal(size=(5, 3)) + 9)
    write_mtw(tmp_path / "S.txt", made)
    (back,) = read_sensor_file(tmp_path / "S.txt")
    np.testing.assert_allclose(back.gyr, made.gyr, atol=1e-6)
    assert (back.mag, back.orientations, back.rate_hz) == (None, None, 100.0)
