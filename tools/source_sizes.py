"""Compare sizes of source files with xz: ``python -m tools.source_sizes FILES OR FOLDERS``.

A line a file: its bytes, xz -9e, mcz with --effort fast and best, and whether it came back
byte for byte.
"""

from __future__ import annotations

import lzma
import sys
import tempfile
import zlib
from pathlib import Path

import mcz
from mcz.errors import MczError
from mcz.sources import FORMATS

SUFFIXES = {suffix for source_format in FORMATS.values() for suffix in source_format.suffixes}
EFFORTS = ("fast", "best")


def measure(path: Path, folder: Path) -> tuple[list[int], str]:
    """Bytes of the file, deflate, xz, fast and best; and what became of it."""
    data = path.read_bytes()
    sizes = [len(data), len(zlib.compress(data, 9))]
    sizes.append(len(lzma.compress(data, preset=9 | lzma.PRESET_EXTREME)))
    for effort in EFFORTS:
        target = folder / "out.mcz"
        try:
            mcz.encode(path, target, effort=effort, force=True)
        except MczError as error:
            return [*sizes, sizes[2], sizes[2]], f"refused: {error}"[:100]
        sizes.append(target.stat().st_size)
        with mcz.open(target) as file:
            back = next(iter(file.clips.values())).source_bytes()
            if back != data:
                return sizes, "DIFFERS"
    return sizes, "parsed"


def main(arguments: list[str]) -> None:
    paths = [path for name in arguments for path in sorted(_files(Path(name)))]
    sums, over = [0] * 5, 0
    print(f"{'file':44s}{'bytes':>9s}{'zip':>9s}{'xz':>9s}{'fast':>9s}{'best':>9s}  best/xz")
    with tempfile.TemporaryDirectory() as folder:
        for path in paths:
            sizes, said = measure(path, Path(folder))
            sums = [a + b for a, b in zip(sums, sizes, strict=True)]
            more = sizes[4] - sizes[2]
            over += more > 200
            mark = f"  xz + {more}" if more > 0 else ""
            print(_line(path.name[:43], sizes) + f"  {said}{mark}", flush=True)
    print(_line("all", sums) + f"  {over} of {len(paths)} beyond xz + 200 bytes")


def _line(name: str, sizes: list[int]) -> str:
    return f"{name:44s}" + "".join(f"{size:9d}" for size in sizes) + f"{sizes[4] / sizes[2]:8.2f}"


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        return [p for p in path.rglob("*") if p.suffix.lower() in SUFFIXES]
    return [path]


if __name__ == "__main__":
    main(sys.argv[1:])
