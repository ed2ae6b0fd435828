"""`motionary convert`, `cut` and `features`: recordings as other files.

Convert writes whole recordings in another format, cut writes labels as clips, and features
writes what is measured of a recording.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import chain, count
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated, Any, Literal

from motionary.cli import screen
from motionary.cli.labels import RecordingsOf, select_labels
from motionary.cli.options import (
    REQUIRED,
    AsJson,
    Excel,
    Force,
    InFrames,
    Jobs,
    argument,
    check_picture,
    check_target,
    declare,
    option,
    wrong,
)
from motionary.cli.recordings import (
    describe_failure,
    find_files,
    map_files,
    measure_all,
    read_recording,
)
from motionary.errors import UnwritableFile
from motionary.files import is_stdout
from motionary.io.options import ReadOptions
from motionary.tables import enumerate_names

if TYPE_CHECKING:
    from motionary.features import FeatureBatch, NamedFile
    from motionary.labels import LabelTrack

_COLUMNS = ("recording", "written", ">joints", ">frames", ">rate_hz", "not kept")


# -- convert ----------------------------------------------------------------------------


def convert(
    files: Annotated[list[str], argument("FILE", "Files, folders or patterns to convert.")],
    output: Annotated[
        str, declare("--output -o OUT", "A file with its suffix, or a folder with --to.")
    ],
    to: Annotated[
        str | None,
        declare("--to SUFFIX", ".bvh, .amc, .c3d, .trc or .npz; .gz after it packs texts."),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    *,
    jobs: Jobs,
    reading: ReadOptions,
) -> int:
    """Write recordings in another format.

    In a folder the results have the names of the recordings. What a format cannot hold, such
    as the rig of a BVH in a C3D, is reported. A file that holds several recordings becomes several
    files with --to.

    motionary convert take.c3d -o take.npz
    motionary convert recordings/ -o converted --to .trc
    """
    from motionary.batch import Failure

    found = find_files(files, reading)
    work = partial(
        convert_file, targets=_targets(found.files, output, to, replace=force), reading=reading
    )
    rows: list[dict[str, Any]] = []
    failures = []
    for done in map_files(work, found.files, "converting", jobs=jobs):
        if isinstance(done, Failure):
            failures.append(done)
            row = {"recording": done.item[0], "error": describe_failure(done)}
        else:
            row = done
            rows.append(row)
        if as_json:
            screen.print_json(row)
    if rows and not as_json:
        screen.print_table(_COLUMNS, list(map(_cells, rows)))
    return found.warn(failures)


def convert_file(
    file: "NamedFile", *, targets: dict[str, Path], reading: ReadOptions
) -> dict[str, Any]:
    """Read and write a recording; what was written, for JSON."""
    from motionary.io import what_is_lost, write

    name, path = file
    motion = read_recording(path, reading)
    target = targets[name]
    write(motion, target, asf=reading.asf)
    return {
        "recording": name,
        "written": str(target),
        "joints": len(motion.names),
        "frames": motion.n_frames,
        "rate_hz": motion.rate_hz,
        "not_kept": list(what_is_lost(motion, target)),
    }


def _targets(
    files: Mapping[str, Path], output: str, to: str | None, *, replace: bool
) -> dict[str, Path]:
    """Where each recording goes; no target is a recording, or there and must not be replaced."""
    from motionary.io import file_of

    targets = _name_targets(list(files), output, to)
    sources = {_identity(file_of(path)) for path in files.values()} - {None}
    for target in targets.values():
        if _identity(target) in sources:
            raise UnwritableFile("would replace a recording; write to another folder", file=target)
        check_target(str(target), replace=replace)
    return targets


def _identity(path: Path) -> tuple[int, int] | None:
    """What tells a file from others, whatever it is called; None where there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _name_targets(names: list[str], output: str, to: str | None) -> dict[str, Path]:
    from motionary.io import WRITTEN_SUFFIXES, format_suffix, stem_of

    known = ", ".join(WRITTEN_SUFFIXES)
    if to is None:
        if format_suffix(output) not in WRITTEN_SUFFIXES:
            raise wrong(
                "--output", f"must end in {known}, or be a folder with --to SUFFIX, got {output}"
            )
        if len(names) > 1:
            raise wrong(
                "--output",
                f"{len(names)} recordings need a folder with --to SUFFIX, got the file {output}",
            )
        return {name: Path(output) for name in names}
    suffix = to if to.startswith(".") else f".{to}"
    if suffix not in WRITTEN_SUFFIXES:
        raise wrong("--to", f"must be one of {known}, got {to}")
    check_target(f"{output}/x")
    targets: dict[str, Path] = {}
    for name in names:
        # What lies outside of the folder that was searched stays below the output all the same.
        inside = [part for part in PurePosixPath(name).parts if part not in ("..", "/")]
        place = PurePosixPath(*inside)
        stem = stem_of(place)
        # Of two formats of one take, side by side, the second keeps its name whole.
        stems = chain((stem, place.name), (f"{stem}-{number}" for number in count(2)))
        possible = (Path(output) / place.with_name(stem + suffix) for stem in stems)
        targets[name] = next(target for target in possible if target not in targets.values())
    return targets


def _cells(row: dict[str, Any]) -> list[str]:
    numbers = str(row["joints"]), str(row["frames"]), f"{row['rate_hz']:g}"
    return [row["recording"], row["written"], *numbers, ", ".join(row["not_kept"])]


# -- cut --------------------------------------------------------------------------------


def cut(
    labels: Annotated[str, argument("LABELS", "Hits or labels: a table, ELAN, ...")],
    recordings: Annotated[
        list[str], argument("RECORDINGS", "Folders, files or patterns they belong to.")
    ],
    output: Annotated[str, declare("--output -o FOLDER", "Folder to write clips to.")],
    only: Annotated[
        list[str] | None, declare("--only LABEL", "Cut labels of this name; may be repeated.")
    ] = None,
    frames: InFrames = False,
    force: Force = False,
    *,
    jobs: Jobs,
    reading: ReadOptions,
) -> int:
    """Write each hit or label of a table as a clip, in the rig and rate of its recording.

    What stands in a file stays as it is, so that nothing is computed anew: BVH, AMC and TRC are
    cut line by line, of C3D analog signals stay too. The frames of a clip count from 0 (BVH), 1
    (AMC) or as before; an AMC clip gets its skeleton beside it.

    motionary cut labels.csv recordings/ -o clips
    with labels.csv from `motionary annotate -o` or `motionary search -o`
    """
    from motionary.io import read_labels

    check_target(output, is_folder=True)
    found = find_files(recordings, reading)
    tracks = read_labels(
        labels, rate_hz=reading.rate_hz, in_frames=frames,
        recordings=RecordingsOf(found.files, reading),
    )  # fmt: skip
    tracks = select_labels(tracks, only=only)
    code = found.warn()
    done = cut_labels(
        tracks.values(), found.files, output,
        reading=reading, jobs=jobs, replace=force,
    )  # fmt: skip
    return code if done else 1


def cut_labels(
    tracks: "Iterable[LabelTrack]",
    files: Mapping[str, Path],
    folder: str,
    *,
    reading: ReadOptions,
    jobs: int,
    replace: bool,
) -> bool:
    """Write a clip a label; reports what could not be cut. Whether all could.

    Raises
    ------
    UnwritableFile
        If a clip is there and must not be replaced; none is written then.
    """
    from motionary.batch import Failure
    from motionary.io import cut_clips, plan_clips

    clips = plan_clips(tracks, files, folder)
    for clip in clips:
        check_target(str(clip.target), replace=replace)
    with screen.progress("cutting", len(clips)) as done:
        written = cut_clips(clips, options=reading, replace=replace, jobs=jobs, on_done=done)
        failures = [clip for clip in written if isinstance(clip, Failure)]
    for failure in failures:
        screen.warn(f"{failure.item.target.name}: {failure.error}")
    screen.warn(f"{len(clips) - len(failures)} of {len(clips)} clips written to {folder}")
    return not failures


# -- features ---------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class People:
    """Who moves in which recording, and how that splits them."""

    persons: str | None = option(
        "--persons REGEX",
        "Who moves: what this finds in a recording's name, such as '^(s[0-9]+)_'.",
    )
    split_by: Literal["person"] | None = option(
        "--split-by", "Put each person into train (80 %), validation or test (10 % each)."
    )
    seed: int = option("--seed", "Of who is put where.", 0)

    def find(self, names: Iterable[str]) -> list[str]:
        """Who moves in each recording; nobody where it is not given."""
        from motionary.features import match_names
        from motionary.features.batches import SPLITS

        if not self.persons:
            if self.split_by:
                raise wrong("--split-by", "person needs --persons, which says who moves")
            return []
        found = match_names(names, self.persons, each="recording", has="person")
        people = sorted(set(found))
        if self.split_by and 0 < len(people) < len(SPLITS):
            what = f"person needs {len(SPLITS)} people or more, got {enumerate_names(people)}"
            raise wrong("--split-by", what)
        return found

    def place(self, batch: "FeatureBatch") -> "FeatureBatch":
        """Features with who moves, and in which part they are, as far as it is given."""
        if self.persons:
            batch = batch.with_persons(self.find(batch.names))
        return batch.split_by_person(seed=self.seed) if self.split_by else batch


@dataclass(frozen=True, kw_only=True)
class FeatureOptions:
    """Where features are written and drawn."""

    output: str = option("--output -o OUT", "Where to write; .npz, .parquet or .csv.", REQUIRED)
    plot: str | None = option("--plot PNG", "Draw the features of one recording.")
    excel: Excel = False
    force: Force = False

    def check(self) -> None:
        """Refuse files of other kinds."""
        if Path(self.output).suffix.lower() not in (".npz", ".parquet", ".csv"):
            what = "a file, not stdout, whose name" if is_stdout(self.output) else "a name that"
            problem = f"needs {what} ends in .npz, .parquet or .csv, got {self.output}"
            raise wrong("--output", problem)
        check_target(self.output, replace=self.force)
        check_picture("--plot", self.plot)


def features(
    files: Annotated[list[str], argument("FILE", "Files, folders or patterns to measure.")],
    options: FeatureOptions,
    *,
    jobs: Jobs,
    people: People,
    reading: ReadOptions,
) -> int:
    """Write which of the 40 relational features hold in recordings, and when.

    There are 30 frames a second. A .npz file has `features` and `known`, arrays of 0 and 1
    of shape (frames, 40), `names` and `rate_hz`; of several recordings, one after the other,
    `recordings` and `starts`. In a .csv or .parquet file (extra `parquet`) a frame is a row, and
    unknown features are empty cells.

    motionary features take.bvh -o take.npz
    motionary features clips/ -o clips.parquet --persons '^(s[0-9]+)_' --split-by person --jobs 4
    """
    from motionary.features import FULL_BODY, FeatureBatch, write_features
    from motionary.tables import load_pyarrow

    options.check()
    found = find_files(files, reading)
    if options.plot and len(found.files) > 1:
        raise wrong("--plot", f"draws one recording, got {len(found.files)}")
    # Before hours of measuring.
    people.find(found.files)
    if options.output.lower().endswith(".parquet"):
        load_pyarrow()
    done, failures = measure_all(
        found, "measuring", reading=reading, feature_set=FULL_BODY, jobs=jobs
    )
    code = found.warn(failures)
    if not done:
        return 1
    batch = people.place(FeatureBatch(tuple(done)))
    write_features(batch, options.output, excel=options.excel)
    seconds = sum(one.duration_s for one in done)
    screen.say(
        f"features of {len(done)} recording{'s' * (len(done) != 1)}, {seconds:.1f} s, written to "
        f"{options.output}"
    )
    if options.plot:
        from motionary.plots import plot_features, save

        save(plot_features(done[0]), options.plot)
    return code
