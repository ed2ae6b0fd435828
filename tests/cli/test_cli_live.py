"""`motionary live` and `motionary replay`: what goes in, what comes out, what goes wrong."""

import io
import json
import signal
import socket
import threading
import time
import urllib.error
import urllib.request

import numpy as np
import pytest

import motionary as mo
from cli_cases import documented_example, run, write_bvh
from motionary.errors import InvalidInput, UnwritableFile
from motionary.live import LivePeople, PageServer, PoseLines, WebSocketSource, write_lines
from motionary.samples import synthetic_motion, synthetic_stream

#: Of an event, as the reference shows one.
KEYS = documented_example("`motionary live` prints an event a line")


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
    assert all(list(event) == KEYS and event["event"] == "final" for event in events)
    track = mo.annotate(mo.read(path), mo.ClassLibrary.load(library))
    expected = [(label.name, label.start_frame, label.end_frame) for label in track]
    found = [(e["label"], e["start_frame"], e["end_frame"]) for e in events]
    assert sorted(found) == sorted(expected)


def test_lines_that_are_no_poses_are_told_and_the_others_count(capsys, monkeypatch, lines, library):
    wrong = [
        "garbage", '{"positions": [[1, 2, 3]]}', "[1, 2]", '{"positions": 3}',
        '{"positions": [[1, 2]]}', '{"what": 1}', '{"rate_hz": "fast"}', "",
    ]  # fmt: skip
    feed(monkeypatch, "\n".join([lines[0], *wrong, *lines[1:]]) + "\n")
    ran = run(capsys, monkeypatch, "live", "--final", "--library", library)
    assert ran.code == 1
    assert "line 2: a line must be one JSON object, got 'garbage" in ran.err
    assert "line 3: the first line has 24 joints, got 1 positions; a first line with" in ran.err
    assert "7 lines were of no use" in ran.err
    feed(monkeypatch, "\n".join(lines) + "\n")
    assert ran.out == run(capsys, monkeypatch, "live", "--final", "--library", library).out


def test_without_a_rate_the_command_says_what_to_give(capsys, monkeypatch, lines, library):
    feed(monkeypatch, '{"positions": []}\n' + lines[1] + "\n")
    ran = run(capsys, monkeypatch, "live")
    assert (ran.code, ran.out) == (1, "")
    assert '{"rate_hz": 60} or --rate' in ran.err
    # Its former name stays.
    feed(monkeypatch, lines[1] + "\n")
    assert run(capsys, monkeypatch, "live", "--rate-hz", 30, "--library", library).code == 0


def test_a_stream_of_bytes_may_hold_any(capsys, monkeypatch, lines, library):
    text = "\ufeff" + "\n".join(lines[:3]) + "\n"
    content = text.encode() + b"\xff\xfe\n" + b"x" * 250_000 + b"\n"
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(content), encoding="utf-8"))
    ran = run(capsys, monkeypatch, "live", "--library", library)
    assert ran.code == 1
    assert "has at most 100000 characters, got more" in ran.err
    assert "4 lines were of no use" in ran.err


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


@pytest.fixture
def pose(take):
    """The first pose of the take as a line, at a time, of a person."""
    positions = np.round(take.positions[0], 3).tolist()

    def line(**more):
        return json.dumps({"positions": positions} | more)

    return line


@pytest.fixture
def people(lines, library):
    found = LivePeople(mo.ClassLibrary.load(library))
    found.push(lines[0])
    return found


def durations(people):
    return {key[1]: one.annotator.duration_s for key, one in people._people.items()}


def test_who_leaves_has_final_labels_and_who_comes_back_another_recording(lines, library):
    people = LivePeople(mo.ClassLibrary.load(library))
    found = []
    for i, line in enumerate([*lines, *lines[1:]]):
        content = json.loads(line)
        if "time_s" in content:
            content["time_s"] += 1e9 + (i > len(lines) - 1) * 3600
        found += people.push(json.dumps(content))
    found += people.leave("")
    assert people.finish() == []
    first, second = (
        [one.event.label for one in found if one.event.status == "final" and one.recording == n]
        for n in (1, 2)
    )
    assert first
    assert first == second
    assert {one.recording_start_s for one in found} == {1e9, 1e9 + 3600}


def test_people_who_are_numbered_anew_do_not_fill_the_memory(people, pose):
    for person in range(70):
        for i in range(2 if person else 1):
            people.push(pose(time_s=400.0 * person + i, person=person))
        people._senders[""].round += 400
    assert len(people._people) < 5


def test_senders_that_come_and_go_leave_nothing(people, pose, lines):
    for number in range(300):
        people.push(lines[0], sender=str(number))
        if number % 10 == 0:
            people.push(pose(), sender=str(number))
            people.leave(str(number))
    assert len(people._people) == 0
    assert len(people._senders) <= 256


def test_wrong_poses_hold_no_place_and_lose_no_events(people, pose, lines):
    for person in range(66):
        with pytest.raises(InvalidInput, match="joints"):
            people.push(json.dumps({"positions": [[1, 2, 3]], "person": person}))
    own = [event for line in lines for event in people.push(line)]
    with pytest.raises(InvalidInput, match="joints"):
        people.push('{"positions": [[1, 2, 3]], "time_s": 0}')
    own += people.push(pose(time_s=0.1))
    # A clock set back begins another recording.
    assert durations(people)[""] == pytest.approx(1 / 30)
    assert labels_of(own)
    assert {one.recording for one in own if one.event.status == "final"} == {1}


@pytest.mark.parametrize(
    ("more", "what"),
    [
        ({"person": "a" * 61}, "at most 60 characters, got 61"),
        ({"person": {"a": 1}}, "a name or a number"),
        ({"person": True}, "a name or a number"),
        ({"time_s": float("nan")}, "number of seconds"),
        ({"time_s": 1.7e12}, "number of seconds"),
        ({"positions": [[float("inf"), 0, 0]]}, "metres or null"),
        ({"positions": [[10**400, 0, 0]]}, "metres or null"),
        ({"positions": {"a": 1}}, "positions must be a list"),
    ],
)
def test_hostile_values_are_refused(people, pose, more, what):
    with pytest.raises(InvalidInput, match=what):
        people.push(pose(**more))
    assert durations(people) == {}


def test_what_is_not_seen_may_be_null_or_nan_and_people_names_or_numbers():
    lines = PoseLines()
    read = lines.read('{"positions": [[NaN, 1, 2], null, [1, 2, 3]], "person": null}')
    assert np.isnan(read.positions[:2]).all()
    assert read.positions[2].tolist() == [1, 2, 3]
    assert read.person == ""
    assert lines.read('{"positions": [null], "person": 7, "time_s": 1.8e9}').person == "7"
    with pytest.raises(InvalidInput, match="skeleton"):
        lines.read('{"skeleton": 3}')


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


@pytest.fixture
def websocket(monkeypatch):
    """A source, what it told, and how to connect."""
    client = pytest.importorskip("websockets.sync.client")
    monkeypatch.setattr("motionary.live.sockets._CLOSING_S", 0.2)
    told = []
    source = WebSocketSource(0, tell=told.append)
    yield source, told, lambda **more: client.connect(f"ws://127.0.0.1:{source.port}", **more)
    source.close()


def wait_for(is_so):
    deadline = time.monotonic() + 10
    while not is_so() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert is_so()


def test_poses_by_websocket_come_back_as_events(lines, websocket):
    source, told, connect = websocket
    with pytest.raises(InvalidInput, match=rf"port {source.port} of 127.0.0.1 .* with --port"):
        WebSocketSource(source.port, tell=told.append)
    with pytest.raises(InvalidInput, match="give an address of this computer"):
        WebSocketSource(0, address="192.0.2.1", tell=told.append)
    with connect() as connection:
        connection.send("\n".join(lines[:4]))
        arrived = source.lines()
        assert [next(arrived)[1] for _ in range(4)] == lines[:4]
        source.send({"event": "final"})
        assert json.loads(connection.recv(timeout=5)) == {"event": "final"}
        # One that sends faster than it is labelled has to wait, and is told so.
        sending = threading.Thread(target=connection.send, args=("\n".join(["{}"] * 400),))
        sending.start()
        sending.join(timeout=5)
        wait_for(lambda: any("faster than they can be labelled" in text for text in told))
        assert [next(arrived)[1] for _ in range(400)] == ["{}"] * 400
    assert next(arrived) == ("1", None)
    assert told[0] == "sender 1 is connected"
    assert told[-1] == "sender 1 is gone"


def test_a_silent_sender_is_told_as_one_that_ends(websocket, monkeypatch):
    source, _, connect = websocket
    monkeypatch.setattr("motionary.live.sources.SILENT_S", 0.2)
    with connect() as connection:
        connection.send(b'{"person": "a\xe2\x80\xa8b"}\n\n')
        arrived = source.lines()
        assert next(arrived) == ("1", b'{"person": "a\xe2\x80\xa8b"}')
        assert next(arrived) == ("1", None)


def test_nobody_waits_for_a_listener_that_does_not_read(websocket):
    source, told, connect = websocket
    with connect(max_queue=1, compression=None, close_timeout=0.1):
        wait_for(lambda: told)
        for _ in range(400):
            source.send({"event": "x" * 60_000})
        assert any("does not read its events" in text for text in told)


def test_connections_that_are_none_are_told_in_a_line(websocket, capfd):
    source, told, connect = websocket
    with socket.create_connection(("127.0.0.1", source.port)) as hello:
        hello.sendall(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n")
        wait_for(lambda: any("without TLS" in text for text in told))
    with pytest.raises(Exception, match="403"), connect(origin="https://example.com"):
        pass
    with connect(origin="http://localhost:3000") as connection:
        connection.send("x" * 1_100_000)
        wait_for(lambda: any("is gone (" in text and "too big" in text for text in told))
    assert capfd.readouterr().err == ""


def test_an_address_open_to_the_network_is_told():
    pytest.importorskip("websockets")
    told = []
    WebSocketSource(0, address="0.0.0.0", tell=told.append).close()
    assert "0.0.0.0 is open to the network" in told[0]


def test_options_that_would_do_nothing_are_refused(capsys, monkeypatch, lines):
    for options, what in (
        (("--address", "0.0.0.0"), "needs --port"),
        (("--skeleton", "foo"), "foo"),
    ):
        feed(monkeypatch, "\n".join(lines[:3]))
        ran = run(capsys, monkeypatch, "live", *options)
        assert ran.code != 0
        assert what in ran.err


def test_a_stream_goes_on_from_a_file_as_without_a_break(
    capsys, monkeypatch, tmp_path, lines, library
):
    state, parts = tmp_path / "Zustand.npz", [lines[:1] + lines[1:70], lines[70:]]
    feed(monkeypatch, "\n".join(lines) + "\n")
    whole = run(capsys, monkeypatch, "live", "--library", library).out.splitlines()
    out = []
    for part in parts:
        feed(monkeypatch, "\n".join(part) + "\n")
        ran = run(capsys, monkeypatch, "live", "--library", library, "--state", state)
        assert (ran.code, ran.err) == (0, "")
        out += ran.out.splitlines()
    # What ends with the last line is kept, too.
    assert out == whole[: len(out)]
    assert 0 < len(out) < len(whole)
    people = LivePeople(mo.ClassLibrary.load(library))
    people.resume(state)
    assert people.senders == ("",)
    rest = [json.dumps(event.as_json()) for event in people.finish()]
    assert [json.loads(one) for one in out + rest] == [json.loads(one) for one in whole]


class Stopped(io.StringIO):
    """Lines, and the end of the program by the system in place of their end."""

    def readline(self, size=-1):
        return super().readline(size) or signal.raise_signal(signal.SIGTERM)


def test_what_the_system_ends_is_kept(capsys, monkeypatch, tmp_path, lines, library):
    state = tmp_path / "state.npz"
    monkeypatch.setattr("sys.stdin", Stopped("\n".join(lines[:5]) + "\n"))
    before = signal.getsignal(signal.SIGTERM)
    ran = run(capsys, monkeypatch, "live", "--library", library, "--state", state)
    assert (ran.code, ran.out) == (0, "")
    assert f"what is left is kept in {state}" in ran.err
    assert signal.getsignal(signal.SIGTERM) == before
    people = LivePeople(mo.ClassLibrary.load(library))
    people.resume(state)
    assert durations(people) == {"": pytest.approx(4 / 30)}


@pytest.mark.parametrize(("sent", "n_poses"), [("INT", 3), ("TERM", 3), ("INT INT", 2)])
def test_a_line_is_done_before_the_end_unless_asked_twice(
    capsys, monkeypatch, tmp_path, lines, library, sent, n_poses
):
    state, push = tmp_path / "state.npz", LivePeople.push

    def push_interrupted(people, line, *, sender=""):
        for name in sent.split() if line.strip() == lines[3] else ():
            signal.raise_signal(signal.Signals[f"SIG{name}"])
        return push(people, line, sender=sender)

    monkeypatch.setattr(LivePeople, "push", push_interrupted)
    feed(monkeypatch, "\n".join(lines[:5]) + "\n")
    ran = run(capsys, monkeypatch, "live", "--library", library, "--state", state)
    assert (ran.code, ran.out) == (0, "")
    assert f"what is left is kept in {state}" in ran.err
    people = LivePeople(mo.ClassLibrary.load(library))
    people.resume(state)
    assert durations(people) == {"": pytest.approx(n_poses / 30)}


def test_labels_go_on_while_their_state_cannot_be_written(
    capsys, monkeypatch, tmp_path, lines, library
):
    state, save = tmp_path / "state.npz", LivePeople.save
    calls = []

    def fill_the_disk_once(people, path):
        calls.append(path)
        if len(calls) == 2:
            raise UnwritableFile("no space left", file=path)
        save(people, path)

    monkeypatch.setattr(LivePeople, "save", fill_the_disk_once)
    monkeypatch.setattr("motionary.cli.live._SAVED_EACH_S", -1)
    feed(monkeypatch, "\n".join(lines[:8]) + "\n")
    ran = run(capsys, monkeypatch, "live", "--library", library, "--state", state)
    assert ran.code == 0
    assert "no space left; labels go on" in " ".join(ran.err.split())
    assert len(calls) > 3


def test_states_of_something_else_are_refused(capsys, monkeypatch, tmp_path, lines, library):
    feed(monkeypatch, "")
    path = tmp_path / "one.npz"
    mo.LiveAnnotator(mo.ClassLibrary.load(library), rate_hz=30).save(path)
    wrong = tmp_path / "damaged.npz"
    wrong.write_bytes(b"PK")
    for state, what in ((path, "no state of this kind"), (wrong, "or damaged")):
        ran = run(capsys, monkeypatch, "live", "--library", library, "--state", state)
        assert (ran.code, ran.out) == (1, "")
        assert what in ran.err
    ran = run(capsys, monkeypatch, "live", "--library", library, "--state", wrong / "x.npz")
    assert (ran.code, ran.out) == (1, "")
    assert "cannot be written" in ran.err


def test_a_page_is_served_to_this_computer_and_told_of_what_was(monkeypatch, lines, library):
    client = pytest.importorskip("websockets.sync.client")
    monkeypatch.setattr("motionary.live.sockets._CLOSING_S", 0.2)
    told = []
    page, people = PageServer(0, tell=told.append), LivePeople(mo.ClassLibrary.load(library))
    with pytest.raises(InvalidInput, match=rf"port {page.port} of 127.0.0.1 .* with --page"):
        PageServer(page.port, tell=told.append)
    for line in lines[:4]:
        people.push(line)
        if people.pose:
            page.show(people.pose)
    page.send_event({"event": "final", "id": 1})
    page.send_event({"event": "revised", "id": 2})
    place = f"127.0.0.1:{page.port}"
    with urllib.request.urlopen(f"http://{place}/") as opened:
        assert opened.headers["X-Frame-Options"] == "DENY"
        text = opened.read().decode()
    assert f"connect-src ws://{place}/watch;" in text
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(f"http://{place}/etc/passwd")
    with pytest.raises(Exception, match="403"):
        client.connect(f"ws://{place}/watch", origin="https://example.com")
    with client.connect(f"ws://{place}/watch", origin=f"http://{place}") as connection:
        run_of, body, event = json.loads(connection.recv(timeout=5))
        assert len(run_of["live"]) == 8
        assert body["recording"]["number"] == 1
        assert body["recording"]["name"] == "motion"
        assert event == {"event": {"event": "final", "id": 1}}
        people.push(json.dumps({"positions": [None] * 24, "time_s": 0.2}))
        page.show(people.pose)
        assert json.loads(connection.recv(timeout=5))["pose"][2] == [None] * 24
    page.close()


def test_a_page_shows_a_body_from_when_it_is_seen(monkeypatch, lines, library):
    client = pytest.importorskip("websockets.sync.client")
    monkeypatch.setattr("motionary.live.sockets._CLOSING_S", 0.2)
    page, people = PageServer(0, tell=pytest.fail), LivePeople(mo.ClassLibrary.load(library))
    people.push(lines[0])
    with client.connect(f"ws://127.0.0.1:{page.port}/watch") as connection:
        assert len(json.loads(connection.recv(timeout=5))) == 1
        for line in (json.dumps({"positions": [None] * 24, "time_s": 0.0}), *lines[2:4]):
            people.push(line)
            page.show(people.pose)
        assert json.loads(connection.recv(timeout=5))["recording"]["missing"] == []
        assert None not in json.loads(connection.recv(timeout=5))["pose"][2]
    page.close()


def test_the_command_serves_the_page(capsys, monkeypatch, lines, library):
    pytest.importorskip("websockets")
    feed(monkeypatch, "\n".join(lines[:3]))
    ran = run(capsys, monkeypatch, "live", "--library", library, "--page", 0)
    assert ran.code == 0
    assert "the page is http://127.0.0.1:" in ran.err
