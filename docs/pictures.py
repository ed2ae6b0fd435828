"""Pictures of the README and the documentation.

`make docs-pictures`, or `python docs/pictures.py [NAME ...]`, draws them with the package
from real recordings: MOTIONARY_DATA names the folder that has `hdm05` (clips of HDM05, a
folder a class), `cmu/86_01.amc` and `truth/annotation_2009.csv`. The same recordings give
the same pictures.
"""

import io
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import motionary as mo
from motionary.features import FULL_BODY
from motionary.files import write_atomically
from motionary.matching import distance_function
from motionary.models.library import (
    TrainingOptions,
    format_thresholds,
    learn_classes,
    load_everyday,
)
from motionary.plots import features as grid
from motionary.plots import (
    plot_annotation,
    plot_distance,
    plot_features,
    plot_pose,
    plot_recordings,
    plot_sheet,
    plot_template,
)
from motionary.plots.style import (
    BLACK,
    WHITE,
    Layout,
    add_legend,
    house_style,
    mark_seconds,
    new_page,
    swatch,
)
from motionary.recording import Recording
from motionary.retrieval.index import Collection, collect
from motionary.retrieval.labelling import class_distance
from motionary.retrieval.search import QueryExpansion, SearchResult
from motionary.samples import synthetic_motion, synthetic_stream

IMAGES = Path(__file__).resolve().parent / "images"

EXAMPLE = "squat1Reps/HDM_mm_squat1Reps_037_120.amc"
#: The first performance of each of three actors, to see what they have in common.
PERFORMANCES = (
    "squat1Reps/HDM_bk_squat1Reps_013_120.amc",
    "squat1Reps/HDM_dg_squat1Reps_025_120.amc",
    "squat1Reps/HDM_mm_squat1Reps_037_120.amc",
)
#: Features that say most of a squat.
TELLING = (
    "F13", "F14", "F19", "F20", "F21", "F27", "F28", "F29", "F30", "F31", "F37", "F39",
)  # fmt: skip
UNSEEN_ACTOR = "bd"
TRAINING = TrainingOptions(mirror=True)
TAKE = "86_01"
#: Classes as the annotators of the take call them.
NAMES = {
    "hopBothLegs1hops": "jump",
    "jogLeftCircle4StepsRstart": "move",
    "kickLFront1Reps": "kick",
    "sneak2StepsLStart": "move",
}

_COLOURS = 256
_GAP_PX = 12
_INCHES_PER_S = 1.2


@dataclass(frozen=True)
class World:
    """The recordings, and what is learned from them."""

    data: Path

    @cached_property
    def clips(self) -> Collection:
        """Words of all clips."""
        return collect(self.data / "hdm05", jobs=2)

    @cached_property
    def library(self) -> mo.ClassLibrary:
        """Classes and mirror images of four actors."""
        examples: dict[str, dict[str, list[mo.FeatureSequence]]] = {}
        for sequence in self.clips.sequences:
            name = sequence.source.split("/")[0]
            if actor(sequence.source) != UNSEEN_ACTOR:
                examples.setdefault(name, {}).setdefault(name, []).append(sequence)
        return learn_classes(examples, training=TRAINING)

    @cached_property
    def found(self) -> SearchResult:
        """All hits of the example."""
        return mo.search(self.clip(EXAMPLE), self.clips, limit=None)

    def clip(self, name: str) -> mo.Motion:
        """A clip under its short name."""
        return mo.read(self.data / "hdm05" / name).renamed(Path(name).stem)

    @cached_property
    def take(self) -> mo.FeatureSequence:
        """Features of a recording with several motions."""
        motion = mo.read(self.data / "cmu" / f"{TAKE}.amc")
        return mo.compute_features(motion.renamed(f"CMU {TAKE}"))

    @cached_property
    def truth(self) -> mo.LabelTrack:
        """What people say happens in it."""
        return mo.read_labels(self.data / "truth" / "annotation_2009.csv")[TAKE]


def actor(recording: str) -> str:
    """Initials of the actor, from the file's name."""
    return recording.split("/")[-1].split("_")[1]


def hits(world: World) -> list[Figure]:
    """One squat, and the best hit of each actor."""
    others = [hit for hit in world.found if hit.recording.name != EXAMPLE]
    best = {actor(hit.recording.name): hit for hit in reversed(others)}
    example = world.clip(EXAMPLE)
    times = np.arange(example.n_frames) / example.rate_hz
    rows = [("example: " + Path(EXAMPLE).stem, example.generic_positions(), times)]
    for hit in sorted(best.values(), key=lambda h: h.cost):
        motion = world.clip(hit.recording.name)
        first, last = (n - motion.first_frame for n in (hit.start_frame, hit.end_frame))
        label = f"{hit.start_s:.1f}–{hit.end_s:.1f} s, cost {hit.cost:.2f}"
        part = motion.cut(first, last + 1).generic_positions()
        seconds = np.arange(first, last + 1) / motion.rate_hz
        rows.append((f"{motion.source}, {label}", part, seconds))
    figure = plot_sheet(rows[0], rows[1:], n_figures=9)
    return [_titled(figure, "one squat, and the best hit of each of five actors")]


def pose(world: World) -> list[Figure]:
    """A pose, and its 40 features."""
    motion = world.clip(EXAMPLE)
    sequence = mo.compute_features(motion)
    lowest = int(np.argmin(motion.generic_positions()[:, 0, 1]))
    frame = round(lowest / motion.rate_hz * sequence.rate_hz)
    drawn = plot_pose(motion.generic_positions()[lowest], title="one pose")
    return [drawn, _matrices("its features", {"": sequence.part(frame, frame + 1)}, width=0.4)]


def features(world: World) -> list[Figure]:
    """A motion as stick figures, and as a matrix."""
    motion = world.clip(EXAMPLE)
    sequence = mo.compute_features(motion)
    sheet = plot_sheet((motion.source, motion.generic_positions()), [], n_figures=9)
    return [_titled(sheet, "one motion"), _titled(plot_features(sequence), "its features")]


def examples(world: World) -> list[Figure]:
    """Three performances, in the features that say most."""
    sequence = {name: mo.compute_features(world.clip(name)) for name in PERFORMANCES}
    panels = {f"{Path(name).stem}": one for name, one in sequence.items()}
    return [_matrices("three squats by three actors", panels, ids=TELLING)]


def template(world: World) -> list[Figure]:
    """What four actors' squats have in common, in the same features."""
    learned = world.library["squat1Reps"].prototypes[0].template
    telling = FULL_BODY.select(TELLING, name="telling")
    shown = replace(
        learned,
        values=learned.values[:, [learned.feature_names.index(i) for i in TELLING]],
        feature_names=telling.ids,
        feature_set=telling.name,
        provenance="squats of four actors",
    )
    return [plot_template(shown, tolerance=TRAINING.tolerance, feature_set=telling)]


def distance(world: World) -> list[Figure]:
    """How well each moment of a take ends a kick, and two steps of sneaking."""
    titles = {"kickLFront1Reps": "kick", "sneak2StepsLStart": "sneaking, two steps"}
    curves = {}
    for name, title in titles.items():
        patterns = [pattern for _, pattern in world.library[name].patterns]
        each = [distance_function(p, world.take.packed, world.take.known) for p in patterns]
        curves[title] = np.minimum.reduce(each)
    track = mo.annotate(world.take, world.library, assignment="published")
    labels = {title: [x for x in track if x.name == name] for name, title in titles.items()}
    title = f"{world.take.source}: cost of the best match that ends at each moment"
    return [plot_distance(curves, hits=labels, threshold=TRAINING.threshold, title=title)]


def annotation(world: World) -> list[Figure]:
    """Labels of the take, over those of people."""
    track = mo.annotate(world.take, world.library, assignment="published")
    named = replace(track, labels=tuple(replace(x, name=NAMES[x.name]) for x in track))
    curves: dict[str, np.ndarray] = {}
    for name, title in NAMES.items():
        one = class_distance(world.take, world.library[name]).modified
        curves[title] = np.minimum(curves.get(title, one), one)
    return [plot_annotation(named, world.truth, distances=curves)]


def everyday(world: World) -> list[Figure]:
    """Labels of the take by the library that ships, without training."""
    library = load_everyday()
    note = f"least score {format_thresholds(library)}"
    return [plot_annotation(mo.annotate(world.take), note=note)]


def expanded(world: World) -> list[Figure]:
    """The template that grew from one squat and its nearest hits."""
    return [plot_template(world.found.templates[0], tolerance=QueryExpansion().tolerance)]


def session(world: World) -> list[Figure]:
    """Labels of the synthetic session of the page for biomechanists, with its gap."""
    classes = ("squat", "kick_left", "kick_right")
    library = mo.learn({n: [synthetic_motion(n, seed=i) for i in range(6)] for n in classes})
    protocol = ["squat"] * 3 + ["kick_left"] * 2 + ["kick_right"] * 3
    motion, truth = synthetic_stream(protocol, seed=12)
    positions = motion.positions.copy()
    positions[264:300, motion.names.index("rwrist")] = np.nan
    positions[1140:1416] = np.nan
    session = mo.compute_features(replace(motion, positions=positions)).renamed("synthetic session")
    plan = mo.LabelTrack(Recording("plan"), tuple(mo.Label(*segment) for segment in truth))
    curves = {one.name: class_distance(session, one).modified for one in library}
    figure = plot_annotation(mo.annotate(session, library), plan, distances=curves, classes=classes)
    return [figure]


def first_pose(world: World) -> list[Figure]:
    """First poses as `motionary info --plot` draws them: a rig, and markers with z up."""
    names = ("iclone_07_01.bvh", "85_02.c3d")
    return [plot_recordings([mo.read(world.data / "cmu" / name) for name in names])]


#: By name of the file: what draws it, and whether its parts stand side by side.
PICTURES = {
    "hits": (hits, False),
    "pose": (pose, True),
    "features": (features, False),
    "examples": (examples, False),
    "template": (template, False),
    "distance": (distance, False),
    "annotation": (annotation, False),
    "everyday": (everyday, False),
    "expanded": (expanded, False),
    "session": (session, False),
    "first_pose": (first_pose, False),
}


#: What a browser is told before the page is pictured: the first kick, at this moment of it.
_KICK = """
const labels = [...document.querySelectorAll(".label-list button")];
labels.find((one) => one.innerText.startsWith("kick")).click();
setTimeout(() => document.querySelector("button.play").click(), 300);
"""
_KICK_S = 27.6
_BROWSER = (
    "--headless=new", "--no-sandbox", "--window-size=1280,720", "--hide-scrollbars",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip


def picture_report(world: World) -> Image.Image:
    """The page of a take, as `motionary report TAKE.amc --library everyday -o TAKE.html` writes it.

    Needs Chromium with its driver, and Selenium (`pip install selenium`).
    """
    from selenium import webdriver
    from selenium.webdriver.common.actions.action_builder import ActionBuilder

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for flag in _BROWSER:
        options.add_argument(flag)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / f"{TAKE}.html"
        motion = mo.read(world.data / "cmu" / f"{TAKE}.amc")
        mo.report(motion, page, library=load_everyday())
        # Named, so that Selenium looks for none on the network.
        driver = webdriver.ChromeService(shutil.which("chromedriver"))
        browser = webdriver.Chrome(options=options, service=driver)
        try:
            size = {"width": 1280, "height": 720, "deviceScaleFactor": 1, "mobile": False}
            browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            browser.get(page.as_uri())
            time.sleep(2)
            browser.execute_script(_KICK)
            time.sleep(1)
            axis = browser.find_element("css selector", "canvas.time-canvas").rect
            # Left of the axis stand names, 118 pixels wide.
            x = 118 + _KICK_S / motion.duration_s * (axis["width"] - 126)
            mouse = ActionBuilder(browser)
            mouse.pointer_action.move_to_location(round(x), round(axis["y"]) + 8).click()
            mouse.perform()
            time.sleep(1)
            shot = browser.get_screenshot_as_png()
        finally:
            browser.quit()
    return Image.open(io.BytesIO(shot)).convert("RGB").quantize(_COLOURS, kmeans=1)


@house_style()
def _matrices(
    title: str,
    panels: dict[str, mo.FeatureSequence],
    *,
    ids: Sequence[str] = FULL_BODY.ids,
    width: float | None = None,
) -> Figure:
    """Relations of several recordings side by side, their names written once."""
    chosen = [FULL_BODY.ids.index(i) for i in ids]
    rows = [grid.feature_rows(FULL_BODY)[i] for i in chosen]
    parts = grid.blocks(rows)
    longest = max(one.duration_s for one in panels.values())
    layout = Layout(
        left=grid.name_room(rows),
        width=width or longest * _INCHES_PER_S,
        right=grid.group_room(rows),
        heights=tuple((part.stop - part.start) * grid.ROW_HEIGHT for part in parts),
        above=0.2,
        n_stacks=len(panels),
    )
    figure, stacks = new_page(layout, title=title)
    for axes, (name, one) in zip(stacks, panels.items(), strict=True):
        cells = np.repeat(one.features[:, chosen, np.newaxis].astype(np.float64), 3, axis=2)
        stop_s = len(one) / one.rate_hz
        for ax, part in zip(axes, parts, strict=True):
            nothing = np.zeros(cells[:, part].shape[:2], dtype=np.bool_)
            grid.draw_grid(ax, cells[:, part], nothing, stop_s=stop_s)
        axes[0].set_title(name, loc="left", pad=4.0)
        if len(one) > 1:
            mark_seconds(axes, stop_s)
        for ax in axes if len(one) == 1 else ():
            ax.set_xticks([])
    for i, part in enumerate(parts):
        grid.name_rows(stacks[0][i], rows[part])
        grid.name_group(stacks[-1][i], rows[part][0].group)
    add_legend(figure, [swatch("holds", WHITE), swatch("does not hold", BLACK)])
    return figure


def _titled(figure: Figure, title: str) -> Figure:
    """A picture of the package under a title for this page."""
    figure.texts[0].set_text(title)
    return figure


def compose(figures: Sequence[Figure], *, side_by_side: bool) -> Image.Image:
    """Figures as one picture of few colours, so that it stays small."""
    parts = [_rendered(figure) for figure in figures]
    along, across = (0, 1) if side_by_side else (1, 0)
    size, at = [0, 0], [0, 0]
    size[along] = sum(p.size[along] for p in parts) + _GAP_PX * (len(parts) - 1)
    size[across] = max(p.size[across] for p in parts)
    page = Image.new("RGB", (size[0], size[1]), "white")
    for part in parts:
        page.paste(part, (at[0], at[1]))
        at[along] += part.size[along] + _GAP_PX
    return page.quantize(_COLOURS, kmeans=1, dither=Image.Dither.NONE)


def _rendered(figure: Figure) -> Image.Image:
    buffer = io.BytesIO()
    with house_style():
        figure.savefig(buffer, format="png")
    return Image.open(buffer).convert("RGB")


def main() -> None:
    """Draw all pictures, or those named on the command line."""
    folder = os.environ.get("MOTIONARY_DATA", "")
    if not folder or not Path(folder, "hdm05").is_dir():
        sys.exit("set MOTIONARY_DATA to the folder of the recordings; see the top of this file")
    world = World(Path(folder))
    for name in sys.argv[1:] or [*PICTURES, "report"]:
        with write_atomically(IMAGES / f"{name}.png") as beside:
            if name == "report":
                picture = picture_report(world)
            else:
                draw, side_by_side = PICTURES[name]
                picture = compose(draw(world), side_by_side=side_by_side)
            picture.save(beside, format="png", optimize=True)


if __name__ == "__main__":
    main()
