"""Several MCZ files in one: chunks are copied unchanged, shared ones are written once.

``chunk_copier.py`` copies without re-encoding. Two different things under one name are never mixed:
they are refused, or the later one is renamed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from pathlib import PurePosixPath

from mcz.container import payloads
from mcz.container.writer import Writer
from mcz.errors import OptionError
from mcz.files.editing.appending import protect_written, redundancy_of
from mcz.files.editing.batch_report import Outcome, Report
from mcz.files.editing.chunk_copier import UNPROTECTED, Change
from mcz.files.editing.rewriting import (
    ALIAS,
    ATTACHMENT,
    CLIP,
    SKELETON,
    Plan,
    Thing,
    copy_things,
    path_of,
    plan_whole,
    steps,
    things_in,
    writer_like,
)
from mcz.files.reading.clips import list_some
from mcz.files.reading.file import File, open
from mcz.files.writing.atomic import WriteTransaction, replacing_file
from mcz.model.schema import parse
from mcz.model.text_format import counted, shown
from mcz.model.types import Progress, Target


def merge(
    sources: Sequence[str | os.PathLike[str]],
    target: Target,
    *,
    rename: bool = False,
    skip_identical: bool = False,
    force: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Put the contents of several MCZ files into one, clips in the order of the files.

    A name that two of them have, or a path that both restore, is refused. ``skip_identical``: a
    thing with the same content in both is copied once. ``rename``: the later one is put below the
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
    sources: Sequence[str | os.PathLike[str]],
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
    there: dict[Thing, Callable[[], object]] = dict.fromkeys(
        things_in(transaction.writer.directory), object
    )
    merging = Merger(rename, skip_identical, there)
    merging.things |= {thing: _content(before, thing) for thing in things_in(before)}
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

    ``things`` identify the content of each, ``paths`` are those of all files that it restores.
    ``rename`` and ``skip_identical`` are those of ``merge``.
    """

    rename: bool
    skip_identical: bool
    things: dict[Thing, Callable[[], object]] = field(default_factory=dict)
    paths: set[str] = field(default_factory=set)
    report: Report = field(default_factory=Report)

    @contextmanager
    def plans(self, sources: Sequence[str | os.PathLike[str]]) -> Iterator[list[tuple[File, Plan]]]:
        """The files, and the parts of each to copy; raises OptionError as ``merge``."""
        with ExitStack() as stack:
            files = [stack.enter_context(open(source)) for source in sources]
            double: list[str] = []
            pairs = [(file, self._plan_file(file, double)) for file in files]
            if double:
                raise OptionError(
                    f"{list_some(double)}: {counted(len(double), 'name')} in more than one "
                    "file; rename the later ones, or skip identical content"
                )
            yield pairs

    def _plan_file(self, file: File, double: list[str]) -> Plan:
        """Plan the parts of ``file`` to copy; refused names are added to ``double``."""
        plan = plan_whole(file)
        for thing in list(plan.things):
            kind, name = thing
            there = self.things.get(thing)
            of_skeleton = kind == ALIAS and file.alias_of(name).kind == SKELETON
            may_skip = there is not None and (self.skip_identical or of_skeleton)
            new = ""
            if there is not None and may_skip and there() == _content(file, thing)():
                del plan.things[thing]  # aliases refer to the present one
                new, result = "the same content", "present"
            elif there is None and path_of(file, thing) not in self.paths:
                result = "copied"
            elif self.rename:
                new, result = self._free_name(file, thing), "renamed"
                path = path_of(file, thing) if kind == CLIP else ""
                plan.things[thing] = Change(new, new.removesuffix(name) + path if path else None)
            else:
                double.append(f"{kind} {shown(name)}")
                continue
            self.report.outcomes.append(Outcome(name, result, 0, new))
        for thing, change in plan.things.items():
            self.things[thing[0], change.name or thing[1]] = _content(file, thing)
            if path := path_of(file, thing, change):
                self.paths.add(path)
        return plan

    def _free_name(self, file: File, thing: Thing) -> str:
        kind, name = thing
        stem = PurePosixPath(file.name.replace("\\", "/")).stem or "file"
        folders = (stem if n == 1 else f"{stem}~{n}" for n in count(1))
        return next(
            new
            for new in (f"{folder}/{name}" for folder in folders)
            if (kind, new) not in self.things and new not in self.paths
        )

    def carry(
        self, plans: Sequence[tuple[File, Plan]], writer: Writer, progress: Progress | None
    ) -> None:
        """Copy the planned parts of the files."""
        step = steps(progress, sum(len(plan.things_of(CLIP)) for _, plan in plans))
        for file, plan in plans:
            left_out = copy_things(file, writer, plan, step)
            self.report.left_out += [f"{file.name}: {text}" for text in left_out]


def _content(file: File, thing: Thing) -> Callable[[], object]:
    """A finder of the content of a thing, equal for two that can replace each other."""
    kind, name = thing
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
