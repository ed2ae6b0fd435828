"""Search in a collection by example, class, template or keyframes."""

from motionary.retrieval.search.expansion import QueryExpansion, RelevanceFeedback
from motionary.retrieval.search.keyframes import Deriving, derive_queries, suggest_queries
from motionary.retrieval.search.ranking import Hit, SearchResult, cut_frames
from motionary.retrieval.search.searching import class_of_result, search
from motionary.retrieval.search.similar import WindowSettings

__all__ = [
    "Deriving",
    "Hit",
    "QueryExpansion",
    "RelevanceFeedback",
    "SearchResult",
    "WindowSettings",
    "class_of_result",
    "cut_frames",
    "derive_queries",
    "search",
    "suggest_queries",
]
