"""Results as tables: HTML for notebooks, and data frames."""

import sys
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from motionary.batch import Failure
from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import compute_features
from motionary.labels import Label, LabelTrack, count
from motionary.models.library import ClassLibrary, learn
from motionary.recording import Recording, Segment
from motionary.retrieval.search import SearchResult, search
from motionary.samples import synthetic_motion
from motionary.tables import Table, format_html

HOSTILE = "<script>alert(1)</script>&\"'\x1b[2J\u202e.bvh"


class Cells(HTMLParser):
    """Texts of a document's cells by row, and the tags it has."""

    def __init__(self, document):
        super().__init__()
        self.tags, self.rows, self.texts = set(), [], []
        self.feed(document)

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")
        self.in_cell = tag in ("td", "th")

    def handle_data(self, text):
        self.texts.append(text)
        if self.in_cell:
            self.rows[-1][-1] += text


@pytest.fixture(scope="module")
def results():
    """One of each kind, of a recording and a class with hostile names."""
    motion = synthetic_motion("squat", seed=0, rate_hz=30).renamed(HOSTILE)
    sequence = compute_features(motion)
    library = learn({HOSTILE: [motion, motion]})
    labels = (
        Label(HOSTILE, 0.5, 1.25, cost=0.1, extra={"by": "<b>me</b>"}),
        Label("squat", 1.0, 1.5, start_frame=30, end_frame=44),
    )
    track = LabelTrack(Recording(HOSTILE), labels, (Segment(0.0, 0.25),))
    result = SearchResult(
        search(sequence, [sequence]).hits,
        (),
        (Failure((HOSTILE, HOSTILE), UnreadableFile(HOSTILE)),),
    )
    return {
        "Motion": motion,
        "FeatureSequence": sequence,
        "LabelTrack": track,
        "ClassLibrary": library,
        "SearchResult": result,
        "ClassCounts": count(track),
    }


KINDS = ("Motion", "FeatureSequence", "LabelTrack", "ClassLibrary", "SearchResult", "ClassCounts")


@pytest.mark.parametrize("kind", KINDS)
def test_notebooks_show_a_table_whatever_names_say(results, kind):
    one = results[kind]
    document = one._repr_html_()
    cells = Cells(document)
    assert type(one).__name__ == kind
    assert cells.tags <= {"div", "p", "table", "thead", "tbody", "tr", "th", "td"}
    assert "".join(cells.texts).isprintable()
    assert len(cells.rows) > 1
    assert len({len(row) for row in cells.rows}) == 1
    assert len(document) < 12_000
    assert len(repr(one)) < 400


def test_what_a_track_shows(results):
    rows = Cells(results["LabelTrack"]._repr_html_()).rows
    assert rows[0] == ["recording", "label", "start_s", "end_s", "start_frame", "end_frame",
                       "cost", "known", "unassessed", "by"]  # fmt: skip
    assert [row[1:4] for row in rows[1:]] == [
        ["", "0", "0.25"],
        [rows[1][0], "0.5", "1.25"],
        ["squat", "1", "1.5"],
    ]
    assert rows[1][-2:] == ["True", ""]
    assert rows[2][-1] == "<b>me</b>"


def test_long_tables_end_and_empty_columns_are_left_out():
    table = Table(("a", "b", "c"), [(number, None, float("nan")) for number in range(50)])
    document = format_html(table, title="t")
    assert Cells(document).rows == [["a"], *([str(number)] for number in range(20))]
    assert "30 more rows" in document
    assert "table" not in Cells(format_html(Table(("a",), []), title="t")).tags


@pytest.mark.parametrize("kind", KINDS[1:])
def test_without_pandas_data_frames_say_what_to_install(results, kind, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(InvalidInput, match=r"pip install 'motionary\[pandas\]'"):
        results[kind].to_dataframe()


def test_data_frames(results):
    pandas = pytest.importorskip("pandas")
    frames = {kind: results[kind].to_dataframe() for kind in KINDS[1:]}
    assert all(isinstance(frame, pandas.DataFrame) for frame in frames.values())
    labels = frames["LabelTrack"]
    assert labels["label"].isna().tolist() == labels["unassessed"].tolist() == [True, False, False]
    assert labels["end_s"].tolist() == [0.25, 1.25, 1.5]
    assert labels["by"][1] == "<b>me</b>"
    assert frames["ClassCounts"]["number"].tolist() == [1, 1]
    assert frames["SearchResult"]["rank"].tolist() == [1]
    assert frames["ClassLibrary"]["class"].tolist() == [HOSTILE]
    empty = LabelTrack(Recording("a")).to_dataframe()
    assert (len(empty), list(empty.columns)[:2]) == (0, ["recording", "label"])
    assert len(ClassLibrary(()).to_dataframe()) == 0


def test_the_data_frame_of_features_has_unknown_ones(results):
    pytest.importorskip("pandas")
    motion = results["Motion"]
    places = motion.positions.copy()
    places[:, [name.startswith("l") for name in motion.names]] = np.nan
    sequence = compute_features(replace(motion, positions=places))
    frame = sequence.to_dataframe()
    assert frame.shape == sequence.features.shape
    assert list(frame.columns) == list(sequence.feature_set.names)
    assert frame.index.name == "time_s"
    assert np.allclose(frame.index[:3], [0, 1 / 30, 2 / 30])
    assert np.array_equal(frame.isna().to_numpy(), sequence.known_features == 0)
    assert 0 < frame.isna().to_numpy().mean() < 1
    assert np.array_equal(frame.fillna(0).to_numpy(dtype=np.uint8), sequence.features)
