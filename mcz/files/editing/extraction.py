"""``extract``: frames, joints and coarser resolutions cut out of the stored bytes of a file.

Streams are copied byte for byte, SPEC.md, "Cutting without re-encoding". A clip that cannot be cut
is decoded and encoded again (``recoding.py``), if the caller allows it.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import BinaryIO

from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.directory import ClipRow, SegmentRow
from mcz.container.model_records import (
    ValueDigest,
    value_hash,
)
from mcz.container.reader import Container
from mcz.container.segments import SegmentHeader
from mcz.container.source import ByteSource
from mcz.errors import FormatError, MotionError, OptionError
from mcz.files.editing.cutting import (
    WITHOUT_SOURCE,
    ClipCut,
    SignalCut,
    clip_record,
    cut_quality,
    cut_segment,
    cut_skeleton,
    note_source,
    plan_cut,
    recoded_quality,
)
from mcz.files.editing.recoding import (
    OF_JOINTS,
    check_recodable,
    joints_alone,
    settings_of,
    settings_of_joints,
    with_own_source,
)
from mcz.files.editing.rewriting import ChunkCopier, metadata_records, writer_like
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Where
from mcz.files.reading.file import File, open
from mcz.files.reading.signal_reader import SignalReader
from mcz.files.reading.source_files import stating_rate
from mcz.files.writing.atomic import replacing_file
from mcz.files.writing.clip_writer import Amend, write_plan
from mcz.files.writing.planning import prepare
from mcz.files.writing.tuning import tuned_plan
from mcz.model.checks import FRAMES, check_arguments
from mcz.model.motion import Motion
from mcz.model.schema import build, parse
from mcz.model.skeleton import Joints
from mcz.model.text_format import fields_text
from mcz.model.types import Params, Progress, Target
from mcz.sources import FORMATS


@dataclass(frozen=True, slots=True)
class ExtractedClip:
    """An extracted clip: frames a <= f < b, joints (None: all), number of resolutions left out.

    ``stored_frames`` counts the frames whose bytes were copied; the two sizes are of whole DATA
    payloads. ``recoded``: it was decoded and encoded again.
    """

    name: str
    frames: tuple[int, int]
    joints: tuple[str, ...] | None
    resolution: int
    stored_frames: int
    data_bytes: int
    data_bytes_before: int
    recoded: bool = False

    __repr__ = fields_text


@dataclass(slots=True)
class Extraction:
    """The outcome of ``extract``, and parts left out because they cannot be cut.

    ``damage`` lists faults found by salvage.
    """

    clips: list[ExtractedClip] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)
    size: int = 0

    __repr__ = fields_text


@check_arguments(frames=FRAMES)
def extract(
    source: Target,
    target: Target,
    *,
    resolution: int = 0,
    joints: Joints = None,
    frames: tuple[int, int | None] | None = None,
    clip: str | Sequence[str] | None = None,
    where: Where | None = None,
    salvage: bool = False,
    force: bool = False,
    max_decoded: int | None = None,
    copies: bool | None = None,
    recode: bool = False,
    progress: Progress | None = None,
) -> Extraction:
    """Copy frames, joints, resolutions or clips of ``source`` to a new file, without re-encoding.

    ``resolution``: the number of finest resolutions to leave out. ``joints``: those whose channels
    are kept; all joints stay in the skeleton. ``frames``: a <= f < b, b None for the end. ``clip``:
    keep only this clip, or these; otherwise all are cut, and attachments kept. ``where``: keep only
    the clips that match it, see ``File.find``. ``salvage``: damage outside of the kept parts is
    allowed. ``max_decoded``: as in ``mcz.open``; the result is decoded once to hash it. ``copies``:
    as in ``mcz.write``; None: if ``source`` has some. ``recode``: encode a clip again if
    copying is impossible: if joints share a group with others, which is refused by default, or
    if frames outside of the cut are needed to decode it. Raises OptionError or MotionError for
    what cannot be cut, and if the target is the source; FormatError for bad bytes; nothing is
    left under the target's name then.
    """
    alone = clip is not None or where is not None
    if not resolution and joints is None and frames is None and not alone:
        raise OptionError("nothing to extract: give a resolution, joints, frames or clips")
    with open(source, salvage=salvage, max_decoded=max_decoded) as opened:
        file = File(opened.container.strictly())
        names = [clip] if isinstance(clip, str) else clip
        clips = file.select_clips(names, where)
        if not clips:
            raise OptionError("the file has no clip", path=file.name)
        cuts = [plan_cut(one, frames, joints, resolution, recode) for one in clips]
        for cut in cuts:
            if cut.is_recoded:
                check_recodable(cut.clip, whole=cut.joints is None)
        with replacing_file(target, force=force, inputs=(source,)) as stream:
            copier = Copier(Copying(file, stream, progress, copies))
            copier.run(cuts, alone=alone)
            check_values(stream, [cut.clip.name for cut in cuts if not copier.is_same(cut)])
            size = copier.writer.offset
            return Extraction(copier.clips, copier.left_out, list(opened.damage), size)


@dataclass(frozen=True, slots=True)
class Copying:
    """A file and the target of its copy; ``copies`` None: if the file has some."""

    file: File
    stream: BinaryIO
    progress: Progress | None = None
    copies: bool | None = None


class Copier(ChunkCopier):
    """Copies the kept parts of a file."""

    def __init__(self, copying: Copying) -> None:
        file = copying.file
        super().__init__(file.container, writer_like(copying.stream, [file], copying.copies))
        self.file, self.progress = file, copying.progress
        self.clips: list[ExtractedClip] = []
        self.done = self.total = 0  # segments

    def run(self, cuts: Sequence[ClipCut], *, alone: bool) -> None:
        """Write the new file; ``alone``: these clips and what they need, nothing else."""
        self.total = sum(len(part.rows) for cut in cuts for part in cut.signals)
        for id_ in self.container.directory.ids(ChunkType.MODL):
            self.shared(ChunkType.MODL, id_)  # only the codec knows which models a clip needs
        if not alone:
            self.skeletons()
            self.before_clips()
            self.attachments()
        for cut in cuts:
            if cut.is_recoded:
                self.write_recoded(cut)
            else:
                self.write(cut)
        self.aliases({cut.clip.name: cut for cut in cuts}, alone)
        if cuts:
            names = ((cut.clip.name, self.name_of(cut)) for cut in cuts)
            self.writer.metadata(metadata_records(self.container, names))
        self.writer.finish()

    def skeletons(self) -> None:
        """Copy every skeleton, also those without a clip."""
        for id_ in self.container.directory.ids(ChunkType.SKEL):
            self.skeleton(id_)

    def attachments(self) -> None:
        for name in self.container.directory.attachments:
            self.attachment(name)

    def is_same(self, cut: ClipCut) -> bool:
        return cut.is_whole and not cut.is_recoded

    def write(self, cut: ClipCut) -> None:
        clip, row = cut.clip, self.container.directory.clips[cut.clip.name]
        record = self.record_of(cut)
        skeleton = self.skeleton(clip.skeleton_id)
        if cut.joints is not None:
            payload = self.stored(ChunkType.SKEL, skeleton)
            payload = cut_skeleton(payload, skeleton, cut.joints, self.container.profile)
            skeleton = self.writer.shared(ChunkType.SKEL, payload)
        whole = replace(record, skeleton=skeleton)
        new = whole if cut.is_whole else clip_record(cut, skeleton, record)
        source, hashes = self.finish_record(cut, new)
        new.name = self.name_of(cut)
        self.writer.begin_clip(new)
        self.copy_before_cend(row)
        rows = [(own, part) for part in cut.signals for own in part.rows]
        for own, part in sorted(rows, key=lambda pair: pair[0].offset):
            self.writer.segment(*self.segment(cut, part, own, noted=bool(new.source)))
            self.done += 1
            if self.progress is not None:
                self.progress(self.done, self.total, clip.name)
        cend = self.container.cend(row)
        extension = b"" if cend is None else bytes(cend.extension)
        missing = cend.missing if cend is not None and cut.is_whole else []
        self.writer.end_clip(cut.n_frames, source, hashes, extension, missing)
        self.quality(cut, row)
        self.record_result(cut)

    def segment(
        self, cut: ClipCut, part: SignalCut, row: SegmentRow, *, noted: bool
    ) -> tuple[SegmentHeader, list[bytes], bytes]:
        """Write the header, streams and extension of the kept part of a segment."""
        return cut_segment(self.container, part, row, noted=noted)

    def write_recoded(self, cut: ClipCut) -> None:
        """Write the kept part of a clip, decoded and encoded again."""
        clip, old = cut.clip, cut.clip.stored_quality or {}
        motion = replace(joints_alone(cut), name=self.name_of(cut))
        settings = settings_of(clip) if cut.joints is None else settings_of_joints(clip)
        record = self.recode(clip, motion, settings, partial(recoded_quality, cut, old))
        for name in OF_JOINTS:
            if f"param.{name}" in old and f"param.{name}" not in record:
                self._leave_out(cut, f"its {name}, which other joints have a part in")
        if clip.source is not None and cut.joints is not None:
            self._leave_out(cut, "its source file, as joints were cut")
        self.record_result(cut)

    def _leave_out(self, cut: ClipCut, text: str) -> None:
        self.left_out.append(f"clip {cut.clip.name}: {text}")

    def recode(self, clip: Clip, motion: Motion, settings: Params, amend: Amend) -> dict[str, str]:
        """Encode ``motion`` in the place of ``clip``; return its quality record.

        ``amend`` edits the new quality record before it is written; lossless codecs have none.
        """
        row, codec = self.container.directory.clips[clip.name], clip.signals[0].codec
        self.skeleton(clip.skeleton_id)
        motion, left_out = with_own_source(motion, clip)
        if left_out is not None:
            self.left_out.append(f"clip {clip.name}: its source file, as {left_out}")
        prepared = prepare(motion, codec, settings)
        plan = tuned_plan(prepared, codec, settings, self.writer.profile)
        record = write_plan(self.writer, plan, self.progress, amend=amend)
        self.copy_before_cend(row)
        self.copy_after_cend(row, but=ChunkType.QUAL)
        return record or {}

    def record_of(self, cut: ClipCut) -> payloads.Clip:
        return self.container.clip(self.container.directory.clips[cut.clip.name])

    def name_of(self, cut: ClipCut) -> str:
        return cut.clip.name

    def finish_record(self, cut: ClipCut, new: payloads.Clip) -> tuple[bytes, list[bytes]]:
        """Source and metadata of the new CLIP; return the hashes of the source and the signals."""
        if cut.is_whole:
            cend = self.container.whole_cend(self.container.directory.clips[cut.clip.name])
            source, hashes = cend.source_sha256 or b"", list(cend.value_sha256)
        else:
            source, hashes = self._hash_decoded(cut, new)
            if new.source is None:
                self._drop_units(cut, new)
        if new.source is not None:
            self.shared(ChunkType.SRCE, new.source.template)
        return source, hashes

    def _drop_units(self, cut: ClipCut, new: payloads.Clip) -> None:
        """Drop the units of stored integers that only the source file could scale."""
        for info, signal in zip(cut.clip.signals, new.signals, strict=True):
            if cut.clip.is_scaled(info.index):
                signal.channels = [replace(own, unit="") for own in signal.channels or ()]
                note_source(new, f"{info.name}: words as they were stored")
                words = f"the words of its signal {info.name}"
                self._leave_out(cut, f"what {words} mean, as its source file was cut")

    def _hash_decoded(self, cut: ClipCut, new: payloads.Clip) -> tuple[bytes, list[bytes]]:
        """The hashes of the kept part, decoded once, and its source file."""
        source = new.source
        if source and cut.joints is not None:
            new.source = None
            note_source(new, WITHOUT_SOURCE)
            self._leave_out(cut, "its source file, as joints were cut")
        elif source:
            motion = cut.clip.motion((cut.start, cut.stop), cut.resolution)
            hashes = [value_hash(signal.stored, signal.mask) for signal in motion.signals]
            if motion.source is None:  # a damaged file; the template may give the reason
                self.container.template(source.template, source.format)
                raise FormatError("the parts cannot be combined")
            return self.put_source(cut, new, motion), hashes
        return b"", [self._value_hash(cut, part) for part in cut.signals]

    def put_source(self, cut: ClipCut, new: payloads.Clip, motion: Motion) -> bytes:
        """Set the clip's source to ``motion``'s; returns its SHA-256, b"" if it was left out."""
        source, changed = new.source, stating_rate(motion, cut.clip.frame_numbers)
        assert source is not None and changed.source is not None
        if changed is not motion:
            template = self.writer.template(source.format, changed.source.template)
            source = replace(source, template=template)
        try:
            data = FORMATS[changed.source.format].write(changed)
        except MotionError as error:
            new.source = None
            text = f"the source file was left out: {error}"
            note_source(new, text, None if cut.is_whole else cut)
            self._leave_out(cut, f"its source file, as {error}")
            return b""
        new.source = replace(source, size=len(data))
        return hashlib.sha256(data).digest()

    def _value_hash(self, cut: ClipCut, part: SignalCut) -> bytes:
        """The hash of the kept part of a signal, a few segments in memory at a time."""
        info, digest = part.info, ValueDigest()
        reader = SignalReader(self.container, info, part.groups, part.dropped, cut.clip.name)
        for block in reader.blocks(cut.start + info.skip, cut.stop + info.skip):
            digest.update(block.values, block.mask)
        return digest.digest()

    def quality(self, cut: ClipCut, row: ClipRow) -> None:
        """Write the quality record, edited if the clip was cut, and copy other ancillary chunks."""
        if self.is_same(cut):
            self.copy_after_cend(row)
            return
        records = [chunk for chunk in row.ancillary if chunk.type == ChunkType.QUAL]
        record = payloads.Qual(entries=[])
        if records:
            payload = self.container.payload(records[0])
            record = parse(payloads.Qual, payload, records[0].label)
        old = {entry.key: entry.value for entry in record.entries}
        entries = self.entries(cut, old if records else None)
        if entries is not None:
            record.entries = payloads.metadata_records(entries)
            self.writer.ancillary(ChunkType.QUAL, build(record, "quality record"))
        self.copy_after_cend(row, but=ChunkType.QUAL)

    def entries(self, cut: ClipCut, old: Mapping[str, str] | None) -> dict[str, str] | None:
        """Entries of the new quality record from the old ones; None: no record."""
        return cut_quality(cut, old or {})

    def record_result(self, cut: ClipCut) -> None:
        written = self.writer.directory.clips[self.name_of(cut)].segments
        before = [row for info in cut.clip.signals for row in info.rows]
        stored = cut.n_frames
        if not cut.is_recoded:
            stored += cut.signals[0].skip + cut.signals[0].spare
            n_frames = sum(row.header.n_frames for part in cut.signals for row in part.rows)
            assert n_frames == sum(row.header.n_frames for row in written)
        self.clips.append(
            ExtractedClip(
                cut.clip.name,
                (cut.start, cut.stop),
                cut.names,
                cut.resolution,
                stored,
                sum(row.size for row in written),
                sum(row.size for row in before),
                cut.is_recoded,
            )
        )

    def aliases(self, cuts: Mapping[str, ClipCut], alone: bool) -> None:
        """Copy the aliases of contents that were copied unchanged."""
        for name, (of, target) in self.file.aliases.items():
            if of == payloads.OF_CLIP:
                cut = cuts.get(target.decode("utf-8", "replace"))
                if cut is None:
                    continue  # of a clip that was not chosen
                if not self.is_same(cut):
                    text = f"{name}, a file identical to that of clip {cut.clip.name} before"
                    self.left_out.append(text)
                    continue
            elif of == payloads.OF_SKELETON:
                if (ChunkType.SKEL, bytes(target)) not in self.writer.directory.shared:
                    continue
            elif alone:
                continue
            self.writer.alias(name, of, target)


def check_values(stream: BinaryIO, names: Iterable[str]) -> None:
    """Decode clips of the file in ``stream`` and compare their hashes, before it gets its name."""
    stream.flush()
    container = Container(ByteSource(stream), max_decoded=2**53)
    for name in names:
        clip = Clip(container, container.directory.clips[name])
        for info in clip.signals:
            clip.check_values(info.index)
    stream.seek(0, os.SEEK_END)
