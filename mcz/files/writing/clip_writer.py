"""A planned clip -> chunks: its skeletons and models, CLIP, segments, CEND, its quality record.

The clip is decoded from its final bytes before it ends; the record has the errors of a lossy codec,
and its settings. SPEC.md, "CEND" and "QUAL", are normative; docs/reference/measures.md defines the
figures.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Codec, Segment
from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.encodings import pack_skeleton
from mcz.container.limits import Profile, check
from mcz.container.model_records import (
    ValueDigest,
    build_skeleton,
    canonical,
    put_time_base,
    time_base_of,
)
from mcz.container.reader import Container
from mcz.container.segments import FRAME_NOTES, FRESH, GROUP_NOTES, MASKS, SegmentHeader
from mcz.container.source import open_source
from mcz.container.writer import Writer
from mcz.errors import ChecksumError, LimitError
from mcz.files.reading.signal_info import SignalInfo, read_signal
from mcz.files.reading.signal_reader import SignalReader
from mcz.files.reading.stored_clip import with_indices, with_names
from mcz.files.writing.atomic import alias_once
from mcz.files.writing.planning import (
    ClipPlan,
    Prepared,
    SignalPlan,
    StoredSkeleton,
    clip_record,
    plan_clip,
)
from mcz.files.writing.signal_source import MemorySource
from mcz.kinematics.joint_names import find_feet
from mcz.kinematics.metrics import compare
from mcz.kinematics.metrics.sums import channel_errors
from mcz.model.motion import Exceptions, Motion, Signal, Skeleton
from mcz.model.schema import build
from mcz.model.types import JsonObject, Params, Progress, Values
from mcz.sources import FORMATS

NO_HASH = bytes(32)


# (stored entries of a quality record, decoded values of each signal) -> new entries
Amend = Callable[[dict[str, str], Sequence[Values]], dict[str, str]]


@dataclass(frozen=True, slots=True)
class Decoded:
    """A signal as a reader decodes it; a lossless codec gives the original ``values``."""

    values: Values
    sha256: bytes


class ClipCopy:
    """A second copy of CLIP and segments, in memory, for decoding.

    The file of the clip itself may be a pipe.
    """

    def __init__(self, profile: Profile) -> None:
        self._out = io.BytesIO()
        self.writer = Writer(self._out, profile=profile)

    def segment(self, header: SegmentHeader, streams: Sequence[bytes]) -> None:
        self.writer.segment(header, streams)

    def decoded(self, motion: Motion, coded: Sequence[SignalPlan]) -> list[Decoded]:
        """The signals; raises ChecksumError if a channel differs that must not."""
        self.writer.end_clip(motion.n_frames, NO_HASH, [NO_HASH] * len(motion.signals))
        directory, data = self.writer.directory, open_source(self._out.getvalue())
        container = Container(data, max_decoded=2**53, directory=directory)
        row = directory.clips[motion.name]
        record = container.clip(row)
        signals = []
        for index, part in enumerate(coded):
            info = read_signal(container, row, record, index, motion.skeleton, motion.frame_rate)
            info = replace(info, own_codec=part.codec)
            signals.append(_decode(container, info, motion.signals[index], part.lossy_channels()))
        return signals


def _decode(
    container: Container, info: SignalInfo, signal: Signal, free: NDArray[np.bool_]
) -> Decoded:
    reader = SignalReader(container, info, None, 0, signal.name)
    values = np.empty(signal.values.shape) if free.any() else signal.values
    digest, n_frames = ValueDigest(), info.layout.n_frames
    for block in reader.blocks(0, n_frames):
        rows = slice(*(edge * signal.samples_per_frame for edge in (block.start, block.stop)))
        kept = ~free if free.any() else slice(None)
        is_same = _is_same(signal.values[rows, kept], block.values[:, kept])
        mask = None if signal.mask is None else signal.mask[rows]
        if not is_same or not _is_same_mask(mask, block.mask):  # CEND-07
            raise ChecksumError(
                f"frames {block.start}:{block.stop}: codec {info.codec.name} does not decode "
                "to the values that it encoded",
                where=f"signal {info.index}",
            )
        if free.any():
            values[rows] = block.values
        digest.update(block.values, block.mask)
    return Decoded(values, digest.digest())


def _is_same(source: Values, decoded: Values) -> bool:
    """True for equal bits, except those of NaN."""
    own, other = (np.ascontiguousarray(values).view(np.int64) for values in (source, decoded))
    if source.dtype == decoded.dtype and np.array_equal(own, other):
        return True
    return canonical(source) == canonical(decoded)


def _is_same_mask(source: NDArray[np.bool_] | None, decoded: NDArray[np.bool_] | None) -> bool:
    if source is None or decoded is None:
        return (source is None or bool(source.all())) and (decoded is None or bool(decoded.all()))
    return np.array_equal(source, decoded)


def write_skeletons(writer: Writer, skeletons: Sequence[StoredSkeleton]) -> bytes:
    """Write skeletons that the file does not have, and their names; return the id of the last."""
    id_ = b""
    for stored in skeletons:
        skeleton = replace(stored.skeleton, base=id_) if stored.derives else stored.skeleton
        id_ = write_skeleton(writer, skeleton)
        if stored.path:
            alias_once(writer, stored.path, id_)
    return id_


def write_skeleton(writer: Writer, skeleton: Skeleton) -> bytes:
    """Write SKEL, after the SRCE of its own file if it has one; return its id."""
    original = skeleton
    if writer.last_skeleton is not None and writer.last_skeleton[0] is original:
        id_ = writer.last_skeleton[1]
        if (ChunkType.SKEL, id_) in writer.directory.shared:  # not undone after a failure
            return id_
    check("joints", skeleton.n_joints, writer.profile.joints)
    check("channels", skeleton.n_channels, writer.profile.channels)
    if skeleton.base and (ChunkType.SKEL, skeleton.base) not in writer.directory.shared:
        skeleton = replace(skeleton, base=None)  # it is in another file
    source = None
    if skeleton.source is not None:
        format_id = FORMATS[skeleton.source.format].id
        source = payloads.SkeletonSource(
            template=writer.template(format_id, skeleton.source.template),
            format=format_id,
            size=skeleton.source.size,
            sha256=skeleton.source.sha256,
        )
    payload = build_skeleton(skeleton, source)
    id_ = writer.shared(ChunkType.SKEL, pack_skeleton(payload) if writer.short else payload)
    writer.last_skeleton = original, id_
    return id_


def write_clip(
    writer: Writer, motion: Motion, codec: Codec, params: Params
) -> dict[str, str] | None:
    """``write_plan`` of a motion without targets."""
    return write_plan(writer, plan_clip(Prepared(motion), codec, params, writer.profile))


@dataclass(frozen=True, slots=True)
class Trial:
    """A file of one clip in memory, without its quality record.

    ``header`` is that of the motion's codec, ``values`` (by signal) are as a reader has them.
    """

    data: bytes
    header: bytes
    values: tuple[Values, ...]


def write_trial(prepared: Prepared, codec: Codec, params: Params, profile: Profile) -> Trial:
    out = io.BytesIO()
    writer = Writer(out, profile=profile)
    plan = plan_clip(prepared, codec, params, profile)
    decoded = _write_clip(writer, plan, ClipCopy(profile))
    writer.finish()
    values = tuple(signal.values for signal in decoded)
    return Trial(out.getvalue(), plan.signals[0].encoded.header, values)


def write_plan(
    writer: Writer,
    plan: ClipPlan,
    progress: Progress | None = None,
    *,
    quality: bool = True,
    amend: Amend | None = None,
    copy: ClipCopy | None = None,
) -> dict[str, str] | None:
    """Write one clip: its skeletons and template if new, CLIP, segments, CEND, quality if lossy.

    Returns the quality record, None if there is none; ``amend`` edits it last. ``copy`` decodes the
    clip before it ends.
    """
    motion, codec = plan.motion, plan.codec
    decoded = _write_clip(writer, plan, copy or ClipCopy(writer.profile), progress)
    if not quality or codec.lossless:
        return None
    settings, values = codec.settings(plan.options), [signal.values for signal in decoded]
    record = quality_record(motion, values, codec.name, settings, plan.remarks)
    stored = with_indices(record, motion.skeleton)
    stored = amend(stored, values) if amend else stored
    writer.ancillary(ChunkType.QUAL, quality_payload(stored))
    return with_names(stored, motion.skeleton)


def _write_clip(
    writer: Writer, plan: ClipPlan, copy: ClipCopy, progress: Progress | None = None
) -> list[Decoded]:
    """Write one clip up to CEND; return its signals as decoded from ``copy``."""
    motion = plan.motion
    record = _write_references(writer, plan)
    for model in plan.models:
        copy.writer.shared(ChunkType.MODL, model)
    for each in (writer, copy.writer):
        each.begin_clip(record)
    for index, signal in enumerate(plan.signals):
        _write_signal((writer, copy), motion, index, signal, progress)
    decoded = copy.decoded(motion, plan.signals)
    sha256 = motion.source.sha256 if motion.source else b""
    writer.end_clip(motion.n_frames, sha256, [signal.sha256 for signal in decoded])
    return decoded


def begin_open_clip(writer: Writer, plan: ClipPlan, first_number: int = 1) -> None:
    """Write the CLIP of a plan without known frames, and the chunks that it refers to.

    ``first_number`` is the number of its first frame.
    """
    record = _write_references(writer, plan)
    record.flags |= payloads.OPEN_CLIP
    put_time_base(record, time_base_of(np.array([first_number], np.int64), None))
    writer.begin_clip(record)


def _write_references(writer: Writer, plan: ClipPlan) -> payloads.Clip:
    """Write the chunks that CLIP refers to; return its record."""
    prepared, source = plan.prepared, plan.motion.source
    for model in plan.models:
        writer.shared(ChunkType.MODL, model)
    skeletons = prepared.skeletons or (StoredSkeleton(plan.motion.skeleton),)
    skeleton = write_skeletons(writer, skeletons)
    template = None
    if source is not None:
        template = writer.template(FORMATS[source.format].id, source.template)
    return clip_record(plan, skeleton, template)


def _write_signal(
    outs: tuple[Writer, ClipCopy],
    motion: Motion,
    index: int,
    plan: SignalPlan,
    progress: Progress | None,
) -> None:
    for segment in plan.encoded.segments:
        header, streams = _segment(outs[0].profile, motion, index, plan.source, segment)
        for out in outs:
            out.segment(header, streams)
        if progress is not None:
            progress(segment.first + segment.n_frames, motion.n_frames, motion.name)


def _segment(
    profile: Profile, motion: Motion, index: int, source: MemorySource, segment: Segment
) -> tuple[SegmentHeader, list[bytes]]:
    """Header and streams of a segment: its notes, its masks, and the codec's streams."""
    start, stop = segment.first, segment.first + segment.n_frames
    per_frame = 8 * source.layout.samples_per_frame * max(1, source.layout.n_channels)
    size = segment.n_frames * per_frame
    check(f"frames {start}:{stop}: decoded bytes", size, profile.segment_bytes)
    flags = FRESH if segment.fresh else 0
    streams: list[bytes] = []
    notes = b""
    if index == 0 and motion.source is not None and motion.source.notes is not None:
        notes = motion.source.notes.cut(start, stop)
    if notes:
        flags |= FRAME_NOTES
        streams.append(notes)
    group_notes = source.group_notes(start, stop)
    if any(group_notes):
        if profile.is_plain:  # LIMIT-21
            raise LimitError("profile small does not allow numbers off their grid (group notes)")
        flags |= GROUP_NOTES
        streams += group_notes
    masks = source.masks(start, stop)
    if any(masks):
        flags |= MASKS
        streams += masks
    streams += segment.streams
    header = SegmentHeader(index, start, segment.n_frames, segment.lead, segment.tail, flags)
    return header, streams


# Figures that a record omits to save bytes: the radius is 3 cm unless stated.
NOT_STORED = ("max_channel_error", "max_channel_error_frame", "max_channel_error_channel")
LEFT_OUT = (
    *("shell_radius_cm", "shell_max_frame", "shell_max_joint"),
    *("contact_frames", "slide_max_frame", "slide_max_joint"),
    *("slide_path_mm", "slide_path_original_mm"),
)


def quality_record(
    original: Motion,
    decoded: Sequence[Values],
    codec_name: str,
    options: Params,
    remarks: Mapping[str, str],
) -> dict[str, str]:
    """The entries of the record; ``decoded`` are the values of every signal as a reader has them.

    If no point has a position, the entries ``NOT_STORED``, which are not metrics of the format,
    have the greatest error of a channel.
    """
    signals = tuple(map(with_values, original.signals, decoded))
    entries = quality_entries(original, replace(original, signals=signals), codec_name, options)
    if "max_position_error" not in entries:
        entries |= texts_of(_greatest_error(original, signals[0]))
    return entries | dict(remarks)


def _greatest_error(original: Motion, decoded: Signal) -> JsonObject:
    """The greatest error of a channel, without whole turns, and its frame and channel."""
    skeleton, signal = original.skeleton, original.signals[0]
    source_values, decoded_values = (
        np.asarray(one.masked(), np.float64) for one in (signal, decoded)
    )
    with np.errstate(all="ignore"):  # overflow is no figure
        errors = channel_errors(skeleton, signal, source_values, decoded_values)
    errors[~np.isfinite(errors)] = -1.0
    if not errors.size or errors.max() < 0:
        return {}
    row, column = divmod(int(errors.argmax()), errors.shape[1])
    found_at = row // signal.samples_per_frame
    own = signal.channels
    name = skeleton.channel_addresses()[column] if own is None else own[column].label
    figures = (float(errors[row, column]), found_at, name)
    return dict(zip(NOT_STORED, figures, strict=True))


def quality_payload(entries: Mapping[str, str]) -> bytes:
    stored = {key: value for key, value in entries.items() if key not in NOT_STORED}
    return build(payloads.Qual(entries=payloads.metadata_records(stored)), "quality record")


def quality_entries(
    original: Motion, decoded: Motion, codec_name: str, options: Params
) -> dict[str, str]:
    """Settings, then figures, as text; None is left out.

    Numbers are the shortest decimals that read back as the same binary64.
    """
    settings = {f"param.{name}": value for name, value in options.items()}
    return texts_of({"codec": codec_name, **settings, **figures(original, decoded)})


def figures(original: Motion, decoded: Motion) -> JsonObject:
    """The figures of a record by their metric ids, rounded; None if there is none."""
    contacts = bool(find_feet(original.skeleton))
    entries = compare(original, decoded, contacts=contacts).entries()
    # Ten significant digits are more than measures agree on, in fewer bytes.
    return {
        key: float(f"{value:.10g}") if isinstance(value, float) else value
        for key, value in entries.items()
        if key not in LEFT_OUT
    }


def texts_of(entries: Params) -> dict[str, str]:
    """Settings or figures as text, without those that are None."""
    return {key: _text(value) for key, value in entries.items() if value is not None}


def with_values(signal: Signal, values: Values) -> Signal:
    """``signal`` with decoded values, which need not lie on its grids."""
    return replace(
        signal,
        values=np.asarray(values, np.float64),
        grids=(),
        grid_changes=(),
        exceptions=Exceptions(),
        ordinals=None,
    )


def _text(value: object) -> str:
    """
    >>> _text(0.1), _text(3), _text(True), _text((1.0, -0.5))
    ('0.1', '3', 'true', '1.0,-0.5')
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, (tuple, list)):
        return ",".join(map(_text, value))
    return str(value)
