"""A signal of a clip: its facts from CLIP, checked, and the segments of it that can be decoded.

SPEC.md, "CLIP" and "Salvage", are normative.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, partial
from typing import Any

from mcz.codecs import CODECS, codec_by_id
from mcz.codecs.contract import Codec, Layout, Model, Span
from mcz.container import payloads
from mcz.container.chunks import FRAME, ChunkType
from mcz.container.directory import ClipRow, SegmentRow
from mcz.container.limits import check
from mcz.container.model_records import parse_channels
from mcz.container.reader import Container
from mcz.container.segments import FRAME_NOTES, FRESH, StreamCounts, frame_table
from mcz.errors import FormatError, UnsupportedError, error_context
from mcz.model.clock import TIMES, times_signal_fault
from mcz.model.identity import IdentityCache
from mcz.model.motion import ROLES, Channel, Skeleton
from mcz.model.numbers import Grid, GridKind


@dataclass(frozen=True)
class SignalInfo:
    """Facts of one signal from CLIP, and the places of its segments.

    ``layout`` and ``rows`` count stored frames, of which the clip shows those from ``skip`` on.
    """

    index: int
    name: str
    channels: tuple[Channel, ...] | None
    grids: tuple[Grid, ...]
    codec_id: int
    preset: int
    codec_version: int
    header: bytes
    layout: Layout
    counts: StreamCounts
    rows: tuple[SegmentRow, ...]
    skip: int = 0
    spare: int = 0
    role: str = ""
    of: int | None = None
    own_codec: Codec | None = None  # of a signal that is being written: it need not be in the table

    @property
    def has_poses(self) -> bool:
        """True of a motion with the channels of its skeleton."""
        return self.role == "motion" and self.channels is None

    @property
    def samples_per_frame(self) -> int:
        return self.layout.samples_per_frame

    @cached_property
    def codec(self) -> Codec:
        """The codec; raises UnsupportedError if this reader lacks it."""
        return self.own_codec or codec_by_id(self.codec_id, self.codec_version, self.preset)

    @cached_property
    def exact(self) -> tuple[int, ...]:
        """The groups of ordinals of a codec of values."""
        return self.codec.exact(self.header, self.layout) if self.codec.exact else ()

    @cached_property
    def is_integer(self) -> bool:
        # GRID-10
        return bool(self.grids) and all(grid.kind == GridKind.INTEGER for grid in self.grids)

    @cached_property
    def spans(self) -> list[Span]:
        headers = [row.header for row in self.rows]
        return [Span(h.first, h.n_frames, h.lead, h.tail, bool(h.flags & FRESH)) for h in headers]

    @cached_property
    def columns(self) -> list[int]:
        """The channels of all groups, one group after the other."""
        return [channel for group in self.layout.groups for channel in group]

    @cached_property
    def coded_grids(self) -> tuple[Grid, ...]:
        """The grids of ``columns``."""
        grids = self.layout.grids
        is_ordered = self.columns == list(range(len(grids)))
        return grids if is_ordered else tuple(grids[column] for column in self.columns)

    def covering(self, start: int, stop: int) -> range:
        """The segments whose own frames overlap the stored frames start <= f < stop."""
        low = bisect_right(self.rows, start, key=lambda row: row.header.stop)
        return range(low, bisect_left(self.rows, stop, key=lambda row: row.header.first))

    def coarser(self, resolution: int) -> int:
        """The number of details to leave out of a signal other than the motion: at most all."""
        return min(resolution, self.counts.n_resolutions - 1)


def read_signal(
    container: Container,
    row: ClipRow,
    fields: Any,
    index: int,
    skeleton: Skeleton,
    frame_rate: Fraction | None,
) -> SignalInfo:
    """The checked SignalInfo of signal ``index`` of a clip; ``fields`` are those of CLIP.

    Raises FormatError or LimitError.
    """
    where = f"clip {row.name!r}, signal {index}"
    own = fields.signals[index]
    channels = None
    if own.flags & payloads.OWN_CHANNELS:
        channels = parse_channels(own.channels)
    coded: Skeleton | None = skeleton
    if channels is not None:  # CLIP-09, PWAVE-04
        coded = None
    n_channels = skeleton.n_channels if channels is None else len(channels)
    check(f"{where}: channels", n_channels, container.profile.channels)
    with error_context(where=where):
        groups, grids = _partition(own, coded)
    layout = Layout(
        own.skip + row.n_frames + own.spare,
        groups,
        own.samples_per_frame,
        coded,
        frame_rate,
        grids,
        own.n_resolutions,
        find_model=partial(_model, container, row.clip.offset),
    )
    info = SignalInfo(
        index,
        own.name,
        channels,
        layout.grids,
        own.codec,
        own.preset,
        own.codec_version,
        bytes(own.header),
        layout,
        StreamCounts(len(layout.groups), own.n_resolutions),
        tuple(segment for segment in row.segments if segment.header.signal == index),  # DATA-08
        own.skip,
        own.spare,
        role_name(own.role),
        own.of,
    )
    if info.role == TIMES:
        _check_times(info, where)
    _check_segments(container, info, index == 0 and bool(fields.source), where)
    return info


def _read_partition(
    own: payloads.Signal, skeleton: Skeleton | None
) -> tuple[tuple[tuple[int, ...], ...], tuple[Grid, ...]]:
    """The groups of a signal, and the grids of its channels; its own, or of ``skeleton``."""
    n_channels = len(own.channels or ()) if skeleton is None else skeleton.n_channels
    return parse_groups(own.groups, skeleton, n_channels), parse_grids(own.grids, n_channels)


_partition = IdentityCache(_read_partition)


def role_name(role: int) -> str:
    """The name of a role of the registry, "" for another."""
    return ROLES[role] if role < len(ROLES) else ""  # ROLE-06


def check_roles(signals: Sequence[payloads.Signal], where: str) -> None:
    """Raise FormatError for roles that signals of one clip cannot have."""
    roles = [signal.role for signal in signals]
    if payloads.MOTION in roles[1:]:  # ROLE-01
        raise FormatError(f"{where}: only the first signal can be a motion")
    if roles.count(payloads.TIMES) > 1:  # ROLE-02
        raise FormatError(f"{where}: more than one signal of times")
    for index, signal in enumerate(signals):
        if signal.of is not None and (signal.of >= len(signals) or signal.of == index):  # ROLE-05
            raise FormatError(
                f"{where}: signal {index} has residuals of signal {signal.of}, which is "
                "itself or does not exist"
            )


def _check_times(info: SignalInfo, where: str) -> None:
    fault = times_signal_fault(info)
    codec = CODECS.find(info.codec_id, info.preset)
    if not fault and codec is not None and not CODECS[codec].lossless:  # ROLE-03
        fault = f"codec {info.codec_id} is lossy"
    if fault:
        raise FormatError(f"{where}: invalid signal of times: {fault}")


def read_segments(container: Container, info: SignalInfo) -> None:
    """Read the segments of a signal that cannot be decoded: their tables can still be read."""
    for row in info.rows:
        container.streams(row, info.counts, None)


def _model(container: Container, before: int, id_: bytes) -> Model | None:
    """The model with this id, None if the file has none before this offset, the clip's."""
    chunk = container.directory.shared.get((ChunkType.MODL, id_))
    if chunk is None or chunk.offset > before:  # GRAM-10
        return None
    fields = container.model(id_)
    return Model(fields.kind, bytes(fields.data))


def _check_segments(container: Container, info: SignalInfo, noted: bool, where: str) -> None:
    """``noted``: frame notes are legal."""
    limit = container.profile.segment_bytes
    per_frame = max(1, info.layout.n_channels) * info.layout.samples_per_frame * 8
    frame = 0
    for row in info.rows:
        if row.packet == FRAME:
            # refuses an impossible packet
            frame_table(row.header, info.counts, row.size, 0)
        if row.header.flags & FRAME_NOTES and not noted:  # NOTES-01
            raise FormatError("frame notes need a source, and the clip has none", where=where)
        if not (row.header.first or row.header.flags & FRESH):  # DATA-12
            raise FormatError("the first segment depends on an earlier one", where=where)
        check(f"{where}: bytes of a segment", row.header.n_frames * per_frame, limit)
        n_rows = row.header.n_frames * info.layout.samples_per_frame
        check(f"{where}: rows of a segment", n_rows, container.profile.rows)  # LIMIT-19
        if row.header.first != frame and not container.salvage:
            raise FormatError(
                f"a segment begins at frame {row.header.first}; expected {frame}", where=where
            )
        frame = row.header.stop
    if frame != info.layout.n_frames and not container.salvage:
        raise FormatError(
            f"the segments end at frame {frame} of {info.layout.n_frames}", where=where
        )


def parse_groups(
    fields: Any, skeleton: Skeleton | None, n_channels: int
) -> tuple[tuple[int, ...], ...]:
    """The channels of each group, as the ``kind`` of GROUPS defines them."""
    if fields.kind == payloads.GROUP_ALL:
        return (tuple(range(n_channels)),) if n_channels else ()
    if fields.kind == payloads.GROUP_JOINT:
        if skeleton is None:
            raise FormatError("channels are grouped by joint, but belong to no joints")
        sizes = [len(joint.channels) for joint in skeleton.joints]
    elif fields.kind == payloads.GROUP_CHANNEL:
        sizes = [1] * n_channels  # CLIP-08
    else:
        sizes = list(fields.sizes)
        if 0 in sizes or sum(sizes) != n_channels:  # CLIP-10, CLIP-11
            raise FormatError(f"group sizes {sizes} do not add up to {n_channels} channels")
    groups, at = [], 0
    for size in sizes:
        if size:  # CLIP-08
            groups.append(tuple(range(at, at + size)))
        at += size
    return tuple(groups)


def parse_grids(runs: Any, n_channels: int) -> tuple[Grid, ...]:
    grids: list[Grid] = []
    for run in runs:
        if not 1 <= run.n_channels <= n_channels - len(grids):  # CLIP-06, CLIP-07
            raise FormatError(f"grids are given for more than its {n_channels} channels")
        grids += [run.grid] * run.n_channels
    if len(grids) != n_channels:  # CLIP-07
        raise FormatError(f"grids are given for {len(grids)} of {n_channels} channels")
    return tuple(grids)


def groups_of(layout: Layout, columns: Sequence[int]) -> tuple[tuple[int, ...], list[int]]:
    """The groups with ``columns``, and the place of each column among theirs."""
    group_of = {c: g for g, group in enumerate(layout.groups) for c in group}
    groups = tuple(dict.fromkeys(sorted(group_of[c] for c in columns)))
    column = {c: i for i, c in enumerate(c for g in groups for c in layout.groups[g])}
    return groups, [column[c] for c in columns]


LOST_BEFORE = "they need earlier frames, which are lost"
Run = tuple[int, int]  # segments first <= i < last
Complain = Callable[[int, int, object], None]


def salvage(
    spans: Sequence[Span],
    segments: range,
    frames: tuple[int, int],
    rescue: Callable[[int, int], None],
    complain: Complain,
) -> None:
    """Let ``rescue`` decode all frames a <= f < b of ``segments`` that can be decoded.

    ``rescue`` raises FormatError for a range that cannot be; it is halved until the bad segments
    are known. ``complain`` gets lost frames and the reason. The cost is one decoding, and a few
    more for each bad segment.
    """
    lead = max((span.lead for span in spans), default=0)
    for run in _runs(spans, segments, complain):
        todo = [run]
        while todo:
            first, last = todo.pop()
            a, b = max(frames[0], spans[first].first), min(frames[1], spans[last - 1].stop)
            try:
                rescue(a, b)
            except UnsupportedError:
                raise
            except FormatError as error:
                if last - first > 1:
                    middle = (first + last) // 2
                    todo += [(middle, last), (first, middle)]
                    continue
                # Frames that the segment after affects may be lost with it; others are not.
                complain(a, b, error)
                _rescue_start(rescue, a, max(a, spans[first].stop - lead), b, complain)
                todo = _without_bad_segment(spans, todo, first, complain)


def _rescue_start(
    rescue: Callable[[int, int], None], start: int, stop: int, candidate: int, complain: Complain
) -> None:
    if stop >= candidate:
        return
    try:
        rescue(start, stop)
    except FormatError as error:
        complain(start, stop, error)


def _without_bad_segment(
    spans: Sequence[Span], todo: list[Run], bad: int, complain: Complain
) -> list[Run]:
    last = max((run[1] for run in todo), default=0)
    after = bad + 1
    while after < last and not spans[after].fresh:
        after += 1
    if after > bad + 1:
        complain(spans[bad + 1].first, spans[after - 1].stop, LOST_BEFORE)
    return [(max(first, after), stop) for first, stop in todo if stop > after]


def _runs(spans: Sequence[Span], segments: range, complain: Complain) -> list[Run]:
    """Runs of neighbors among ``segments``, each from a fresh one on."""
    start = segments.start
    while start > 0 and start < len(spans) and not spans[start].fresh:
        start -= 1
    runs: list[Run] = []
    usable, lost = False, None
    for index in range(start, segments.stop):
        joined = index > start and spans[index - 1].stop == spans[index].first
        usable = spans[index].fresh or (joined and usable)
        if index < segments.start:
            continue
        if not usable:
            lost = spans[index].first if lost is None else lost
            continue
        if lost is not None:
            complain(lost, spans[index - 1].stop, LOST_BEFORE)
            lost = None
        if runs and runs[-1][1] == index and joined:
            runs[-1] = (runs[-1][0], index + 1)
        else:
            runs.append((index, index + 1))
    if lost is not None:
        complain(lost, spans[segments.stop - 1].stop, LOST_BEFORE)
    return runs
