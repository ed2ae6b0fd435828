"""Does the search find what the published one finds?

On the eleven HDM05 classes: templates of the authors' training halves on their evaluation
halves (`half_split.json`), and single examples as queries against the clips of all other
actors (`example_queries.json`). The expected numbers come from a plain prototype that was
written apart from this package; they are to be met or bettered.
"""

import json
from functools import cache
from statistics import fmean

import numpy as np
import pytest

from motionary.evaluation.ranking import (
    compute_rates_at,
    score_classification,
    summarize_rankings,
)
from motionary.features import FULL_BODY, FULL_BODY_2006, FeatureSequence
from motionary.matching import Pattern, concatenate, corpus_distance
from motionary.models.templates import learn_template, quantise
from motionary.packing import full_mask, pack
from motionary.retrieval.index import Collection
from motionary.retrieval.search import QueryExpansion, search

WITHIN = 0.01
N = len(FULL_BODY_2006)


@pytest.fixture(scope="module")
def clips(hdm05) -> dict[str, FeatureSequence]:
    """Features of all clips, by name."""
    return {name: sequence.renamed(name) for name, sequence in hdm05.items()}


def class_of(name):
    return name.split("_")[2]


def actor_of(name):
    return name.split("_")[1]


def corpus_of(packed, *, n_features):
    known = [full_mask(len(w), n_features) for w in packed]
    return concatenate(packed, known, full=full_mask(1, n_features)[0])


# -- templates of the authors' halves --------------------------------------------------


@pytest.fixture(scope="module")
def halves(golden):
    return json.loads((golden / "half_split.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def patterns(clips, halves):
    """Templates of the training halves at tolerance .1; columns weigh the same."""
    patterns = {}
    for name, half in halves.items():
        template = learn_template(
            [clips[clip].features[:, :N] for clip in half["train"]],
            feature_names=FULL_BODY_2006.ids,
            feature_set=FULL_BODY_2006.name,
        )
        quantised = quantise(template, tolerance=0.1)
        weights = np.ones(quantised.n_columns)
        patterns[name] = Pattern(quantised.packed_values, quantised.packed_fixed, weights)
    return patterns


@pytest.fixture(scope="module")
def costs_of_halves(clips, halves, patterns):
    """Smallest cost of each class in each clip of the evaluation halves, and the truth."""
    names = [clip for half in halves.values() for clip in half["test"]]
    corpus = corpus_of([pack(clips[name].features[:, :N]) for name in names], n_features=N)

    def compute(skip_weight):
        rows = [
            [d.min() for d in corpus.split(corpus_distance(p, corpus, skip_weight=skip_weight))]
            for p in patterns.values()
        ]
        return np.array(rows, dtype=np.float64)

    return cache(compute), [class_of(name) for name in names]


@pytest.mark.parametrize(
    ("skip_weight", "average_precision", "precision", "recall", "right"),
    [(1, 0.974, 0.65, 0.98, 0.951), (2, 0.992, 0.93, 0.93, 0.986)],
)
def test_templates_of_the_authors_halves(
    costs_of_halves, patterns, skip_weight, average_precision, precision, recall, right
):
    compute, truth = costs_of_halves
    assert len(truth) == 142
    costs, names = compute(skip_weight), list(patterns)
    relevant = [np.array([t == name for t in truth]) for name in names]
    found = summarize_rankings(zip(costs, relevant, strict=True))
    rates = [
        compute_rates_at(row, wanted, threshold=0.06)
        for row, wanted in zip(costs, relevant, strict=True)
    ]
    assert found.average_precision >= average_precision - WITHIN
    assert fmean(rate.precision for rate in rates) >= precision - WITHIN
    assert fmean(rate.recall for rate in rates) >= recall - WITHIN
    accuracy = score_classification(costs.T, truth, names=names).accuracy
    assert accuracy >= right - WITHIN


# -- one example as query --------------------------------------------------------------


@pytest.fixture(scope="module")
def example_queries(golden, clips):
    """An example, the clips of the other actors, and their words in one piece."""
    names = json.loads((golden / "example_queries.json").read_text(encoding="utf-8"))
    assert len(names) == 33
    others = {}
    for actor in {actor_of(name) for name in names}:
        sequences = [s for name, s in clips.items() if actor_of(name) != actor]
        corpus = corpus_of([s.packed for s in sequences], n_features=len(FULL_BODY))
        others[actor] = Collection(tuple(sequences)), corpus
    return [(clips[name], *others[actor_of(name)]) for name in names]


def smallest_costs(example, collection, corpus, expansion):
    """Cost of the best hit of each clip.

    The best hit tells what the search looked for; ranking every clip's further hits too
    takes minutes and changes no clip's first one (the next test).
    """
    pattern = search(example, collection, limit=1, expansion=expansion)[0].evidence.pattern
    return np.array([d.min() for d in corpus.split(corpus_distance(pattern, corpus))])


def relevance(example, collection):
    wanted = class_of(example.source)
    return np.array([class_of(s.source) == wanted for s in collection.sequences])


def test_without_limit_every_clip_is_ranked_by_its_smallest_cost(example_queries):
    example, collection, corpus = example_queries[10]
    result = search(example, collection, limit=None)
    best: dict[str, float] = {}
    for hit in result:
        best.setdefault(hit.recording.name, hit.cost)
    found = [best.get(s.source, np.inf) for s in collection.sequences]
    np.testing.assert_allclose(found, smallest_costs(example, collection, corpus, None), rtol=1e-5)


@pytest.mark.parametrize(
    ("expansion", "average_precision", "r_precision"),
    [
        pytest.param(
            QueryExpansion(hits=0, by_self_information=False), 0.887, 0.835, id="as it is"
        ),
        pytest.param(
            QueryExpansion(hits=3, reach=np.inf, by_self_information=False),
            0.951,
            0.908,
            id="grown by 3",
        ),
        pytest.param(QueryExpansion(hits=0), 0.898, 0.852, id="by surprise"),
        pytest.param(None, 0.97, 0.935, id="default"),
    ],
)
def test_one_example_as_query(example_queries, expansion, average_precision, r_precision):
    found = summarize_rankings(
        (smallest_costs(example, clips, corpus, expansion), relevance(example, clips))
        for example, clips, corpus in example_queries
    )
    assert found.queries == 33
    assert found.average_precision >= average_precision
    assert found.r_precision >= r_precision
