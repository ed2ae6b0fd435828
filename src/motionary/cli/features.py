"""`motionary features`: which of the 40 relations hold when, in numbers?"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli.inputs import check_picture, check_target, read_as_told
from motionary.cli.options import Excel, ReadingOptions

if TYPE_CHECKING:
    from motionary.features import FeatureSequence
    from motionary.io import Cell


def features(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A recording.")],
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="NPZ", help="Where to write; .npz or .csv.")
    ],
    plot: Annotated[
        str | None, typer.Option(metavar="PNG", help="Draw the relations over time.")
    ] = None,
    excel: Excel = False,
    *,
    reading: ReadingOptions,
) -> int:
    """Write which of the 40 relations hold in a recording, and when.

    There are 30 frames a second. A .npz file has `features` and `known`, arrays of 0 and 1
    of shape (frames, 40), `names` and `rate_hz`. In a .csv file unknown relations are empty
    cells.

    motionary features take.bvh -o take.npz
    """
    from motionary.features import compute_features

    suffix = Path(output).suffix.lower()
    if suffix not in (".npz", ".csv"):
        raise typer.BadParameter(f"must end in .npz or .csv, got {output}", param_hint="--output")
    check_target(output)
    check_picture("--plot", plot)
    path = Path(file)
    motion = read_as_told(path, reading.reading()).renamed(path.name)
    words = compute_features(motion)
    if suffix == ".npz":
        _write_npz(words, output)
    else:
        _write_csv(words, output, excel=excel)
    if plot:
        from motionary.plots import plot_features, save

        save(plot_features(words), plot)
    return 0


def _write_npz(words: "FeatureSequence", path: str) -> None:
    import numpy as np

    from motionary.batch import write_atomically

    with write_atomically(path) as beside:
        np.savez_compressed(
            beside,
            features=words.features,
            known=words.known_features,
            names=np.array(words.feature_set.names),
            rate_hz=np.float64(words.rate_hz),
        )


def _write_csv(words: "FeatureSequence", path: str, *, excel: bool) -> None:
    from motionary.io import write_table

    table: list[list[Cell]] = [["time_s", *words.feature_set.names]]
    for i, (held, known) in enumerate(zip(words.features, words.known_features, strict=True)):
        cells = [int(h) if k else None for h, k in zip(held, known, strict=True)]
        table.append([round(i / words.rate_hz, 4), *cells])
    write_table(table, path, excel=excel)
