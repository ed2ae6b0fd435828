"""Arguments of the wrong kind: what was expected, what came, what to do."""

import numpy as np
import pytest

from motionary import ClassLibrary, annotate, compute_features
from motionary.errors import InvalidInput, WrongKind
from motionary.retrieval.index import collect
from motionary.retrieval.search import search
from motionary.samples import synthetic_motion

MOTION = synthetic_motion("squat", seed=0)
LIBRARY = ClassLibrary(())


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: annotate([MOTION, MOTION], LIBRARY), "recording must be Motion or FeatureS.*list"),
        (lambda: annotate("take.bvh", LIBRARY), r"got str; read files first.*read\(path\)"),
        (lambda: annotate(LIBRARY, MOTION), "got ClassLibrary"),
        (lambda: annotate(MOTION, "library"), r"library must be ClassLibrary, got str.*\.load"),
        (lambda: MOTION.cut(1.5, 3.5), r"first must be int.*got float; for seconds.*rate_hz"),
        (lambda: MOTION.cut(1, 3.5), "stop must be int"),
        (
            lambda: search(np.zeros((9, 3)), [MOTION]),
            r"query must be an example.*Motion .*got ndarray",
        ),
        (lambda: search("take.bvh", [MOTION]), r"got str; read files first"),
        (lambda: search([MOTION, "x"], [MOTION]), r"query must be .*got str"),
        (lambda: collect(MOTION), r"recordings must be str or Path or Iterable, got Motion"),
        (lambda: collect(np.zeros((9, 3))), r"a recording must be .*got ndarray; give a folder"),
        (lambda: collect([LIBRARY]), "got ClassLibrary"),
    ],
)
def test_the_wrong_kind_is_told(call, words):
    with pytest.raises(WrongKind, match=words) as told:
        call()
    assert isinstance(told.value, TypeError)
    assert isinstance(told.value, InvalidInput)
    assert "\n" not in str(told.value)


def test_whole_numbers_of_numpy_are_numbers():
    assert MOTION.cut(np.int64(1), np.int32(9)).n_frames == 8
    assert len(collect([compute_features(MOTION), MOTION])) == 2
