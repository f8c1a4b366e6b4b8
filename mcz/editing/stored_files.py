"""Which files an MCZ file restores, and what is in them: read by hand, for there may be many."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from mcz.container import payloads
from mcz.container.directory import ClipRow
from mcz.container.reader import Container
from mcz.errors import FormatError
from mcz.reading.file import File
from mcz.schema import parse, parse_until
from mcz.writing.draft import Digest

Content = dict[bytes, tuple[int, bytes]]  # SHA-256 of a file -> what ALIA says of it


def stored_files(container: Container) -> tuple[dict[str, Digest], Content]:
    """What ``container`` restores under each path, its SHA-256 or what finds it; and by content.

    What is damaged cannot be restored, and is left out.
    """
    paths: dict[str, Digest] = {}
    contents: Content = {}
    for name, row in container.directory.clips.items():
        with suppress(FormatError):
            path, digest = _of_clip(container, row)
            if digest:
                contents.setdefault(digest, (payloads.OF_CLIP, name.encode()))
            if digest and path:
                paths.setdefault(path, digest)
    for name, held in container.directory.attachments.items():
        with suppress(FormatError):
            part = held.parts[0]
            digest = bytes(parse(payloads.Atta, container.payload(part), part.label).sha256)
            contents.setdefault(digest, (payloads.OF_ATTACHMENT, name.encode()))
            paths.setdefault(name, digest)
    by_target = {target: digest for digest, target in contents.items()}
    file = File(container)
    for name, alias in container.directory.aliases.items():
        found = by_target.get((alias[0], bytes(alias[1])))
        paths.setdefault(name, found or partial(_digest_of, _restoring(file, *alias)))
    return paths, contents


def _of_clip(container: Container, row: ClipRow) -> tuple[str, bytes]:
    source = container.clip_head(row).source
    if source is None or row.cend is None:
        return "", b""
    cend = parse_until(payloads.Cend, container.payload(row.cend), row.cend.label, "value_sha256")
    return source.path, cend.source_sha256 or b""


def _restoring(file: File, of: int, target: bytes) -> Callable[[], bytes]:
    if of == payloads.OF_SKELETON:
        return partial(file.skeleton_bytes, target)
    name = target.decode("utf-8", "replace")
    return file.clips[name].source_bytes if of == payloads.OF_CLIP else file.attachments[name].read


def _digest_of(restore: Callable[[], bytes]) -> bytes:
    return hashlib.sha256(restore()).digest()
