"""How is what a search has grown kept, to be changed and used again?"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from motionary.errors import InvalidInput

if TYPE_CHECKING:
    from motionary.features import FeatureSet
    from motionary.models.keyframes import KeyframeQuery
    from motionary.models.templates import MotionTemplate
    from motionary.retrieval.index import Collection
    from motionary.retrieval.search import QueryExpansion, SearchResult


#: Shares of the frames that keyframes may leave: in a small collection of a few classes,
#: a class is not rare.
_MAY_BE_LEFT = (0.12, 0.25, 0.5, 1.0)


def derive(
    templates: "Sequence[MotionTemplate]", collection: "Collection"
) -> "tuple[KeyframeQuery, ...]":
    """Keyframes that templates suggest.

    Raises
    ------
    InvalidInput
        If there are none.
    """
    from motionary.retrieval.search import Deriving, derive_queries

    for fraction in _MAY_BE_LEFT:
        deriving = Deriving(frames_left=fraction)
        derived = [derive_queries(template, collection, deriving) for template in templates]
        if any(derived):
            return tuple(query for queries in derived for query in queries)
    raise InvalidInput("nothing in the template is rare enough to be a keyframe")


def save_queries(
    queries: "Sequence[KeyframeQuery]", path: str, *, feature_set: "FeatureSet"
) -> None:
    """Write keyframes as text."""
    from motionary.io.text import write_text
    from motionary.models.keyframes import format_queries

    write_text(path, format_queries(queries, vocabulary=feature_set))


def save_class(
    result: "SearchResult",
    folder: str,
    collection: "Collection",
    *,
    name: str,
    expansion: "QueryExpansion",
) -> None:
    """Add what an example has grown to a library, in place of a class of that name.

    It is found at the same costs as here, and around the same keyframes if there were any.
    """
    from motionary.models.library import ClassLibrary, MotionClass, Prototype, load_library

    library = ClassLibrary((), collection.feature_set)
    if (Path(folder) / "library.toml").exists():
        library = load_library(folder)
    fractions = collection.feature_prior if expansion.by_self_information else ()
    expanded = MotionClass(
        name,
        (Prototype(name, result.templates[0], result.queries),),
        tolerance=expansion.tolerance,
        background=tuple(float(fraction) for fraction in fractions),
    )
    others = tuple(one for one in library if one.name != name)
    replace(library, classes=(*others, expanded)).save(folder)
