"""Where motion, codec and container meet, its entry: open, read, write, encode.

``sources.py`` reads source files, ``encoding.py`` turns a Motion into chunks, ``clip.py`` turns
chunks back into values; this file opens and closes the files around them. Archives of many clips
are in ``archive.py``, and what a file says of itself in ``report.py``.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any

from mcz.codecs import DEFAULT, by_name
from mcz.container import payloads
from mcz.container.directory import AttachmentRow
from mcz.container.limits import ARCHIVE, BASE, Profile
from mcz.container.reader import Container
from mcz.container.skeletons import parse_skeleton
from mcz.container.source import open_source
from mcz.container.writer import Writer
from mcz.errors import AccessError, ChecksumError, MczError, OptionError
from mcz.files.clip import Clip
from mcz.files.clip_source import skeleton_source
from mcz.files.encoding import Progress
from mcz.files.sources import Draft, Entry, name_skeleton, read_source, skeleton_of, with_facts
from mcz.files.targets import replacing
from mcz.files.tuning import write_tuned
from mcz.formats import FORMATS, format_of
from mcz.motion import Motion, Skeleton
from mcz.schema import parse


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
        """Further names of a clip, skeleton or attachment: name -> (of, target)."""
        return self.container.directory.aliases

    @property
    def damage(self) -> list[str]:
        """What salvage found wrong, in file order."""
        return self.container.damage

    @property
    def unverified(self) -> int:
        """Chunks of which so far only a part was read, and checked by its own table alone."""
        return self.container.unverified

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
        if not with_source:
            return skeleton
        return replace(skeleton, source=skeleton_source(self.container, id_))

    def skeleton_bytes(self, id_: bytes) -> bytes:
        """The skeleton's own source file (ASF), byte for byte."""
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
    Raises FormatError, in particular TruncatedError where there is no FOOT at the end, and
    AccessError where the file cannot be read.
    """
    try:
        source = open_source(target)
    except (OSError, ValueError) as error:  # ValueError: a name with a zero byte
        text = getattr(error, "strerror", None) or error
        raise AccessError(f"{target}: {text}") from None
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
    max_decoded: int | None = None,
) -> Motion:
    """The motion in a BVH, AMC, C3D or MCZ file.

    An AMC finds its ASF beside it, or takes ``skeleton``, a path or a Skeleton. ``rate`` in frames
    a second and ``unit`` (a key of ``UNIT_CM``) say what the file does not. Of an MCZ file ``clip``
    is read, with ``max_decoded`` as in ``open``. Raises SourceError, FormatError or OptionError.
    """
    path = Path(path)
    if path.suffix.lower() == ".mcz":
        with open(path, max_decoded=max_decoded) as file:
            motion = file.only_clip(clip).motion()
    else:
        source_format = format_of(path)
        if source_format.is_skeleton:
            raise OptionError(f"{path}: a skeleton without motion (mcz.read_skeleton reads it)")
        motion = read_source(path, source_format, skeleton_of(path, source_format, skeleton))
    return with_facts(motion, rate, unit)


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
        name_skeleton(writer, motion.skeleton)
        write_tuned(writer, motion, by_name(codec), params, progress)
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
    """Turn one ASF, AMC, BVH or C3D file into an MCZ file.

    ``verbatim`` keeps a file that cannot be parsed as an attachment. Raises SourceError,
    OptionError, MotionError or LimitError; nothing is left under the final name then.
    """
    path = Path(source)
    entry = Entry(path, path.name, codec, params or {}, skeleton, rate, unit, verbatim, True)
    with replacing(target, force=force) as stream:
        draft = Draft(stream, profile_of(archive), hold=verbatim)
        entry.write(draft, progress)
        draft.finish()
