"""Which relations are lost where a body is kept in place?"""

from motionary.features import quantities
from motionary.features.relations import Relation

# What carries the body, or is carried by it alone, through the room.
_CARRIERS = frozenset({"root", "lankle", "rankle", "ltoes", "rtoes"})


def needs_travel(relation: Relation) -> bool:
    """Whether a relation asks how fast the root or a foot moves through the room."""
    return relation.quantity is quantities.speed and _CARRIERS.issuperset(relation.joints)
