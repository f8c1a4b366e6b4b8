"""The files that an archive restores: listed, and written, each under its path, only whole."""

from __future__ import annotations

import hashlib
import os
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path, PurePosixPath

from mcz.container import payloads
from mcz.container.chunks import CRC, HEADER
from mcz.container.reader import Container
from mcz.container.scanner import check_path
from mcz.container.source import Forward
from mcz.errors import FormatError, MczError, OptionError
from mcz.files.editing import Outcome, Report, failure_outcome
from mcz.files.editing.folders import HIDDEN, Folder, PortableNames, notes_on, set_time, visible
from mcz.files.editing.rewriting import ALIAS, ATTACHMENT, CLIP, SKELETON, Item
from mcz.files.jobs import limit_jobs, share_clips
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Where, list_some
from mcz.files.reading.differences import RESTORED, fidelity_of, text_notes
from mcz.files.reading.file import File, open
from mcz.files.writing.atomic import Digest
from mcz.model.checks import PATH, check_arguments
from mcz.model.schema import parse, parse_until, read_varint
from mcz.model.types import Progress, Settings, Target

Content = dict[bytes, tuple[int, bytes]]  # SHA-256 of a file -> target of an alias


def stored_files(container: Container) -> tuple[dict[str, Digest], Content]:
    """Index the restored files by path, with their SHA-256 or its getter, and by content.

    Damaged ones cannot be restored, and are left out.
    """
    paths: dict[str, Digest] = {}
    contents: Content = {}
    for name, path, digest in _clip_sources(container):
        contents.setdefault(digest, (payloads.OF_CLIP, name.encode()))
        if path:
            paths.setdefault(path, digest)
    for name, attachment in container.directory.attachments.items():
        with suppress(FormatError):
            part = attachment.parts[0]
            digest = bytes(parse(payloads.Atta, container.payload(part), part.label).sha256)
            contents.setdefault(digest, (payloads.OF_ATTACHMENT, name.encode()))
            paths.setdefault(name, digest)
    aliases = container.directory.aliases
    by_target = {target: digest for digest, target in contents.items()} if aliases else {}
    file = File(container)
    for name, (of, target) in aliases.items():
        one = StoredFile(name, ALIAS, name)
        paths.setdefault(name, by_target.get((of, bytes(target))) or partial(_digest_of, file, one))
    return paths, contents


def _clip_sources(container: Container) -> Iterator[tuple[str, str, bytes]]:
    """Name, path and digest of each clip with a source; without rows of the directory."""
    read = Forward(container.source).read
    for name, at, size, cend_at, cend_size in container.directory.clips.places():
        if not cend_size:
            continue
        clip, cend = read(at, size), read(cend_at, cend_size)
        with suppress(FormatError, IndexError, UnicodeDecodeError):
            path, digest = _parse_path(_check_chunk(clip)), _parse_digest(_check_chunk(cend))
            if path is not None and digest:
                yield name, path, digest


def _check_chunk(chunk: bytes) -> bytes:
    """The payload of a whole chunk; raises FormatError for a wrong crc."""
    if CRC.pack(zlib.crc32(memoryview(chunk)[: -CRC.size])) != chunk[-CRC.size :]:
        raise FormatError("a chunk is damaged")
    return chunk[HEADER.size : -CRC.size]


def _parse_path(clip: bytes) -> str | None:
    size, at = read_varint(clip, 2)
    flags, at = clip[at + size], at + size + 17
    if flags & payloads.HAS_TIME_BASE:
        source = parse_until(payloads.Clip, clip, "CLIP", "signals").source
        return None if source is None else source.path
    for _ in range(3):
        _, at = read_varint(clip, at)
    count, at = read_varint(clip, at)
    for _ in range(2 * count):
        size, at = read_varint(clip, at)
        at += size
    if not clip[at]:
        return None
    size, at = read_varint(clip, at + 19)
    size, at = read_varint(clip, at + size)
    return clip[at : at + size].decode()


def _parse_digest(cend: bytes) -> bytes:
    """The hash of the source file in the payload of a CEND, empty without one."""
    _, at = read_varint(cend, 0)
    if cend[at]:  # runs of missing frames
        return parse_until(payloads.Cend, cend, "CEND", "value_sha256").source_sha256 or b""
    return cend[at + 2 : at + 34] if cend[at + 1] else b""


def _digest_of(file: File, one: StoredFile) -> bytes:
    return hashlib.sha256(_restore((file, None), one)).digest()


NAMES = ("stored", "portable", "strict")  # treatment of names that are not portable


@check_arguments(directory=PATH)
def unpack(
    target: Target,
    directory: str | os.PathLike[str],
    *,
    clips: Sequence[str] | None = None,
    where: Where | None = None,
    salvage: bool = False,
    force: bool = False,
    names: str = "stored",
    mtimes: bool = False,
    max_decoded: int | None = None,
    threads: int | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """Write every source file and attachment of an MCZ file below ``directory``.

    ``clips``: only these clips, and their skeletons; ``where``: only clips that match it, see
    ``File.find``. Each file appears under its name only when it is complete and its hash is right.
    No symbolic link below ``directory`` is followed. Clips without a source are reported as
    skipped. With ``salvage`` the file may be damaged: intact files are written, the rest is
    reported as damaged. ``max_decoded`` and ``threads`` are as in ``mcz.open``. ``jobs`` processes
    restore in parallel, by default one.

    ``names`` decides about names that are invalid on some systems, or next to another: "stored"
    writes them unchanged, except control characters and those that turn the direction of text,
    which the outcomes report, and refuses names that this system or disk cannot have; "portable"
    gives them others, which the outcomes report; "strict" refuses them. One file never replaces
    another of the same archive. ``mtimes``: files get the modification time in the metadata of
    their clip, if it has one (``mcz.pack(..., mtimes=True)``).
    """
    if names not in NAMES:
        raise OptionError(f"names is {names!r}, not one of {', '.join(NAMES)}")
    folder, report = Folder(Path(directory)), Report()
    options: Settings = {"max_decoded": max_decoded, "threads": threads}
    with limit_jobs(jobs), open(target, salvage=salvage, **options) as opened:
        file = File(opened.container.strictly())
        report.damage += opened.damage
        timeless: list[str] = []  # files whose times are not in the archive
        chosen_clips, whole = file.select_clips(clips, where), clips is None and where is None
        stored = list(files_of(file, None if whole else chosen_clips))
        writing = _Writing(target, folder, force, names, [one.path for one in stored])
        with share_clips(_restore, file, stored) as restoring:
            for done, (one, restore) in enumerate(zip(stored, restoring, strict=True)):
                outcome = writing.outcome(one.path, restore)
                if outcome.result == RESTORED:
                    clip = file.clips[one.name] if one.kind == CLIP else None
                    time = clip.metadata.get("mtime") if mtimes and clip is not None else None
                    if mtimes and not set_time(writing.place, time):
                        timeless.append(one.path)
                    notes = () if clip is None else text_notes(clip)
                    outcome = replace(outcome, result=_fidelity_of(file, one), notes=notes)
                if salvage and writing.is_damaged:
                    outcome = replace(outcome, result="damaged")
                report.outcomes.append(outcome)
                if progress is not None:
                    progress(done + 1, len(stored), one.path)
        if timeless:
            report.left_out.append(f"times of files that are not clips: {list_some(timeless)}")
        report.outcomes += _fileless_outcomes(chosen_clips)
    return report


def _fileless_outcomes(clips: Iterable[Clip]) -> Iterator[Outcome]:
    for clip in clips:
        with suppress(FormatError):  # it has failed already
            if clip.source is None or not clip.source.path:
                text = "it has no source file" if clip.source is None else "its file has no name"
                yield Outcome(clip.name, "skipped", 0, text)


@dataclass(frozen=True, slots=True)
class StoredFile:
    """A file of the archive under ``path``, from the item ``name`` of that ``kind``."""

    path: str
    kind: str
    name: str


def files_of(file: File, clips: Sequence[Clip] | None = None) -> Iterator[StoredFile]:
    """All files of the archive, or only the sources and skeletons of ``clips``."""
    for clip in file if clips is None else clips:
        try:
            path = clip.source.path if clip.source is not None else ""
        except FormatError:  # restoring it reports the error
            path = clip.name
        if path:
            yield StoredFile(path, CLIP, clip.name)
    for name in file.attachments if clips is None else ():
        yield StoredFile(name, ATTACHMENT, name)
    skeletons = None if clips is None else {id_.hex() for id_ in file.skeleton_ids(clips)}
    for name in file.aliases:
        kind, target = file.alias_of(name)
        if skeletons is None or (kind == SKELETON and target in skeletons):
            yield StoredFile(name, ALIAS, name)


def named_files(file: File) -> Iterator[tuple[str, Callable[[], bytes]]]:
    """Path and restoring function of every file of the archive."""
    for one in files_of(file):
        yield one.path, partial(_restore, (file, None), one)


def _resolve(file: File, one: StoredFile) -> Item:
    return file.alias_of(one.name) if one.kind == ALIAS else (one.kind, one.name)


def _restore(shared: tuple[File, object], one: StoredFile) -> bytes:
    """The bytes of a file; raises FormatError if they cannot be restored."""
    file, _ = shared
    kind, name = _resolve(file, one)
    if kind == SKELETON:
        return file.skeleton_bytes(bytes.fromhex(name))
    if one.kind == ALIAS and name not in (file.clips if kind == CLIP else file.attachments):
        raise FormatError(f"alias {one.name!r} refers to {name!r}, which does not exist")
    return file.clips[name].source_bytes() if kind == CLIP else file.attachments[name].read()


def _fidelity_of(file: File, one: StoredFile) -> str:
    """The word for a written file: other than "restored" only of a clip."""
    kind, name = _resolve(file, one)
    clip = file.clips.get(name) if kind == CLIP else None
    return RESTORED if clip is None else fidelity_of(clip)


class _Writing:
    """Writes files below a folder, no two to one place.

    ``is_damaged``: the last one could not be restored, or its name is not allowed.
    """

    def __init__(
        self, target: Target, folder: Folder, force: bool, names: str, paths: Sequence[str]
    ) -> None:
        self._target, self._folder, self._force = target, folder, force
        self._names, self._notes, self._written = names, notes_on(paths), set[str]()
        plain = (path for path in paths if not HIDDEN.search(path))
        is_portable = names == "portable"
        self._renamed = PortableNames() if is_portable else PortableNames(visible, plain)
        self.is_damaged = False
        self.place = Path()  # of the file that was written last

    def outcome(self, path: str, restore: Callable[[], bytes]) -> Outcome:
        """Write the result of ``restore`` to its place; return the outcome."""
        self.is_damaged = False
        try:
            size, as_path = self._write(path, restore)
        except (MczError, OSError) as error:
            self.is_damaged |= isinstance(error, FormatError)
            return failure_outcome(path, error)
        return Outcome(path, RESTORED, size, "" if as_path == path else f"as {as_path}")

    def _write(self, path: str, restore: Callable[[], bytes]) -> tuple[int, str]:
        as_path = str(safe_path(path))
        if self._names == "portable" or HIDDEN.search(as_path):
            as_path = self._renamed(as_path)
        if self._names == "strict" and path in self._notes:
            raise FormatError(self._notes[path])
        if path in self._written:
            raise FormatError("another file of the archive has the same path")  # PATH-06
        self.is_damaged = True
        data = restore()
        self.is_damaged = False
        self._written.add(path)
        self.place = self._folder.write(as_path, data, self._target, force=self._force, name=path)
        return len(data), as_path


def safe_path(name: str) -> PurePosixPath:
    """``name`` as a relative path; raises FormatError if it would leave the folder."""
    check_path(name, "archive")
    return PurePosixPath(name)
