"""How is one piece of evidence made, from recordings to page?"""

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from evidence.common.pages import render
from evidence.common.recordings import Recordings, load
from evidence.common.records import (
    FOLDER,
    PICTURES,
    describe_commit,
    describe_machine,
    read_record,
    rounded,
    write_record,
)
from motionary.plots import save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Results = dict[str, Any]

JOBS = 2


@dataclass(frozen=True)
class Evidence:
    """A table or figure.

    Attributes
    ----------
    name : of the script, the record and the page
    title : of the page
    split : what is learned from and what is tested on, in a sentence
    seed : of all that is drawn at random
    describe_data : entries of the record on the data that were used
    measure : results, plain numbers and words
    write : body of the page, from the results alone
    draw : pictures by name, from the results alone
    draw_recordings : further pictures, for which recordings are needed
    """

    name: str
    title: str
    split: str
    seed: int
    describe_data: Callable[[Recordings], list[dict[str, Any]]]
    measure: Callable[[Recordings], Results]
    write: Callable[[Results], str]
    draw: "Callable[[Results], Mapping[str, Figure]]"
    draw_recordings: "Callable[[Recordings, Results], Mapping[str, Figure]] | None" = None


def make(evidence: Evidence, recordings: Recordings) -> None:
    """Measure, and write record, pictures and page."""
    began = time.perf_counter()
    results = evidence.measure(recordings)
    seconds = time.perf_counter() - began
    record = rounded(
        {
            "name": evidence.name,
            "title": evidence.title,
            "command": f"python -m evidence.run {evidence.name}",
            "data": evidence.describe_data(recordings),
            "split": evidence.split,
            "seed": evidence.seed,
            "commit": describe_commit(),
            "machine": describe_machine(),
            "seconds": seconds,
            "results": results,
        }
    )
    write_record(record)
    if evidence.draw_recordings:
        _save(evidence.draw_recordings(recordings, record["results"]))
    show(evidence)
    sys.stdout.write(f"{evidence.name}: {seconds:.0f} s\n")
    sys.stdout.flush()


def show(evidence: Evidence) -> None:
    """Write pictures and page from the record that is there."""
    record = read_record(evidence.name)
    _save(evidence.draw(record["results"]))
    (FOLDER / f"{evidence.name}.md").write_text(page_of(evidence, record), "utf-8")


def page_of(evidence: Evidence, record: dict[str, Any]) -> str:
    """Page of a record."""
    return render(record, evidence.write(record["results"]))


def main(evidence: Evidence) -> None:
    """Run one script alone."""
    make(evidence, load(jobs=JOBS))


def _save(figures: "Mapping[str, Figure]") -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        save(figure, PICTURES / f"{name}.png")
