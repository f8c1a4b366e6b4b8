"""Tables as data, and as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from mcz.model.types import JsonObject, Settings

Cell = float | int | str | None


@dataclass(frozen=True, slots=True)
class ResultTable:
    """Rows of raw values; the caption has clip, numerator, metric and unit.

    ``columns`` are pairs of heading and format; a format is as for ``format()``, "" for text.
    """

    title: str
    caption: str
    columns: tuple[tuple[str, str], ...]
    rows: list[Sequence[Cell]] = field(default_factory=list)

    def document(self) -> JsonObject:
        """For JSON: the raw values."""
        heads = [head for head, _ in self.columns]
        return {
            "title": self.title,
            "caption": self.caption,
            "columns": heads,
            "rows": [list(row) for row in self.rows],
        }

    def to_cache(self) -> JsonObject:
        """Everything, for the cache."""
        return self.document() | {"columns": [list(pair) for pair in self.columns]}

    @classmethod
    def from_cache(cls, cached: JsonObject) -> ResultTable:
        """The inverse of ``to_cache``."""
        columns = tuple((head, spec) for head, spec in cached["columns"])
        return cls(cached["title"], cached["caption"], columns, cached["rows"])

    def cells(self) -> list[list[str]]:
        """Headings, then rows, as text."""
        formats = [spec for _, spec in self.columns]
        body = [
            [format_cell(value, spec) for value, spec in zip(row, formats, strict=True)]
            for row in self.rows
        ]
        return [[head for head, _ in self.columns], *body]

    @property
    def right(self) -> str:
        """Alignment of columns: ``r`` for numbers, else ``l``."""
        return "".join("r" if spec else "l" for _, spec in self.columns)

    def markdown(self) -> Iterator[str]:
        yield f"### {self.title}"
        yield ""
        yield self.caption
        yield ""
        head, *body = self.cells()
        yield _row(head)
        yield _row(["---:" if side == "r" else "---" for side in self.right])
        yield from map(_row, body)
        yield ""


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def format_cell(value: Cell, spec: str) -> str:
    """
    >>> format_cell(12.345, ".1f"), format_cell(None, ".1f"), format_cell(5, ",d")
    ('12.3', '-', '5')
    """
    if value is None:
        return "-"
    if isinstance(value, str) or not spec:
        return str(value)
    return format(round(value), spec) if spec.endswith("d") else format(value, spec)


def setting(params: Settings) -> str:
    """
    >>> setting({"T_g": 0.25, "Q": 1})
    'T_g=0.25 Q=1'
    """
    return " ".join(
        f"{k}={v:.4g}" if isinstance(v, float) else f"{k}={v}" for k, v in params.items()
    )
