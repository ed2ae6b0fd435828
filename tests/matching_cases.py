"""Random patterns and documents, as lists for the oracles and as words for the package."""

from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from motionary.matching import Pattern
from motionary.packing import PackedFeatures, pack
from oracles import matching as oracle

FREE = UNKNOWN = None


class Case(NamedTuple):
    """A pattern and a document; see `oracles.matching` for what the lists mean."""

    columns: list
    weights: list
    entries: list | None
    frames: list
    n_features: int
    skip_weight: float

    @property
    def pattern(self) -> Pattern:
        values, fixed = words_and_mask(self.columns, self.n_features)
        entries = None if self.entries is None else np.array(self.entries)
        return Pattern(values, fixed, np.array(self.weights), entries)

    @property
    def packed(self) -> PackedFeatures:
        return words_and_mask(self.frames, self.n_features)[0]

    @property
    def known(self) -> PackedFeatures:
        return words_and_mask(self.frames, self.n_features)[1]

    def oracle_costs(self) -> list:
        """Rows of cell costs, as fractions."""
        entries = self.entries or [None] * len(self.columns)
        return [
            [oracle.cell_cost(column, frame, weight=w, entries=e) for frame in self.frames]
            for column, w, e in zip(self.columns, self.weights, entries, strict=True)
        ]

    def oracle_matches(self) -> list:
        """Cost and path of the best match at each frame."""
        if not self.frames:
            return []
        return oracle.best_matches(self.oracle_costs(), skip_weight=self.skip_weight)


def words_and_mask(rows: list, n_features: int) -> tuple[PackedFeatures, PackedFeatures]:
    """Words of rows of 0, 1 and None, and the mask of what is not None."""
    table = np.array(rows, dtype=object).reshape(len(rows), n_features)
    return pack(table == 1), pack(table != None)  # noqa: E711


def random_rows(rng, n, n_features, *, share_none, share_empty=0.0):
    """Rows of 0, 1 and None; some of nothing but None."""
    table = rng.integers(0, 2, (n, n_features)).astype(object)
    table[rng.random((n, n_features)) < share_none] = None
    table[rng.random(n) < share_empty] = None
    return table.tolist()


@st.composite
def cases(draw, *, most_frames=26, unknown=None, weighed=None, n_features=None):
    """Small cases in which ties, free columns and unknown stretches are common."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n_columns, n_frames = draw(st.integers(1, 7)), draw(st.integers(0, most_frames))
    n = draw(st.sampled_from(n_features or [1, 2, 5, 40, 64, 65, 130]))
    free, blind = draw(st.sampled_from([0, 0.3, 0.8, 1])), draw(st.sampled_from([0, 0.2, 0.6]))
    weighed = draw(st.booleans()) if weighed is None else weighed
    return Case(
        columns=random_rows(rng, n_columns, n, share_none=free, share_empty=0.1),
        weights=rng.choice([0.5, 0.75, 1, 1.25, 2], n_columns).tolist(),
        entries=rng.choice([0, 0.5, 1, 2], (n_columns, n)).tolist() if weighed else None,
        frames=random_rows(
            rng, n_frames, n, share_none=0 if unknown is False else blind,
            share_empty=0 if unknown is False else draw(st.sampled_from([0, 0.3])),
        ),
        n_features=n,
        skip_weight=draw(st.sampled_from([2, 1, 0, 1.5])),
    )  # fmt: skip


def same_bits(a, b) -> bool:
    """Whether two arrays are equal to the bit."""
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
