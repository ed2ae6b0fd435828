"""Which relations are lost where a body is kept in place?"""

from motionary.features import quantities
from motionary.features.feature_set import Feature


def needs_travel(feature: Feature) -> bool:
    """Whether a relation asks how fast a joint moves through the room.

    Of the 40 these are F25, F26 and F39, and F13 and F14: a hand that is fast because its body
    walks is slow on the spot.
    """
    return feature.quantity is quantities.speed
