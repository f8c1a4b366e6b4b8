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
from mcz.files.reading.clips import MOST_NAMES, list_some
from mcz.hints import Hint, Remark
from mcz.model.types import Target
from mcz.sources import FORMATS

SNIFFED = 2**16  # bytes at the start that show the type of a file


def files_below(root: Path, target: Target | None) -> tuple[list[Path], list[Outcome]]:
    """The files below ``root`` except the target, sorted; and outcomes of other entries."""
    archive = Path(target).resolve() if isinstance(target, (str, os.PathLike)) else None
    if archive is not None and archive.suffix.lower() != ".mcz":
        archive = None  # not an archive: it is packed, and not overwritten
    files: list[Path] = []
    others: list[Outcome] = []

    def add_outcome(path: Path, result: str, text: str) -> None:
        others.append(Outcome(path.relative_to(root).as_posix(), result, 0, text))

    def unreadable(error: OSError) -> None:
        if Path(error.filename) == root:
            raise AccessError(reason_of(error), path=root) from None
        add_outcome(Path(error.filename), "failed", remark_of(error))

    for folder, folders, names in os.walk(root, onerror=unreadable):
        for path in (Path(folder, name) for name in (*folders, *names)):
            if path.is_symlink():
                add_outcome(path, "skipped", "a symbolic link; only files are packed")
            elif path.is_file():
                if path.resolve() != archive:
                    files.append(path)
            elif not path.is_dir():
                add_outcome(path, "skipped", "neither a file nor a folder")

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
    """Return True for a suffix of a source format and, if other formats share it, fitting content.

    An unreadable file counts: opening it reports the error.
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
    """Parts of a folder that no archive has: empty folders, modes, times of some files."""

    def some(word: str, paths: Iterable[Path]) -> Iterator[str]:
        names = [path.relative_to(root).as_posix() for path in paths]
        if names:
            yield f"{word}: {list_some(names)}" + (
                f" ({len(names)} in all)" if names[MOST_NAMES:] else ""
            )

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
    names are relative to it; raises OptionError for a file outside of it.
    """
    files: list[tuple[Path, str]] = []
    skipped: list[Outcome] = []
    for source in map(Path, sources):
        if not source.is_dir():
            files.append((source, source.name if root is None else _relative(source, root)))
            continue
        paths, others = files_below(source, target)
        paths, others_ = motion_files(paths)
        skipped += [*others, *(skipped_outcome(path, source) for path in others_)]
        base = source if root is None else root
        files += [(path, _relative(path, base)) for path in paths]
    return files, skipped


def _relative(path: Path, root: str | os.PathLike[str]) -> str:
    try:
        return path.resolve().relative_to(Path(root).resolve()).as_posix()
    except ValueError:
        raise OptionError(f"it does not lie below {root}", path=path) from None


SECOND = 10**9
TIMESTAMP = re.compile(r"([0-9-]{10}T[0-9:]{8})(?:\.([0-9]{1,9}))?Z")


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
    """Nanoseconds since 1970; None if the text is not such a time."""
    match = TIMESTAMP.fullmatch(text)
    if not match:
        return None
    try:
        seconds = int(datetime.fromisoformat(match[1] + "+00:00").timestamp())
    except (ValueError, OverflowError):
        return None
    return seconds * SECOND + int((match[2] or "").ljust(9, "0"))


def set_time(path: Path, text: str | None) -> bool:
    """Set the modification time to a metadata text; return whether it is a time."""
    time = None if text is None else nanoseconds(text)
    if time is not None:
        os.utime(path, ns=(time, time))
    return time is not None
