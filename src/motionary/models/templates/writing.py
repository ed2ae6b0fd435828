"""How are the fixed cells of a template put into words?

Writes the language of `motionary.models.templates.text`: few stretches one after the other, many
by the time from the beginning, relation by relation, so that 60 columns stay readable.

Conventions: states of cells are 1, 0 and -1 for free, shape (columns, features).
"""

import re

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import FeatureSet
from motionary.models.templates.parsing import ANYTHING, FREE, States
from motionary.models.templates.segments import find_segments, show_seconds

_FEW_STRETCHES = 4
_LINE_WIDTH = 96
# Would be read as something else.
_MISLEADING = re.compile(rf"[,:#]|^not |^{ANYTHING}$|^$")


def write_states(states: States, feature_set: FeatureSet) -> list[str]:
    """Lines that `parse_states` reads back to the same states."""
    phrases = _phrases(feature_set)
    if len(find_segments(states)) <= _FEW_STRETCHES:
        return _write_in_turn(states, phrases)
    return _write_by_time(states, phrases)


def _phrases(feature_set: FeatureSet) -> list[str]:
    """What each relation is called: its name where that reads back, else its id."""
    names = [" ".join(name.split()).casefold() for name in feature_set.names]
    ids = [id_.casefold() for id_ in feature_set.ids]
    phrases = []
    for feature, name, id_ in zip(feature_set.features, names, ids, strict=True):
        readable = names.count(name) == 1 and name not in ids and not _MISLEADING.search(name)
        if not readable and (_MISLEADING.search(id_) or ids.count(id_) > 1):
            raise InvalidInput(
                f"relation {feature.id!r} of {feature_set.name!r} has no name that reads back; "
                "give it an id of letters and digits"
            )
        phrases.append(feature.name if readable else feature.id)
    return phrases


def _write_in_turn(states: States, phrases: list[str]) -> list[str]:
    lines = []
    for start, stop in find_segments(states):
        said = [_said(phrases[i], states[start, i]) for i in np.flatnonzero(states[start] != FREE)]
        lines += _fold(f"for {show_seconds(stop - start)} s", said or [ANYTHING])
    return lines


def _write_by_time(states: States, phrases: list[str]) -> list[str]:
    """Each run of each relation, those of the same time together, in the order of time."""
    runs: dict[tuple[int, int], list[str]] = {}
    for i, phrase in enumerate(phrases):
        for start, stop in find_segments(states[:, i]):
            if states[start, i] != FREE:
                runs.setdefault((start, stop), []).append(_said(phrase, states[start, i]))
    lines = [f"lasts {show_seconds(len(states))} s"]
    lines += _fold("throughout", runs.pop((0, len(states)), []))
    for start, stop in sorted(runs):
        lines += _fold(f"from {show_seconds(start)} to {show_seconds(stop)} s", runs[start, stop])
    return lines


def _said(phrase: str, state: np.int8) -> str:
    return phrase if state == 1 else f"not {phrase}"


def _fold(head: str, phrases: list[str]) -> list[str]:
    """A line of phrases, folded at its commas; nothing for none."""
    lines: list[str] = []
    for i, phrase in enumerate(phrases):
        comma = "," if i < len(phrases) - 1 else ""
        if i == 0:
            lines.append(f"{head}: {phrase}{comma}")
        elif len(lines[-1]) + len(phrase) + 2 > _LINE_WIDTH:
            lines.append(f"    {phrase}{comma}")
        else:
            lines[-1] += f" {phrase}{comma}"
    return lines
