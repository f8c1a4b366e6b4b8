"""The files below a folder that are packed, their order and names, and their times (``mtime``)."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from mcz.errors import AccessError, OptionError, reason_of, remark_of
from mcz.files.editing.batch_report import Outcome
from mcz.files.reading.clips import FEW, list_some
from mcz.hints import Hint, Remark
from mcz.model.types import Target
from mcz.sources import FORMATS

SNIFFED = 2**16  # bytes that tell what a file is


def files_below(root: Path, target: Target | None) -> tuple[list[Path], list[Outcome]]:
    """The files below ``root`` but for an earlier ``target``, and what else there is, in order."""
    own = Path(target).resolve() if isinstance(target, (str, os.PathLike)) else None
    if own is not None and own.suffix.lower() != ".mcz":
        own = None  # a file to be packed, which may not be replaced
    files: list[Path] = []
    others: list[Outcome] = []

    def say(path: Path, result: str, text: str) -> None:
        others.append(Outcome(path.relative_to(root).as_posix(), result, 0, text))

    def unreadable(error: OSError) -> None:
        if Path(error.filename) == root:
            raise AccessError(reason_of(error), path=root) from None
        say(Path(error.filename), "failed", remark_of(error))

    for folder, folders, names in os.walk(root, onerror=unreadable):
        for path in (Path(folder, name) for name in (*folders, *names)):
            if path.is_symlink():
                say(path, "skipped", "a symbolic link; only files are packed")
            elif path.is_file():
                if path.resolve() != own:
                    files.append(path)
            elif not path.is_dir():
                say(path, "skipped", "neither a file nor a folder")

    def key(name: str) -> bytes:
        return os.fsencode(name)

    files.sort(key=lambda path: key(path.relative_to(root).as_posix()))
    return files, others


def motion_files(paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """The files of source formats, and the others."""
    motions = [path for path in paths if _is_motion(path)]
    chosen = set(motions)
    return motions, [path for path in paths if path not in chosen]


def _is_motion(path: Path) -> bool:
    """Return True for a suffix of a source format, with fitting content where others use it, too.

    One that cannot be read counts: whoever wants it is told so.
    """
    suffix = path.suffix.lower()
    for source_format in FORMATS.values():
        if suffix in source_format.suffixes:
            if source_format.is_motion is None:
                return True
            try:
                with path.open("rb") as file:
                    return source_format.is_motion(file.read(SNIFFED))
            except OSError:
                return True
    return False


NO_MOTION = Remark("no motion file", Hint.KEEP_ALL)


def skipped_outcome(path: Path, root: Path) -> Outcome:
    name = path.relative_to(root).as_posix()
    return Outcome(name, "skipped", size_of(path), NO_MOTION)


def dropped_facts(root: Path, packed: Sequence[Path], *, with_times: bool) -> Iterator[str]:
    """Parts of a folder that no archive has: empty folders, modes, and times but of clips."""

    def some(word: str, paths: Iterable[Path]) -> Iterator[str]:
        names = [path.relative_to(root).as_posix() for path in paths]
        if names:
            yield f"{word}: {list_some(names)}" + (f" ({len(names)} in all)" if names[FEW:] else "")

    walk = os.walk(root)
    yield from some(
        "empty folders", sorted(Path(f) for f, below, files in walk if not below + files)
    )
    if os.name == "posix":
        yield from some("modes of executable files", filter(_is_executable, packed))
    if with_times:
        others = (p for p in packed if p.suffix.lower() == ".asf" or not _is_motion(p))
        yield from some("times of files that are no clips", others)


def _is_executable(path: Path) -> bool:
    with suppress(OSError):
        return bool(path.stat().st_mode & 0o111)
    return False


def size_of(path: Path) -> int:
    with suppress(OSError, ValueError):
        return path.stat().st_size
    return 0


def find_sources(
    sources: Sequence[str | os.PathLike[str]], root: str | os.PathLike[str] | None, target: Target
) -> tuple[list[tuple[Path, str]], list[Outcome]]:
    """The files that ``sources`` name, each with its name in an archive; and what is left out.

    A folder stands for the motion files below it, under their paths relative to it. ``root``: all
    names are relative to that; raises OptionError for a file that does not lie below.
    """
    found: list[tuple[Path, str]] = []
    skipped: list[Outcome] = []
    for source in map(Path, sources):
        if not source.is_dir():
            found.append((source, source.name if root is None else _relative(source, root)))
            continue
        paths, others = files_below(source, target)
        paths, left = motion_files(paths)
        skipped += [*others, *(skipped_outcome(path, source) for path in left)]
        base = source if root is None else root
        found += [(path, _relative(path, base)) for path in paths]
    return found, skipped


def _relative(path: Path, root: str | os.PathLike[str]) -> str:
    try:
        return path.resolve().relative_to(Path(root).resolve()).as_posix()
    except ValueError:
        raise OptionError(f"it does not lie below {root}", path=path) from None


SECOND = 10**9
FORM = re.compile(r"([0-9-]{10}T[0-9:]{8})(?:\.([0-9]{1,9}))?Z")


def stamp(path: Path) -> str:
    """The time of a file, with as many decimals as it needs; raises OSError.

    >>> import tempfile
    >>> path = Path(tempfile.mkstemp()[1])
    >>> os.utime(path, ns=(0, 1_500_000_000_250_000_000))
    >>> stamp(path), nanoseconds(stamp(path))
    ('2017-07-14T02:40:00.25Z', 1500000000250000000)
    """
    seconds, rest = divmod(path.stat().st_mtime_ns, SECOND)
    text = datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%S")
    return text + (f".{rest:09d}".rstrip("0") if rest else "") + "Z"


def nanoseconds(text: str) -> int | None:
    """Nanoseconds since 1970; None for what is no such time."""
    match = FORM.fullmatch(text)
    if not match:
        return None
    try:
        seconds = int(datetime.fromisoformat(match[1] + "+00:00").timestamp())
    except (ValueError, OverflowError):
        return None
    return seconds * SECOND + int((match[2] or "").ljust(9, "0"))


def set_time(path: Path, text: str | None) -> bool:
    """Give a file the time that its metadata state; return whether they do."""
    found = None if text is None else nanoseconds(text)
    if found is not None:
        os.utime(path, ns=(found, found))
    return found is not None
