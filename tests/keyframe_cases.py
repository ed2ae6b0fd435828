"""Random queries and documents, as lists for the oracles and packed for the package."""

from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from motionary.features import FULL_BODY, FeatureSequence
from motionary.models.keyframes import Gap, KeyframeQuery, PostingIndex, index_packed
from motionary.models.templates import MotionTemplate, learn_template
from motionary.packing import PackedFeatures, pack

SET = "a stream of yes and no"


class Case(NamedTuple):
    """A query and documents, as arrays of 0/1 with one column per feature."""

    values: np.ndarray
    fixed: np.ndarray
    gaps: list
    documents: list
    known: list

    @property
    def query(self) -> KeyframeQuery:
        ids = ids_of(self.values.shape[1])
        gaps = tuple(Gap(*gap) for gap in self.gaps)
        return KeyframeQuery(pack(self.values), pack(self.fixed), gaps, SET, ids)

    @property
    def keyframes(self) -> list:
        return list(zip(self.values, self.fixed, strict=True))

    @property
    def packed(self) -> list[PackedFeatures]:
        return [pack(document) for document in self.documents]

    @property
    def masks(self) -> list[PackedFeatures]:
        return [pack(mask) for mask in self.known]

    @property
    def index(self) -> PostingIndex:
        ids = ids_of(self.values.shape[1])
        return index_packed(self.packed, self.masks, feature_set=SET, feature_ids=ids)


def ids_of(n_features: int) -> tuple[str, ...]:
    return tuple(f"X{i + 1}" for i in range(n_features))


@st.composite
def cases(draw):
    """Few features and short documents, so that hits are common and can all be tried."""
    n_features = draw(st.sampled_from([1, 2, 3, 66]))
    n_keyframes = draw(st.integers(1, 4))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    gaps = []
    for _ in range(n_keyframes - 1):
        least = draw(st.sampled_from([0, 0, 0, 1, 2, 4]))
        width = draw(st.sampled_from([0, 0, 1, 3, None]))
        gaps.append((least, None if width is None else least + width))
    documents, known = [], []
    for _ in range(draw(st.integers(1, 3))):
        shape = (draw(st.integers(0, 10)), n_features)
        documents.append(rng.random(shape) < draw(st.sampled_from([0.3, 0.5, 0.8])))
        known.append(rng.random(shape) < draw(st.sampled_from([0.8, 1.0])))
    fixed = rng.random((n_keyframes, n_features)) < (0.7 if n_features < 10 else 0.02)
    values = (rng.random(fixed.shape) < 0.6) & fixed
    return Case(values, fixed, gaps, [d & k for d, k in zip(documents, known, strict=True)], known)


def streams(seed, *, lengths, n_features=12, flip=0.1):
    """Documents whose features keep for some frames, as those of recordings do."""
    rng = np.random.default_rng(seed)
    return [np.cumsum(rng.random((n, n_features)) < flip, axis=0) % 2 == 1 for n in lengths]


def query_of_streams(seed, *, n_features=12, n_keyframes=3, gaps=((0, 9), (2, 40))) -> Case:
    rng = np.random.default_rng(seed)
    fixed = rng.random((n_keyframes, n_features)) < 0.3
    values = rng.random(fixed.shape) < 0.5
    for k, gap in enumerate(gaps):
        if gap == (0, 0):
            values[k + 1] = values[k]
    return Case(values & fixed, fixed, list(gaps), [], [])


def query_for(values, fixed, gaps=(), positions=None) -> KeyframeQuery:
    gaps = tuple(Gap(*gap) for gap in gaps)
    ids = ids_of(np.shape(values)[1])
    return KeyframeQuery(pack(values), pack(fixed), gaps, SET, ids, positions)


def sequence_of(features, known=None) -> FeatureSequence:
    """Full-body features of a recording, all known unless given."""
    features = np.asarray(features, dtype=bool)
    known = np.ones_like(features) if known is None else np.asarray(known, dtype=bool)
    return FeatureSequence(pack(features & known), pack(known), FULL_BODY)


def learned_template(examples) -> MotionTemplate:
    return learn_template(
        [example.features for example in examples],
        feature_names=FULL_BODY.ids, feature_set=FULL_BODY.name,
    )  # fmt: skip
