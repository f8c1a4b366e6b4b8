"""Rewriting of files: chunks are copied unchanged, by a plan of what to keep and to change.

Shared chunks are named by their hash, so they need no new number and are written once. The old file
keeps its name until the new one is complete and has been read from end to end. SPEC.md, "Chunks"
and "Grammar", are normative.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import count, takewhile
from pathlib import Path
from typing import BinaryIO

from mcz.container import payloads
from mcz.container.chunks import Chunk, ChunkFlag, ChunkType, read_chunk
from mcz.container.directory import ClipRow, Directory, PackedClipRow, SegmentRow
from mcz.container.encodings import chunk_id, parse_skel
from mcz.container.grammar import CLIP as IN_CLIP
from mcz.container.index import segment_rows
from mcz.container.index_reader import parse_segments
from mcz.container.limits import Profile
from mcz.container.metadata import Record, merge_records
from mcz.container.parser_drivers import chunks
from mcz.container.reader import Container
from mcz.container.source import locked_file
from mcz.container.source import path_of as named_path
from mcz.container.writer import Writer
from mcz.errors import ChecksumError, FormatError, OptionError
from mcz.files.editing import Report
from mcz.files.editing.appending import DEFAULT, protect_written, redundancy_of
from mcz.files.reading.file import File, open
from mcz.files.writing.atomic import replacing_file
from mcz.model.schema import build, parse, parse_until
from mcz.model.types import Progress, Target

UNPROTECTED = "its recovery data, which fit only the old file; mcz protect makes new ones"
BLOCK = 1 << 20  # bytes of an open DATA that are copied at a time


@dataclass(frozen=True, slots=True)
class Change:
    """Changes of a clip that is copied; None: unchanged.

    ``name`` of the clip, ``path`` of its source, ``rate`` in frames a second, ``metadata`` of CLIP.
    """

    name: str | None = None
    path: str | None = None
    rate: Fraction | None = None
    metadata: Mapping[str, str] | None = None


UNCHANGED = Change()


class ChunkCopier:
    """Copies chunks of ``container`` to ``writer``; ``left_out`` lists forbidden ones.

    Every checksum is checked on the way; raises FormatError for a wrong one.
    """

    def __init__(self, container: Container, writer: Writer) -> None:
        self.container, self.writer = container, writer
        self.left_out: list[str] = []

    def stored(self, kind: bytes, id_: bytes) -> bytes:
        """The payload of the SKEL, MODL or SRCE with this id, its hash checked."""
        chunk = self.container.directory.shared.get((kind, id_))
        if chunk is None:
            raise FormatError(f"no {kind.decode()} has the id {id_.hex()}")
        payload = self.container.payload(chunk)
        if chunk_id(kind, payload, self.container.profile) != id_:
            raise ChecksumError(f"its id should be {id_.hex()}", where=f"chunk {chunk.label}")
        return payload

    def shared(self, kind: bytes, id_: bytes) -> None:
        """Copy a MODL or SRCE, unless it is there."""
        if (kind, id_) not in self.writer.directory.shared:
            self.writer.shared(kind, self.stored(kind, id_))

    def skeleton(self, id_: bytes) -> bytes:
        """Copy a SKEL after its bases and their templates, unless it is there; return its id."""
        chain: list[bytes] = []
        next_id: bytes | None = id_
        while next_id and (ChunkType.SKEL, next_id) not in self.writer.directory.shared:
            payload = self.stored(ChunkType.SKEL, next_id)
            fields = parse_skel(payload, "SKEL", self.container.profile)
            if fields.source is not None:
                self.shared(ChunkType.SRCE, fields.source.template)
            chain.append(payload)
            next_id = fields.base
        for payload in reversed(chain):
            self.writer.shared(ChunkType.SKEL, payload)
        return id_

    def attachment(self, name: str, as_name: str | None = None) -> None:
        """Copy an attached file, perhaps under another name."""
        row = self.container.directory.attachments[name]
        parts = [self.container.payload(part) for part in row.parts]
        if as_name not in (None, name):
            parts = [_rename_part(part, as_name) for part in parts]
        self.writer.attachment_parts(as_name or name, row.size, parts)

    def before_clips(self) -> None:
        """Copy the ancillary chunks before the first clip, which do not belong to it."""
        clips = self.container.directory.clips.values()
        first = min((row.clip.offset for row in clips), default=0)
        for chunk, _ in chunks(self.container.source):
            if chunk.offset >= first:
                break
            if chunk.flags and chunk.type != ChunkType.INDX:
                self.ancillary(chunk)

    def ancillary(self, chunk: Chunk) -> bool:
        """Copy an ancillary chunk if that is safe; return whether it was.

        META is not copied: it may refer to other clips, see ``metadata_records``.
        """
        if chunk.type == ChunkType.META:
            return False
        if chunk.flags & ChunkFlag.SAFE_TO_COPY:  # CHUNK-13, CHUNK-14
            self.writer.ancillary(chunk.type, self.container.payload(chunk))
            return True
        if chunk.type == ChunkType.RECV:
            if UNPROTECTED not in self.left_out:  # each added part has another one
                self.left_out.append(UNPROTECTED)
        elif chunk.type != ChunkType.COPY:  # copies are written again if requested
            self.left_out.append(f"chunk {chunk.label}, which is not safe to copy")
        return False

    def clip(self, name: str, change: Change = UNCHANGED) -> None:
        """Copy a clip: its skeleton and template, CLIP to CEND, and chunks that belong to it."""
        row = self.container.directory.clips[name]
        payload = self.container.payload(row.clip)
        head = parse_until(payloads.Clip, payload, row.clip.label, "signals")
        if head.name != name or head.skeleton != row.skeleton:
            raise FormatError(
                f"{row.clip.label} is clip {head.name!r}, but the index says {name!r}"
            )
        if head.source is not None:
            self.shared(ChunkType.SRCE, head.source.template)
        self.skeleton(row.skeleton)
        if change != UNCHANGED:
            payload = _apply_change(payload, row.clip.label, change)
        rate = change.rate
        new = PackedClipRow(
            change.name or name,
            row.skeleton,
            row.n_frames,
            row.rate_numerator if rate is None else rate.numerator,
            row.rate_denominator if rate is None else rate.denominator,
            row.signals,
            row.clip,
        )
        self.writer.begin_carried(new, payload)
        self._copy_body(row, new)
        self.writer.end_carried()
        self.copy_after_cend(row)

    def copy_after_cend(self, row: ClipRow, *, but: bytes = b"") -> None:
        """Copy the ancillary chunks after CEND, except those of type ``but``."""
        for chunk in row.ancillary:
            data = read_chunk(self.container.source, chunk.offset)
            if data.type != chunk.type:
                raise FormatError(f"{data.label} is {chunk.label} according to the index")
            if data.type != but:
                self.ancillary(data)

    def copy_before_cend(self, row: ClipRow) -> None:
        """Carry over the ancillary chunks between CLIP and CEND."""
        for chunk, _ in self._walk(row):
            if chunk.flags:
                self.ancillary(chunk)

    def _walk(self, row: ClipRow) -> Iterator[tuple[Chunk, int]]:
        if row.cend is None:  # of a damaged file
            raise FormatError(f"clip {row.name!r} has no CEND")
        at, stop = row.clip.stop, row.cend.offset
        inner_chunks = chunks(self.container.source, at, IN_CLIP)
        for chunk, at in takewhile(lambda one: one[0].offset < stop, inner_chunks):
            yield chunk, at
        if at != row.cend.offset:
            raise FormatError(f"{row.cend.label} is not where the index says", clip=row.name)

    def _copy_body(self, row: ClipRow, new: PackedClipRow) -> None:
        """Copy the chunks after CLIP up to CEND; ``new`` records their places."""
        packed = segment_rows(row)
        moved: list[tuple[int, int]] = []  # (offset, number of removed bytes before it)
        less = 0
        for chunk, end in self._walk(row):
            if chunk.length is None:  # an open DATA, packets and all
                for at in range(chunk.offset, end, BLOCK):
                    self.writer.raw(self.container.source.read(at, min(BLOCK, end - at)))
            elif not chunk.flags:
                self.writer.chunk(chunk.type, self.container.payload(chunk))
            elif not self.ancillary(chunk):
                less += chunk.size
                moved.append((end, less))
        assert row.cend is not None
        new.cend = self.writer.chunk(ChunkType.CEND, self.container.payload(row.cend))
        if moved:
            shift = new.clip.stop - row.clip.stop
            new.segments = [_move_segment(segment, shift, moved) for segment in row.segments]
        else:
            new.keep_packed(lambda: packed, parse_segments)


def metadata_records(container: Container, names: Iterable[tuple[str, str]]) -> list[Record]:
    """META records of the file, and of clips by their old and new names."""
    pairs = [("", ""), *names]
    renamed = ((new, container.metadata_records(old)) for old, new in pairs)
    return [merge_records(new, records) for new, records in renamed if records]


def _move_segment(segment: SegmentRow, shift: int, moved: list[tuple[int, int]]) -> SegmentRow:
    less = max((size for start, size in moved if segment.offset >= start), default=0)
    model_row = segment.mask_row and _move_segment(segment.mask_row, shift, moved)
    return replace(segment, offset=segment.offset + shift - less, mask_row=model_row)


def _rename_part(part: bytes, name: str) -> bytes:
    return build(replace(parse(payloads.Atta, part, "ATTA"), name=name), "ATTA")


def _apply_change(payload: bytes, where: str, change: Change) -> bytes:
    record = parse(payloads.Clip, payload, where)
    if change.name is not None:
        record.name = change.name
    if change.path is not None and record.source:
        record.source.path = change.path
    if change.metadata is not None:
        record.metadata = payloads.metadata_records(dict(sorted(change.metadata.items())))
    if change.rate is not None:
        base, rate = record.time_base, record.rate_numerator
        if base is not None and base.first_time is not None and rate:
            base.first_time *= float(rate / change.rate / record.rate_denominator)
        record.rate_numerator = change.rate.numerator
        record.rate_denominator = change.rate.denominator
        record.flags &= ~payloads.ROUNDED_RATE
    return build(record, where)


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
Item = tuple[str, str]  # (kind, name); for a skeleton its id in hex is the name


def items_in(file: File | Directory) -> Iterator[Item]:
    """The named contents of a file, in order."""
    names = (CLIP, file.clips), (ATTACHMENT, file.attachments), (ALIAS, file.aliases)
    return ((kind, name) for kind, names_of in names for name in names_of)


@dataclass(slots=True)
class Plan:
    """The parts of a file that go into a new one.

    ``changes`` are those of named contents, clips in their new order. ``shared`` is copied
    too, whether a clip needs it or not. ``drops_meta``: META is not copied, for the clips have
    their metadata in CLIP.
    """

    changes: dict[Item, Change] = field(default_factory=dict)
    shared: list[Shared] = field(default_factory=list)
    drops_meta: bool = False

    def changes_of(self, kind: str) -> dict[str, Change]:
        """The changes of contents of one kind, by name."""
        return {name: change for (its, name), change in self.changes.items() if its == kind}


def plan_whole(file: File) -> Plan:
    """Plan to copy a file unchanged."""
    return Plan(dict.fromkeys(items_in(file), UNCHANGED), list(file.container.directory.shared))


def copy_items(file: File, writer: Writer, plan: Plan, step: Step) -> list[str]:
    """Copy the contents that ``plan`` lists; return what is not copied."""
    copier = ChunkCopier(file.container, writer)
    copier.before_clips()
    for kind, id_ in plan.shared:
        if kind == ChunkType.SKEL:
            copier.skeleton(id_)
        else:
            copier.shared(kind, id_)
    for name, change in plan.changes_of(ATTACHMENT).items():
        copier.attachment(name, change.name)
    clips = plan.changes_of(CLIP)
    for name, change in clips.items():
        copier.clip(name, change)
        step(name)
    for name, change in plan.changes_of(ALIAS).items():
        target_kind, target = file.aliases[name]
        renamed = plan.changes.get(file.alias_of(name), UNCHANGED).name
        writer.alias(
            change.name or name, target_kind, target if renamed is None else renamed.encode()
        )
    if plan.drops_meta and file.metadata:
        writer.metadata([Record("", file.metadata)])
    elif clips and not plan.drops_meta:
        names = ((name, change.name or name) for name, change in clips.items())
        writer.metadata(metadata_records(file.container, names))
    return copier.left_out


def path_of(file: File, item: Item, change: Change = UNCHANGED) -> str:
    """The path under which an item is restored; "" if it is not."""
    kind, name = item
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
    progress: Progress | None
    file: File

    def write(self, plan: Plan, report: Report, step: Step | None = None) -> Report:
        """Write the contents of ``plan``; ``report`` gets the size and what was left out."""
        step = step or steps(self.progress, len(plan.changes_of(CLIP)))
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
        return report

    def copy_to(self, stream: BinaryIO, plan: Plan, step: Step) -> list[str]:
        """Write the contents of ``plan`` to ``stream``; return what was left out."""
        writer = writer_like(stream, [self.file])
        left_out = copy_items(self.file, writer, plan, step)
        writer.finish()
        return left_out


@contextmanager
def rewriting(
    target: Target,
    output: Target | None = None,
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> Iterator[Rewriting]:
    """Open a file to rewrite; if it is rewritten in place, it is locked against appending.

    Raises AccessError if another process is appending to it.
    """
    with ExitStack() as stack:
        if output is None:
            stack.enter_context(locked_file(disk_path(target)))
        yield Rewriting(target, output, force, progress, stack.enter_context(open(target)))


def disk_path(target: Target) -> Path:
    """The path of a file that can be rewritten in place; raises OptionError for any other."""
    if not isinstance(target, (str, os.PathLike)) or "://" in str(target):
        raise OptionError(
            "only a file on disk can be rewritten in place; name an output file",
            path=named_path(target),
        )
    return Path(target).resolve()
