"""Which files do classes of any name get?

Names of files must fit every file system: some fold case, some decompose accents, some
keep names of devices to themselves, all limit the length.
"""

import re
import unicodedata
from collections.abc import Collection, Iterable, Mapping

_LONGEST_BYTES = 100
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)


def choose_stems(
    names: Iterable[str], *, kept: Mapping[str, str], taken: Collection[str]
) -> dict[str, str]:
    """File name without suffix for each class.

    Parameters
    ----------
    names : of the classes
    kept : stems that classes had before and keep
    taken : stems that others must not get
    """
    used = {_fold(stem) for stem in (*taken, *kept.values())}
    stems = {}
    for name in names:
        stems[name] = kept[name] if name in kept else _free(to_stem(name), used)
        used.add(_fold(stems[name]))
    return stems


def to_stem(name: str) -> str:
    """The nearest name that every file system takes; not unique."""
    stem = re.sub(r"[^\w.-]", "_", unicodedata.normalize("NFC", name))
    stem = stem.encode()[:_LONGEST_BYTES].decode(errors="ignore").strip(".-")
    return f"_{stem}" if _DEVICES.match(stem) else stem or "class"


def _free(stem: str, used: Collection[str]) -> str:
    candidate, number = stem, 2
    while _fold(candidate) in used:
        candidate, number = f"{stem}-{number}", number + 1
    return candidate


def _fold(stem: str) -> str:
    return unicodedata.normalize("NFC", stem).casefold()
