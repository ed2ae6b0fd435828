"""Text files: suffixes, encodings, packing, and tables of separated values.

Tables for programs have commas, decimal points, UTF-8. For Excel as it opens a file by a double
click in most of Europe: semicolons, decimal commas, a byte order mark, lines as Windows ends them.
"""

import csv
import gzip
import io
import re
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from motionary.errors import UnreadableFile, describe_cause
from motionary.files import check_table_name, most_unpacked, read_bytes, write_atomically

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

#: A text that is packed keeps its own suffix before this one: `take.bvh.gz`.
PACKED = ".gz"

#: Between the name of a file and that of one of its recordings.
TAKE_MARK = "#"

Cell = str | int | float | None

_BREAKS = re.compile(r"[\t\r\n]+")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")

_PIECE = 1 << 22
_LOOKED_AT = 1 << 10


def format_suffix(path: str | PurePath) -> str:
    """Suffix in lower case, of a packed file both: ".bvh", ".bvh.gz"; takes have their file's."""
    path = PurePath(path)
    suffix = path.suffix.lower().partition(TAKE_MARK)[0]
    return PurePath(path.stem).suffix.lower() + suffix if suffix == PACKED else suffix


def stem_of(path: str | PurePath) -> str:
    """Name of a file without folder and suffix, of a packed file without both.

    Of a take of a file, `batch.npy#007`, both: `batch-007`.
    """
    path = PurePath(path)
    suffix, mark, take = path.suffix.partition(TAKE_MARK)
    stem = PurePath(path.stem).stem if suffix.lower() == PACKED else path.stem
    return f"{stem}-{take}" if mark else stem


def read_text(path: Path) -> str:
    """Text of a file: UTF-8 or UTF-16, else as Windows writes it, else Latin-1.

    Lines end with a newline, whichever system wrote them. A file whose name ends in .gz
    is unpacked.

    Raises
    ------
    UnreadableFile
        If the file is missing, a folder, may not be read, or is packed and damaged.
    """
    content = read_bytes(path)
    if path.suffix.lower() == PACKED:
        content = _unpack(content, path.name)
    text = _decode(content)
    if "\r" not in text:
        return text
    # A file that was converted twice ends its lines with two of them.
    return text.replace("\r\r\n", "\n").replace("\r\n", "\n").replace("\r", "\n")


def write_text(path: str | Path, pieces: Iterable[str]) -> None:
    """Write pieces of UTF-8, whole or not at all; packed where the name ends in .gz.

    Raises
    ------
    UnwritableFile
        If the file cannot be written.
    """
    packed = Path(path).suffix.lower() == PACKED
    with write_atomically(path) as beside, beside.open("wb") as file:
        if not packed:
            file.writelines(piece.encode() for piece in pieces)
            return
        # No time and no name inside: same motion, same bytes.
        with gzip.GzipFile(filename="", mode="wb", fileobj=file, mtime=0) as packer:
            for piece in pieces:
                packer.write(piece.encode())


def read_toml(path: Path) -> dict[str, Any]:
    """Content of a TOML file that a person wrote; errors as of `read_text`."""
    import tomllib

    try:
        return tomllib.loads(read_text(path))
    # Not TOMLDecodeError alone: numbers may have more digits than Python takes.
    except (ValueError, RecursionError) as error:
        raise UnreadableFile(f"is no TOML: {describe_cause(error)}", file=path.name) from error


def read_json(path: Path) -> Any:
    """Content of a JSON file; errors as of `read_text` and `parse_json`."""
    return parse_json(read_text(path), file=path.name)


def parse_json(text: str, **where: Any) -> Any:
    """What a text of JSON holds.

    Parameters
    ----------
    where : `file` and `place` of the text, for the error

    Raises
    ------
    UnreadableFile
        If it is no JSON.
    """
    import json

    try:
        return json.loads(text)
    # Not JSONDecodeError alone: numbers may have more digits than Python takes.
    except (ValueError, RecursionError) as error:
        raise UnreadableFile(
            f"is no JSON file, or broken JSON: {describe_cause(error)}", **where
        ) from error


def parse_xml(text: str, *, file: str, problem: str, refusal: str) -> "Element":
    """The root of an XML text that defines no entities.

    Parameters
    ----------
    problem : begins the error about what is no XML
    refusal : the error about a document type, by which a few bytes grow to gigabytes, or other
        files are read

    Raises
    ------
    UnreadableFile
    """
    from xml.etree import ElementTree

    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise UnreadableFile(refusal, file=file)
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise UnreadableFile(f"{problem}: {error}", file=file) from error


def _unpack(content: bytes, name: str) -> bytes:
    pieces, size, most = [], 0, most_unpacked(len(content))
    unpacker = zlib.decompressobj(wbits=31)
    try:
        while content:
            piece = unpacker.decompress(content, _PIECE)
            pieces.append(piece)
            size += len(piece)
            content = unpacker.unconsumed_tail
            finished = unpacker.eof
            if finished:
                # Packed files may be put one after the other.
                content, unpacker = unpacker.unused_data, zlib.decompressobj(wbits=31)
            if size > most:
                raise UnreadableFile(
                    f"unpacks to more than {most >> 20} MB, as no text of a motion does; "
                    "unpack it first (gunzip) if it is yours",
                    file=name,
                )
            if not piece and not content and not finished:
                break
    except zlib.error:
        raise UnreadableFile("is packed (gzip) and damaged", file=name) from None
    if not pieces or not finished:
        raise UnreadableFile("is packed (gzip) and cut off; get the whole file", file=name)
    return b"".join(pieces)


def _decode(content: bytes) -> str:
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", errors="replace")
    # UTF-16 without its mark: text of Europe has a zero in every other byte.
    start = content[:_LOOKED_AT]
    for encoding, zeros, letters in (
        ("utf-16-le", start[1::2], start[::2]),
        ("utf-16-be", start[::2], start[1::2]),
    ):
        if len(zeros) > 1 and zeros.count(0) > 0.9 * len(zeros) and letters.count(0) == 0:
            return content.decode(encoding, errors="replace")
    for encoding in ("utf-8-sig", "cp1252"):
        try:
            return content.decode(encoding)
        except UnicodeDecodeError:
            pass
    return content.decode("latin-1")


def write_table(rows: Iterable[Sequence[Cell]], path: str | Path, *, excel: bool = False) -> None:
    """Write rows of cells, headings first; None is an empty cell.

    A name that ends in .tsv means tabs and no quotes; breaks within a cell become spaces.

    Parameters
    ----------
    rows : numbers that are whole as int, others as float; text stays as it is
    path : the file
    excel : for Excel instead of for programs

    Raises
    ------
    InvalidInput
        If the file's name is that of another format.
    UnwritableFile
        If the file cannot be written; what was there before stays.
    """
    check_table_name(path)
    text = io.StringIO()
    end = "\r\n" if excel else "\n"
    if Path(path).suffix.lower() == ".tsv":
        # With tabs between them, cells have no quotes.
        for row in rows:
            cells = (_format_cell(cell, excel=excel) for cell in row)
            text.write("\t".join(_BREAKS.sub(" ", cell) for cell in cells) + end)
    else:
        writer = csv.writer(text, delimiter=";" if excel else ",", lineterminator=end)
        writer.writerows([_format_cell(cell, excel=excel) for cell in row] for row in rows)
    encoding = "utf-8-sig" if excel else "utf-8"
    with write_atomically(path) as beside:
        # Names of files may hold bytes that are no text; they are shown as escapes.
        beside.write_text(text.getvalue(), encoding=encoding, errors="backslashreplace", newline="")


def _format_cell(cell: Cell, *, excel: bool) -> str:
    if cell is None:
        return ""
    if isinstance(cell, str):
        # Excel computes what begins so: a file of this name could send what stands beside it.
        return f"'{cell}" if excel and cell.startswith(_FORMULA) else cell
    if isinstance(cell, float):
        return repr(cell).replace(".", ",") if excel else repr(cell)
    return str(cell)
