"""How is a set of relations written down, so that another program has the same?

A relation is data but for its quantity; quantities of this package go by their names.

Conventions: rows of strings, numbers and lists, as TOML and JSON have them.
"""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

from motionary.errors import InvalidInput
from motionary.features import quantities
from motionary.features.feature_set import Feature, FeatureSet

_FIELDS = tuple(field.name for field in fields(Feature))
#: Later than the first files; left out where a feature has none.
_OPTIONAL = ("no",)
_KINDS: dict[str, tuple[type, ...]] = {
    "joints": (list,),
    "weak": (int, float, list),
    "strong": (int, float, list),
    "window_s": (int, float),
}
_TESTS = (">", ">=", "<", "<=", "within")


def describe_set(feature_set: FeatureSet) -> list[dict[str, Any]] | None:
    """Rows that `set_from_rows` reads; None if a quantity is not of this package."""
    named = {function: name for name, function in _quantities().items()}
    if any(feature.quantity not in named for feature in feature_set.features):
        return None
    rows = []
    for feature in feature_set.features:
        row = {name: getattr(feature, name) for name in _FIELDS}
        row = {key: v for key, v in row.items() if v or key not in _OPTIONAL}
        row |= {key: list(v) for key, v in row.items() if isinstance(v, tuple)}
        rows.append(row | {"quantity": named[feature.quantity]})
    return rows


def set_from_rows(name: str, rows: Sequence[Mapping[str, Any]]) -> FeatureSet:
    """Set of relations that rows describe.

    Raises
    ------
    InvalidInput
        If a row lacks something or says something impossible; names relation and field.
    """
    return FeatureSet(name, tuple(_feature(i, row) for i, row in enumerate(rows)))


def _feature(number: int, row: Mapping[str, Any]) -> Feature:
    where = f"relation {row.get('id', number + 1)!r}"
    missing = [name for name in _FIELDS if name not in row and name not in _OPTIONAL]
    if missing:
        raise InvalidInput(f"{where}: {missing[0]} is missing")
    values = {name: row[name] for name in _FIELDS if name in row}
    for name, value in values.items():
        if not isinstance(value, _KINDS.get(name, (str,))) or isinstance(value, bool):
            raise InvalidInput(f"{where}: {name} has no meaning as {value!r}")
    known = _quantities()
    if values["quantity"] not in known:
        raise InvalidInput(
            f"{where}: no quantity {values['quantity']!r}; known: {', '.join(known)}"
        )
    if values["test"] not in _TESTS:
        raise InvalidInput(f"{where}: test must be one of {', '.join(_TESTS)}")
    values["quantity"] = known[values["quantity"]]
    values["joints"] = tuple(values["joints"])
    for name in ("weak", "strong"):
        values[name] = _threshold(where, name, values[name])
    _check_joints(where, values["quantity"], values["joints"])
    return Feature(**values)


def _threshold(where: str, name: str, value: Any) -> float | tuple[float, float]:
    if not isinstance(value, list):
        return float(value)
    if len(value) != 2 or not all(isinstance(v, int | float) for v in value):
        raise InvalidInput(f"{where}: {name} must be a number, or a pair [least, most]")
    return float(value[0]), float(value[1])


def _check_joints(where: str, quantity: Any, joints: tuple[Any, ...]) -> None:
    try:
        inspect.signature(quantity).bind(None, 0.0, *joints)
    except TypeError as error:
        raise InvalidInput(f"{where}: its quantity takes other joints ({error})") from error


def _quantities() -> dict[str, Any]:
    """Quantities of the package by name: public functions of a body."""
    return {
        name: function
        for name, function in vars(quantities).items()
        if inspect.isfunction(function)
        and function.__module__ == quantities.__name__
        and not name.startswith("_")
    }
