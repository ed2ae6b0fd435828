"""Clips of C3D files: bytes of the file itself, so that analog signals and parameters stay.

Only what counts frames changes. Events keep their times in the recording, as its frames keep
their numbers.
"""

from pathlib import Path

from motionary.errors import UnreadableFile
from motionary.files import open_regular
from motionary.io.formats.c3d_head import BLOCK, parse_head, recount
from motionary.io.formats.c3d_layout import find_layout
from motionary.io.formats.numbers import check_frames

# As in reading: a parameter section has at most 255 blocks.
_LONGEST_HEAD = 600 * BLOCK


def cut_c3d(path: Path, first: int, last: int, take: str | int | None = None) -> bytes:
    """A clip of a C3D file; frames as the file counts them, both included.

    Raises
    ------
    UnreadableFile
        If the file is missing or damaged, or has rotations, which lie behind its frames.
    InvalidInput
        If these frames are not in the file.
    """
    with open_regular(path) as file:
        head = parse_head(file.read(_LONGEST_HEAD), path.name)
        if head.count("ROTATION", "USED", 0):
            raise UnreadableFile(
                f"{path.name}: holds rotations, which clips cannot be cut out of; convert it to "
                ".npz first"
            )
        layout, _ = find_layout(file, head, path.name)
        check_frames(
            first, last, first_number=layout.first_frame, n_frames=layout.n_frames, name=path.name
        )
        file.seek(0)
        before = recount(file.read(layout.start), head.machine, first_frame=first, last_frame=last)
        file.seek(layout.start + (first - layout.first_frame) * layout.frame)
        return before + file.read((last - first + 1) * layout.frame)
