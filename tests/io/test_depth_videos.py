"""Depth in .bag and .mkv, in files that rosbags and PyAV themselves write."""

import json

import numpy as np
import pytest

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.depth_images import read_depth

IMAGES = np.random.default_rng(4).integers(900, 4000, (3, 288, 320)).astype(np.uint16)
# As an Azure Kinect's: shares of the sensor's 1024 x 1024, the last two p2 and p1.
NUMBERS = [0.5122698, 0.4945123, 0.4921168, 0.4921668, *[0.0] * 10]


def calibration(numbers=NUMBERS):
    cameras = [
        {"Purpose": f"CALIBRATION_CameraPurpose{kind}", "Intrinsics": {"ModelParameters": own}}
        for kind, own in (("PhotoVideo", [1.0] * 14), ("Depth", numbers))
    ]
    return json.dumps({"CalibrationInformation": {"Cameras": cameras}}).encode()


def write_bag(path, images, *, topics=None, encoding="mono16", unit=None, stamps=None):
    rosbag1 = pytest.importorskip("rosbags.rosbag1")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    kinds = store.types
    time = kinds["builtin_interfaces/msg/Time"](0, 0)
    header = kinds["std_msgs/msg/Header"](0, time, "")
    region = kinds["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    stream = "/device_0/sensor_0/Depth_0"
    image_topic, info_topic = topics or (f"{stream}/image/data", f"{stream}/info/camera_info")
    height, width = images.shape[1:]
    matrix = np.array([400.0, 0, 161, 0, 410, 143, 0, 0, 1])
    info = kinds["sensor_msgs/msg/CameraInfo"](
        header, height, width, "plumb_bob", np.zeros(5), matrix, np.eye(3).ravel(), np.zeros(12),
        0, 0, region,
    )  # fmt: skip
    with rosbag1.Writer(path) as writer:

        def write(topic, kind, message, stamp):
            own = next((one for one in writer.connections if one.topic == topic), None)
            own = own or writer.add_connection(topic, kind, typestore=store)
            writer.write(own, stamp, store.serialize_ros1(message, kind))

        write(info_topic, "sensor_msgs/msg/CameraInfo", info, 0)
        if unit is not None:
            value = kinds["std_msgs/msg/Float32"](unit)
            write("/device_0/sensor_0/option/Depth_Units/value", "std_msgs/msg/Float32", value, 0)
        for number, one in enumerate(images):
            image = kinds["sensor_msgs/msg/Image"](
                header, height, width, encoding, 0, one.strides[0], one.view(np.uint8).ravel()
            )
            stamp = round(1e9 * (stamps[number] if stamps else number / 15))
            write(image_topic, "sensor_msgs/msg/Image", image, stamp)
    return path


def write_mkv(path, images, *, codec="ffv1", attached=None, titles=("DEPTH",)):
    av = pytest.importorskip("av")
    with av.open(str(path), "w", options={"allow_raw_vfw": "1"}) as container:
        tracks = []
        for title in titles:
            track = container.add_stream(codec, rate=30)
            track.height, track.width = images.shape[1:]
            track.pix_fmt = "gray16le" if codec == "ffv1" else "gray16be"
            track.metadata["title"] = title
            tracks.append(track)
        if attached is not None:
            container.add_attachment("calibration.json", "application/octet-stream", attached)
        for number, one in enumerate(images):
            for track, sign in zip(tracks, (1, 0), strict=False):
                frame = av.VideoFrame.from_ndarray(one * np.uint16(sign), format=track.pix_fmt)
                frame.pts = number
                container.mux(track.encode(frame))
        for track in tracks:
            container.mux(track.encode())
    if codec == "rawvideo":
        # As k4arecorder writes: big-endian, named so in the track's BITMAPINFOHEADER.
        content = path.read_bytes()
        bits = b"\x01\x00\x10\x00"
        assert content.count(bits + bytes(4)) == 1
        path.write_bytes(content.replace(bits + bytes(4), bits + b"b16g"))
    return path


def test_a_bag_of_realsense_is_read_with_its_unit_and_camera(tmp_path):
    recording = read_depth(
        write_bag(tmp_path / "a.bag", IMAGES, unit=0.0005, stamps=[0.0, 0.1, 0.2])
    )
    assert (recording.width, recording.height, len(recording)) == (320, 288, 3)
    assert recording.focal == (400, 410)
    assert recording.centre == (161, 143)
    assert recording.rate_hz == pytest.approx(10)
    for _ in range(2):
        np.testing.assert_allclose(list(recording.images()), IMAGES * 0.0005, rtol=1e-6)


def test_a_bag_of_ros_is_read_with_the_camera_beside_its_images(tmp_path):
    topics = ("/camera/depth/image_rect_raw", "/camera/depth/camera_info")
    path = write_bag(tmp_path / "a.bag", IMAGES, topics=topics, encoding="16UC1")
    np.testing.assert_array_equal(next(read_depth(path).images()), IMAGES[0] * 0.001)
    metres = (IMAGES / 1000).astype(np.float32)
    path = write_bag(tmp_path / "b.bag", metres, topics=topics, encoding="32FC1")
    np.testing.assert_array_equal(next(read_depth(path).images()), metres[0])
    colour = write_bag(tmp_path / "c.bag", IMAGES, topics=("/camera/color/image", "/camera/info"))
    with pytest.raises(UnreadableFile, match=r"c\.bag: holds no images of depth; it has /camera"):
        read_depth(colour)
    with pytest.raises(InvalidInput, match="16UC1, mono16, 32FC1, got rgb8"):
        read_depth(write_bag(tmp_path / "d.bag", IMAGES, encoding="rgb8"))


@pytest.mark.parametrize("codec", ["ffv1", "rawvideo"])
def test_a_track_of_depth_is_read_without_loss(tmp_path, codec):
    path = write_mkv(tmp_path / "a.mkv", IMAGES, attached=calibration(), codec=codec)
    recording = read_depth(path)
    # The camera that Azure Kinect's SDK tells of these numbers, in the binned mode.
    assert recording.focal == pytest.approx((251.964, 251.989), abs=1e-3)
    assert recording.centre == pytest.approx((165.782, 162.690), abs=1e-3)
    assert recording.rate_hz == pytest.approx(30, rel=0.02)
    for _ in range(2):
        np.testing.assert_array_equal(list(recording.images()), IMAGES * 0.001)


def test_the_track_of_depth_is_told_from_infrared_and_intrinsics_lie_beside_it(tmp_path):
    path = write_mkv(tmp_path / "a.mkv", IMAGES, titles=("DEPTH", "IR"))
    with pytest.raises(InvalidInput, match="intrinsics are missing"):
        read_depth(path)
    beside = {"focal": [250, 251], "centre": [160, 144]}
    (tmp_path / "a.json").write_text(json.dumps(beside), "utf-8")
    recording = read_depth(path)
    assert recording.focal == (250, 251)
    np.testing.assert_array_equal(next(recording.images()), IMAGES[0] * 0.001)
    small = np.ascontiguousarray(IMAGES[:, :40, :50])
    other = write_mkv(tmp_path / "b.mkv", small, attached=calibration())
    with pytest.raises(InvalidInput, match=r"is for images of .*, got \(50, 40\)"):
        read_depth(other)
    with pytest.raises(InvalidInput, match="calibration"):
        read_depth(write_mkv(tmp_path / "c.mkv", IMAGES, attached=b"{}"))


def test_what_the_lens_bends_is_put_straight(tmp_path):
    bent = [*NUMBERS[:4], 0.3, *[0.0] * 9]
    images = np.full((1, 288, 320), 2000, np.uint16)
    # A point 0.4 to the right of the axis is seen at 0.4 (1 + 0.3 * 0.16).
    focal, centre = 0.4921168 * 512, (0.5122698 * 512 - 96.5, 0.4945123 * 512 - 90.5)
    column, row = round(centre[0] + focal * 0.4 * 1.048), round(centre[1])
    images[0, row - 1 : row + 2, column - 1 : column + 2] = 3000
    path = write_mkv(tmp_path / "a.mkv", images, attached=calibration(bent))
    image = next(read_depth(path).images())
    rows, columns = np.nonzero(image == 3.0)
    assert columns.mean() == pytest.approx(centre[0] + focal * 0.4, abs=1)
    assert rows.mean() == pytest.approx(centre[1], abs=1)
    # The corners of the straight image are not in the bent one.
    assert np.isnan(image[0, 0])


@pytest.mark.parametrize("name", ["a.bag", "a.mkv"])
def test_a_damaged_file_is_told(tmp_path, name):
    pytest.importorskip("rosbags" if name == "a.bag" else "av")
    whole = (write_bag if name == "a.bag" else write_mkv)(tmp_path / f"whole{name[1:]}", IMAGES)
    for content in (b"x" * 50, whole.read_bytes()[:300]):
        (tmp_path / name).write_bytes(content)
        with pytest.raises((UnreadableFile, InvalidInput), match=name):
            read_depth(tmp_path / name)
