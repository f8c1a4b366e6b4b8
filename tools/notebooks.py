"""Pages of the manual as Jupyter notebooks: ``python tools/notebooks.py FOLDER [PAGE...]``.

A page stays the one source: its prose, its blocks, and the output that the tests compare. The site
offers the notebooks beside their pages, and ``.ci/full`` executes them.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = ("start/researcher.md", "start/biomechanist.md", "guides/batches.md")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```\n", re.M | re.S)
LINK = re.compile(r"\[([^\]]+)\]\((?!https:)[^)]+\)")
NEW_FOLDER = """import os
import tempfile

os.chdir(tempfile.mkdtemp())  # the files of this notebook go into a folder of their own"""

Cell = dict[str, object]


def convert_page(text: str) -> dict[str, object]:
    """The notebook of a page in MyST Markdown, as the JSON of nbformat 4.5."""
    prose, *rest = BLOCK.split(text)
    cells = [_markdown(prose), _code(NEW_FOLDER)]
    for language, block, after in zip(*[iter(rest)] * 3, strict=True):
        if language == "python":
            cells.append(_code(block.rstrip()))
        elif language == "sh":
            cells.append(_code("\n".join(f"!{line}" for line in block.splitlines())))
        elif language == "output":
            cells[-1]["outputs"] = [{"output_type": "stream", "name": "stdout", "text": block}]
        else:
            cells.append(_markdown(f"```{language}\n{block}```"))
        if after.strip():
            cells.append(_markdown(after))
    numbered = [cell | {"id": f"cell-{number}"} for number, cell in enumerate(cells)]
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    return {"nbformat": 4, "nbformat_minor": 5, "metadata": metadata, "cells": numbered}


def _markdown(text: str) -> Cell:
    """A cell of prose; a link to another page is its text, since a notebook stands alone."""
    return {"cell_type": "markdown", "metadata": {}, "source": LINK.sub(r"\1", text.strip())}


def _code(text: str) -> Cell:
    empty: list[object] = []
    return {
        "cell_type": "code",
        "metadata": {},
        "execution_count": None,
        "source": text,
        "outputs": empty,
    }


def write_notebooks(folder: Path, pages: tuple[str, ...] = PAGES) -> list[Path]:
    """Write ``folder/NAME.ipynb`` for each page, by its path below docs; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for page in pages:
        path = folder / Path(page).with_suffix(".ipynb").name
        notebook = convert_page((ROOT / "docs" / page).read_text("utf-8"))
        path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", "utf-8")
        paths.append(path)
    return paths


if __name__ == "__main__":
    print(*write_notebooks(Path(sys.argv[1]), tuple(sys.argv[2:]) or PAGES), sep="\n")
