"""Measure tables of docs/evidence and README, and write them there.

    python -m tools.figures [--data FOLDER] [--jobs N] [--write] [PART ...]

Prints each table as soon as it is measured; ``--write`` also replaces those in the documents. The
clips are those of CMU, in the layout of FOLDER (default: MCZ_DATA). Extra ``bench`` has the peers;
7z is measured where it is installed. All parts take about an hour on two idle cores.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from tools.figures import first_result, lossless, lossy, packing
from tools.figures.table import Table, replaced

ROOT = Path(__file__).parents[2]
PAGES = "docs/evidence/figures.md", "docs/evidence/lossy-figures.md", "README.md"
DOCUMENTS = tuple(ROOT / page for page in PAGES)
PARTS: dict[str, Callable[[Path, int], Iterator[Table]]] = {
    "lossless": lossless.tables,
    "lossy": lossy.tables,
    "lossy-codecs": lossy.tables_of_codecs,
    "packing": packing.tables,
    "first-result": first_result.tables,
}


def main() -> None:
    parser = argparse.ArgumentParser(prog="tools.figures", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", choices=[*PARTS, []])
    parser.add_argument("--data", type=Path, default=os.environ.get("MCZ_DATA"))
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--write", action="store_true", help="put the tables into the documents")
    given = parser.parse_args()
    if given.data is None:
        parser.error("no clips: give --data or set MCZ_DATA")
    for part in given.parts or PARTS:
        for name, lines in PARTS[part](given.data, given.jobs):
            print(f"<!-- figures: {name} -->\n{lines}", flush=True)
            if given.write:
                for path in DOCUMENTS:
                    text = path.read_text("utf-8")
                    path.write_text(replaced(text, {name: lines}), "utf-8")


if __name__ == "__main__":
    main()
