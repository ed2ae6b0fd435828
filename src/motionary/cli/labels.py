"""`motionary labels`: tables of labels to other programs and back, compared, summed up."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.options import (
    REQUIRED,
    AsJson,
    Excel,
    Force,
    InFrames,
    check_target,
    option,
    wrong,
)
from motionary.cli.recordings import find_files, read_recording
from motionary.errors import InvalidInput, UnreadableFile
from motionary.files import NO_SUCH_FILE, is_stdout
from motionary.io.options import ReadOptions
from motionary.tables import enumerate_names

if TYPE_CHECKING:
    from motionary.io.labels import LabelFormat
    from motionary.labels import LabelTrack
    from motionary.recording import Recording

Tracks = dict[str, "LabelTrack"]

_DIFF = ("recording", "change", "label", ">start_s", ">end_s", "new label", ">new start_s",
         ">new end_s")  # fmt: skip
_STATS = ("label", ">number", ">recordings", ">total_s", ">mean_s", ">shortest_s", ">longest_s")

LabelFiles = Annotated[
    list[str], typer.Argument(metavar="LABELS", help="Files of labels, or patterns.")
]
Rate = Annotated[
    float | None,
    typer.Option("--rate", metavar="HZ", help="Frames per second, where the files do not say it."),
]
Names = Annotated[
    list[str] | None,
    typer.Option("--only", metavar="LABEL", help="Labels of this name only; may be repeated."),
]
TrackNames = Annotated[
    list[str] | None,
    typer.Option("--track", metavar="TIER", help="Labels of this tier only; may be repeated."),
]


def labels() -> None:
    """Take labels to other programs and back, compare and sum them up.

    Formats: .csv, .tsv, .xlsx, .jsonl, .eaf (ELAN), .TextGrid (Praat), .srt, .vtt, and with --to:
    boris, boris-tabular, label-studio, label-studio-video, babel, audacity, blender (markers, BVH
    and an add-on), c3d (events in a copy of the recording).

    motionary labels convert labels.csv -o take.eaf
    motionary labels diff labels.csv take.eaf
    """


@dataclass(frozen=True, kw_only=True)
class ConvertOptions:
    """Which labels are written, and how."""

    output: str = option(
        "--output -o OUT", "A file; or a folder, for a file a recording.", REQUIRED
    )
    to: str | None = option("--to FORMAT", "The format, where no suffix says it.")
    recordings: list[str] | None = option(
        "--recordings PATH", "The recordings: labels are checked against them, and get their rates."
    )
    only: Names = None
    track: TrackNames = None
    excel: Excel = False
    force: Force = False


def convert(
    files: LabelFiles,
    options: ConvertOptions,
    rate: Rate = None,
    frames: InFrames = False,
) -> int:
    """Write labels in the format of another program, or of another program as a table.

    A format that holds one recording a file needs a folder where there are several.

    motionary labels convert labels.csv -o take.eaf
    motionary labels convert labels.csv -o elan/ --to eaf --recordings takes/
    motionary labels convert elan/*.eaf -o labels.csv
    """
    from motionary.io import match_recording
    from motionary.io.labels import write_labels

    form = _find_format(options)
    is_file = _is_file(options, form)
    if is_file:
        check_target(options.output, replace=options.force)
    sources = find_files(options.recordings or ())
    for error in sources.missing.values():
        screen.warn(str(error))
    known = RecordingsOf(sources.files, ReadOptions(rate_hz=rate))
    tracks = _read_all(files, rate_hz=rate, in_frames=frames, recordings=known)
    tracks = select_labels(tracks, only=options.only, track=options.track)
    tracks = {n: _check(track, known, rate) for n, track in tracks.items()}
    if not tracks:
        raise InvalidInput("no labels to convert; nothing is written", file=enumerate_names(files))
    if form.needs_recording and not sources.files:
        raise wrong("--recordings", f"{form.title} needs the recordings that are labelled")
    targets = _targets(tracks, options, form) if not is_file else {options.output: tracks}
    for target in targets:
        check_target(target, replace=options.force)
    for target, content in targets.items():
        name = match_recording(next(iter(content)), sources.files) if form.is_single else None
        recording = None if name is None else sources.files[name]
        write_labels(content, target, to=form.name, excel=options.excel, recording=recording)
    _say_lost(form, tracks)
    if is_stdout(options.output):
        return 1 if sources.missing else 0
    n_labels = _n(sum(map(len, tracks.values())), "label")
    screen.warn(f"{n_labels} of {_n(len(tracks), 'recording')} written to {options.output}")
    return 1 if sources.missing else 0


def _find_format(options: ConvertOptions) -> "LabelFormat":
    from motionary.io.labels import find_label_format

    try:
        return find_label_format(options.output, to=options.to)
    except InvalidInput as error:
        raise wrong("--to" if options.to else "--output", str(error)) from error


def _is_file(options: ConvertOptions, form: "LabelFormat") -> bool:
    from motionary.io import format_suffix

    suffix = format_suffix(options.output)
    return options.to is None or (suffix in form.suffixes and bool(suffix))


def _targets(tracks: Tracks, options: ConvertOptions, form: "LabelFormat") -> dict[str, Tracks]:
    """A file a recording, called as it."""
    from motionary.cli.options import picture_path
    from motionary.io import stem_of

    check_target(options.output, is_folder=True)
    suffix = ".TextGrid" if form.name == "praat" else form.suffixes[0]
    targets: dict[str, Tracks] = {}
    for name, track in tracks.items():
        stem, number = picture_path("", stem_of(name)).stem, 1
        target = Path(options.output, stem + suffix)
        while str(target) in targets:
            number += 1
            target = Path(options.output, f"{stem}-{number}{suffix}")
        targets[str(target)] = {name: track}
    return targets


def _read_all(files: Sequence[str], **options: Any) -> Tracks:
    """Tracks of files and patterns; those of one recording become one."""
    from motionary.io import read_labels

    tracks: Tracks = {}
    for path in _expand(files):
        for name, track in read_labels(path, **options).items():
            before = tracks.get(name)
            if before is None:
                tracks[name] = track
                continue
            tracks[name] = replace(
                before,
                recording=before.recording if before.rate_hz else track.recording,
                labels=(*before.labels, *track.labels),
                unassessed=tuple(sorted({*before.unassessed, *track.unassessed})),
            )
    return tracks


def _expand(files: Sequence[str]) -> Iterator[Path]:
    for path in map(Path, files):
        # Shells of Windows leave patterns to programs.
        found = [path] if path.exists() else sorted(path.parent.glob(path.name))
        if not found:
            raise UnreadableFile(NO_SUCH_FILE, file=path)
        yield from found


class RecordingsOf(Mapping[str, "Recording"]):
    """What files are, by name; each is read when it is asked for."""

    def __init__(self, files: Mapping[str, Path], reading: ReadOptions) -> None:
        self._files = files
        self._reading = reading
        self._known: dict[str, Recording] = {}

    def __getitem__(self, name: str) -> "Recording":
        if name not in self._known:
            self._known[name] = read_recording(self._files[name], self._reading).recording
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __len__(self) -> int:
        return len(self._files)


def select_labels(
    tracks: Tracks, *, only: Sequence[str] | None, track: Sequence[str] | None = None
) -> Tracks:
    """Labels of some names and tiers.

    Raises
    ------
    BadParameter
        If there is none of such a name.
    """
    everything = [label for one in tracks.values() for label in one]
    tiers = {label.extra.get("track") or "labels" for label in everything}
    for name, asked, there, none, kind in (
        ("--only", only, {label.name for label in everything}, "no label is called", "there are"),
        ("--track", track, tiers, "there is no tier", "the tiers are"),
    ):
        unknown = sorted(set(asked or ()) - there)
        if unknown:
            shown = enumerate_names(sorted(there))
            raise wrong(name, f"{none} {', '.join(unknown)}; {kind} {shown}")
    return {
        name: replace(
            one,
            labels=tuple(
                label
                for label in one
                if (not only or label.name in only)
                and (not track or (label.extra.get("track") or "labels") in track)
            ),
        )
        for name, one in tracks.items()
    }


def _check(
    track: "LabelTrack", sources: Mapping[str, "Recording"], rate_hz: float | None
) -> "LabelTrack":
    """The track with what its recording says; without recordings, with the given rate."""
    from motionary.io import explain_unmatched, match_recording
    from motionary.labels import of_recording

    name = track.recording.name
    if not sources:
        if track.rate_hz or not rate_hz:
            return track
        return replace(track, recording=replace(track.recording, rate_hz=rate_hz))
    source = match_recording(name, sources)
    if source is None:
        raise InvalidInput(explain_unmatched([name], sources)[0])
    return of_recording(track, sources[source].renamed(name))


def _say_lost(form: "LabelFormat", tracks: Tracks) -> None:
    """Say what labels said and the format does not hold."""
    if form.keeps_all:
        return
    everything = [label for track in tracks.values() for label in track]
    columns = ("cost", "score", "probability", "false_per_min", "side")
    lost = [name for name in columns if any(getattr(x, name) for x in everything)]
    lost += ["known"] if any(label.known < 1 for label in everything) else []
    lost += sorted({name for label in everything for name in label.extra} - {"track"})
    if lost:
        screen.warn(f"{form.title} does not keep {', '.join(lost)}")


# -- diff -------------------------------------------------------------------------------


def diff(
    before: Annotated[str, typer.Argument(metavar="BEFORE", help="A file of labels.")],
    after: Annotated[str, typer.Argument(metavar="AFTER", help="Another one.")],
    rate: Rate = None,
    frames: InFrames = False,
    as_json: AsJson = False,
) -> None:
    """Say which labels were added, removed, renamed or moved.

    motionary labels diff labels.csv corrected.eaf
    """
    from motionary.io import match_recording, read_labels
    from motionary.labels import compare_labels

    old, new = (read_labels(x, rate_hz=rate, in_frames=frames) for x in (before, after))
    partners = {name: match_recording(name, new) for name in old}
    if old and new and not any(partners.values()):
        raise InvalidInput(
            f"no recording is in both; {before} has {enumerate_names(sorted(old))}, {after} has "
            f"{enumerate_names(sorted(new))}"
        )
    rows, kept = [], 0
    alone = [name for name in new if name not in partners.values()]
    for name, partner in [*partners.items(), *((None, name) for name in alone)]:
        changes = compare_labels(old[name] if name else (), new[partner] if partner else ())
        kept += sum(change.kind == "kept" for change in changes)
        for change in changes:
            if change.kind != "kept":
                rows.append({"recording": name or partner, **_describe(change)})
    if as_json:
        for row in rows:
            screen.print_json(row)
        return
    if rows:
        screen.print_table(_DIFF, [[_cell(value) for value in row.values()] for row in rows])
    counts = {kind: sum(row["change"] == kind for row in rows) for kind in _KINDS}
    screen.say(", ".join([f"{kept} kept", *(f"{n} {kind}" for kind, n in counts.items() if n)]))


_KINDS = ("moved", "renamed", "added", "removed")


def _describe(change: Any) -> dict[str, Any]:
    row: dict[str, Any] = {"change": change.kind}
    for prefix, label in (("", change.before), ("new_", change.after)):
        values = (None,) * 3 if label is None else (label.name, label.start_s, label.end_s)
        row |= dict(
            zip((f"{prefix}label", f"{prefix}start_s", f"{prefix}end_s"), values, strict=True)
        )
    return row


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.3f}" if isinstance(value, float) else str(value)


# -- stats ------------------------------------------------------------------------------


def stats(
    files: LabelFiles, rate: Rate = None, frames: InFrames = False, as_json: AsJson = False
) -> None:
    """Sum up labels: how many of each name, in how many recordings, how long.

    motionary labels stats labels.csv
    motionary labels stats elan/*.eaf
    """
    tracks = _read_all(files, rate_hz=rate, in_frames=frames)
    rows = list(_sum_up(tracks))
    if as_json:
        for row in rows:
            screen.print_json(row)
        return
    if rows:
        screen.print_table(_STATS, [[_cell(value) for value in row.values()] for row in rows])
    unassessed = sum(end - start for x in tracks.values() for start, end in x.unassessed)
    n_labels = sum(map(len, tracks.values()))
    screen.say(
        f"{_n(n_labels, 'label')} in {_n(len(tracks), 'recording')}; "
        f"{unassessed:.2f} s were not assessed"
    )


def _n(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _sum_up(tracks: Tracks) -> Iterator[dict[str, Any]]:
    durations: dict[str, list[float]] = {}
    places: dict[str, set[str]] = {}
    for name, track in tracks.items():
        for label in track:
            durations.setdefault(label.name, []).append(label.end_s - label.start_s)
            places.setdefault(label.name, set()).add(name)
    for name in sorted(durations):
        lengths = durations[name]
        total = float(sum(lengths))
        yield {
            "label": name, "number": len(lengths), "recordings": len(places[name]),
            "total_s": total, "mean_s": total / len(lengths), "shortest_s": min(lengths),
            "longest_s": max(lengths),
        }  # fmt: skip


#: Commands of the group, in the sequence of its help.
SUBCOMMANDS = {"labels": {"convert": convert, "diff": diff, "stats": stats}}
