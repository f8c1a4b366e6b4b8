"""``repair``: a sound file of all that is whole in a damaged one.

Stored bytes are copied, never coded anew. Of a clip that has lost frames, each run of frames that
can still be decoded becomes a clip of its own. Nothing is made up: what is lost stays lost.
SPEC.md, "Salvage" and "Cutting without re-encoding", are normative.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO

from mcz.container import payloads
from mcz.container.chunks import COPY, FOOT, parse_foot
from mcz.container.directory import ClipRow
from mcz.container.packed import parse_skel
from mcz.container.reader import Container
from mcz.container.source import ByteSource
from mcz.container.writer import payload_id
from mcz.editing.cutting import ClipCut, add_note, plan_cut
from mcz.editing.extraction import Copier
from mcz.editing.recovering import Recovery, recover
from mcz.errors import FormatError, MczError, OptionError
from mcz.reading.clip import Clip
from mcz.reading.file import File, open, reached
from mcz.reading.report import Problem, clip_problems, validate
from mcz.reading.signal_reader import SignalReader
from mcz.schema import build
from mcz.writing.atomic import replacing
from mcz.writing.clip_writer import Progress

Run = tuple[int, int]  # frames a <= f < b
# Chunks without content of their own, or of a clip that is named.
TOLD = (b"HEAD", b"INDX", b"DATA", b"CEND", COPY)
NOTE = "lost: the template of the source file was damaged"


@dataclass(slots=True)
class Repair:
    """What ``repair`` wrote: names of what is whole, runs of frames of other clips, what is lost.

    ``damage`` is what was found wrong with the file, ``lost`` what of its content is gone.
    ``recovery``: what its recovery data found, where it has some; ``restored``: these have given
    every byte back, so that nothing is lost.
    """

    clips: list[str] = field(default_factory=list)
    attachments: list[str] = field(default_factory=list)
    runs: dict[str, list[Run]] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)
    size: int = 0
    recovery: Recovery | None = None
    restored: bool = False


def repair(
    source: Any,
    target: Any,
    *,
    force: bool = False,
    max_decoded: int | None = None,
    progress: Progress | None = None,
) -> Repair:
    """Write a sound MCZ file of all that is whole in the damaged file ``source`` to ``target``.

    Whole clips and attachments are copied as they are. Of another clip the runs of frames that can
    be decoded are clips called ``NAME.A-B``, with sources of these frames. What was written is
    read again, strictly, before it gets its name. Raises FormatError where nothing is whole.

    A file with recovery data (``mcz.protect``) is first made what it was, byte for byte: what is
    above happens only where more of it is bad than they can restore.
    """
    found = Repair()
    if _recovered(source, target, force, found, progress):
        return found
    with open(source, salvage=True, max_decoded=max_decoded) as file:
        _refuse_same(file, target)
        found.damage += file.damage
        cuts = list(_cuts(file, found))
        found.lost += _gone(file.container)
        with replacing(target, force=force) as stream:
            writer = _Repairer(file, stream, progress, found)
            writer.run(cuts, alone=False)
            found.size = writer.found.size
            if not (found.clips or found.runs or found.attachments):
                raise FormatError(f"{file.name}: no clip and no attachment in it is whole")
            _check(stream, found.size, max_decoded)
    return found


def _recovered(
    source: Any, target: Any, force: bool, found: Repair, progress: Progress | None
) -> bool:
    """Whether recovery data have given the file back to ``target``."""
    data = reached(source)
    try:
        found.recovery = recover(data, source, target, force, progress)
        if found.recovery is None:
            return False
        found.damage += found.recovery.told()
        if not found.recovery.possible:
            return False
    finally:
        data.close()
    with open(target) as file:
        found.clips, found.attachments = list(file.clips), list(file.attachments)
        found.size, found.restored = file.size, True
    return True


def _refuse_same(file: File, target: Any) -> None:
    path = file.container.source.target
    if isinstance(path, str) and isinstance(target, (str, os.PathLike)):
        with suppress(OSError):
            if Path(path).samefile(target):
                raise OptionError(f"{file.name}: the damaged file is not overwritten; name another")


def _gone(container: Container) -> Iterator[str]:
    """What lay where nothing can be read, by the name that an index has for it."""
    last = max(container.feet, default=0)
    indices = {_index_offset(container, foot) for foot in container.feet}
    names = _names(container)
    for at, chunk in container.broken:
        if chunk is None and at < last and at not in indices:
            name = names.get(at, f"what began at byte {at}")
            if name:
                yield name
        elif chunk is not None and chunk.type not in TOLD:
            yield names.get(at, f"chunk {chunk.label}")


def _index_offset(container: Container, foot: int) -> int:
    found = parse_foot(container.source.read(foot, FOOT.size), foot)
    return found.index_offset if found else 0


def _names(container: Container) -> dict[int, str]:
    """What the index, if it is sound, says that begins at each offset; "" where that is no loss."""
    names: dict[int, str] = {}
    with suppress(FormatError):
        listed = Container(container.source).directory
        for name, clip in listed.clips.items():
            names[clip.clip.offset] = f"clip {name!r}: all of it"
            for one in clip.ancillary:
                text = f"clip {name!r}: its {one.type.decode()}"
                names[one.offset] = "" if one.type == COPY else text
        for name, row in listed.attachments.items():
            names |= {part.offset: f"attachment {name!r}" for part in row.parts}
    return names


def _check(stream: BinaryIO, size: int, max_decoded: int | None) -> None:
    """Raise FormatError unless what was written to ``stream`` is a sound file."""
    if not (stream.seekable() and stream.readable()):
        return
    stream.flush()
    source = ByteSource(stream, name="the repaired file", size=size)
    file = File(Container(source, max_decoded=max_decoded))
    problems = [problem for problem in validate(file) if problem.heading != "Codecs"]
    stream.seek(size)
    if problems:
        raise FormatError(f"the repaired file is not sound: {problems[0].message}")


def _cuts(file: File, found: Repair) -> Iterator[ClipCut]:
    """What is left of each clip."""
    sound = File(file.container.strictly())
    for name, clip in file.clips.items():
        problems = clip_problems(sound, sound.clips[name])
        if all(problem.heading == "Codecs" for problem in problems):  # whole, if not for us
            found.clips.append(name)
            yield plan_cut(sound.clips[name], None, None, 0)
            continue
        runs = list(_planned(clip))
        yield from runs
        if runs:
            found.runs[name] = [(run.start, run.stop) for run in runs]
        found.lost.append(_lost(clip, found.runs.get(name, []), problems))


def _planned(clip: Clip) -> Iterator[_Run]:
    """A cut for each run of frames that can be decoded."""
    with suppress(MczError):  # what cannot be planned is lost, as is told
        for start, stop in whole_runs(clip):
            cut = plan_cut(clip, (start, stop), None, 0)
            yield _Run(*(getattr(cut, one.name) for one in fields(ClipCut)))


def _lost(clip: Clip, runs: list[Run], problems: list[Problem]) -> str:
    kept, stated = sum(stop - start for start, stop in runs), clip.n_frames
    with suppress(MczError):  # of a clip that was cut short CLIP says it
        stated = max(
            stated, clip.container.clip(clip.container.directory.clips[clip.name]).n_frames
        )
    if kept == stated:
        return f"clip {clip.name!r}: {problems[0].message}"
    return f"clip {clip.name!r}: {stated - kept:,} of {stated:,} frames"


def whole_runs(clip: Clip) -> list[Run]:
    """The runs of frames of which every signal can be decoded, in a file opened for salvage."""
    runs = [(0, clip.n_frames)] if clip.n_frames else []
    for info in clip.signals:
        groups = tuple(range(info.counts.n_groups))
        reader = SignalReader(clip.container, info, groups, 0, clip.name)
        whole = reader.whole_runs(info.skip, info.skip + clip.n_frames)
        runs = _both(runs, [(start - info.skip, stop - info.skip) for start, stop in whole])
    return runs


def _both(some: list[Run], others: list[Run]) -> list[Run]:
    """The runs that lie in both lists, in order."""
    met = [(max(a, c), min(b, d)) for a, b in some for c, d in others]
    return sorted((start, stop) for start, stop in met if start < stop)


class _Run(ClipCut):
    """A run of frames of a damaged clip: hashes and source are made anew, whatever its length."""

    __slots__ = ()

    @property
    def is_whole(self) -> bool:
        return False

    @property
    def name(self) -> str:
        return f"{self.clip.name}.{self.start}-{self.stop}"


class _Repairer(Copier):
    """Copies what is whole, and of everything else says that it is lost."""

    def __init__(
        self, file: File, stream: BinaryIO, progress: Progress | None, found: Repair
    ) -> None:
        super().__init__(file, stream, progress)
        self.repair = found
        self._skeletons: dict[bytes, bytes] = {}  # the payload that stands for each id

    def name_of(self, cut: ClipCut) -> str:
        name = cut.name if isinstance(cut, _Run) else cut.clip.name
        while isinstance(cut, _Run) and name in self.file.clips.rows:
            name += "+"
        return name

    def skeletons(self) -> None:
        for kind, id_ in self.container.directory.shared:
            if kind == b"SKEL":
                self.skeleton(id_)

    def attachments(self) -> None:
        for name, held in self.file.attachments.items():
            try:
                held.read()
            except MczError as error:
                self.repair.lost.append(f"attachment {name!r}: {error}")
                continue
            self.attachment(name)
            self.repair.attachments.append(name)

    def before_clips(self) -> None:
        with suppress(FormatError):  # what is damaged there has been told
            super().before_clips()

    def inside(self, row: ClipRow) -> None:
        with suppress(FormatError):
            if row.cend is not None:
                super().inside(row)

    def skeleton(self, id_: bytes) -> bytes:
        """Without its source or its base, and so under another id, where these are lost."""
        if id_ not in self._skeletons:
            try:
                self._skeletons[id_] = super().skeleton(id_)
            except FormatError as error:
                self._skeletons[id_] = self._poorer_skeleton(id_)
                self.repair.lost.append(f"skeleton {id_.hex()}: its source or base: {error}")
        return self._skeletons[id_]

    def _poorer_skeleton(self, id_: bytes) -> bytes:
        stored, where = self.carrier.stored(b"SKEL", id_), f"SKEL {id_.hex()}"
        fields = dict(parse_skel(stored, where, self.container.profile))
        bases = []
        for base in fields["base"]:
            with suppress(FormatError):
                bases.append(payload_id(self.skeleton(bytes(base))))
        payload = build(payloads.SKEL, fields | {"base": bases, "source": []}, "skeleton")
        self.writer.shared(b"SKEL", payload)
        return payload

    def aliases(self, cuts: Mapping[str, ClipCut], alone: bool) -> None:
        for name, (of, target) in self.file.aliases.items():
            if self._restores(of, target):
                self.writer.alias(name, of, target)
            else:
                self.repair.lost.append(f"{name!r}, another name of what is lost")

    def _restores(self, of: int, target: bytes) -> bool:
        """Whether the file that is written gives what an alias stands for."""
        if of == payloads.OF_SKELETON:
            return (b"SKEL", target) in self.writer.directory.shared
        here = self.repair.clips if of == payloads.OF_CLIP else self.repair.attachments
        return target.decode("utf-8", "replace") in here

    def finish_fields(self, cut: ClipCut, new: dict[str, Any]) -> tuple[bytes, list[bytes]]:
        try:
            found = super().finish_fields(cut, new)
        except FormatError as error:
            if not new["source"]:
                raise
            new["source"] = []
            add_note(new["metadata"], "source-note", NOTE)
            self.repair.lost.append(f"clip {cut.clip.name!r}: its source file: {error}")
            found = super().finish_fields(cut, new)
        if isinstance(cut, _Run) and new["source"] and new["source"][0]["path"]:
            path = PurePosixPath(new["source"][0]["path"])
            named = path.with_name(f"{path.stem}.{cut.start}-{cut.stop}{path.suffix}")
            new["source"] = [new["source"][0] | {"path": str(named)}]
        return found
