"""Clips ranked by templates, and the draws of clips that templates are learned from.

A clip's cost is the smallest value of the distance function within it; a clip too short
for a template costs infinity.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.baselines import match_costs
from evidence.common.recordings import ACTORS, Clip, Recordings, clips_packed, of_class
from motionary.errors import InvalidInput
from motionary.evaluation import (
    compute_average_precision,
    compute_rates_at,
    score_classification,
    summarize_rankings,
)
from motionary.features import FeatureSequence
from motionary.matching import (
    SKIP_WEIGHT,
    Corpus,
    Hit,
    Pattern,
    concatenate,
    corpus_distance,
    feature_prior,
    find_hits,
)
from motionary.models.library import TOLERANCE
from motionary.models.templates import MotionTemplate, learn_template, pattern_of, quantise
from motionary.packing import full_mask, unpack

Floats = NDArray[np.float64]

#: Of the publication of 2006.
TAU = 0.06
TOLERANCE_2006 = 0.1


#: Tolerance, and whether what is rare among the examples weighs more (the default).
SETTINGS = {"as published": (TOLERANCE_2006, False), "by surprise": (TOLERANCE, True)}


def corpus_of(sequences: Sequence[FeatureSequence]) -> Corpus:
    """Recordings as one padded sequence."""
    return concatenate(
        [s.packed for s in sequences],
        [s.known for s in sequences],
        full=full_mask(1, len(sequences[0].feature_set))[0],
    )


def templates_of(clips: Sequence[Clip]) -> dict[str, MotionTemplate]:
    """A template of each class, sorted by name."""
    names = sorted({clip.motion_class for clip in clips})
    return {name: template_of(clips_packed(of_class(clips, name))) for name in names}


def template_of(sequences: Sequence[FeatureSequence]) -> MotionTemplate:
    """Template of some examples."""
    first = sequences[0].feature_set
    return learn_template(
        [s.features for s in sequences], feature_names=first.ids, feature_set=first.name
    )


def patterns_of(
    templates: Mapping[str, MotionTemplate], *, tolerance: float, prior: Floats | None = None
) -> dict[str, Pattern]:
    """Patterns; with a prior of the features weighed by self-information."""
    return {
        name: pattern_of(quantise(template, tolerance=tolerance), ones=prior)
        for name, template in templates.items()
    }


def patterns_by_setting(clips: Sequence[Clip]) -> dict[str, dict[str, Pattern]]:
    """Patterns of all classes, learned from clips, by name in `SETTINGS`."""
    templates, ones = (
        templates_of(clips),
        feature_prior(corpus_of(clips_packed(clips)), len(clips[0].packed.feature_set)),
    )
    prior = np.clip(ones, 1e-6, 1 - 1e-6)
    return {
        name: patterns_of(templates, tolerance=tolerance, prior=prior if weighed else None)
        for name, (tolerance, weighed) in SETTINGS.items()
    }


def clip_costs(
    patterns: Mapping[str, Pattern], corpus: Corpus, *, skip_weight: float = SKIP_WEIGHT
) -> Floats:
    """Smallest cost of each pattern in each document, shape (documents, patterns)."""
    columns = []
    for pattern in patterns.values():
        distance = corpus_distance(pattern, corpus, skip_weight=skip_weight)
        columns.append([float(part.min(initial=np.inf)) for part in corpus.split(distance)])
    return np.array(columns).T


def hits_of(
    pattern: Pattern, sequences: Sequence[FeatureSequence], *, threshold: float
) -> list[tuple[int, Hit]]:
    """Hits of a pattern, each with the number of the recording that it lies in."""
    corpus = corpus_of(sequences)
    parts = corpus.split(corpus_distance(pattern, corpus))
    return [
        (i, hit)
        for i, (one, distance) in enumerate(zip(sequences, parts, strict=True))
        for hit in find_hits(distance, pattern, one.packed, one.known, threshold=threshold)
    ]


def summarize(costs: Floats, truth: Sequence[str], names: Sequence[str]) -> dict[str, Any]:
    """Ranking, retrieval at τ, and choice of the cheapest class.

    Precision and recall are means over the classes.
    """
    classes = by_class(costs, truth, names)
    retrieval = summarize_rankings(list(zip(costs.T, _relevant(truth, names), strict=True)))
    return {
        "mean_average_precision": retrieval.average_precision,
        "r_precision": retrieval.r_precision,
        "precision": float(np.mean([row["precision"] for row in classes.values()])),
        "recall": float(np.mean([row["recall"] for row in classes.values()])),
        "right_class": score_classification(costs, truth, names=names).accuracy,
    }


def by_class(
    costs: Floats, truth: Sequence[str], names: Sequence[str]
) -> dict[str, dict[str, float]]:
    """Average precision, and precision and recall at τ, of each class."""
    result = {}
    for name, own, relevant in zip(names, costs.T, _relevant(truth, names), strict=True):
        rates = compute_rates_at(own, relevant, threshold=TAU)
        result[name] = {
            "average_precision": compute_average_precision(own, relevant),
            "precision": rates.precision,
            "recall": rates.recall,
        }
    return result


def mean_f(
    costs: Floats, truth: Sequence[str], names: Sequence[str], *, thresholds: Sequence[float]
) -> Floats:
    """Mean over the classes of F at each threshold, shape (thresholds,)."""
    rankings = list(zip(costs.T, _relevant(truth, names), strict=True))
    scores = [[compute_rates_at(*one, threshold=t).f for one in rankings] for t in thresholds]
    return np.asarray(np.mean(scores, axis=1))


def _relevant(truth: Sequence[str], names: Sequence[str]) -> list[NDArray[np.bool_]]:
    return [np.array([name == label for label in truth]) for name in names]


# -- other costs --------------------------------------------------------------------------


def manhattan_distance(
    template: MotionTemplate, corpus: Corpus, *, skip_weight: float = SKIP_WEIGHT
) -> Floats:
    """Distance function without masks: Manhattan distance of template and frame.

    What Müller and Röder (2006) compare with in figure 7 (a template that is not quantised)
    and table 4 (the features of a single example). A cell costs the mean difference of the
    features times the mean of the column's weight and 1, so that the scale is that of the
    masked cost. Shape (padded frames,).
    """
    frames = unpack(corpus.packed, template.n_features).astype(np.float64)
    # Of a feature that is 0 or 1, |x - y| is x (1 - 2 y) + y.
    costs = (1 - 2 * template.values) @ frames.T + template.values.sum(axis=1, keepdims=True)
    costs *= ((template.weights + 1) / 2 / template.n_features)[:, np.newaxis]
    costs = np.maximum(costs, 0.0)
    costs[:, corpus.blocked] = np.inf
    return match_costs(costs, skip_weight=skip_weight).distance


def whole_costs(patterns: Mapping[str, Pattern], clips: Sequence[FeatureSequence]) -> Floats:
    """Cost of each clip as a whole against each pattern, shape (clips, patterns).

    Classical DTW with boundary conditions: first column meets first frame, last column meets
    last frame, steps (1, 0), (0, 1), (1, 1); the cost of a cell is the masked one of matching.
    The sum along the cheapest path is divided by columns plus frames, so that templates and
    clips of different lengths can be compared.

    Raises
    ------
    InvalidInput
        If some feature of a clip is unknown.
    """
    unseen = [clip.source for clip in clips if not clip.known_features.all()]
    if unseen:
        raise InvalidInput(f"{unseen[0]}: every feature must be known, some are not")
    lengths = np.array([len(clip) for clip in clips])
    frames = np.zeros((len(clips), int(lengths.max()), len(clips[0].feature_set)))
    for i, clip in enumerate(clips):
        frames[i, : len(clip)] = clip.features
    columns = [_accumulate(_cell_costs(p, frames), lengths) for p in patterns.values()]
    return np.array(columns).T


def _cell_costs(pattern: Pattern, frames: Floats) -> Floats:
    """Masked cost of each column in each frame, shape (columns, clips, frames)."""
    n_features = frames.shape[-1]
    fixed = unpack(pattern.fixed, n_features)
    value = unpack(pattern.values, n_features)
    entries = fixed if pattern.entry_weights is None else fixed * pattern.entry_weights
    total = entries.sum(axis=1)
    entries = entries * (pattern.column_weights / np.where(total > 0, total, 1.0))[:, np.newaxis]
    # Wrong is a 1 that is not there, or one that should not be.
    costs = frames @ np.where(value, -entries, entries).T + (entries * value).sum(axis=1)
    return np.moveaxis(costs, -1, 0)


def _accumulate(costs: Floats, lengths: NDArray[np.intp]) -> Floats:
    """Cost of one pattern against all clips: a column over all frames at a time.

    Within a row, D(j) = min over i <= j of entering at i and paying on to j, which is a
    running minimum once the sum of costs is taken off.
    """
    row = np.full(costs.shape[1:], np.inf)
    for k, cost in enumerate(costs):
        total = np.cumsum(cost, axis=1)
        enter = row.copy()
        enter[:, 1:] = np.minimum(enter[:, 1:], row[:, :-1])
        if k == 0:
            enter[:, 0] = 0.0
        row = total + np.minimum.accumulate(enter - (total - cost), axis=1)
    ends = row[np.arange(len(lengths)), lengths - 1]
    return np.asarray(ends / (len(costs) + lengths), dtype=np.float64)


# -- few clips to learn from --------------------------------------------------------------


class Draw(NamedTuple):
    """A few clips of each class to learn from, and others to test on."""

    train: tuple[Clip, ...]
    test: tuple[Clip, ...]


def few(pool: Sequence[Clip], n: int, rng: np.random.Generator) -> tuple[Clip, ...]:
    """`n` clips of each class, fewer where there are not so many, in their order."""
    chosen: list[Clip] = []
    for name in sorted({clip.motion_class for clip in pool}):
        own = of_class(pool, name)
        chosen += [own[i] for i in sorted(rng.permutation(len(own))[:n])]
    return tuple(chosen)


def from_half(recordings: Recordings, n: int, *, repeats: int, seed: int) -> list[Draw]:
    """Of the training half, whoever the actors; the same people are tested on."""
    train, test = recordings.halves()
    return [Draw(few(train, n, _rng(seed, 0, n, i)), test) for i in range(repeats)]


def from_others(recordings: Recordings, n: int, *, repeats: int, seed: int) -> list[Draw]:
    """Of four actors, tested on the fifth; each actor in turn."""
    return [
        Draw(
            few(recordings.of(actors=set(ACTORS) - {actor}), n, _rng(seed, 1, n, i, a)),
            recordings.of(actors=[actor]),
        )
        for a, actor in enumerate(ACTORS)
        for i in range(repeats)
    ]


def from_one(recordings: Recordings, n: int, *, repeats: int, seed: int) -> list[Draw]:
    """Of one actor alone, tested on the other four; each actor in turn."""
    return [
        Draw(
            few(recordings.of(actors=[actor]), n, _rng(seed, 2, n, i, a)),
            recordings.of(actors=set(ACTORS) - {actor}),
        )
        for a, actor in enumerate(ACTORS)
        for i in range(repeats)
    ]


def spread(values: Sequence[float]) -> dict[str, Any]:
    """Mean, standard deviation and extremes of repetitions."""
    array = np.array(values)
    return {
        "mean": array.mean(),
        "deviation": array.std(ddof=1) if len(array) > 1 else 0.0,
        "least": array.min(),
        "most": array.max(),
        "repetitions": len(array),
    }


def _rng(seed: int, *more: int) -> np.random.Generator:
    return np.random.default_rng([seed, *more])
