"""Which relation is meant by a name?

People write phrases ("right hand fast") or ids ("F13"), in any case and spacing.
"""

import difflib

from motionary.errors import InvalidInput
from motionary.features.feature_set import FeatureSet

_MOST_HINTS = 3


def find_feature(name: str, feature_set: FeatureSet) -> int:
    """Number of a relation by its id or its phrase.

    Raises
    ------
    InvalidInput
        If the set has none of that name, or several; says which come nearest.
    """
    wanted = _even(name)
    for known in (feature_set.ids, feature_set.names):
        places = [i for i, other in enumerate(known) if _even(other) == wanted]
        if len(places) > 1:
            ids = ", ".join(feature_set.ids[i] for i in places)
            raise InvalidInput(f"{name!r} may be each of {ids}; write the id")
        if places:
            return places[0]
    raise InvalidInput(f"{feature_set.name} has no relation {name!r}; {_hint(wanted, feature_set)}")


def _hint(wanted: str, feature_set: FeatureSet) -> str:
    """The names that come nearest: by their letters, else by their words."""
    names = {_even(name): name for name in feature_set.names}
    near = difflib.get_close_matches(wanted, names, n=_MOST_HINTS, cutoff=0.6)
    if not near:
        packed = set(wanted.split())
        shared = {name: len(packed & set(name.split())) for name in names}
        near = [name for name in sorted(names, key=lambda n: -shared[n]) if shared[name]]
    if near:
        return "did you mean " + " or ".join(repr(names[n]) for n in near[:_MOST_HINTS]) + "?"
    return f"it has {', '.join(feature_set.names)}"


def _even(name: str) -> str:
    return " ".join(name.split()).casefold()
