"""Do pictures show what they are given, and can a person read them?"""

import subprocess
import sys
import warnings

import numpy as np
import pytest

from motionary import plots
from motionary.errors import InvalidInput, UnwritableFile
from motionary.features import FULL_BODY, Feature, FeatureSequence, FeatureSet, compute_features
from motionary.features.quantities import speed
from motionary.io import read
from motionary.labels import Label, LabelTrack
from motionary.models.templates import MotionTemplate, quantise
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.packing import full_mask, pack
from motionary.plots import figures, style
from motionary.recording import Recording, Segment
from motionary.samples import synthetic_motion

NASTY = r"take_01 $x_1^2$ \alpha {a} 日本 \x00 " + "very long " * 40
INDEX = {name: i for i, name in enumerate(GENERIC_JOINTS)}


def words(n_frames=90, *, share_known=1.0, source="squat_01.amc", seed=1):
    random = np.random.default_rng(seed)
    # Relations hold for a while, as those of people do.
    features = np.repeat(random.random((-(-n_frames // 5), 40)) < 0.4, 5, axis=0)[:n_frames]
    known = random.random((n_frames, 40)) < share_known
    return FeatureSequence(
        pack(features & known),
        pack(known),
        FULL_BODY,
        Recording(source, rate_hz=120.0, n_frames=4 * n_frames),
    )


def template(n_columns=45, n_features=40, *, provenance="squat", seed=2):
    random = np.random.default_rng(seed)
    values = random.choice([0.0, 0.0, 0.2, 0.5, 0.9, 1.0, 1.0], (n_columns, n_features))
    return MotionTemplate(
        values, random.uniform(0.7, 1.4, n_columns), FULL_BODY.ids[:n_features], FULL_BODY.name,
        provenance, 6,
    )  # fmt: skip


def partial_template():
    """No example shows its first and its last feature."""
    random = np.random.default_rng(6)
    values = random.choice([0.0, 0.5, 1.0], (45, 40))
    values[:, [0, -1]] = 0.5
    ends = (FULL_BODY.ids[0], FULL_BODY.ids[-1])
    return MotionTemplate(
        values, np.ones(45), FULL_BODY.ids, FULL_BODY.name, "squat", 6, unmeasured=ends
    )


def strange_motion():
    """Far away, nothing known of it, and much said."""
    positions = np.random.default_rng(5).normal(size=(3, 7, 3)) * 200
    notes = (f"unit {NASTY}", f"z up, {NASTY}", f"no features: {NASTY}")
    return Motion(tuple("abcdefg"), positions, Recording(NASTY, rate_hz=29.97), notes=notes)


def strange_template():
    """Names that no known set has, in another set."""
    names = tuple(f"{NASTY} {i}" for i in range(40))
    return MotionTemplate(np.eye(40), np.ones(40), names, "theirs", NASTY)


def distance(n_frames=300, seed=3):
    random = np.random.default_rng(seed)
    values = 0.2 + 0.1 * np.sin(np.arange(n_frames) / 9) + 0.01 * random.random(n_frames)
    values[: n_frames // 20] = np.inf
    return values


def track(*labels, duration_s=0.0, unassessed=(), nearest=""):
    recording = Recording("take_01", rate_hz=30.0, n_frames=round(30 * duration_s))
    segments = tuple(Segment(*segment) for segment in unassessed)
    return LabelTrack(recording, tuple(Label(*label) for label in labels), segments, nearest)


def person(n_frames=12, *, heading_deg=0.0, seed=4):
    """Someone who stands, faces `heading_deg` from +z towards +x and sways a little."""
    at = {
        "root": (0, 0.9, 0), "belly": (0, 1.05, 0), "chest": (0, 1.2, 0), "neck": (0, 1.45, 0),
        "head": (0, 1.55, 0), "headtop": (0, 1.75, 0),
    }  # fmt: skip
    for side, sign in (("l", 1.0), ("r", -1.0)):
        at |= {
            f"{side}hip": (0.1 * sign, 0.88, 0), f"{side}knee": (0.1 * sign, 0.48, 0.02),
            f"{side}ankle": (0.1 * sign, 0.08, 0), f"{side}toes": (0.1 * sign, 0.02, 0.15),
            f"{side}clavicle": (0.03 * sign, 1.42, 0), f"{side}shoulder": (0.2 * sign, 1.4, 0),
            f"{side}elbow": (0.25 * sign, 1.12, 0), f"{side}wrist": (0.25 * sign, 0.9, 0.1),
            f"{side}fingers": (0.25 * sign, 0.8, 0.15),
        }  # fmt: skip
    pose = np.array([at[name] for name in GENERIC_JOINTS], dtype=float)
    sway = 0.01 * np.random.default_rng(seed).standard_normal((n_frames, 24, 3))
    angle = np.radians(heading_deg)
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    return (pose + sway) @ turn.T


def custom_sequence():
    """One relation in a group with a long name."""
    feature = Feature(
        "A1", NASTY, NASTY, speed, ("root",), ">", 1.0, 2.0, "humerus", "The root moves."
    )
    chosen = FeatureSet("one", (feature,))
    return FeatureSequence(full_mask(20, 1), full_mask(20, 1), chosen, Recording(NASTY))


def nothing_seen(n_frames=5):
    return np.full((n_frames, 24, 3), np.nan)


def flying_joint():
    positions = person()
    positions[3, INDEX["lwrist"]] = 50.0
    return positions


SQUATS = {"squat": [Label("squat", 1.0, 2.5), Label("squat", 2.5, 4.0)]}
LONG_TRACK = track(*[("jump", 10.0 * i, 10.0 * i + 0.3) for i in range(60)], duration_s=600.0)
MANY = [f"class_{i:02d}" for i in range(40)]

CASES = {
    "features": lambda: plots.plot_features(words()),
    "features, one frame": lambda: plots.plot_features(words(1)),
    "features, half a second": lambda: plots.plot_features(words(15), ids=["F33", "F1", "F2"]),
    "features, ten minutes": lambda: plots.plot_features(words(18_000, share_known=0.9)),
    "features, all unknown": lambda: plots.plot_features(
        words(share_known=0.0), ids=FULL_BODY.ids[:20]
    ),
    "features, gaps": lambda: plots.plot_features(
        words(300, share_known=0.5), ids=FULL_BODY.ids[::4]
    ),
    "features, nasty names": lambda: plots.plot_features(custom_sequence()),
    "template": lambda: plots.plot_template(template()),
    "template, quantised": lambda: plots.plot_template(template(), tolerance=0.1),
    "template, 300 columns": lambda: plots.plot_template(template(300), tolerance=0.0),
    "template, never measured": lambda: plots.plot_template(partial_template(), tolerance=0.1),
    "template, one column": lambda: plots.plot_template(template(1, 39)),
    "template, nasty names": lambda: plots.plot_template(strange_template(), tolerance=0.1),
    "distance": lambda: plots.plot_distance({"squat": distance()}),
    "distance, hits": lambda: plots.plot_distance(
        {"squat": distance(), NASTY: distance(200)},
        hits=SQUATS, threshold=0.15, truth=track(("squat", 1.0, 3.0)), title=NASTY,
    ),
    "distance, nothing fits": lambda: plots.plot_distance({"a": np.full(9, np.inf)}, threshold=0.1),
    "distance, one frame": lambda: plots.plot_distance({"squat": [0.1]}, hits={"squat": []}),
    "distance, ten minutes": lambda: plots.plot_distance({"squat": distance(18_000)}),
    "distance, 12 classes": lambda: plots.plot_distance(dict.fromkeys(MANY[:12], distance())),
    "annotation": lambda: plots.plot_annotation(
        track(("jump", 0.5, 2.0), ("kick", 1.8, 3.0), unassessed=((4.0, 5.0),), duration_s=8.0),
        track(("jump", 0.4, 2.2), ("turn", 3.0, 3.5)),
        distances={"jump": distance(240), "kick": np.full(240, np.inf)},
    ),
    "annotation, no labels": lambda: plots.plot_annotation(
        track(duration_s=0.5, nearest="nothing below 0.06; nearest: " + NASTY)
    ),
    "annotation, nothing known": lambda: plots.plot_annotation(LabelTrack(Recording())),
    "annotation, no labels but truth": lambda: plots.plot_annotation(track(), LONG_TRACK),
    "annotation, ten minutes": lambda: plots.plot_annotation(LONG_TRACK, LONG_TRACK),
    "annotation, 40 classes": lambda: plots.plot_annotation(
        track(*[(name, i, i + 1.0) for i, name in enumerate(MANY)]),
        distances=dict.fromkeys(MANY, distance()), classes=[*MANY, NASTY],
    ),
    "annotation, all unassessed": lambda: plots.plot_annotation(track(unassessed=((0.0, 3.0),))),
    "sheet": lambda: plots.plot_sheet(("query", person()), [(NASTY, person(30))] * 3),
    "sheet, no hits": lambda: plots.plot_sheet((NASTY, person()), []),
    "sheet, 120 hits": lambda: plots.plot_sheet(
        ("query", person()), [("hit", person(1))] * 120
    ),
    "sheet, no query": lambda: plots.plot_sheet(None, [("hit", person())]),
    "sheet, one frame": lambda: plots.plot_sheet(("query", person(1)), [("hit", person(2))]),
    "sheet, nothing seen": lambda: plots.plot_sheet(("query", nothing_seen()), []),
    "sheet, a flying joint": lambda: plots.plot_sheet(("query", flying_joint()), [], n_figures=30),
    "recordings": lambda: plots.plot_recordings(
        [synthetic_motion("squat", seed=1), strange_motion()] * 3
    ),
    "pose": lambda: plots.plot_pose(person()[0], title=NASTY),
    "pose, nothing seen": lambda: plots.plot_pose(nothing_seen()[0]),
}  # fmt: skip


def written(figure):
    """Visible words of a figure with their boxes in pixels: left, bottom, right, top."""
    from matplotlib.text import Text

    found = [t for t in figure.findobj(Text) if t.get_visible() and t.get_text().strip()]
    hidden = out_of_range(figure)
    boxes = [(t, t.get_window_extent().extents) for t in found if t not in hidden]
    return [(t, box) for t, box in boxes if box[2] > box[0]]


def out_of_range(figure):
    """Numbers of ticks beyond the ends of their axis: they exist, but nobody sees them."""
    hidden = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            slack = 1e-6 * (high - low)
            hidden |= {
                tick.label1
                for tick in axis.get_major_ticks()
                if not low - slack <= tick.get_loc() <= high + slack
            }
    return hidden


def rendered(figure):
    """Colours on screen, shape (rows, columns, 3), top first."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    with style.house_style():
        canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3] / 255.0


def laid_out(figure):
    """Width and height in pixels of a figure whose words have their places; nothing is painted."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    with style.house_style():
        figure.draw_without_rendering()
    return canvas.get_width_height()


def colour_at(pixels, axes, x, y):
    """Colour at a point of the axes' data."""
    column, up = axes.transData.transform((x, y))
    return pixels[len(pixels) - 1 - int(up), int(column)]


def rgb(colour):
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0


def is_colour(pixel, colour):
    return np.abs(np.asarray(pixel) - rgb(colour)).max() < 0.02


@pytest.mark.parametrize("case", CASES)
def test_every_word_is_on_the_page_large_enough_and_alone(case):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = CASES[case]()
        width, height = laid_out(figure)
    assert 4.0 <= width / style.DPI <= 11.7
    texts = written(figure)
    assert texts
    for text, box in texts:
        place = (text.get_text(), box)
        assert text.get_fontsize() >= 8.0, place
        assert not text.get_parse_math(), place
        assert box[:2].min() >= 0, place
        assert box[2] <= width, place
        assert box[3] <= height, place
    boxes = np.array([box for _, box in texts])
    overlap = np.minimum(boxes[:, None, 2:], boxes[:, 2:]) - np.maximum(
        boxes[:, None, :2], boxes[:, :2]
    )
    touching = np.triu((overlap > 1).all(axis=-1), k=1)
    assert [
        (texts[i][0].get_text(), texts[j][0].get_text()) for i, j in np.argwhere(touching)
    ] == []


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_the_same_input_gives_the_same_bytes_whatever_the_settings(kind, tmp_path):
    from matplotlib import rc_context

    plots.save(CASES["annotation"](), tmp_path / f"a.{kind}")
    theirs = {"font.size": 20, "lines.linewidth": 9, "savefig.dpi": 40, "figure.facecolor": "red"}
    with rc_context(theirs):
        plots.save(CASES["annotation"](), tmp_path / f"b.{kind}")
    first, second = ((tmp_path / f"{name}.{kind}").read_bytes() for name in "ab")
    assert first == second
    assert len(first) > 1000
    assert b"matplotlib" not in first[:2000].lower()


def test_saving_refuses_other_formats_and_leaves_the_file(tmp_path):
    path = tmp_path / "a.jpg"
    path.write_text("mine")
    with pytest.raises(InvalidInput, match=r"\.png, \.svg or \.pdf"):
        plots.save(CASES["pose"](), path)
    assert path.read_text() == "mine"
    (tmp_path / "file").write_text("")
    with pytest.raises(UnwritableFile):
        plots.save(CASES["pose"](), tmp_path / "file" / "a.png")
    assert {p.name for p in tmp_path.iterdir()} == {"a.jpg", "file"}


def test_matplotlib_is_imported_late_and_pyplot_never():
    code = (
        "import sys; from motionary import plots; print('matplotlib' in sys.modules);"
        "import numpy as np; plots.plot_distance({'a': np.ones(9)});"
        "print('matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


def test_features_are_white_black_and_blue_grey_where_they_should_be():
    sequence = words(24, share_known=0.8)
    sequence = FeatureSequence(
        sequence.packed, sequence.known & pack(np.arange(24)[:, None] % np.arange(2, 42) > 0),
        FULL_BODY, Recording("x", rate_hz=120.0, n_frames=96),
    )  # fmt: skip
    figure = plots.plot_features(sequence)
    pixels = rendered(figure)
    features, known = sequence.features, sequence.known_features
    first = 0
    for axes in figure.axes:
        n_rows = round(axes.get_ylim()[0] + 0.5)
        for row, frame in np.ndindex(n_rows, 24):
            # Beside the middle of the row, where no line of the hatching need be.
            spots = [colour_at(pixels, axes, (frame + 0.5) / 30, row + y) for y in (-0.2, 0, 0.2)]
            if not known[frame, first + row]:
                assert any(is_colour(spot, style.UNKNOWN) for spot in spots)
            else:
                expected = style.WHITE if features[frame, first + row] else style.BLACK
                assert is_colour(spots[1], expected)
        first += n_rows
    assert first == 40


def test_groups_stand_apart_in_the_order_asked_for():
    figure = plots.plot_features(words(), ids=["F15", "F1", "F40", "F39"])
    rendered(figure)
    said = [t.get_text() for t, _ in written(figure)]
    assert len(figure.axes) == 3
    for phrase in ("lower", "upper", "mix", "F15", "right foot behind left leg", "body turns"):
        assert phrase in said
    assert "F2" not in said


def test_a_change_within_one_column_of_a_long_recording_is_grey():
    features = np.zeros((3000, 40), dtype=np.bool_)
    features[1::3] = True
    mask = full_mask(3000, 40)
    figure = plots.plot_features(FeatureSequence(pack(features), mask, FULL_BODY))
    pixel = colour_at(rendered(figure), figure.axes[0], 50.0, 0.0)
    np.testing.assert_allclose(pixel, 1 / 3, atol=0.01)


def test_features_that_no_example_shows_are_hatched_and_not_between():
    values = np.full((30, 40), 0.5)
    values[:, ::2] = 1.0
    never = MotionTemplate(
        values, np.ones(30), FULL_BODY.ids, FULL_BODY.name, "kick", 3, unmeasured=("F2",)
    )
    for tolerance in (None, 0.1):
        figure = plots.plot_template(never, tolerance=tolerance)
        pixels = rendered(figure)
        n_panels = 1 if tolerance is None else 2
        upper = figure.axes[(n_panels - 1) * len(figure.axes) // n_panels]
        spots = [
            [colour_at(pixels, upper, (c + 0.5) / 30, row + y) for c in range(30)
             for y in (-0.2, 0, 0.2)] for row in (0, 1, 3)
        ]  # fmt: skip
        assert all(is_colour(spot, style.WHITE) for spot in spots[0])
        assert any(is_colour(spot, style.UNKNOWN) for spot in spots[1])
        assert not any(is_colour(spot, style.UNKNOWN) for spot in spots[2])
        assert "never measured" in [text.get_text() for text, _ in written(figure)]


def test_a_quantised_template_shows_what_is_fixed():
    shown = template(30)
    figure = plots.plot_template(shown, tolerance=0.1)
    pixels = rendered(figure)
    quantised = quantise(shown, tolerance=0.1)
    fractions, fixed = figure.axes[0], figure.axes[4]
    for row, column in np.ndindex(14, 30):
        place = ((column + 0.5) / 30, row)
        expected = style.WHITE if quantised.values[column, row] else style.BLACK
        if not quantised.fixed[column, row]:
            expected = style.FREE
        assert is_colour(colour_at(pixels, fixed, *place), expected)
        value = shown.values[column, row]
        if value in (0.0, 1.0):
            assert is_colour(
                colour_at(pixels, fractions, *place), style.WHITE if value else style.BLACK
            )
        else:
            red, _, blue = colour_at(pixels, fractions, *place)
            assert red > blue + 0.2


def test_rows_of_an_unknown_feature_set_keep_their_names():
    shown = MotionTemplate(np.eye(3), np.ones(3), ("left", "right", "both"), "theirs")
    figure = plots.plot_template(shown)
    rendered(figure)
    said = [t.get_text() for t, _ in written(figure)]
    assert {"left", "right", "both"} <= set(said)


def test_phrases_find_their_row_as_ids_do():
    by_id, by_name = (
        MotionTemplate(np.eye(2), np.ones(2), getattr(FULL_BODY, kind)[:2], FULL_BODY.name)
        for kind in ("ids", "names")
    )
    a, b = (rendered(plots.plot_template(t)) for t in (by_id, by_name))
    np.testing.assert_array_equal(a, b)


def test_infinite_distances_are_blank_and_hits_are_shaded():
    values = np.full(300, 0.3)
    values[100:200] = np.inf
    hits = {"a": [Label("a", 7.0, 9.0)]}
    figure = plots.plot_distance({"a": values}, hits=hits, threshold=0.1)
    pixels, axes = rendered(figure), figure.axes[0]
    assert is_colour(colour_at(pixels, axes, 1.0, 0.3), style.BLUE)
    assert is_colour(colour_at(pixels, axes, 5.0, 0.3), style.WHITE)
    assert is_colour(colour_at(pixels, axes, 8.0, 0.2), style.PALE_BLUE)
    assert is_colour(colour_at(pixels, axes, 6.9, 0.2), style.WHITE)


def test_labels_stand_over_truth_in_the_row_of_their_class():
    figure = plots.plot_annotation(
        track(("jump", 1.0, 2.0), ("kick", 3.0, 4.0), unassessed=((5.0, 6.0),), duration_s=8.0),
        track(("jump", 1.5, 2.5)),
    )
    pixels, axes = rendered(figure), figure.axes[0]
    assert [t.get_text() for t in axes.get_yticklabels()] == ["jump", "kick"]
    assert is_colour(colour_at(pixels, axes, 1.2, -0.2), style.VERMILLION)
    assert is_colour(colour_at(pixels, axes, 2.2, -0.2), style.WHITE)
    assert is_colour(colour_at(pixels, axes, 2.2, 0.2), style.BLACK)
    assert is_colour(colour_at(pixels, axes, 1.2, 0.2), style.WHITE)
    assert is_colour(colour_at(pixels, axes, 3.5, 0.8), style.VERMILLION)
    unassessed = [colour_at(pixels, axes, 5.5, y) for y in np.linspace(-0.4, 1.4, 40)]
    assert any(is_colour(pixel, style.UNKNOWN) for pixel in unassessed)


def test_a_short_label_of_a_long_recording_can_be_seen():
    figure = plots.plot_annotation(track(("jump", 300.0, 300.1), duration_s=3600.0))
    pixels = rendered(figure)
    axes = figure.axes[0]
    around = [colour_at(pixels, axes, x, 0.0) for x in np.linspace(290, 310, 30)]
    assert min(np.abs(pixel - rgb(style.VERMILLION)).max() for pixel in around) < 0.5


def test_a_short_match_of_a_long_recording_is_coloured():
    values = np.full(30_000, np.inf)
    values[15_007] = 0.01
    figure = plots.plot_annotation(track(duration_s=1000.0), distances={"jump": values})
    pixels, axes = rendered(figure), figure.axes[0]
    around = np.array([colour_at(pixels, axes, x, 0.0) for x in np.linspace(497, 503, 40)])
    assert around.min() < 0.9


def test_chosen_classes_are_the_rows_in_their_order():
    figure = plots.plot_annotation(track(("jump", 0, 1), ("kick", 1, 2)), classes=["turn", "jump"])
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == ["turn", "jump"]


def test_bones_join_all_generic_joints_in_one_tree():
    joints = [joint for joint, _ in plots.BONES]
    assert sorted([*joints, "root"]) == sorted(GENERIC_JOINTS)
    parent = dict(plots.BONES)
    for joint in joints:
        steps = 0
        while joint != "root":
            joint, steps = parent[joint], steps + 1
            assert steps < 24


@pytest.mark.parametrize("heading", [0, 45, 90, 135, 180, 270, 333])
def test_figures_face_right_whatever_the_heading(heading):
    plain, turned = person(), person(heading_deg=heading) + np.array([3.0, 0.0, -7.0])
    view, other = figures.project(plain), figures.project(turned)
    toes = view[:, [INDEX["ltoes"], INDEX["rtoes"]], 0]
    ankles = view[:, [INDEX["lankle"], INDEX["rankle"]], 0]
    assert (toes > ankles + 0.05).all()
    shift = other - view
    np.testing.assert_allclose(shift, np.broadcast_to(shift[0, 0], shift.shape), atol=1e-9)
    np.testing.assert_allclose(view[..., 1], plain[..., 1])


def test_from_the_front_the_left_side_is_on_the_right():
    view = figures.project(person(), turn_deg=90.0)
    assert (view[:, INDEX["lshoulder"], 0] > view[:, INDEX["rshoulder"], 0] + 0.3).all()


def test_over_a_full_turn_the_first_pose_decides_the_view():
    turning = np.concatenate([person(1, heading_deg=a) for a in np.arange(30, 390, 10)])
    view = figures.project(turning)
    assert view[0, INDEX["ltoes"], 0] > view[0, INDEX["lankle"], 0] + 0.05


def test_what_was_not_seen_is_not_drawn_and_what_a_file_lacks_is_bridged():
    positions = person(4)
    whole = figures.poses(positions, figures.project(positions), [0, 2])
    assert [len(part) for part in (whole[0].left, whole[0].trunk, whole[0].right)] == [9, 5, 9]
    positions[2, INDEX["lelbow"]] = np.nan
    positions[:, INDEX["rknee"]] = np.nan
    positions[:, [INDEX["headtop"], INDEX["rfingers"]]] = np.nan
    seen, hidden = figures.poses(positions, figures.project(positions), [0, 2])
    assert [len(part) for part in (seen.left, seen.trunk, seen.right)] == [9, 4, 7]
    assert [len(part) for part in (hidden.left, hidden.trunk, hidden.right)] == [7, 4, 7]
    lengths = np.linalg.norm(seen.right[:, 0] - seen.right[:, 1], axis=1)
    assert lengths.max() > 0.7
    assert seen.head_radius > 0


def test_rows_of_a_sheet_have_one_scale():
    small = 0.5 * person()
    figure = plots.plot_sheet(("query", person()), [("hit", small)])
    lines = [c for c in figure.axes[0].collections if hasattr(c, "get_segments")]
    trunks = [c for c in lines if is_colour(c.get_color()[0][:3], style.TRUNK)]
    tall, short = (np.ptp(np.concatenate(c.get_segments())[:, 1]) for c in trunks)
    assert short == pytest.approx(tall / 2, rel=1e-6)


@pytest.mark.parametrize(
    ("draw", "words_of_error"),
    [
        (lambda: plots.plot_features(words(), ids=["F99"]), "no feature 'F99'"),
        (lambda: plots.plot_features(words(), ids=[]), "0 features"),
        (lambda: plots.plot_template(template(), tolerance=0.5), "tolerance"),
        (lambda: plots.plot_distance({}), "at least one distance function"),
        (lambda: plots.plot_distance(np.ones(5)), "{name: array}"),
        (lambda: plots.plot_distance({"a": []}), "shape"),
        (lambda: plots.plot_distance({"a": np.ones((2, 2))}), "shape"),
        (lambda: plots.plot_distance({"a": [1.0]}, rate_hz=0), "rate_hz"),
        (lambda: plots.plot_distance({"a": [1.0]}, hits=SQUATS), "hits of 'squat'"),
        (lambda: plots.plot_annotation(track(), distances={"a": [[1.0]]}), "shape"),
        (lambda: plots.plot_sheet(("query", np.ones((3, 20, 3))), []), "24"),
        (lambda: plots.plot_sheet(("query", np.ones((0, 24, 3))), []), "24"),
        (lambda: plots.plot_sheet(("query", person()), [], n_figures=0), "n_figures"),
        (lambda: plots.plot_sheet(None, []), "a query or hits"),
        (lambda: plots.plot_pose(np.ones((23, 3))), "24"),
    ],
)
def test_what_cannot_be_drawn_is_said(draw, words_of_error):
    with pytest.raises(InvalidInput, match=words_of_error):
        draw()


def lightness(colour):
    """CIE L* of an sRGB colour."""
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    luminance = float(linear @ [0.2126, 0.7152, 0.0722])
    return 116 * np.cbrt(luminance) - 16 if luminance > 0.008856 else 903.3 * luminance


def test_what_stands_side_by_side_differs_in_grey():
    pairs = [
        (style.VERMILLION, style.BLACK),
        (style.LEFT_SIDE, style.RIGHT_SIDE),
        (style.FREE, style.BLACK),
        (style.FREE, style.WHITE),
        (style.UNKNOWN, style.BLACK),
        (style.BLUE, style.PALE_BLUE),
        (style.BETWEEN[0], style.BLACK),
    ]
    for a, b in pairs:
        assert abs(lightness(rgb(a)) - lightness(rgb(b))) > 20, (a, b)


@pytest.mark.parametrize("ramp", [style.BETWEEN, style.NEAR_TO_FAR])
def test_ramps_grow_lighter_all_the_way(ramp):
    steps = [lightness(rgb(colour)) for colour in (style.BLACK, *ramp, style.WHITE)]
    assert (np.diff(steps) > 5).all()


def test_a_real_recording_is_drawn(data, tmp_path):
    motion = read(data / "hdm05" / "squat1Reps" / "HDM_bd_squat1Reps_001_120.amc")
    plots.save(plots.plot_features(compute_features(motion)), tmp_path / "features.png")
    figure = plots.plot_sheet(("squat", motion.generic_positions()), [])
    plots.save(figure, tmp_path / "sheet.svg")
    assert (tmp_path / "features.png").stat().st_size > 10_000
    assert (tmp_path / "sheet.svg").stat().st_size > 10_000


def test_a_sheet_says_times_and_shows_the_strongest_change():
    positions = np.repeat(person(1), 40, axis=0)
    # One hand jumps between two frames that an even choice leaves out.
    positions[18:, GENERIC_JOINTS.index("lwrist"), 1] += 0.4
    times = 2 + np.arange(40) / 20
    figure = plots.plot_sheet(("query", positions, times), [("hit", positions, times)], n_figures=4)
    texts = [text for axes in figure.axes for text in axes.texts]
    said = [text.get_text() for text in texts if text.get_text().endswith(" s")]
    assert said == ["2.00 s", "2.90 s", "3.30 s", "3.95 s"] * 2
    bold = [t.get_text() for t in texts if t.get_weight() == "bold" and t.get_text() in said]
    assert bold == ["2.90 s"] * 2
    with pytest.raises(InvalidInput, match="times need shape"):
        plots.plot_sheet(("query", positions, times[1:]), [])


def test_sheets_of_many_hits_are_pages_at_one_scale(tmp_path):
    wide = person(1) * [1.0, 1.0, 1.5]
    hits = [(f"{i}", person(1) if i < 20 else wide) for i in range(1, 27)]
    pages = plots.plot_sheets(("query", person(1)), hits)
    titles = [page.texts[0].get_text() for page in pages]
    assert [title.split(", ")[1] for title in titles] == ["1 to 12", "13 to 24", "25 to 26"]
    rows = [[text.get_text() for text in page.axes[0].texts] for page in pages]
    assert [row[0] for row in rows] == ["query"] * 3
    assert [name for row in rows for name in row[1:] if name] == [name for name, _ in hits]
    lines = [page.axes[0].lines[0].get_xydata() for page in pages]
    assert np.allclose(np.ptp(lines[0], axis=0), np.ptp(lines[2], axis=0))
    (alone,) = plots.plot_sheets(("query", person(1)), hits[:12])
    assert "to" not in alone.texts[0].get_text().split()
    paths = plots.save_pages(pages[:2], tmp_path / "sheet.svg")
    assert [path.name for path in paths] == ["sheet.svg", "sheet-2.svg"]
    assert all(path.is_file() for path in paths)


def test_distances_have_a_named_axis_and_hits_their_length_and_end():
    hits = {"a": [Label("a", 1.0, 4.0, cost=0.04)]}
    figure = plots.plot_distance({"a": np.linspace(0, 1, 300)}, hits=hits, threshold=0.1)
    (axes,) = figure.axes
    assert axes.get_ylabel() == "distance"
    assert [text.get_text() for text in axes.texts] == ["3.0 s\n0.040"]
    (end,) = [line for line in axes.lines if line.get_marker() == "o"]
    assert np.allclose(end.get_xydata(), [[119.5 / 30, 119 / 299]])
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend[0] == "distance of the best match that ends here"
    assert "its end" in legend


def test_both_views_of_a_first_pose_have_one_scale():
    figure = plots.plot_recordings([synthetic_motion("squat", seed=0)])
    side, front = figure.axes[:2]
    spans = [np.ptp(axes.get_xlim()) for axes in (side, front)]
    assert spans[0] == pytest.approx(spans[1])
