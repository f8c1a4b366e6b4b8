"""Several MCZ files in one: chunks are copied unchanged, shared ones are written once.

Two different things under one name are never mixed: they are refused, or the later one is renamed.
Files that other processes encode are such files, too: parts of one source file each. Decisions that
depend on the contents of the archive (a used name, a repeated file, a stored skeleton) are made
where the parts are joined, in the order of the files; so the archive equals the one that a single
process would write.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from pathlib import PurePosixPath

from mcz.container import payloads
from mcz.container.directory import Directory
from mcz.container.limits import Profile
from mcz.container.writer import Writer
from mcz.errors import MczError, OptionError, WorkerError
from mcz.files.editing import Outcome, Report
from mcz.files.editing.appending import protect_written, redundancy_of
from mcz.files.editing.folders import size_of
from mcz.files.editing.rewriting import (
    ALIAS,
    ATTACHMENT,
    CLIP,
    SKELETON,
    UNPROTECTED,
    Change,
    Item,
    Plan,
    copy_items,
    items_in,
    path_of,
    plan_whole,
    steps,
    writer_like,
)
from mcz.files.editing.unpacking import Content
from mcz.files.jobs import DEFAULT_JOBS, Answer, answers, has_only_builtins, useful_jobs
from mcz.files.reading.clips import list_some
from mcz.files.reading.file import File, open
from mcz.files.writing.atomic import WriteTransaction, check_name, clip_name, replacing_file
from mcz.files.writing.file import SourceEncoder
from mcz.model.checks import FILES, check_arguments
from mcz.model.schema import parse
from mcz.model.text_format import count_text, quote_name
from mcz.model.types import Progress, Target
from mcz.sources import wants_skeleton


@check_arguments(sources=FILES)
def merge(
    sources: Sequence[Target],
    target: Target,
    *,
    rename: bool = False,
    skip_identical: bool = False,
    force: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Put the contents of several MCZ files into one, clips in the order of the files.

    A name that two of them have, or a path that both restore, is refused. ``skip_identical``: an
    item with the same content in both is copied once. ``rename``: the later one is put below the
    name of its file, "walk" of day2.mcz becomes "day2/walk", and so does its source. Equal files of
    skeletons under one name are always copied once. Raises OptionError, which names the duplicates;
    nothing is left under the target's name then.

    Recovery data belong to one file. If all files have some, the new one gets its own, with the
    greatest redundancy of them; if only some have, the report mentions it.
    """
    if not sources:
        raise OptionError("nothing to merge: give at least one MCZ file")
    merging = Merger(rename, skip_identical)
    with (
        merging.plans(sources) as plans,
        replacing_file(target, force=force, inputs=sources) as stream,
    ):
        report, files = merging.report, [file for file, _ in plans]
        writer = writer_like(stream, files)
        merging.carry(plans, writer, progress)
        writer.finish()
        if share := _share_of_all(files):
            protect_written(stream, share)
            report.left_out = [t for t in report.left_out if not t.endswith(UNPROTECTED)]
        report.size = stream.tell()
    return report


def _share_of_all(files: Sequence[File]) -> float | None:
    """The greatest redundancy of the files; None if one has no recovery data."""
    shares = [redundancy_of(file.container) for file in files]
    known = [share for share in shares if share is not None]
    return max(known) if len(known) == len(shares) else None


def add_files(
    sources: Sequence[Target],
    before: File,
    transaction: WriteTransaction,
    rename: bool,
    skip_identical: bool,
    progress: Progress | None,
) -> Report:
    """Copy the contents of MCZ files to ``transaction``, which adds to the file ``before``.

    Raises as ``merge``.
    """
    # Newly written content is unique: it cannot be read yet.
    present: dict[Item, Callable[[], object]] = dict.fromkeys(
        items_in(transaction.writer.directory), object
    )
    merging = Merger(rename, skip_identical, present)
    merging.known |= {item: _content(before, item) for item in items_in(before)}
    merging.paths.update(transaction.paths)

    def kept(done: int, total: int, name: str) -> None:
        transaction.keep()
        if progress is not None:
            progress(done, total, name)

    with merging.plans(sources) as plans:
        merging.carry(plans, transaction.writer, kept)
    return merging.report


@dataclass(slots=True)
class Merger:
    """Files that are merged, and the contents of the new file up to now.

    ``known`` identifies the content of each item, ``paths`` are those of all restored files.
    ``rename`` and ``skip_identical`` are those of ``merge``.
    """

    rename: bool
    skip_identical: bool
    known: dict[Item, Callable[[], object]] = field(default_factory=dict)
    paths: set[str] = field(default_factory=set)
    report: Report = field(default_factory=Report)

    @contextmanager
    def plans(self, sources: Sequence[Target]) -> Iterator[list[tuple[File, Plan]]]:
        """The files, and the parts of each to copy; raises OptionError as ``merge``."""
        with ExitStack() as stack:
            files = [stack.enter_context(open(source)) for source in sources]
            double: list[str] = []
            pairs = [(file, self._plan_file(file, double)) for file in files]
            if double:
                raise OptionError(
                    f"{list_some(double)}: {count_text(len(double), 'name')} in more than one "
                    "file; rename the later ones, or skip identical content"
                )
            yield pairs

    def _plan_file(self, file: File, double: list[str]) -> Plan:
        """Plan the parts of ``file`` to copy; refused names are added to ``double``."""
        plan = plan_whole(file)
        for item in list(plan.changes):
            kind, name = item
            stored = self.known.get(item)
            of_skeleton = kind == ALIAS and file.alias_of(name).kind == SKELETON
            may_skip = stored is not None and (self.skip_identical or of_skeleton)
            new = ""
            if stored is not None and may_skip and stored() == _content(file, item)():
                del plan.changes[item]  # aliases refer to the present one
                new, result = "the same content", "present"
            elif stored is None and path_of(file, item) not in self.paths:
                result = "copied"
            elif self.rename:
                new, result = self._free_name(file, item), "renamed"
                path = path_of(file, item) if kind == CLIP else ""
                plan.changes[item] = Change(new, new.removesuffix(name) + path if path else None)
            else:
                double.append(f"{kind} {quote_name(name)}")
                continue
            self.report.outcomes.append(Outcome(name, result, 0, new))
        for item, change in plan.changes.items():
            self.known[item[0], change.name or item[1]] = _content(file, item)
            if path := path_of(file, item, change):
                self.paths.add(path)
        return plan

    def _free_name(self, file: File, item: Item) -> str:
        kind, name = item
        stem = PurePosixPath(file.name.replace("\\", "/")).stem or "file"
        folders = (stem if n == 1 else f"{stem}~{n}" for n in count(1))
        return next(
            new
            for new in (f"{folder}/{name}" for folder in folders)
            if (kind, new) not in self.known and new not in self.paths
        )

    def carry(
        self, plans: Sequence[tuple[File, Plan]], writer: Writer, progress: Progress | None
    ) -> None:
        """Copy the planned parts of the files."""
        step = steps(progress, sum(len(plan.changes_of(CLIP)) for _, plan in plans))
        for file, plan in plans:
            left_out = copy_items(file, writer, plan, step)
            self.report.left_out += [f"{file.name}: {text}" for text in left_out]


def _content(file: File, item: Item) -> Callable[[], object]:
    """A function that returns the content of an item, equal for interchangeable items."""
    kind, name = item
    if kind == ALIAS:
        return _alias_content(file, name)
    return partial(_clip_content if kind == CLIP else _attachment_content, file, name)


def _clip_content(file: File, name: str) -> object:
    clip = file.clips[name]
    hashes = clip.container.whole_cend(clip.container.directory.clips[name])
    digests = [hashes.source_sha256, *hashes.value_sha256]
    path = clip.source.path if clip.source is not None else ""
    return clip.skeleton_id, clip.frame_rate, path, dict(clip.metadata), digests


def _attachment_content(file: File, name: str) -> tuple[int, bytes]:
    part = file.container.directory.attachments[name].parts[0]
    fields = parse(payloads.Atta, file.container.payload(part), part.label)
    return fields.size, bytes(fields.sha256)


def _alias_content(file: File, alias: str) -> Callable[[], object]:
    kind, name = file.alias_of(alias)
    if kind == CLIP and name in file.clips.rows:
        source = file.clips[name].source
        return lambda: None if source is None else source.sha256
    if kind == ATTACHMENT and name in file.attachments:
        return lambda: _attachment_content(file, name)[1]
    return lambda: (kind, name)


@dataclass(frozen=True, slots=True)
class Part:
    """One encoded file: ``data`` is an MCZ file of it alone, written by ``encoder``.

    ``digest`` is the SHA-256 of the source file, ``result`` that of ``SourceEncoder.write``.
    """

    encoder: SourceEncoder
    digest: bytes
    data: bytes
    result: str


def encode_part(profile: Profile, settings: SourceEncoder) -> Part:
    """The part of a file, within the limits of the target; raises as ``SourceEncoder.write``."""
    encoder = SourceEncoder(settings.path, settings.name, settings.options, settings.encoding)
    sink = io.BytesIO()
    transaction = WriteTransaction(sink, profile)
    result = encoder.write(transaction)
    transaction.finish()
    digest = transaction.paths[settings.name]
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
        for kind, name in list(plan.changes):
            if kind == CLIP and name != clip:
                plan.changes[kind, name] = Change(clip)
            elif (
                kind == ALIAS and name in directory.aliases and file.alias_of(name).kind == SKELETON
            ):
                del plan.changes[kind, name]
        copy_items(file, transaction.writer, plan, lambda name: None)


def request_parts(
    entries: Iterable[SourceEncoder], transaction: WriteTransaction, content: Content
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
        is_there = not depends and (digest in content or digest in sent)
        if is_there or entry.name in transaction.paths:
            yield None
            continue
        sent.add(digest)
        yield entry


@contextmanager
def encode_ahead(
    entries: Sequence[SourceEncoder], transaction: WriteTransaction, content: Content
) -> Iterator[Iterator[SourceEncoder]]:
    """The entries in order, encoded ahead by other processes if worthwhile."""
    jobs = useful_jobs(len(entries), sum(size_of(entry.path) for entry in entries))
    if jobs == DEFAULT_JOBS or not has_only_builtins():
        yield iter(entries)
        return
    requests, profile = request_parts(entries, transaction, content), transaction.writer.profile
    with answers(encode_part, requests, jobs, profile) as parts:
        pairs = zip(entries, parts, strict=True)
        yield (entry if answer is None else EncodedPart(entry, answer) for entry, answer in pairs)
