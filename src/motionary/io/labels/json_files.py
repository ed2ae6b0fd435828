"""Labels as JSON: lines as `motionary annotate --json` prints, Label Studio, BABEL.

Conventions: JSON lines hold everything that labels say. In Label Studio a recording is a task;
its labels are spans in seconds (time series), or ranges of frames counted from 1, both ends
included (video). Labels with a cost or score are predictions there, others annotations. In
BABEL times are seconds, and a label's name is its processed text and its action category.
"""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any

from motionary.errors import InvalidInput, UnreadableFile, Where, describe_cause
from motionary.io.labels.lanes import (
    TRACK,
    UNASSESSED,
    Found,
    list_unassessed,
    track_of,
    with_track,
)
from motionary.io.labels.lines import is_markers, read_markers
from motionary.io.text import parse_json, read_text, stem_of, write_text
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording, Segment

_SERIES, _VIDEO = "timeserieslabels", "timelinelabels"
_NUMBERS = ("cost", "score", "probability", "false_per_min")
_OWN = (
    "label", "start_s", "end_s", "start_frame", "end_frame", "known", "side", *_NUMBERS,
)  # fmt: skip

Item = Mapping[str, Any]


def read_json(path: Path, *, rate_hz: float | None) -> dict[str, LabelTrack]:
    """Labels of Label Studio, BABEL or Blender, as the file is; see `read_labels`."""
    content = parse_json(read_text(path), file=path.name)
    try:
        if isinstance(content, dict) and any(
            isinstance(x, dict) and "babel_sid" in x for x in content.values()
        ):
            return _read_babel(content)
        if is_markers(content):
            return read_markers(content, path)
        tasks = content if isinstance(content, list) else [content]
        if tasks and all("annotations" in task or "predictions" in task for task in tasks):
            return _read_tasks(tasks, path, rate_hz)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise UnreadableFile(
            f"not as Label Studio or BABEL write it: {describe_cause(error)}", file=path.name
        ) from error
    raise UnreadableFile(
        "expected tasks of Label Studio (annotations, predictions), sequences of "
        "BABEL (babel_sid) or markers of Blender, got other JSON",
        file=path.name,
    )


# -- lines --------------------------------------------------------------------------------


def read_lines(path: Path) -> dict[str, LabelTrack]:
    """Labels of JSON lines, an object a recording; see `read_labels`."""
    found = Found()
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        if not line.strip():
            continue
        where = Where(file=path.name, place=f"line {number}")
        row = parse_json(line, **where)
        try:
            name = str(row["recording"])
            found.recordings[name] = _recording(name, row)
            for item in row["labels"]:
                found.add_label(name, _to_label(item))
            for x in row.get(UNASSESSED, ()):
                found.add_unassessed(name, Segment(float(x["start_s"]), float(x["end_s"])))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise UnreadableFile(
                'expected {"recording": ..., "rate_hz": ..., "labels": [{"label", '
                f'"start_s", "end_s"}}]}}: {describe_cause(error)}',
                **where,
            ) from error
    return found.tracks()


def _recording(name: str, row: Item) -> Recording:
    rate, n_frames = row.get("rate_hz"), row.get("frames")
    return Recording(
        name,
        rate_hz=float(rate) if rate else 0.0,
        n_frames=int(n_frames) if n_frames else 0,
        first_frame=int(row.get("first_frame") or 0),
    )


def _to_label(item: Item) -> Label:
    known: dict[str, Any] = {
        key: None if item.get(key) is None else int(item[key])
        for key in ("start_frame", "end_frame")
    }
    known |= {key: None if item.get(key) is None else _number(item[key]) for key in _NUMBERS}
    return Label(
        str(item["label"]),
        _number(item["start_s"]),
        _number(item["end_s"]),
        known=1.0 if item.get("known") is None else _number(item["known"]),
        side=str(item.get("side") or ""),
        extra={key: str(value) for key, value in item.items() if key not in _OWN},
        **known,
    )


def _number(value: Any) -> float:
    if isinstance(value, bool) or not math.isfinite(number := float(value)):
        raise InvalidInput(f"expected a number, got {str(value)[:40]!r}")
    return number


def write_lines(tracks: Iterable[LabelTrack], path: Path) -> None:
    """Write tracks as JSON lines; see `write_labels`."""
    write_text(path, (_dump(_to_row(track)) + "\n" for track in tracks))


def _to_row(track: LabelTrack) -> dict[str, Any]:
    recording = track.recording
    known = {"frames": recording.n_frames, "first_frame": recording.first_frame}
    labels = []
    for label in track.labels:
        item: dict[str, Any] = {"label": label.name}
        item |= {key: getattr(label, key) for key in _OWN[1:]}
        clash = set(label.extra) & set(item)
        if clash:
            raise InvalidInput(f"a further column cannot be called {', '.join(sorted(clash))}")
        labels.append(item | dict(label.extra))
    return {
        "recording": recording.name,
        "rate_hz": track.rate_hz,
        **{key: value for key, value in known.items() if value},
        "labels": labels,
        UNASSESSED: [{"start_s": start, "end_s": end} for start, end in track.unassessed],
    }


def _dump(value: Any, *, indent: int | None = None) -> str:
    # What is no text, such as half a letter of a file's name, becomes an escape.
    return json.dumps(value, ensure_ascii=False, indent=indent).encode(
        "utf-8", "backslashreplace"
    ).decode()  # fmt: skip


# -- Label Studio -------------------------------------------------------------------------


def _read_tasks(tasks: Sequence[Item], path: Path, rate_hz: float | None) -> dict[str, LabelTrack]:
    found = Found()
    for number, task in enumerate(tasks, start=1):
        data = task.get("data") or {}
        name = _task_name(task, path)
        where = Where(file=path.name, place=f"task {task.get('id', number)}")
        found.recordings[name] = recording = _recording(name, data)
        rate = recording.rate_hz or rate_hz
        made = [x for x in task.get("annotations") or () if not x.get("was_cancelled")]
        for result in made or task.get("predictions") or ():
            for track, label, segment in _read_results(result.get("result", ()), rate, where):
                if track == UNASSESSED:
                    found.add_unassessed(name, segment)
                else:
                    found.add_label(name, Label(label, *segment, extra=with_track(track)))
    return found.tracks()


def _task_name(task: Item, path: Path) -> str:
    """What a task is of: as written here, else the first file that its data names."""
    data = task.get("data") or {}
    if data.get("recording"):
        return str(data["recording"])
    texts = [str(task.get("file_upload") or ""), *(x for x in data.values() if isinstance(x, str))]
    named = next((text for text in texts if text), stem_of(path))
    return PurePath(named.replace("\\", "/").rpartition("=")[2]).name or stem_of(path)


def _read_results(
    results: Sequence[Item], rate_hz: float | None, where: Where
) -> Iterator[tuple[str, str, Segment]]:
    for result in results:
        kind, value = result.get("type"), result.get("value", {})
        if kind not in (_SERIES, _VIDEO):
            continue
        notes = (result.get("meta") or {}).get("text") or [""]
        track = notes if isinstance(notes, str) else str(notes[0])
        track = UNASSESSED if result.get("from_name") == UNASSESSED else track
        if kind == _SERIES:
            spans = [Segment(_number(value["start"]), _number(value["end"]))]
        elif rate_hz is None:
            raise UnreadableFile(
                "labels of videos are in frames; say the rate (rate_hz=..., --rate HZ)", **where
            )
        else:
            spans = [
                Segment((int(x["start"]) - 1) / rate_hz, int(x["end"]) / rate_hz)
                for x in value["ranges"]
            ]
        for name in value[kind]:
            for span in spans:
                yield track, str(name), span


def write_series(tracks: Iterable[LabelTrack], path: Path) -> None:
    """Write tracks as time series of Label Studio; see `write_labels`."""

    def span(track: LabelTrack, label: Label) -> dict[str, Any]:
        return {
            "start": label.start_s, "end": label.end_s, "instant": label.start_s == label.end_s,
        }  # fmt: skip

    _write_tasks(tracks, path, kind=_SERIES, of="ts", span=span)


def write_video(tracks: Iterable[LabelTrack], path: Path) -> None:
    """Write tracks as timelines of videos of Label Studio; see `write_labels`."""

    def span(track: LabelTrack, label: Label) -> dict[str, Any]:
        rate = track.rate_hz
        if rate is None:
            raise InvalidInput(
                "labels of videos are in frames, and the rate of "
                f"{track.recording.name} is unknown; give the recordings, or the rate (--rate HZ)",
                file=path.name,
            )
        start = round(label.start_s * rate) + 1
        return {"ranges": [{"start": start, "end": max(round(label.end_s * rate), start)}]}

    _write_tasks(tracks, path, kind=_VIDEO, of="video", span=span)


def _write_tasks(
    tracks: Iterable[LabelTrack],
    path: Path,
    *,
    kind: str,
    of: str,
    span: Callable[[LabelTrack, Label], dict[str, Any]],
) -> None:
    tasks = []
    for number, track in enumerate(tracks, start=1):
        unseen = list_unassessed(track)
        results: list[dict[str, Any]] = []
        for label in (*track.labels, *unseen):
            is_unseen = any(label is x for x in unseen)
            result = {
                "id": f"r{len(results) + 1}", "type": kind, "to_name": of,
                "from_name": UNASSESSED if is_unseen else "label",
                "value": span(track, label) | {kind: [label.name]},
            }  # fmt: skip
            if not is_unseen and with_track(track_of(label)):
                result["meta"] = {"text": [track_of(label)]}
            results.append(result)
        measured = any(x.cost is not None or x.score is not None for x in track.labels)
        data = {of: track.recording.name, "recording": track.recording.name}
        rate = {"rate_hz": track.rate_hz} if track.rate_hz else {}
        task = {"id": number, "data": data | rate, "annotations": [], "predictions": []}
        task["predictions" if measured else "annotations"] = [{"result": results}]
        tasks.append(task)
    write_text(path, [_dump(tasks, indent=1) + "\n"])


# -- BABEL --------------------------------------------------------------------------------


def _read_babel(content: Item) -> dict[str, LabelTrack]:
    found = Found()
    for key, sequence in content.items():
        name = str(sequence.get("feat_p") or key)
        duration = _number(sequence.get("dur") or 0)
        found.recordings[name] = _recording(name, sequence)
        for track, annotation in _annotations(sequence):
            for item in annotation.get("labels") or ():
                start, end = _number(item.get("start_t", 0)), _number(item.get("end_t", duration))
                extra = _babel_extra(item, track)
                found.add_label(name, Label(_babel_name(item), start, end, extra=extra))
        for start, end in sequence.get(UNASSESSED, ()):
            found.add_unassessed(name, Segment(_number(start), _number(end)))
    return found.tracks()


def _annotations(sequence: Item) -> Iterator[tuple[str, Item]]:
    """Annotations of a sequence with the track each is, frames before the whole."""
    for kind in ("frame_ann", "seq_ann"):
        several = sequence.get(f"{kind}s")
        found = several if several is not None else [sequence.get(kind)]
        there = [annotation for annotation in found if annotation and annotation.get("labels")]
        for i, annotation in enumerate(there):
            yield f"annotator {i + 1}" if len(there) > 1 else "", annotation
        if there:
            return


def _babel_name(item: Item) -> str:
    return str(item.get("proc_label") or item.get("raw_label") or "?")


def _babel_extra(item: Item, track: str) -> dict[str, str]:
    extra = with_track(str(item.get(TRACK) or track))
    name, categories = _babel_name(item), item.get("act_cat") or []
    if item.get("raw_label") not in (None, name):
        extra["raw_label"] = str(item["raw_label"])
    if categories and list(categories) != [name]:
        extra["act_cat"] = "|".join(map(str, categories))
    return extra


def write_babel(tracks: Iterable[LabelTrack], path: Path) -> None:
    """Write tracks as sequences of BABEL; see `write_labels`."""
    content = {}
    for number, track in enumerate(tracks, start=1):
        ends = [x.end_s for x in track.labels] + [x.end_s for x in track.unassessed]
        sequence: dict[str, Any] = {
            "babel_sid": number, "url": "", "feat_p": track.recording.name,
            "dur": track.duration_s or max(ends, default=0.0), "seq_ann": None,
            "frame_ann": {
                "babel_lid": str(number), "mul_act": len(track) > 1,
                "labels": [_babel_item(label, i) for i, label in enumerate(track.labels, start=1)],
            },
        }  # fmt: skip
        if track.rate_hz:
            sequence["rate_hz"] = track.rate_hz
        if track.unassessed:
            sequence[UNASSESSED] = [list(segment) for segment in track.unassessed]
        content[str(number)] = sequence
    write_text(path, [_dump(content, indent=1) + "\n"])


def _babel_item(label: Label, number: int) -> dict[str, Any]:
    categories = label.extra.get("act_cat", "")
    item: dict[str, Any] = {
        "raw_label": label.extra.get("raw_label", label.name), "proc_label": label.name,
        "seg_id": str(number), "act_cat": categories.split("|") if categories else [label.name],
        "start_t": label.start_s, "end_t": label.end_s,
    }  # fmt: skip
    track = with_track(track_of(label))
    return item | track
