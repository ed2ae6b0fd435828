"""`motionary evaluate`: scores of labels against the truth."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from motionary.cli import screen
from motionary.cli.options import REQUIRED, AsJson, InFrames, argument, flag, option, wrong
from motionary.errors import InvalidInput, UnreadableFile
from motionary.labels import LabelTrack
from motionary.recording import Recording
from motionary.tables import enumerate_names

if TYPE_CHECKING:
    from motionary.evaluation import Measures, Scores

Tracks = Mapping[str, LabelTrack]

_COLUMNS = ("", ">P1", ">R1", ">F1", ">P2", ">R2", ">F2", ">mAP")
_RENAME_COLUMNS = ["label", "new"]
_MIDDLE_IOU = 0.5


@dataclass(frozen=True, kw_only=True)
class EvaluateOptions:
    """What labels are scored against, and which of them."""

    truth: str = option("--truth TRUTH", "The true labels, in any format of labels.", REQUIRED)
    rename: list[str] | None = option(
        "--rename NAME=NEW",
        "Call a class otherwise, in both tables; or a CSV table with the columns label,new. "
        "Repeatable.",
    )
    only: list[str] | None = option("--only CLASS", "Count labels of this class only. Repeatable.")
    count_missing: bool = flag(
        "--count-missing",
        "Take recordings that only TRUTH has as if nothing was found in them; a recording without "
        "labels has no row in LABELS.",
    )
    rate: float | None = option("--rate HZ", "Frames per second, where times are frames.")
    frames: InFrames = False


def evaluate(
    labels: Annotated[str, argument("LABELS", "Labels, as `annotate -o` writes.")],
    options: EvaluateOptions,
    as_json: AsJson = False,
) -> int:
    """Score labels against the truth.

    P1, R1, F1: precision, recall and F of frames. P2, R2, F2: of segments, which count as
    found if they overlap at all. mAP: mean average precision of segments that overlap by
    half. Recordings are matched by name, with or without folder and suffix.

    motionary evaluate labels.csv --truth truth.csv --rename squat=exercise
    """
    from motionary.evaluation import evaluate as score
    from motionary.io import read_labels

    names, only = _read_renames(options.rename or []), options.only
    tables = (
        read_labels(path, rate_hz=options.rate, in_frames=options.frames)
        for path in (labels, options.truth)
    )
    predicted, true = _match(*tables, count_missing=options.count_missing)
    predicted, true = _rename(predicted, names), _rename(true, names)
    if only:
        _check_only(only, predicted, true)
    scores = score(predicted, true, classes=only or None)
    if as_json:
        screen.print_json(scores.as_dict())
    else:
        _say(scores)
    return 0


def _read_renames(given: Sequence[str]) -> dict[str, str]:
    names: dict[str, str] = {}
    for text in given:
        name, separator, new = text.partition("=")
        if separator and not Path(text).exists():
            if not name or not new:
                raise wrong("--rename", f"expected NAME=NEW, got {text!r}")
            names[name] = new
        else:
            names |= _read_table(Path(text))
    return names


def _read_table(path: Path) -> dict[str, str]:
    from motionary.io import read_text

    rows = [row for row in csv.reader(read_text(path).splitlines()) if row]
    if not rows or rows[0] != _RENAME_COLUMNS or any(len(row) != 2 for row in rows):
        raise UnreadableFile(
            f"expected a table with the columns {','.join(_RENAME_COLUMNS)} and two cells a row",
            file=path,
        )
    return dict((row[0], row[1]) for row in rows[1:])


def _match(predicted: Tracks, truth: Tracks, *, count_missing: bool) -> tuple[Tracks, Tracks]:
    """Both tables for the recordings that both know, under the names of the predicted one."""
    from motionary.io import match_recording

    found = {name: match_recording(name, truth) for name in predicted}
    matched = {name: truth[row] for name, row in found.items() if row is not None}
    kept = {name: predicted[name] for name in matched}
    unlabelled = sorted(set(truth) - set(found.values()))
    if count_missing:
        kept |= {name: LabelTrack(Recording(name)) for name in unlabelled}
        matched |= {name: truth[name] for name in unlabelled}
    if not kept:
        raise InvalidInput(
            "the labels and the truth have no recording in common; labels: "
            f"{enumerate_names(sorted(predicted))}; truth: {enumerate_names(sorted(truth))}"
        )
    strangers = sorted(set(predicted) - set(kept))
    if strangers:
        screen.warn(f"not in the truth, left out: {enumerate_names(strangers)}")
    if unlabelled and not count_missing:
        screen.warn(
            f"without a row in the labels, left out: {enumerate_names(unlabelled)}; if nothing was "
            "found in them, --count-missing counts what was missed"
        )
    return kept, matched


def _rename(tracks: Tracks, names: Mapping[str, str]) -> Tracks:
    return {
        recording: replace(
            track, labels=tuple(replace(x, name=names.get(x.name, x.name)) for x in track)
        )
        for recording, track in tracks.items()
    }


def _check_only(only: Sequence[str], *tables: Tracks) -> None:
    there = sorted({name for table in tables for track in table.values() for name in track.names})
    unknown = [name for name in only if name not in there]
    if unknown:
        raise wrong(
            "--only", f"no label is called {', '.join(unknown)}; there are: {', '.join(there)}"
        )


def _say(scores: "Scores") -> None:
    rows = [["all as one", *_cells(scores.concatenated)], ["mean", *_cells(scores.mean)]]
    for title, parts in (("recording", scores.recordings), ("class", scores.classes)):
        rows.append([""] * len(_COLUMNS))
        rows += [[f"{title} {name}", *_cells(one)] for name, one in parts.items()]
    screen.print_table(_COLUMNS, rows)
    ious = scores.concatenated.mean_average_precision
    shown = ", ".join(f"{iou:g}: {_number(value)}" for iou, value in ious.items())
    screen.say("", f"mAP by least overlap, all as one: {shown}")


def _cells(measures: "Measures") -> list[str]:
    values = (*measures.frames, *measures.segments)
    return [_number(v) for v in (*values, measures.mean_average_precision[_MIDDLE_IOU])]


def _number(value: float) -> str:
    return screen.cell(value, digits=3, unknown="–")
