"""Motion -> chunks: what a clip says of itself, its segments, its hashes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from mcz.clock import TIMES
from mcz.codecs import by_name
from mcz.codecs.contract import Codec, Encoded, Segment
from mcz.codecs.parameters import TARGETS
from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.limits import ARCHIVE, check
from mcz.container.packed import pack_skeleton
from mcz.container.segments import FRAME_NOTES, FRESH, GROUP_NOTES, MASKS, SegmentHeader
from mcz.container.skeletons import build_skeleton, channel_records
from mcz.container.strict import is_plain_path
from mcz.container.time_base import put_time_base, time_base_of
from mcz.container.writer import Writer
from mcz.errors import MotionError, OptionError
from mcz.formats import FORMATS
from mcz.motion import ROLES, Motion, Skeleton, Source
from mcz.schema import MAX_COUNT, build
from mcz.types import JsonObject, Params, Progress, Values
from mcz.writing.clip_check import ClipCopy, Coded
from mcz.writing.quality import CHUNK, quality_payload, quality_record
from mcz.writing.signal_source import MemorySource, as_stored
from mcz.writing.sources import with_source_hash

BESIDE = "lossless"  # the codec of all signals but the motion, where that one is lossy
# (entries of a quality record, decoded values of each signal) -> its entries
Amend = Callable[[dict[str, str], Sequence[Values]], dict[str, str]]


def write_skeleton(writer: Writer, skeleton: Skeleton) -> bytes:
    """Write SKEL, after the SRCE of its own file if it has one; return its id."""
    given = skeleton
    if writer.last_skeleton is not None and writer.last_skeleton[0] is given:
        id_ = writer.last_skeleton[1]
        if (ChunkType.SKEL, id_) in writer.directory.shared:  # not taken back with what failed
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
    writer.last_skeleton = given, id_
    return id_


def write_clip(
    writer: Writer,
    motion: Motion,
    codec: Codec,
    params: Params,
    progress: Progress | None = None,
    *,
    quality: bool = True,
    remarks: Mapping[str, str] = MappingProxyType({}),
    amend: Amend | None = None,
) -> dict[str, str] | None:
    """Write one clip: its skeleton and template if new, CLIP, segments, CEND, quality if lossy.

    Returns what the quality record says, None where there is none.

    A lossy codec takes the motion alone; further signals stay lossless. ``remarks`` join the
    quality record, ``amend`` has the last word on it. Raises OptionError for a bad parameter or a
    target that nobody has met yet (see ``tuning.py``), MotionError for values that the codec cannot
    hold.
    """
    options = codec.options(params, inner=True)
    if codec.dial and asked(options) and options[codec.dial.parameter] is None:
        raise OptionError(f"{', '.join(asked(options))}: {codec.dial.parameter} is not yet found")
    counted = motion.counted_by_ones()
    motion = as_stored(with_source_hash(counted, lossless=codec.lossless))
    for signal in motion.signals:
        check(f"signal {signal.name!r}: channels", signal.n_channels, writer.profile.channels)
    coded = [
        _coded(motion, index, codec, options, writer.profile.segment_bytes)
        for index in range(len(motion.signals))
    ]
    for part in coded:
        _write_models(writer, part.encoded)
    record = _clip_record(writer, motion, coded)
    copy, n_channels = ClipCopy(writer.profile), [signal.n_channels for signal in motion.signals]
    for part in coded:
        _write_models(copy.writer, part.encoded)
    for each in (writer, copy.writer):
        each.begin_clip(record, n_channels)
    for index, part in enumerate(coded):
        _write_signal((writer, copy), motion, index, part, progress)
    decoded = copy.decoded(motion, coded)
    sha256 = motion.source.sha256 if motion.source else b""
    writer.end_clip(motion.n_frames, sha256, [signal.sha256 for signal in decoded])
    if quality and not codec.lossless:
        settings, values = codec.settings(options), [signal.values for signal in decoded]
        quality_entries = quality_record(motion, values, codec.name, settings, remarks)
        quality_entries = amend(quality_entries, values) if amend else quality_entries
        writer.ancillary(CHUNK, quality_payload(quality_entries))
        return quality_entries
    return None


def open_clip(
    writer: Writer, motion: Motion, codec: Codec, encoded: Encoded, first_number: int = 1
) -> None:
    """Write the CLIP, and what it refers to, of a motion of which no frame is known yet.

    ``first_number`` is that of its first frame.
    """
    check("channels", motion.signals[0].n_channels, writer.profile.channels)
    _write_models(writer, encoded)
    source = MemorySource(motion, 0, codec, writer.profile.segment_bytes)
    record = _clip_record(writer, motion, [Coded(source, codec, encoded)])
    record.flags |= payloads.OPEN_CLIP
    put_time_base(record, time_base_of(np.array([first_number], np.int64), None))
    writer.begin_clip(record, [motion.signals[0].n_channels])


def _write_models(writer: Writer, encoded: Encoded) -> None:
    """Write the models that a signal needs; well-known ones where all shall be in the file."""
    known = encoded.known if writer.profile is ARCHIVE else ()
    for model in (*encoded.models, *known):
        record = payloads.Modl(kind=model.kind, data=model.data)
        writer.shared(ChunkType.MODL, build(record, "MODL"))


def asked(options: Params) -> JsonObject:
    """The targets among the options of a codec."""
    return {t.name: options[t.name] for t in TARGETS if options.get(t.name) is not None}


def _coded(motion: Motion, index: int, codec: Codec, options: Params, segment_bytes: int) -> Coded:
    if index and not codec.lossless:
        codec = by_name(BESIDE)
        options = codec.options({})
    signal = motion.signals[index]
    if not codec.lossless and signal.channels is not None:
        raise MotionError(f"codec {codec.name}: signal {signal.name!r} has channels of its own")
    if codec.domain == "values" and signal.values.dtype == np.int64:
        raise MotionError(f"codec {codec.name}: signal {signal.name!r} is one of integers")
    source = MemorySource(motion, index, codec, segment_bytes, options)
    if codec.domain == "values" and source.signal.values.dtype == np.int64:
        raise MotionError(f"signal {source.signal.name!r}: codec {codec.name} holds no integers")
    return Coded(source, codec, codec.encode(source, options))


def _write_signal(
    outs: tuple[Writer, ClipCopy],
    motion: Motion,
    index: int,
    coded: Coded,
    progress: Progress | None,
) -> None:
    """Write the segments of a signal, to the file and to the copy that is decoded."""
    for segment in coded.encoded.segments:
        header, streams = _segment(outs[0], motion, index, coded.source, segment)
        for out in outs:
            out.segment(header, streams)
        if progress is not None:
            progress(segment.first + segment.n_frames, motion.n_frames, motion.name)


def _clip_record(writer: Writer, motion: Motion, coded: Sequence[Coded]) -> payloads.Clip:
    rate = motion.frame_rate
    if rate is not None and max(rate.numerator, rate.denominator) > MAX_COUNT:
        raise MotionError(f"frame rate {rate} has a term beyond 2^53 - 1")
    record = payloads.Clip(
        name=motion.name,
        flags=0 if motion.frame_rate_exact else payloads.ROUNDED_RATE,
        skeleton=write_skeleton(writer, motion.skeleton),
        n_frames=motion.n_frames,
        rate_numerator=rate.numerator if rate else 0,
        rate_denominator=rate.denominator if rate else 1,
        metadata=payloads.metadata_records(dict(sorted(motion.metadata.items()))),
        source=_source_record(writer, motion.source) if motion.source else None,
        signals=[_signal_record(part.source, part.codec, part.encoded) for part in coded],
    )
    first_time = None if motion.signals_of(TIMES) else motion.first_time
    put_time_base(record, time_base_of(motion.frame_numbers, first_time))
    return record


def _source_record(writer: Writer, source: Source) -> payloads.ClipSource:
    format_id = FORMATS[source.format].id
    if source.path and not is_plain_path(source.path):
        raise MotionError(f"source path {source.path!r} is not relative and plain")
    return payloads.ClipSource(
        template=writer.template(format_id, source.template),
        format=format_id,
        detail=source.detail,
        path=source.path,
        size=source.size,
    )


def _signal_record(source: MemorySource, codec: Codec, part: Encoded) -> payloads.Signal:
    signal = source.signal
    kinds = {"all": payloads.GROUP_ALL, "joint": payloads.GROUP_JOINT}
    own = signal.channels is not None
    kind = kinds.get(codec.grouping, payloads.GROUP_CHANNEL)
    if own and codec.grouping == "joint":
        kind = payloads.GROUP_CHANNEL
    kind = payloads.GROUP_LISTED if source.is_listed else kind
    sizes = [len(group) for group in source.layout.groups] if source.is_listed else None
    return payloads.Signal(
        name=signal.name,
        flags=payloads.OWN_CHANNELS if own else 0,
        role=ROLES.index(signal.role or ""),
        of=signal.of,
        channels=channel_records(signal.channels) if signal.channels is not None else None,
        samples_per_frame=signal.samples_per_frame,
        grids=payloads.grid_runs(signal.grids),
        codec=codec.id,
        codec_version=codec.version if part.version is None else part.version,
        header=part.header,
        groups=payloads.Groups(kind=kind, sizes=sizes),
        n_resolutions=part.n_resolutions,
    )


def _segment(
    writer: Writer, motion: Motion, index: int, source: MemorySource, segment: Segment
) -> tuple[SegmentHeader, list[bytes]]:
    """Header and streams of a segment: its notes, its masks, and what the codec made."""
    start, stop = segment.first, segment.first + segment.n_frames
    per_frame = 8 * source.layout.samples_per_frame * max(1, source.layout.n_channels)
    size = segment.n_frames * per_frame
    check(f"frames {start}:{stop}: decoded bytes", size, writer.profile.segment_bytes)
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
        flags |= GROUP_NOTES
        streams += group_notes
    masks = source.masks(start, stop)
    if any(masks):
        flags |= MASKS
        streams += masks
    streams += segment.streams
    header = SegmentHeader(index, start, segment.n_frames, segment.lead, segment.tail, flags)
    return header, streams
