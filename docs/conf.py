"""The manual as a site: ``python -m sphinx -W -b html docs docs/_build``.

Pages are Markdown. The specification and the page of the conformance suite are pages of the site,
too: ``reference/format.md`` and ``evidence/conformance.md`` include them. A link from a page to
another file of the repository is plain text here, since a site has no such file.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from posixpath import dirname, join, normpath, relpath

from sphinx.application import Sphinx

import mcz

sys.path.insert(0, str(Path(__file__).parents[1]))
from tools import notebooks

project = "MCZ"
version = release = mcz.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc"]
exclude_patterns = ["_build", "_notebooks"]
html_theme = "furo"
html_title = f"MCZ {release}"
html_show_copyright = False
myst_heading_anchors = 3
suppress_warnings = ["misc.highlighting_failure"]  # SPEC.md has blocks of hex
autodoc_typehints = "description"
autodoc_member_order = "bysource"

INCLUDED = {
    "SPEC.md": "reference/format.md",
    "conformance/README.md": "evidence/conformance.md",
}
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)#\s]+)(#[^)\s]*)?\)")


def mend_links(app: Sphinx, page: str, source: list[str]) -> None:
    """Point links out of the manual to the pages that include their files, or make them text."""
    folder = dirname(page)

    def mend(match: re.Match[str]) -> str:
        text, target, anchor = match[1], match[2], match[3] or ""
        if "://" in target:
            return match[0]
        path = normpath(join("docs", folder, target))
        if path in INCLUDED:
            return f"[{text}]({relpath(INCLUDED[path], folder or '.')}{anchor})"
        return match[0] if path.startswith("docs/") else text

    source[0] = LINK.sub(mend, source[0])


def include(app: Sphinx, page: str, source: list[str]) -> None:
    """Fill the pages of ``INCLUDED`` with the files that they are for."""
    for path, target in INCLUDED.items():
        if f"{page}.md" == target:
            text = (Path(app.srcdir).parent / path).read_text("utf-8")
            source[0] = LINK.sub(lambda match: match[0] if "://" in match[2] else match[1], text)


def add_contents(app: Sphinx, page: str, source: list[str]) -> None:
    """Add tables of contents to the index: the pages of its own tables, by section."""
    if page != "index":
        return
    for title, section in re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", source[0], re.M | re.S):
        pages = re.findall(r"^\| \[[\w-]+\]\(([\w/-]+)\.md\)", section, re.M)
        if pages:
            source[0] += "\n".join(
                ["", "```{toctree}", ":hidden:", f":caption: {title}", "", *pages, "```", ""]
            )


def write_notebooks(app: Sphinx) -> None:
    notebooks.write_notebooks(Path(app.srcdir) / "_notebooks")


def offer_notebook(app: Sphinx, page: str, source: list[str]) -> None:
    """Link a page that is a notebook, too, to its file."""
    if f"{page}.md" in notebooks.PAGES:
        path = f"/_notebooks/{Path(page).name}.ipynb"
        source[0] += f"\n{{download}}`This page as a Jupyter notebook <{path}>`\n"


def setup(app: Sphinx) -> None:
    app.connect("builder-inited", write_notebooks)
    app.connect("source-read", offer_notebook)
    app.connect("source-read", mend_links)
    app.connect("source-read", include)
    app.connect("source-read", add_contents)
