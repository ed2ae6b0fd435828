"""How is a picture written?

The same picture gives the same bytes: no date, no version, no random names.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from motionary.batch import write_atomically
from motionary.errors import InvalidInput
from motionary.plots.style import house_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": "motionary"},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


@house_style()
def save(figure: "Figure", path: str | Path) -> None:
    """Write a picture; the suffix of the name says how: png, svg or pdf.

    Parameters
    ----------
    figure : from any function of this package
    path : file to write; is replaced only once the new one is complete

    Raises
    ------
    InvalidInput
        If the suffix is another one.
    UnwritableFile
        If the file cannot be written.
    """
    kind = Path(path).suffix.lower().lstrip(".")
    if kind not in _METADATA:
        raise InvalidInput(
            f"{Path(path).name}: pictures are written as .png, .svg or .pdf, got "
            f"{Path(path).suffix!r}; give the file one of these suffixes"
        )
    from matplotlib import rc_context

    with write_atomically(path) as beside, rc_context({"svg.hashsalt": "motionary"}):
        figure.savefig(beside, format=kind, metadata=_METADATA[kind])
