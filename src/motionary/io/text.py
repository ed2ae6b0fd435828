"""What does a text file say, whatever its encoding?"""

from pathlib import Path

from motionary.errors import UnreadableFile


def read_text(path: Path) -> str:
    """Text of a file: UTF-8 or UTF-16 by its mark, else UTF-8, else Latin-1.

    Lines end with a newline, whichever system wrote them.

    Raises
    ------
    UnreadableFile
        If the file is missing, a folder, or may not be read.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise UnreadableFile(f"{path}: cannot be read: {reason}") from error
    text = _decode(content)
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def _decode(content: bytes) -> str:
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")
