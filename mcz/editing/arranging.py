"""Clips taken out of a file, renamed, put in another order, or spread over several files.

Nothing is coded anew (``rewriting.py``). What is deleted is in no byte of the new file, nor is what
was there for its sake alone: skeletons, templates, models, what is said of it.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath

from mcz.brief import counted, nearest, shown
from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.editing.carrying import SAME, Change
from mcz.editing.outcomes import Outcome, Report
from mcz.editing.rewriting import (
    Plan,
    rewrite,
    source_of,
    source_path,
    steps,
    used_by,
    used_by_skeleton,
    whole,
)
from mcz.editing.safe_names import PortableNames
from mcz.errors import ExistsError, OptionError
from mcz.hints import Hint
from mcz.queries import Value
from mcz.reading.clip import Clip
from mcz.reading.fields import Where, getter_of
from mcz.reading.file import File, open
from mcz.reading.names import clips_meant, listed
from mcz.types import Progress, Target
from mcz.writing.names import check_name

FOLDER = "folder"  # split by the first part of the names


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
    """Take clips, attachments and aliases out of an MCZ file, and their bytes with them.

    ``names``: those of clips, attachments or aliases; ``where``: also the clips that it takes, see
    ``File.find``. What only they needed goes, too: skeletons and the files of these, templates,
    models. A further name of the same content would keep it: with ``aliases`` it is deleted as
    well, without it is refused. ``output``: the new file, for which ``force`` is; None: it takes
    the place of the old one once it is whole. Raises OptionError for a name that is not there, and
    where nothing is named.
    """
    with source_of(target, output) as file:
        gone = _named(file, [names] if isinstance(names, str) else names)
        if where is not None:
            gone.clips |= {clip.name: SAME for clip in file.find(where)}
        if not (gone.clips or gone.attachments or gone.aliases):
            raise OptionError("nothing to delete; name clips or say where", path=file.name)
        _take_aliases(file, gone, allowed=aliases)
        plan = _without(file, gone)
        report = Report()
        for name, what in (*_each(gone), *_lost_aliases(file, gone, plan)):
            report.outcomes.append(Outcome(name, "deleted", 0, what))
        return _finish(report, target, output, force, file, plan, progress)


def _named(file: File, names: Iterable[str]) -> Plan:
    """The clips, attachments and aliases of these names."""
    found = Plan()
    for name in names:
        clips = clips_meant(file.clips, name)
        if name in file.clips.rows:
            found.clips[name] = SAME
        elif name in file.attachments:
            found.attachments[name] = name
        elif name in file.aliases:
            found.aliases[name] = name
        elif len(clips) == 1:
            found.clips[clips[0]] = SAME
        else:
            raise OptionError(_unknown(file, name, clips), path=file.name)
    return found


def _unknown(file: File, name: str, clips: Sequence[str]) -> str:
    if clips:
        return f"{name!r} may be {listed(clips)}; choose one"
    near = nearest(name, [*file.clips, *file.attachments, *file.aliases])
    return f"nothing is called {name!r}" + (f"; did you mean {near}?" if near else "")


def _take_aliases(file: File, gone: Plan, *, allowed: bool) -> None:
    """Let the further names of what goes go as well, where that is allowed."""
    others = []
    for alias, (of, target) in file.aliases.items():
        name = target.decode("utf-8", "replace")
        of_clip = of == payloads.OF_CLIP and name in gone.clips
        if of_clip or (of == payloads.OF_ATTACHMENT and name in gone.attachments):
            others.append(alias)
    if not allowed and (missed := [alias for alias in others if alias not in gone.aliases]):
        raise OptionError(
            f"{listed(missed)} {'is' if len(missed) == 1 else 'are'} the same content "
            "under another name, which would go, too; name it, or say aliases",
            path=file.name,
        )
    gone.aliases |= {alias: alias for alias in others}


def _without(file: File, gone: Plan) -> Plan:
    """What stays when ``gone`` goes, and what is there for the sake of that alone."""
    plan = whole(file)
    for name in gone.clips:
        del plan.clips[name]
    for name in gone.attachments:
        del plan.attachments[name]
    needed, lost = used_by(file, plan.clips), used_by(file, gone.clips)
    for alias, (of, target) in file.aliases.items():
        if of == payloads.OF_SKELETON and alias in gone.aliases:
            lost |= used_by_skeleton(file.container, target)
        elif of == payloads.OF_SKELETON and (ChunkType.SKEL, target) not in lost:
            needed |= used_by_skeleton(file.container, target)
    lost -= needed
    plan.shared = [key for key in plan.shared if key not in lost]
    for alias, (of, target) in file.aliases.items():
        if alias in gone.aliases or (
            of == payloads.OF_SKELETON and (ChunkType.SKEL, target) in lost
        ):
            del plan.aliases[alias]
    return plan


def _each(gone: Plan) -> list[tuple[str, str]]:
    kinds = (gone.clips, "clip"), (gone.attachments, "attachment"), (gone.aliases, "alias")
    return [(name, what) for names, what in kinds for name in names]


def _lost_aliases(file: File, gone: Plan, plan: Plan) -> list[tuple[str, str]]:
    """The files of skeletons that go with the clips that had them."""
    others = [name for name in file.aliases if name not in plan.aliases | gone.aliases]
    return [(name, "the file of a skeleton that no other clip has") for name in others]


def rename_clips(
    target: Target,
    names: Mapping[str, str],
    *,
    output: Target | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Call clips, attachments and aliases of an MCZ file otherwise.

    ``names``: from the old ones to the new. A clip's source, whose path was the clip's name and a
    suffix, follows it, so that ``unpack`` gives it under the new name; so do what is said of it
    and its aliases, which keep their own names. Names may be swapped. ``output`` and ``force`` are
    those of ``delete_clips``. Raises OptionError for a name that is not there, and for one that is
    taken.
    """
    with source_of(target, output) as file:
        plan, report = whole(file), Report()
        for old, new in names.items():
            _rename(file, plan, old, new, report)
        _refuse_equal(file, plan)
        return _finish(report, target, output, force, file, plan, progress)


def _rename(file: File, plan: Plan, old: str, new: str, report: Report) -> None:
    found = _named(file, [old])
    check_name(new)
    for name in found.clips:
        plan.clips[name] = renamed(file, name, new)
    for name in found.attachments:
        plan.attachments[name] = new
    for name in found.aliases:
        plan.aliases[name] = new
    report.outcomes += [Outcome(name, "renamed", 0, new) for name, _ in _each(found)]


def renamed(file: File, name: str, new: str) -> Change:
    """What makes the clip ``name`` one that is called ``new``."""
    path = source_path(file, name)
    suffix = PurePosixPath(path).suffix
    return Change(new, new + suffix if path and path == name + suffix else None)


def _refuse_equal(file: File, plan: Plan) -> None:
    """Raise OptionError where two things would have one name that have not got one now."""
    names = [change.name or name for name, change in plan.clips.items()]
    tables = {"clips": names, "attachments": [*plan.attachments.values()]}
    tables["aliases"] = [*plan.aliases.values()]
    for what, taken in tables.items():
        if twice := [name for name, count in Counter(taken).items() if count > 1]:
            raise OptionError(f"two {what} would be called {shown(twice[0])}", path=file.name)
    before, after = Counter(paths_of(file, whole(file))), Counter(paths_of(file, plan))
    for path, count in after.items():
        if count > 1 and count > before[path]:
            raise OptionError(f"two files would be restored as {shown(path)}", path=file.name)


def paths_of(file: File, plan: Plan) -> list[str]:
    """The path of every file that what ``plan`` says restores."""
    paths = [*plan.attachments.values(), *plan.aliases.values()]
    found = ((change, source_path(file, name)) for name, change in plan.clips.items())
    return paths + [change.path or path for change, path in found if path]


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

    Those called ``names`` come first, in this order; the others follow in the order that they had
    or, with ``by``, sorted by a field or metadata key ("-n_frames": descending), those without it
    last. Names are sorted as people do: "take2" before "take10". ``output`` and ``force`` are
    those of ``delete_clips``.
    """
    if isinstance(names, str):
        names = [names]
    if not names and by is None:
        raise OptionError("no order: name clips, or say by what they are sorted")
    with source_of(target, output) as file:
        first = {clip.name: SAME for clip in file.clips_called(names)}
        rest = list(file) if by is None else in_order(file, list(file), by)
        plan = whole(file)
        plan.clips = first | {clip.name: SAME for clip in rest if clip.name not in first}
        report = Report([Outcome(name, "moved") for name in plan.clips])
        return _finish(report, target, output, force, file, plan, progress)


def in_order(file: File, clips: Sequence[Clip], by: str) -> list[Clip]:
    """``clips`` sorted by a field or metadata key, "-" before it: descending; those without last.

    Raises OptionError for a name that is neither.
    """
    get = getter_of(by.removeprefix("-"), file.clips.values())
    found = [(get(clip), clip) for clip in clips]
    having = [(value, clip) for value, clip in found if value is not None]
    having.sort(key=lambda pair: natural(pair[0]), reverse=by.startswith("-"))
    return [clip for _, clip in having] + [clip for value, clip in found if value is None]


def natural(value: Value) -> tuple[object, ...]:
    """What sorts numbers as numbers, also those within a text: "take2" before "take10"."""
    if isinstance(value, str):
        parts = re.split(r"([0-9]+)", value)
        return 1, [(int(part), part) if part.isdigit() else (-1, part.casefold()) for part in parts]
    return 0, value


def split(
    target: Target,
    directory: str | os.PathLike[str],
    *,
    by: str = FOLDER,
    rest: str | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Spread the clips of an MCZ file over files below ``directory``, one for each value of ``by``.

    ``by``: a field or metadata key, or "folder", the first part of the clips' names. Each file is
    called like the value and has the skeletons, templates and aliases of its clips. Clips without
    a value, attachments, and skeletons that no clip has, are for the file called ``rest``; without
    it an OptionError says that there are some. ``target`` stays as it is.
    """
    folder, report = Path(directory), Report()
    with open(target) as file:
        groups = _groups(file, by, rest)
        portable = PortableNames()
        outputs = {v: folder / portable(f"{v.replace('/', '_')}.mcz") for v in groups}
        _check_outputs(outputs.values(), force)
        folder.mkdir(parents=True, exist_ok=True)
        step = steps(progress, len(file.clips))
        for value, names in groups.items():
            plan = _part(file, names, with_rest=value == rest)
            output = outputs[value]
            written = rewrite(target, output, force, file, plan, step)
            said = counted(len(plan.clips), "clip")
            report.outcomes.append(Outcome(str(output), "written", written.size, said))
    return report


def _groups(file: File, by: str, rest: str | None) -> dict[str, list[str]]:
    """The names of the clips for each file."""
    get = _folder if by == FOLDER else getter_of(by, file.clips.values())
    groups: dict[str, list[str]] = {}
    without = []
    for clip in file:
        value = get(clip)
        if value is None or value == "":
            without.append(clip.name)
        else:
            groups.setdefault(_text(value), []).append(clip.name)
    kept = used_by(file, file.clips)
    others = [key for key in file.container.directory.shared if key not in kept]
    if rest is not None:
        groups.setdefault(rest, []).extend(without)
    elif without or file.attachments or others:
        left = [(len(without), "clip"), (len(file.attachments), "attachment")]
        left.append((sum(kind == ChunkType.SKEL for kind, _ in others), "skeleton"))
        said = ", ".join(counted(n, word) for n, word in left if n)
        if said:
            raise OptionError(f"{said} without {by}; name a file for the rest", path=file.name)
    return groups


def _folder(clip: Clip) -> Value:
    return clip.name.partition("/")[0] if "/" in clip.name else None


def _text(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _check_outputs(outputs: Iterable[Path], force: bool) -> None:
    for path in outputs:
        if not force and os.path.lexists(path):
            raise ExistsError("it exists", path=path, hint=Hint.FORCE)


def _part(file: File, names: Sequence[str], *, with_rest: bool) -> Plan:
    """What goes into the file of these clips; ``with_rest``: and all that is no clip's."""
    needed = used_by(file, names)
    if with_rest:
        needed |= set(file.container.directory.shared) - used_by(file, file.clips)
    plan = Plan(dict.fromkeys(names, SAME))
    plan.attachments = {name: name for name in file.attachments if with_rest}
    plan.shared = [key for key in file.container.directory.shared if key in needed]
    for alias, (of, target) in file.aliases.items():
        name = target.decode("utf-8", "replace")
        of_clip = of == payloads.OF_CLIP and name in plan.clips
        of_attachment = of == payloads.OF_ATTACHMENT and name in plan.attachments
        if (
            of_clip
            or of_attachment
            or (of == payloads.OF_SKELETON and (ChunkType.SKEL, target) in needed)
        ):
            plan.aliases[alias] = alias
    return plan


def _finish(
    report: Report,
    target: Target,
    output: Target | None,
    force: bool,
    file: File,
    plan: Plan,
    progress: Progress | None,
) -> Report:
    """Write the new file; let the report say its size, and what may not be carried over."""
    step = steps(progress, len(plan.clips))
    written = rewrite(target, output, force, file, plan, step)
    report.size = written.size
    report.left_out += written.left_out
    return report
