"""What recordings of the test sets show, in names of the library that ships.

Written down before the library was first run on them as it ships. Of files of ACCAD the
table of contents says what they show; what a file's name says besides (a walk into a
crouch) may be labelled as well, and is not asked for. Names of the truth of 2009 are
coarser than the library's.
"""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

#: Contents of ACCAD that the library has classes for.
ACCAD: Mapping[str, tuple[str, ...]] = {
    "walk": ("walk",),
    "run / jog": ("run",),
    "walk backwards": ("walk backwards",),
    "run backwards": ("run backwards",),
    "side step left": ("side step",),
    "side step right": ("side step",),
    "skip": ("skip",),
    "crawl": ("crawl",),
    "pick up from the floor": ("pick up", "put down"),
    "put down on the floor": ("pick up", "put down"),
    "lie down": ("lie down",),
    "lying": ("lie",),
    "get up from lying (to crouch)": ("get up",),
    "jump / leap": ("jump",),
    "hop (one leg)": ("hop",),
    "turn around (180)": ("turn around",),
    "crouch down": ("crouch", "squat"),
    "rise from crouch": ("rise from crouch",),
    "punch": ("punch",),
    "kick": ("kick",),
}
#: Words in names of files, and what may be labelled besides.
ACCAD_WORDS: Mapping[str, tuple[str, ...]] = {
    "walk": ("walk",),
    "walkback": ("walk backwards",),
    "forward": ("walk", "run"),
    "run": ("run",),
    "runback": ("run backwards",),
    "skip": ("skip",),
    "hop": ("hop", "jump"),
    "jump": ("jump",),
    "leap": ("jump",),
    "turn": ("turn around",),
    "crouch": ("crouch", "squat", "rise from crouch"),
    "pickup": ("pick up", "put down", "crouch", "rise from crouch"),
    "putdown": ("pick up", "put down", "crouch", "rise from crouch"),
    "lie": ("lie down", "lie"),
    "crawl": ("crawl",),
    "sidestep": ("side step",),
    "kick": ("kick",),
}
#: Beginnings of names of Bandai's files, the longest that fits; none for all others.
BANDAI: Mapping[str, tuple[str, ...]] = {
    "walk": ("walk",),
    "walk-back": ("walk backwards",),
    "walk-left": ("walk", "side step"),
    "walk-right": ("walk", "side step"),
    "walk-turn": ("walk",),
    "run": ("run",),
    "dash": ("run",),
    "kick": ("kick",),
    "punch": ("punch",),
    "raise-up": ("arm raise forward", "arm raise sideways", "reach up"),
}
RIGS: Mapping[str, tuple[str, ...]] = {"jumping": ("jump",), "jumping_jacks": ("jump",)}
#: Names of the truth of 2009, by class.
TRUTH: Mapping[str, str] = {
    "walk": "move", "run": "move", "sneak": "move", "walk backwards": "move",
    "run backwards": "move", "side step": "move", "skip": "move", "crawl": "move",
    "jump": "jump", "hop": "jump", "kick": "kick", "punch": "punch", "throw": "throwR",
    "turn around": "turn", "lie down": "sitLieDown", "sit down": "sitLieDown",
    "stand up": "standUp", "rise from crouch": "standUp",
    "squat": "exercise", "elbow to knee": "exercise", "knee raise": "exercise",
    "lunge": "exercise", "side lunge": "exercise", "leg raise": "exercise",
    "arm raise forward": "exercise", "arm raise sideways": "exercise",
    "arm raise backward": "exercise", "forearm rotation": "exercise", "get up": "standUp",
    "arm circles": "rotateArms", "reach up": "grabDepR", "put down": "grabDepR",
    "pick up": "grabDepR", "T-pose": "tpose",
}  # fmt: skip
#: Postures: right where they are asked for, else no motion that a recording shows.
POSTURES = ("lie", "T-pose")


class Contents(NamedTuple):
    """What one recording shows.

    Attributes
    ----------
    asked : names for each content that the library knows; one of each is asked for
    allowed : names that are not wrong
    is_whole : whether the recording shows one motion from end to end
    """

    asked: tuple[tuple[str, ...], ...]
    allowed: frozenset[str]
    is_whole: bool


def accad_contents(table: Path) -> dict[str, Contents]:
    """Contents by recording, as the table has them."""
    rows: dict[str, list[tuple[str, str]]] = {}
    with table.open(encoding="utf-8", newline="") as lines:
        for row in csv.DictReader(lines):
            rows.setdefault(row["recording"], []).append((row["content"], row["extent"]))
    found = {}
    for recording, contents in rows.items():
        asked = tuple(ACCAD[content] for content, _ in contents if content in ACCAD)
        is_whole = all(extent == "whole" for _, extent in contents)
        found[recording] = _contents(asked, _words_of(recording), is_whole=is_whole)
    return found


def named_contents(name: str, table: Mapping[str, tuple[str, ...]]) -> Contents:
    """Contents of a recording by the beginning of its name."""
    stem = name.rsplit("/", 1)[-1].removeprefix("dataset-2_").split(".")[0]
    fitting = [key for key in table if stem == key or stem.startswith((f"{key}_", f"{key}-"))]
    asked = (table[max(fitting, key=len)],) if fitting else ()
    return _contents(asked, (), is_whole=True)


def _words_of(recording: str) -> tuple[str, ...]:
    text = recording.lower().replace("backwards", "back")
    return tuple(name for word, names in ACCAD_WORDS.items() if word in text for name in names)


def _contents(
    asked: tuple[tuple[str, ...], ...], besides: tuple[str, ...], *, is_whole: bool
) -> Contents:
    names = [name for names in asked for name in names]
    return Contents(asked, frozenset([*names, *besides]), is_whole)
