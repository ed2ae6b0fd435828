"""`motionary labels`: tables of labels to other programs and back, compared, summed up."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from motionary.cli import screen
from motionary.cli.options import (
    REQUIRED,
    AsJson,
    Excel,
    Force,
    InFrames,
    argument,
    check_target,
    declare,
    option,
    picture_path,
    wrong,
)
from motionary.cli.recordings import find_files, read_recording
from motionary.errors import InvalidInput, UnreadableFile
from motionary.files import NO_SUCH_FILE, is_stdout
from motionary.io.options import ReadOptions
from motionary.tables import enumerate_names

if TYPE_CHECKING:
    from motionary.io.labels import LabelFormat
    from motionary.labels import Change, Label, LabelTrack
    from motionary.recording import Recording

Tracks = dict[str, "LabelTrack"]

_DIFF = ("recording", "change", "label", ">start_s", ">end_s", "new label", ">new start_s",
         ">new end_s")  # fmt: skip
_STATS = ("label", ">number", ">recordings", ">total_s", ">mean_s", ">shortest_s", ">longest_s")

_CHANGES = ("moved", "renamed", "added", "removed")

LabelFiles = Annotated[list[str], argument("LABELS", "Files of labels, or patterns.")]
Rate = Annotated[
    float | None, declare("--rate HZ", "Frames per second, where the files do not say it.")
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
    only: list[str] | None = option("--only LABEL", "Labels of this name only; may be repeated.")
    track: list[str] | None = option("--track TIER", "Labels of this tier only; may be repeated.")
    excel: Excel = False
    force: Force = False


def convert(
    files: LabelFiles, options: ConvertOptions, rate: Rate = None, frames: InFrames = False
) -> int:
    """Write labels in the format of another program, or of another program as a table.

    A format that holds one recording a file needs a folder where there are several.

    motionary labels convert labels.csv -o take.eaf
    motionary labels convert labels.csv -o elan/ --to eaf --recordings takes/
    motionary labels convert elan/*.eaf -o labels.csv
    """
    from motionary.io import format_suffix, match_recording
    from motionary.io.labels import write_labels

    form = _find_format(options)
    suffix = format_suffix(options.output)
    is_file = options.to is None or (suffix in form.suffixes and bool(suffix))
    if is_file:
        check_target(options.output, replace=options.force)
    sources = find_files(options.recordings or ())
    code = sources.warn()
    known = RecordingsOf(sources.files, ReadOptions(rate_hz=rate))
    tracks = _read_all(files, rate_hz=rate, in_frames=frames, recordings=known)
    tracks = select_labels(tracks, only=options.only, track=options.track)
    tracks = {n: _check(track, known, rate) for n, track in tracks.items()}
    if not tracks:
        raise InvalidInput("no labels to convert; nothing is written", file=enumerate_names(files))
    if form.needs_recording and not sources.files:
        raise wrong("--recordings", f"{form.title} needs the recordings that are labelled")
    targets = {options.output: tracks} if is_file else _targets(tracks, options, form)
    for target in targets:
        check_target(target, replace=options.force)
    for target, content in targets.items():
        name = match_recording(next(iter(content)), sources.files) if form.is_single else None
        recording = None if name is None else sources.files[name]
        write_labels(content, target, to=form.name, excel=options.excel, recording=recording)
    _say_lost(form, tracks)
    if not is_stdout(options.output):
        screen.warn(f"{_count(tracks, 'of')} written to {options.output}")
    return code


def _count(tracks: Tracks, joined: str) -> str:
    n_labels = screen.count(sum(map(len, tracks.values())), "label")
    return f"{n_labels} {joined} {screen.count(len(tracks), 'recording')}"


def _find_format(options: ConvertOptions) -> "LabelFormat":
    from motionary.io.labels import find_label_format

    try:
        return find_label_format(options.output, to=options.to)
    except InvalidInput as error:
        raise wrong("--to" if options.to else "--output", str(error)) from error


def _targets(tracks: Tracks, options: ConvertOptions, form: "LabelFormat") -> dict[str, Tracks]:
    """A file a recording, called as it."""
    from motionary.io import stem_of

    check_target(options.output, is_folder=True)
    suffix = ".TextGrid" if form.name == "praat" else form.suffixes[0]
    targets: dict[str, Tracks] = {}
    for name, track in tracks.items():
        stem = picture_path("", stem_of(name)).stem
        stems = chain((stem,), (f"{stem}-{number}" for number in count(2)))
        possible = (str(Path(options.output, stem + suffix)) for stem in stems)
        targets[next(target for target in possible if target not in targets)] = {name: track}
    return targets


def _read_all(files: Sequence[str], **options: Any) -> Tracks:
    """Tracks of files and patterns; those of one recording become one."""
    from motionary.io import read_labels

    tracks: Tracks = {}
    for path in map(Path, files):
        # Shells of Windows leave patterns to programs.
        found = [path] if path.exists() else sorted(path.parent.glob(path.name))
        if not found:
            raise UnreadableFile(NO_SUCH_FILE, file=path)
        for one in found:
            for name, track in read_labels(one, **options).items():
                tracks[name] = tracks[name].joined(track) if name in tracks else track
    return tracks


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
    labels = [label for one in tracks.values() for label in one]
    for name, asked, there, none, kind in (
        ("--only", only, {x.name for x in labels}, "no label is called", "there are"),
        ("--track", track, set(map(_tier, labels)), "there is no tier", "the tiers are"),
    ):
        unknown = sorted(set(asked or ()) - there)
        if unknown:
            shown = enumerate_names(sorted(there))
            raise wrong(name, f"{none} {', '.join(unknown)}; {kind} {shown}")

    def is_asked(label: "Label") -> bool:
        return (not only or label.name in only) and (not track or _tier(label) in track)

    return {name: replace(one, labels=tuple(filter(is_asked, one))) for name, one in tracks.items()}


def _tier(label: "Label") -> str:
    return label.extra.get("track") or "labels"


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
    before: Annotated[str, argument("BEFORE", "A file of labels.")],
    after: Annotated[str, argument("AFTER", "Another one.")],
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
        screen.print_json(*rows)
        return
    _print(_DIFF, rows)
    counts = {kind: sum(row["change"] == kind for row in rows) for kind in _CHANGES}
    screen.say(", ".join([f"{kept} kept", *(f"{n} {kind}" for kind, n in counts.items() if n)]))


def _describe(change: "Change") -> dict[str, Any]:
    row: dict[str, Any] = {"change": change.kind}
    for prefix, label in (("", change.before), ("new_", change.after)):
        for key, name in (("label", "name"), ("start_s", "start_s"), ("end_s", "end_s")):
            row[prefix + key] = None if label is None else getattr(label, name)
    return row


def _print(columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    if rows:
        cells = [[screen.cell(value, digits=3) for value in row.values()] for row in rows]
        screen.print_table(columns, cells)


# -- stats ------------------------------------------------------------------------------


def stats(
    files: LabelFiles, rate: Rate = None, frames: InFrames = False, as_json: AsJson = False
) -> None:
    """Sum up labels: how many of each name, in how many recordings, how long.

    motionary labels stats labels.csv
    motionary labels stats elan/*.eaf
    """
    tracks = _read_all(files, rate_hz=rate, in_frames=frames)
    rows = _sum_up(tracks)
    if as_json:
        screen.print_json(*rows)
        return
    _print(_STATS, rows)
    unassessed = sum(end - start for x in tracks.values() for start, end in x.unassessed)
    screen.say(f"{_count(tracks, 'in')}; {unassessed:.2f} s were not assessed")


def _sum_up(tracks: Tracks) -> list[dict[str, Any]]:
    durations: dict[str, list[float]] = {}
    places: dict[str, set[str]] = {}
    for recording, track in tracks.items():
        for label in track:
            durations.setdefault(label.name, []).append(label.end_s - label.start_s)
            places.setdefault(label.name, set()).add(recording)
    return [
        {
            "label": name, "number": len(lengths), "recordings": len(places[name]),
            "total_s": float(sum(lengths)), "mean_s": float(sum(lengths)) / len(lengths),
            "shortest_s": min(lengths), "longest_s": max(lengths),
        }
        for name, lengths in sorted(durations.items())
    ]  # fmt: skip


#: Commands of the group, in the sequence of its help.
SUBCOMMANDS = {"labels": {"convert": convert, "diff": diff, "stats": stats}}
