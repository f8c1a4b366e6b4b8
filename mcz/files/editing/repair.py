"""``repair``: restore a damaged file, or write a valid file of its intact parts.

``recovering.py`` restores bytes from recovery data; its result counts only if it opens, and has
every part that the damaged file still has. Otherwise stored bytes are copied, never encoded again:
each run of frames that can still be decoded becomes a clip. SPEC.md, "Salvage" and "Cutting without
re-encoding", are normative.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import fields
from itertools import pairwise
from operator import eq
from pathlib import Path
from typing import BinaryIO

from mcz.container.chunks import CRC, END_MAGIC, FOOT, SIGNATURE, Chunk, ChunkType, parse_foot
from mcz.container.reader import Container
from mcz.container.scan import scan
from mcz.container.source import ByteSource
from mcz.errors import FormatError, MczError, OptionError, error_context, remark_of
from mcz.files.editing.cutting import ClipCut, plan_cut
from mcz.files.editing.extraction import Copying
from mcz.files.editing.recovering import recover
from mcz.files.editing.rewriting import UNPROTECTED
from mcz.files.editing.salvage_copier import (
    FULL,
    NO_PART,
    Repairer,
    Run,
    SomeSignals,
    WholeRun,
    about_clip,
    stated_frames,
)
from mcz.files.editing.salvage_copier import Repair as Repair
from mcz.files.reading.clip import Clip
from mcz.files.reading.faults import Problem, clip_problems, validate
from mcz.files.reading.file import File, file_of, open_bytes
from mcz.files.reading.signal_reader import SignalReader
from mcz.files.writing.atomic import replacing, rereadable
from mcz.model.checks import check_arguments
from mcz.model.types import Progress, Target

Content = set[tuple[object, ...]]


@check_arguments()
def repair(
    source: Target,
    target: Target,
    *,
    force: bool = False,
    max_decoded: int | None = None,
    progress: Progress | None = None,
) -> Repair:
    """Write a valid MCZ file of the intact parts of the damaged file ``source`` to ``target``.

    Intact clips, skeletons and attachments are copied unchanged. Runs of frames of other clips that
    can be decoded become clips ``NAME.A-B``, with sources of these frames, or keep the name if no
    frame is lost. The new file is read again, strictly, before it gets its name. Raises FormatError
    if nothing is intact.

    A file with recovery data (``mcz.protect``) is first restored byte for byte: the above applies
    only if more of it is bad than they can restore, and to bytes appended after it.
    """
    with closing(open_bytes(source)) as data, error_context(path=data.name):
        _refuse_same(data, target)
        with replacing(target, force=force, inputs=(source,)) as stream, rereadable(stream) as own:
            return _repair_to(data, own, max_decoded, progress)


def _refuse_same(source: ByteSource, target: Target) -> None:
    if isinstance(source.target, str) and isinstance(target, (str, os.PathLike)):
        with suppress(OSError):
            if Path(source.target).samefile(target):
                raise OptionError(
                    "the output is the damaged file itself; name another output", path=source.name
                )


def _repair_to(
    source: ByteSource, out: BinaryIO, max_decoded: int | None, progress: Progress | None
) -> Repair:
    outcome = Repair()
    outcome.recovery, stop = recover(source, out, progress)
    if outcome.recovery is not None:
        outcome.damage += outcome.recovery.lines()
    required = _content(source) if stop else Content()
    if stop and outcome.recovery is not None and outcome.recovery.possible:
        size = _size_of_whole(out, stop, required, outcome)
        if size:
            out.truncate(size)
            return _as_it_was(out, outcome, max_decoded)
    with tempfile.TemporaryFile() as spool:
        better = _move_to(out, spool, source.name) if stop else source
        if not required <= _content(better):  # it belongs to another file
            better = source
        file = file_of(Container(better, salvage=True, max_decoded=max_decoded))
        return write_whole(file, out, outcome, progress)


def _size_of_whole(out: BinaryIO, stop: int, required: Content, outcome: Repair) -> int:
    """The number of bytes in ``out`` that are a valid file with everything in ``required``.

    Bytes after ``stop``, the end of the protected part, count if they belong to it. Zero if there
    is no such file.
    """
    size = out.seek(0, os.SEEK_END)
    for end in dict.fromkeys((size, stop)):
        whole = ByteSource(out, size=end)
        try:
            Container(whole)
            scan(whole, whole=True)
        except FormatError:
            continue
        if not (required | _content(ByteSource(out, size=size))) <= _content(whole):
            return 0
        if end < size:
            outcome.damage.append(f"{size - end:,} bytes after its end do not belong to the file")
        return end
    return 0


def _content(source: ByteSource) -> Content:
    """The intact content of a file, so that two files can be compared."""
    try:
        container = Container(source, salvage=True)
    except MczError:
        return set()
    directory = container.directory

    def mark(chunk: Chunk) -> bytes:
        return container.source.read(chunk.offset + chunk.size - CRC.size, CRC.size)

    content: Content = {("skeleton", id_) for id_ in directory.ids(ChunkType.SKEL)}
    content |= {("alias", name, *alias) for name, alias in directory.aliases.items()}
    for name, row in directory.clips.items():
        content.add(("clip", name, mark(row.clip)))
        if row.cend is not None:
            content.add(("end", name, mark(row.cend)))
    for name, attachment in directory.attachments.items():
        content |= {("attachment", name, mark(part)) for part in attachment.parts}
    return content


def _move_to(out: BinaryIO, spool: BinaryIO, name: str) -> ByteSource:
    out.seek(0)
    shutil.copyfileobj(out, spool)
    spool.flush()
    out.seek(0)
    out.truncate()
    return ByteSource(spool, name=name)


def _as_it_was(out: BinaryIO, outcome: Repair, max_decoded: int | None) -> Repair:
    file = File(Container(ByteSource(out), max_decoded=max_decoded))
    outcome.damage += [f"{problem.heading}: {problem.message}" for problem in validate(file)]
    outcome.clips, outcome.attachments = list(file.clips), list(file.attachments)
    outcome.size, outcome.restored = file.size, True
    out.seek(0, os.SEEK_END)
    return outcome


# Chunks without content of their own, or of a clip that is named.
REPORTED = (
    ChunkType.HEAD,
    ChunkType.INDX,
    ChunkType.DATA,
    ChunkType.CEND,
    ChunkType.COPY,
    ChunkType.RECV,
)


def write_whole(file: File, stream: BinaryIO, outcome: Repair, progress: Progress | None) -> Repair:
    """Write the intact parts of ``file``, opened for salvage, to ``stream``, and read it again.

    Parts with right checksums that break a rule are left out: first the ancillary chunks of a clip,
    then its source, then the clip. Raises FormatError if nothing is intact.
    """
    damage, degrees = [*outcome.damage, *file.damage], dict[str, int]()
    while True:
        attempt = Repair(damage=list(damage), recovery=outcome.recovery)
        repairer = Repairer(Copying(file, stream, progress), attempt, degrees)
        cuts = list(_plan_cuts(file, attempt))
        attempt.lost += _lost_parts(file.container)
        repairer.run(cuts, alone=False)
        attempt.size = repairer.writer.offset
        for text in repairer.left_out:
            (attempt.damage if text == UNPROTECTED else attempt.lost).append(f"left out: {text}")
        if not (attempt.clips or attempt.runs or attempt.attachments or attempt.skeletons):
            raise FormatError("no clip, skeleton or attachment is intact", path=file.name)
        problems = _check_output(stream, attempt.size, file.container.max_decoded)
        if not problems:
            return attempt
        for name in {_clip_at(repairer, problem.offset) for problem in problems}:
            if not name or degrees.get(name, FULL) == NO_PART:
                raise FormatError(f"the repaired file is invalid: {problems[0].message}")
            degrees[name] = degrees.get(name, FULL) + 1
        stream.seek(0)
        stream.truncate()


def _clip_at(repairer: Repairer, offset: int) -> str:
    """The clip of the new file at ``offset``; "" if there is none."""
    rows = repairer.writer.directory.clips
    return next((name for name in reversed(rows) if rows[name].clip.offset <= offset), "")


def _lost_parts(container: Container) -> Iterator[str]:
    last = max(container.feet, default=0)
    feet = (parse_foot(container.source.read(at, FOOT.size), at) for at in container.feet)
    indices = {foot.index_offset for foot in feet if foot}
    names = _indexed_names(container)
    for at, chunk in container.broken:
        if chunk is None and at < last and at not in indices and not _is_foot(container, at):
            name = names.get(at, f"what began at byte {at}")
            if name:
                yield name
        elif chunk is not None and chunk.type not in REPORTED:
            yield names.get(at, f"chunk {chunk.label}")


def _is_foot(container: Container, at: int) -> bool:
    """Return whether a FOOT was there: most letters of its end magic are."""
    end = container.source.read(at, min(FOOT.size, container.source.size - at))[-len(END_MAGIC) :]
    return bool(sum(map(eq, end, END_MAGIC)) > len(END_MAGIC) // 2)


def _indexed_names(container: Container) -> dict[int, str]:
    """Names of the parts at each offset in a valid index; "" for a part that is not lost."""
    names: dict[int, str] = {}
    with suppress(FormatError):
        directory = Container(container.source).directory
        for (kind, id_), chunk in directory.shared.items():
            names[chunk.offset] = f"{kind.decode()} {id_.hex()}"
        for name, clip in directory.clips.items():
            names[clip.clip.offset] = f"clip {name!r}: all of it"
            inside = [row.chunk() for row in clip.segments if not row.packet]
            names |= {one.offset: "" for one in (*inside, clip.cend) if one is not None}
            for one in clip.ancillary:
                text = f"clip {name!r}: its {one.type.decode()}"
                names[one.offset] = "" if one.type in REPORTED else text
        for name, row in directory.attachments.items():
            names |= {part.offset: f"attachment {name!r}" for part in row.parts}
    return names | {len(SIGNATURE): ""}  # HEAD


def _check_output(stream: BinaryIO, size: int, max_decoded: int) -> list[Problem]:
    stream.flush()
    source = ByteSource(stream, name="the repaired file", size=size)
    try:
        file = File(Container(source, max_decoded=max_decoded))
        return _real_problems(validate(file))
    except FormatError as error:
        return [Problem(error.offset or 0, "structure", remark_of(error))]
    finally:
        stream.seek(size)


def _plan_cuts(file: File, outcome: Repair) -> Iterator[ClipCut]:
    sound = File(file.container.strictly())
    for name, clip in file.clips.items():
        problems = clip_problems(sound.clips[name])
        # Parts for an unknown codec are intact, though not readable here.
        if not _real_problems(problems) and not (
            problems := problems and _end_problems(sound.clips[name])
        ):
            yield plan_cut(sound.clips[name], None, None, 0)
            continue
        runs = list(_plan_runs(clip))
        yield from runs
        outcome.lost += _list_losses(clip, runs, problems)


def _real_problems(problems: list[Problem]) -> list[Problem]:
    return [problem for problem in problems if problem.heading != "Codecs"]


def _end_problems(clip: Clip) -> list[Problem]:
    """Problems of the end of a clip that cannot be decoded; only it has the hashes."""
    try:
        _ = clip.value_hashes, clip.source
    except MczError as error:
        codec = (
            f"codec {clip.signals[0].codec_id}" if clip.codec.startswith("codec") else clip.codec
        )
        text = f"{error}, and {codec} cannot be decoded here"
        return [Problem(0, "CEND", text)]
    return []


def _plan_runs(clip: Clip) -> Iterator[WholeRun]:
    """A cut for each run of frames and the signals that can be decoded in it."""
    with suppress(MczError):  # parts that cannot be planned are reported as lost
        parts = whole_parts(clip)
        if not parts and stated_frames(clip) == clip.n_frames == 0:
            parts = [((0, 0), tuple(range(len(clip.signals))))]  # no frame of it can be lost
        for run, signals in parts:
            one = clip if len(signals) == len(clip.signals) else SomeSignals(clip, signals)
            cut = plan_cut(one, run, None, 0)
            yield WholeRun(*(getattr(cut, one.name) for one in fields(ClipCut)))


def _list_losses(clip: Clip, runs: list[WholeRun], problems: list[Problem]) -> Iterator[str]:
    counts = stated_frames(clip)
    if not runs:
        yield f"clip {clip.name!r}: {counts:,} of {counts:,} frames: {problems[0].message}"
        return
    names = [info.name for info in clip.signals]
    missing = dict.fromkeys(names, counts)
    for run in runs:
        for info in run.clip.signals:
            missing[info.name] -= run.n_frames
    if all(len(run.clip.signals) == len(names) for run in runs):
        missing = {"": missing[names[0]]}
    for name, number in missing.items():
        if number:
            signal = f", signal {name!r}" if name else ""
            yield f"clip {clip.name!r}{signal}: {number:,} of {counts:,} frames"
    if any(missing.values()):
        return
    if clip.container.directory.clips[clip.name].cend is None:
        yield f"clip {clip.name!r}: the hashes of its values, which are intact"
        return
    source = _source_error(clip)
    yield from (about_clip(clip.name, one) for one in problems[:1] if one.message != source)


def _source_error(clip: Clip) -> str:
    """Reason why a source cannot be restored, if its template is to blame; else ""."""
    row = clip.container.directory.clips[clip.name]
    try:
        source = clip.container.clip(row).source
        if source is not None:
            clip.container.template(source.template, source.format)
    except MczError as error:
        return remark_of(error)
    return ""


def whole_parts(clip: Clip) -> list[tuple[Run, tuple[int, ...]]]:
    """Runs of frames of a clip opened for salvage, and the signals that can be decoded in each."""
    runs: list[list[Run]] = []
    for info in clip.signals:
        reader = SignalReader(clip.container, info, None, 0, clip.name)
        try:
            whole = reader.whole_runs(info.skip, info.skip + clip.n_frames)
        except MczError:  # its header, or a codec that is unknown here
            whole = []
        runs.append([(start - info.skip, stop - info.skip) for start, stop in whole])
    edges = sorted({edge for signal_runs in runs for run in signal_runs for edge in run})
    parts: list[tuple[Run, tuple[int, ...]]] = []
    for start, stop in pairwise(edges):
        signals = tuple(
            index
            for index, signal_runs in enumerate(runs)
            if any(first <= start and stop <= last for first, last in signal_runs)
        )
        if parts and parts[-1][1] == signals and parts[-1][0][1] == start:
            parts[-1] = (parts[-1][0][0], stop), signals
        elif signals:
            parts.append(((start, stop), signals))
    return parts
