"""`motionary live` and `motionary replay`: what goes in, what comes out, what goes wrong."""

import io
import json
import threading
import time

import numpy as np
import pytest

import motionary as mo
from cli_cases import run, write_bvh
from motionary.errors import InvalidInput
from motionary.live import LivePeople, PoseLines, WebSocketSource, write_lines
from motionary.samples import synthetic_motion, synthetic_stream

KEYS = {
    "event", "id", "person", "label", "start_s", "end_s", "start_frame", "end_frame", "score",
    "probability", "side", "why",
}  # fmt: skip


@pytest.fixture(scope="module")
def take():
    return synthetic_stream(("squat",), seed=4, rate_hz=30.0)[0]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """A folder with one class, so that each pose is soon labelled."""
    examples = [synthetic_motion("squat", seed=seed) for seed in range(4)]
    folder = tmp_path_factory.mktemp("live") / "squats"
    mo.learn({"squat": [mo.compute_features(one) for one in examples]}).save(folder)
    return folder


@pytest.fixture(scope="module")
def lines(take):
    return list(write_lines(take))


def feed(monkeypatch, text):
    monkeypatch.setattr("sys.stdin", io.StringIO(text))


def test_a_replayed_recording_is_labelled_as_annotate_labels_it(
    capsys, monkeypatch, tmp_path, take, library
):
    path = tmp_path / "Übung 1.bvh"
    write_bvh(take, path)
    sent = run(capsys, monkeypatch, "replay", path, "--speed", 0)
    assert sent.code == 0
    feed(monkeypatch, sent.out)
    ran = run(capsys, monkeypatch, "live", "--final", "--library", library)
    events = [json.loads(line) for line in ran.out.splitlines()]
    assert (ran.code, ran.err) == (0, "")
    assert events
    assert all(event.keys() == KEYS and event["event"] == "final" for event in events)
    track = mo.annotate(mo.read(path), mo.ClassLibrary.load(library))
    expected = [(label.name, label.start_frame, label.end_frame) for label in track]
    found = [(e["label"], e["start_frame"], e["end_frame"]) for e in events]
    assert sorted(found) == sorted(expected)


def test_lines_that_are_no_poses_are_told_and_the_others_count(capsys, monkeypatch, lines, library):
    wrong = [
        "garbage", "[1, 2]", '{"positions": 3}', '{"positions": [[1, 2]]}', '{"what": 1}',
        '{"positions": [[1, 2, 3]]}', '{"rate_hz": "fast"}', "",
    ]  # fmt: skip
    feed(monkeypatch, "\n".join([lines[0], *wrong, *lines[1:]]) + "\n")
    ran = run(capsys, monkeypatch, "live", "--final", "--library", library)
    assert ran.code == 1
    assert "a line must be one JSON object, got 'garbage" in ran.err
    assert "7 lines were of no use" in ran.err
    feed(monkeypatch, "\n".join(lines) + "\n")
    assert ran.out == run(capsys, monkeypatch, "live", "--final", "--library", library).out


def test_without_a_rate_the_command_says_what_to_give(capsys, monkeypatch, lines):
    feed(monkeypatch, '{"positions": []}\n' + lines[1] + "\n")
    ran = run(capsys, monkeypatch, "live")
    assert (ran.code, ran.out) == (1, "")
    assert '{"rate_hz": 60} or --rate-hz' in ran.err


def as_poses(lines, **more):
    """The lines, with something beside the positions of each pose."""
    yield lines[0]
    for line in lines[1:]:
        yield json.dumps(json.loads(line) | more)


def labels_of(events):
    final = [one.event.label for one in events if one.event.status == "final"]
    return [(label.name, label.start_s, label.end_s) for label in final]


def test_each_person_and_sender_has_labels_of_their_own(lines, library):
    classes = mo.ClassLibrary.load(library)
    alone, people = LivePeople(classes), LivePeople(classes)
    expected = [event for line in lines for event in alone.push(line)] + alone.finish()
    found = []
    for one, other in zip(as_poses(lines, person="a"), as_poses(lines, person="b"), strict=True):
        found += people.push(one) + people.push(other, sender="2") + people.push(other)
    found += people.finish()
    assert labels_of(expected)
    for person, times in (("a", 1), ("b", 2)):
        own = [event for event in found if event.person == person]
        assert sorted(labels_of(own)) == sorted(labels_of(expected) * times)


def test_a_clock_set_back_begins_another_recording(lines, library):
    people = LivePeople(mo.ClassLibrary.load(library))
    first = [event for line in lines for event in people.push(line)]
    again = [event for line in lines[1:] for event in people.push(line)]
    events = labels_of([*first, *again, *people.finish()])
    assert len(events) >= 2
    assert sorted(events[: len(events) // 2]) == sorted(events[len(events) // 2 :])


def test_poses_by_the_names_of_joints_may_leave_joints_out(take):
    lines = PoseLines()
    names = list(take.names)
    assert lines.read(json.dumps({"rate_hz": 30, "joints": names})) is None
    pose = lines.read(json.dumps({"joints": {names[1]: [1, 2, 3]}, "time_s": 4}))
    assert pose.time_s == 4
    assert pose.positions[1].tolist() == [1, 2, 3]
    assert np.isnan(np.delete(pose.positions, 1, axis=0)).all()
    with pytest.raises(InvalidInput, match="'tail' was not among those of the first pose"):
        lines.read(json.dumps({"joints": {"tail": [1, 2, 3]}}))


def test_poses_by_websocket_come_back_as_events(lines):
    client = pytest.importorskip("websockets.sync.client")
    told = []
    source = WebSocketSource(0, tell=told.append)
    with pytest.raises(InvalidInput, match=rf"port {source.port} of 127.0.0.1 cannot be listened"):
        WebSocketSource(source.port, tell=told.append)
    with client.connect(f"ws://127.0.0.1:{source.port}") as connection:
        connection.send("\n".join(lines[:4]))
        arrived = source.lines()
        assert [next(arrived)[1] for _ in range(4)] == lines[:4]
        source.send({"event": "final"})
        assert json.loads(connection.recv(timeout=5)) == {"event": "final"}
        # One that sends faster than it is labelled has to wait, and is told so.
        sending = threading.Thread(target=connection.send, args=("\n".join(["{}"] * 400),))
        sending.start()
        sending.join(timeout=5)
        deadline = time.monotonic() + 5
        while not any("faster" in text for text in told) and time.monotonic() < deadline:
            time.sleep(0.01)
        assert any("faster than they can be labelled" in text for text in told)
        assert [next(arrived)[1] for _ in range(400)] == ["{}"] * 400
    source.close()
    assert told[0] == "sender 1 is connected"
