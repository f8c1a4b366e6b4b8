"""What of a file goes into a new one, and the writing of that: chunks are carried over, not coded.

``carrying.py`` carries, this module plans. The old file keeps its name until the new one is whole
and was walked from end to end.
"""

from __future__ import annotations

import builtins
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import BinaryIO

from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.limits import Profile
from mcz.container.locks import lock
from mcz.container.metadata import Record
from mcz.container.reader import Container
from mcz.container.source import path_of
from mcz.container.writer import Writer
from mcz.editing.carrying import SAME, UNPROTECTED, Carrier, Change, said_of
from mcz.editing.protecting import (
    DEFAULT,
    Protection,
    protect_written,
    protection_of,
    redundancy_of,
)
from mcz.errors import (
    AccessError,
    FormatError,
    OptionError,
    reason_of,
)
from mcz.reading.file import File, open
from mcz.reading.sizes import models_used
from mcz.schema import parse
from mcz.types import Progress, Target
from mcz.writing.atomic import replacing_file

Shared = tuple[bytes, bytes]  # type and id of a SKEL, MODL or SRCE
Step = Callable[[str], None]  # is told the name of each clip that was carried over


def steps(progress: Progress | None, total: int) -> Step:
    """A step that counts for ``progress``."""
    numbers = count(1)

    def step(name: str) -> None:
        if progress is not None:
            progress(next(numbers), total, name)

    return step


@dataclass(slots=True)
class Plan:
    """What of a file goes into a new one: names, and what they are from now on.

    ``clips`` are in their new order. ``shared`` goes along, needed by a clip or not. ``purges``: no
    META is carried over, for the clips have their metadata in CLIP.
    """

    clips: dict[str, Change] = field(default_factory=dict)
    attachments: dict[str, str] = field(default_factory=dict)
    aliases: dict[str, str] = field(default_factory=dict)
    shared: list[Shared] = field(default_factory=list)
    purges: bool = False


def whole(file: File) -> Plan:
    """All of a file, as it is."""
    return Plan(
        dict.fromkeys(file.clips, SAME),
        {name: name for name in file.attachments},
        {name: name for name in file.aliases},
        list(file.container.directory.shared),
    )


def used_by(file: File, names: Iterable[str]) -> set[Shared]:
    """The skeletons with their bases, the templates and the models that these clips need."""
    container, used = file.container, set[Shared]()
    has_models = any(kind == ChunkType.MODL for kind, _ in container.directory.shared)
    for name in names:
        row = container.directory.clips[name]
        source = container.clip_head(row).source
        if source is not None:
            used.add((ChunkType.SRCE, source.template))
        if (ChunkType.SKEL, row.skeleton) not in used:
            used |= used_by_skeleton(container, row.skeleton)
        for signal in file.clips[name].signals if has_models else ():
            used |= {(ChunkType.MODL, id_) for id_ in models_used(signal)}
    return used


def used_by_skeleton(container: Container, id_: bytes) -> set[Shared]:
    """A skeleton, its bases, and the templates of their own files."""
    found: set[Shared] = set()
    wanted: bytes | None = id_
    while wanted and (ChunkType.SKEL, wanted) not in found:
        fields = container.skeleton_fields(wanted)
        found.add((ChunkType.SKEL, wanted))
        found |= {(ChunkType.SRCE, bytes(source.template)) for source in [fields.source] if source}
        wanted = fields.base
    return found


def carry(file: File, writer: Writer, plan: Plan, step: Step) -> list[str]:
    """Write what ``plan`` says of ``file``; return what may not be carried over."""
    carrier = Carrier(file.container, writer)
    carrier.before_clips()
    for kind, id_ in plan.shared:
        if kind == ChunkType.SKEL:
            carrier.skeleton(id_)
        else:
            carrier.shared(kind, id_)
    for name, as_name in plan.attachments.items():
        carrier.attachment(name, as_name)
    for name, change in plan.clips.items():
        carrier.clip(name, change)
        step(name)
    for alias, as_name in plan.aliases.items():
        writer.alias(as_name, *_target(file, plan, alias))
    names = ((name, change.name or name) for name, change in plan.clips.items())
    if plan.purges and file.metadata:
        writer.metadata([Record("", file.metadata)])
    elif plan.clips and not plan.purges:
        writer.metadata(said_of(file.container, names))
    return carrier.left_out


def _target(file: File, plan: Plan, alias: str) -> tuple[int, bytes]:
    """What an alias stands for, by the name that this has from now on."""
    of, target = file.aliases[alias]
    name = target.decode("utf-8", "replace")
    if of == payloads.OF_CLIP:  # one that was left out has the same name where it is already
        return of, (plan.clips.get(name, SAME).name or name).encode()
    if of == payloads.OF_ATTACHMENT:
        return of, plan.attachments.get(name, name).encode()
    return of, target


def source_path(file: File, name: str) -> str:
    """The path of the source of a clip; "" where it has none, or that has none."""
    source = file.container.clip_head(file.container.directory.clips[name]).source
    return source.path if source is not None else ""


def writer_like(stream: BinaryIO, files: Iterable[File], copies: bool | None = None) -> Writer:
    """A Writer of a new file that has what the first of ``files`` has, and holds what all hold.

    ``copies`` None: where one of them has some.
    """
    files = list(files)
    head = parse(payloads.Head, files[0].container.directory.head, "HEAD")
    profiles: list[Profile] = [file.container.profile for file in files]
    return Writer(
        stream,
        profile=max(profiles, key=lambda profile: profile.channels),
        head_extension=bytes(head.extension),
        copies=any(file.container.copies() for file in files) if copies is None else copies,
    )


@contextmanager
def source_of(target: Target, output: Target | None) -> Iterator[File]:
    """The file to be rewritten; where it is to take its own place, nobody appends meanwhile.

    Raises AccessError where another process is appending to it.
    """
    if output is not None:
        with open(target) as file:
            yield file
        return
    if not isinstance(target, (str, os.PathLike)) or "://" in str(target):
        raise OptionError(
            "only a file on disk can be rewritten in place; name an output", path=path_of(target)
        )
    try:
        stream = builtins.open(target, "r+b", buffering=0)  # noqa: SIM115 - closed by the with below
    except (OSError, ValueError) as error:
        raise AccessError(reason_of(error), path=target) from None
    with stream:
        if not lock(stream):
            raise AccessError("another process is appending to it", path=target)
        with open(target) as file:
            yield file


def _disk_path(target: Target) -> Path:
    """The path of a file that ``source_of`` lets be rewritten in place."""
    assert isinstance(target, (str, os.PathLike))
    return Path(target)


def rewrite(
    target: Target, output: Target | None, force: bool, file: File, plan: Plan, step: Step
) -> Written:
    """Write what ``plan`` says of ``file`` in its own place, or to ``output``."""
    inputs = () if output is None else (target,)
    path = output or _disk_path(target)
    with replacing_file(path, force=force or output is None, inputs=inputs) as stream:
        size, left_out = _written(stream, file, plan, step)
        if output is None and UNPROTECTED in left_out:
            left_out = [text for text in left_out if text != UNPROTECTED]
            protect_written(stream, redundancy_of(file.container) or DEFAULT)
            size = stream.tell()
    return Written(size, left_out)


def _written(stream: BinaryIO, file: File, plan: Plan, step: Step) -> tuple[int, list[str]]:
    """Write what ``plan`` says of ``file``; the size, and what was left out."""
    writer = writer_like(stream, [file])
    left_out = carry(file, writer, plan, step)
    writer.finish()
    return writer.offset, left_out


def protected_anew(
    target: Target, redundancy: float, progress: Callable[[int, int], object] | None
) -> Protection | None:
    """Rewrite a file with recovery data for all of it in place of those that it has.

    The file has its old ones until it has the new ones. Returns None, and does nothing, where it
    has none. Raises FormatError where more would be lost, and as ``source_of`` does.
    """
    with source_of(target, None) as file:
        if redundancy_of(file.container) is None:
            return None
        with replacing_file(_disk_path(target), force=True) as stream:
            _, left_out = _written(stream, file, whole(file), lambda name: None)
            if lost := [text for text in left_out if text != UNPROTECTED]:
                raise FormatError(f"rewriting it would lose {lost[0]}", path=file.name)
            return protection_of(protect_written(stream, redundancy, progress))


@dataclass(frozen=True, slots=True)
class Written:
    """The size of a new file, and what may not be carried over to it."""

    size: int
    left_out: list[str]
