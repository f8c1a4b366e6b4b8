"""Files that an MCZ file restores: read without records, since there may be many."""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial

from mcz.container import payloads
from mcz.container.chunks import CRC, HEADER
from mcz.container.reader import Container
from mcz.container.source import Forward
from mcz.errors import FormatError
from mcz.files.reading.file import File
from mcz.files.writing.write_transaction import Digest
from mcz.model.schema import parse, parse_until, read_varint

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
    for name, alias in aliases.items():
        target_digest = by_target.get((alias[0], bytes(alias[1])))
        paths.setdefault(name, target_digest or partial(_digest_of, _restorer_of(file, *alias)))
    return paths, contents


def _clip_sources(container: Container) -> Iterator[tuple[str, str, bytes]]:
    """Name, path and digest of each clip with a source; without rows of the directory."""
    read = Forward(container.source, 0)
    for name, at, size, cend_at, cend_size in container.directory.clips.places():
        if not cend_size:
            continue
        clip, cend = read.at_offset(at, size), read.at_offset(cend_at, cend_size)
        with suppress(FormatError, IndexError, UnicodeDecodeError):
            path, digest = _parse_path(_check_chunk(clip)), _parse_digest(_check_chunk(cend))
            if path is not None and digest:
                yield name, path, digest


def _check_chunk(chunk: bytes) -> bytes:
    """The payload of a whole chunk; raises FormatError for a wrong crc."""
    if CRC.pack(zlib.crc32(memoryview(chunk)[: -CRC.size])) != chunk[-CRC.size :]:
        raise FormatError("a damaged chunk")
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


def _restorer_of(file: File, of: int, target: bytes) -> Callable[[], bytes]:
    if of == payloads.OF_SKELETON:
        return partial(file.skeleton_bytes, target)
    name = target.decode("utf-8", "replace")
    return file.clips[name].source_bytes if of == payloads.OF_CLIP else file.attachments[name].read


def _digest_of(restore: Callable[[], bytes]) -> bytes:
    return hashlib.sha256(restore()).digest()
