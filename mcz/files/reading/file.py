"""``mcz.open``: an MCZ file and its contents by name, decoded on demand.

``clip.py`` turns chunks into values, ``report.py`` collects the facts of a file.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from mcz.container import payloads
from mcz.container.chunks import SIGNATURE, ChunkType
from mcz.container.directory import AttachmentRow
from mcz.container.metadata import apply_records
from mcz.container.reader import Container
from mcz.container.source import ByteSource, open_source, path_of
from mcz.errors import (
    AccessError,
    ChecksumError,
    FormatError,
    MotionError,
    OptionError,
    TruncatedError,
    error_context,
    reason_of,
)
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Clips, Where, filter_clips, list_some
from mcz.files.reading.lost_skeletons import restore_skeletons
from mcz.files.reading.source_files import sourced_skeleton
from mcz.model.checks import check_arguments
from mcz.model.motion import Skeleton
from mcz.model.schema import parse
from mcz.model.text_format import count_text, quote_name
from mcz.model.threads import check_threads
from mcz.model.types import JsonObject, Params, Target
from mcz.sources import FORMATS


def is_mcz(path: str | os.PathLike[str]) -> bool:
    """Return whether a file is an MCZ file, by suffix or first bytes; URLs by their suffix."""
    if str(path).partition("?")[0].lower().endswith(".mcz"):
        return True
    try:
        with Path(path).open("rb") as stream:
            return stream.read(len(SIGNATURE)) == SIGNATURE
    except (OSError, ValueError):
        return False


def is_source(path: str) -> bool:
    """Return whether a path has the suffix of a source format, and its file is not an MCZ file."""
    suffixes = tuple(suffix for known in FORMATS.values() for suffix in known.suffixes)
    return path.lower().endswith(suffixes) and not is_mcz(path)


def suffixes_of(target: str) -> tuple[str, ...]:
    """The suffixes of a target, a format or a scene."""
    return FORMATS[target].suffixes if target in FORMATS else (f".{target}",)


class StoredSkeleton(NamedTuple):
    """A skeleton of a file, and its id, which clips refer to."""

    id: bytes
    skeleton: Skeleton


class AliasTarget(NamedTuple):
    """Target of an alias: its kind, "clip", "skeleton" or "attachment", and its name."""

    kind: str
    name: str


class Attachment:
    """An attached file, byte for byte."""

    def __init__(self, container: Container, row: AttachmentRow) -> None:
        self._container, self._row = container, row
        self.name, self.size = row.name, row.size

    def __repr__(self) -> str:
        return f"<Attachment {quote_name(self.name)}: {self.size} bytes>"

    def read(self) -> bytes:
        """The bytes, their hash checked."""
        return self._container.attachment(self._row)


class File:
    """An open MCZ file: its clips, skeletons and attachments by name, decoded on demand.

    It iterates over its clips in file order; ``file[name]`` and ``name in file`` find a clip as
    ``only_clip`` does. Threads may share it, and processes after a fork. A File and its contents,
    opened by path, URL or from bytes, can be pickled: unpickling opens the same file again.
    """

    def __init__(self, container: Container) -> None:
        self.container = container
        self.grows = False  # another process was appending: this is the file up to its last end
        rows = container.directory
        self.clips = Clips(container)
        self.attachments: Mapping[str, Attachment] = {
            name: Attachment(container, row) for name, row in rows.attachments.items()
        }

    def __reduce__(self) -> tuple[object, ...]:
        return file_of, (self.container,)

    def __repr__(self) -> str:
        clips = count_text(len(self.clips), "clip")
        attachments = count_text(len(self.attachments), "attachment")
        return f"<File {quote_name(self.name)}: {clips}, {attachments}, {self.size} bytes>"

    def __iter__(self) -> Iterator[Clip]:
        return iter(self.clips.values())

    def __len__(self) -> int:
        return len(self.clips)

    def __bool__(self) -> bool:
        """True, also without clips."""
        return True

    def __getitem__(self, name: str) -> Clip:
        """The clip that ``name`` refers to; raises UnknownNameError."""
        return self.clips[name]

    def __contains__(self, thing: object) -> bool:
        """Return True for a clip of this file, or the name or alias of one."""
        if isinstance(thing, Clip):
            return thing.name in self.clips.rows and self.clips[thing.name] is thing
        return thing in self.clips

    def __enter__(self) -> File:
        return self

    def __exit__(self, *_: object) -> None:
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

    def alias_of(self, name: str) -> AliasTarget:
        """Resolve an alias to the kind, "clip", "skeleton" or "attachment", and name of its target.

        A skeleton's name is its id in hex.
        """
        of, target = self.aliases[name]
        if of == payloads.OF_SKELETON:
            return AliasTarget("skeleton", target.hex())
        kind = "clip" if of == payloads.OF_CLIP else "attachment"
        return AliasTarget(kind, target.decode("utf-8", "replace"))

    @property
    def metadata(self) -> Mapping[str, str]:
        """Metadata of the file as a whole, see ``Clip.metadata``."""
        return apply_records({}, self.container.metadata_records(""))

    @property
    def damage(self) -> list[str]:
        """Faults that salvage found, in file order."""
        return self.container.damage

    @property
    def unverified(self) -> int:
        """Number of segments that were read in part, without a check of their checksum."""
        return self.container.unverified

    @cached_property
    def header(self) -> JsonObject:
        """Format version, version needed and profile, from HEAD."""
        head = parse(payloads.Head, self.container.directory.head, "HEAD")
        return {
            "format_version": f"{head.major}.{head.minor}",
            "needs_version": f"{head.needs_major}.{head.needs_minor}",
            "profile": self.container.profile.name,
        }

    @cached_property
    def skeletons(self) -> list[StoredSkeleton]:
        """The skeletons with their ids, in file order."""
        ids = self.container.directory.ids(ChunkType.SKEL)
        return [StoredSkeleton(id_, self.skeleton(id_)) for id_ in ids]

    def skeleton(self, id_: bytes, *, with_source: bool = False) -> Skeleton:
        """The skeleton with this id; ``with_source`` also reads the template of its own file."""
        return (
            sourced_skeleton(self.container, id_) if with_source else self.container.skeleton(id_)
        )

    def skeleton_bytes(self, id_: bytes) -> bytes:
        """The skeleton's own source file (ASF), byte for byte."""
        skeleton = self.skeleton(id_, with_source=True)
        source = skeleton.source
        if source is None:
            raise OptionError(
                f"skeleton {skeleton.name or id_.hex()} has no source file of its own"
            )
        try:
            data = FORMATS[source.format].write(skeleton)
        except MotionError:  # its format cannot hold the stored skeleton
            data = b""
        if data != source.template:
            raise FormatError(f"skeleton {id_.hex()}: its source file describes another skeleton")
        # SRC-01, SRC-02
        if len(data) != source.size or hashlib.sha256(data).digest() != source.sha256:
            raise ChecksumError(f"skeleton {id_.hex()}: the restored file differs from its source")
        return data

    def only_clip(self, name: str | None = None) -> Clip:
        """The clip called ``name``, or the only one.

        A clip is found by its name, the path of its source or an alias, and by the last part of one
        of these if only one clip has it. Raises OptionError, which suggests a name.
        """
        if name is not None:
            return self.clips[name]
        if len(self.clips) != 1:
            names = list_some(self.clips)
            raise OptionError(
                f"the file has {len(self.clips)} clips; choose one: {names}", path=self.name
            )
        return next(iter(self.clips.values()))

    def clips_called(self, names: Iterable[str]) -> list[Clip]:
        """The clips of these names, each once, in this order; raises as ``only_clip``."""
        return list({clip.name: clip for clip in map(self.only_clip, names)}.values())

    def find(self, where: Where) -> list[Clip]:
        """The clips that match ``where``, in file order, perhaps none.

        ``where`` is a function of a Clip or a query such as "subject == '05' and n_frames > 500"
        (docs/reference/queries.md). Raises OptionError for a malformed query, and for a name in it
        that is neither a field nor a metadata key of any clip.
        """
        return list(filter_clips(self, where, self.clips.values()))

    def select_clips(
        self, names: Iterable[str] | None = None, where: Where | None = None
    ) -> list[Clip]:
        """The clips of these names that match ``where``; None: all.

        Raises OptionError as ``only_clip`` and ``find``, and if no clip matches.
        """
        clips = list(self) if names is None else self.clips_called(names)
        if where is None:
            return clips
        matches = list(filter_clips(clips, where, self.clips.values()))
        if not matches:
            query = quote_name(where) if isinstance(where, str) else "what is asked for"
            raise OptionError(
                f"none of {count_text(len(clips), 'clip')} matches {query}", path=self.name
            )
        return matches

    def skeleton_ids(self, clips: Iterable[Clip]) -> set[bytes]:
        """The ids of the skeletons of ``clips``, and of their bases."""
        ids: set[bytes] = set()
        for clip in clips:
            id_: bytes | None = clip.skeleton_id
            while id_ and id_ not in ids:
                ids.add(id_)
                id_ = self.skeleton(id_).base
        return ids


@check_arguments()
def open(
    target: Target,
    salvage: bool = False,
    max_decoded: int | None = None,
    unverified: bool = False,
    threads: int | None = None,
    verify: bool = False,
) -> File:
    """Open an MCZ file lazily: a path, an fsspec target, bytes or a binary stream.

    ``salvage`` reads the intact parts of a damaged file and lists the rest in ``File.damage``.
    ``max_decoded`` replaces the limit of decoded bytes, max(64 MiB, 4096 x file size).
    ``unverified`` reads only the requested part of a segment (joints, a resolution), so that its
    checksum cannot be checked and a damaged file may give wrong numbers; ``File.unverified`` counts
    such segments. It saves bytes where segments are large, and has no effect in salvage.
    ``threads`` decode in parallel, by default one a processor; the numbers are the same. ``verify``
    compares the SHA-256 of every signal that is decoded whole. By default it is not compared for
    the codecs raw and fast, whose bytes have checksums. Raises FormatError, in particular
    TruncatedError if there is no FOOT at the end, AccessError if the file cannot be read, and
    OptionError.
    """
    options = {
        "salvage": salvage,
        "max_decoded": max_decoded,
        "reads_parts": unverified,
        "threads": check_threads(threads),
        "verify": verify,
    }
    source = open_bytes(target)
    try:
        with error_context(path=source.name):
            return _open_source(source, options)
    except BaseException:
        source.close()
        raise


def open_bytes(target: Target) -> ByteSource:
    """The bytes of ``target``, as for ``open``; raises AccessError and OptionError."""
    try:
        return open_source(target)
    except (OSError, ValueError) as error:  # ValueError: a name with a zero byte
        raise AccessError(reason_of(error), path=path_of(target)) from None


def file_of(container: Container) -> File:
    """The file in ``container``, with lost skeletons that salvage can rebuild."""
    if container.salvage:
        restore_skeletons(container)
    return File(container)


def _open_source(source: ByteSource, options: Params) -> File:
    """The file; while another process appends to it, the file up to its last end."""
    while True:
        try:
            return file_of(Container(source, **options))
        except TruncatedError as error:
            size = source.size_now()
            if source.grows():
                if error.last_foot is None:
                    raise
                end = error.last_foot
                break
            if size == source.size:  # no process has appended since
                raise
            source = source.up_to(size)
    file = file_of(Container(source.up_to(end), **options))
    file.grows = True
    return file
