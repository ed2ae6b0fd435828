"""Which format does the name of a file say?"""

from pathlib import PurePath

#: A text that is packed keeps its own suffix before this one: `take.bvh.gz`.
PACKED = ".gz"


def format_suffix(path: str | PurePath) -> str:
    """Suffix in lower case, of a packed file both: ".bvh", ".bvh.gz"."""
    path = PurePath(path)
    suffix = path.suffix.lower()
    return PurePath(path.stem).suffix.lower() + suffix if suffix == PACKED else suffix


def stem_of(path: str | PurePath) -> str:
    """Name of a file without folder and suffix, of a packed file without both."""
    path = PurePath(path)
    return PurePath(path.stem).stem if path.suffix.lower() == PACKED else path.stem
