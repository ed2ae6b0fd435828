"""How are tables of skeletons, which say what the joints of a rig are, read and written?"""

from pathlib import Path

from motionary.errors import InvalidInput
from motionary.io.text import read_text, write_text
from motionary.motion import Motion
from motionary.skeletons import SkeletonTable, format_table, named_table, parse_table, without_guess

SUFFIX = ".toml"


def find_skeleton(skeleton: str | Path) -> SkeletonTable:
    """A known skeleton by its name, or the one that a .toml file holds.

    Raises
    ------
    InvalidInput
        If no known skeleton has this name, or the file holds none.
    UnreadableFile
        If the file is missing or may not be read.
    """
    if not str(skeleton).lower().endswith(SUFFIX):
        return named_table(str(skeleton))
    path = Path(skeleton)
    return parse_table(path.stem, read_text(path), source=path.name)


def save_skeleton(motion: Motion, path: str | Path) -> None:
    """Write how the joints of a motion are mapped, to be corrected and given back.

    Parameters
    ----------
    motion : whose mapping is known
    path : the file, .toml

    Raises
    ------
    InvalidInput
        If the mapping is unknown, or the file is called otherwise.
    UnwritableFile
        If the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != SUFFIX:
        raise InvalidInput(f"a skeleton is written as {SUFFIX}, got {path.name}")
    if motion.mapping is None:
        why = motion.notes[-1] if motion.notes else "no known skeleton has them"
        raise InvalidInput(f"{motion.source or 'motion'}: its joints are not mapped: {why}")
    about = f"Joints of {motion.source}" if motion.source else "Joints of a rig"
    write_text(path, [format_table(without_guess(motion.mapping), about=about, names=motion.names)])
