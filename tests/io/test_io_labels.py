"""Do tables of labels keep what they say, and is nonsense refused with its line?"""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.io import read_labels, write_labels
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording, Segment

HEADER = "recording,label,start_s,end_s\n"


def table(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "labels.csv"
    path.write_bytes(text.encode(encoding))
    return path


def test_rows_become_tracks_sorted(tmp_path):
    tracks = read_labels(
        table(tmp_path, HEADER + "b.amc,walk,1,2.5\na/b c.bvh,jump,3,4\nb.amc,run,0,1\n")
    )
    assert list(tracks) == ["a/b c.bvh", "b.amc"]
    assert tracks["b.amc"].labels == (Label("run", 0, 1), Label("walk", 1, 2.5))
    assert tracks["b.amc"].duration_s is None


def test_known_columns_are_read_and_further_ones_kept(tmp_path):
    text = (
        "who,end_s,start_s,Label,recording,cost,known,start_frame,end_frame,note\n"
        'Ana,2,1,"kick, left",x,0.05,0.9,121,240,"she said ""go"""\n'
        "Bo,3,2,walk,x,,,,,\n"
    )
    first, second = read_labels(table(tmp_path, text))["x"]
    assert first == Label("kick, left", 1, 2, 0.05, 0.9, 121, 240)
    assert first.extra == {"who": "Ana", "note": 'she said "go"'}
    assert second == Label("walk", 2, 3)
    assert second.extra == {"who": "Bo", "note": ""}


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        (HEADER + "ü x,jump,1.5,2\n", "utf-8"),
        (HEADER + "ü x,jump,1.5,2\n", "utf-8-sig"),
        (HEADER + "ü x,jump,1.5,2\n", "utf-16"),
        (HEADER + "ü x,jump,1.5,2\n", "latin-1"),
        (HEADER + "ü x,jump,1.5,2", "utf-8"),
        ("\n" + HEADER + "\n,,,\n ü x , jump ,1.5, 2\n\n", "utf-8"),
        ((HEADER + "ü x,jump,1.5,2\n").replace("\n", "\r\n"), "utf-8"),
        ((HEADER + "ü x,jump,1.5,2\n").replace(",", "\t"), "utf-8"),
        ((HEADER + "ü x,jump,1.5,2\n").replace(",", ";"), "utf-8"),
        ("sep=;\n" + HEADER.replace(",", ";") + "ü x;jump;1,5;2,0\n", "utf-8"),
        (HEADER.upper() + '"ü x","jump","1.5","2"\n', "utf-8"),
    ],
)
def test_looks_of_a_table_do_not_matter(tmp_path, text, encoding):
    tracks = read_labels(table(tmp_path, text, encoding))
    assert tracks == {"ü x": LabelTrack(Recording("ü x"), (Label("jump", 1.5, 2),))}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty; expected"),
        ("\n\n", "empty; expected"),
        ("recording,label,start_s\nx,a,1\n", "line 1: column end_s is missing"),
        ("label,start,end\na,1,2\n", "line 1: column recording, start_s, end_s is missing"),
        ("recording,label,start_s,end_s,label\n", "line 1: column label occurs twice"),
        (HEADER + "x,a,1,2\nx,a,1\n", "line 3: 3 cells"),
        (HEADER + "x,a,1,2,3\n", "line 2: 5 cells"),
        (HEADER + "x,a,one,2\n", "line 2: start_s must be a number, got 'one'"),
        (HEADER + "x,a,1,nan\n", "line 2: end_s must be a number"),
        (HEADER + "x,a,1,inf\n", "line 2: end_s must be a number"),
        (HEADER + "x,a,1_0,20\n", "line 2: start_s must be a number"),
        (HEADER + "x,a,,2\n", "line 2: start_s is empty"),
        (HEADER + "\nx,a,2,1\n", "line 3: .*start must not come after end"),
        (HEADER + "x,,1,2\n", "line 2: a label needs a name"),
        (HEADER + ",a,1,2\n", "line 2: the recording is empty"),
        (HEADER + '"x,a,1,2\n', "line 2: not a table"),
        (HEADER + 'x,"a"b,1,2\n', "line 2: not a table"),
        (HEADER[:-1] + ",start_frame\nx,a,1,2,3.5\n", "line 2: start_frame must be a whole"),
        (HEADER[:-1] + ",known\nx,a,1,2,much\n", "line 2: known must be a number"),
    ],
)
def test_nonsense_is_refused_with_its_line(tmp_path, text, words):
    with pytest.raises(UnreadableFile, match=words) as caught:
        read_labels(table(tmp_path, text))
    assert "labels.csv" in str(caught.value)


def test_a_missing_table_is_unreadable(tmp_path):
    with pytest.raises(UnreadableFile, match=r"nowhere\.csv"):
        read_labels(tmp_path / "nowhere.csv")


names = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=8)
times = st.tuples(st.floats(0, 1e5), st.floats(0, 1e5)).map(sorted)
labels = st.builds(
    lambda name, times, cost, known, frames: Label(name, *times, cost, known, *frames),
    names,
    times,
    st.none() | st.floats(0, 1),
    st.floats(0, 1),
    st.just((None, None)) | st.tuples(st.integers(0, 10**6), st.integers(0, 10**6)),
)


@given(st.dictionaries(names, st.lists(labels, min_size=1, max_size=4), max_size=3))
def test_what_is_written_is_read(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("labels") / "out.csv"
    tracks = {name: LabelTrack(Recording(name), tuple(content[name])) for name in sorted(content)}
    write_labels(tracks, path)
    assert read_labels(path) == tracks
    first = path.read_bytes()
    write_labels(list(tracks.values()), path)
    assert path.read_bytes() == first


def test_further_columns_come_back_in_their_sequence(tmp_path):
    track = LabelTrack(
        Recording("x"),
        (
            Label("a", 0, 1, extra={"who": "Ana", "note": "1;2,3\n4"}),
            Label("b", 1, 2, extra={"zeal": "much"}),
        ),
    )
    write_labels(track, tmp_path / "out.csv")
    text = (tmp_path / "out.csv").read_text(encoding="utf-8")
    assert text.startswith("recording,label,start_s,end_s,who,note,zeal\nx,a,0.0,1.0,Ana,")
    first, second = read_labels(tmp_path / "out.csv")["x"]
    assert first.extra == {"who": "Ana", "note": "1;2,3\n4", "zeal": ""}
    assert second.extra["zeal"] == "much"


def test_a_further_column_cannot_take_an_own_name(tmp_path):
    track = LabelTrack(Recording("x"), (Label("a", 0, 1, extra={"cost": "dear"}),))
    with pytest.raises(InvalidInput, match="cost"):
        write_labels(track, tmp_path / "out.csv")


def test_an_unwritable_place_is_said(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(UnwritableFile, match=r"out\.csv.*cannot be written"):
        write_labels(LabelTrack(Recording("x")), tmp_path / "file" / "out.csv")


def test_the_tables_of_truth_are_read(data):
    tracks = {}
    for path in sorted((data / "truth").glob("*.csv")):
        tracks[path.stem] = read_labels(path)
    counts = {name: len(track) for name, track in tracks["annotation_2009"].items()}
    assert counts == {"01_01": 12, "49_08": 1, "86_01": 13, "HDM_bd_03-03_01_120": 9}
    assert tracks["annotation_2009"]["01_01"].labels[0].extra["first_frame"] == "165"
    assert len(tracks["segments_86_01"]["86_01"]) == 7


def test_what_was_measured_says_how_much_was_known(tmp_path):
    measured = LabelTrack(Recording("a"), (Label("walk", 0, 1, cost=0.02),))
    write_labels(measured, tmp_path / "measured.csv")
    assert (tmp_path / "measured.csv").read_text().splitlines() == [
        "recording,label,start_s,end_s,cost,known",
        "a,walk,0.0,1.0,0.02,1.0",
    ]
    write_labels(LabelTrack(Recording("a"), (Label("walk", 0, 1),)), tmp_path / "by-hand.csv")
    assert "known" not in (tmp_path / "by-hand.csv").read_text()


@pytest.mark.parametrize(
    ("table", "rate_hz"),
    [
        ("recording,label,start_s,end_s\nx,a,0:01.5,1:02:03\n", None),
        ("recording,label,start_ms,end_ms\nx,a,1500,3723000\n", None),
        ("recording;label;start_s;end_s\nx;a;0:01,5;3723\n", None),
        ("recording,label,start_frame,end_frame\nx,a,15,37229\n", 10),
        ("recording,label,start_s,end_s,cost\nx,a,1.5,3723,n/a\n", None),
    ],
)
def test_times_as_people_write_them(tmp_path, table, rate_hz):
    path = tmp_path / "labels.csv"
    path.write_text(table, encoding="utf-8")
    (label,) = read_labels(path, rate_hz=rate_hz)["x"]
    assert (label.start_s, label.end_s, label.cost) == (1.5, 3723, None)


@pytest.mark.parametrize(
    ("columns", "options"),
    [("start_frame,end_frame", {}), ("start_s,end_s", {"in_frames": True})],
)
def test_frames_are_those_of_the_recording(tmp_path, columns, options):
    path = tmp_path / "labels.csv"
    path.write_text(f"recording,label,{columns},unassessed\nx,a,16,20,\nx,,21,30,1\n", "utf-8")
    first = Recording("x.amc", rate_hz=10, first_frame=1)
    track = read_labels(path, recordings={"x.amc": first}, rate_hz=99, **options)["x"]
    (label,) = track
    assert (label.start_s, label.end_s) == (1.5, 2.0)
    assert (label.start_frame, label.end_frame) == (16, 20)
    assert track.unassessed == (Segment(2.0, 3.0),)
    with pytest.raises(InvalidInput, match=r"times of ELAN are no frames"):
        read_labels(tmp_path / "a.eaf", in_frames=True)


def test_frames_without_a_rate_and_cells_without_a_column_are_refused(tmp_path):
    path = tmp_path / "labels.csv"
    path.write_text("recording,label,start_frame,end_frame\nx,a,1,2\n", encoding="utf-8")
    with pytest.raises(UnreadableFile, match=r"line 2: says frames and no times"):
        read_labels(path)
    with pytest.raises(UnreadableFile, match=r"line 2: frame 1 comes before the first one, 3"):
        read_labels(path, recordings={"x.amc": Recording("x.amc", rate_hz=10, first_frame=3)})
    path.write_text("recording,label,start_s,end_s,\nx,a,1,2,what\n", encoding="utf-8")
    with pytest.raises(UnreadableFile, match=r"line 2: 'what' stands in a column without a name"):
        read_labels(path)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-16", "cp1252"])
def test_text_of_other_encodings(tmp_path, encoding):
    path = tmp_path / "labels.csv"
    path.write_bytes("recording,label,start_s,end_s\nx,Höhe – é,1,2\n".encode(encoding))
    (label,) = read_labels(path)["x"]
    assert label.name == "Höhe – é"
