"""`motionary track` and `untangle`: a person in keypoints of several calibrated cameras."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from motionary.cli import screen
from motionary.cli.options import (
    REQUIRED,
    AsJson,
    Excel,
    Force,
    argument,
    check_page,
    check_target,
    declare,
    flag,
    option,
)
from motionary.cli.recordings import open_library
from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile

if TYPE_CHECKING:
    from motionary.models.library import ClassLibrary
    from motionary.multiview import PoseMemory, Tracking
    from motionary.multiview.priors import AllocatedPrior, PriorTable

Keypoints = Annotated[
    str, argument("POSE_FOLDER", "A folder for each camera, a JSON for each image.")
]


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """The calibration, and what keypoints and calibration do not say."""

    cameras: str = option(
        "--cameras CALIBRATION",
        ".toml of Pose2Sim, anipose, freemocap; .qca.txt; .yml or .xml of OpenCV.",
        REQUIRED,
    )
    rate: float = option("--rate HZ", "Images a second.", REQUIRED)
    person: int | None = option(
        "--person N", "Number of the person in each list; else the best.", min=0
    )
    layout: str | None = option(
        "--layout NAME", "BODY_25, BODY_25B, HALPE_26, COCO, ...; else found."
    )
    unit: str | None = option("--unit m|cm|mm", "Of the calibration; else found by the legs.")
    synchronise: bool = flag(
        "--synchronise/--no-synchronise", "Move images of cameras that are late or early."
    )

    def calibration(self) -> dict[str, Any]:
        """What views are put together by, as the library takes it."""
        return {"rate_hz": self.rate, "unit": self.unit, "synchronise": self.synchronise}


@dataclass(frozen=True, kw_only=True)
class TrackOptions(ViewOptions):
    """What is recognised, and what is written beside the motion."""

    library: str | None = option(
        "--library FOLDER",
        "Classes of motion: recognised, they hold feet and lend poses; 'everyday' ships.",
    )
    labels: str | None = option("--labels FILE", "Write what was recognised, with --library.")
    confidence: str | None = option(
        "--confidence CSV", "Write how well views tell each point, 0 to 1, by frame."
    )
    report: str | None = option(
        "--report HTML", "Write a page that plays it, also as cameras see it."
    )
    images: str | None = option(
        "--images FOLDER", "With --report: images behind the body, a folder for each camera."
    )

    def check(self, *, replace: bool) -> None:
        """Refuse what cannot be written or read, and options that do not go together."""
        for target in (self.labels, self.confidence):
            check_target(target, replace=replace)
        check_page("--report", self.report, replace=replace)
        if self.labels is not None and self.library is None:
            raise InvalidInput("--labels needs --library: the classes to be recognised")
        if self.images is not None and self.report is None:
            raise InvalidInput("--images goes with --report HTML")
        if self.images is not None and not Path(self.images).is_dir():
            what = "no folder there; give the one with a folder of images of each camera"
            raise UnreadableFile(what, file=self.images)


def untangle(
    keypoints: Keypoints,
    output: Annotated[str, declare("--output -o FOLDER", "For the same files, put right.")],
    options: ViewOptions,
    excel: Excel = False,
    force: Force = False,
) -> int:
    """Put left and right legs and arms right in keypoints of several cameras.

    Writes the same files, with exchanged points changed and nothing else, for any program that
    triangulates them; beside the folder a table FOLDER.exchanges.csv: what was exchanged, where,
    and where it is unsure. People are told apart before: Pose2Sim's pose-associated.

    motionary untangle pose --cameras Calib.toml --rate 60 -o pose-untangled
    """
    from motionary.io.keypoints import read_keypoints, write_exchanged
    from motionary.io.labels import write_labels
    from motionary.multiview import untangle as find

    target = Path(output)
    table = target.with_name(f"{target.name}.exchanges.csv")
    if target.is_dir() and Path(keypoints).resolve() == target.resolve():
        raise UnwritableFile("holds the files that were read; give another folder", file=target)
    check_target(output, is_folder=True)
    check_target(str(table), replace=force)
    if target.is_dir() and any(target.iterdir()) and not force:
        raise UnwritableFile("is a folder with files; --force writes over those", file=target)
    views = read_keypoints(keypoints, layout=options.layout, person=options.person)
    found = find(views, options.cameras, **options.calibration())
    changed = write_exchanged(views, found.sources, target)
    write_labels([found.track.renamed(target.name)], table, excel=excel)
    for one in found.exchanges:
        rows = [
            (camera, f"{100 * share.mean():.1f} %", f"{100 * doubt.mean():.1f} %")
            for camera, share, doubt in zip(views.cameras, one.exchanged, one.unsure, strict=True)
        ]
        screen.print_table((f"{one.limb} of", ">exchanged", ">unsure"), rows)
    for note in found.notes:
        screen.warn(note)
    screen.say(f"{screen.count(changed, 'file')} changed; written to {output} and {table}")
    return 0


def track(
    keypoints: Keypoints,
    output: Annotated[str, declare("--output -o FILE", "The motion: .trc, .c3d, .bvh, .npz.")],
    options: TrackOptions,
    as_json: AsJson = False,
    force: Force = False,
) -> int:
    """Track a person in keypoints of several calibrated cameras.

    Left and right are put right, gaps are bridged by a body of constant bones, noise is smoothed as
    far as the views are noisy. Points are those of the keypoints, y up, in metres; a .bvh holds the
    chain of bones. With a library, poses of other people are lent from its file poses.npz, which
    `PoseMemory.save` writes; without that file, those of the recording itself.

    motionary track pose --cameras Calib.toml --rate 60 -o walk.trc
    motionary track pose --cameras Calib.toml --rate 60 -o walk.trc --report walk.html
    """
    from motionary.io import write, write_labels
    from motionary.io.keypoints import read_keypoints
    from motionary.multiview import track as find

    check_target(output, replace=force)
    options.check(replace=force)
    views = read_keypoints(keypoints, layout=options.layout, person=options.person)
    known, memory, named = _read_library(options.library)
    found = find(
        views, options.cameras, library=known, memory=memory, named=named, **options.calibration(),
    )  # fmt: skip
    name, is_rig = Path(output).stem, Path(output).suffix.lower() == ".bvh"
    write((found.rig if is_rig else found.motion).renamed(name), output)
    if as_json:
        screen.print_json({**found.as_dict(), "recording": name})
    else:
        _show(found)
    if options.labels is not None and found.labels is not None:
        write_labels([found.labels.renamed(name)], options.labels)
    if options.confidence is not None:
        _write_confidence(found, options.confidence)
    if options.report is not None:
        from motionary.reporting import report_tracking

        report_tracking(found, options.report, images=options.images, title=name)
        screen.say_size(options.report)
    if not as_json:
        for note in found.notes:
            screen.warn(note)
        screen.say(f"{views.n_frames} frames written to {output}")
    return 0


def _write_confidence(found: "Tracking", path: str) -> None:
    """A row for each frame, a column for each point."""
    from motionary.files import write_atomically

    motion = found.motion
    lines = [",".join(("frame", *motion.names))]
    for frame, row in enumerate(found.confidence, start=motion.recording.first_frame):
        lines.append(",".join((str(frame), *(f"{value:.3f}" for value in row))))
    with write_atomically(path) as beside:
        beside.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _read_library(
    folder: str | None,
) -> "tuple[ClassLibrary | None, PoseMemory | None, PriorTable | None]":
    """The classes of a folder or those that ship, poses of people and edited priors beside them."""
    if folder is None:
        return None, None, None
    from motionary.multiview import PoseMemory

    library, poses = open_library(folder), Path(folder, "poses.npz")
    memory = PoseMemory.load(poses) if poses.is_file() else None
    return library, memory, read_marks(folder, library)


def read_marks(folder: str, library: "ClassLibrary") -> "PriorTable | None":
    """The priors that lie beside a library; None if none were written."""
    from motionary.multiview import PRIORS_FILE, read_priors

    path = Path(folder, PRIORS_FILE)
    return read_priors(path, library) if path.is_file() else None


def priors(
    folder: Annotated[str, argument("LIB", "A folder that `motionary learn` wrote.")],
    force: Force = False,
) -> int:
    """Write what templates tell tracks into LIB/priors.toml, to be edited.

    Resting feet, feet and hands ahead, bent and straight elbows and knees, each with the columns of
    its template in which all examples agree. `motionary track --library LIB` then takes what the
    file says; `motionary library show LIB CLASS --plot PICTURE` shows it in the template.

    motionary library priors my-classes
    """
    from motionary.multiview import PRIORS_FILE, derive_priors, write_priors

    library, path = open_library(folder), Path(folder, PRIORS_FILE)
    if not path.parent.is_dir():
        raise InvalidInput("priors are written beside a library of your own, not one that ships")
    if path.exists() and not force:
        raise UnwritableFile("exists, and may be edited; say --force to replace it", file=path)
    check_target(str(path))
    found = derive_priors(library)
    write_priors(found, path)
    screen.say(f"{screen.count(sum(map(len, found.values())), 'prior')} written to {path}")
    return 0


def _show(found: "Tracking") -> None:
    """The table before and after, which priors were taken, and what was exchanged."""
    rows = [
        # Nothing to measure, as of feet that never stand, is a dash.
        (name, *(screen.cell(factor * float(getattr(one, key)), digits=1, unknown="–")
                 for one in (found.before, found.after)))
        for name, key, factor in (
            ("sliding of planted feet, cm/s", "sliding", 100),
            ("frames below the floor, %", "below", 100), ("points not known, %", "gaps", 100),
            ("jitter, m/s²", "jitter", 1),
        )
    ]  # fmt: skip
    screen.print_table(("", ">triangulated", ">tracked"), rows)
    by_name: dict[str, list[AllocatedPrior]] = {}
    for prior in found.priors:
        by_name.setdefault(prior.name, []).append(prior)
    rows = []
    for name, every in by_name.items():
        refused = [one for one in every if not one.kept]
        why = refused[-1].reason if refused else ""
        rows.append((name, str(len(every) - len(refused)), str(len(refused)), why))
    if rows:
        screen.print_table(("prior", ">taken", ">not taken", "why not"), rows)
    frames = sum(label.end_s - label.start_s for label in found.exchanges)
    many = screen.count(len(found.exchanges), "segment")
    screen.say(f"{many} of limbs exchanged or unsure, {frames:.1f} s")
