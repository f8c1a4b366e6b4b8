"""``mcz.bag``: files in a bag of their own."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import date
from pathlib import Path

from mcz.errors import AccessError, ExistsError, FormatError, OptionError, reason_of
from mcz.files.bags.manifests import (
    ALGORITHMS,
    DECLARATION,
    INFO,
    PAYLOAD,
    digests,
    manifest_text,
    tags_text,
)
from mcz.files.reading.faults import quick_check
from mcz.model.text_format import counted

SUFFIX = ".mcz"
OXUM = "Payload-Oxum"  # bytes and files of the payload, which we count ourselves


def bag(
    files: Sequence[str | os.PathLike[str]],
    folder: str | os.PathLike[str],
    info: Mapping[str, str] | None = None,
    *,
    software: str = "mcz",
) -> Path:
    """Make ``folder``, which must not exist, a bag with copies of ``files``; return it.

    ``info``: lines of ``bag-info.txt``, such as {"Source-Organization": "..."}; Bagging-Date is
    today unless given, Bag-Software-Agent is ``software``. Every ``.mcz`` is checked quickly first.
    The folder gets its name when it is complete. Raises FormatError for a damaged ``.mcz``,
    ExistsError where ``folder`` exists, OptionError for two files of one name and a name with % or
    a line end, AccessError where a file cannot be read or written.
    """
    target, paths = Path(folder), [Path(file) for file in files]
    lines = _info_lines(dict(info or {}), software)
    if os.path.lexists(target):
        raise ExistsError("it exists; a bag is a new folder", path=target)
    _check_files(paths)
    try:
        temporary = Path(
            tempfile.mkdtemp(prefix=f".{target.name[:48]}.", suffix=".part", dir=target.parent)
        )
    except OSError as error:
        raise AccessError(reason_of(error), path=target) from None
    try:
        _fill(temporary, paths, lines)
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o777 & ~umask)  # mkdtemp made it private
        if os.path.lexists(target):
            raise ExistsError("it exists; a bag is a new folder", path=target)
        temporary.rename(target)
    except BaseException as error:
        with suppress(OSError):
            shutil.rmtree(temporary)
        if isinstance(error, OSError):
            raise AccessError(reason_of(error), path=target) from error
        raise
    return target


def _info_lines(info: dict[str, str], software: str) -> list[tuple[str, str]]:
    if any(name.lower() == OXUM.lower() for name in info):
        raise OptionError(f"{OXUM} is counted, it cannot be given")
    given = {name.lower() for name in info}
    ours = {"Bagging-Date": date.today().isoformat(), "Bag-Software-Agent": software}
    lines = [*info.items(), *(pair for pair in ours.items() if pair[0].lower() not in given)]
    tags_text(lines)  # raises before any work
    return lines


def _check_files(paths: Sequence[Path]) -> None:
    if not paths:
        raise OptionError("a bag of no files")
    names: dict[str, Path] = {}
    for path in paths:
        other = names.setdefault(path.name.casefold(), path)
        if other is not path:
            raise OptionError(f"{other} and {path} would have one name in the bag")
        if set(path.name) & set("%\r\n"):  # RFC 8493 escapes them, but some tools do not
            raise OptionError("tools for bags differ on names with %; rename it", path=path)
        if not path.is_file():
            raise AccessError(f"{'not a file' if path.exists() else 'no such file'}", path=path)
    for path in paths:
        if path.suffix.lower() != SUFFIX:
            continue
        problems = quick_check(path)[1]
        if problems:
            more = f" and {len(problems) - 1} more" if len(problems) > 1 else ""
            text = f"{counted(len(problems), 'fault')}: {problems[0].message}{more}"
            raise FormatError(f"damaged, so not put into a bag; {text}", path=path)


def _fill(folder: Path, paths: Sequence[Path], lines: list[tuple[str, str]]) -> None:
    data = folder / PAYLOAD
    data.mkdir()
    by_algorithm: dict[str, dict[str, str]] = {name: {} for name in ALGORITHMS}
    size = 0
    for path in sorted(paths, key=lambda path: path.name):
        copy = data / path.name
        shutil.copyfile(path, copy)
        _sync(copy)
        size += copy.stat().st_size
        if _add_digests(by_algorithm, f"{PAYLOAD}/{path.name}", copy) != digests(path):
            raise AccessError("it changed while it was copied", path=path)
    tags = {
        DECLARATION: "BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n",
        INFO: tags_text([*lines, (OXUM, f"{size}.{len(paths)}")]),
    }
    tags |= {f"manifest-{name}.txt": manifest_text(rows) for name, rows in by_algorithm.items()}
    stated: dict[str, dict[str, str]] = {name: {} for name in ALGORITHMS}
    for name, text in tags.items():
        _write(folder / name, text)
        _add_digests(stated, name, folder / name)
    for name, rows in stated.items():
        _write(folder / f"tagmanifest-{name}.txt", manifest_text(rows))


def _add_digests(by_algorithm: dict[str, dict[str, str]], name: str, path: Path) -> dict[str, str]:
    digest_of = digests(path)
    for algorithm, digest in digest_of.items():
        by_algorithm[algorithm][name] = digest
    return digest_of


def _write(path: Path, text: str) -> None:
    path.write_bytes(text.encode("utf-8"))
    _sync(path)


def _sync(path: Path) -> None:
    with path.open("rb") as stream:
        os.fsync(stream.fileno())
