"""What do several examples of one class of motion have in common?

Motion templates are learned after Müller and Röder (2006), section 4.1: every example in
turn is the reference to which all others are warped; the averages, brought back to real
time, are the examples of the next pass, until they agree. The template is what the first
example has become.

Where the paper is silent (ties, contraction, stop rule), the authors' published code
decides.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.models.templates.alignment import Engine, Floats, align_all, align_batched
from motionary.models.templates.averaging import Stack, average, unwarp
from motionary.models.templates.template import MotionTemplate, check_values

EngineName = Literal["auto", "numpy", "compiled"]

#: Pairs of columns in one pass (48 examples of 74 columns) above which loading numba costs
#: less time than it saves.
WORTH_LOADING = 6_000_000


@dataclass(frozen=True, slots=True)
class Learning:
    """Settings of learning; defaults of the authors' published code.

    Attributes
    ----------
    stop : float
        Learning ends after a pass whose dearest alignment cost at most this much per
        column, in relations.
    max_passes : int
        It ends after so many passes in any case.
    contract_at : float
        Columns are merged until they weigh this much.
    """

    stop: float = 0.005
    max_passes: int = 10
    contract_at: float = 0.75

    def __post_init__(self) -> None:
        if not self.stop >= 0.0:
            raise InvalidInput(f"stop needs to be at least 0, got {self.stop}")
        if self.max_passes < 1:
            raise InvalidInput(f"max_passes needs to be at least 1, got {self.max_passes}")
        if not 0.0 < self.contract_at <= 1.0:
            raise InvalidInput(f"contract_at needs to lie in (0, 1], got {self.contract_at}")


def learn_template(
    matrices: Sequence[ArrayLike],
    *,
    feature_names: Sequence[str],
    feature_set: str,
    provenance: str = "",
    known: Sequence[ArrayLike] | None = None,
    learning: Learning | None = None,
    engine: EngineName = "auto",
) -> MotionTemplate:
    """Template of a class of motion from its examples.

    A single example is its own template.

    Parameters
    ----------
    matrices : sequence of arrays, shape (frames, features), in [0, 1], at 30 Hz
        One per example; the first one's timing is where the template starts from.
    feature_names, feature_set, provenance : as in `MotionTemplate`
    known : sequence of bool arrays of the same shapes, optional
        False where an entry was not seen. Such entries leave the averages; when examples
        are aligned they count as 0.5, half a disagreement with either value. A cell that no
        example knows becomes 0.5, which quantising leaves free.
    learning : Learning, optional
    engine : "auto", "numpy" or "compiled"
        The compiled engine needs the extra `fast`; results are equal to the bit. "auto"
        takes it where it is installed and the work outweighs the time to load it.

    Raises
    ------
    InvalidInput
        If there is no example, if examples disagree in their features or with `known`, or
        if values lie outside [0, 1].
    """
    settings = learning or Learning()
    examples = _check_examples(matrices)
    n_features = examples[0].shape[1]
    columns = examples
    unmeasured: tuple[str, ...] = ()
    if known is not None:
        columns = _with_fractions(examples, known)
        never = ~np.concatenate(columns)[:, n_features:].any(axis=0)
        unmeasured = tuple(np.array(feature_names)[never].tolist())
    offsets = np.cumsum([0] + [len(example) for example in examples]).astype(np.intp)
    stack = Stack(np.concatenate(columns), np.ones(offsets[-1]), offsets)
    stack = repeat_passes(stack, n_features, settings, _choose_engine(engine, stack))
    end = stack.offsets[1]
    return MotionTemplate(
        values=_values(stack.columns[:end], n_features),
        weights=stack.weights[:end],
        feature_names=tuple(feature_names),
        feature_set=feature_set,
        provenance=provenance,
        n_examples=len(examples),
        unmeasured=unmeasured,
    )


def repeat_passes(stack: Stack, n_features: int, settings: Learning, engine: Engine) -> Stack:
    """Stack after passes until they agree, cost the same twice, or are `max_passes`."""
    mean_weight = stack.mean_weight
    cost_before = np.inf
    for _ in range(settings.max_passes):
        stack, cost = learn_pass(
            stack, n_features=n_features, contract_at=settings.contract_at, engine=engine
        )
        if cost / mean_weight <= settings.stop or cost == cost_before:
            break
        cost_before = cost
    return stack


def learn_pass(
    stack: Stack, *, n_features: int, contract_at: float, engine: Engine
) -> tuple[Stack, float]:
    """One pass: every example as reference of all others, averaged and unwarped.

    Parameters
    ----------
    stack : Stack
        Its columns hold the values, shape (n, features); or, where entries are unknown,
        values times the share known and next to them that share, (n, 2 * features).
    n_features : number of features
    contract_at : weight up to which columns are merged
    engine : `align_batched` or `align_compiled`

    Returns
    -------
    stack : Stack of the next pass
    cost : cost of the dearest alignment
    """
    values = _values(stack.columns, n_features)
    alignment = align_all(values, stack.weights, stack.offsets, engine=engine)
    averaged = average(stack, alignment)
    return unwarp(averaged, contract_at=contract_at), alignment.largest_cost


def _values(columns: Floats, n_features: int) -> Floats:
    """Values of columns that may carry the share known beside them."""
    if columns.shape[1] == n_features:
        return columns
    weighted, fraction = columns[:, :n_features], columns[:, n_features:]
    values = np.full(weighted.shape, 0.5)
    np.divide(weighted, fraction, out=values, where=fraction > 0.0)
    return values


def _check_examples(matrices: Sequence[ArrayLike]) -> list[Floats]:
    if len(matrices) == 0:
        raise InvalidInput("learning needs at least one example, got none")
    examples = [check_values(matrix) for matrix in matrices]
    widths = sorted({example.shape[1] for example in examples})
    if len(widths) > 1:
        raise InvalidInput(
            f"examples need the same features, got examples of {widths} features; "
            "compute all of them with one feature set"
        )
    return examples


def _with_fractions(examples: list[Floats], known: Sequence[ArrayLike]) -> list[Floats]:
    masks: list[NDArray[np.bool_]] = [np.asarray(mask, dtype=np.bool_) for mask in known]
    shapes = [example.shape for example in examples]
    if [mask.shape for mask in masks] != shapes:
        raise InvalidInput(
            f"known needs one mask per example, of shapes {shapes}, "
            f"got {[mask.shape for mask in masks]}"
        )
    return [
        np.concatenate([example * mask, mask], axis=1)
        for example, mask in zip(examples, masks, strict=True)
    ]


def _choose_engine(name: EngineName, stack: Stack) -> Engine:
    if name not in ("auto", "numpy", "compiled"):
        raise InvalidInput(f"engine needs to be 'auto', 'numpy' or 'compiled', got {name!r}")
    loaded = sys.modules.get("numba") is not None
    if name == "numpy" or (name == "auto" and not loaded and _count_cells(stack) < WORTH_LOADING):
        return align_batched
    try:
        from motionary.models.templates.compiled import align_compiled
    except ImportError as error:
        if name == "auto":
            return align_batched
        raise InvalidInput(
            f"the compiled engine needs numba ({error}); "
            "pip install 'motionary[fast]', or take engine='numpy'"
        ) from error
    return align_compiled


def _count_cells(stack: Stack) -> int:
    """Pairs of columns of different examples, in any order."""
    lengths = np.diff(stack.offsets)
    return int(lengths.sum() ** 2 - (lengths**2).sum()) // 2
