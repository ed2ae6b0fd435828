"""What does the page on recordings that people have labelled say?"""

from typing import Any

#: (recording, label, about which second) -> what it shows.
LOOKED_AT: dict[tuple[str, str, int], str] = {}


def write(results: dict[str, Any]) -> str:
    """Body of the page, from the results alone."""
    return ""
