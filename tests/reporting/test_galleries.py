"""Are clips side by side the right ones, in step by their matches, and open to yes and no?"""

import html
import json
import re
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from cli_cases import CLASSES, write_examples
from motionary import compute_features, learn, search
from motionary.errors import InvalidInput
from motionary.features import load_everyday_set
from motionary.labels import Label, LabelTrack
from motionary.motion import Motion
from motionary.plots import style
from motionary.recording import Recording
from motionary.reporting import report_hits, report_library
from motionary.reporting.classes import find_confusions
from motionary.reporting.galleries import cell_of_hit
from motionary.retrieval.index import Collection
from motionary.retrieval.search import QueryExpansion
from motionary.samples import synthetic_motion, synthetic_stream

HOSTILE = "</script><script>alert(1)</script>"


@pytest.fixture(scope="module")
def motions():
    made = {
        f"{name}{seed}": synthetic_motion(name, seed=seed, rate_hz=60.0)
        for name in CLASSES
        for seed in range(3)
    }
    return {name: motion.renamed(name) for name, motion in made.items()}


@pytest.fixture(scope="module")
def result(motions):
    example = QueryExpansion(hits=0)
    return search(motions["squat0"], list(motions.values()), limit=4, expansion=example)


def content_of(text):
    (found,) = re.findall(r'<script type="application/json" id="content">(.*?)</script>', text)
    return json.loads(found)


def test_hits_stand_beside_the_query_with_their_own_frames(motions, result):
    page = report_hits(result, motions, query=motions["squat0"])
    (gallery,) = content_of(page.text)["galleries"]
    query, *cells = gallery["cells"]
    assert query["query"]
    assert query["title"] == "squat0"
    assert len(cells) == len(result) == 4
    for hit, cell in zip(result, cells, strict=True):
        assert cell["title"].endswith(hit.recording.name)
        clip = cell["clip"]
        assert clip["first_frame"] == hit.start_frame
        assert clip["first_frame"] + clip["n_frames"] - 1 == hit.end_frame
        assert f'id="{clip["positions"][0]}"' in page.text
    assert gallery["duration_s"] == pytest.approx(motions["squat0"].duration_s, abs=1e-3)
    assert {row[0] for row in gallery["template"]} <= set(range(40))


def test_clips_keep_in_step_by_their_matches(motions, result):
    page = report_hits(result, motions, query=motions["squat0"])
    (gallery,) = content_of(page.text)["galleries"]
    for cell in gallery["cells"]:
        phases, seconds = np.array(cell["warp"]).T
        assert (phases[0], phases[-1]) == (0.0, 1.0)
        assert (np.diff(phases) >= 0).all()
        assert (np.diff(seconds) >= 0).all()
        assert 0 <= seconds[0] <= seconds[-1] <= cell["clip"]["duration_s"] + 1 / 30


def test_a_slower_half_is_met_by_a_slower_clip(motions):
    squat = motions["squat0"]
    # The first half takes twice its time.
    frames = np.r_[
        np.repeat(np.arange(squat.n_frames // 2), 2), squat.n_frames // 2 : squat.n_frames
    ]
    slowed = Motion(squat.names, squat.positions[frames], squat.recording, squat.mapping)
    made = {"as it was": squat.renamed("as it was"), "slowed": slowed.renamed("slowed")}
    found = search(squat, list(made.values()), limit=2, expansion=QueryExpansion(hits=0))
    (gallery,) = content_of(report_hits(found, made).text)["galleries"]
    poses = []
    for cell in sorted(gallery["cells"], key=lambda one: one["title"].split(maxsplit=1)[1]):
        motion = made[cell["title"].split(maxsplit=1)[1]]
        seconds = cell["start_s"] + np.interp(np.linspace(0, 1, 40), *np.array(cell["warp"]).T)
        shown = np.minimum(np.rint(seconds * 60).astype(int), motion.n_frames - 1)
        poses.append(motion.generic_positions()[shown])
    evenly = [
        one.generic_positions()[np.linspace(0, one.n_frames - 1, 40).astype(int)]
        for one in made.values()
    ]
    in_step, at_one_tempo = (np.abs(one - other).mean() for one, other in (poses, evenly))
    assert in_step < 0.3 * at_one_tempo


def test_hits_by_windows_play_their_own_part_and_say_what_is_alike():
    stream, labels = synthetic_stream(["bow", "squat", "kick_left", "squat"], seed=3)
    stream = stream.renamed("stream")
    everyday = load_everyday_set()
    start, stop = (round(at * stream.rate_hz) for at in labels[1][1:])
    whole = compute_features(stream, feature_set=everyday)
    example = compute_features(stream.cut(start, stop), feature_set=everyday)
    found = search(example, Collection((whole,), everyday), limit=4)
    for hit in found:
        assert hit.start_s - 1e-6 <= hit.evidence.alignment.start / 30
        assert hit.evidence.alignment.end / 30 < hit.end_s
        cell = cell_of_hit(1, hit, stream)
        seconds = cell.warp[:, 1]
        assert 0 <= seconds[0] < seconds[-1] <= cell.motion.duration_s + 1 / 30
        assert [note.split(": ")[0] for note in cell.notes] in (["alike"], ["alike", "differs"])


def test_names_stay_text_and_motions_are_asked_for(motions, result):
    named = {name: motion.renamed(HOSTILE) for name, motion in motions.items()}
    found = search(motions["squat0"], [named["squat1"]], limit=1)
    page = report_hits(found, {HOSTILE: named["squat1"]}, title=HOSTILE)
    assert page.text.count("<script>") == 1
    assert HOSTILE not in page._repr_html_()
    assert html.unescape(page._repr_html_()).count("</iframe>") == 1
    with pytest.raises(InvalidInput, match="is not among the motions"):
        report_hits(result, {})


def test_the_page_of_a_search_takes_yes_and_no(motionary, tmp_path):
    write_examples(tmp_path / "all")
    like = tmp_path / "all" / "squat" / "squat 0.bvh"
    target = tmp_path / "hits.html"
    asked = ("search", tmp_path / "all", "--like", like, "--to", "1.5", "--expand", 0)
    ran = motionary(*asked, "--limit", 6, "--report", target)
    assert ran.code == 0
    text = target.read_text("utf-8")
    assert str(tmp_path) not in text
    (gallery,) = content_of(text)["galleries"]
    judging = gallery["judging"]
    assert judging["command"] == (
        "motionary search all --like 'squat 0.bvh' --to 1.5 --expand 0 --limit 6"
    )
    assert judging["ranks"] == [1, 2, 3, 4, 5, 6]
    assert motionary(*asked, "--relevant", "2", "--irrelevant", "6", "--report", target).code == 0
    (again,) = content_of(target.read_text("utf-8"))["galleries"]
    assert (again["judging"]["relevant"], again["judging"]["irrelevant"]) == ([2], [6])
    titles = {cell["title"].split(maxsplit=1)[1]: cell for cell in again["cells"][1:]}
    second = gallery["cells"][2]["title"].split(maxsplit=1)[1]
    place = [cell["title"] for cell in again["cells"][1:]].index(titles[second]["title"])
    assert again["judging"]["ranks"][place] == 2
    assert motionary(*asked, "--report", tmp_path / "hits.txt").code == 2


@pytest.fixture(scope="module")
def kept(motions):
    """A library that keeps the features of its examples."""
    examples = {name: [motions[f"{name}{seed}"] for seed in range(3)] for name in CLASSES}
    return learn(examples, keep_examples=True)


def test_the_page_of_classes_plays_the_examples_that_are_at_hand(motions, kept):
    galleries = content_of(report_library(kept, recordings=motions).text)["galleries"]
    assert [one["name"] for one in galleries] == list(kept.names)
    for gallery in galleries:
        names = [f"{gallery['name']}{seed}" for seed in range(3)]
        assert [cell["title"] for cell in gallery["cells"]] == names
        assert gallery["template"]
    lists = dict(galleries[0]["lists"])
    assert lists["Examples"] == ["3 of the 3 that it was learned from"]


def test_without_recordings_the_page_says_so_and_names_what_is_near(motions, kept):
    alone = content_of(report_library(kept, names=["squat"]).text)["galleries"]
    assert alone[0]["cells"] == []
    assert "keeps no positions" in dict(alone[0]["lists"])["Examples"][0]
    # A second class of the same motions cannot be told from the first.
    twin = replace(kept["squat"], name="twin")
    near = find_confusions(replace(kept, classes=(*kept.classes, twin)), kept["squat"])
    assert near[0].startswith("twin: costs 0.000")
    assert "may be taken for it" in near[0]
    assert not any("may be taken" in line for line in near[1:])
    with pytest.raises(InvalidInput, match="no classes"):
        report_library(kept, names=[])


def test_a_library_without_examples_shows_the_nearest(motions):
    examples = {name: [motions[f"{name}{seed}"] for seed in range(2)] for name in CLASSES}
    page = report_library(learn(examples), names=["squat"], recordings=motions)
    (gallery,) = content_of(page.text)["galleries"]
    titles = [cell["title"].split()[1] for cell in gallery["cells"][:3]]
    assert set(titles) == {"squat0", "squat1", "squat2"}


def test_the_command_writes_a_page_of_all_classes(motionary, tmp_path):
    write_examples(tmp_path / "examples")
    library, target = tmp_path / "lib", tmp_path / "classes.html"
    assert motionary("learn", tmp_path / "examples", "-o", library).code == 0
    ran = motionary("library", "show", library, "--report", target)
    assert ran.code == 0
    assert len(content_of(target.read_text("utf-8"))["galleries"]) == len(CLASSES)
    assert motionary("library", "show", library).code == 2
    assert motionary("library", "show", library, "squat", "--recordings", tmp_path).code == 2


def test_notebooks_show_motions_labels_and_hits_in_a_frame(motions, result):
    squat = motions["squat0"]
    track = LabelTrack(squat.recording, (Label("squat", 0.1, 1.0),))
    table = LabelTrack(Recording("read"), (Label("squat", 0.1, 1.0),))
    for page in (squat.show(labels=track), track.show(squat), track.show(), table.show()):
        cell = page._repr_html_()
        assert cell.startswith("<iframe ")
        assert 'sandbox="allow-scripts allow-downloads"' in cell
        (recording,) = content_of(page.text)["recordings"]
        assert [row[0] for lane in recording["lanes"] for row in lane["labels"]] == ["squat"]
    assert "positions" not in content_of(track.show().text)["recordings"][0]
    cells = content_of(result.show().text)["galleries"][0]["cells"]
    assert len(cells) == 1 + len(result)
    of_features = search(squat, [compute_features(squat)])
    with pytest.raises(InvalidInput, match="features have no positions"):
        of_features.show()


def test_cells_of_templates_have_the_colours_of_their_pictures():
    folder = resources.files("motionary.reporting") / "page"
    rules = (folder / "style.css").read_text("utf-8")
    colours = {"bar-yes": style.WHITE, "bar-no": style.BLACK, "bar-free": style.FREE}
    for name, colour in colours.items():
        (rule,) = re.findall(rf"^\.{name}\b.*\{{ background: (#\w+)", rules, re.MULTILINE)
        assert rule.upper() == colour
