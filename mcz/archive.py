"""Archives: many files into one, more files into it, and all of them out again."""

from __future__ import annotations

import builtins
import hashlib
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO

from mcz.codecs import DEFAULT
from mcz.container import payloads
from mcz.container.directory import Directory
from mcz.container.reader import Container
from mcz.container.source import ByteSource
from mcz.container.strict import check_path
from mcz.container.writer import Writer
from mcz.encoding import Progress
from mcz.errors import FormatError, MczError, OptionError, SourceError, TruncatedError
from mcz.file import File, open, profile_of
from mcz.formats import FORMATS
from mcz.sources import Entry, read_bytes
from mcz.targets import replacing


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one file: "parsed", "skeleton", "alias", "verbatim", "skipped", "failed"."""

    path: str
    result: str
    size: int = 0
    message: str = ""


@dataclass(slots=True)
class Report:
    """The outcomes of a command over many files."""

    outcomes: list[Outcome] = field(default_factory=list)

    @property
    def failures(self) -> list[Outcome]:
        return [outcome for outcome in self.outcomes if outcome.result == "failed"]

    def count(self, result: str) -> int:
        return sum(outcome.result == result for outcome in self.outcomes)


def pack(
    directory: str | os.PathLike[str],
    target: Any,
    *,
    codec: str = DEFAULT,
    params: Mapping[str, Any] | None = None,
    rate: float | None = None,
    unit: str | None = None,
    verbatim: bool = False,
    keep_all: bool = False,
    force: bool = False,
    archive: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Pack every motion file below ``directory`` into one MCZ file.

    A file that cannot be parsed is reported and left out; ``verbatim`` keeps it as an attachment,
    ``keep_all`` also keeps files of other kinds so. Paths are stored relative to ``directory``.
    """
    root = Path(directory)
    if not root.is_dir():
        raise OptionError(f"{root}: not a folder")
    paths, links = _files_below(root, target)
    known = {suffix for source_format in FORMATS.values() for suffix in source_format.suffixes}
    if not keep_all:
        paths = [path for path in paths if path.suffix.lower() in known]
    entries = [
        Entry(
            path,
            path.relative_to(root).as_posix(),
            codec,
            params,
            rate=rate,
            unit=unit,
            verbatim=verbatim or keep_all,
        )
        for path in sorted(paths, key=lambda path: path.relative_to(root).as_posix())
    ]
    with replacing(target, force=force) as stream:
        buffer = _Buffer(stream)
        writer = Writer(buffer, profile=profile_of(archive))
        report = _write_entries(writer, buffer, entries, progress)
        writer.finish()
        buffer.commit()
    text = "a symbolic link; only files are packed"
    report.outcomes += [Outcome(p.relative_to(root).as_posix(), "skipped", 0, text) for p in links]
    return report


def _files_below(root: Path, target: Any) -> tuple[list[Path], list[Path]]:
    """The files below ``root`` but for ``target`` itself, and the symbolic links to files."""
    own = Path(target).resolve() if isinstance(target, (str, os.PathLike)) else None
    files = [path for path in root.rglob("*") if path.is_file() and path.resolve() != own]
    return [p for p in files if not p.is_symlink()], sorted(p for p in files if p.is_symlink())


def append(
    sources: Sequence[str | os.PathLike[str]],
    target: str | os.PathLike[str],
    *,
    codec: str = DEFAULT,
    params: Mapping[str, Any] | None = None,
    skeleton: str | os.PathLike[str] | None = None,
    rate: float | None = None,
    unit: str | None = None,
    verbatim: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Add files after the last valid FOOT of an MCZ file; what it held stays readable throughout.

    A file whose writing was cut short is taken up from its last valid FOOT. When a source cannot
    be added, nothing is.
    """
    entries = [
        Entry(Path(s), Path(s).name, codec, params, skeleton, rate, unit, verbatim) for s in sources
    ]
    with _appending(Path(target)) as (stream, container):
        directory = container.directory
        buffer = _Buffer(stream)
        writer = Writer(
            buffer, profile=container.profile, directory=directory, offset=directory.end
        )
        report = _write_entries(writer, buffer, entries, progress)
        if report.failures:
            raise SourceError("; ".join(o.message for o in report.failures))
        writer.finish()
        buffer.commit()
    return report


@contextmanager
def _appending(path: Path) -> Iterator[tuple[BinaryIO, Container]]:
    """What the block writes lands behind the last valid FOOT, in place of what was cut short there.

    If the block fails, the file is not touched.
    """
    try:
        stream = builtins.open(path, "r+b")  # noqa: SIM115 - closed by the with below
    except OSError as error:
        raise OptionError(f"{path}: {error.strerror or error}") from None
    with stream:
        container = _up_to_last_foot(stream, str(path))
        end = container.directory.end
        added = io.BytesIO()
        yield added, container
        try:
            stream.seek(end)
            stream.write(added.getvalue())
            stream.truncate()
            stream.flush()
            os.fsync(stream.fileno())
        except BaseException:
            stream.truncate(end)
            raise


def _up_to_last_foot(stream: BinaryIO, name: str) -> Container:
    try:
        return Container(ByteSource(stream, name=name))
    except TruncatedError as error:
        if error.last_foot is None:
            raise
        return Container(ByteSource(stream, name=name, size=error.last_foot))


class _Buffer:
    """Holds what an entry writes until it is whole, so that a failed one leaves no trace."""

    def __init__(self, sink: BinaryIO) -> None:
        self._sink, self._pending = sink, io.BytesIO()

    def write(self, data: bytes, /) -> int:
        return self._pending.write(data)

    def commit(self) -> None:
        self._sink.write(self._pending.getvalue())
        self._pending = io.BytesIO()

    def discard(self) -> None:
        self._pending = io.BytesIO()


def _write_entries(
    writer: Writer, buffer: _Buffer, entries: Sequence[Entry], progress: Progress | None
) -> Report:
    report = Report()
    seen: dict[bytes, tuple[int, bytes]] = {}
    buffer.commit()
    for done, entry in enumerate(entries):
        before, offset = _snapshot(writer.directory), writer.offset
        size = entry.path.stat().st_size if entry.path.exists() else 0
        try:
            result = _write_entry(writer, entry, seen)
            report.outcomes.append(Outcome(entry.name, result, size))
            buffer.commit()
        except MczError as error:
            buffer.discard()
            writer.rewind(before, offset)
            report.outcomes.append(Outcome(entry.name, "failed", size, str(error)))
        if progress is not None:
            progress(done + 1, len(entries), entry.name)
    return report


def _snapshot(directory: Directory) -> Directory:
    kept = copy(directory)
    for name in ("shared", "attachments", "aliases", "clips"):
        setattr(kept, name, dict(getattr(directory, name)))
    return kept


def _write_entry(writer: Writer, entry: Entry, seen: dict[bytes, tuple[int, bytes]]) -> str:
    """Write one file, or only its name where the same bytes are there already."""
    digest = hashlib.sha256(read_bytes(entry.path)).digest()
    is_amc = entry.path.suffix.lower() == ".amc"  # its values hang on the ASF beside it
    if digest in seen and not is_amc:
        writer.alias(entry.name, *seen[digest])
        return "alias"
    clips, attachments = len(writer.directory.clips), len(writer.directory.attachments)
    result = entry.write(writer)
    if len(writer.directory.clips) > clips:
        name = next(reversed(writer.directory.clips))
        seen[digest] = (payloads.OF_CLIP, name.encode())
    elif len(writer.directory.attachments) > attachments:
        seen[digest] = (payloads.OF_ATTACHMENT, entry.name.encode())
    return result


def unpack(
    target: Any,
    directory: str | os.PathLike[str],
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Write every source file and attachment of an MCZ file below ``directory``.

    Each file appears under its name only when it is whole and its hash is right. Clips without
    a source are reported as skipped.
    """
    root, report = Path(directory), Report()
    with open(target) as file:
        jobs = list(named_files(file))
        written: set[Path] = set()
        for done, (name, restore) in enumerate(jobs):
            try:
                path = root / safe_path(name)
                if path in written:
                    raise FormatError("another file in the archive has the same path")
                data = restore()
                written.add(path)
                path.parent.mkdir(parents=True, exist_ok=True)
                with replacing(path, force=force) as stream:
                    stream.write(data)
                report.outcomes.append(Outcome(name, "restored", len(data)))
            except (MczError, OSError) as error:
                report.outcomes.append(Outcome(name, "failed", 0, f"{name}: {error}"))
            if progress is not None:
                progress(done + 1, len(jobs), name)
        for clip in file.clips.values():
            if clip.source is None or not clip.source.path:
                text = "it has no source file" if clip.source is None else "its file has no name"
                report.outcomes.append(Outcome(clip.name, "skipped", 0, text))
    return report


def named_files(file: File) -> Iterator[tuple[str, Any]]:
    """Path and restoring function of every file that the archive holds under a name."""
    for clip in file.clips.values():
        if clip.source is not None and clip.source.path:
            yield clip.source.path, clip.source_bytes
    for attachment in file.attachments.values():
        yield attachment.name, attachment.read
    for name, (of, target) in file.aliases.items():
        yield name, _alias_reader(file, name, of, target)


def _alias_reader(file: File, name: str, of: int, target: bytes) -> Any:
    """What restores an alias; it raises FormatError where its target is not there."""
    if of == payloads.OF_SKELETON:
        return lambda: file.skeleton_bytes(target)

    def restore() -> bytes:
        table: Mapping[str, Any] = file.clips if of == payloads.OF_CLIP else file.attachments
        found = table.get(target.decode("utf-8", "replace"))
        if found is None:
            raise FormatError(f"alias {name!r} names {target!r}, which is not there")
        data: bytes = found.source_bytes() if of == payloads.OF_CLIP else found.read()
        return data

    return restore


def safe_path(name: str) -> PurePosixPath:
    """``name`` as a relative path; raises FormatError where it would leave the folder."""
    check_path(name, "archive")
    return PurePosixPath(name)
