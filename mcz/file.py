"""The one place where motion, codec and container meet: open, read, write, encode.

``encoding.py`` turns a Motion into chunks, ``clip.py`` turns chunks back into values; this file
opens and closes the files around them. Archives of many clips are in ``archive.py``.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from mcz.clip import Clip
from mcz.codecs import DEFAULT, by_name
from mcz.container import payloads
from mcz.container.directory import AttachmentRow, Directory
from mcz.container.limits import ARCHIVE, BASE, Profile
from mcz.container.reader import Container
from mcz.container.skeletons import parse_skeleton
from mcz.container.source import open_source
from mcz.container.writer import Writer
from mcz.encoding import Progress, write_clip, write_skeleton
from mcz.errors import ChecksumError, MczError, OptionError, SourceError
from mcz.formats import FORMATS, Format, find_asf, format_by_id, format_of
from mcz.motion import Motion, Skeleton, Source
from mcz.schema import parse

UNIT_CM = {"mm": 0.1, "cm": 1.0, "dm": 10.0, "m": 100.0, "in": 2.54, "ft": 30.48}


class Attachment:
    """A file kept as it is."""

    def __init__(self, container: Container, row: AttachmentRow) -> None:
        self._container, self._row = container, row
        self.name, self.size = row.name, row.size

    def read(self) -> bytes:
        """The bytes, their hash checked."""
        return self._container.attachment(self._row)


class File:
    """An open MCZ file: its clips, skeletons and attachments by name, nothing decoded yet."""

    def __init__(self, container: Container) -> None:
        self.container = container
        rows = container.directory
        self.clips: Mapping[str, Clip] = {
            name: Clip(container, row) for name, row in rows.clips.items()
        }
        self.attachments: Mapping[str, Attachment] = {
            name: Attachment(container, row) for name, row in rows.attachments.items()
        }

    def __enter__(self) -> File:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        self.container.source.close()

    @property
    def name(self) -> str:
        return self.container.source.name

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return self.container.source.size

    @property
    def aliases(self) -> Mapping[str, tuple[int, bytes]]:
        """Further files with the content of a clip, skeleton or attachment: name -> (of, target)."""
        return self.container.directory.aliases

    @property
    def damage(self) -> list[str]:
        """What salvage found wrong, in file order."""
        return self.container.damage

    @cached_property
    def header(self) -> dict[str, Any]:
        """Format version, version needed and profile, from HEAD."""
        head = parse(payloads.HEAD, self.container.directory.head, "HEAD")
        return {
            "format_version": f"{head.major}.{head.minor}",
            "needs_version": f"{head.needs_major}.{head.needs_minor}",
            "profile": self.container.profile.name,
        }

    @cached_property
    def skeletons(self) -> list[tuple[bytes, Skeleton]]:
        """The skeletons with their ids, in file order."""
        ids = [id_ for kind, id_ in self.container.directory.shared if kind == b"SKEL"]
        return [(id_, self.skeleton(id_)) for id_ in ids]

    def skeleton(self, id_: bytes, *, with_source: bool = False) -> Skeleton:
        """The skeleton with this id; ``with_source`` also reads the template of its own file."""
        fields = self.container.shared(b"SKEL", id_, payloads.SKEL)
        skeleton = parse_skeleton(fields, self.container.profile, f"SKEL {id_.hex()}")
        if not with_source or not fields.source:
            return skeleton
        source = fields.source[0]
        return replace(
            skeleton,
            source=Source(
                format=format_by_id(source.format).name,
                template=self.container.template(bytes(source.template), source.format),
                size=source.size,
                sha256=bytes(source.sha256),
            ),
        )

    def skeleton_bytes(self, id_: bytes) -> bytes:
        """The skeleton's own source file (ASF), byte for byte."""
        import hashlib

        skeleton = self.skeleton(id_, with_source=True)
        source = skeleton.source
        if source is None:
            raise OptionError(
                f"skeleton {skeleton.name or id_.hex()} has no source file of its own"
            )
        data = FORMATS[source.format].write(skeleton)
        if len(data) != source.size or hashlib.sha256(data).digest() != source.sha256:
            raise ChecksumError(f"skeleton {id_.hex()}: the restored file differs from its source")
        return data

    def only_clip(self, name: str | None = None) -> Clip:
        """The clip called ``name``, or the only one there is; raises OptionError."""
        if name is not None and name in self.clips:
            return self.clips[name]
        names = ", ".join(list(self.clips)[:8]) + (" ..." if len(self.clips) > 8 else "")
        if name is not None:
            raise OptionError(f"{self.name}: no clip {name!r}; there are: {names or 'none'}")
        if len(self.clips) != 1:
            raise OptionError(f"{self.name} has {len(self.clips)} clips, choose one: {names}")
        return next(iter(self.clips.values()))


def open(target: Any, salvage: bool = False, max_decoded: int | None = None) -> File:
    """Open an MCZ file lazily: a path, an fsspec target, bytes or a binary stream.

    ``salvage`` reads what a damaged file still holds and lists the rest in ``File.damage``.
    ``max_decoded`` replaces the limit of decoded bytes, max(64 MiB, 4096 x file size).
    Raises FormatError, in particular TruncatedError where there is no FOOT at the end.
    """
    try:
        source = open_source(target)
    except OSError as error:
        raise OptionError(f"{target}: {error.strerror or error}") from None
    try:
        return File(Container(source, salvage=salvage, max_decoded=max_decoded))
    except MczError as error:
        source.close()
        error.args = (f"{source.name}: {error}",)
        raise
    except BaseException:
        source.close()
        raise


def read(
    path: str | os.PathLike[str],
    *,
    skeleton: str | os.PathLike[str] | Skeleton | None = None,
    rate: Fraction | float | None = None,
    unit: str | None = None,
    clip: str | None = None,
) -> Motion:
    """The motion in a BVH, AMC or MCZ file.

    An AMC finds its ASF beside it, or takes ``skeleton``, a path or a Skeleton. ``rate`` in frames
    a second and ``unit`` (a key of ``UNIT_CM``) say what the file does not. Raises SourceError,
    FormatError or OptionError.
    """
    path = Path(path)
    if path.suffix.lower() == ".mcz":
        with open(path) as file:
            motion = file.only_clip(clip).motion()
    else:
        source_format = format_of(path)
        if source_format.is_skeleton:
            raise OptionError(f"{path}: a skeleton without motion; use mcz.read_skeleton")
        motion = _read_source(path, source_format, _skeleton(path, source_format, skeleton))
    return _with_facts(motion, rate, unit)


def read_skeleton(path: str | os.PathLike[str]) -> Skeleton:
    """The skeleton in an ASF file, with its source."""
    path = Path(path)
    source_format = format_of(path)
    if not source_format.is_skeleton:
        raise OptionError(f"{path}: not a skeleton file")
    skeleton: Skeleton = _named(path, source_format.read, _bytes(path), path.stem)
    return skeleton


def _skeleton(
    path: Path, source_format: Format, given: str | os.PathLike[str] | Skeleton | None
) -> Skeleton | None:
    if not source_format.wants_skeleton:
        return None
    if isinstance(given, Skeleton):
        return given
    found = Path(given) if given is not None else find_asf(path)
    return read_skeleton(found) if found is not None else None


def _read_source(path: Path, source_format: Format, skeleton: Skeleton | None) -> Motion:
    arguments = (skeleton,) if source_format.wants_skeleton else ()
    motion: Motion = _named(path, source_format.read, _bytes(path), path.stem, *arguments)
    if motion.source is None:
        return motion
    return replace(motion, source=replace(motion.source, path=path.name))


def _named(path: Path, reader: Any, data: bytes, *arguments: Any) -> Any:
    """What ``reader`` makes of ``data``; its errors say which file."""
    try:
        return reader(data, *arguments)
    except MczError as error:
        error.args = (f"{path}: {error}",)
        raise


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror or error}") from None


def _with_facts(motion: Motion, rate: Fraction | float | None, unit: str | None) -> Motion:
    if rate is not None:
        try:
            value = Fraction(rate).limit_denominator(2**52)
        except (ValueError, ZeroDivisionError, OverflowError):
            raise OptionError(f"frame rate {rate!r} is not a number") from None
        if value <= 0:
            raise OptionError(f"frame rate {rate} is not positive")
        motion = replace(motion, frame_rate=value, frame_rate_exact=True)
    if unit is not None:
        if unit not in UNIT_CM:
            raise OptionError(f"unit {unit!r} is not one of {', '.join(UNIT_CM)}")
        motion = replace(motion, skeleton=replace(motion.skeleton, unit_cm=UNIT_CM[unit]))
    return motion


@contextmanager
def replacing(target: Any, *, force: bool) -> Iterator[BinaryIO]:
    """A binary stream whose bytes become ``target`` only when the block ends well.

    On disk that is a temporary file beside the target, synced and renamed; a stream that was
    given is written as it is. Raises OptionError where the target exists and not ``force``.
    """
    if hasattr(target, "write"):
        yield target
        return
    if "://" in str(target):
        import fsspec

        fs, path = fsspec.core.url_to_fs(str(target))
        if not force and fs.exists(path):
            raise OptionError(f"{target} exists; use force to replace it")
        with fs.transaction, fs.open(path, "wb") as remote:
            yield remote
        return
    path = Path(target)
    if not force and path.exists():
        raise OptionError(f"{path} exists; use force to replace it")
    with _temporary(path) as stream:
        yield stream


@contextmanager
def _temporary(path: Path) -> Iterator[BinaryIO]:
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    except OSError as error:
        raise OptionError(f"{path}: {error.strerror or error}") from None
    try:
        with os.fdopen(handle, "wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)  # mkstemp made it private
        os.replace(name, path)
        _sync_directory(path.parent)
    except BaseException:
        with suppress(OSError):
            os.unlink(name)
        raise


def _sync_directory(path: Path) -> None:
    """Make the rename itself last; not every system lets a directory be opened."""
    with suppress(OSError):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def write(
    motion: Motion,
    target: Any,
    codec: str = DEFAULT,
    *,
    force: bool = False,
    archive: bool = False,
    progress: Progress | None = None,
    **params: Any,
) -> None:
    """Write ``motion`` to a new MCZ file: a path, an fsspec target or a binary stream.

    ``params`` are the codec's; ``archive`` chooses the profile of large limits. Raises
    OptionError, MotionError, or LimitError where the profile is too small.
    """
    with replacing(target, force=force) as stream:
        writer = Writer(stream, profile=profile_of(archive))
        write_clip(writer, motion, by_name(codec), params, progress)
        writer.finish()


def profile_of(archive: bool) -> Profile:
    return ARCHIVE if archive else BASE


def encode(
    source: str | os.PathLike[str],
    target: Any,
    *,
    codec: str = DEFAULT,
    params: Mapping[str, Any] | None = None,
    skeleton: str | os.PathLike[str] | None = None,
    rate: Fraction | float | None = None,
    unit: str | None = None,
    verbatim: bool = False,
    force: bool = False,
    archive: bool = False,
    progress: Progress | None = None,
) -> None:
    """Turn one ASF, AMC or BVH file into an MCZ file.

    ``verbatim`` keeps a file that cannot be parsed as an attachment. Raises SourceError,
    OptionError, MotionError or LimitError; nothing is left under the final name then.
    """
    path = Path(source)
    with replacing(target, force=force) as stream:
        writer = Writer(stream, profile=profile_of(archive))
        entry = Entry(path, path.name, codec, params or {}, skeleton, rate, unit, verbatim, True)
        entry.write(writer, progress)
        writer.finish()


class Entry:
    """One source file on its way into an MCZ file, under the relative path ``name``."""

    def __init__(
        self,
        path: Path,
        name: str,
        codec: str = DEFAULT,
        params: Mapping[str, Any] | None = None,
        skeleton: str | os.PathLike[str] | None = None,
        rate: Fraction | float | None = None,
        unit: str | None = None,
        verbatim: bool = False,
        keep_skeleton: bool = False,
    ) -> None:
        if unit is not None and unit not in UNIT_CM:
            raise OptionError(f"unit {unit!r} is not one of {', '.join(UNIT_CM)}")
        self.path, self.name = path, name
        self.codec, self.params = by_name(codec), params or {}
        self.skeleton, self.rate, self.unit = skeleton, rate, unit
        self.verbatim = verbatim
        self.keep_skeleton = keep_skeleton  # under its own name, to be restored as well

    def write(self, writer: Writer, progress: Progress | None = None) -> str:
        """Write the file; return how: "skeleton", "parsed", "alias" or "verbatim"."""
        try:
            return self._parsed(writer, progress)
        except SourceError:
            if not self.verbatim:
                raise
        writer.attachment(self.name, _bytes(self.path))
        return "verbatim"

    def _parsed(self, writer: Writer, progress: Progress | None) -> str:
        source_format = format_of(self.path)
        if source_format.is_skeleton:
            id_ = write_skeleton(writer, self._unit(read_skeleton(self.path)))
            _alias_once(writer, self.name, id_)
            return "skeleton"
        skeleton = _skeleton(self.path, source_format, self.skeleton)
        if skeleton is not None:
            skeleton = self._unit(skeleton)
        motion = _read_source(self.path, source_format, skeleton)
        motion = _with_facts(motion, self.rate, self.unit)
        if motion.source is not None:
            motion = replace(motion, source=replace(motion.source, path=self.name))
        if skeleton is not None:
            motion = self._based(writer, motion, skeleton)
        name = clip_name(self.name, writer.directory)
        write_clip(writer, replace(motion, name=name), self.codec, self.params, progress)
        return "parsed"

    def _unit(self, skeleton: Skeleton) -> Skeleton:
        return replace(skeleton, unit_cm=UNIT_CM[self.unit]) if self.unit else skeleton

    def _based(self, writer: Writer, motion: Motion, skeleton: Skeleton) -> Motion:
        """``motion`` after its ASF was written; a derived skeleton names it as its base."""
        id_ = write_skeleton(writer, skeleton)
        if self.keep_skeleton:
            found = self.skeleton or find_asf(self.path)
            _alias_once(writer, Path(found).name if found else f"{skeleton.name}.asf", id_)
        if motion.skeleton.base is None:
            return motion
        return replace(motion, skeleton=replace(motion.skeleton, base=id_))


def _alias_once(writer: Writer, name: str, id_: bytes) -> None:
    if name not in writer.directory.aliases:
        writer.alias(name, payloads.OF_SKELETON, id_)


def clip_name(path: str, directory: Directory) -> str:
    """The relative path without its suffix, or with it where that name is taken."""
    stem = Path(path).with_suffix("").as_posix()
    return path if stem in directory.clips else stem
