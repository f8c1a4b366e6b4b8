"""A sound file of all that is whole in a damaged one.

Stored bytes are copied, never coded anew. Of a clip that has lost frames, each run of frames that
can still be decoded becomes a clip of its own. Nothing is made up: what is lost stays lost.
SPEC.md, "Salvage" and "Cutting without re-encoding", are normative.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from operator import eq
from pathlib import PurePosixPath
from typing import Any, BinaryIO

from mcz.container import payloads
from mcz.container.chunks import COPY, END_MAGIC, FOOT, RECOVERY, SIGNATURE, parse_foot
from mcz.container.directory import ClipRow
from mcz.container.packed import parse_skel
from mcz.container.reader import Container
from mcz.container.source import ByteSource
from mcz.container.writer import payload_id
from mcz.editing.carrying import UNPROTECTED
from mcz.editing.cutting import ClipCut, add_note, plan_cut
from mcz.editing.extraction import Copier
from mcz.editing.recovering import Recovery
from mcz.errors import FormatError, MczError
from mcz.reading.clip import Clip
from mcz.reading.file import File
from mcz.reading.report import Problem, clip_problems, validate
from mcz.reading.signal_info import SignalInfo
from mcz.reading.signal_reader import SignalReader
from mcz.schema import Fields, build
from mcz.writing.clip_writer import Progress

Run = tuple[int, int]  # frames a <= f < b
# Chunks without content of their own, or of a clip that is named.
TOLD = (b"HEAD", b"INDX", b"DATA", b"CEND", COPY, RECOVERY)
NOTE = "lost: the template of the source file was damaged"
NOTE_OF_SIGNALS = "lost: other signals of the clip were damaged, and with them its source file"


@dataclass(slots=True)
class Repair:
    """What ``repair`` wrote: names of what is whole, runs of frames of other clips, what is lost.

    ``damage`` is what was found wrong with the file, ``lost`` what of its content is gone.
    ``recovery``: what its recovery data found, where it has some; ``restored``: these have given
    every byte back, so that nothing is lost.
    """

    clips: list[str] = field(default_factory=list)
    attachments: list[str] = field(default_factory=list)
    skeletons: list[str] = field(default_factory=list)
    runs: dict[str, list[Run]] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)
    size: int = 0
    recovery: Recovery | None = None
    restored: bool = False


def write_whole(file: File, stream: BinaryIO, found: Repair, progress: Progress | None) -> None:
    """Write all that is whole in ``file``, opened for salvage, to ``stream``, and read it again.

    Raises FormatError where nothing is whole.
    """
    found.damage += file.damage
    cuts = list(_cuts(file, found))
    found.lost += _gone(file.container)
    repairer = _Repairer(file, stream, progress, found)
    repairer.run(cuts, alone=False)
    found.size = repairer.found.size
    for text in repairer.found.left_out:
        (found.damage if text == UNPROTECTED else found.lost).append(f"left out: {text}")
    if not (found.clips or found.runs or found.attachments or found.skeletons):
        raise FormatError(f"{file.name}: no clip, skeleton or attachment in it is whole")
    _check(stream, found.size, file.container.max_decoded)


def _gone(container: Container) -> Iterator[str]:
    """What lay where nothing can be read, by the name that an index has for it."""
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
    """Whether a FOOT lay there: most of the letters that end one do."""
    end = container.source.read(at, min(FOOT.size, container.source.size - at))[-len(END_MAGIC) :]
    return bool(sum(map(eq, end, END_MAGIC)) > len(END_MAGIC) // 2)


def _names(container: Container) -> dict[int, str]:
    """What the index, if it is sound, says that begins at each offset; "" where that is no loss."""
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


def _check(stream: BinaryIO, size: int, max_decoded: int) -> None:
    """Raise FormatError unless what was written to ``stream`` is a sound file."""
    stream.flush()
    source = ByteSource(stream, name="the repaired file", size=size)
    file = File(Container(source, max_decoded=max_decoded))
    problems = _faults(validate(file))
    stream.seek(size)
    if problems:
        raise FormatError(f"the repaired file is not sound: {problems[0].message}")


def _cuts(file: File, found: Repair) -> Iterator[ClipCut]:
    """What is left of each clip."""
    sound = File(file.container.strictly())
    for name, clip in file.clips.items():
        problems = clip_problems(sound, sound.clips[name])
        # What only an unknown codec can decode is whole, if not for us.
        if not _faults(problems) and not (problems := problems and _unhashed(sound.clips[name])):
            found.clips.append(name)
            yield plan_cut(sound.clips[name], None, None, 0)
            continue
        runs = list(_planned(clip))
        yield from runs
        if runs:
            found.runs[name] = [(run.start, run.stop) for run in runs]
        found.lost += _lost(clip, runs, problems)


def _faults(problems: list[Problem]) -> list[Problem]:
    """Those that are not this reader's, which lacks a codec."""
    return [problem for problem in problems if problem.heading != "Codecs"]


def _unhashed(clip: Clip) -> list[Problem]:
    """What is wrong with the end of a clip that cannot be decoded; nothing else has its hashes."""
    try:
        _ = clip.value_hashes, clip.source
    except MczError as error:
        codec = (
            f"codec {clip.signals[0].codec_id}" if clip.codec.startswith("codec") else clip.codec
        )
        text = f"{error}, and {codec} cannot be decoded here"
        return [Problem(0, "CEND", text)]
    return []


def _planned(clip: Clip) -> Iterator[_Run]:
    """A cut for each run of frames and the signals that can be decoded in it."""
    with suppress(MczError):  # what cannot be planned is lost, as is told
        parts = whole_parts(clip)
        if not parts and _stated(clip) == clip.n_frames == 0:
            parts = [((0, 0), tuple(range(len(clip.signals))))]  # nothing can have been lost of it
        for run, kept in parts:
            one = clip if len(kept) == len(clip.signals) else _SomeSignals(clip, kept)
            cut = plan_cut(one, run, None, 0)
            yield _Run(*(getattr(cut, one.name) for one in fields(ClipCut)))


def _stated(clip: Clip) -> int:
    """How many frames a clip has had; of one that was cut short CLIP says it."""
    with suppress(MczError):
        row = clip.container.directory.clips[clip.name]
        return max(clip.n_frames, int(clip.container.clip(row).n_frames))
    return clip.n_frames


def _lost(clip: Clip, runs: list[_Run], problems: list[Problem]) -> Iterator[str]:
    """What a clip has lost, its source apart."""
    stated = _stated(clip)
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
    yield from (_about(clip.name, one.message) for one in problems[:1] if one.message != source)


def _source_error(clip: Clip) -> str:
    """Why the source of a clip cannot be put together, as far as its template is to blame."""
    row = clip.container.directory.clips[clip.name]
    try:
        for held in clip.container.clip(row).source:
            clip.container.template(bytes(held.template), held.format)
    except MczError as error:
        return str(error)
    return ""


def _about(name: str, text: str) -> str:
    """``text``, which may name the clip already."""
    start = f"clip {name!r}"
    return text if text.startswith(start) else f"{start}: {text}"


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


class _SomeSignals(Clip):
    """What is left of a clip of which some signals are lost, and with them its source."""

    def __init__(self, clip: Clip, kept: tuple[int, ...]) -> None:
        super().__init__(clip.container, clip.container.directory.clips[clip.name])
        self.whole, self.kept = clip, kept

    @property
    def signals(self) -> tuple[SignalInfo, ...]:
        own = (self.whole.signals[index] for index in self.kept)
        return tuple(replace(info, index=index) for index, info in enumerate(own))

    def is_scaled(self, signal: int) -> bool:
        return self.whole.is_scaled(self.kept[signal])


class _Run(ClipCut):
    """A run of frames of a damaged clip: hashes and source are made anew, whatever its length."""

    __slots__ = ()

    @property
    def is_whole(self) -> bool:
        return False

    @property
    def name(self) -> str:
        """That of the clip where all frames of its motion are there."""
        has_motion = not isinstance(self.clip, _SomeSignals) or 0 in self.clip.kept
        if has_motion and self.n_frames == _stated(self.clip):
            return self.clip.name
        of = "" if has_motion else f".{self.clip.signals[0].name}"
        return f"{self.clip.name}.{self.start}-{self.stop}{of}"


class _Repairer(Copier):
    """Copies what is whole, and of everything else says that it is lost."""

    def __init__(
        self, file: File, stream: BinaryIO, progress: Progress | None, found: Repair
    ) -> None:
        super().__init__(file, stream, progress)
        self.repair = found
        self._skeletons: dict[bytes, bytes] = {}  # the payload that stands for each id

    def name_of(self, cut: ClipCut) -> str:
        if not isinstance(cut, _Run):
            return cut.clip.name
        name = cut.name
        while name != cut.clip.name and name in self.file.clips.rows:
            name += "+"
        return name

    def fields_of(self, cut: ClipCut) -> Any:
        fields = super().fields_of(cut)
        if not isinstance(cut.clip, _SomeSignals):
            return fields
        signals = [fields.signals[index] for index in cut.clip.kept]
        return Fields(fields, signals=signals, source=[])

    def _quality(self, cut: ClipCut, row: ClipRow) -> None:
        """Figures are of the motion."""
        if not isinstance(cut.clip, _SomeSignals) or 0 in cut.clip.kept:
            super()._quality(cut, row)

    def skeletons(self) -> None:
        for kind, id_ in self.container.directory.shared:
            if kind == b"SKEL":
                with suppress(FormatError):  # what is wrong with it clips say, and is told
                    self.skeleton(id_)
                    self.repair.skeletons.append(self.container.skeleton(id_).name or id_.hex())

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
        if isinstance(cut.clip, _SomeSignals):
            add_note(new["metadata"], "source-note", NOTE_OF_SIGNALS)
        try:
            found = super().finish_fields(cut, new)
        except FormatError as error:
            if not new["source"]:
                raise
            found = self._without_source(cut, new, error)
        if isinstance(cut, _Run) and cut.name != cut.clip.name and new["source"]:
            held = new["source"][0]
            if held["path"]:
                path = PurePosixPath(held["path"])
                named = path.with_name(f"{path.stem}.{cut.start}-{cut.stop}{path.suffix}")
                new["source"] = [held | {"path": str(named)}]
        return found

    def _without_source(
        self, cut: ClipCut, new: dict[str, Any], error: FormatError
    ) -> tuple[bytes, list[bytes]]:
        """The same of a clip whose template is lost, and with it what the file was like."""
        text = _about(cut.clip.name, f"its source file: {error}")
        if text not in self.repair.lost:
            self.repair.lost.append(text)
        metadata = new["metadata"]
        if cut.is_whole:  # a list of records
            metadata = {pair["key"]: pair["value"] for pair in metadata}
        new["source"], new["metadata"] = [], metadata
        add_note(metadata, "source-note", NOTE)
        _, hashes = super().finish_fields(cut, new)
        if cut.is_whole:
            new["metadata"] = [{"key": key, "value": metadata[key]} for key in sorted(metadata)]
        return b"", hashes
