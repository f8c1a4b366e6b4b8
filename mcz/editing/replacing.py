"""``replace``: one joint of a clip gets other values; no other stream of the file is touched.

SPEC.md, "Replacing a joint", is normative. ``recoding.py`` codes the joint, this file writes what
it has coded. Where all joints are coded in one and a caller allows it, the clip is coded anew.
"""

from __future__ import annotations

import builtins
import dataclasses
import hashlib
import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import ArrayLike

from mcz.brief import brief
from mcz.container import note_records, payloads
from mcz.container.chunks import ChunkType, read_chunk
from mcz.container.directory import ClipRow, SegmentRow
from mcz.container.locks import lock
from mcz.container.segments import FRAME_NOTES, GROUP_NOTES, MASKS, SegmentHeader
from mcz.container.value_hash import value_hash
from mcz.editing.anew import check_anew, settings_of, source_file
from mcz.editing.cutting import ClipCut, cut_segment, note_source, plan_cut
from mcz.editing.extraction import Copier, with_stated_rate
from mcz.editing.recoding import Edited, Recoded, edit, is_coded_with_others, recode_joint
from mcz.errors import (
    AccessError,
    MotionError,
    OptionError,
    reason_of,
)
from mcz.reading.clip import Clip
from mcz.reading.file import File, open
from mcz.reading.quality_joints import with_indices
from mcz.schema import build, parse
from mcz.types import Progress, Target, Values
from mcz.writing.atomic import replacing_file
from mcz.writing.clip_check import check_values
from mcz.writing.quality import CHUNK, figures, texts_of

RECODED = "edit-recoded"


@dataclass(frozen=True, slots=True)
class Replacement:
    """What ``replace`` did.

    ``recoded``: the joints that stood in the file as copies of this one and were coded anew, their
    values as before. The two numbers of bytes are those of the joint's streams, its masks and its
    exceptions: numbers off the grid, which are counted, too. ``max_error``: how far a decoded value
    is from the one that was given, at most, in source units.

    ``anew``: the whole clip was coded anew, and other joints are off by at most ``others_error``;
    the numbers of bytes are those of the clip then.
    """

    clip: str
    joint: str
    codec: str
    recoded: tuple[str, ...]
    joint_bytes: int
    joint_bytes_before: int
    n_exceptions: int
    n_exceptions_before: int
    max_error: float
    left_out: tuple[str, ...]
    size: int
    anew: bool = False
    others_error: float = 0.0

    __repr__ = brief


def replace(
    source: Target,
    clip: str | None,
    joint: int | str,
    values: ArrayLike,
    target: Target | None = None,
    *,
    on_grid: bool = False,
    force: bool = False,
    copies: bool | None = None,
    recode: bool = False,
    progress: Progress | None = None,
) -> Replacement:
    """Give one joint of a clip other values; write the file to ``target``, by default in place.

    ``source`` is what ``mcz.open`` takes, or a File that is open, which stays what it is and needs
    a ``target``. ``clip`` may be None where there is only one. ``values``, of shape (n_frames,
    channels of the joint), are in source units; a clip without a source file takes NaN for invalid.
    The joint is coded anew with the clip's own codec and settings, all other streams are copied
    byte for byte. A lossless clip takes every number exactly, or, ``on_grid``, the nearest that its
    source would print. ``copies``: as ``mcz.write`` has it; None: where the file has some.
    ``recode``: a clip whose codec codes all joints in one is decoded and coded anew, so that other
    joints change a little, too; by default it is refused.

    Raises OptionError where the codec cannot code a joint alone, or where ``target`` is the source,
    MotionError for values that it cannot hold; the file is as it was then.
    """
    with ExitStack() as stack:
        inputs = [source.name if isinstance(source, File) else source]
        if target is None:
            target, force, inputs = _locked(source, stack), True, []
        stream = stack.enter_context(replacing_file(target, force=force, inputs=inputs))
        file = source if isinstance(source, File) else stack.enter_context(open(source))
        chosen = file.only_clip(clip)
        if recode and is_coded_with_others(chosen, joint):
            check_anew(chosen)
            edited = edit(chosen, joint, values, on_grid)
            return _write_anew(chosen, _AnewEditor(file, stream, chosen, edited, progress, copies))
        recoded = recode_joint(chosen, joint, values, on_grid)
        writer = _Editor(file, stream, chosen.name, recoded, progress, copies)
        found = _write(file, chosen, recoded, writer)
        check_values(stream, [chosen.name])
        return found


def _locked(source: Target, stack: ExitStack) -> Path:
    """The file that ``source`` names, taken for this process until ``stack`` ends."""
    if not isinstance(source, (str, os.PathLike)) or "://" in str(source):
        raise OptionError(f"{source!r} cannot be edited in place; name a target")
    path = Path(source).resolve()
    if os.name == "posix":  # elsewhere nothing can be renamed to what is open
        try:
            held = builtins.open(path, "r+b", buffering=0)  # noqa: SIM115 - closed by the stack
        except (OSError, ValueError) as error:
            raise AccessError(reason_of(error), path=path) from None
        if not lock(stack.enter_context(held)):
            raise AccessError("another process is appending to it", path=path)
    return path


def _write(file: File, clip: Clip, recoded: Recoded, writer: _Editor) -> Replacement:
    found = writer.run(
        [plan_cut(one, None, None, 0) for one in file.clips.values()],
        alone=False,
    )
    addresses = clip.skeleton.addresses()
    return Replacement(
        clip=clip.name,
        joint=addresses[recoded.joint],
        codec=clip.codec,
        recoded=tuple(addresses[other] for other in recoded.others),
        joint_bytes=recoded.size + writer.beside.size,
        joint_bytes_before=recoded.size_before + writer.beside_before.size,
        n_exceptions=writer.beside.n_exceptions,
        n_exceptions_before=writer.beside_before.n_exceptions,
        max_error=recoded.max_error,
        left_out=tuple(found.left_out),
        size=found.size,
    )


@dataclass(slots=True)
class _Beside:
    """Bytes beside the codec's streams of a joint, and how many exceptions are in them."""

    size: int = 0
    n_exceptions: int = 0

    def add(self, flag: int, stream: bytes) -> None:
        self.size += len(stream)
        if flag == GROUP_NOTES and stream:
            notes = parse(note_records.GroupNotes, stream, "group notes")
            self.n_exceptions += len(notes.exceptions)


class _Editor(Copier):
    """Copies a file, the streams of one joint of one clip replaced."""

    def __init__(
        self,
        file: File,
        stream: BinaryIO,
        name: str,
        recoded: Recoded,
        progress: Progress | None,
        copies: bool | None,
    ) -> None:
        super().__init__(file, stream, progress, copies)
        self.name, self.recoded = name, recoded
        self.beside, self.beside_before = _Beside(), _Beside()

    def is_same(self, cut: ClipCut) -> bool:
        return cut.clip.name != self.name

    def clip(self, cut: ClipCut) -> None:
        if self.is_same(cut):
            super().clip(cut)
            return
        row = self.container.directory.clips[cut.clip.name]
        record = self.container.clip(row)
        self.skeleton(cut.clip.skeleton_id)
        source = self._source(record)
        if record.source is not None:
            self.carrier.shared(ChunkType.SRCE, record.source.template)
        self.writer.begin_clip(record, [part.info.layout.n_channels for part in cut.signals])
        self.inside(row)
        self._edited_segments(cut, noted=bool(record.source))
        cend = self.container.whole_cend(row)
        signal = self.recoded.decoded.signals[0]
        hashes = [value_hash(signal.values, signal.mask), *cend.value_sha256[1:]]
        extension = bytes(cend.extension)
        self.writer.end_clip(cut.n_frames, source, hashes, extension, cend.missing)
        self._edited_quality(row)

    def _source(self, record: payloads.Clip) -> bytes:
        """Put the size of the new source file into CLIP; return its hash."""
        motion, held = self.recoded.decoded, record.source
        if motion.source is None or held is None:
            return b""
        clip = self.file.clips[self.name]
        motion, held = with_stated_rate(self.writer, motion, held, clip)
        try:
            data = source_file(motion)
        except MotionError as error:
            note_source(record, f"the source file was left out: {error}")
            record.source = None
            self.found.left_out.append(f"clip {self.name}: its source file, as {error}")
            return b""
        record.source = dataclasses.replace(held, size=len(data))
        return hashlib.sha256(data).digest()

    def _edited_segments(self, cut: ClipCut, *, noted: bool) -> None:
        motion = cut.signals[0]
        numbers = {row.offset: index for index, row in enumerate(motion.rows)}
        rows = [(row.offset, row, part) for part in cut.signals for row in part.rows]
        for _, row, part in sorted(rows, key=lambda entry: entry[0]):
            if part is motion:
                written = self._segment(row, numbers[row.offset], noted)
            else:
                written = cut_segment(self.container, part, row, noted=noted, name=self.name)
            self.writer.segment(*written)
            self.done += 1
            if self.progress is not None:
                self.progress(self.done, self.total, self.name)

    def _segment(
        self, row: SegmentRow, index: int, noted: bool
    ) -> tuple[SegmentHeader, list[bytes], bytes]:
        """Header, streams and extension of a segment, those of the joint in their places."""
        counts, edit = self.recoded.info.counts, self.recoded
        table, old = self.container.streams(row, counts, None)
        flags = row.header.flags & ~(FRAME_NOTES | GROUP_NOTES | MASKS)
        kept: list[bytes] = []
        at = table.frame_notes()
        if noted and at is not None:
            flags |= FRAME_NOTES
            kept.append(old[at])
        new_notes, new_masks = edit.beside(row.header.first, row.header.stop)
        for flag, where, new in (
            (GROUP_NOTES, table.group_notes, new_notes),
            (MASKS, table.mask, new_masks),
        ):
            numbers = [where(group) for group in range(counts.n_groups)]
            streams = [b"" if number is None else old[number] for number in numbers]
            for group, stream in new.items():
                if group in edit.groups:
                    self.beside_before.add(flag, streams[group])
                    self.beside.add(flag, stream)
                streams[group] = stream
            if row.header.flags & flag or any(streams):
                flags |= flag
                kept += streams
        for resolution in range(counts.n_resolutions):
            for group in range(counts.n_groups):
                coded = edit.streams.get((index, group))
                kept.append(
                    old[table.codec(resolution, group)] if coded is None else coded[resolution]
                )
        return dataclasses.replace(row.header, flags=flags), kept, table.extension

    def _edited_quality(self, row: ClipRow) -> None:
        """The quality record with what is known of the new values, and the other chunks."""
        records = [chunk for chunk in row.ancillary if chunk.type == CHUNK]
        if records or not self.recoded.info.codec.lossless:
            record = payloads.Qual(entries=[])
            if records:
                payload = self.container.payload(records[0])
                record = parse(payloads.Qual, payload, records[0].label)
            old = {entry.key: entry.value for entry in record.entries}
            record.entries = payloads.metadata_records(self._entries(old))
            self.writer.ancillary(CHUNK, build(record, "quality record"))
        for chunk in row.ancillary:
            if chunk.type != CHUNK:
                self.carrier.ancillary(read_chunk(self.container.source, chunk.offset))

    def _entries(self, old: dict[str, str]) -> dict[str, str]:
        edit, codec = self.recoded, self.recoded.info.codec
        found = {} if codec.lossless else texts_of(figures(edit.given, edit.decoded))
        stored = with_indices(found, edit.given.skeleton)
        return edited_quality(old, codec.name, edit.joint, stored)


class _AnewEditor(Copier):
    """Copies a file, one clip of it decoded and, after its edit, coded anew."""

    def __init__(
        self,
        file: File,
        stream: BinaryIO,
        clip: Clip,
        edited: Edited,
        progress: Progress | None,
        copies: bool | None,
    ) -> None:
        super().__init__(file, stream, progress, copies)
        self.edited_clip, self.edited = clip, edited
        self.address = clip.skeleton.addresses()[edited.joint]
        self.max_error = self.others_error = 0.0

    def is_same(self, cut: ClipCut) -> bool:
        return cut.clip.name != self.edited_clip.name

    def clip(self, cut: ClipCut) -> None:
        if self.is_same(cut):
            super().clip(cut)
            return
        self.recode(cut.clip, self.edited.motion, settings_of(cut.clip), self._record)

    def _record(self, now: dict[str, str], decoded: Sequence[Values]) -> dict[str, str]:
        wanted = self.edited.motion.signals[0].masked()
        with np.errstate(invalid="ignore"):  # infinities
            difference = np.abs(decoded[0] - wanted)
        own = np.zeros(difference.shape[1], np.bool_)
        own[list(self.edited_clip.skeleton.columns(self.edited.joint))] = True
        self.max_error = float(np.nanmax(difference[:, own], initial=0.0))
        self.others_error = float(np.nanmax(difference[:, ~own], initial=0.0))
        settings = {key: value for key, value in now.items() if key.startswith("param.")}
        found = {k: v for k, v in now.items() if k != "codec" and k not in settings}
        old = self.edited_clip.stored_quality or {}
        record = edited_quality(old, now["codec"], self.edited.joint, found)
        record = {k: v for k, v in record.items() if not k.startswith("param.")}
        return record | settings | {RECODED: "yes"}


def _write_anew(clip: Clip, writer: _AnewEditor) -> Replacement:
    before = sum(row.size for info in clip.signals for row in info.rows)
    found = writer.run(
        [plan_cut(one, None, None, 0) for one in writer.file.clips.values()], alone=False
    )
    segments = writer.writer.directory.clips[clip.name].segments
    return Replacement(
        clip=clip.name,
        joint=writer.address,
        codec=clip.codec,
        recoded=(),
        joint_bytes=sum(row.size for row in segments),
        joint_bytes_before=before,
        n_exceptions=0,
        n_exceptions_before=0,
        max_error=writer.max_error,
        left_out=tuple(found.left_out),
        size=found.size,
        anew=True,
        others_error=writer.others_error,
    )


def edited_quality(
    old: Mapping[str, str], codec: str, joint: int, found: Mapping[str, str]
) -> dict[str, str]:
    """The entries of the quality record of a clip in which a ``joint`` was edited, as stored.

    ``old`` are those of before, ``found`` the figures of this edit.
    """
    now = {"codec": codec}
    for key, value in old.items():
        if key == "codec" or key.startswith(("param.", "cut-", "uncut_", "unedited_")):
            now[key] = value
        elif not key.startswith(("edit-", "edit_")):
            now[f"unedited_{key}"] = value
    edited = [name for name in old.get("edit-joints", "").split(",") if name]
    now["edit-joints"] = ",".join(dict.fromkeys([*edited, str(joint)]))
    if RECODED in old:
        now[RECODED] = old[RECODED]
    return now | {f"edit_{key}": value for key, value in found.items()}
