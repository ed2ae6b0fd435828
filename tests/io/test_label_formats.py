"""Labels go to other programs and come back, exact to the frame."""

import csv
import json
from xml.etree import ElementTree as ET

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io import read_labels, write_labels
from motionary.io.labels import FORMATS, find_label_format
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording, Segment

RATES = [24, 29.97, 30, 50, 59.94, 100, 120]
PHASES = [Phase.generate]
FREE = [form for form in FORMATS if not form.needs_recording]
NAMES = [form.name for form in FREE]

texts = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=6)
names = st.one_of(
    texts,
    st.sampled_from(
        ['a "b" </script>', "<b>&amp;", "[x] y", "--> 0", "=1+1", "été 走る", "1;2,3", "_x0041_"]
    ),
)
frames = st.lists(st.integers(0, 20_000), min_size=2, max_size=2, unique=True).map(sorted)
tracks_of_labels = st.lists(
    st.tuples(names, frames, st.sampled_from(["", "left hand", "truth (old)", "=x"])), max_size=5
)
segments = st.lists(frames, max_size=2)


def make(rate, content, unseen=()):
    labels = [
        Label(name, a / rate, b / rate, extra={"track": track} if track else {})
        for name, (a, b), track in content
    ]
    gaps = tuple(sorted(Segment(a / rate, b / rate) for a, b in unseen))
    return LabelTrack(Recording("take", rate_hz=rate), tuple(labels), gaps)


def bare(track, rate):
    def on(time):
        return round(time * rate)

    return (
        sorted(
            (x.name, on(x.start_s), on(x.end_s), x.extra.get("track") or "") for x in track.labels
        ),
        [(on(a), on(b)) for a, b in track.unassessed],
    )


def place(folder, form):
    suffix = ".TextGrid" if form.name == "praat" else form.suffixes[0]
    return folder / f"take{suffix}"


@pytest.mark.parametrize("form", FREE, ids=NAMES)
def test_labels_come_back_to_the_frame(form, tmp_path_factory):
    folder = tmp_path_factory.mktemp("labels")
    path = place(folder, form)

    @settings(max_examples=12, deadline=None, phases=PHASES)
    @given(st.sampled_from(RATES), tracks_of_labels, segments)
    def check(rate, content, unseen):
        track = make(rate, content, unseen)
        write_labels(track, path, to=form.name)
        again = read_labels(path, rate_hz=rate)
        if not content and not unseen and form.suffixes[0] in (".csv", ".tsv", ".xlsx"):
            assert again == {}
            return
        assert list(again) == ["take"]
        assert bare(again["take"], rate) == bare(track, rate)
        if form.resolution_s or not form.is_single:
            # To the last digit where the rate is known.
            assert {x.start_s for x in again["take"]} == {x.start_s for x in track}

    check()


def test_what_was_measured_is_kept_by_tables_and_json(tmp_path):
    label = Label(
        "walk", 0.5, 1, 0.02, 0.75, 15, 29, score=12.5, probability=0.9, false_per_min=0.1,
        side="mirrored", extra={"note": "x"},
    )  # fmt: skip
    track = LabelTrack(Recording("take.bvh"), (label,), (Segment(2, 3),))
    kept = [form for form in FORMATS if form.keeps_all]
    assert {form.name for form in kept} == {"csv", "tsv", "xlsx", "jsonl"}
    for form in kept:
        write_labels([track], place(tmp_path, form), to=form.name)
        (again,) = read_labels(place(tmp_path, form))["take.bvh"]
        assert again == label
        assert again.extra == {"note": "x"}


def test_elan_files_open_in_pympi(tmp_path):
    elan = pytest.importorskip("pympi").Elan
    content = [("walk", (24, 48), ""), ("wave", (30, 40), ""), ("jump", (50, 60), "truth")]
    write_labels(make(24, content, [(70, 80)]), tmp_path / "x.eaf")
    file = elan.Eaf(tmp_path / "x.eaf")
    assert list(file.get_tier_names()) == ["labels", "labels (2)", "truth", "unassessed"]
    assert [x[:3] for x in file.get_annotation_data_for_tier("labels")] == [(1000, 2000, "walk")]
    assert [x[:3] for x in file.get_annotation_data_for_tier("truth")] == [(2083, 2500, "jump")]
    assert sorted(value[0][0] for value, _ in file.get_cv_entries("labels")[0].values()) == [
        "jump", "walk", "wave",
    ] if isinstance(file.get_cv_entries("labels"), tuple) else True  # fmt: skip
    assert ("motionary.recording", "take") in file.get_properties()
    # What a person adds there is read back.
    file.add_annotation("truth", 3001, 3500, "kick")
    file.to_file(tmp_path / "y.eaf")
    added = [x for x in read_labels(tmp_path / "y.eaf")["take"] if x.name == "kick"]
    assert [(x.start_s, x.end_s, x.extra) for x in added] == [(3.001, 3.5, {"track": "truth"})]


def test_text_grids_open_in_pympi(tmp_path):
    praat = pytest.importorskip("pympi").Praat
    content = [('say "a"', (30, 60), ""), ("wave", (45, 75), "")]
    write_labels(make(30, content), tmp_path / "x.TextGrid")
    grid = praat.TextGrid(tmp_path / "x.TextGrid")
    found = [(t.name, [i for i in t.get_all_intervals() if i[2]]) for t in grid.get_tiers()]
    assert found == [("labels", [(1.0, 2.0, 'say "a"')]), ("labels (2)", [(1.5, 2.5, "wave")])]
    grid.to_file(tmp_path / "short.TextGrid", mode="short")
    assert bare(read_labels(tmp_path / "short.TextGrid")["short"], 30)[0] == sorted(
        [('say "a"', 30, 60, ""), ("wave", 45, 75, "")]
    )


def test_elan_elements_stand_in_the_sequence_of_its_schema(tmp_path):
    write_labels(make(30, [("walk", (3, 9), "")], [(1, 2)]), tmp_path / "x.eaf")
    root = ET.parse(tmp_path / "x.eaf").getroot()
    order = [
        "LICENSE", "HEADER", "TIME_ORDER", "TIER", "LINGUISTIC_TYPE", "LOCALE", "LANGUAGE",
        "CONSTRAINT", "CONTROLLED_VOCABULARY",
    ]  # fmt: skip
    places = [order.index(child.tag) for child in root]
    assert places == sorted(places)
    kinds = {kind.get("LINGUISTIC_TYPE_ID") for kind in root.iter("LINGUISTIC_TYPE")}
    assert {tier.get("LINGUISTIC_TYPE_REF") for tier in root.iter("TIER")} <= kinds
    slots = [int(slot.get("TIME_VALUE")) for slot in root.iter("TIME_SLOT")]
    assert slots == sorted(slots)


def test_elan_tiers_that_people_make_are_read(tmp_path):
    (tmp_path / "x.eaf").write_text(
        """<?xml version="1.0" encoding="UTF-8"?>
<ANNOTATION_DOCUMENT AUTHOR="" DATE="2020-01-01T00:00:00Z" FORMAT="3.0" VERSION="3.0">
<HEADER MEDIA_FILE="" TIME_UNITS="milliseconds">
<MEDIA_DESCRIPTOR MEDIA_URL="file:///D:/videos/my%20take.mp4" MIME_TYPE="video/mp4"/></HEADER>
<TIME_ORDER><TIME_SLOT TIME_SLOT_ID="ts1" TIME_VALUE="100"/><TIME_SLOT TIME_SLOT_ID="ts2"/>
<TIME_SLOT TIME_SLOT_ID="ts3" TIME_VALUE="300"/></TIME_ORDER>
<TIER LINGUISTIC_TYPE_REF="default-lt" TIER_ID="walk"><ANNOTATION>
<ALIGNABLE_ANNOTATION ANNOTATION_ID="a1" TIME_SLOT_REF1="ts1" TIME_SLOT_REF2="ts2">
<ANNOTATION_VALUE/></ALIGNABLE_ANNOTATION></ANNOTATION><ANNOTATION>
<ALIGNABLE_ANNOTATION ANNOTATION_ID="a2" TIME_SLOT_REF1="ts2" TIME_SLOT_REF2="ts3">
<ANNOTATION_VALUE>limp</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION></TIER>
<TIER LINGUISTIC_TYPE_REF="n" PARENT_REF="walk" TIER_ID="notes"><ANNOTATION>
<REF_ANNOTATION ANNOTATION_ID="a3" ANNOTATION_REF="a1"><ANNOTATION_VALUE>?</ANNOTATION_VALUE>
</REF_ANNOTATION></ANNOTATION></TIER></ANNOTATION_DOCUMENT>""",
        encoding="utf-8",
    )
    ((name, track),) = read_labels(tmp_path / "x.eaf").items()
    assert name == "my take.mp4"
    assert [(x.name, x.start_s, x.end_s) for x in track] == [("walk", 0.1, 0.2), ("limp", 0.2, 0.3)]


BORIS_OLD = """Observation id\tob 1\t\t\t\t\t\t\t
Media file(s)\t\t\t\t\t\t\t\t
Time\tMedia file path\tTotal length\tFPS\tSubject\tBehavior\tBehavioral category\tComment\tStatus
1.5\ta.mp4\t10\t25\tAna\twalk\tgait\t\tSTART
2.0\ta.mp4\t10\t25\tNo focal subject\tblink\t\t\tPOINT
2.5\ta.mp4\t10\t25\tAna\twalk\tgait\t\tSTOP
"""


def test_boris_of_older_versions_is_read(tmp_path):
    (tmp_path / "x.tsv").write_text(BORIS_OLD)
    track = read_labels(tmp_path / "x.tsv")["ob 1"]
    assert [(x.name, x.start_s, x.end_s, dict(x.extra)) for x in track] == [
        ("walk", 1.5, 2.5, {"track": "Ana"}),
        ("blink", 2, 2, {}),
    ]
    assert track.rate_hz == 25


def test_boris_tables_have_the_columns_of_its_exports(tmp_path):
    track = make(25, [("walk", (25, 50), "Ana")])
    write_labels(track, tmp_path / "a.csv", to="boris")
    write_labels(track, tmp_path / "t.csv", to="boris-tabular")
    (row,) = csv.DictReader((tmp_path / "a.csv").read_text().splitlines())
    wanted = {
        "Observation id": "take", "Subject": "Ana", "Behavior": "walk", "Behavior type": "STATE",
        "Start (s)": "1.0", "Stop (s)": "2.0", "FPS (frame/s)": "25.0", "Image index stop": "50",
    }  # fmt: skip
    assert wanted.items() <= row.items()
    rows = list(csv.DictReader((tmp_path / "t.csv").read_text().splitlines()))
    assert [(x["Behavior type"], x["Time"]) for x in rows] == [("START", "1.0"), ("STOP", "2.0")]


def test_label_studio_and_babel_files_have_their_layout(tmp_path):
    track = make(30, [("walk", (30, 60), "")])
    write_labels(track, tmp_path / "x.json", to="label-studio-video")
    (task,) = json.loads((tmp_path / "x.json").read_text())
    (result,) = task["annotations"][0]["result"]
    assert result["type"] == "timelinelabels"
    assert result["value"] == {"ranges": [{"start": 31, "end": 60}], "timelinelabels": ["walk"]}
    write_labels(track, tmp_path / "x.json", to="label-studio")
    (task,) = json.loads((tmp_path / "x.json").read_text())
    value = task["annotations"][0]["result"][0]["value"]
    assert value == {"start": 1.0, "end": 2.0, "instant": False, "timeserieslabels": ["walk"]}
    write_labels(track, tmp_path / "x.json", to="babel")
    (sequence,) = json.loads((tmp_path / "x.json").read_text()).values()
    (label,) = sequence["frame_ann"]["labels"]
    assert (label["act_cat"], label["start_t"], label["end_t"]) == (["walk"], 1.0, 2.0)


def test_several_recordings_share_a_file_where_the_format_has_room(tmp_path):
    two = [LabelTrack(Recording(name), (Label("a", 0, 1),)) for name in ("one", "two")]
    for form in FREE:
        path = place(tmp_path, form)
        if form.is_single:
            with pytest.raises(InvalidInput, match="holds one recording, got 2"):
                write_labels(two, path, to=form.name)
        elif form.name != "label-studio-video":
            write_labels(two, path, to=form.name)
            assert list(read_labels(path)) == ["one", "two"]


BOMB = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaa">]><x>&a;</x>'


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("x.eaf", BOMB, "document type"),
        ("x.eaf", "<ANNOTATION_DOCUMENT>", "broken XML"),
        ("x.eaf", "<html/>", "expected a file of ELAN"),
        ("x.TextGrid", "hello", "no TextGrid"),
        ("x.TextGrid", '"ooTextFile" "Pitch"', "Pitch"),
        ("x.TextGrid", '"ooTextFile" "TextGrid" 0 1 <exists> 3', "end of the file"),
        ("x.srt", "1\nhello\n", "block 1: expected times"),
        ("x.vtt", "WEBVTT\n\n00:01.000 --> 0\nx", "block 2: expected times"),
        ("x.srt", "1\n00:00:02,000 --> 00:00:01,000\nx", "start must not come after end"),
        ("x.vtt", "WEBVTT\n\nNOTE unassessed 0:02.0 --> 0:01.0", "block 2: .* after end"),
        ("x.csv", "recording,label,start_s,end_s,unassessed\na,,2,1,1\n", "line 2: .* after end"),
        ("x.jsonl", '{"recording": "a", "labels": [], "unassessed": [{"start_s": 2, "end_s": 1}]}',
         "line 1: .* after end"),
        ("x.json", "{", "broken JSON"),
        ("x.json", "[" * 100_000, "broken JSON"),
        ("x.json", "{}", "expected tasks of Label Studio"),
        ("x.json", '[{"annotations": [{"result": [{"type": "timeserieslabels"}]}]}]', "'start' is"),
        ("x.json", '{"1": {"babel_sid": 1, "frame_ann": {"labels": [3]}}}', "another kind"),
        ("x.jsonl", '{"labels": []}', "line 1: expected"),
        ("x.jsonl", '{"recording": "a", "labels": [{"label": "a"}]}', "start_s"),
        ("x.txt", "1\t2\ta\n3\tb\n", "line 2: expected start, end and label"),
        ("x.tsv", BORIS_OLD.replace("STOP", "START"), "row 6: 'walk' of 'Ana' starts twice"),
        ("x.tsv", BORIS_OLD.rsplit("2.5", 1)[0], "starts and never stops"),
        ("x.xlsx", "PK", "no workbook of Excel"),
        ("x.docx", "", "labels, got .docx; known are .c3d, .csv, .eaf"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(tmp_path, name, content, words):
    if name.endswith("xlsx"):
        pytest.importorskip("openpyxl")
    (tmp_path / name).write_text(content)
    with pytest.raises(UnreadableFile, match=words):
        read_labels(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "to", "words"),
    [
        ("x.docx", None, r"not written as \.docx.*elan \(\.eaf\)"),
        ("x.json", None, "several formats.*label-studio, label-studio-video, babel"),
        ("x.csv", "word", "no format of labels is called 'word'"),
        ("x.json", "label-studio-video", "rate of take is unknown"),
        ("x.srt", None, "stands for what was not seen"),
        ("x.eaf", None, "a track cannot be called 'unassessed'"),
    ],
)
def test_what_cannot_be_written_is_refused(tmp_path, name, to, words):
    label = Label("[unassessed]", 0, 1, extra={"track": "unassessed"} if "eaf" in name else {})
    with pytest.raises(InvalidInput, match=words):
        write_labels(LabelTrack(Recording("take"), (label,)), tmp_path / name, to=to)
    assert not list(tmp_path.iterdir())


def test_formats_are_found_by_name_and_suffix():
    assert find_label_format("x.TextGrid").name == "praat"
    assert find_label_format("x.csv", to="BORIS").name == "boris"
    assert find_label_format("-").name == "csv"
    assert find_label_format("x", to=".eaf").name == "elan"
