"""How labels are assigned by scores, as a table of `library.toml`."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from motionary.errors import InvalidInput
from motionary.models.library.scoring import Scoring
from motionary.models.library.toml_tables import Keys, check_keys, refuse, refuse_value

_KEYS: Keys = {"corpus": list, "threshold": float, "look_ahead_s": float}


def describe_scoring(scoring: Scoring | None) -> dict[str, Any]:
    """The table of a library; empty without scores."""
    if scoring is None:
        return {}
    content = {key: value for key, value in asdict(scoring).items() if value is not None}
    return content | {"corpus": list(scoring.corpus)}


def read_scoring(path: Path, index: Mapping[str, Any]) -> Scoring | None:
    """What a library says of scores; None in one from before there were any.

    Raises
    ------
    UnreadableFile
        If the table is not what it should be.
    """
    if "scoring" not in index:
        return None
    content = index["scoring"]
    keys = dict(_KEYS)
    if isinstance(content, dict) and "false_slope" in content:
        keys["false_slope"] = float
    check_keys(path, content, keys, place=("scoring",))
    if not all(isinstance(x, int | float) for x in content["corpus"]):
        raise refuse(path, ("scoring", "corpus"), "must be a list of numbers")
    try:
        return Scoring(**{key: content[key] for key in keys})
    except InvalidInput as error:
        raise refuse_value(path, ("scoring",), error) from error
