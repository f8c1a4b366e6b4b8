"""Several MCZ files in one: chunks are carried over as they are, what they share is written once.

Nothing is coded anew (``carrying.py``). Two different things under one name are never mixed: that
is refused, or the later one is called otherwise.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import count
from pathlib import PurePosixPath

from mcz.brief import counted, shown
from mcz.container import payloads
from mcz.container.writer import Writer
from mcz.editing.carrying import UNPROTECTED, Change
from mcz.editing.outcomes import Outcome, Report
from mcz.editing.protecting import protect_written, redundancy_of
from mcz.editing.rewriting import (
    Plan,
    carry,
    source_path,
    steps,
    whole,
    writer_like,
)
from mcz.errors import OptionError
from mcz.reading.clip import Clip
from mcz.reading.file import File, open
from mcz.reading.names import listed
from mcz.schema import parse
from mcz.types import Progress, Target
from mcz.writing.atomic import replacing_file
from mcz.writing.draft import Draft

CLIP, ATTACHMENT, ALIAS = "clip", "attachment", "alias"


def merge(
    sources: Sequence[str | os.PathLike[str]],
    target: Target,
    *,
    rename: bool = False,
    skip_identical: bool = False,
    force: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Put all that several MCZ files hold into one, clips in the order of the files.

    A name that two of them have, or a path that both restore, is refused. ``skip_identical``: one
    that means the same content in both is taken once. ``rename``: the later one is put below the
    name of its file, "walk" of day2.mcz becomes "day2/walk", and so is its source. The own files
    of skeletons that are the same under one name are always taken once. Raises OptionError, which
    names what is double; nothing is left under the target's name then.

    Recovery data are of one file. Where all files have some, the new one has its own, in the
    greatest share of theirs; where only some have, the report says so.
    """
    if not sources:
        raise OptionError("nothing to merge: name MCZ files")
    with ExitStack() as stack:
        files = [stack.enter_context(open(source)) for source in sources]
        report, held = Report(), Held()
        plans = [
            joined(file, held, report, rename=rename, skip_identical=skip_identical)
            for file in files
        ]
        _refuse_double(held)
        with replacing_file(target, force=force, inputs=sources) as stream:
            writer = writer_like(stream, files)
            report.left_out += carried(list(zip(files, plans, strict=True)), writer, progress)
            writer.finish()
            report.size = writer.offset
            if share := _share_of_all(files):
                protect_written(stream, share)
                report.size = stream.tell()
                report.left_out = [t for t in report.left_out if not t.endswith(UNPROTECTED)]
    return report


def _share_of_all(files: Sequence[File]) -> float | None:
    """The greatest share of recovery data that a file has; None where not all have some."""
    shares = [redundancy_of(file.container) for file in files]
    known = [share for share in shares if share is not None]
    return max(known) if len(known) == len(shares) else None


def carried(
    plans: Sequence[tuple[File, Plan]], writer: Writer, progress: Progress | None
) -> list[str]:
    """Write what the plans say of their files; return what may not be carried over."""
    step, left_out = steps(progress, sum(len(plan.clips) for _, plan in plans)), []
    for file, plan in plans:
        found = carry(file, writer, plan, step)
        left_out += [f"{file.name}: {text}" for text in found]
    return left_out


def add_files(
    sources: Sequence[str | os.PathLike[str]],
    before: File,
    draft: Draft,
    rename: bool,
    skip_identical: bool,
    progress: Progress | None,
) -> Report:
    """Carry what MCZ files hold over to ``draft``, which adds to the file ``before``.

    Raises as ``merge`` does.
    """
    directory, report = draft.writer.directory, Report()
    contents = {(kind, name): content for kind, name, content in _things(before)}
    names = [(CLIP, name) for name in directory.clips]
    names += [(ATTACHMENT, name) for name in directory.attachments]
    names += [(ALIAS, name) for name in directory.aliases]
    # Content that was written just now is like no other: it cannot be read yet.
    held = Held({key: contents.get(key, object) for key in names}, set(draft.paths))
    with ExitStack() as stack:
        files = [stack.enter_context(open(source)) for source in sources]
        options = {"rename": rename, "skip_identical": skip_identical}
        plans = [(file, joined(file, held, report, **options)) for file in files]
        _refuse_double(held)

        def kept(done: int, total: int, name: str) -> None:
            draft.keep()
            if progress is not None:
                progress(done, total, name)

        report.left_out += carried(plans, draft.writer, kept)
    return report


@dataclass(slots=True)
class Held:
    """What a new file holds so far: what finds whether a thing of a name is the same.

    ``names`` are those of clips, attachments and aliases, each with what tells the content.
    ``paths`` are those of all files that it restores. ``double``: what cannot be taken in.
    """

    names: dict[tuple[str, str], Callable[[], object]] = field(default_factory=dict)
    paths: set[str] = field(default_factory=set)
    double: list[str] = field(default_factory=list)


def joined(file: File, held: Held, report: Report, *, rename: bool, skip_identical: bool) -> Plan:
    """What of ``file`` goes into the file that holds ``held``, which learns it."""
    plan, first = whole(file), not held.names
    for kind, name, content in _things(file):
        if first:
            report.outcomes.append(Outcome(name, "copied", 0, ""))
            continue
        path = _path_of(file, kind, name)
        there = held.names.get((kind, name))
        may_skip = there is not None and _may_skip(kind, file, name, skip_identical)
        if there is not None and may_skip and there() == content():
            _drop(plan, kind, name)
            report.outcomes.append(Outcome(name, "present", 0, "the same content"))
        elif there is None and path not in held.paths:
            report.outcomes.append(Outcome(name, "copied", 0, ""))
        elif rename:
            new = _free(file, held, kind, name)
            _call(file, plan, kind, name, new)
            report.outcomes.append(Outcome(name, "renamed", 0, new))
        else:
            held.double.append(f"{kind} {shown(name)}")
    _learn(file, plan, held)
    return plan


def _refuse_double(held: Held) -> None:
    if held.double:
        raise OptionError(
            f"{listed(held.double)}: {counted(len(held.double), 'name')} in more than one file; "
            "rename the later ones, or skip those of identical content"
        )


def _things(file: File) -> Iterator[tuple[str, str, Callable[[], object]]]:
    """Kind, name, and what finds the content of everything that has a name."""
    for clip in file:
        yield CLIP, clip.name, _of_clip(clip)
    for name in file.attachments:
        yield ATTACHMENT, name, _of_attachment(file, name)
    for name, (of, target) in file.aliases.items():
        yield ALIAS, name, _of_alias(file, of, target)


def _of_clip(clip: Clip) -> Callable[[], object]:
    """What is the same in two clips of which one can stand for the other."""

    def content() -> object:
        hashes = clip.container.whole_cend(clip.container.directory.clips[clip.name])
        digests = [hashes.source_sha256, *hashes.value_sha256]
        path = clip.source.path if clip.source is not None else ""
        return clip.skeleton_id, clip.frame_rate, path, dict(clip.metadata), digests

    return content


def _of_attachment(file: File, name: str) -> Callable[[], tuple[object, ...]]:
    def content() -> tuple[object, ...]:
        container = file.container
        part = container.directory.attachments[name].parts[0]
        fields = parse(payloads.Atta, container.payload(part), part.label)
        return fields.size, bytes(fields.sha256)

    return content


def _of_alias(file: File, of: int, target: bytes) -> Callable[[], object]:
    """The content of what an alias stands for; of a skeleton's file its id."""
    name = target.decode("utf-8", "replace")
    if of == payloads.OF_CLIP and name in file.clips.rows:
        source = file.clips[name].source
        return lambda: None if source is None else source.sha256
    if of == payloads.OF_ATTACHMENT and name in file.attachments:
        content = _of_attachment(file, name)
        return lambda: content()[1]
    return lambda: (of, target)


def _may_skip(kind: str, file: File, name: str, skip_identical: bool) -> bool:
    of_skeleton = kind == ALIAS and file.aliases[name][0] == payloads.OF_SKELETON
    return skip_identical or of_skeleton


def _path_of(file: File, kind: str, name: str) -> str | None:
    return name if kind != CLIP else source_path(file, name) or None


def _drop(plan: Plan, kind: str, name: str) -> None:
    """Take a thing out of the plan, since the file has it: aliases lead to what is there."""
    if kind == CLIP:
        del plan.clips[name]
    else:
        del (plan.attachments if kind == ATTACHMENT else plan.aliases)[name]


def _free(file: File, held: Held, kind: str, name: str) -> str:
    """A name below that of the file, that nothing has."""
    stem = PurePosixPath(file.name.replace("\\", "/")).stem or "file"
    folders = (stem if n == 1 else f"{stem}~{n}" for n in count(1))
    return next(
        new
        for new in (f"{folder}/{name}" for folder in folders)
        if (kind, new) not in held.names and new not in held.paths
    )


def _call(file: File, plan: Plan, kind: str, name: str, new: str) -> None:
    if kind == CLIP:
        path = source_path(file, name)
        plan.clips[name] = Change(new, new.removesuffix(name) + path if path else None)
    elif kind == ATTACHMENT:
        plan.attachments[name] = new
    else:
        plan.aliases[name] = new


def _learn(file: File, plan: Plan, held: Held) -> None:
    """Let ``held`` know what ``plan`` brings, by its new names."""
    contents = {(kind, name): content for kind, name, content in _things(file)}
    for name, change in plan.clips.items():
        held.names[CLIP, change.name or name] = contents[CLIP, name]
        path = change.path or _path_of(file, CLIP, name)
        if path:
            held.paths.add(path)
    for kind, names in ((ATTACHMENT, plan.attachments), (ALIAS, plan.aliases)):
        for name, new in names.items():
            held.names[kind, new] = contents[kind, name]
            held.paths.add(new)
