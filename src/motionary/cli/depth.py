"""`motionary depth`: a person's motion from the images of one depth camera."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.options import (
    REQUIRED,
    AsJson,
    Force,
    LibraryDefault,
    check_picture,
    check_target,
    flag,
    option,
    wrong,
)
from motionary.cli.recordings import find_files, read_motions, split_failures, warn_of_all
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from motionary.depth import PoseDatabase, Tracking
    from motionary.depth.clouds import Floats
    from motionary.motion import Motion


def depth() -> None:
    """Find a person's motion in the images of one depth camera.

    motionary depth track images -o take.bvh
    motionary depth database recordings -o poses.npz
    """


@dataclass(frozen=True, kw_only=True)
class TrackOptions:
    """What the camera is, where the person is, and where results go."""

    output: str = option("--output -o FILE", "The motion: .bvh, .npz, .trc ...", REQUIRED)
    intrinsics: str | None = option(
        "--intrinsics JSON", "Focal length and centre, pixels; else camera.json beside images."
    )
    mirrored: bool | None = option(
        "--mirrored/--not-mirrored", "Whether left and right are exchanged."
    )
    stature_m: float | None = option("--stature METRES", "Of the person, as far as known.")
    empty: int = option("--empty N", "The first N images show the scene empty.", 0, min=0)
    background: str | None = option("--background IMAGES", "The scene empty, by the same camera.")
    near_m: float = option(
        "--near METRES",
        "Nothing nearer is the person.",
        LibraryDefault("motionary.depth:PreparationSettings", "near_m"),
    )
    far_m: float = option(
        "--far METRES",
        "Nothing farther is the person.",
        LibraryDefault("motionary.depth:PreparationSettings", "far_m"),
    )
    floor_m: float | None = option(
        "--floor METRES", "Height of the floor; a camera whose place is not told is at 1."
    )
    database: str | None = option("--database NPZ", "Poses, by depth database; else those of CMU.")
    published: bool = flag("--published/--no-published", "Track by Baak's method as it is printed.")
    least_confidence: float = option(
        "--least-confidence C", "Joints that are less sure are unknown.", 0.0, min=0.0, max=1.0
    )
    picture: str | None = option(
        "--picture PNG", "Draw some images with the pose, the least sure first."
    )
    force: Force = False


def track(
    source: Annotated[
        str,
        typer.Argument(metavar="IMAGES", help="A folder of 16-bit PNG, npz, mat, bag, mkv."),
    ],
    options: TrackOptions,
    as_json: AsJson = False,
) -> int:
    """Track a person through depth images, and write the motion.

    Images show one whole person; its shape is found in the first second. What is unsure is told.

    motionary depth track images -o take.bvh --far 4
    """
    from motionary.depth import PreparationSettings, TrackerSettings, track_recording
    from motionary.depth.tracking import MEAN_STATURE_M
    from motionary.io import write
    from motionary.io.depth_images import read_depth, read_intrinsics

    check_picture("--picture", options.picture)
    check_target(options.output, replace=options.force)
    is_rig = options.output.lower().endswith((".bvh", ".bvh.gz"))
    if is_rig and options.least_confidence:
        raise wrong("--least-confidence", "BVH holds no unknown joints; write .npz or .trc")
    if options.background is not None and options.empty:
        raise wrong("--empty", "the empty scene is given by --background already")
    told = None if options.intrinsics is None else read_intrinsics(Path(options.intrinsics))
    recording = read_depth(source, intrinsics=told, mirrored=options.mirrored)
    settings = TrackerSettings(
        published=options.published,
        preparation=PreparationSettings(options.near_m, options.far_m, options.floor_m),
    )
    with screen.progress("tracking", len(recording) - options.empty) as done:
        tracked = track_recording(
            recording,
            _read_database(options.database),
            settings=settings,
            stature_m=MEAN_STATURE_M if options.stature_m is None else options.stature_m,
            background=_read_background(options) if options.background else options.empty or None,
            least_confidence=options.least_confidence,
            progress=lambda images: _count(images, done),
        )
    written, notes = _cut_to_person(tracked, whole=is_rig)
    write(written, options.output)
    if options.picture is not None:
        from motionary.plots import plot_depth, save

        images = list(recording.images())[options.empty :]
        save(plot_depth(images, tracked), options.picture)
    return _say(tracked, (*tracked.motion.notes, *notes), options.output, as_json=as_json)


def _say(tracked: "Tracking", notes: "Sequence[str]", output: str, *, as_json: bool) -> int:
    """Tell what was tracked; 1 if it is of little use."""
    row = _to_row(tracked)
    if as_json:
        screen.print_json(row)
    else:
        screen.say(
            f"{row['images']} images: {row['tracked']} tracked, {row['unsure']} unsure, "
            f"{row['none']} without a person; off from the images by {100 * row['cost_m']:.1f} cm",
            f"motion written to {output}",
        )
    for note in notes:
        screen.warn(note)
    if row["unsure"] + row["none"] < row["images"] / 2:
        return 0
    screen.warn("half of the images or more are unsure or without a person: look at the motion")
    return 1


def _cut_to_person(tracked: "Tracking", *, whole: bool) -> "tuple[Motion, tuple[str, ...]]":
    """The motion from the first to the last image with a person; or where none lacks one."""
    import numpy as np

    from motionary.recording import find_runs

    seen = np.array([pose.status != "none" for pose in tracked.poses])
    first, stop = int(seen.argmax()), len(seen) - int(seen[::-1].argmax())
    if whole and not seen[first:stop].all():
        first, stop = max(find_runs(seen), key=lambda run: run[1] - run[0])
        kept = f"BVH holds no gaps: images {first} to {stop - 1} are written, the longest run"
        return tracked.motion.cut(first, stop), (kept,)
    return tracked.motion.cut(first, stop), ()


def _read_background(options: TrackOptions) -> "Floats":
    """The empty scene, from a recording of its own."""
    import numpy as np

    from motionary.depth import learn_background
    from motionary.io.depth_images import read_depth, read_intrinsics

    told = None if options.intrinsics is None else read_intrinsics(Path(options.intrinsics))
    scene = read_depth(str(options.background), intrinsics=told, mirrored=options.mirrored)
    return learn_background(np.stack(list(scene.images())))


def _count(images: "Iterable[Floats]", done: Any) -> "Iterator[Floats]":
    for image in images:
        yield image
        done()


def _read_database(path: str | None) -> "PoseDatabase | None":
    if path is None:
        return None
    from motionary.depth.poses import database_from_arrays
    from motionary.io.formats.npz import ArchivedArrays

    return database_from_arrays(ArchivedArrays(Path(path)))


def _to_row(tracked: "Tracking") -> dict[str, Any]:
    """What is said of a tracking, for JSON."""
    import numpy as np

    counts = Counter(pose.status for pose in tracked.poses)
    seen = [pose for pose in tracked.poses if pose.status != "none"]
    return {
        "recording": tracked.motion.source,
        "rate_hz": tracked.motion.rate_hz,
        "images": len(tracked.poses),
        "tracked": counts["tracked"],
        "unsure": counts["unsure"],
        "none": counts["none"],
        "lookup": sum(pose.hypothesis == "lookup" for pose in tracked.poses),
        "cost_m": round(float(np.mean([pose.cost for pose in seen])), 4),
        "confidence": round(float(np.mean([pose.confidence for pose in seen])), 3),
        "stature_m": round(float(np.ptp(tracked.body.vertices[:, 1])), 3),
        "notes": list(tracked.motion.notes),
    }


def database(
    recordings: Annotated[
        list[str], typer.Argument(metavar="RECORDINGS...", help="Recordings of people, folders.")
    ],
    output: Annotated[str, typer.Option("--output", "-o", metavar="NPZ", help="The database.")],
    least_m: Annotated[
        float,
        typer.Option(
            "--apart",
            min=0.001,
            metavar="METRES",
            default_factory=LibraryDefault("motionary.depth:build_database", "least_m"),
            help="Poses differ by more, joint by joint (8.1).",
        ),
    ],
    force: Force = False,
    *,
    reading: ReadOptions,
) -> int:
    """Make a database of poses out of recordings and their mirror images.

    motionary depth database recordings -o poses.npz
    """
    import numpy as np

    from motionary.depth import build_database
    from motionary.depth.poses import database_to_arrays
    from motionary.files import write_atomically

    check_target(output, replace=force)
    if Path(output).suffix != ".npz":
        raise InvalidInput(f"a database of poses is written as .npz, got {Path(output).name!r}")
    found = find_files(recordings, reading)
    motions, failures = split_failures(read_motions(found.files, reading))
    failed = warn_of_all(found.missing.values(), failures, given=recordings)
    made = build_database(
        motions, least_m=least_m, provenance={"recordings": sorted(one.source for one in motions)}
    )
    with write_atomically(output) as beside, beside.open("wb") as file:
        np.savez_compressed(file, **database_to_arrays(made))  # type: ignore[arg-type]
    many = "recording" if len(motions) == 1 else "recordings"
    screen.say(f"{len(made)} poses of {len(motions)} {many} written to {output}")
    return 1 if failed else 0


SUBCOMMANDS = {"track": track, "database": database}
