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
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.matching._numpy import (
    Columns,
    Steps,
    WeighedColumns,
    march,
    prepare,
    prepare_weighed,
    row_costs,
    stack,
)
from motionary.matching.corpus import Corpus
from motionary.matching.pattern import SKIP_WEIGHT, Pattern, check_sequence, check_skip_weight
from motionary.packing import PackedFeatures

Engine = Literal["auto", "numpy", "compiled"]
Single = NDArray[np.float32]

#: From so many cells on the compiled twin is worth the half second that loading it takes:
#: NumPy needs 30 ms for them, and a pattern seldom comes alone.
COMPILED_PAYS_AT = 20_000_000

# Frames times patterns that are matched together, in NumPy: as many as fit into a tile.
_ABREAST_CELLS = 32768
COMPILED = "motionary.matching._compiled"


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


class Abreast(NamedTuple):
    """Patterns that are matched together.

    Attributes
    ----------
    patterns : each is one of `longest`, or its first columns
    longest : by length, the longest first
    places : index into `longest` for each pattern
    """

    patterns: tuple[Pattern, ...]
    longest: tuple[Pattern, ...]
    places: tuple[int, ...]

    def n_cells(self, n_frames: int) -> int:
        """Cells of the longest pattern times the patterns that are marched."""
        return len(self.longest[0]) * len(self.longest) * n_frames


def alone(pattern: Pattern) -> Abreast:
    """A pattern that is matched by itself."""
    return Abreast((pattern,), (pattern,), (0,))


def plan_abreast(
    patterns: Sequence[Pattern], *, n_frames: int
) -> list[tuple[tuple[int, ...], Abreast]]:
    """Indices of patterns that are best matched together, with them; each index once.

    A class of several cycles often holds that of one: its first columns serve both.
    """
    heads = _find_longest(patterns)
    members: dict[int, list[int]] = {head: [] for head in heads}
    for i, head in enumerate(heads):
        members[head].append(i)
    by_length = sorted(members, key=lambda head: -len(patterns[head]))
    is_plain = [_is_plain(patterns[head]) for head in by_length]
    most = max(1, _ABREAST_CELLS // max(n_frames, 1))
    plain = [head for head, fits in zip(by_length, is_plain, strict=True) if fits]
    blocks = [plain[i : i + most] for i in range(0, len(plain), most)]
    blocks += [[head] for head, fits in zip(by_length, is_plain, strict=True) if not fits]
    planned = []
    for block in blocks:
        indices = tuple(i for head in block for i in members[head])
        places = tuple(place for place, head in enumerate(block) for _ in members[head])
        longest = tuple(patterns[head] for head in block)
        planned.append((indices, Abreast(tuple(patterns[i] for i in indices), longest, places)))
    return planned


def _is_plain(pattern: Pattern) -> bool:
    """Whether a pattern has one integer a column and no entry weights."""
    return pattern.entry_weights is None and pattern.values.shape[1] == 1


def _find_longest(patterns: Sequence[Pattern]) -> list[int]:
    """Index of the longest pattern that begins with the columns of each; or its own."""
    heads = list(range(len(patterns)))
    # In this order a pattern that begins another stands right before one that it begins.
    columns = {
        i: np.column_stack(
            [one.values[:, 0], one.fixed[:, 0], one.column_weights.view(np.uint64)]
        ).astype(">u8").tobytes()
        for i, one in enumerate(patterns)
        if _is_plain(one)
    }  # fmt: skip
    order = sorted(columns, key=lambda i: columns[i], reverse=True)
    for longer, shorter in pairwise(order):
        if columns[longer].startswith(columns[shorter]):
            heads[shorter] = heads[longer]
    return heads


def march_abreast(
    patterns: Abreast,
    packed: PackedFeatures,
    known: PackedFeatures | None,
    engine: Engine,
    steps: Steps,
) -> Single:
    """Distance functions, shape (patterns, frames), with the steps into all cells.

    These are of shape (columns, longest patterns, frames).
    """
    blocked = np.empty(0, dtype=np.intp)
    if len(patterns.patterns) == 1:
        (pattern,) = patterns.patterns
        state = MatchState.fresh(pattern)
        distance = march_pattern(
            pattern, packed, known, blocked, SKIP_WEIGHT, state, engine, steps[:, 0]
        )
        return distance[np.newaxis]
    if known is not None and all(one.fully_seen(known) for one in patterns.longest):
        known = None
    lengths = np.array([len(one) for one in patterns.longest])
    ends: dict[int, list[tuple[int, int]]] = {}
    for i, (pattern, place) in enumerate(zip(patterns.patterns, patterns.places, strict=True)):
        ends.setdefault(len(pattern) - 1, []).append((i, place))
    result = np.empty((len(patterns.patterns), len(packed)), dtype=np.float32)
    march(
        row_costs(stack([prepare(one) for one in patterns.longest]), packed, known),
        ends,
        (lengths > np.arange(lengths[0])[:, np.newaxis]).sum(axis=1),
        blocked,
        np.float32(SKIP_WEIGHT - 1),
        np.full((lengths[0], len(lengths), 2), np.inf, dtype=np.float32),
        result,
        steps,
    )
    result /= np.array([[len(one)] for one in patterns.patterns], dtype=np.float32)
    return result


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
    columns = prepare(pattern) if _is_plain(pattern) else prepare_weighed(pattern)
    pays = len(pattern) * len(packed) >= COMPILED_PAYS_AT
    kernels = load_twin(COMPILED, engine, pays=pays)
    if kernels is None:
        if isinstance(columns, Columns):
            columns = stack([columns])
        march(
            row_costs(columns, packed, known),
            {len(pattern) - 1: ((0, 0),)},
            np.ones(len(pattern), dtype=np.intp),
            blocked,
            again,
            state.last_two[:, np.newaxis],
            result[np.newaxis],
            None if steps is None else steps[:, np.newaxis],
        )
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
