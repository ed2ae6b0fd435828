"""How does a record become a page?

Every number of a page is taken from its record: rendering a record again gives the page.
"""

from collections.abc import Iterable, Sequence
from typing import Any

from motionary.errors import InvalidInput


def table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Markdown table; numbers to the right."""
    body = [[_cell(item) for item in row] for row in rows]
    if any(len(row) != len(head) for row in body):
        raise InvalidInput(f"each row needs {len(head)} cells, as the head has")
    right = [
        all(isinstance(row[i], int | float | None) or _is_number(body[j][i])
            for j, row in enumerate(body)) and i > 0
        for i in range(len(head))
    ]  # fmt: skip
    rule = ["---:" if flag else "---" for flag in right]
    return "\n".join(_row(cells) for cells in ([*head], rule, *body)) + "\n"


def picture(name: str, caption: str) -> str:
    """A picture and what it shows; `caption` is also read to those who do not see it."""
    return f"![{caption}](pictures/{name}.png)\n\n*{caption}*\n"


def fraction(value: float | None, digits: int = 2) -> str:
    """A share in [0, 1] without its leading zero, as the papers print it."""
    if value is None:
        return "–"
    text = f"{value:.{digits}f}"
    return text[1:] if text.startswith("0.") else text


def pair(first: float | None, second: float | None) -> str:
    """Two shares, such as F1 and F2."""
    return f"{fraction(first)} / {fraction(second)}"


def number(value: float | None, digits: int = 1) -> str:
    """A number, or a dash for one that is not defined."""
    return "–" if value is None else f"{value:.{digits}f}"


def with_interval(triple: dict[str, float]) -> str:
    """A mean with its limits."""
    return f"{fraction(triple['mean'])} [{fraction(triple['low'])}, {fraction(triple['high'])}]"


def claim(holds: bool, text: str) -> str:
    """What a page says of its numbers, if they say so."""
    if not holds:
        raise InvalidInput(f"the record does not show this any more: {text}")
    return text


def render(record: dict[str, Any], body: str) -> str:
    """The page of a record: title, body, and how it was made."""
    machine = record["machine"]
    data = "\n".join(
        f"- {entry['what']}: {entry['files']} files, {entry['minutes']:.1f} min"
        for entry in record["data"]
    )
    return f"""# {record["title"]}

{body.strip()}

## How it was made

{data}

- Split: {record["split"]}
- Seed: {record["seed"]}
- Commit: {record["commit"]}
- Machine: {machine["processor"]}, {machine["cores"]} cores, {machine["system"]}, Python
  {machine["python"]}, NumPy {machine["numpy"]}; {record["seconds"]:.0f} s
- Again: `{record["command"]}`; numbers: [record](records/{record["name"]}.json)
"""


def _cell(item: Any) -> str:
    if item is None:
        return "–"
    if isinstance(item, float):
        return fraction(item) if abs(item) < 1 else f"{item:.2f}"
    return str(item)


def _is_number(text: str) -> bool:
    return bool(text) and all(letter in "0123456789.,–-+/ %()[]" for letter in text)


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"
