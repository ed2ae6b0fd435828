"""Are two recordings aligned by what they show, and their differences said in true words?"""

import json
import re

import numpy as np
import pytest

from cli_cases import write_stream
from motionary import compute_features
from motionary.features import FULL_BODY
from motionary.motion import Motion
from motionary.reporting.comparing import (
    align_recordings,
    find_differences,
    report_comparison,
    short_names,
)
from motionary.samples import synthetic_stream
from packing_cases import sequence

RATE_HZ = 60.0


@pytest.fixture(scope="module")
def motion():
    stream, _ = synthetic_stream(("squat", "kick_left"), seed=3, rate_hz=RATE_HZ)
    return stream.renamed("right/take")


def held(motion, second, *, for_s):
    """The same, standing still at one second."""
    at = round(second * RATE_HZ)
    frames = np.r_[:at, np.full(round(for_s * RATE_HZ), at), at : motion.n_frames]
    return Motion(motion.names, motion.positions[frames], motion.recording, motion.mapping).renamed(
        "wrong/take"
    )


def lowest_s(motion):
    return float(np.argmin(motion.generic_positions()[:, 0, 1])) / RATE_HZ


def test_a_pause_is_found_where_it_was_planted(motion):
    at = lowest_s(motion)
    slower = held(motion, at, for_s=0.7)
    first, second = compute_features(motion), compute_features(slower)
    warp = align_recordings(first, second)
    assert len(warp) == len(first)
    assert (np.diff(warp) >= 0).all()
    times = np.arange(len(first)) / 30
    truth = np.where(times <= at, times, times + 0.7)
    away = np.abs(warp - truth)
    assert np.median(away[np.abs(times - at) > 0.5]) < 0.1

    found = find_differences(first, second, warp)
    names = [first.feature_set.features[one.feature].name for one in found]
    (bent,) = (one for one, name in zip(found, names, strict=True) if name == "left knee bent")
    assert bent.other_s - bent.reference_s == pytest.approx(0.7, abs=0.1)
    assert bent.here.start_s < at < bent.here.end_s


def test_the_same_recording_differs_nowhere(motion):
    sequence = compute_features(motion)
    warp = align_recordings(sequence, sequence)
    assert np.abs(warp - np.arange(len(sequence)) / 30).max() < 1e-6
    assert find_differences(sequence, sequence, warp) == []


def test_what_holds_throughout_in_both_is_no_difference():
    # Nine of ten seconds here; there a fifth slower, and for 0.2 s less than that.
    here, there = (np.zeros((n, len(FULL_BODY)), dtype=bool) for n in (300, 360))
    here[15:285, 0], there[18:336, 0] = True, True
    here[100:130, 1], there[120:162, 1] = True, True
    warp = np.linspace(0, 359, 300) / 30
    found = find_differences(sequence(here), sequence(there), warp)
    assert [one.feature for one in found] == [1]


def test_the_page_says_it_in_words(motion):
    page = report_comparison(motion, held(motion, lowest_s(motion), for_s=0.7))
    (text,) = re.findall(r'<script type="application/json" id="content">(.*?)</script>', page.text)
    (recording,) = json.loads(text)["recordings"]
    summary = recording["other"]["summary"]
    assert re.search(r"right lasts \d+\.\d s, wrong lasts \d+\.\d s", summary[0])
    assert any(re.fullmatch(r"left knee bent 0\.[678] s longer in wrong", line) for line in summary)
    labels = [label for lane in recording["lanes"] for label in lane["labels"]]
    assert labels
    assert all(
        lane["whys"][label[6]]["lines"] for lane in recording["lanes"] for label in lane["labels"]
    )


@pytest.mark.parametrize(
    ("names", "short"),
    [
        (("a/x.bvh", "b/x.bvh"), ("a", "b")),
        (("a/x.bvh", "a/y.bvh"), ("x.bvh", "y.bvh")),
        (("x", "x"), ("x (first)", "x (second)")),
        (("", "y"), ("motion", "y")),
    ],
)
def test_names_are_what_tells_them_apart(names, short):
    assert short_names(*names) == short


def test_the_command_takes_two_files(motionary, tmp_path):
    for place in ("b/take.bvh", "a/take.bvh"):
        write_stream(tmp_path / place)
    first, second = tmp_path / "b/take.bvh", tmp_path / "a/take.bvh"
    target = tmp_path / "out.html"
    assert motionary("report", first, second, "--compare", "-o", target).code == 0
    text = target.read_text("utf-8")
    assert "<title>b and a</title>" in text
    assert str(tmp_path) not in text
    assert motionary("report", first, "--compare", "-o", tmp_path / "x.html").code == 2
    ran = motionary(
        "report", first, second, "--compare", "--library", "everyday", "-o", tmp_path / "x.html"
    )
    assert ran.code == 2
