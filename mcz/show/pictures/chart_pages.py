"""Pages that hold all they show: no script, no request, and no text of a file is markup."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

from mcz.model.text_format import printable

STYLE = """
:root { color-scheme: light dark; --ground: #fbfbf9; --ink: #1f2328; --quiet: #5b626a;
  --line: #d9dcdf; --stripe: #f1f2f0; }
@media (prefers-color-scheme: dark) { :root { --ground: #16191d; --ink: #eceff1; --quiet: #a3abb3;
  --line: #353b42; --stripe: #1d2126; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem 1rem 4rem; max-width: 75rem; background: var(--ground);
  color: var(--ink); font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.4rem; margin: 0 0 .5rem; overflow-wrap: anywhere; }
h2 { font-size: 1.1rem; margin: 2.5rem 0 .5rem; overflow-wrap: anywhere; }
p, li, figcaption { color: var(--quiet); max-width: 60rem; overflow-wrap: anywhere; }
figure { margin: 1rem 0; }
img { max-width: 100%; height: auto; display: block; border-radius: .4rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85rem; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .7rem; border-bottom: 1px solid var(--line); text-align: left;
  white-space: nowrap; }
th.n, td.n { text-align: right; }
thead th { color: var(--quiet); font-weight: 600; }
tbody tr:nth-child(even) { background: var(--stripe); }
nav a { color: inherit; }
"""
POLICY = (
    "default-src 'none'; img-src data:; style-src '{style}'; base-uri 'none'; form-action 'none'"
)


@dataclass(frozen=True, slots=True)
class Sheet:
    """A table: its first row are headings; ``right`` has "r" for each column of numbers."""

    title: str
    rows: Sequence[Sequence[str]]
    right: str = ""
    caption: str = ""


@dataclass(frozen=True, slots=True)
class ChartPage:
    """Pictures and tables, one below the other."""

    title: str
    notes: Sequence[str] = ()
    parts: list[str] = field(default_factory=list)
    headings: list[str] = field(default_factory=list)

    def add_picture(self, name: str, light: str, dark: str) -> None:
        """A picture on light and on dark ground, each as a data: URI."""
        source = f'<source media="(prefers-color-scheme: dark)" srcset="{_text(dark)}">'
        image = f'<img src="{_text(light)}" alt="{_text(name)}">'
        self.parts.append(f"<figure><picture>{source}{image}</picture></figure>")

    def add_table(self, table: Sheet) -> None:
        if table.title:
            self.add_heading(table.title)
        if table.caption:
            self.parts.append(f"<p>{_text(table.caption)}</p>")
        head, *body = table.rows
        sides = table.right.ljust(len(head), "l")
        rows = "".join(f"<tr>{_cells(row, sides, 'td')}</tr>\n" for row in body)
        heads = _cells(head, sides, "th")
        # It scrolls by itself, so that it can be reached with the keyboard, too.
        self.parts.append(
            f'<div class="scroll" tabindex="0" role="region" aria-label="{_text(table.title)}">'
            f"<table><thead><tr>{heads}</tr></thead>\n<tbody>{rows}</tbody></table></div>"
        )

    def add_heading(self, text: str) -> None:
        self.headings.append(text)
        self.parts.append(f'<h2 id="part{len(self.headings)}">{_text(text)}</h2>')

    def html(self) -> bytes:
        """The page as UTF-8."""
        style = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode("ascii")
        policy = POLICY.format(style=f"sha256-{style}")
        notes = "".join(f"<li>{_text(note)}</li>" for note in self.notes)
        listed = f"<ul>{notes}</ul>" if notes else ""
        contents = ""
        if len(self.headings) > 3:
            links = (
                f'<li><a href="#part{number}">{_text(text)}</a></li>'
                for number, text in enumerate(self.headings, 1)
            )
            contents = f'<nav aria-label="Contents"><ul>{"".join(links)}</ul></nav>'
        body = "\n".join(self.parts)
        return (
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{_text(self.title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n"
            f"<h1>{_text(self.title)}</h1>\n{listed}{contents}\n{body}\n</main>\n</body>\n</html>\n"
        ).encode("utf-8", "backslashreplace")


def data_uri(data: bytes, kind: str) -> str:
    """A picture, "png" or "svg+xml", as the page holds it."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"


def _cells(row: Sequence[str], sides: str, tag: str) -> str:
    scope = ' scope="col"' if tag == "th" else ""
    kinds = {"r": ' class="n"', "l": ""}
    return "".join(
        f"<{tag}{scope}{kinds[side]}>{_text(cell)}</{tag}>"
        for cell, side in zip(row, sides, strict=True)
    )


def _text(text: str) -> str:
    """Text as it stands in a page, also between quotes; what steers is shown."""
    return escape(printable(text))
