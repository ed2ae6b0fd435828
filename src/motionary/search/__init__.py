"""Where in a collection is a motion like this one?"""

from motionary.search.growing import Growing
from motionary.search.results import Hit, SearchResult
from motionary.search.searching import search

__all__ = ["Growing", "Hit", "SearchResult", "search"]
