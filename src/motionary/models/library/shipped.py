"""The library of everyday motion that comes with the package.

It lies in two folders: what was learned from CMU and UI-PRMD or designed by hand, and what
was learned from HDM05, under CC BY-SA 3.0. `recipes/everyday.py` makes both.
"""

from functools import cache
from pathlib import Path

from motionary.models.library.editing import merge_libraries
from motionary.models.library.storage import INDEX, ClassLibrary, load_library

#: What it is called where a library is asked for.
EVERYDAY = "everyday"
#: Asks for no library.
NO_LIBRARY = "none"

_FOLDERS = ("everyday", "everyday_hdm05")


@cache
def load_everyday() -> ClassLibrary:
    """The library of everyday motion; each class says where it comes from."""
    home = Path(__file__).parents[2] / "libraries"
    return merge_libraries([load_library(home / one) for one in _FOLDERS], clash="both")


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
