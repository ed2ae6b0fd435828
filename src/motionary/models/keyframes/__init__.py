"""Keyframe queries: a few poses with elastic gaps, found in hours of motion.

All but queries themselves is imported when it is first used (PEP 562).
"""

from typing import TYPE_CHECKING

from motionary.lazy import lazy_names
from motionary.models.keyframes.query import (
    Gap,
    KeyframeQuery,
    Spring,
    check_features,
    columns_of_query,
    from_template,
    gap_of,
    gap_of_seconds,
    join_queries,
    mirror_query,
    spring_of,
    template_of_query,
)

if TYPE_CHECKING:
    from motionary.models.keyframes.choosing import (
        Choice,
        ChoiceSettings,
        ChosenQuery,
        choose_keyframes,
        choose_query,
    )
    from motionary.models.keyframes.index import (
        HitRange,
        HitRanges,
        PostingIndex,
        agree,
        check_votes,
        extend,
        index_packed,
        margins,
    )
    from motionary.models.keyframes.search import (
        FittedHits,
        fit_hits,
        search_packed,
        search_query,
        select_in_index,
        select_in_sequence,
        single_hits,
    )
    from motionary.models.keyframes.text import (
        Vocabulary,
        format_queries,
        format_query,
        from_features,
        from_patterns,
        parse_queries,
        parse_query,
    )

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

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "choosing": "Choice ChoiceSettings ChosenQuery choose_keyframes choose_query",
        "index": "HitRange HitRanges PostingIndex agree check_votes extend index_packed margins",
        "search": (
            "FittedHits fit_hits search_packed search_query select_in_index select_in_sequence "
            "single_hits"
        ),
        "text": (
            "Vocabulary format_queries format_query from_features from_patterns parse_queries "
            "parse_query"
        ),
    },
)
