"""How far are generated motions from real ones, and how much do they differ?

FID_g and Dist_g of dance generation (Li, Yang, Ross and Kanazawa, 2021), as the code that
is widespread since computes them: the features of both sets are first normalised by mean
and standard deviation (of the population) of the *real* set. FID is the Fréchet distance
of two normal distributions, covariances with n - 1; diversity the mean Euclidean distance
of all pairs of a set. Neither has a unit, and numbers compare only between sets that were
normalised by the same real one.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.generation_metrics.features import Mode

Floats = NDArray[np.float64]

# What the widespread code adds to each deviation.
_FLOOR = 1e-10


def frechet_distance(generated: ArrayLike, real: ArrayLike, *, mode: Mode = "corrected") -> float:
    """FID_g: Fréchet distance between two sets of motions, normalised by the real one.

    With fewer motions than features the covariances are singular: the distance is defined
    but depends on the number of motions, so compare sets of one size only.

    Parameters
    ----------
    generated, real : arrays, shape (motions, features), from `motion_features`
        At least two motions each.
    mode : "published" divides by deviation + 1e-10, so that a relation that no real motion
        varies decides everything as soon as a generated one does; "corrected" leaves such
        a relation as it is, a share, and leaves out relations that are unknown (NaN) in
        any motion

    Raises
    ------
    InvalidInput
        If the sets do not fit together, are too small, or have no known feature in common.
    """
    first, second = _normalised(generated, real, mode)
    difference = first.mean(axis=0) - second.mean(axis=0)
    one, two = np.cov(first, rowvar=False), np.cov(second, rowvar=False)
    one, two = np.atleast_2d(one), np.atleast_2d(two)
    spread = np.trace(one) + np.trace(two) - 2 * _trace_of_root(one, two)
    # Rounding may leave a hair below zero for equal sets.
    return float(max(difference @ difference + spread, 0.0))


def diversity(
    generated: ArrayLike, real: ArrayLike | None = None, *, mode: Mode = "corrected"
) -> float:
    """Dist_g: mean distance of all pairs of motions of a set.

    Parameters
    ----------
    generated : array, shape (motions, features), at least two motions
    real : array, shape (motions, features)
        What normalises; the set itself if left out.
    mode : as in `frechet_distance`

    Raises
    ------
    InvalidInput
        As in `frechet_distance`.
    """
    features, _ = _normalised(generated, generated if real is None else real, mode)
    n = len(features)
    total = sum(
        float(np.linalg.norm(features[i + 1 :] - features[i], axis=1).sum()) for i in range(n - 1)
    )
    return total / (n * (n - 1) / 2)


def _normalised(generated: ArrayLike, real: ArrayLike, mode: Mode) -> tuple[Floats, Floats]:
    ours, theirs = (np.asarray(one, dtype=np.float64) for one in (generated, real))
    for name, one in (("generated", ours), ("real", theirs)):
        if one.ndim != 2 or len(one) < 2 or one.shape[1:] != theirs.shape[1:]:
            raise InvalidInput(
                "sets need shape (motions, features), the same features and at least two "
                f"motions, got {name} of shape {one.shape} beside {theirs.shape}"
            )
    known = np.isfinite(ours).all(axis=0) & np.isfinite(theirs).all(axis=0)
    if mode == "published" and not known.all():
        raise InvalidInput("published features are never NaN or infinite; use mode='corrected'")
    if mode not in ("published", "corrected"):
        raise InvalidInput(f"mode must be 'published' or 'corrected', got {mode!r}")
    if not known.any():
        raise InvalidInput("no feature is known in every motion; leave motions out, or look at NaN")
    ours, theirs = ours[:, known], theirs[:, known]
    mean, scale = theirs.mean(axis=0), theirs.std(axis=0)
    scale = scale + _FLOOR if mode == "published" else np.where(scale > _FLOOR, scale, 1.0)
    return (ours - mean) / scale, (theirs - mean) / scale


def _trace_of_root(one: Floats, two: Floats) -> float:
    """Trace of the square root of a product of covariances, also of singular ones."""
    values, vectors = np.linalg.eigh(one)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    inner = np.linalg.eigvalsh(root @ two @ root)
    return float(np.sqrt(np.maximum(inner, 0.0)).sum())
