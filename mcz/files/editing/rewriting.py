"""Rewriting of files: chunks are copied, not encoded.

``chunk_copier.py`` copies chunks, this module plans. The old file keeps its name until the new one
is complete and has been read from end to end. ``protect``, which may rewrite a file, is here too.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import BinaryIO

from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.directory import Directory
from mcz.container.limits import Profile
from mcz.container.metadata import Record
from mcz.container.reader import Container
from mcz.container.recovery import blocks
from mcz.container.recovery.blocks import check_redundancy
from mcz.container.source import locked_file
from mcz.container.source import path_of as named_path
from mcz.container.writer import Writer
from mcz.errors import FormatError, OptionError
from mcz.files.editing.appending import (
    DEFAULT,
    Protection,
    add_recovery,
    protect_written,
    protection_of,
    redundancy_of,
)
from mcz.files.editing.batch_report import Report
from mcz.files.editing.chunk_copier import (
    UNCHANGED,
    UNPROTECTED,
    Change,
    ChunkCopier,
    metadata_records,
)
from mcz.files.reading.file import File, open
from mcz.files.reading.sizes import models_used
from mcz.files.writing.atomic import replacing_file
from mcz.model.schema import parse
from mcz.model.types import Progress, Target

Shared = tuple[bytes, bytes]  # type and id of a SKEL, MODL or SRCE
Step = Callable[[str], None]  # called with the name of each copied clip


def steps(progress: Progress | None, total: int) -> Step:
    numbers = count(1)

    def step(name: str) -> None:
        if progress is not None:
            progress(next(numbers), total, name)

    return step


KINDS = CLIP, ATTACHMENT, ALIAS = "clip", "attachment", "alias"
SKELETON = "skeleton"
Thing = tuple[str, str]  # (kind, name); for a skeleton its id in hex is the name


def things_in(file: File | Directory) -> Iterator[Thing]:
    """The named contents of a file, in order."""
    names = (CLIP, file.clips), (ATTACHMENT, file.attachments), (ALIAS, file.aliases)
    return ((kind, name) for kind, names_of in names for name in names_of)


@dataclass(slots=True)
class Plan:
    """The parts of a file that go into a new one.

    ``things`` are named contents with their changes, clips in their new order. ``shared`` is copied
    too, whether a clip needs it or not. ``drops_meta``: META is not copied, for the clips have
    their metadata in CLIP.
    """

    things: dict[Thing, Change] = field(default_factory=dict)
    shared: list[Shared] = field(default_factory=list)
    drops_meta: bool = False

    def things_of(self, kind: str) -> dict[str, Change]:
        """The things of one kind by name."""
        return {name: change for (its, name), change in self.things.items() if its == kind}


def plan_whole(file: File) -> Plan:
    """Plan to copy a file unchanged."""
    return Plan(dict.fromkeys(things_in(file), UNCHANGED), list(file.container.directory.shared))


def used_by(file: File, names: Iterable[str]) -> set[Shared]:
    """The skeletons with their bases, the templates and the models that these clips need."""
    container, used = file.container, set[Shared]()
    has_models = bool(container.directory.ids(ChunkType.MODL))
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
    used: set[Shared] = set()
    next_id: bytes | None = id_
    while next_id and (ChunkType.SKEL, next_id) not in used:
        fields = container.skeleton_fields(next_id)
        used.add((ChunkType.SKEL, next_id))
        if fields.source:
            used.add((ChunkType.SRCE, bytes(fields.source.template)))
        next_id = fields.base
    return used


def copy_things(file: File, writer: Writer, plan: Plan, step: Step) -> list[str]:
    """Copy the contents that ``plan`` lists; return what is not copied."""
    copier = ChunkCopier(file.container, writer)
    copier.before_clips()
    for kind, id_ in plan.shared:
        if kind == ChunkType.SKEL:
            copier.skeleton(id_)
        else:
            copier.shared(kind, id_)
    for name, change in plan.things_of(ATTACHMENT).items():
        copier.attachment(name, change.name)
    clips = plan.things_of(CLIP)
    for name, change in clips.items():
        copier.clip(name, change)
        step(name)
    for name, change in plan.things_of(ALIAS).items():
        target_kind, target = file.aliases[name]
        renamed = plan.things.get(file.alias_of(name), UNCHANGED).name
        writer.alias(
            change.name or name, target_kind, target if renamed is None else renamed.encode()
        )
    if plan.drops_meta and file.metadata:
        writer.metadata([Record("", file.metadata)])
    elif clips and not plan.drops_meta:
        names = ((name, change.name or name) for name, change in clips.items())
        writer.metadata(metadata_records(file.container, names))
    return copier.left_out


def path_of(file: File, thing: Thing, change: Change = UNCHANGED) -> str:
    """The path under which a thing is restored; "" if it is not."""
    kind, name = thing
    if kind != CLIP:
        return change.name or name
    source = file.container.clip_head(file.container.directory.clips[name]).source
    return change.path or (source.path if source is not None else "")


def writer_like(stream: BinaryIO, files: Iterable[File], copies: bool | None = None) -> Writer:
    """A Writer with the HEAD of the first of ``files`` and a profile that fits all of them.

    ``copies`` None: write copies if one of the files has some.
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


@dataclass(frozen=True, slots=True)
class Rewriting:
    """A file that is rewritten to ``output``, or in place where ``output`` is None."""

    target: Target
    output: Target | None
    force: bool
    file: File

    def write(self, plan: Plan, report: Report, step: Step) -> None:
        """Write the contents of ``plan``; ``report`` gets the size and what was left out."""
        in_place = self.output is None
        inputs = () if in_place else (self.target,)
        path = disk_path(self.target) if self.output is None else self.output
        with replacing_file(path, force=self.force or in_place, inputs=inputs) as stream:
            left_out = self.copy_to(stream, plan, step)
            if in_place and UNPROTECTED in left_out:
                left_out.remove(UNPROTECTED)
                protect_written(stream, redundancy_of(self.file.container) or DEFAULT)
            report.size = stream.tell()
        report.left_out += left_out

    def copy_to(self, stream: BinaryIO, plan: Plan, step: Step) -> list[str]:
        """Write the contents of ``plan`` to ``stream``; return what was left out."""
        writer = writer_like(stream, [self.file])
        left_out = copy_things(self.file, writer, plan, step)
        writer.finish()
        return left_out


@contextmanager
def rewriting(
    target: Target, output: Target | None = None, *, force: bool = False
) -> Iterator[Rewriting]:
    """Open a file to rewrite; if it is rewritten in place, it is locked against appending.

    Raises AccessError where another process is appending to it.
    """
    with ExitStack() as stack:
        if output is None:
            stack.enter_context(locked_file(disk_path(target)))
        yield Rewriting(target, output, force, stack.enter_context(open(target)))


def disk_path(target: Target) -> Path:
    """The path of a file that can be rewritten in place; raises OptionError for any other."""
    if not isinstance(target, (str, os.PathLike)) or "://" in str(target):
        raise OptionError(
            "only a file on disk can be rewritten in place; name an output file",
            path=named_path(target),
        )
    return Path(target).resolve()


def protect(
    target: str | os.PathLike[str],
    redundancy: float = DEFAULT,
    *,
    anew: bool = False,
    progress: blocks.Step | None = None,
) -> list[Protection]:
    """Append recovery data to an MCZ file, of ``redundancy`` times its bytes.

    ``mcz.repair`` restores every byte as long as there are no more bad blocks than recovery blocks,
    wherever they lie: single bytes, a burst, the beginning, the end. If the file has recovery data
    already, only bytes appended since get new data; without such bytes nothing changes. ``anew``
    rewrites the file and computes recovery data for all of it. Returns all recovery data, in the
    order of the file. Raises OptionError for a ``redundancy`` out of range, FormatError where
    rewriting would lose a chunk of unknown type, AccessError where another process is appending,
    and as ``mcz.append`` for a file cut short.
    """
    check_redundancy(redundancy)
    if anew and (protection := _protected_anew(target, redundancy, progress)) is not None:
        return [protection]
    return add_recovery(target, redundancy, progress)


def _protected_anew(
    target: Target, redundancy: float, progress: blocks.Step | None
) -> Protection | None:
    """Rewrite a file with recovery data for all of it; None without a change if it has none.

    The old recovery data stay until the new are written.
    """
    with rewriting(target) as job:
        if redundancy_of(job.file.container) is None:
            return None
        with replacing_file(disk_path(target), force=True) as stream:
            left_out = job.copy_to(stream, plan_whole(job.file), lambda name: None)
            if lost := [text for text in left_out if text != UNPROTECTED]:
                raise FormatError(f"rewriting it would lose {lost[0]}", path=job.file.name)
            return protection_of(protect_written(stream, redundancy, progress))
