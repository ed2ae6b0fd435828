"""The distance function: how cheaply a pattern can end at each frame of a sequence.

The distance function of Müller and Röder (2006), eq. 2: masked subsequence DTW with the
steps (1, 1), (1, 2) and (2, 1) in (pattern, sequence). The pattern may start at any frame;
the value at a frame is the cost of the best path that ends there, divided by the number of
columns; infinite where no path fits.

Conventions: single precision, the same operations in the same order in NumPy and compiled,
so that both give the same bits. Along time the kernels take a chunk and the last two
frames of what came before; a sequence is one chunk.
"""

import importlib
import sys
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.matching._numpy import (
    Steps,
    WeighedColumns,
    march,
    prepare,
    prepare_weighed,
    row_costs,
)
from motionary.matching.corpus import Corpus
from motionary.matching.pattern import Pattern, check_sequence, check_skip_weight
from motionary.packing import PackedFeatures

Engine = Literal["auto", "numpy", "compiled"]
Single = NDArray[np.float32]

#: The authors' programs count the cell after a (2, 1) step twice, for the column left out.
SKIP_WEIGHT = 2.0

#: From so many cells on the compiled twin is worth the half second that loading it takes:
#: NumPy needs 30 ms for them, and a pattern seldom comes alone.
COMPILED_PAYS_AT = 20_000_000

_COMPILED = "motionary.matching._compiled"


@dataclass(slots=True, eq=False)
class MatchState:
    """State of a stream between chunks: the last two frames of every column."""

    last_two: Single

    @classmethod
    def fresh(cls, pattern: Pattern) -> "MatchState":
        """State at the beginning of a sequence."""
        return cls(np.full((len(pattern), 2), np.inf, dtype=np.float32))


def distance_function(
    pattern: Pattern,
    packed: PackedFeatures,
    known: PackedFeatures | None = None,
    *,
    skip_weight: float = SKIP_WEIGHT,
    state: MatchState | None = None,
    engine: Engine = "auto",
) -> Single:
    """Cost of the best match that ends at each frame of one sequence.

    Parameters
    ----------
    pattern : Pattern
    packed : array, shape (frames, n_integers), uint64
    known : array of the same shape: which features are known; all if left out
    skip_weight : how often the cell after a (2, 1) step counts
    state : for chunks of a stream; is updated
    engine : which twin computes; "auto" takes the compiled one where it pays

    Returns
    -------
    array, shape (frames,), float32; inf where no path fits

    Raises
    ------
    InvalidInput
        If pattern, sequence and state do not fit, or the compiled twin is not installed.
    """
    check_sequence(pattern, packed, known)
    blocked = np.empty(0, dtype=np.intp)
    state = state or MatchState.fresh(pattern)
    if state.last_two.shape != (len(pattern), 2):
        raise InvalidInput(
            f"a pattern of {len(pattern)} columns needs its own state, got one for "
            f"{len(state.last_two)}; see MatchState.fresh"
        )
    return march_pattern(pattern, packed, known, blocked, skip_weight, state, engine)


def corpus_distance(
    pattern: Pattern,
    corpus: Corpus,
    *,
    skip_weight: float = SKIP_WEIGHT,
    engine: Engine = "auto",
) -> Single:
    """Distance function of all sequences of a corpus, shape (padded frames,); padding inf."""
    packed, known = corpus.packed, corpus.known
    check_sequence(pattern, packed, known)
    state = MatchState.fresh(pattern)
    return march_pattern(pattern, packed, known, corpus.blocked, skip_weight, state, engine)


def march_pattern(
    pattern: Pattern,
    packed: PackedFeatures,
    known: PackedFeatures | None,
    blocked: NDArray[np.intp],
    skip_weight: float,
    state: MatchState,
    engine: Engine,
    steps: Steps | None = None,
) -> Single:
    """Distance function without checks; `steps` as in `_numpy.march`."""
    check_skip_weight(skip_weight)
    again = np.float32(skip_weight - 1)
    if known is not None and pattern.fully_seen(known):
        known = None
    result = np.empty(len(packed), dtype=np.float32)
    is_weighed = pattern.entry_weights is not None or packed.shape[1] > 1
    columns = prepare_weighed(pattern) if is_weighed else prepare(pattern)
    pays = len(pattern) * len(packed) >= COMPILED_PAYS_AT
    kernels = load_twin(_COMPILED, engine, pays=pays)
    if kernels is None:
        march(row_costs(columns, packed, known), blocked, again, state.last_two, result, steps)
    else:
        # Kernels are compiled per kind of array: one kind keeps users from waiting again.
        packed = np.require(packed, requirements=["C", "W"])
        mask = None if known is None else np.require(known, requirements=["C", "W"])
        if isinstance(columns, WeighedColumns):
            mask = ~np.zeros((1, packed.shape[1]), np.uint64) if mask is None else mask
            kernels.march_weighed(
                columns, packed, mask, blocked, again, state.last_two, result, steps
            )
        else:
            mask = None if mask is None else mask[:, 0]
            kernels.march_packed(
                columns, packed[:, 0], mask, blocked, again, state.last_two, result, steps
            )
    result /= np.float32(len(pattern))
    return result


def load_twin(module: str, engine: Engine, *, pays: bool) -> Any:
    """A module of compiled kernels where it is asked for, or pays and can be loaded; else None.

    Parameters
    ----------
    module : its full name; numba is loaded with it
    engine : "auto" takes it where it is loaded already, or `pays` loading

    Raises
    ------
    InvalidInput
        If there is no such engine, or the compiled one is asked for and not installed.
    """
    if engine not in ("auto", "numpy", "compiled"):
        raise InvalidInput(f"engine needs to be 'auto', 'numpy' or 'compiled', got {engine!r}")
    if engine == "numpy" or (engine == "auto" and not pays and module not in sys.modules):
        return None
    try:
        return importlib.import_module(module)
    except ImportError as error:
        if engine == "auto":
            return None
        raise InvalidInput(
            f"the compiled engine needs numba ({error}); "
            "pip install 'motionary[fast]', or take engine='numpy'"
        ) from error
