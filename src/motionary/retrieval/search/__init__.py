"""Search in a collection by example, class, template or keyframes."""

from motionary.retrieval.search.keyframes import Deriving, derive_queries
from motionary.retrieval.search.ranking import Hit, SearchResult
from motionary.retrieval.search.searching import QueryExpansion, RelevanceFeedback, search

__all__ = [
    "Deriving",
    "Hit",
    "QueryExpansion",
    "RelevanceFeedback",
    "SearchResult",
    "derive_queries",
    "search",
]
