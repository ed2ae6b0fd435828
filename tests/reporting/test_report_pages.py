"""Does a page hold what it should, allow nothing from outside, and keep positions right?"""

import base64
import hashlib
import json
import re
import tomllib
import zlib
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from cli_cases import write_stream
from motionary import report
from motionary.errors import InvalidInput
from motionary.labels import Label, LabelTrack
from motionary.models.library import TrainingOptions, assignment, learn_classes
from motionary.motion import Motion
from motionary.recording import Recording, Segment
from motionary.reporting import html, recordings, report_comparison
from motionary.reporting.html import UNIT_M, encode_positions, encode_series, encode_states
from motionary.retrieval import labelling
from motionary.samples import synthetic_motion, synthetic_stream

HOSTILE = (
    "</script><script>alert(1)</script>", "<!--<script>", "\" onload='x'", "a\x00b\x1b[31m\u202e",
    "\u2028]]>&amp;", "[[SCRIPT]]", "=1+2",
)  # fmt: skip


@pytest.fixture(scope="module")
def motion():
    stream, _ = synthetic_stream(("squat", "kick_left"), seed=3, rate_hz=120.0)
    return stream.renamed("stream.bvh")


@pytest.fixture(scope="module")
def library(examples):
    return learn_classes(examples, training=TrainingOptions())


@pytest.fixture(scope="module")
def page(motion, library):
    track = LabelTrack(Recording("stream"), (Label("squat", 1.0, 2.0),), (Segment(0.0, 0.5),))
    return report(motion, labels=track, truth=track, library=library).text


def content_of(page):
    (text,) = re.findall(r'<script type="application/json" id="content">(.*?)</script>', page)
    return json.loads(text)


def block_of(page, name):
    (text,) = re.findall(rf'<script type="text/plain" id="{name}">([\w+/=]*)</script>', page)
    return zlib.decompress(base64.b64decode(text))


def varints(content):
    values, value, shift = [], 0, 0
    for byte in content:
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            values.append(value)
            value = shift = 0
    return values


def unfold(values):
    return [-(v + 1) // 2 if v % 2 else v // 2 for v in values]


def decode_positions(content, n_frames, n_joints):
    values = varints(content)
    n = n_frames * n_joints * 3
    rows = np.cumsum(np.reshape(unfold(values[:n]), (n_joints, 3, n_frames)), axis=2)
    known, runs = np.zeros((n_frames, n_joints), dtype=bool), iter(values[n:])
    for joint in range(n_joints):
        at, seen = 0, True
        while at < n_frames:
            length = next(runs)
            known[at : at + length, joint] = seen
            at, seen = at + length, not seen
    assert next(runs, None) is None
    return rows.transpose(2, 0, 1) * UNIT_M, known


def test_positions_are_off_by_half_a_unit_at_most():
    rng = np.random.default_rng(0)
    positions = np.cumsum(rng.normal(0, 0.05, (200, 5, 3)), axis=0) + 1000 * rng.normal(size=(5, 3))
    known = rng.random((200, 5)) < 0.7
    known[:, 0], known[:, 1] = True, False
    text = encode_positions(positions, known)
    got, seen = decode_positions(zlib.decompress(base64.b64decode(text)), 200, 5)
    assert np.abs(got - positions).max() <= UNIT_M / 2 + 1e-9
    assert (seen == known).all()


def test_series_and_states_come_back_as_they_were():
    rng = np.random.default_rng(1)
    series = rng.integers(-(10**6), 10**6, (3, 50))
    content = zlib.decompress(base64.b64decode(encode_series(series)))
    assert (np.cumsum(np.reshape(unfold(varints(content)), (3, 50)), axis=1) == series).all()
    states = np.repeat(rng.integers(0, 3, (2, 20)), 7, axis=1)
    runs = iter(varints(zlib.decompress(base64.b64decode(encode_states(states)))))
    for row in states:
        got = [run for _ in range(next(runs)) for run in [next(runs)]]
        assert np.concatenate([[run % 8] * (run // 8) for run in got]).tolist() == row.tolist()


def test_the_page_holds_each_pose_at_thirty_hertz(motion, page):
    (recording,) = content_of(page)["recordings"]
    positions, frames = motion.generic_positions()[::4], recording["page_frames"]
    assert (recording["page_hz"], frames) == (30.0, len(positions))
    got, known = decode_positions(block_of(page, "r0-0"), frames, 24)
    assert known.all()
    assert np.abs(got - positions).max() <= UNIT_M / 2 + 1e-9


def test_what_was_not_seen_is_marked_and_kept_on_its_bone(motion):
    positions = motion.positions.copy()
    hand = motion.names.index("lwrist")
    positions[120:240, hand] = np.nan
    page = report(replace(motion, positions=positions)).text
    (recording,) = content_of(page)["recordings"]
    got, known = decode_positions(block_of(page, "r0-0"), recording["page_frames"], 24)
    joint, elbow = recording["joints"].index("lwrist"), recording["joints"].index("lelbow")
    assert not known[30:60, joint].any()
    assert known[:29, joint].all()
    assert known[61:, joint].all()
    # Never farther from the elbow than the forearm is long.
    lengths = np.linalg.norm(got[:, joint] - got[:, elbow], axis=1)
    assert lengths[30:60].max() <= lengths[known[:, joint]].max() + 0.005
    assert recording["gaps"]
    assert recording["gaps"][0][0] == pytest.approx(1.0, abs=0.04)


def test_joints_of_an_unknown_rig_are_drawn_as_they_are():
    positions = np.random.default_rng(2).normal(size=(40, 3, 3))
    motion = Motion(("a", "b", "c"), positions, Recording("rig", rate_hz=30.0))
    (recording,) = content_of(report(motion).text)["recordings"]
    assert recording["joints"] == ["a", "b", "c"]
    assert "strip" not in recording


def test_labels_of_a_library_say_why_over_curves(page):
    content = content_of(page)
    (recording,) = content["recordings"]
    found, table, truth = recording["lanes"]
    assert [lane["name"] for lane in (found, table, truth)] == ["library", "labels", "truth"]
    assert truth["truth"]
    assert {row[0] for row in found["labels"]} == {"squat", "kick_left"}
    whys = json.loads(block_of(page, found["why"]))
    assert [row[-1] for row in found["labels"]] == list(range(len(whys)))
    for why in whys:
        assert why["held"]
        assert all(0 <= finding[0] < 40 for finding in why["held"] + why["failed"])
    assert table["unassessed"] == [[0.0, 0.5]]
    assert {one["name"] for one in recording["curves"]["classes"]} >= {"squat", "kick_left"}
    assert block_of(page, recording["curves"]["block"])
    assert len(content["features"]) == 40


def test_only_the_pages_own_script_and_style_may_run(page):
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    directives = dict(part.strip().split(" ", 1) for part in policy.split(";"))
    assert directives["default-src"] == "'none'"
    assert directives["connect-src"] == "'none'"
    assert "unsafe" not in policy
    assert "http" not in policy
    for tag, directive in (("script", "script-src"), ("style", "style-src")):
        (own,) = re.findall(rf"<{tag}>(.*?)</{tag}>", page, flags=re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(own.encode()).digest()).decode()
        assert directives[directive] == f"'sha256-{digest}'"
    assert not re.findall(r"""(?:src|href)=["'](?!data:)""", page)
    assert not re.findall(r"\son\w+=[\"']", page.split("<script>")[0])


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_are_text(name):
    motion = synthetic_motion("squat", seed=0, rate_hz=30.0).renamed(name)
    labels = LabelTrack(Recording(name), (Label(name, 0.0, 0.5),))
    page = report(motion, lanes={name: labels}).text
    assert page.count("<script") == 2 + page.count('<script type="text/plain"')
    assert page.count("<script>") == 1
    (recording,) = content_of(page)["recordings"]
    assert recording["name"] == recording["lanes"][0]["name"] == name
    assert recording["lanes"][0]["labels"][0][0] == name
    assert "\x00" not in page


def test_ten_thousand_labels_stay_small():
    motion = synthetic_motion("squat", seed=0, rate_hz=30.0)
    many = tuple(Label(f"{HOSTILE[0]}{i}", i * 1e-4, i * 1e-4 + 0.1) for i in range(10_000))
    page = report(motion, labels=LabelTrack(motion.recording, many)).text
    assert len(content_of(page)["recordings"][0]["lanes"][0]["labels"]) == 10_000
    assert len(page) < 2_500_000


def test_the_bundle_is_the_recorded_one_with_its_licence():
    folder = resources.files("motionary.reporting").joinpath("page")
    script = folder.joinpath("three.min.js").read_bytes()
    record = tomllib.loads(folder.joinpath("three.toml").read_text("utf-8"))
    assert len(script) == record["bytes"] <= 700_000
    assert hashlib.sha256(script).hexdigest() == record["sha256"]
    assert "MIT License" in folder.joinpath("three.LICENSE").read_text("utf-8")


def test_labels_of_another_recording_are_refused(motion):
    other = LabelTrack(Recording("other.bvh"), (Label("squat", 0.0, 1.0),))
    with pytest.raises(InvalidInput, match=r"these labels are of other\.bvh"):
        report(motion, labels=other)
    late = LabelTrack(Recording("stream"), (Label("squat", 0.0, 1000.0),))
    with pytest.raises(InvalidInput, match=r"ends at 1000\.00 s"):
        report(motion, labels=late)
    with pytest.raises(InvalidInput, match="at least one recording"):
        report([])
    with pytest.raises(InvalidInput, match="rate_hz"):
        report(motion, rate_hz=0.5)
    with pytest.raises(InvalidInput, match=r"\.html"):
        report(motion, "page.txt")


def test_a_page_larger_than_browsers_open_is_refused_before_it_is_made(motion, monkeypatch):
    monkeypatch.setattr(html, "MOST_BYTES", 30_000)
    short = motion.cut(0, 30)
    text = r"about 0 MB.*give fewer or shorter recordings.*--keep, rate_hz"
    with monkeypatch.context() as without_clips:
        without_clips.setattr(recordings, "make_clip", None)
        with pytest.raises(InvalidInput, match=text):
            report(tiled(motion, 20))
    read = iter([short, tiled(motion, 20), short])
    with pytest.raises(InvalidInput, match=text):
        report(read)
    assert len(list(read)) == 1
    with pytest.raises(InvalidInput, match=text):
        report_comparison(short, tiled(motion, 20))
    # Labels count, too.
    many = tuple(Label("squat", i * 1e-4, i * 1e-4 + 0.1) for i in range(5000))
    with pytest.raises(InvalidInput, match=text):
        report(short, labels=LabelTrack(short.recording, many))


def tiled(motion, n):
    """A motion that is repeated so often."""
    return replace(motion, positions=np.tile(motion.positions, (n, 1, 1)), rotations=None)


def count_calls(monkeypatch, module, name):
    calls, own = [], getattr(module, name)

    def counted(*args, **options):
        calls.append(name)
        return own(*args, **options)

    monkeypatch.setattr(module, name, counted)
    return calls


@pytest.mark.parametrize("by_scores", [True, False])
def test_curves_are_what_labels_were_assigned_by_computed_once(
    motion, library, monkeypatch, by_scores
):
    scored = count_calls(monkeypatch, assignment, "score_patterns")
    compared = count_calls(monkeypatch, labelling, "corpus_distance")
    if not by_scores:
        # A threshold of costs of its own: then costs decide.
        library = replace(library, classes=tuple(replace(one, threshold=0.2) for one in library))
    page = report(motion, library=library).text
    n_patterns = sum(len(one.patterns) for one in library)
    assert (len(scored), len(compared)) == ((1, 0) if by_scores else (0, n_patterns))
    (recording,) = content_of(page)["recordings"]
    curves = recording["curves"]
    assert curves["kind"] == ("score" if by_scores else "cost")
    steps = np.reshape(unfold(varints(block_of(page, curves["block"]))), (-1, curves["n_frames"]))
    rows = dict(zip([one["name"] for one in curves["classes"]], steps.cumsum(axis=1), strict=True))
    labels = recording["lanes"][0]["labels"]
    assert labels
    for name, start, end, cost, score, *_ in labels:
        part = rows[name][round(start * 30) : round(end * 30)] * curves["unit"]
        best = part.max() if by_scores else part.min()
        assert best == pytest.approx(score if by_scores else cost, abs=curves["unit"])


def test_the_command_writes_names_and_no_folders(motionary, tmp_path):
    folder = tmp_path / "secret place"
    segments = write_stream(folder / "take.bvh")
    table = folder / "labels.csv"
    rows = [f"take,{name},{start},{end}" for name, start, end in segments]
    table.write_text("\n".join(["recording,label,start_s,end_s", *rows]) + "\n", "utf-8")
    target = tmp_path / "out.html"
    ran = motionary("report", folder / "take.bvh", "--labels", table, "-o", target)
    assert ran.code == 0
    page = target.read_text("utf-8")
    assert "secret place" not in page
    assert str(tmp_path) not in page
    (lane,) = content_of(page)["recordings"][0]["lanes"]
    assert [row[0] for row in lane["labels"]] == [name for name, _, _ in segments]
    assert motionary("report", folder / "take.bvh", "-o", target).code != 0
    assert motionary("report", folder / "take.bvh", "-o", tmp_path / "a.txt").code == 2
    assert motionary("report", folder / "none.bvh", "-o", tmp_path / "b.html").code == 1
    assert not (tmp_path / "b.html").exists()


def test_a_minute_at_120_hz_is_small(tmp_path):
    motion, _ = synthetic_stream(("squat", "kick_left", "jump") * 7, seed=1, rate_hz=120.0)
    minute = motion.cut(0, 7200) if motion.n_frames > 7200 else motion
    assert minute.duration_s > 55
    target = tmp_path / "minute.html"
    report(minute, target)
    assert target.stat().st_size < 1_500_000
