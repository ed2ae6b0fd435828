"""`motionary depth`: a person's motion from the images of one depth camera."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from motionary.cli import screen
from motionary.cli.options import (
    REQUIRED,
    AsJson,
    Force,
    LibraryDefault,
    argument,
    check_picture,
    check_target,
    declare,
    flag,
    option,
    wrong,
)
from motionary.cli.recordings import find_files, read_motions, split_failures
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from motionary.depth import Tracking
    from motionary.depth.clouds import Floats
    from motionary.io.depth_images import DepthRecording


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
    source: Annotated[str, argument("IMAGES", "A folder of 16-bit PNG, npz, mat, bag, mkv.")],
    options: TrackOptions,
    as_json: AsJson = False,
) -> int:
    """Track a person through depth images, and write the motion.

    Images show one whole person; its shape is found in the first second. What is unsure is told.

    motionary depth track images -o take.bvh --far 4
    """
    from motionary.depth import PreparationSettings, TrackerSettings, load_database, track_recording
    from motionary.io import write

    check_picture("--picture", options.picture)
    check_target(options.output, replace=options.force)
    is_rig = options.output.lower().endswith((".bvh", ".bvh.gz"))
    if is_rig and options.least_confidence:
        raise wrong("--least-confidence", "BVH holds no unknown joints; write .npz or .trc")
    if options.background is not None and options.empty:
        raise wrong("--empty", "the empty scene is given by --background already")
    recording = _read_images(source, options)
    settings = TrackerSettings(
        published=options.published,
        preparation=PreparationSettings(options.near_m, options.far_m, options.floor_m),
    )
    background: Any = options.empty or None
    if options.background is not None:
        background = _read_images(options.background, options)
    with screen.progress("tracking", len(recording) - options.empty) as done:
        tracked = track_recording(
            recording, None if options.database is None else load_database(options.database),
            settings=settings, background=background, least_confidence=options.least_confidence,
            stature_m=options.stature_m, progress=lambda images: _count(images, done),
        )  # fmt: skip
    written = tracked.cut_to_person(gapless=is_rig)
    write(written, options.output)
    if options.picture is not None:
        from motionary.plots import plot_depth, save

        images = list(recording.images())[options.empty :]
        save(plot_depth(images, tracked), options.picture)
    return _say(tracked, written.notes, options.output, as_json=as_json)


def _read_images(source: str, options: TrackOptions) -> "DepthRecording":
    from motionary.io.depth_images import read_depth, read_intrinsics

    told = None if options.intrinsics is None else read_intrinsics(Path(options.intrinsics))
    return read_depth(source, intrinsics=told, mirrored=options.mirrored)


def _say(tracked: "Tracking", notes: "Sequence[str]", output: str, *, as_json: bool) -> int:
    """Tell what was tracked; 1 if it is of little use."""
    row = tracked.as_dict()
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


def _count(images: "Iterable[Floats]", done: Any) -> "Iterator[Floats]":
    for image in images:
        yield image
        done()


def database(
    recordings: Annotated[list[str], argument("RECORDINGS...", "Recordings of people, folders.")],
    output: Annotated[str, declare("--output -o NPZ", "The database.")],
    least_m: Annotated[
        float,
        declare(
            "--apart METRES",
            "Poses differ by more, joint by joint (8.1).",
            min=0.001,
            default_factory=LibraryDefault("motionary.depth:build_database", "least_m"),
        ),
    ],
    force: Force = False,
    *,
    reading: ReadOptions,
) -> int:
    """Make a database of poses out of recordings and their mirror images.

    motionary depth database recordings -o poses.npz
    """
    from motionary.depth import build_database

    check_target(output, replace=force)
    if Path(output).suffix != ".npz":
        raise InvalidInput(f"a database of poses is written as .npz, got {Path(output).name!r}")
    found = find_files(recordings, reading)
    motions, failures = split_failures(read_motions(found.files, reading))
    code = found.warn(failures)
    made = build_database(
        motions, least_m=least_m, provenance={"recordings": sorted(one.source for one in motions)}
    )
    made.save(output)
    screen.say(
        f"{len(made)} poses of {screen.count(len(motions), 'recording')} written to {output}"
    )
    return code


SUBCOMMANDS = {"depth": {"track": track, "database": database}}
