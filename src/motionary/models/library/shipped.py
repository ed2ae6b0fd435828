"""The library of everyday motion that comes with the package.

It lies in two folders: what was learned from CMU and UI-PRMD or designed by hand, and what
was learned from HDM05, under CC BY-SA 3.0. Beside the latter lies what its labels were
calibrated by, for the classes of both. `recipes/everyday.py` makes all.
"""

import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

from motionary.errors import InvalidInput
from motionary.models.library.editing import merge_libraries
from motionary.models.library.storage import INDEX, ClassLibrary, load_library

#: What it is called where a library is asked for.
EVERYDAY = "everyday"
#: Asks for no library.
NO_LIBRARY = "none"

#: File of what both folders together were calibrated by.
CALIBRATION = "calibration.toml"

_FOLDERS = ("everyday", "everyday_hdm05")


@cache
def load_everyday() -> ClassLibrary:
    """The library of everyday motion; each class says where it comes from."""
    return load_parts(Path(__file__).parents[2] / "libraries")


def load_parts(home: Path) -> ClassLibrary:
    """One calibrated library of both folders, wherever they lie.

    Raises
    ------
    UnreadableFile
        As `load_library`.
    """
    whole = merge_libraries([load_library(home / one) for one in _FOLDERS], clash="both")
    content = tomllib.loads((home / _FOLDERS[1] / CALIBRATION).read_text("utf-8"))
    levels = content["false_levels"]
    classes = tuple(replace(one, false_level=levels[one.name]) for one in whole)
    scoring = whole.scoring and replace(
        whole.scoring, false_slope=content["false_slope"], probability=content["probability"]
    )
    return replace(whole, classes=classes, scoring=scoring)


def write_calibration(whole: ClassLibrary, path: Path) -> None:
    """Write what `load_parts` reads beside the two folders."""
    scoring = whole.scoring
    if scoring is None or scoring.probability is None:
        raise InvalidInput("the library is not calibrated")
    lines = [
        "# False labels a minute, and how probably a label is right, of both folders together.",
        f"false_slope = {scoring.false_slope}",
        f"probability = {list(scoring.probability)}",
    ]
    lines += ["", "[false_levels]", *(f'"{one.name}" = {one.false_level}' for one in whole)]
    path.write_text("\n".join(lines) + "\n", "utf-8")


def open_library(folder: str | Path) -> ClassLibrary:
    """A library by its folder, or the one that ships by its name.

    A folder of that name that is a library comes first.

    Raises
    ------
    UnreadableFile
        As `load_library`.
    """
    if str(folder) == EVERYDAY and not (Path(folder) / INDEX).exists():
        return load_everyday()
    return load_library(folder)
