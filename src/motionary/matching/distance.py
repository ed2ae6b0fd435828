"""How well does a pattern end at each frame of a document?

The distance function of Müller and Röder (2006), eq. 2: masked subsequence DTW with the
steps (1, 1), (1, 2) and (2, 1) in (pattern, document). The pattern may start at any frame;
the value at a frame is the cost of the best path that ends there, divided by the number of
columns; infinite where no path fits.

Conventions: single precision, the same operations in the same order in NumPy and compiled,
so that both give the same bits. Along time the kernels take a chunk and the last two
frames of what came before; a document is one chunk.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.matching._numpy import march, row_costs, unit_costs
from motionary.matching.corpus import Corpus
from motionary.matching.pattern import Pattern
from motionary.words import Words

Engine = Literal["auto", "numpy", "compiled"]
Single = NDArray[np.float32]
Kernel = Callable[..., Any]

#: The authors' programs count the cell after a (2, 1) step twice, for the column left out.
SKIP_WEIGHT = 2.0

#: Below so many cells NumPy ends before a compiled twin is loaded.
COMPILED_PAYS_AT = 20_000_000

_TILE = 8192


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
    words: Words,
    known: Words | None = None,
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
    engine : which twin computes; "auto" takes the compiled one where it pays

    Returns
    -------
    array, shape (frames,), float32; inf where no path fits
    """
    _check(pattern, words, known, skip_weight)
    blocked = np.empty(0, dtype=np.intp)
    return _distance(pattern, words, known, blocked, skip_weight, state, engine)


def corpus_distance(
    pattern: Pattern,
    corpus: Corpus,
    *,
    skip_weight: float = SKIP_WEIGHT,
    engine: Engine = "auto",
) -> Single:
    """Distance function of all documents of a corpus, shape (padded frames,); padding inf."""
    known = None if corpus.all_known else corpus.known
    _check(pattern, corpus.words, known, skip_weight)
    return _distance(pattern, corpus.words, known, corpus.blocked, skip_weight, None, engine)


def _check(pattern: Pattern, words: Words, known: Words | None, skip_weight: float) -> None:
    if words.ndim != 2 or words.shape[1] != pattern.values.shape[1]:
        raise InvalidInput(
            f"the pattern has {pattern.values.shape[1]} integers a frame, the document has "
            f"shape {words.shape}; both must come from one feature set"
        )
    if known is not None and known.shape != words.shape:
        raise InvalidInput(f"known needs the shape of words {words.shape}, got {known.shape}")
    if not skip_weight >= 0:
        raise InvalidInput(f"skip_weight must be at least 0, got {skip_weight}")


def _distance(
    pattern: Pattern,
    words: Words,
    known: Words | None,
    blocked: NDArray[np.intp],
    skip_weight: float,
    state: MatchState | None,
    engine: Engine,
) -> Single:
    state = state or MatchState.fresh(pattern)
    result = np.empty(words.shape[0], dtype=np.float32)
    skip = np.float32(skip_weight)
    plain = pattern.entry_weights is None and known is None and words.shape[1] == 1
    kernel = _compiled_kernel(engine, len(pattern) * len(words)) if plain else None
    costs = row_costs(pattern, words, known)
    for start in range(0, len(words), _TILE):
        stop = min(start + _TILE, len(words))
        inside = blocked[np.searchsorted(blocked, start) : np.searchsorted(blocked, stop)] - start
        out = result[start:stop]
        if kernel is not None:
            scales = unit_costs(pattern)[np.arange(len(pattern)), pattern.n_fixed]
            tile = np.ascontiguousarray(words[start:stop, 0])
            kernel(pattern.values[:, 0], pattern.fixed[:, 0], scales, tile, inside, skip,
                   state.last_two, out)  # fmt: skip
        else:
            march(costs, start, inside, skip, state.last_two, out)
    result /= np.float32(len(pattern))
    return result


def _compiled_kernel(engine: Engine, n_cells: int) -> Kernel | None:
    if engine == "numpy" or (engine == "auto" and n_cells < COMPILED_PAYS_AT):
        return None
    try:
        from motionary.matching._compiled import march_words
    except ImportError:
        if engine == "compiled":
            raise InvalidInput(
                "the compiled engine needs numba; pip install 'motionary[fast]'"
            ) from None
        return None
    return march_words
