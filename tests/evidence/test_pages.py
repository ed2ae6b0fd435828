"""Each page of docs/evidence is its record, rendered; records and scripts say the same."""

import re

import pytest
from evidence.common.pages import render
from evidence.common.recordings import SOURCES
from evidence.common.running import FOLDER, read_record, script_of
from evidence.run import SCRIPTS

OVERVIEW = "papers"


def test_each_record_has_a_script_and_each_page_a_record():
    assert {path.stem for path in (FOLDER / "records").glob("*.json")} == set(SCRIPTS)
    assert {path.stem for path in FOLDER.glob("*.md")} == {*SCRIPTS, OVERVIEW}


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_page_is_the_rendering_of_its_record(name):
    page = (FOLDER / f"{name}.md").read_text("utf-8")
    assert page == render(read_record(name), script_of(name))


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_record_is_described_as_its_script_describes_it(name):
    record, script = read_record(name), script_of(name)
    assert record["name"] == name
    assert (record["title"], record["split"], record["seed"]) == (
        script.TITLE, script.SPLIT, script.SEED
    )  # fmt: skip
    said = [entry if isinstance(entry, str) else entry[0] for entry in script.DATA]
    texts = [SOURCES.get(text, text).format(**SOURCES) for text in said]
    assert [entry["what"] for entry in record["data"]] == texts


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_page_shows_pictures_that_are_there(name):
    page = (FOLDER / f"{name}.md").read_text("utf-8")
    for picture in re.findall(r"\]\((pictures/[^)]+)\)", page):
        assert (FOLDER / picture).is_file(), picture


def test_a_page_that_its_record_does_not_bear_out_is_refused():
    record = read_record("joined_query")
    for row in record["results"]["rows"]:
        row["found"]["at once"][0] = 0
    with pytest.raises(ValueError, match="does not show any more"):
        render(record, script_of("joined_query"))
