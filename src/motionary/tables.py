"""Results as tables: in notebooks as HTML, as data frames of pandas, and as Parquet.

Names come from files of strangers: in HTML every cell is escaped and without control
characters. pandas and pyarrow are imported only where they are asked for.
"""

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any, NamedTuple

from motionary.errors import InvalidInput

# More is not looked through in a notebook.
_MOST_ROWS = 20
_MOST_LETTERS = 200
# Names of a sentence.
_MOST_NAMES = 5
# Names that may have been meant.
_MOST_HINTS = 3


class Table(NamedTuple):
    """Rows under the names of their columns.

    Attributes
    ----------
    columns : names
    rows : cells, as many as columns; None where there is nothing to say
    """

    columns: tuple[str, ...]
    rows: Sequence[Sequence[object]]


class Shown:
    """What notebooks show as a table below its short form."""

    __slots__ = ()

    def list_rows(self) -> Table:
        """What there is to show."""
        raise NotImplementedError

    def _repr_html_(self) -> str:
        return format_html(self.list_rows(), title=repr(self))


class Tabular(Shown):
    """What is a table: shown in notebooks, and a data frame where pandas is there."""

    __slots__ = ()

    def to_dataframe(self) -> Any:
        """The rows as a data frame.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        InvalidInput
            If pandas is not installed.
        """
        columns, rows = self.list_rows()
        cells = zip(*rows, strict=True) if rows else [()] * len(columns)
        return build_frame(dict(zip(columns, map(list, cells), strict=True)))


def build_frame(columns: Mapping[str, Any], **options: Any) -> Any:
    """A data frame of pandas; `options` are those of `pandas.DataFrame`.

    Raises
    ------
    InvalidInput
        If pandas is not installed.
    """
    try:
        import pandas
    except ImportError as error:
        raise InvalidInput("data frames need pandas: pip install 'motionary[pandas]'") from error
    return pandas.DataFrame(columns, **options)


def load_pyarrow() -> Any:
    """The package that writes Parquet.

    Raises
    ------
    InvalidInput
        If it is not installed.
    """
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise InvalidInput("Parquet needs pyarrow: pip install 'motionary[parquet]'") from error
    return pyarrow


def write_parquet(portions: Iterable[Mapping[str, Any]], path: Path) -> None:
    """Write columns of one table, some rows after the others, as a file of Parquet.

    Parameters
    ----------
    portions : arrays by the name of their column; texts become categories, and what is masked
        is null; the first portion says what the columns are

    Raises
    ------
    InvalidInput
        If pyarrow is not installed.
    """
    pyarrow, writer = load_pyarrow(), None
    try:
        for columns in portions:
            arrays = {name: pyarrow.array(column) for name, column in columns.items()}
            for name, array in arrays.items():
                if array.type == pyarrow.string():
                    arrays[name] = array.dictionary_encode()
            table = pyarrow.table(arrays)
            writer = writer or pyarrow.parquet.ParquetWriter(path, table.schema)
            writer.write_table(table)
    finally:
        if writer is not None:
            writer.close()


def format_html(table: Table, *, title: str) -> str:
    """A title and the first rows of a table; columns that say nothing are left out."""
    shown = table.rows[:_MOST_ROWS]
    used = [i for i in range(len(table.columns)) if any(_cell(row[i]) for row in shown)]
    head = "".join(f"<th>{_escape(table.columns[i])}</th>" for i in used)
    body = "".join(f"<tr>{''.join(_to_html(row[i]) for i in used)}</tr>" for row in shown)
    more = len(table.rows) - len(shown)
    below = f"<p>{more} more rows</p>" if more else ""
    content = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>" if used else ""
    return f"<div><p>{_escape(title)}</p>{content}{below}</div>"


def _to_html(value: object) -> str:
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    style = ' style="text-align: right"' if is_number else ""
    return f"<td{style}>{_escape(_cell(value))}</td>"


def _cell(value: object) -> str:
    if value is None or value is False:
        return ""
    if isinstance(value, Real) and not isinstance(value, Integral):
        number = float(value)
        if math.isnan(number):
            return ""
        return f"{number:.3f}".rstrip("0").rstrip(".") if abs(number) >= 0.01 else f"{number:.2g}"
    return str(value)


def _escape(text: str) -> str:
    # Imported late: names of all characters come with it, and commands write no HTML.
    from html import escape

    short = text if len(text) <= _MOST_LETTERS else text[:_MOST_LETTERS] + " ..."
    return escape(printable(short))


def enumerate_names(names: Sequence[str], *, most: int = _MOST_NAMES) -> str:
    """The first names, and how many more there are; "none" where there are none."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return (", ".join(names[:most]) or "none") + more


def near_names(wanted: str, names: Iterable[str]) -> list[str]:
    """The names that come nearest: by their letters, else by their words; at most three."""
    even = {" ".join(name.split()).casefold(): name for name in names}
    wanted = " ".join(wanted.split()).casefold()
    near = difflib.get_close_matches(wanted, even, n=_MOST_HINTS, cutoff=0.6)
    if not near:
        parts = set(wanted.split())
        shared = {name: len(parts & set(name.split())) for name in even}
        near = [name for name in sorted(even, key=lambda n: -shared[n]) if shared[name]]
    return [even[name] for name in near[:_MOST_HINTS]]


def printable(text: str) -> str:
    """Text without what would move the cursor or change the terminal."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
