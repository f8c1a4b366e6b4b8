"""Clips deleted, renamed, reordered, or split over several files, without re-encoding.

The new file contains no byte of deleted clips, nor of skeletons, templates, models and metadata
that only they used. ``rewriting.py`` copies the rest.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath

from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.reader import Container
from mcz.errors import ExistsError, OptionError
from mcz.files.editing import Outcome, Report
from mcz.files.editing.folders import PortableNames, make_folder
from mcz.files.editing.rewriting import (
    ALIAS,
    ATTACHMENT,
    CLIP,
    KINDS,
    SKELETON,
    UNCHANGED,
    Change,
    Item,
    Plan,
    Rewriting,
    Shared,
    items_in,
    path_of,
    plan_whole,
    rewriting,
    steps,
)
from mcz.files.queries import Value
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Where, getter_of, list_some, matching_clips
from mcz.files.reading.file import File, open
from mcz.files.reading.sizes import models_used
from mcz.files.writing.atomic import check_name
from mcz.hints import Hint
from mcz.model.checks import MAPPING, PATH, check_arguments
from mcz.model.text_format import count_text, nearest_names, quote_name
from mcz.model.types import Progress, Target

FOLDER = "folder"  # split by the first part of the names


@check_arguments()
def delete_clips(
    target: Target,
    names: str | Iterable[str] = (),
    *,
    where: Where | None = None,
    aliases: bool = False,
    output: Target | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Delete clips, attachments and aliases from an MCZ file, including their bytes.

    ``names``: clips, attachments or aliases; ``where``: also the clips that match it, see
    ``File.find``. Skeletons and their files, templates and models that only they need are deleted
    too. An alias of the same content would keep it: with ``aliases`` it is deleted as well, without
    it is refused. ``output``: the new file, to which ``force`` applies; None: it replaces the old
    one once it is complete. Raises OptionError for an unknown name, and without any.
    """
    with rewriting(target, output, force=force, progress=progress) as job:
        file = job.file
        items = [_find_item(file, name) for name in ([names] if isinstance(names, str) else names)]
        if where is not None:
            items += [(CLIP, clip.name) for clip in file.find(where)]
        if not items:
            reason = "name clips or give where" if where is None else f"no clip matches {where!r}"
            raise OptionError(f"nothing to delete; {reason}", path=file.name)
        gone = dict.fromkeys(items)
        others = [(ALIAS, alias) for alias in file.aliases if file.alias_of(alias) in gone]
        missed = [alias for _, alias in others if (ALIAS, alias) not in gone]
        if missed and not aliases:
            raise OptionError(
                f"{list_some(missed)} {('is' if len(missed) == 1 else 'are')} the same "
                "content under another name, which would be deleted too; name it, or set "
                "aliases",
                path=file.name,
            )
        gone |= dict.fromkeys(others)
        plan = _plan_without(file, gone)
        kinds = {item: item[0] for kind in KINDS for item in gone if item[0] == kind}
        for item in items_in(file):
            if item not in plan.changes:  # with the clips that had the skeleton
                kinds.setdefault(item, "the file of a skeleton that no other clip has")
        report = Report(
            [Outcome(name, "deleted", 0, reason) for (_, name), reason in kinds.items()]
        )
        return job.write(plan, report)


def _find_item(file: File, name: str) -> Item:
    tables: tuple[Collection[str], ...] = (file.clips.rows, file.attachments, file.aliases)
    for kind, table in zip(KINDS, tables, strict=True):
        if name in table:
            return kind, name
    clips = matching_clips(file.clips, name)
    if len(clips) == 1:
        return CLIP, clips[0]
    if clips:
        raise OptionError(f"{name!r} is ambiguous: {list_some(clips)}; choose one", path=file.name)
    near = nearest_names(name, [other for _, other in items_in(file)])
    suggestion = f"; did you mean {near}?" if near else ""
    raise OptionError(
        f"no clip, attachment or alias is called {name!r}{suggestion}", path=file.name
    )


def _plan_without(file: File, gone: Collection[Item]) -> Plan:
    """Plan a file without ``gone`` and without anything that only these need."""
    plan = plan_whole(file)
    plan.changes = {item: UNCHANGED for item in plan.changes if item not in gone}
    needed = used_by(file, plan.changes_of(CLIP))
    lost = used_by(file, [name for kind, name in gone if kind == CLIP])
    of_skeleton = {
        alias: (ChunkType.SKEL, target)
        for alias, (of, target) in file.aliases.items()
        if of == payloads.OF_SKELETON
    }
    for alias, skeleton in of_skeleton.items():
        if (ALIAS, alias) in gone:
            lost |= used_by_skeleton(file.container, skeleton[1])
        elif skeleton not in lost:
            needed |= used_by_skeleton(file.container, skeleton[1])
    lost -= needed
    plan.shared = [key for key in plan.shared if key not in lost]
    for alias, skeleton in of_skeleton.items():
        if skeleton in lost:
            plan.changes.pop((ALIAS, alias), None)
    return plan


@check_arguments(names=MAPPING)
def rename_clips(
    target: Target,
    names: Mapping[str, str],
    *,
    output: Target | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Rename clips, attachments and aliases of an MCZ file.

    ``names``: from old to new ones. A clip's source whose path is the clip's name and a suffix is
    renamed too, so that ``unpack`` writes it under the new name; metadata and aliases, which keep
    their own names, follow the clip. Names may be swapped. ``output`` and ``force`` are as in
    ``delete_clips``. Raises OptionError for an unknown name, and for one that is in use.
    """
    with rewriting(target, output, force=force, progress=progress) as job:
        file, report = job.file, Report()
        plan = plan_whole(file)
        for old, new in names.items():
            item = _find_item(file, old)
            check_name(new)
            plan.changes[item] = _rename_change(file, item, new)
            report.outcomes.append(Outcome(item[1], "renamed", 0, new))
        _refuse_equal(file, plan)
        return job.write(plan, report)


def _rename_change(file: File, item: Item, new: str) -> Change:
    """The change that names an item ``new``: the path of a clip's source may follow."""
    path = path_of(file, item) if item[0] == CLIP else ""
    suffix = PurePosixPath(path).suffix
    return Change(new, new + suffix if path and path == item[1] + suffix else None)


def _refuse_equal(file: File, plan: Plan) -> None:
    """Raise OptionError if two items would get the same name."""
    names = Counter((kind, change.name or name) for (kind, name), change in plan.changes.items())
    for (kind, name), number in names.items():
        if number > 1:
            kinds = "aliases" if kind == ALIAS else f"{kind}s"
            raise OptionError(f"two {kinds} would have the name {quote_name(name)}", path=file.name)
    before = Counter(path_of(file, item) for item in plan.changes)
    after = Counter(path_of(file, item, change) for item, change in plan.changes.items())
    for path, number in after.items():
        if path and number > 1 and number > before[path]:
            raise OptionError(f"two files would be restored to {quote_name(path)}", path=file.name)


@check_arguments()
def reorder_clips(
    target: Target,
    names: Sequence[str] = (),
    *,
    by: str | None = None,
    output: Target | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Put the clips of an MCZ file in another order.

    Clips in ``names`` come first, in this order; the others follow in their old order or, with
    ``by``, sorted by a field or metadata key ("-n_frames": descending), those without it last.
    Names are sorted with numbers as numbers: "take2" before "take10". ``output`` and ``force`` are
    as in ``delete_clips``.
    """
    if isinstance(names, str):
        names = [names]
    if not names and by is None:
        raise OptionError("no order given: name clips, or give a key to sort by")
    with rewriting(target, output, force=force, progress=progress) as job:
        file = job.file
        rest = list(file) if by is None else sort_clips(file, list(file), by)
        clips = dict.fromkeys((CLIP, clip.name) for clip in (*file.clips_called(names), *rest))
        plan = plan_whole(file)
        plan.changes = dict.fromkeys([*clips, *plan.changes], UNCHANGED)
        report = Report([Outcome(name, "moved") for _, name in clips])
        return job.write(plan, report)


def sort_clips(file: File, clips: Sequence[Clip], by: str) -> list[Clip]:
    """``clips`` sorted by a field or metadata key, "-" before it: descending; those without last.

    Raises OptionError for an unknown name.
    """
    get = getter_of(by.removeprefix("-"), file.clips.values())
    keyed = [(get(clip), clip) for clip in clips]
    having = [(value, clip) for value, clip in keyed if value is not None]
    having.sort(key=lambda pair: natural(pair[0]), reverse=by.startswith("-"))
    return [clip for _, clip in having] + [clip for value, clip in keyed if value is None]


def natural(value: Value) -> tuple[object, ...]:
    """Sort key with numbers within texts as numbers: "take2" before "take10"."""
    if isinstance(value, str):
        parts = re.split(r"([0-9]+)", value)
        return 1, [(int(part), part) if part.isdigit() else (-1, part.casefold()) for part in parts]
    return 0, value


@check_arguments(directory=PATH)
def split(
    target: Target,
    directory: str | os.PathLike[str],
    *,
    by: str = FOLDER,
    rest: str | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Split the clips of an MCZ file over files below ``directory``, one for each value of ``by``.

    ``by``: a field or metadata key, or "folder", the first part of the clips' names. Each file has
    the value as its name, with the skeletons, templates and aliases of its clips. Clips without a
    value, attachments, and skeletons without a clip go to the file called ``rest``; without it they
    are an OptionError. ``target`` does not change.
    """
    folder, report = Path(directory), Report()
    with open(target) as file:
        groups = _group_clips(file, by, rest)
        portable = PortableNames()
        outputs = {v: folder / portable(f"{v.replace('/', '_')}.mcz") for v in groups}
        for path in () if force else outputs.values():
            if os.path.lexists(path):
                raise ExistsError("already exists", path=path, hint=Hint.FORCE)
        make_folder(folder)
        step = steps(progress, len(file.clips))
        for value, names in groups.items():
            plan, part = _plan_part(file, names, with_rest=value == rest), Report()
            Rewriting(target, outputs[value], force, None, file).write(plan, part, step)
            message = count_text(len(names), "clip")
            report.outcomes.append(Outcome(str(outputs[value]), "written", part.size or 0, message))
    return report


def _group_clips(file: File, by: str, rest: str | None) -> dict[str, list[str]]:
    get = _folder if by == FOLDER else getter_of(by, file.clips.values())
    groups: dict[str, list[str]] = {}
    without = []
    for clip in file:
        value = get(clip)
        if value is None or value == "":
            without.append(clip.name)
        else:
            groups.setdefault(_text(value), []).append(clip.name)
    needed = used_by(file, file.clips)
    others = [key for key in file.container.directory.shared if key not in needed]
    if rest is not None:
        groups.setdefault(rest, []).extend(without)
    elif without or file.attachments or others:
        left = [(len(without), "clip"), (len(file.attachments), "attachment")]
        left.append((sum(kind == ChunkType.SKEL for kind, _ in others), "skeleton"))
        text = ", ".join(count_text(n, word) for n, word in left if n)
        if text:
            raise OptionError(f"{text} without {by}; name a file for the rest", path=file.name)
    return groups


def _folder(clip: Clip) -> Value:
    return clip.name.partition("/")[0] if "/" in clip.name else None


def _text(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _plan_part(file: File, names: Sequence[str], *, with_rest: bool) -> Plan:
    """Plan the file of these clips; ``with_rest``: with everything outside of clips."""
    needed = used_by(file, names)
    if with_rest:
        needed |= set(file.container.directory.shared) - used_by(file, file.clips)
    shared = [key for key in file.container.directory.shared if key in needed]
    plan = Plan(dict.fromkeys(((CLIP, name) for name in names), UNCHANGED), shared)
    if with_rest:
        plan.changes |= dict.fromkeys(((ATTACHMENT, name) for name in file.attachments), UNCHANGED)
    items = {*plan.changes}
    items |= {(SKELETON, id_.hex()) for kind, id_ in shared if kind == ChunkType.SKEL}
    others = [(ALIAS, alias) for alias in file.aliases if file.alias_of(alias) in items]
    plan.changes |= dict.fromkeys(others, UNCHANGED)
    return plan


def used_by(file: File, names: Iterable[str]) -> set[Shared]:
    """The skeletons with their bases, the templates and the models that these clips need."""
    container, items = file.container, set[Shared]()
    has_models = bool(container.directory.ids(ChunkType.MODL))
    for name in names:
        row = container.directory.clips[name]
        source = container.clip_head(row).source
        if source is not None:
            items.add((ChunkType.SRCE, source.template))
        if (ChunkType.SKEL, row.skeleton) not in items:
            items |= used_by_skeleton(container, row.skeleton)
        for signal in file.clips[name].signals if has_models else ():
            items |= {(ChunkType.MODL, id_) for id_ in models_used(signal)}
    return items


def used_by_skeleton(container: Container, id_: bytes) -> set[Shared]:
    """A skeleton, its bases, and the templates of their own files."""
    items: set[Shared] = set()
    next_id: bytes | None = id_
    while next_id and (ChunkType.SKEL, next_id) not in items:
        fields = container.skeleton_fields(next_id)
        items.add((ChunkType.SKEL, next_id))
        if fields.source:
            items.add((ChunkType.SRCE, bytes(fields.source.template)))
        next_id = fields.base
    return items
