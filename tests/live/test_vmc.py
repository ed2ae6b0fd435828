"""Poses of VMC: against positions computed another way, from the wire to labels, and damaged."""

import json
import math
import socket
import sys
import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import motionary as mo
from cli_cases import run, write_bvh
from motionary.errors import InvalidInput
from motionary.live import (
    LivePeople,
    OscSender,
    OscSource,
    VmcReader,
    write_messages,
)
from motionary.motion import GENERIC_JOINTS
from motionary.samples import synthetic_motion, synthetic_stream

BONE, ROOT = "/VMC/Ext/Bone/Pos", "/VMC/Ext/Root/Pos"
TREE = {
    "Hips": None, "Spine": "Hips", "Chest": "Spine", "Neck": "Chest", "Head": "Neck",
    "LeftUpperArm": "Chest", "LeftLowerArm": "LeftUpperArm", "LeftHand": "LeftLowerArm",
    "RightUpperLeg": "Hips", "RightLowerLeg": "RightUpperLeg", "RightFoot": "RightLowerLeg",
}  # fmt: skip


@pytest.fixture(scope="module")
def take():
    return synthetic_stream(("squat",), seed=4, rate_hz=30.0)[0]


@pytest.fixture(scope="module")
def library():
    examples = [synthetic_motion("squat", seed=seed) for seed in range(4)]
    return mo.learn({"squat": [mo.compute_features(one) for one in examples]})


def random_pose(rng, *, without=()):
    """Messages of a pose, and where Unity would put the bones: matrices in its own axes."""
    world = {None: np.eye(4)}
    root = [*rng.normal(size=3), *Rotation.random(random_state=rng).as_quat()]
    world[None] = matrix(root)
    messages = [(ROOT, ["root", *root])]
    for bone, above in TREE.items():
        own = [*rng.normal(size=3), *Rotation.random(random_state=rng).as_quat()]
        world[bone] = world[above] @ matrix(own)
        if bone not in without:
            messages.append((BONE, [bone, *own]))
    return messages, {bone: world[bone][:3, 3] for bone in TREE}


def matrix(numbers):
    result = np.eye(4)
    result[:3, :3] = Rotation.from_quat(numbers[3:]).as_matrix()
    result[:3, 3] = numbers[:3]
    return result


def read_all(reader, messages, arrived_s=0.0):
    return [
        json.loads(line)
        for address, values in messages
        for line in reader.push(address, values, arrived_s=arrived_s)
    ]


def test_bones_stand_where_matrices_in_unitys_axes_put_them():
    rng = np.random.default_rng(3)
    reader = VmcReader()
    # Which bones there are is known once one comes again.
    first, _ = random_pose(rng)
    second, expected = random_pose(rng)
    assert read_all(reader, first) == []
    head, _, pose = read_all(reader, second)
    assert len(head["joints"]) == len(TREE)
    found = dict(zip(head["joints"], pose["positions"], strict=True))
    for bone, at in expected.items():
        name = bone[0].lower() + bone[1:]
        assert found[name] == pytest.approx(at * (-1, 1, 1), abs=1e-9)


def test_what_hangs_on_a_bone_that_did_not_come_is_not_seen():
    rng = np.random.default_rng(4)
    reader = VmcReader()
    read_all(reader, random_pose(rng)[0] * 2)
    lost, expected = random_pose(rng, without=("LeftLowerArm",))
    # Bones of the next pose tell that this one is over.
    [pose] = read_all(reader, [*lost, (BONE, ["Hips", 0, 1, 0, 0, 0, 0, 1])])
    names = list(reader._bones)
    missing = {names[i] for i, row in enumerate(pose["positions"]) if row is None}
    assert missing == {"LeftLowerArm", "LeftHand"}
    at = pose["positions"][names.index("RightFoot")]
    assert at == pytest.approx(expected["RightFoot"] * (-1, 1, 1), abs=1e-9)


def as_pose(reader, time_s=None, arrived_s=0.0, hips=(0, 1, 0, 0, 0, 0, 1)):
    own = [] if time_s is None else [("/VMC/Ext/T", [time_s])]
    messages = [*own, (BONE, ["Hips", *hips]), (BONE, ["Spine", 0, 0.2, 0, 0, 0, 0, 1])]
    return [line for line in read_all(reader, messages, arrived_s) if "time_s" in line]


def test_times_are_the_senders_and_come_from_arrival_where_it_has_none():
    reader = VmcReader()
    assert as_pose(reader, 5.0, 100.0) == []
    assert [p["time_s"] for p in as_pose(reader, 5.5, 100.6)] == [5.0, 5.5]
    assert [p["time_s"] for p in as_pose(reader, None, 100.8)] == [5.7]
    # Its clock is a little behind the guess: time goes on. A clock set back is passed on.
    assert [p["time_s"] for p in as_pose(reader, 5.69, 100.9)] == [5.701]
    assert [p["time_s"] for p in as_pose(reader, 0.5, 101.0)] == [0.5]
    # After days a float of 32 bits has no more than such steps.
    days = VmcReader()
    told = [float(np.float32(300_000 + i / 60)) for i in range(60)]
    poses = [p for i, t in enumerate(told) for p in as_pose(days, t, i / 60)]
    steps = np.diff([pose["time_s"] for pose in poses])
    assert (steps > 0).all()
    assert steps[2:] == pytest.approx(1 / 60, abs=0.02)


@pytest.mark.parametrize(
    ("address", "values", "what"),
    [
        (BONE, ["Hips", 1, 2], "needs 7 numbers"),
        (BONE, ["Hips", "a", 0, 0, 0, 0, 0, 1], "needs 7 numbers"),
        (ROOT, [], "needs 7 numbers"),
        ("/VMC/Ext/T", [], "needs 1 numbers"),
        ("/VMC/Ext/T", ["late"], "needs 1 numbers"),
        ("/VMC/Ext/T", [math.nan], "needs a time in seconds, got nan"),
    ],
)
def test_messages_that_are_not_as_the_protocol_has_them_are_refused(address, values, what):
    with pytest.raises(InvalidInput, match=what):
        VmcReader().push(address, values, arrived_s=0.0)


def test_numbers_that_are_none_are_joints_that_are_not_seen():
    nan, inf = math.nan, math.inf
    for hips in ((nan, 1, 0, 0, 0, 0, 1), (0, 1, inf, 0, 0, 0, 1), (0, 1, 0, 0, 0, 0, 0)):
        reader = VmcReader()
        as_pose(reader)
        _, pose = as_pose(reader, hips=hips)
        assert pose["positions"][1] is None
    # What nobody asked for is passed over; bones without length are told.
    assert VmcReader().push("/VMC/Ext/Blend/Val", ["A", 1.0], arrived_s=0.0) == []
    assert VmcReader().push(BONE, ["Jaw"], arrived_s=0.0) == []
    # OSC has arrays, too.
    assert VmcReader().push(BONE, [["Hips"], 0, 1, 0, 0, 0, 0, 1], arrived_s=0.0) == []
    reader = VmcReader()
    short = [(BONE, [name, 0, 0, 0, 0, 0, 0, 1]) for name in ("Hips", "Spine", "Hips")]
    with pytest.raises(InvalidInput, match="no length"):
        read_all(reader, short)


def test_a_recording_that_is_sent_has_its_joints_where_they_were(take):
    reader, rows, names = VmcReader(), [], None
    for messages in write_messages(take):
        for line in read_all(reader, messages):
            names = line.get("joints", names)
            rows += [line["positions"]] if "positions" in line else []
    expected = take.generic_positions()
    assert len(rows) == len(expected)
    table = {"hips": "root", "leftHand": "lwrist", "rightFoot": "rankle", "head": "head"}
    for bone, joint in table.items():
        found = np.array([row[names.index(bone)] for row in rows])
        assert found == pytest.approx(expected[:, GENERIC_JOINTS.index(joint)], abs=1e-6)
    # Bones turn, they do not shift: of a stiff body their offsets stay.
    lower = [v for m in write_messages(take) for a, v in m if v[0] == "LeftLowerLeg"]
    assert np.ptp(np.array([v[1:4] for v in lower]), axis=0).max() < 0.03
    assert np.ptp(np.array([v[4:] for v in lower]), axis=0).max() > 0.1


@pytest.fixture
def source():
    pytest.importorskip("pythonosc")
    told = []
    found = OscSource(0, tell=told.append)
    yield found, told
    found.close()


def wait_for(is_so):
    deadline = time.monotonic() + 10
    while not is_so() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert is_so()


def test_a_recording_sent_by_osc_has_the_labels_of_annotate(source, take, library):
    osc, told = source
    take = take.cut(30, 125)
    sender = OscSender(osc.port, tell=told.append)
    people, events = LivePeople(library, rate_hz=30.0), []
    arrived = osc.lines()
    for n, messages in enumerate(write_messages(take)):
        sender.send(messages)
        # The first pose comes with the second, a head before it.
        for _ in range(0 if n == 0 else 3 if n == 1 else 1):
            events += people.push(next(arrived)[1], sender="a")
    sender.close()
    events += people.finish()
    seen = take.generic_positions()
    seen[:, GENERIC_JOINTS.index("headtop")] = np.nan
    track = mo.annotate(mo.compute_features(seen, rate_hz=30.0), library)
    found = [e.event.label for e in events if e.event.status == "final"]
    assert [(x.name, x.start_frame, x.end_frame) for x in found] == [
        (x.name, x.start_frame, x.end_frame) for x in track
    ]
    assert found
    assert told == []


def test_wrong_ports_and_strangers_bytes_are_told(source, monkeypatch):
    osc, told = source
    with pytest.raises(InvalidInput, match=rf"port {osc.port} of 127.0.0.1 .* with --osc"):
        OscSource(osc.port, tell=told.append)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.connect(("127.0.0.1", osc.port))
        for content in (b"", b"garbage", b"\x16\x03\x01\x02", b"/a\0\0,f\0\0", b"#bundle\0" * 9):
            stranger.send(content)
        for _ in range(4):
            stranger.send(b"\xff" * 50)
        wait_for(lambda: osc._n_wrong >= 6)
    assert all("no message of OSC" in text for text in told)
    assert len(told) == 5
    monkeypatch.setattr("motionary.live.sources.SILENT_S", 0.2)
    monkeypatch.setattr("motionary.live.sources._TICK_S", 0.05)
    # Who was there before is awaited, then counts as silent.
    assert next(osc.lines(awaited=["gone"])) == ("gone", None)
    assert "no pose has come" in told[-1]


def test_poses_that_find_no_room_are_lost_and_told(source):
    osc, told = source
    sender = OscSender(osc.port, tell=told.append)
    pose = [(BONE, ["Hips", 0, 1, 0, 0, 0, 0, 1]), (BONE, ["Spine", 0, 0.2, 0, 0, 0, 0, 1])]
    for i in range(5000):
        sender.send(pose)
        if told:
            break
        # The system drops messages, too, and tells nobody.
        if i % 50 == 0:
            time.sleep(0.01)
    wait_for(lambda: told)
    sender.close()
    assert "those that find no room are lost" in told[0]


@pytest.mark.skipif(sys.platform != "linux", reason="others do not tell that nobody listens")
def test_that_nobody_takes_messages_is_told_once():
    pytest.importorskip("pythonosc")
    told = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    sender = OscSender(port, tell=told.append)
    for _ in range(6):
        sender.send([("/a", [1])])
    sender.close()
    assert len(told) == 1
    assert f"nobody takes OSC at 127.0.0.1:{port}" in told[0]


def test_events_by_osc_and_a_recording_played_by_the_command(
    capsys, monkeypatch, tmp_path, take, library
):
    pytest.importorskip("pythonosc")
    from pythonosc.osc_packet import OscPacket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(5)
        port = listener.getsockname()[1]
        path = tmp_path / "take.bvh"
        write_bvh(take.cut(0, 3), path)
        ran = run(capsys, monkeypatch, "replay", path, "--to", "osc", "--port", port)
        assert (ran.code, ran.out, ran.err) == (0, "", "")
        n_packets = 3 * -(-len(next(write_messages(take))) // 12)
        packets = [OscPacket(listener.recv(10_000)).messages for _ in range(n_packets)]
        assert packets[0][0].message.address == "/VMC/Ext/OK"
        assert sum(one.message.address == BONE for p in packets for one in p) >= 60
        sender = OscSender(port, tell=pytest.fail)
        event = dict.fromkeys(("start_s", "end_s"), 1.5) | {"event": "final", "label": "Übung"}
        event |= {"id": 3, "recording": 1, "probability": None, "sender": "", "person": "a"}
        sender.send_event(event)
        sender.close()
        [(_, message)] = OscPacket(listener.recv(10_000)).messages
        assert message.address == "/motionary/final"
        assert message.params == ["Übung", 3, 1, 1.5, 1.5, -1.0, "", "a"]
    if sys.platform == "linux":
        # Others do not tell that nobody listens.
        ran = run(capsys, monkeypatch, "replay", path, "--to", "osc", "--port", port)
        assert ran.code == 1
        assert f"nobody takes OSC at 127.0.0.1:{port}" in ran.err
    for options, what in (
        (("--port", "9000"), "goes with --to osc"),
        (("--to", "osc", "--port", "x:y"), "a port from 1 to 65535"),
        (("--to", "osc", "--speed", 0), "above 0"),
    ):
        ran = run(capsys, monkeypatch, "replay", path, *options)
        assert ran.code == 2
        assert what in ran.err
