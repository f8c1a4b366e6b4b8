"""Archives: many files into one, and more files into it."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path

from mcz.container import payloads
from mcz.container.limits import profile_named
from mcz.container.metadata import SETTABLE, Record
from mcz.errors import MczError, OptionError, SourceError, remark_of
from mcz.files.editing import Outcome, Report
from mcz.files.editing.appending import append_at_end, redundancy_of, still_protect
from mcz.files.editing.folders import (
    dropped_facts,
    files_below,
    find_sources,
    motion_files,
    notes_on,
    size_of,
    skipped_outcome,
    stamp,
)
from mcz.files.editing.merging import RemotePart, add_files, encode_ahead
from mcz.files.editing.metadata_edit import set_metadata
from mcz.files.editing.reorganize import delete_clips
from mcz.files.editing.rewriting import UNPROTECTED
from mcz.files.editing.unpacking import Content, stored_files
from mcz.files.jobs import limit_jobs
from mcz.files.reading.file import File, open
from mcz.files.reading.source_files import SourceOptions, read_bytes
from mcz.files.writing.atomic import WriteTransaction, check_name, refuse_inputs, replacing
from mcz.files.writing.file import SourceEncoder, encoding_options
from mcz.hints import split_hint
from mcz.model.checks import PATH, PATHS, check_arguments
from mcz.model.threads import limit_threads
from mcz.model.types import Params, Progress, Target
from mcz.sources import wants_skeleton


@check_arguments(directory=PATH)
def pack(
    directory: str | os.PathLike[str],
    target: Target,
    *,
    codec: str | None = None,
    effort: str | None = None,
    params: Params | None = None,
    rate: float | None = None,
    force_rate: bool = False,
    unit: str | None = None,
    up: str | None = None,
    arrays: str | None = None,
    model: str | os.PathLike[str] | None = None,
    verbatim: bool = False,
    keep_all: bool = False,
    force: bool = False,
    profile: str = "base",
    copies: bool = True,
    mtimes: bool = False,
    threads: int | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """Pack every motion file below ``directory`` into one MCZ file.

    A file that cannot be parsed is reported and left out; ``verbatim`` keeps it as an attachment,
    ``keep_all`` also keeps files of other kinds so, which are skipped otherwise. Paths are stored
    relative to ``directory``. ``rate`` applies to files that state none, with ``force_rate`` to
    all. ``arrays`` and ``model`` are as in ``mcz.read``; ``effort``, ``copies`` and ``threads`` as
    in ``mcz.write``; ``jobs`` processes work in parallel, by default one: the bytes are the same.
    ``mtimes`` stores the modification time of each file as metadata of its clip, so that the same
    files give other bytes later. An earlier MCZ file of the target's name is not packed; any other
    file that the target would replace is refused, even with ``force``.
    """
    root = Path(directory)
    if not root.is_dir():
        raise OptionError("not a folder", path=root)
    paths, others = files_below(root, target)
    if not keep_all:
        paths, left = motion_files(paths)
        others += [skipped_outcome(path, root) for path in left]
    options = SourceOptions(
        rate=rate,
        force_rate=force_rate,
        unit=unit,
        up=up,
        arrays=arrays,
        model=model,
        verbatim=verbatim or keep_all,
        flat=True,
    )
    encoding = encoding_options(codec, effort, params)
    limits = profile_named(profile)
    files = [(path, path.relative_to(root).as_posix()) for path in paths]
    entries = [SourceEncoder(path, name, options, encoding) for path, name in files]
    inputs = (*paths, *encoding.params.values())
    with (
        limit_threads(threads),
        limit_jobs(jobs),
        replacing(target, force=force, inputs=inputs) as stream,
    ):
        transaction = WriteTransaction(stream, limits, copies=copies)
        report = _write_entries(transaction, entries, progress)
        refuse_inputs(target, _inputs_of(entries))
        without_times = _write_times(transaction, entries) if mtimes else []
        transaction.finish()
    report.size = transaction.writer.offset
    failed = {outcome.path for outcome in report.failures}
    timeless = [entry.path for entry in without_times if entry.name not in failed]
    report.left_out += dropped_facts(root, paths, timeless)
    report.add_messages(notes_on(entry.name for entry in entries))
    report.outcomes += sorted(others, key=lambda outcome: os.fsencode(outcome.path))
    return report


def _write_times(
    transaction: WriteTransaction, entries: Sequence[SourceEncoder]
) -> list[SourceEncoder]:
    """Store the times of files that are clips; return the others: skeletons, aliases and so on."""
    records, others = [], []
    for entry in entries:
        if entry.name not in transaction.clips:
            others.append(entry)
            continue
        with suppress(OSError):
            records.append(Record(transaction.clips[entry.name], {"mtime": stamp(entry.path)}))
    with transaction.step():
        transaction.writer.metadata(records)
    return others


def _inputs_of(entries: Sequence[SourceEncoder]) -> Iterator[Path]:
    return chain.from_iterable(entry.inputs for entry in entries)


@check_arguments(sources=PATHS, target=PATH)
def append(
    sources: Sequence[str | os.PathLike[str]],
    target: str | os.PathLike[str],
    *,
    codec: str | None = None,
    effort: str | None = None,
    params: Params | None = None,
    skeleton: str | os.PathLike[str] | None = None,
    rate: float | None = None,
    force_rate: bool = False,
    unit: str | None = None,
    up: str | None = None,
    arrays: str | None = None,
    model: str | os.PathLike[str] | None = None,
    verbatim: bool = False,
    root: str | os.PathLike[str] | None = None,
    salvage: bool = False,
    force: bool = False,
    rename: bool = False,
    skip_identical: bool = False,
    replace: bool = False,
    copies: bool | None = None,
    threads: int | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """Add files after the last valid FOOT of an MCZ file, which stays readable throughout.

    Each is stored under its path relative to ``root``, or without one under its name; a folder
    stands for all motion files below it, with paths relative to it. A file that the target already
    restores under the same path is left out as "present", another one under a used path is refused,
    and one whose content is stored under another name becomes an alias. The contents of an MCZ file
    are copied without re-encoding; ``rename`` and ``skip_identical`` are as in ``mcz.merge``,
    ``rate`` and ``force_rate`` as in ``mcz.pack``. If a source cannot be added, none is. Additions
    to a file with recovery data get their own. ``replace``: a file replaces an older one from the
    same path, for which the whole archive is rewritten; the metadata of the old clip are kept.

    A truncated target is continued from its last valid FOOT. Where intact clips follow that,
    ``salvage`` keeps them and ``force`` drops them; otherwise a FormatError names them. If its end
    is damaged, one of the two is required. ``arrays`` is as in ``mcz.read``, ``threads`` as in
    ``mcz.write``, and so is ``copies``, for all chunks without copies; None: if the file has some.
    ``jobs`` is as in ``mcz.pack``. Raises AccessError while another process is appending,
    OptionError if the target is also a source.
    """
    refuse_inputs(target, (*sources, skeleton, *(params or {}).values()))
    options = SourceOptions(
        skeleton=skeleton,
        rate=rate,
        force_rate=force_rate,
        unit=unit,
        up=up,
        arrays=arrays,
        model=model,
        verbatim=verbatim,
    )
    encoding = encoding_options(codec, effort, params)
    archives = [source for source in sources if Path(source).suffix.lower() == ".mcz"]
    files = [source for source in sources if source not in archives]
    named, others = find_sources(files, root, target)
    entries = [SourceEncoder(path, name, options, encoding) for path, name in named]
    with (
        limit_threads(threads),
        limit_jobs(jobs),
        replace_older(Path(target), named if replace else ()) as grown,
        append_at_end(grown, salvage=salvage, force=force) as growth,
    ):
        container = growth.container
        paths, content = stored_files(container)
        has_copies = bool(container.copies()) if copies is None else copies
        transaction = WriteTransaction(
            growth.added,
            container.profile,
            container.directory,
            paths,
            copies=has_copies,
            uncopied=container.uncopied() if has_copies else (),
        )
        before = File(container) if archives else None  # before anything is added
        report = _write_entries(transaction, entries, progress, content)
        if report.failures:
            words, hints = zip(*(split_hint(o.message) for o in report.failures), strict=True)
            raise SourceError("; ".join(words), hint=hints[0] if len(set(hints)) == 1 else None)
        refuse_inputs(target, _inputs_of(entries))
        if before is not None:
            added = add_files(archives, before, transaction, rename, skip_identical, progress)
            report.outcomes += added.outcomes
            report.left_out += added.left_out
        redundancy = None
        if growth.tail.kept or any(outcome.result != "present" for outcome in report.outcomes):
            redundancy = redundancy_of(container)
            transaction.finish()
    if still_protect(target, redundancy):
        report.left_out = [text for text in report.left_out if not text.endswith(UNPROTECTED)]
    report.size = Path(target).stat().st_size
    report.add_messages(notes_on(transaction.paths, {outcome.path for outcome in report.outcomes}))
    report.outcomes += others
    tail = growth.tail
    text = "it was complete after the last FOOT of an interrupted file"
    result = "salvaged" if tail.kept else "dropped"
    report.outcomes += [Outcome(name, result, 0, text) for name in tail.names]
    return report


def _write_entries(
    transaction: WriteTransaction,
    entries: Sequence[SourceEncoder],
    progress: Progress | None,
    content: Content | None = None,
) -> Report:
    """Write the files; ``content``: contents of the target by digest."""
    report = Report()
    content = {} if content is None else content
    with encode_ahead(entries, transaction, content) as in_turn:
        write_in_turn(transaction, in_turn, len(entries), report, progress, content)
    return report


def write_in_turn(
    transaction: WriteTransaction,
    entries: Iterable[SourceEncoder],
    total: int,
    report: Report,
    progress: Progress | None,
    content: Content,
) -> None:
    """Write one file after the other; ``report`` gets the outcome of each."""
    for done, entry in enumerate(entries):
        size = entry.size if isinstance(entry, RemotePart) else size_of(entry.path)
        try:
            result = _write_entry(transaction, entry, content)
            notes = tuple(filter(None, (entry.remark, *entry.notes)))
            report.outcomes.append(Outcome(entry.name, result, size, entry.reason, notes))
        except MczError as error:
            report.outcomes.append(
                Outcome(entry.name, "failed", size, remark_of(error, path=entry.name))
            )
        if progress is not None:
            progress(done + 1, total, entry.name)


def _write_entry(transaction: WriteTransaction, entry: SourceEncoder, content: Content) -> str:
    """Write one file, or an alias if the same bytes are stored already."""
    digest = entry.digest()
    depends = wants_skeleton(entry.path)  # its values depend on the ASF next to it
    writer = transaction.writer
    if digest in content and not depends and not transaction.holds(entry.name, digest):
        check_name(entry.name)
        with transaction.step():
            writer.alias(entry.name, *content[digest])
        transaction.paths[entry.name] = digest
        return "alias"
    clips, attachments = len(writer.directory.clips), len(writer.directory.attachments)
    result = entry.write(transaction)
    if len(writer.directory.clips) > clips:
        name = next(reversed(writer.directory.clips))
        content[digest] = (payloads.OF_CLIP, name.encode())
        transaction.clips[entry.name] = name
    elif len(writer.directory.attachments) > attachments:
        content[digest] = (payloads.OF_ATTACHMENT, entry.name.encode())
    return result


Said = dict[str, dict[str, str]]  # metadata of clips, by the paths of their files
Named = Sequence[tuple[Path, str]]  # files, each with its path in the archive


@contextmanager
def replace_older(target: Path, files: Named) -> Iterator[Path]:
    """The path of a file to append ``files`` to: a copy, if it must replace older contents.

    The copy lacks these, and takes the place of ``target`` when the block succeeds. Metadata of a
    replaced clip are set for the new one. Raises OptionError if an alias has the same content.
    """
    old: list[str] = []
    if files:
        with open(target) as file:
            old, metadata = _find_superseded(file, files)
    if not old:
        yield target
        return
    with tempfile.TemporaryDirectory(prefix=f".{target.name[:48]}.", dir=target.parent) as folder:
        copy = Path(folder, target.name)
        delete_clips(target, old, output=copy)
        yield copy
        with open(copy) as file:
            by_path = {clip.source.path: clip.name for clip in file.clips.values() if clip.source}
        changes = {
            by_path[path]: words for path, words in metadata.items() if words and path in by_path
        }
        if changes:
            set_metadata(copy, changes)
        os.chmod(copy, target.stat().st_mode)
        os.replace(copy, target)


def _find_superseded(file: File, files: Named) -> tuple[list[str], Said]:
    """The items from the same paths, and their metadata by path."""
    paths, _ = stored_files(file.container)
    clips = {clip.source.path: clip for clip in file.clips.values() if clip.source is not None}
    old: list[str] = []
    metadata: Said = {}
    for path, name in files:
        present = paths.get(name)
        if present is None:
            continue
        digest = present if isinstance(present, bytes) else present()
        if digest == hashlib.sha256(read_bytes(path)).digest():
            continue
        clip = clips.get(name)
        old.append(name if clip is None else clip.name)
        if clip is not None:
            metadata[name] = {
                key: value
                for key, value in clip.metadata.items()
                if (key in SETTABLE and key != "mtime") or key.startswith("x-")
            }
    return old, metadata
