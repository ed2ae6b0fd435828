"""Keyframe queries: a few poses with elastic gaps, found in hours of motion."""

from motionary.models.keyframes.building import (
    Vocabulary,
    from_features,
    from_patterns,
    from_template,
    join_queries,
    mirror_query,
)
from motionary.models.keyframes.choosing import Choice, choose_keyframes
from motionary.models.keyframes.choosing_query import ChoiceSettings, ChosenQuery, choose_query
from motionary.models.keyframes.fitting import FittedHits, fit_hits
from motionary.models.keyframes.query import (
    Gap,
    KeyframeQuery,
    Spring,
    check_features,
    gap_of,
    gap_of_seconds,
    spring_of,
)
from motionary.models.keyframes.ranges import (
    HitRange,
    HitRanges,
    agree,
    check_votes,
    extend,
    margins,
)
from motionary.models.keyframes.ranking import columns_of_query, template_of_query
from motionary.models.keyframes.search import search_packed, search_query
from motionary.models.keyframes.selecting import select_in_index, select_in_sequence
from motionary.models.keyframes.single import single_hits
from motionary.models.keyframes.text import (
    format_queries,
    format_query,
    parse_queries,
    parse_query,
)
from motionary.models.keyframes.word_index import PostingIndex, index_packed

__all__ = [
    "Choice",
    "ChoiceSettings",
    "ChosenQuery",
    "FittedHits",
    "Gap",
    "HitRange",
    "HitRanges",
    "KeyframeQuery",
    "PostingIndex",
    "Spring",
    "Vocabulary",
    "agree",
    "check_features",
    "check_votes",
    "choose_keyframes",
    "choose_query",
    "columns_of_query",
    "extend",
    "fit_hits",
    "format_queries",
    "format_query",
    "from_features",
    "from_patterns",
    "from_template",
    "gap_of",
    "gap_of_seconds",
    "index_packed",
    "join_queries",
    "margins",
    "mirror_query",
    "parse_queries",
    "parse_query",
    "search_packed",
    "search_query",
    "select_in_index",
    "select_in_sequence",
    "single_hits",
    "spring_of",
    "template_of_query",
]
