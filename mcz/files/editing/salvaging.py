"""A sound file of all that is whole in a damaged one.

Stored bytes are copied, never coded anew. Of a clip that has lost frames, each run of frames that
can still be decoded becomes a clip of its own. Nothing is made up: what is lost stays lost.
SPEC.md, "Salvage" and "Cutting without re-encoding", are normative.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import fields
from itertools import pairwise
from operator import eq
from typing import BinaryIO

from mcz.container.chunks import END_MAGIC, FOOT, SIGNATURE, ChunkType, parse_foot
from mcz.container.reader import Container
from mcz.container.source import ByteSource
from mcz.errors import FormatError, MczError, remark_of
from mcz.files.editing.chunk_copier import UNPROTECTED
from mcz.files.editing.cutting import ClipCut, plan_cut
from mcz.files.editing.extraction import Copying
from mcz.files.editing.salvage_copier import (
    FULL,
    NOTHING,
    Repair,
    Repairer,
    Run,
    SomeSignals,
    WholeRun,
    about_clip,
    stated_frames,
)
from mcz.files.reading.clip import Clip
from mcz.files.reading.faults import Problem, clip_problems, validate
from mcz.files.reading.file import File
from mcz.files.reading.signal_reader import SignalReader
from mcz.model.types import Progress

# Chunks without content of their own, or of a clip that is named.
TOLD = (
    ChunkType.HEAD,
    ChunkType.INDX,
    ChunkType.DATA,
    ChunkType.CEND,
    ChunkType.COPY,
    ChunkType.RECV,
)


def write_whole(file: File, stream: BinaryIO, found: Repair, progress: Progress | None) -> Repair:
    """Write all that is whole in ``file``, opened for salvage, to ``stream``, and read it again.

    What breaks a rule there, though its checksums are right, is left out: of a clip first what
    belongs to it, then its source, then the clip. Raises FormatError where nothing is whole.
    """
    damage, degrees = [*found.damage, *file.damage], dict[str, int]()
    while True:
        attempt = Repair(damage=list(damage), recovery=found.recovery)
        repairer = Repairer(Copying(file, stream, progress), attempt, degrees)
        cuts = list(_cuts(file, attempt))
        attempt.lost += _gone(file.container)
        repairer.run(cuts, alone=False)
        attempt.size = repairer.writer.offset
        for text in repairer.left_out:
            (attempt.damage if text == UNPROTECTED else attempt.lost).append(f"left out: {text}")
        if not (attempt.clips or attempt.runs or attempt.attachments or attempt.skeletons):
            raise FormatError("no clip, skeleton or attachment in it is whole", path=file.name)
        problems = _problems(stream, attempt.size, file.container.max_decoded)
        if not problems:
            return attempt
        for name in {_clip_at(repairer, problem.offset) for problem in problems}:
            if not name or degrees.get(name, FULL) == NOTHING:
                raise FormatError(f"the repaired file is not sound: {problems[0].message}")
            degrees[name] = degrees.get(name, FULL) + 1
        stream.seek(0)
        stream.truncate()


def _clip_at(repairer: Repairer, offset: int) -> str:
    """The clip of the new file that lies at ``offset``; "" where none does."""
    rows = repairer.writer.directory.clips
    return next((name for name in reversed(rows) if rows[name].clip.offset <= offset), "")


def _gone(container: Container) -> Iterator[str]:
    """Lost things, by the names that an index has for them."""
    last = max(container.feet, default=0)
    indices = {_index_offset(container, foot) for foot in container.feet}
    names = _names(container)
    for at, chunk in container.broken:
        if chunk is None and at < last and at not in indices and not _is_foot(container, at):
            name = names.get(at, f"what began at byte {at}")
            if name:
                yield name
        elif chunk is not None and chunk.type not in TOLD:
            yield names.get(at, f"chunk {chunk.label}")


def _index_offset(container: Container, foot: int) -> int:
    found = parse_foot(container.source.read(foot, FOOT.size), foot)
    return found.index_offset if found else 0


def _is_foot(container: Container, at: int) -> bool:
    """Return whether a FOOT lay there: most of the letters that end one do."""
    end = container.source.read(at, min(FOOT.size, container.source.size - at))[-len(END_MAGIC) :]
    return bool(sum(map(eq, end, END_MAGIC)) > len(END_MAGIC) // 2)


def _names(container: Container) -> dict[int, str]:
    """The names, in a sound index, of the things at each offset; "" where that is no loss."""
    names: dict[int, str] = {}
    with suppress(FormatError):
        listed = Container(container.source).directory
        for (kind, id_), chunk in listed.shared.items():
            names[chunk.offset] = f"{kind.decode()} {id_.hex()}"
        for name, clip in listed.clips.items():
            names[clip.clip.offset] = f"clip {name!r}: all of it"
            inside = [row.chunk() for row in clip.segments if not row.packet]
            names |= {one.offset: "" for one in (*inside, clip.cend) if one is not None}
            for one in clip.ancillary:
                text = f"clip {name!r}: its {one.type.decode()}"
                names[one.offset] = "" if one.type in TOLD else text
        for name, row in listed.attachments.items():
            names |= {part.offset: f"attachment {name!r}" for part in row.parts}
    return names | {len(SIGNATURE): ""}  # HEAD


def _problems(stream: BinaryIO, size: int, max_decoded: int) -> list[Problem]:
    """Problems of the file that was written to ``stream``, read strictly."""
    stream.flush()
    source = ByteSource(stream, name="the repaired file", size=size)
    try:
        file = File(Container(source, max_decoded=max_decoded))
        return _faults(validate(file))
    except FormatError as error:
        return [Problem(error.offset or 0, "structure", remark_of(error))]
    finally:
        stream.seek(size)


def _cuts(file: File, found: Repair) -> Iterator[ClipCut]:
    """The cuts that are left of each clip."""
    sound = File(file.container.strictly())
    for name, clip in file.clips.items():
        problems = clip_problems(sound, sound.clips[name])
        # What only an unknown codec can decode is whole, if not for us.
        if not _faults(problems) and not (problems := problems and _unhashed(sound.clips[name])):
            yield plan_cut(sound.clips[name], None, None, 0)
            continue
        runs = list(_planned(clip))
        yield from runs
        found.lost += _lost(clip, runs, problems)


def _faults(problems: list[Problem]) -> list[Problem]:
    """Drop problems of this reader, which lacks a codec."""
    return [problem for problem in problems if problem.heading != "Codecs"]


def _unhashed(clip: Clip) -> list[Problem]:
    """Problems of the end of a clip that cannot be decoded; nothing else has its hashes."""
    try:
        _ = clip.value_hashes, clip.source
    except MczError as error:
        codec = (
            f"codec {clip.signals[0].codec_id}" if clip.codec.startswith("codec") else clip.codec
        )
        text = f"{error}, and {codec} cannot be decoded here"
        return [Problem(0, "CEND", text)]
    return []


def _planned(clip: Clip) -> Iterator[WholeRun]:
    """A cut for each run of frames and the signals that can be decoded in it."""
    with suppress(MczError):  # what cannot be planned is lost, as is told
        parts = whole_parts(clip)
        if not parts and stated_frames(clip) == clip.n_frames == 0:
            parts = [((0, 0), tuple(range(len(clip.signals))))]  # nothing can have been lost of it
        for run, kept in parts:
            one = clip if len(kept) == len(clip.signals) else SomeSignals(clip, kept)
            cut = plan_cut(one, run, None, 0)
            yield WholeRun(*(getattr(cut, one.name) for one in fields(ClipCut)))


def _lost(clip: Clip, runs: list[WholeRun], problems: list[Problem]) -> Iterator[str]:
    """Losses of a clip, its source apart."""
    stated = stated_frames(clip)
    if not runs:
        yield f"clip {clip.name!r}: {stated:,} of {stated:,} frames: {problems[0].message}"
        return
    names = [info.name for info in clip.signals]
    missing = dict.fromkeys(names, stated)
    for run in runs:
        for info in run.clip.signals:
            missing[info.name] -= run.n_frames
    if all(len(run.clip.signals) == len(names) for run in runs):
        missing = {"": missing[names[0]]}
    for name, number in missing.items():
        if number:
            signal = f", signal {name!r}" if name else ""
            yield f"clip {clip.name!r}{signal}: {number:,} of {stated:,} frames"
    if any(missing.values()):
        return
    if clip.container.directory.clips[clip.name].cend is None:
        yield f"clip {clip.name!r}: the hashes of its values, which are whole"
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
        groups = tuple(range(info.counts.n_groups))
        reader = SignalReader(clip.container, info, groups, 0, clip.name)
        try:
            whole = reader.whole_runs(info.skip, info.skip + clip.n_frames)
        except MczError:  # its header, or a codec that is unknown here
            whole = []
        runs.append([(start - info.skip, stop - info.skip) for start, stop in whole])
    edges = sorted({edge for found in runs for run in found for edge in run})
    parts: list[tuple[Run, tuple[int, ...]]] = []
    for start, stop in pairwise(edges):
        kept = tuple(
            index
            for index, found in enumerate(runs)
            if any(first <= start and stop <= last for first, last in found)
        )
        if parts and parts[-1][1] == kept and parts[-1][0][1] == start:
            parts[-1] = (parts[-1][0][0], stop), kept
        elif kept:
            parts.append(((start, stop), kept))
    return parts
