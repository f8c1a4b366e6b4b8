"""Tables in Markdown, and their places in documents."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

MARK = re.compile(r"(<!-- figures: ([\w-]+) -->\n)(?:\|.*\n)+")


class Table(NamedTuple):
    """A table and the name of its mark."""

    name: str
    lines: str


def table(name: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """The first column is text, all others are numbers.

    >>> print(table("sizes", ["file", "bytes"], [["walk", "1,024"]]).lines, end="")
    | file | bytes |
    |---|---:|
    | walk | 1,024 |
    """
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    texts = ["| " + " | ".join(cells) + " |" for cells in lines]
    texts[1] = "|" + "|".join(lines[1]) + "|"
    return Table(name, "".join(f"{text}\n" for text in texts))


def bold(texts: Sequence[str], best: int) -> list[str]:
    """The texts, that number ``best`` in bold."""
    return [f"**{text}**" if k == best else text for k, text in enumerate(texts)]


def names_in(document: str) -> list[str]:
    """Names of the tables that ``document`` has marks of."""
    return [match[2] for match in MARK.finditer(document)]


def replaced(document: str, tables: Mapping[str, str]) -> str:
    """``document`` with the tables behind their marks; other tables stay."""
    return MARK.sub(
        lambda match: match[1] + tables.get(match[2], match[0][len(match[1]) :]), document
    )
