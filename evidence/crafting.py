"""Templates edited: two classes joined into one, and a class designed by hand.

Figure 5 and the sweeping of section 5.4 of Müller and Röder (2006).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from evidence.common.drawing import BETWEEN, house_style
from evidence.common.ranking import TOLERANCE_2006, hits_of, template_of
from evidence.common.recordings import Clip, Recordings, Results, clips_packed, of_class
from motionary.features import FeatureSequence, compute_features
from motionary.models.templates import MotionTemplate, pattern_of, quantise, template_from_text
from motionary.samples import Proportions, pose_figure
from motionary.samples.phrases import curves, end_of, parse_phrases, vary

TITLE = "Classes joined and designed, beside figure 5 of 2006"
SPLIT = (
    "templates are learned from the authors' training half, the evaluation half is searched; the "
    "designed class needs no examples"
)
SEED = 4
DATA = (
    "clips",
    (
        "searched for sweeping: {cmu}; uncut takes of HDM05",
        lambda r: [one for name, one in r.others.items() if not name.startswith("bandai")],
    ),
    ("searched for sweeping: {bandai}", "bandai"),
    ("synthetic sweeps, planted", lambda _: _sweeps()),
)

THRESHOLDS = (0.01, 0.02, 0.04, 0.06, 0.08, 0.1)
BACKWARD, FORWARD = "rotateArmsBothBackward1Reps", "the same clips played backwards"
DEPOSIT, GRAB = "depositFloorR", "grabHighR"
UPPER = 14

#: As designed in 2006: "an MT of length 50, setting all matrix entries to 0.5 except for
#: the rows corresponding to F13, F32 and F33, which were set to one".
SWEEPING = """
features: full-body-40
for 1.67 s: right hand fast, spine horizontal, right hand low
"""
#: A synthetic sweep: bent over, the right hand runs in flat ovals near the floor.
SWEEP = """
    0.0-0.8 s: root pitch 55, hips 75, knees 20, spine 40, right shoulder 95
    0.8-1.1 s: right shoulder 55
    0.95-1.25 s: right shoulder aside 40
    1.1-1.4 s: right shoulder 110
    1.25-1.55 s: right shoulder aside 0
    1.4-1.7 s: right shoulder 55
    1.55-1.85 s: right shoulder aside 40
    1.7-2.0 s: right shoulder 110
    1.85-2.15 s: right shoulder aside 0
    2.0-2.3 s: right shoulder 55
    2.15-2.45 s: right shoulder aside 40
    2.3-2.6 s: right shoulder 110
    2.45-2.75 s: right shoulder aside 0
    2.8-3.6 s: root pitch 0, hips 0, knees 0, spine 0, right shoulder 0
"""
N_SWEEPS = 10
SHOWN = 20


def measure(recordings: Recordings) -> Results:
    """Both joins, and the sweeping."""
    train, test = recordings.halves()
    return {
        "thresholds": THRESHOLDS,
        "rotate": _join_rotations(recordings, train, test),
        "grab": _join(
            {name: clips_packed(of_class(train, name)) for name in (DEPOSIT, GRAB)},
            {clip.name: (clip.motion_class, clip.packed) for clip in test},
        ),
        "sweeping": _sweep(recordings.others),
    }


def _join_rotations(recordings: Recordings, train: Sequence[Clip], test: Sequence[Clip]) -> Results:
    """Rotating backwards, and forwards: the same clips with time reversed."""
    learned = {
        BACKWARD: clips_packed(of_class(train, BACKWARD)),
        FORWARD: _reversed(recordings, train),
    }
    searched = {clip.name: (clip.motion_class, clip.packed) for clip in test}
    for packed in _reversed(recordings, test):
        searched[f"{packed.source} reversed"] = (FORWARD, packed)
    return _join(learned, searched)


def _reversed(recordings: Recordings, clips: Sequence[Clip]) -> list[FeatureSequence]:
    motions = [recordings.motion(clip.name) for clip in of_class(clips, BACKWARD)]
    return [compute_features(replace(one, positions=one.positions[::-1].copy())) for one in motions]


def _join(
    learned: Mapping[str, Sequence[FeatureSequence]],
    searched: Mapping[str, tuple[str, FeatureSequence]],
) -> Results:
    """Hits of each class's template and of one learned from both, as published."""
    templates = {name: template_of(examples) for name, examples in learned.items()}
    templates["joined"] = template_of([e for examples in learned.values() for e in examples])
    truth = [name for name, _ in searched.values()]
    sequences = [packed for _, packed in searched.values()]
    rows = {}
    for name, template in templates.items():
        quantised = quantise(template, tolerance=TOLERANCE_2006)
        hits = hits_of(pattern_of(quantised), sequences, threshold=THRESHOLDS[-1])
        found = [[i for i, hit in hits if hit.cost <= tau] for tau in THRESHOLDS]
        rows[name] = {
            "template_length": template.n_columns,
            "fixed": quantised.n_fixed / quantised.fixed.size,
            "hits": [len(one) for one in found],
            "of": {
                label: [len({i for i in one if truth[i] == label}) for one in found]
                for label in learned
            },
            "upper": np.asarray(template.values)[:, :UPPER].tolist(),
        }
    return {"templates": rows, "clips": {name: truth.count(name) for name in learned}}


def _sweep(others: Mapping[str, FeatureSequence]) -> Results:
    """Ranked hits of the designed template in all other recordings and synthetic sweeps."""
    template = template_from_text(SWEEPING, name="sweeping with a hand brush")
    _check_design(template)
    pattern = pattern_of(quantise(template, tolerance=TOLERANCE_2006))
    searched = dict(others) | {f"synthetic sweep {i}": one for i, one in enumerate(_sweeps())}
    names = list(searched)
    hits = [
        (hit.cost, names[i], hit.start / 30, hit.stop / 30)
        for i, hit in hits_of(pattern, list(searched.values()), threshold=1.0)
    ]
    ranked = sorted(hits)[:SHOWN]
    first: dict[str, float] = {}
    for cost, name, *_ in sorted(hits):
        if name.startswith("synthetic"):
            first.setdefault(name, cost)
    bent = searched[max(first, key=lambda name: first[name])]
    elsewhere = [cost for cost, name, *_ in hits if not name.startswith("synthetic")]
    return {
        "columns": template.n_columns,
        "planted": N_SWEEPS,
        "found_among_first": len({n for _, n, *_ in ranked[:N_SWEEPS] if "synthetic" in n}),
        "dearest_sweep": max(first.values()),
        "dearest_spine_horizontal": float(
            bent.features[:, bent.feature_set.ids.index("F32")].mean()
        ),
        "cheapest_elsewhere": min(elsewhere),
        "cheaper_than_all_else": sum(c < min(elsewhere) for c in first.values()),
        "first": [
            {"recording": name, "cost": cost, "start_s": start, "end_s": end}
            for cost, name, start, end in ranked
        ],
        "minutes": sum(len(packed) for packed in searched.values()) / 30 / 60,
    }


def _check_design(template: MotionTemplate) -> None:
    """The text says what was designed in 2006: 50 columns, three rows of ones."""
    designed = np.full(template.values.shape, 0.5)
    designed[:, [template.feature_names.index(name) for name in ("F13", "F32", "F33")]] = 1.0
    if template.n_columns != 50 or not np.array_equal(template.values, designed):
        raise SystemExit("the text of the sweeping does not give the template of 2006")


def _sweeps() -> list[FeatureSequence]:
    rng = np.random.default_rng(SEED)
    result = []
    for i in range(N_SWEEPS):
        phrases = vary(parse_phrases(SWEEP), rng, tempo=0.12, amplitude=0.08)
        times = np.arange(int(end_of(phrases) * 120) + 1) / 120
        size = float(np.exp(rng.normal(0, 0.05)))
        figure = pose_figure(
            curves(phrases, times), Proportions(size=size), rate_hz=120.0,
            source=f"synthetic sweep {i}",
        )  # fmt: skip
        result.append(compute_features(figure))
    return result


@house_style()
def draw(results: Results) -> dict[str, Any]:
    """Figure 5: the upper features of three templates."""
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.figure import Figure

    rows = results["rotate"]["templates"]
    colours = LinearSegmentedColormap.from_list("fraction", ["black", *BETWEEN, "white"])
    figure = Figure(figsize=(8.4, 2.5), layout="constrained")
    titles = ["backwards", "forwards (played backwards)", "joined"]
    for axes, title, row in zip(figure.subplots(1, 3), titles, rows.values(), strict=True):
        values = np.array(row["upper"]).T
        n_columns = row["template_length"]
        image = axes.imshow(
            values, aspect="auto", interpolation="nearest", cmap=colours, vmin=0, vmax=1,
            extent=(0, n_columns / 30, UPPER + 0.5, 0.5),
        )  # fmt: skip
        axes.set_title(title, loc="left", pad=3)
        axes.set_xlabel("seconds")
        axes.set_yticks(range(1, UPPER + 1), labels=[f"F{i}" for i in range(1, UPPER + 1)])
        axes.tick_params(axis="y", length=0, labelsize=6)
    bar = figure.colorbar(image, ax=figure.axes, shrink=0.8, pad=0.01)
    bar.set_label("fraction of the examples")
    return {"crafting": figure}
