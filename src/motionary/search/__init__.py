"""Where in a collection is a motion like this one?"""

from motionary.search.deriving import Deriving, derive_queries
from motionary.search.growing import Growing, Judged
from motionary.search.results import Hit, SearchResult
from motionary.search.searching import search

__all__ = ["Deriving", "Growing", "Hit", "Judged", "SearchResult", "derive_queries", "search"]
