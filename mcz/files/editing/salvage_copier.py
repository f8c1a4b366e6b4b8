"""Copy the intact parts of a damaged file: clips, runs of frames of others, some signals.

Stored bytes are copied, never encoded again. Each run of frames that can still be decoded, in a
clip that has lost some, becomes a clip of its own. Lost values are never replaced. SPEC.md,
"Salvage" and "Cutting without re-encoding", are normative.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath

from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.directory import ClipRow
from mcz.container.encodings import parse_skel
from mcz.errors import FormatError, MczError
from mcz.files.editing.cutting import ClipCut, note_source
from mcz.files.editing.extraction import Copier, Copying
from mcz.files.editing.recovering import Recovery
from mcz.files.reading.clip import Clip
from mcz.files.reading.faults import Problem
from mcz.files.reading.signal_info import SignalInfo
from mcz.model.schema import build

Run = tuple[int, int]  # frames a <= f < b
NOTE = "lost: the template of the source file was damaged"
NOTE_OF_SIGNALS = "lost: other signals of the clip were damaged, and with them its source file"
# Parts of a clip to write: all, or without parts that break a rule though their checksums are
# right.
FULL, WITHOUT_CHUNKS, WITHOUT_SOURCE_FILE, NO_PART = range(4)


@dataclass(slots=True)
class Repair:
    """The outcome of ``repair``: names of intact things, runs of frames of other clips, losses.

    ``damage`` lists faults of the file, ``lost`` its lost contents. ``recovery``: result of its
    recovery data, if any; ``restored``: these have restored every byte, so that nothing is lost.
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


def stated_frames(clip: Clip) -> int:
    """The number of frames of the original clip; CLIP states it for a truncated one."""
    with suppress(MczError):
        row = clip.container.directory.clips[clip.name]
        return max(clip.n_frames, int(clip.container.clip(row).n_frames))
    return clip.n_frames


def about_clip(name: str, problem: Problem) -> str:
    """The message of a problem, with the name of its clip."""
    message = problem.message
    return message if problem.clip is not None else f"clip {name!r}: {message}"


class SomeSignals(Clip):
    """The rest of a clip that has lost some signals, and so its source."""

    def __init__(self, clip: Clip, numbers: tuple[int, ...]) -> None:
        super().__init__(clip.container, clip.container.directory.clips[clip.name])
        self.whole, self.kept = clip, numbers

    @property
    def signals(self) -> tuple[SignalInfo, ...]:
        own = (self.whole.signals[index] for index in self.kept)
        return tuple(replace(info, index=index) for index, info in enumerate(own))

    def is_scaled(self, signal: int) -> bool:
        return self.whole.is_scaled(self.kept[signal])


def has_motion(clip: Clip) -> bool:
    """True for a clip, or the rest of one, with its first signal."""
    return not isinstance(clip, SomeSignals) or 0 in clip.kept


class WholeRun(ClipCut):
    """A run of frames of a damaged clip: hashes and source are always computed again."""

    __slots__ = ()

    @property
    def is_whole(self) -> bool:
        return False

    @property
    def name(self) -> str:
        """The name of the clip if no frame of its motion is lost."""
        if has_motion(self.clip) and self.n_frames == stated_frames(self.clip):
            return self.clip.name
        of = "" if has_motion(self.clip) else f".{self.clip.signals[0].name}"
        return f"{self.clip.name}.{self.start}-{self.stop}{of}"


class Repairer(Copier):
    """Copies the intact parts, and reports all others as lost."""

    def __init__(self, copying: Copying, outcome: Repair, degrees: Mapping[str, int]) -> None:
        super().__init__(copying)
        self.repair, self.degrees = outcome, degrees
        self._skeletons: dict[bytes, bytes] = {}  # the id that each has now

    def name_of(self, cut: ClipCut) -> str:
        if not isinstance(cut, WholeRun):
            return cut.clip.name
        name = cut.name
        while name != cut.clip.name and name in self.file.clips.rows:
            name += "+"
        return name

    def record_of(self, cut: ClipCut) -> payloads.Clip:
        record = super().record_of(cut)
        if not isinstance(cut.clip, SomeSignals):
            return record
        signals = [record.signals[index] for index in cut.clip.kept]
        place = {old: new for new, old in enumerate(cut.clip.kept)}
        for signal in signals:
            if signal.of is not None:
                signal.of = place.get(signal.of)
                signal.role = 0 if signal.of is None else signal.role
        return replace(record, signals=signals, source=None)

    def quality(self, cut: ClipCut, row: ClipRow) -> None:
        """Figures are of the motion."""
        if has_motion(cut.clip) and self._degree_of(cut) == FULL:
            super().quality(cut, row)

    def _degree_of(self, cut: ClipCut) -> int:
        return self.degrees.get(self.name_of(cut), FULL)

    def run(self, cuts: Sequence[ClipCut], *, alone: bool) -> None:
        for cut in cuts:
            if degree := self._degree_of(cut):
                noun = "chunks that belong to it, which break a rule"
                if degree == NO_PART:
                    noun = "all of it, which breaks a rule"
                self.repair.lost.append(f"clip {self.name_of(cut)!r}: {noun}")
        super().run([cut for cut in cuts if self._degree_of(cut) < NO_PART], alone=alone)

    def record_result(self, cut: ClipCut) -> None:
        if isinstance(cut, WholeRun):
            self.repair.runs.setdefault(cut.clip.name, []).append((cut.start, cut.stop))
        else:
            self.repair.clips.append(cut.clip.name)

    def skeletons(self) -> None:
        for id_ in self.container.directory.ids(ChunkType.SKEL):
            with suppress(FormatError):  # its fault is reported with the clips
                self.skeleton(id_)
                self.repair.skeletons.append(self.container.skeleton(id_).name or id_.hex())

    def attachments(self) -> None:
        for name, attachment in self.file.attachments.items():
            try:
                attachment.read()
            except MczError as error:
                self.repair.lost.append(f"attachment {name!r}: {error}")
                continue
            self.attachment(name)
            self.repair.attachments.append(name)

    def before_clips(self) -> None:
        with suppress(FormatError):  # the damage is already reported
            super().before_clips()

    def copy_before_cend(self, row: ClipRow) -> None:
        with suppress(FormatError):
            if row.cend is not None and self.degrees.get(row.name, FULL) == FULL:
                super().copy_before_cend(row)

    def skeleton(self, id_: bytes) -> bytes:
        """Without its source or its base, and so under another id, if these are lost."""
        chain: dict[bytes, None] = {}
        next_id: bytes | None = id_
        while next_id and next_id not in self._skeletons and next_id not in chain:
            chain[next_id] = None
            with suppress(FormatError):
                next_id = self.container.skeleton_fields(next_id).base
        for one in reversed(chain):
            with suppress(FormatError) if one != id_ else nullcontext():
                self._skeletons[one] = self._copy_skeleton(one)
        return self._skeletons[id_]

    def _copy_skeleton(self, id_: bytes) -> bytes:
        fields = self.container.skeleton_fields(id_)
        base = self._skeletons.get(fields.base) if fields.base else None
        try:
            if base != (fields.base or None):
                raise FormatError("its base skeleton is not the original one")
            if fields.source:
                self.file.skeleton_bytes(id_)
            return super().skeleton(id_)
        except FormatError as error:
            self.repair.lost.append(f"skeleton {id_.hex()}: its source or base: {error}")
        stored = self.stored(ChunkType.SKEL, id_)
        record = parse_skel(stored, f"SKEL {id_.hex()}", self.container.profile)
        record.base, record.source = base, None
        return self.writer.shared(ChunkType.SKEL, build(record, "skeleton"))

    def aliases(self, cuts: Mapping[str, ClipCut], alone: bool) -> None:
        for name, (of, target) in self.file.aliases.items():
            if self._is_restored(of, target):
                self.writer.alias(name, of, target)
            else:
                self.repair.lost.append(f"{name!r}, another name of what is lost")

    def _is_restored(self, of: int, target: bytes) -> bool:
        if of == payloads.OF_SKELETON:
            return (ChunkType.SKEL, target) in self.writer.directory.shared
        here = self.repair.clips if of == payloads.OF_CLIP else self.repair.attachments
        return target.decode("utf-8", "replace") in here

    def finish_record(self, cut: ClipCut, new: payloads.Clip) -> tuple[bytes, list[bytes]]:
        if isinstance(cut.clip, SomeSignals):
            note_source(new, NOTE_OF_SIGNALS)
        try:
            if self._degree_of(cut) >= WITHOUT_SOURCE_FILE and new.source:
                raise FormatError("the copied clip differs from the original")
            hashes = super().finish_record(cut, new)
        except FormatError as error:
            if new.source is None:
                raise
            hashes = self._without_source(cut, new, error)
        is_renamed = isinstance(cut, WholeRun) and cut.name != cut.clip.name
        if is_renamed and new.source and new.source.path:
            path = PurePosixPath(new.source.path)
            target = path.with_name(f"{path.stem}.{cut.start}-{cut.stop}{path.suffix}")
            new.source = replace(new.source, path=str(target))
        return hashes

    def _without_source(
        self, cut: ClipCut, new: payloads.Clip, error: FormatError
    ) -> tuple[bytes, list[bytes]]:
        """A part of a clip whose template, and with it the original file, is lost."""
        text = f"clip {cut.clip.name!r}: its source file: {error}"
        if text not in self.repair.lost:
            self.repair.lost.append(text)
        new.source = None
        note_source(new, NOTE)
        _, hashes = super().finish_record(cut, new)
        return b"", hashes
