"""Files of an archive that other processes read and encode ahead: each becomes a part.

A part is an MCZ file of one file, whose chunks are copied. Decisions that depend on the contents of
the archive (a used name, a repeated file, a stored skeleton) are made where the parts are joined,
in the order of the files; so the archive equals the one that a single process would write.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from mcz.container.directory import Directory
from mcz.container.limits import Profile
from mcz.errors import MczError, WorkerError
from mcz.files.editing.chunk_copier import Change
from mcz.files.editing.folders import size_of
from mcz.files.editing.rewriting import ALIAS, CLIP, SKELETON, copy_things, plan_whole
from mcz.files.editing.unpacking import Content
from mcz.files.jobs import DEFAULT_JOBS, Answer, answers, useful_jobs
from mcz.files.reading.file import open
from mcz.files.reading.parallel_clips import only_own
from mcz.files.writing.atomic import WriteTransaction, check_name, clip_name
from mcz.files.writing.file import SourceEncoder
from mcz.sources import wants_skeleton


@dataclass(frozen=True, slots=True)
class Part:
    """One encoded file: ``data`` is an MCZ file of it alone, written by ``encoder``.

    ``digest`` is the SHA-256 of the source file, ``result`` that of ``SourceEncoder.write``.
    """

    encoder: SourceEncoder
    digest: bytes
    data: bytes
    result: str


def encode_part(profile: Profile, asked: SourceEncoder) -> Part:
    """The part of a file, within the limits of the target; raises as ``SourceEncoder.write``."""
    encoder = SourceEncoder(asked.path, asked.name, asked.options, asked.encoding)
    sink = io.BytesIO()
    transaction = WriteTransaction(sink, profile)
    result = encoder.write(transaction)
    transaction.finish()
    digest = transaction.paths[asked.name]
    assert isinstance(digest, bytes)
    return Part(encoder, digest, sink.getvalue(), result)


class EncodedPart(SourceEncoder):
    """A SourceEncoder whose part another process has encoded; it copies the part."""

    can_be_read = True  # in this process too

    def __init__(self, entry: SourceEncoder, answer: Answer[Part]) -> None:
        super().__init__(entry.path, entry.name, entry.options, entry.encoding)
        self.inputs = entry.inputs  # read by its owner
        self._answer = answer

    def write(self, transaction: WriteTransaction, progress: object = None) -> str:
        """Write the file as ``SourceEncoder.write``; raises WorkerError if a process died."""
        part = self._part()
        if part is None or part.digest != self.digest():
            return super().write(transaction)  # it fails, or has changed: errors as of one process
        name = clip_name(self.name, transaction.writer.directory)
        if (
            self.can_be_read
            and part.result == "verbatim"
            and name != clip_name(self.name, Directory())
        ):
            return super().write(transaction)  # the reason may name the clip
        check_name(self.name)
        if transaction.holds(self.name, part.digest):
            return "present"
        with transaction.step():
            join_part(part, transaction, name)
        done = part.encoder
        self.reason, self.remark, self.notes = done.reason, done.remark, done.notes
        self.inputs[:] = done.inputs
        transaction.paths[self.name] = part.digest
        return part.result

    def _part(self) -> Part | None:
        try:
            return self._answer()
        except WorkerError:
            raise
        except MczError:
            return None


class RemotePart(EncodedPart):
    """A part of a file that only its maker can read, ``size`` bytes."""

    can_be_read = False

    def __init__(self, entry: SourceEncoder, answer: Answer[Part], size: int) -> None:
        super().__init__(entry, answer)
        self.size = size
        self._made: Part | None = None

    def _part(self) -> Part:
        if self._made is None:
            self._made = self._answer()
        return self._made

    def digest(self) -> bytes:
        return self._part().digest


def join_part(part: Part, transaction: WriteTransaction, clip: str) -> None:
    """Carry the chunks of ``part`` over; its clip is called ``clip`` from now on."""
    directory = transaction.writer.directory
    with open(part.data) as file:
        plan = plan_whole(file)
        for kind, name in list(plan.things):
            if kind == CLIP and name != clip:
                plan.things[kind, name] = Change(clip)
            elif (
                kind == ALIAS and name in directory.aliases and file.alias_of(name).kind == SKELETON
            ):
                del plan.things[kind, name]
        copy_things(file, transaction.writer, plan, lambda name: None)


def request_parts(
    entries: Iterable[SourceEncoder], transaction: WriteTransaction, seen: Content
) -> Iterator[SourceEncoder | None]:
    """Yield the sources to encode ahead; None for one that may be stored already."""
    sent: set[bytes] = set()
    for entry in entries:
        try:
            digest = entry.digest()
        except MczError:
            yield None
            continue
        depends = wants_skeleton(entry.path)  # its values depend on the ASF next to it
        is_there = not depends and (digest in seen or digest in sent)
        if is_there or entry.name in transaction.paths:
            yield None
            continue
        sent.add(digest)
        yield entry


@contextmanager
def encode_ahead(
    entries: Sequence[SourceEncoder], transaction: WriteTransaction, seen: Content
) -> Iterator[Iterator[SourceEncoder]]:
    """The entries in order, encoded ahead by other processes if worthwhile."""
    jobs = useful_jobs(len(entries), sum(size_of(entry.path) for entry in entries))
    if jobs == DEFAULT_JOBS or not only_own():
        yield iter(entries)
        return
    asked, profile = request_parts(entries, transaction, seen), transaction.writer.profile
    with answers(encode_part, asked, jobs, profile) as parts:
        yield join_parts(entries, parts)


def join_parts(
    entries: Iterable[SourceEncoder], parts: Iterable[Answer[Part] | None]
) -> Iterator[SourceEncoder]:
    """The entries, with their encoded parts."""
    for entry, answer in zip(entries, parts, strict=True):
        yield entry if answer is None else EncodedPart(entry, answer)
