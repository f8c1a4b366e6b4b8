"""Check that source files come back byte for byte by every way out of an .mcz.

``python -m tools.ways_out FOLDER`` encodes each source file below FOLDER by itself, and all of them
in one archive, runs the commands that give a file back, and prints how many outputs are the same
bytes and are called "restored".
"""

from __future__ import annotations

import io
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr
from pathlib import Path
from tempfile import TemporaryDirectory

from mcz.cli.common import run
from mcz.cli.main import cli
from mcz.files.editing.folders import files_below, motion_files
from mcz.sources import format_of

Way = Callable[[Path, Path, Path], tuple[list[object], Path]]  # source, .mcz, folder: words, output
OF_CLIPS = ("frames", "extract")  # ways that a skeleton alone does not have


def run_command(*words: object) -> tuple[int, bytes]:
    """The exit code of a command and what it prints."""
    printed, before = io.BytesIO(), sys.stdout
    sys.stdout = io.TextIOWrapper(printed, write_through=True)
    try:
        with redirect_stderr(io.StringIO()):
            code = int(run(cli, "mcz", [str(word) for word in words]))
        return code, printed.getvalue()
    finally:
        sys.stdout = before


def _decode_to(name: Callable[[Path], str], *words: str) -> Way:
    """``decode`` to a name made of the source's."""

    def way(source: Path, archive: Path, folder: Path) -> tuple[list[object], Path]:
        output = folder / name(source)
        return ["decode", archive, *words, "-o", output], output

    return way


def _into_folder(source: Path, archive: Path, folder: Path) -> tuple[list[object], Path]:
    return ["decode", archive, "-o", f"{folder}/new/"], folder / "new" / source.name


def _beside(source: Path, archive: Path, folder: Path) -> tuple[list[object], Path]:
    return ["decode", archive], archive.parent / source.name


def _unpack_command(source: Path, archive: Path, folder: Path) -> tuple[list[object], Path]:
    return ["unpack", archive, folder], folder / source.name


def _extract_command(source: Path, archive: Path, folder: Path) -> tuple[list[object], Path]:
    assert run_command("extract", archive, folder / "part.mcz", "--frames", "0:")[0] == 0, source
    return _decode_to(lambda path: f"of-part{path.suffix}")(source, folder / "part.mcz", folder)


def _convert_command(source: Path, archive: Path, folder: Path) -> tuple[list[object], Path]:
    words = ["--skeleton", "none"] if source.suffix.lower() == ".amc" else []
    return ["convert", source, folder / f"copy{source.suffix}", *words], folder / (
        f"copy{source.suffix}"
    )


WAYS: dict[str, Way] = {
    "-o NAME.ext": _decode_to(lambda path: f"back{path.suffix.lower()}"),
    "-o NAME.EXT": _decode_to(lambda path: f"BACK{path.suffix.upper()}"),
    "-o NAME": _decode_to(lambda _: "back"),
    "-o FOLDER/": _into_folder,
    "no -o": _beside,
    "frames": _decode_to(lambda path: f"all{path.suffix}", "--frames", "0:"),
    "extract": _extract_command,
    "convert": _convert_command,
    "unpack": _unpack_command,
}


def ways_of(source: Path, folder: Path) -> Iterator[tuple[str, bool]]:
    """Each way that a source file has, and whether the same bytes came, and that was said.

    Nothing where the file is refused.
    """
    archive, data = folder / "one" / "a.mcz", source.read_bytes()
    archive.parent.mkdir()
    words = ["encode", source, "-o", archive, "--archive"]
    if run_command(*words)[0] and run_command(*words, "--skeleton", "none", "--force")[0]:
        return
    is_skeleton = format_of(source, data).is_skeleton
    yield "-o -", run_command("decode", archive, "-o", "-", "--max-decoded", "2G") == (0, data)
    for name, way in WAYS.items():
        if is_skeleton and name in OF_CLIPS:
            continue
        own = folder / name.replace("/", "")
        own.mkdir()
        command, output = way(source, archive, own)
        code, printed = run_command(*command, "--json", "--max-decoded", "2G")
        document = json.loads(printed) if code == 0 else {}
        results = {row["result"] for row in document.get("outputs", document.get("files", ()))}
        is_same = code == 0 and output.read_bytes() == data
        yield name, is_same and results == {"restored"}


def count_restored(root: Path, paths: list[Path], folder: Path) -> tuple[int, int]:
    """Number of files that ``unpack`` restores of one archive, and number that it holds."""
    assert run_command("pack", root, folder / "all.mcz", "--verbatim", "--jobs", "1")[0] == 0
    assert run_command("unpack", folder / "all.mcz", folder / "all")[0] == 0
    held = [(folder / "all" / path.relative_to(root), path) for path in paths]
    there = [(output, path) for output, path in held if output.is_file()]
    return sum(a.read_bytes() == b.read_bytes() for a, b in there), len(held)


def main() -> int:
    root = Path(sys.argv[1])
    began, good, bad = time.monotonic(), Counter[str](), Counter[str]()
    kinds, refused = Counter[str](), list[str]()
    paths = motion_files(files_below(root, None)[0])[0]
    for source in paths:
        with TemporaryDirectory() as name:
            found = dict(ways_of(source, Path(name)))
        if not found:
            refused.append(source.name)
        else:
            kinds[source.suffix.lower()] += 1
        for way, is_same in found.items():
            (good if is_same else bad)[way] += 1
            if not is_same:
                print(f"{source}: {way} differs")
    with TemporaryDirectory() as name:
        same, held = count_restored(root, paths, Path(name))
    print(f"{sum(kinds.values())} files: {', '.join(f'{n} {k}' for k, n in sorted(kinds.items()))}")
    print(f"refused: {', '.join(refused) or 'none'}")
    for way in ("-o -", *WAYS):
        print(f"{way:<12} {good[way]:>4} identical, {bad[way]} not")
    print(f"pack, unpack {same:>4} identical, {held - same} not")
    print(f"{time.monotonic() - began:.0f} s")
    return int(bool(bad) or same != held)


if __name__ == "__main__":
    sys.exit(main())
