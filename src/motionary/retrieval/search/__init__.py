"""Where in a collection is a motion like this one?"""

from motionary.retrieval.search.deriving import Deriving, derive_queries
from motionary.retrieval.search.expansion import QueryExpansion, RelevanceFeedback
from motionary.retrieval.search.results import Hit, SearchResult
from motionary.retrieval.search.searching import search

__all__ = [
    "Deriving",
    "Hit",
    "QueryExpansion",
    "RelevanceFeedback",
    "SearchResult",
    "derive_queries",
    "search",
]
