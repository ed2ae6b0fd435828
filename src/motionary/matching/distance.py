"""How well does a pattern end at each frame of a document?

The distance function of Müller and Röder (2006), eq. 2: masked subsequence DTW with the
steps (1, 1), (1, 2) and (2, 1) in (pattern, document). The pattern may start at any frame;
the value at a frame is the cost of the best path that ends there, divided by the number of
columns; infinite where no path fits.

Conventions: single precision, the same operations in the same order in NumPy and compiled,
so that both give the same bits. Along time the kernels take a chunk and the last two
frames of what came before; a document is one chunk.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.matching._numpy import march, prepare, row_costs
from motionary.matching.corpus import Corpus
from motionary.matching.pattern import Pattern, check_document, check_skip_weight
from motionary.packing import PackedFeatures

Engine = Literal["auto", "numpy", "compiled"]
Single = NDArray[np.float32]
Kernel = Callable[..., Any]

#: The authors' programs count the cell after a (2, 1) step twice, for the column left out.
SKIP_WEIGHT = 2.0

#: From so many cells on the compiled twin is worth the half second that loading it takes:
#: NumPy needs 30 ms for them, and a pattern seldom comes alone.
COMPILED_PAYS_AT = 20_000_000

_COMPILED = "motionary.matching._compiled"


@dataclass(slots=True, eq=False)
class MatchState:
    """What a stream remembers between chunks: the last two frames of every column."""

    last_two: Single

    @classmethod
    def fresh(cls, pattern: Pattern) -> "MatchState":
        """State at the beginning of a document."""
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
    """Cost of the best match that ends at each frame of one document.

    Parameters
    ----------
    pattern : Pattern
    words : array, shape (frames, n_words), uint64
    known : array of the same shape: which relations are known; all if left out
    skip_weight : how often the cell after a (2, 1) step counts
    state : for chunks of a stream; is updated
    engine : which twin computes; "auto" takes the compiled one where it pays. Patterns
        with entry weights or several integers a frame have no compiled twin.

    Returns
    -------
    array, shape (frames,), float32; inf where no path fits

    Raises
    ------
    InvalidInput
        If pattern, document and state do not fit, or the compiled twin is not installed.
    """
    check_document(pattern, packed, known)
    blocked = np.empty(0, dtype=np.intp)
    state = state or MatchState.fresh(pattern)
    if state.last_two.shape != (len(pattern), 2):
        raise InvalidInput(
            f"a pattern of {len(pattern)} columns needs its own state, got one for "
            f"{len(state.last_two)}; see MatchState.fresh"
        )
    return _distance(pattern, packed, known, blocked, skip_weight, state, engine)


def corpus_distance(
    pattern: Pattern,
    corpus: Corpus,
    *,
    skip_weight: float = SKIP_WEIGHT,
    engine: Engine = "auto",
) -> Single:
    """Distance function of all documents of a corpus, shape (padded frames,); padding inf."""
    packed, known = corpus.packed, corpus.known
    check_document(pattern, packed, known)
    state = MatchState.fresh(pattern)
    return _distance(pattern, packed, known, corpus.blocked, skip_weight, state, engine)


def _distance(
    pattern: Pattern,
    packed: PackedFeatures,
    known: PackedFeatures | None,
    blocked: NDArray[np.intp],
    skip_weight: float,
    state: MatchState,
    engine: Engine,
) -> Single:
    check_skip_weight(skip_weight)
    again = np.float32(skip_weight - 1)
    if known is not None and pattern.fully_seen(known):
        known = None
    result = np.empty(len(packed), dtype=np.float32)
    kernel = _compiled_kernel(engine, len(pattern) * len(packed))
    if kernel is None or pattern.entry_weights is not None or packed.shape[1] > 1:
        march(row_costs(pattern, packed, known), blocked, again, state.last_two, result)
    else:
        # Kernels are compiled per kind of array: one kind keeps users from waiting again.
        word = np.require(packed[:, 0], requirements=["C", "W"])
        mask = None if known is None else np.require(known[:, 0], requirements=["C", "W"])
        kernel(prepare(pattern), word, mask, blocked, again, state.last_two, result)
    result /= np.float32(len(pattern))
    return result


def _compiled_kernel(engine: Engine, n_cells: int) -> Kernel | None:
    pays = n_cells >= COMPILED_PAYS_AT or _COMPILED in sys.modules
    if engine == "numpy" or (engine == "auto" and not pays):
        return None
    try:
        from motionary.matching._compiled import march_packed
    except ImportError:
        if engine == "compiled":
            raise InvalidInput(
                "the compiled engine needs numba; pip install 'motionary[fast]'"
            ) from None
        return None
    kernel: Kernel = march_packed
    return kernel
