"""Cuts of stored clips by frames, joints or resolutions.

SPEC.md, "Cutting without re-encoding", is normative. ``extraction.py`` writes the cuts planned
here.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from mcz.codecs.contract import Span
from mcz.container import payloads
from mcz.container.directory import SegmentRow
from mcz.container.encodings import parse_skel
from mcz.container.limits import Profile
from mcz.container.model_records import put_time_base, time_base_of
from mcz.container.reader import Container
from mcz.container.segments import FRAME_NOTES, FRESH, GROUP_NOTES, MASKS, SegmentHeader
from mcz.errors import OptionError, error_context
from mcz.files.reading.clip import Clip
from mcz.files.reading.signal_info import SignalInfo
from mcz.hints import Hint
from mcz.model.clock import numbering_of, part_first_time
from mcz.model.motion import Skeleton
from mcz.model.schema import build
from mcz.model.skeleton import Chosen, Joints, joint_list
from mcz.model.types import Values

WITHOUT_SOURCE = "the source file was left out when joints were cut"
WITHOUT_CHANNELS = "the channels of other joints were cut"


@dataclass(frozen=True, slots=True)
class SignalCut:
    """A cut of one signal: segments, groups, and all but ``dropped`` finest resolutions.

    ``skip`` and ``spare`` belong to the cut signal.
    """

    info: SignalInfo
    rows: tuple[SegmentRow, ...]
    groups: tuple[int, ...]
    dropped: int
    skip: int
    spare: int

    @property
    def base(self) -> int:
        """The stored frame that becomes frame 0."""
        return self.rows[0].header.first if self.rows else 0

    @property
    def has_all_groups(self) -> bool:
        return len(self.groups) == self.info.counts.n_groups


@dataclass(frozen=True, slots=True)
class ClipCut:
    """A cut of one clip: frames start <= f < stop, these joints (None: all).

    ``signals`` are empty if it is encoded again.
    """

    clip: Clip
    start: int
    stop: int
    joints: frozenset[int] | None
    resolution: int
    signals: tuple[SignalCut, ...]
    is_recoded: bool = False  # decoded and encoded again

    @property
    def n_frames(self) -> int:
        return self.stop - self.start

    @property
    def has_all_frames(self) -> bool:
        return (self.start, self.stop) == (0, self.clip.n_frames)

    @property
    def is_whole(self) -> bool:
        return self.has_all_frames and self.joints is None and not self.resolution

    @property
    def names(self) -> tuple[str, ...] | None:
        """The addresses of the joints, None for all."""
        if self.joints is None:
            return None
        addresses = self.clip.skeleton.addresses()
        return tuple(addresses[joint] for joint in sorted(self.joints))


def plan_cut(
    clip: Clip,
    frames: tuple[int, int | None] | None,
    joints: Joints,
    resolution: int,
    is_recoded: bool = False,
) -> ClipCut:
    """Plan a cut of ``clip``; raises OptionError or MotionError for an impossible one.

    With ``is_recoded``, joints may be chosen that share a group with others, and no hidden frame is
    stored.
    """
    start, stop = frames if frames is not None else (0, None)
    stop = clip.n_frames if stop is None else stop
    if not 0 <= start <= stop <= clip.n_frames:
        raise OptionError(f"clip {clip.name!r} has {clip.n_frames} frames, not {start}:{stop}")
    motion = clip.signals[0]
    if not 0 <= resolution < motion.counts.n_resolutions:
        raise OptionError(
            f"cannot leave out the {resolution} finest resolutions: it has "
            f"{motion.counts.n_resolutions}",
            clip=clip.name,
        )
    indices = None if joints is None else _find_joints(clip, joints)
    cut = ClipCut(clip, start, stop, indices, resolution, ())
    groups = [tuple(range(info.counts.n_groups)) for info in clip.signals]
    if indices is not None:
        groups[0], mixed = groups_of(clip, indices)
        if mixed is not None and is_recoded:
            return replace(cut, is_recoded=True)
        if mixed is not None:
            raise shared_group_error(clip, *mixed, "cut out: its channels are coded")
    signals = list(map(partial(_plan_signal, cut), clip.signals, groups))
    if is_recoded and any(part.skip or part.spare for part in signals):
        return replace(cut, is_recoded=True)
    return replace(cut, signals=tuple(signals))


def _find_joints(clip: Clip, joints: Chosen) -> frozenset[int] | None:
    """The joints as indices, None if no joint with channels is left out."""
    skeleton = clip.skeleton
    if not clip.signals[0].has_poses:
        raise OptionError("its motion signal is not made of joints", clip=clip.name)
    with error_context(clip=clip.name):
        indices = frozenset(skeleton.find(joint) for joint in joint_list(joints))
    others = (joint for index, joint in enumerate(skeleton.joints) if index not in indices)
    return indices if any(joint.channels for joint in others) else None


def joint_of_column(skeleton: Skeleton) -> list[int]:
    return [index for index, joint in enumerate(skeleton.joints) for _ in joint.channels]


def groups_of(
    clip: Clip, joints: Collection[int]
) -> tuple[tuple[int, ...], tuple[int, int] | None]:
    """The groups with channels of these joints; one of these, and another joint in its group."""
    owners, groups = joint_of_column(clip.skeleton), []
    mixed = None
    for number, columns in enumerate(clip.signals[0].layout.groups):
        inside = {owners[column] for column in columns if owners[column] in joints}
        outside = {owners[column] for column in columns} - inside
        if inside:
            groups.append(number)
            mixed = mixed or ((min(inside), min(outside)) if outside else None)
    return tuple(groups), mixed


def shared_group_error(clip: Clip, joint: int, other: int, text: str) -> OptionError:
    """The error for a joint that shares a group with another, and the way out."""
    names, codec = clip.skeleton.addresses(), clip.signals[0].codec
    return OptionError(
        f"joint {names[joint]} cannot be {text} together with those of {names[other]}",
        clip=clip.name,
        hint=Hint.RECODE if codec.lossless else Hint.RECODE_LOSSY,
    )


def _plan_signal(cut: ClipCut, info: SignalInfo, groups: tuple[int, ...]) -> SignalCut:
    dropped = info.coarser(cut.resolution)
    if cut.is_whole:
        return SignalCut(info, info.rows, groups, 0, info.skip, info.spare)
    start, stop = cut.start + info.skip, cut.stop + info.skip
    rows = _needed_rows(info, start, stop)
    if not rows:
        return SignalCut(info, (), groups, dropped, 0, 0)
    skip, spare = start - rows[0].header.first, rows[-1].header.stop - stop
    return SignalCut(info, rows, groups, dropped, skip, spare)


def _needed_rows(info: SignalInfo, start: int, stop: int) -> tuple[SegmentRow, ...]:
    """The segments that affect the stored frames start <= f < stop, and those they need."""
    hits = [
        index
        for index, row in enumerate(info.rows)
        if row.header.first - row.header.lead < stop and start < row.header.stop + row.header.tail
    ]
    if start == stop or not hits:
        return ()
    first = hits[0]
    while not info.rows[first].header.flags & FRESH:
        first -= 1
    return info.rows[first : hits[-1] + 1]


def clip_record(cut: ClipCut, skeleton: bytes, record: payloads.Clip) -> payloads.Clip:
    """The CLIP of the cut clip, its source not yet changed; ``record``: the old one."""
    metadata = payloads.metadata_pairs(record.metadata)
    if cut.joints is not None:
        add_note(metadata, "skeleton-note", WITHOUT_CHANNELS)
    new = replace(
        record,
        flags=record.flags & ~payloads.OPEN_CLIP,
        skeleton=skeleton,
        n_frames=cut.n_frames,
        metadata=_sorted_records(metadata),
        signals=[
            _signal_record(part, own) for part, own in zip(cut.signals, record.signals, strict=True)
        ],
    )
    clip, numbers = cut.clip, cut.clip.frame_numbers[cut.start : cut.stop]
    first_time = None
    if clip.first_time is not None:
        first_time = part_first_time(clip.first_time, clip.timeline, cut.start, cut.stop)
    put_time_base(new, time_base_of(numbers, first_time))
    if cut.joints is not None:
        keep_times(cut, new)
    return new


def _sorted_records(metadata: Mapping[str, str]) -> list[payloads.Metadata]:
    return payloads.metadata_records(dict(sorted(metadata.items())))


def note_source(record: payloads.Clip, text: str, cut: ClipCut | None = None) -> None:
    """Add ``text`` to the ``source-note`` of a clip; ``cut``: keep its times in its numbers."""
    if cut is not None:
        keep_times(cut, record)
    metadata = payloads.metadata_pairs(record.metadata)
    add_note(metadata, "source-note", text)
    record.metadata = _sorted_records(metadata)


def keep_times(cut: ClipCut, record: payloads.Clip) -> None:
    """Set the time base of a cut to its times, since its source may be gone."""
    if cut.clip.timeline is None or not cut.n_frames:
        return
    frames = slice(cut.start, cut.stop)
    numbered = numbering_of(cut.clip.timeline.cut(frames), cut.clip.frame_numbers[frames])
    if numbered is not None:
        put_time_base(record, time_base_of(numbered.numbers, numbered.first_time))


def add_note(metadata: dict[str, str], key: str, text: str) -> None:
    """Append ``text`` to the metadata value of ``key``, once."""
    old = metadata.get(key, "")
    if text not in old:
        metadata[key] = f"{old}; {text}" if old else text


def _signal_record(part: SignalCut, record: payloads.Signal) -> payloads.Signal:
    info = part.info
    header = info.header
    n_stored = sum(row.header.n_frames for row in part.rows)
    stored_all = n_stored == info.layout.n_frames and part.has_all_groups
    if not stored_all and info.codec.cut is not None:
        stop = part.rows[-1].header.stop if part.rows else part.base
        header = info.codec.cut(header, info.layout, part.base, stop, part.groups)
    sizes = record.groups.sizes
    if sizes is not None:
        sizes = [len(info.layout.groups[group]) for group in part.groups]
    columns = [column for group in part.groups for column in info.layout.groups[group]]
    return replace(
        record,
        skip=part.skip,
        spare=part.spare,
        grids=payloads.grid_runs([info.grids[column] for column in columns]),
        header=header,
        groups=replace(record.groups, sizes=sizes),
        n_resolutions=record.n_resolutions - part.dropped,
    )


class Unchanged:
    """The streams of a segment, unchanged; an edit has others."""

    def group_data(self, flag: int, group: int, old: bytes) -> bytes:
        """Group notes or a mask, by ``flag``."""
        return old

    def coded(self, resolution: int, group: int, old: bytes) -> bytes:
        """A stream of the codec."""
        return old


UNCHANGED = Unchanged()


def cut_segment(
    container: Container,
    part: SignalCut,
    row: SegmentRow,
    *,
    noted: bool,
    edit: Unchanged = UNCHANGED,
) -> tuple[SegmentHeader, list[bytes], bytes]:
    """Header, streams and extension of a cut segment; ``noted``: with frame notes.

    Its chunk is read whole, so that damage is found and not copied.
    """
    table, streams = container.streams(row, part.info.counts, None)
    header, kept = row.header, []
    flags = header.flags & ~(FRAME_NOTES | GROUP_NOTES | MASKS)
    index = table.frame_notes()
    if noted and index is not None:
        flags |= FRAME_NOTES
        kept.append(streams[index])
    for flag, stream_of in ((GROUP_NOTES, table.group_notes), (MASKS, table.mask)):
        numbers = [(group, stream_of(group)) for group in part.groups]
        cut_streams = [
            edit.group_data(flag, group, b"" if number is None else streams[number])
            for group, number in numbers
        ]
        if any(cut_streams) or (cut_streams and header.flags & flag):
            flags |= flag
            kept += cut_streams
    if not part.has_all_groups and part.info.codec.subset is not None:
        span = Span(row.header.first, row.header.n_frames)

        def fetch(_: int, resolution: int, group: int) -> bytes:
            return streams[table.codec(resolution, group)]

        kept += part.info.codec.subset(part.info.layout, span, part.groups, fetch)
        return _cut_header(part, row, flags), kept, table.extension
    for resolution in range(part.info.counts.n_resolutions - part.dropped):
        for group in part.groups:
            stream = streams[table.codec(resolution, group)]
            kept.append(edit.coded(resolution, group, stream))
    return _cut_header(part, row, flags), kept, table.extension


def _cut_header(part: SignalCut, row: SegmentRow, flags: int) -> SegmentHeader:
    header = row.header
    first = header.first - part.base
    lead = min(header.lead, first)
    return SegmentHeader(part.info.index, first, header.n_frames, lead, header.tail, flags)


def cut_skeleton(payload: bytes, id_: bytes, joints: frozenset[int], profile: Profile) -> bytes:
    """The payload of a SKEL whose other joints have no channels; ``id_`` is its base's."""
    fields = parse_skel(payload, f"SKEL {id_.hex()}", profile)
    for index, joint in enumerate(fields.joints):
        if index not in joints:
            joint.channels = []
    return build(replace(fields, base=id_, source=None), "skeleton")


def cut_quality(cut: ClipCut, old: Mapping[str, str]) -> dict[str, str]:
    """The entries of the quality record of a cut clip; ``old`` are those of the original clip.

    All are as stored: a cut leaves each joint its index. Impossible entries on a former cut are
    ignored. docs/guides/parts.md, "Keys of cuts", has their meaning.
    """
    now = _cut_entries(cut, old)
    for key, value in old.items():
        if key.startswith(("param.", "uncut_")) or key in ("codec", "edit-joints"):
            now[key] = value
        elif not key.startswith("cut-"):
            now[f"uncut_{key}"] = value
    return now


def recoded_quality(
    cut: ClipCut, old: Mapping[str, str], now: dict[str, str], _: Sequence[Values]
) -> dict[str, str]:
    """The entries for a clip that was cut and encoded again; ``now`` are the new ones."""
    before = {k: v for k, v in cut_quality(cut, old).items() if not k.startswith("param.")}
    return before | {"cut-recoded": "yes"} | now


def _cut_entries(cut: ClipCut, old: Mapping[str, str]) -> dict[str, str]:
    now = {key: value for key, value in old.items() if key.startswith("cut-")}
    if cut.resolution:
        before = _first_number(old.get("cut-resolution", ""), 1)
        now["cut-resolution"] = str(before + cut.resolution)
    if not cut.has_all_frames:
        start = _first_number(old.get("cut-frames", ""), 2)
        now["cut-frames"] = f"{start + cut.start}:{start + cut.stop}"
    if cut.joints is not None:
        now["cut-joints"] = ",".join(map(str, sorted(cut.joints)))
    return now


def _first_number(text: str, count: int) -> int:
    """The first of ``count`` numbers with colons between them, 0 for another text."""
    words = text.split(":")
    good = len(words) == count and all(re.fullmatch("[0-9]{1,16}", word) for word in words)
    return int(words[0]) if good else 0
