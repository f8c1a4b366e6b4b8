"""Decode a joint or a whole clip and encode it again; no file is written here.

``replacing.py`` uses both, ``extraction.py`` the latter. SPEC.md, "Cutting without re-encoding"
and "Replacing a joint", are normative.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcz.codecs.contract import Codec, RecodeRequest, Request
from mcz.codecs.parameters import TARGETS
from mcz.errors import MotionError, OptionError
from mcz.files.editing.cutting import (
    WITHOUT_CHANNELS,
    ClipCut,
    add_note,
    groups_of,
    joint_of_column,
    shared_group_error,
)
from mcz.files.reading.clip import Clip
from mcz.files.reading.signal_info import SignalInfo
from mcz.files.reading.signal_reader import SignalReader
from mcz.files.reading.source_files import stating_rate
from mcz.files.writing.clip_writer import with_values
from mcz.files.writing.signal_source import MAX_INTEGER, MemorySource, settle
from mcz.model.motion import Motion, Signal
from mcz.model.types import Settings
from mcz.sources import FORMATS

Streams = dict[tuple[int, int], tuple[bytes, ...]]  # (segment, group) -> by stored resolution


@dataclass(frozen=True, slots=True)
class Recoded:
    """One joint of a clip with other values, encoded.

    ``given`` is the requested motion, ``decoded`` the result of a reader. The sizes are those of
    the joint's own streams.
    """

    info: SignalInfo
    joint: int
    groups: tuple[int, ...]
    streams: Streams
    size: int
    size_before: int
    max_error: float
    given: Motion
    decoded: Motion
    source: MemorySource

    def side_data(self, start: int, stop: int) -> tuple[dict[int, bytes], dict[int, bytes]]:
        """Group notes and masks of the joint's groups for the segment start <= f < stop."""
        if self.info.codec.domain == "ordinals":
            self.source.ordinals(start, stop)  # computes the exceptions
        notes, masks = self.source.group_notes(start, stop), self.source.masks(start, stop)
        return self._streams_by_group(notes), self._streams_by_group(masks)

    def _streams_by_group(self, streams: Sequence[bytes]) -> dict[int, bytes]:
        return {group: streams[group] if streams else b"" for group in self.groups}


def recode_joint(clip: Clip, joint: int | str, values: ArrayLike, on_grid: bool) -> Recoded:
    """Encode the joint again, and decode it.

    Raises OptionError for a joint that cannot be edited, MotionError for bad values.
    """
    info = clip.signals[0]
    groups = _own_groups(clip, info, joint)
    edited = edit(clip, joint, values, on_grid)
    columns, motion = list(clip.skeleton.columns(edited.joint)), edited.motion
    signal = motion.signals[0]
    source = _codec_source(clip, info, signal)
    reader = SignalReader(clip.container, info, None, 0, clip.name)
    coded = groups if info.codec.subset is None else reader.groups
    streams = _recode_streams(clip, source, coded, reader)
    decoded = _decode_recoded(signal, source, streams, groups, reader)
    n_segments = range(len(info.rows))
    n_resolutions = range(info.counts.n_resolutions)
    with np.errstate(invalid="ignore"):  # infinities
        difference = np.abs(decoded.masked()[:, columns] - edited.given)
    return Recoded(
        info=info,
        joint=edited.joint,
        groups=groups,
        streams=streams,
        size=sum(len(s) for g in groups for i in n_segments for s in streams[i, g]),
        size_before=sum(
            len(reader.fetch(i, r, g)) for i in n_segments for r in n_resolutions for g in groups
        ),
        max_error=float(np.nanmax(difference, initial=0.0)),
        given=replace(motion, signals=(with_values(signal, signal.values), *motion.signals[1:])),
        decoded=replace(motion, signals=(decoded, *motion.signals[1:])),
        source=source,
    )


@dataclass(frozen=True, slots=True)
class Edited:
    """A decoded clip with other values for one joint; ``given`` are the requested ones."""

    joint: int
    motion: Motion
    given: NDArray[np.float64]


def edit(clip: Clip, joint: int | str, values: ArrayLike, on_grid: bool) -> Edited:
    """A clip with other values for one joint; raises as ``recode_joint``."""
    index = _check_editable(clip, joint)
    columns = list(clip.skeleton.columns(index))
    before = clip.motion()
    for info, signal in zip(clip.signals, before.signals, strict=True):
        clip.check_hash(info, signal.stored, signal.mask)
    checked = _check_values(clip, columns, values)
    signal = _edit_signal(clip, before, columns, checked, on_grid)
    return Edited(index, replace(before, signals=(signal, *before.signals[1:])), checked)


def _check_editable(clip: Clip, joint: int | str) -> int:
    """The index of a joint that may be edited."""
    if clip.container.salvage:
        raise OptionError("a damaged file opened with salvage cannot be edited", clip=clip.name)
    if not clip.signals[0].has_poses:
        raise OptionError("its motion signal is not made of joints", clip=clip.name)
    index = clip.skeleton.find(joint)
    if not clip.skeleton.joints[index].channels:
        name = clip.skeleton.addresses()[index]
        raise OptionError(f"joint {name} has no channels", clip=clip.name)
    return index


def is_coded_with_others(clip: Clip, joint: int | str) -> bool:
    """Return True if a group has channels of this joint and of another."""
    return groups_of(clip, (_check_editable(clip, joint),))[1] is not None


def _own_groups(clip: Clip, info: SignalInfo, joint: int | str) -> tuple[int, ...]:
    """The joint's groups, which contain no channel of another joint."""
    groups, mixed = groups_of(clip, (_check_editable(clip, joint),))
    if mixed is not None:
        text = f"replaced alone: codec {info.codec.name} codes its channels"
        raise shared_group_error(clip, *mixed, text)
    if info.codec.recode is None:
        raise OptionError(f"codec {info.codec.name} cannot re-encode a single joint")
    return groups


def _check_values(clip: Clip, columns: Sequence[int], values: ArrayLike) -> NDArray[np.float64]:
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        raise MotionError("the new values are not numbers", clip=clip.name) from None
    shape = clip.n_frames * clip.signals[0].layout.samples_per_frame, len(columns)
    if array.ndim == 1 and shape[1] == 1:
        array = array[:, None]
    if array.shape != shape:
        raise MotionError(f"expected values of {shape}, not {array.shape}", clip=clip.name)
    return array


def _edit_signal(
    clip: Clip, before: Motion, columns: Sequence[int], values: NDArray[np.float64], on_grid: bool
) -> Signal:
    """The motion signal with the new values; NaN is invalid and keeps the old value."""
    old = before.signals[0]
    valid = ~np.isnan(values)
    was_valid = np.ones(old.values.shape, np.bool_) if old.mask is None else old.mask
    differs = valid != was_valid[:, columns]
    if before.source is not None and differs.any():
        row, at = np.argwhere(differs)[0].tolist()
        now = "NaN" if not valid[row, at] else repr(float(values[row, at]))
        raise MotionError(
            f"frame {row // old.samples_per_frame} of "
            f"{clip.skeleton.channel_addresses()[columns[at]]} is {now}; its source file says "
            f"{'valid' if was_valid[row, columns[at]] else 'invalid'}",
            clip=clip.name,
        )
    new, mask = old.values.copy(), was_valid.copy()
    if new.dtype == np.int64:
        values = np.where(valid, values, 0.0)
        whole = np.rint(values)
        if (np.abs(whole) > MAX_INTEGER).any() or (not on_grid and (whole != values).any()):
            raise MotionError("the clip holds only integers up to 2^53", clip=clip.name)
        values = whole
    new[:, columns] = np.where(valid, values, new[:, columns])
    mask[:, columns] = valid
    signal = replace(old, values=new, mask=None if mask.all() else mask)
    if clip.signals[0].codec.domain == "values" or new.dtype == np.int64:
        return signal
    return _place_on_grids(clip, old, signal, on_grid)


def _place_on_grids(clip: Clip, old: Signal, signal: Signal, on_grid: bool) -> Signal:
    ordinals, exact = signal.to_ordinals()
    changed = signal.values.view(np.int64) != old.values.view(np.int64)
    stray = changed & ~exact
    if not stray.any():
        return signal
    values = signal.values.copy()
    for rows, columns, grid in signal.grid_blocks():
        block = stray[rows][:, columns]
        if not block.any() or (grid.is_text and not on_grid):
            continue
        row, at = np.argwhere(block)[0].tolist()
        label = (
            f"clip {clip.name!r}: frame {(row + rows.start) // signal.samples_per_frame} of "
            f"{clip.skeleton.channel_addresses()[columns[at]]}: its grid {grid.kind.name} does not "
            f"hold {values[row + rows.start, columns[at]]!r}"
        )
        if not on_grid:
            raise MotionError(f"{label}; use on_grid to round to the nearest value")
        placed = ordinals[rows][:, columns]
        nearest = grid.values(placed)
        present = values[rows][:, columns]
        beyond = (np.abs(placed) >= grid.limit) | ~np.isfinite(nearest) | ~np.isfinite(present)
        if (beyond & block).any():
            raise MotionError(f"{label}, nor a value near it")
        values[rows, columns] = np.where(block, nearest, present)
    return replace(signal, values=values)


def _codec_source(clip: Clip, info: SignalInfo, signal: Signal) -> MemorySource:
    """Source for the codec: all stored frames, with ``signal`` as the shown ones."""
    if info.skip or info.spare:
        signal = _with_hidden(clip, info, signal)
    motion = Motion(clip.skeleton, (signal,), name=clip.name)
    source = MemorySource(motion, 0, info.codec, info.layout.segment_bytes)
    source.layout = info.layout
    return source


def _with_hidden(clip: Clip, info: SignalInfo, shown: Signal) -> Signal:
    """``shown`` among the stored frames that are not shown.

    A lossy codec may be unable to decode the later ones: there the last frame is repeated.
    """
    per_frame, n_stored = info.layout.samples_per_frame, info.layout.n_frames
    start, stop = info.skip, n_stored - info.spare
    known = n_stored if info.codec.lossless else stop
    stored = SignalReader(clip.container, info, None, 0, clip.name).signal(0, known)
    rows = slice(start * per_frame, stop * per_frame)
    values = stored.values
    values[rows] = shown.values
    valid = np.ones(values.shape, np.bool_) if stored.mask is None else stored.mask
    valid[rows] = True if shown.mask is None else shown.mask
    n_held = n_stored - known
    values, valid = (
        np.concatenate([rows, *([rows[-per_frame:]] * n_held)]) for rows in (values, valid)
    )
    return replace(
        shown,
        values=values,
        mask=None if valid.all() else valid,
        exceptions=stored.exceptions,
        grid_changes=stored.grid_changes,
        ordinals=stored.ordinals if shown.ordinals is not None else None,
    )


def _recode_streams(
    clip: Clip, source: MemorySource, groups: tuple[int, ...], reader: SignalReader
) -> Streams:
    info = reader.info
    assert info.codec.recode is not None
    spans, options = info.spans, recorded_options(info.codec, clip.quality or {})
    coded = info.codec.recode(
        RecodeRequest(info.header, source, groups, spans, options, reader.fetch)
    )
    return {
        (number, group): streams[at :: len(groups)]
        for number, streams in enumerate(coded)
        for at, group in enumerate(groups)
    }


def recorded_options(codec: Codec, quality: Mapping[str, str]) -> Settings:
    """The parameters of a codec in a quality record, without meaningless ones."""
    aims = {target.name for target in TARGETS}
    options = codec.options({})
    for parameter in codec.parameters:
        text = quality.get(f"param.{parameter.name}")
        if text is None or parameter.name in aims:
            continue
        try:
            options[parameter.name] = parameter.parse(text)
        except OptionError:
            continue
    return options


def _decode_recoded(
    signal: Signal,
    source: MemorySource,
    streams: Streams,
    groups: tuple[int, ...],
    reader: SignalReader,
) -> Signal:

    def fetch(segment: int, resolution: int, group: int) -> bytes:
        coded = streams.get((segment, group))
        return reader.fetch(segment, resolution, group) if coded is None else coded[resolution]

    info = reader.info
    start, stop = info.skip, info.layout.n_frames - info.spare
    request = Request(start, stop, groups)
    decoded = info.codec.decode(info.header, info.layout, info.spans, request, fetch)
    columns = [column for group in groups for column in info.layout.groups[group]]
    if info.codec.domain == "values":
        values = signal.values.copy()
        values[:, columns] = decoded
        return replace(signal, values=values)
    per_frame = signal.samples_per_frame
    for span in info.spans:
        a, b = max(start, span.first), min(stop, span.stop)
        ordinals = source.ordinals(span.first, span.stop)[:, columns]
        ordinals = ordinals[(a - span.first) * per_frame : (b - span.first) * per_frame]
        if (decoded[(a - start) * per_frame : (b - start) * per_frame] != ordinals).any():
            raise AssertionError(f"codec {info.codec.name}: the decoded joint differs")
    return signal if signal.values.dtype == np.int64 else settle(signal)[1]


OF_JOINTS = ("contacts", "quality")  # settings that name joints, which may be missing


def check_recodable(clip: Clip, *, whole: bool = False) -> None:
    """Raise OptionError for a clip that cannot be encoded again; ``whole``: all joints."""
    info = clip.signals[0]
    if info.exact and not (whole and "param.lossless" in (clip.quality or {})):
        raise OptionError(
            "some joints are exact, and re-encoding would not keep them exact", clip=clip.name
        )
    if not info.codec.lossless and (clip.quality or {}).get("codec") != info.codec.name:
        raise OptionError(
            "its settings are unknown, because there is no quality record; decode it and "
            "encode it again",
            clip=clip.name,
        )


def settings_of(clip: Clip) -> Settings:
    """The settings of a clip that differ from the defaults."""
    codec = clip.signals[0].codec
    defaults = codec.options({})
    settings = recorded_options(codec, clip.quality or {})
    if codec.promise:
        settings.pop("preset", None)  # the setting of the dial is its result
    return {name: value for name, value in settings.items() if value != defaults[name]}


def with_own_source(motion: Motion, clip: Clip) -> tuple[Motion, str | None]:
    """The rest of ``clip`` with a source made from its values, or without one and the reason."""
    motion = stating_rate(motion, clip.frame_numbers)
    if motion.source is None:
        return motion, None
    source = motion.source.without_file()
    try:
        FORMATS[source.format].write(replace(motion, source=source))
    except MotionError as error:
        metadata = dict(motion.metadata)
        add_note(metadata, "source-note", f"the source file was left out: {error}")
        left = replace(motion, metadata=metadata).without_source()
        return left.at_times(motion.timeline), str(error)
    signals = tuple(map(_on_binary_grids, motion.signals))
    return replace(motion, signals=signals, source=source), None


def _on_binary_grids(signal: Signal) -> Signal:
    if all(grid.is_text for _, _, grid in signal.grid_blocks()):
        return signal
    ordinals, exact = signal.to_ordinals()
    values = signal.values.copy()
    for rows, columns, grid in signal.grid_blocks():
        nearest = grid.values(ordinals[rows][:, columns])
        stray = ~exact[rows][:, columns] & np.isfinite(nearest)
        if not grid.is_text:
            values[rows, columns] = np.where(stray, nearest, values[rows, columns])
    return replace(signal, values=values)


def joints_alone(cut: ClipCut) -> Motion:
    """Decode the joints of a cut: other joints have no channels, and there is no source."""
    motion = cut.clip.motion((cut.start, cut.stop), cut.resolution)
    if cut.joints is None:
        return motion
    owners = np.array(joint_of_column(motion.skeleton))
    columns = np.flatnonzero(np.isin(owners, sorted(cut.joints)))
    joints = tuple(
        joint if index in cut.joints else replace(joint, channels=())
        for index, joint in enumerate(motion.skeleton.joints)
    )
    skeleton = replace(motion.skeleton, joints=joints, base=cut.clip.skeleton_id, source=None)
    whole = motion.signals[0]
    number = {int(column): place for place, column in enumerate(columns)}
    signal = Signal(
        whole.values[:, columns],
        grids=tuple(whole.grids[column] for column in columns),
        name=whole.name,
        mask=None if whole.mask is None else whole.mask[:, columns],
        grid_changes=tuple((r, number[c], g) for r, c, g in whole.grid_changes if c in number),
        ordinals=None if whole.ordinals is None else whole.ordinals[:, columns],
    )
    metadata = dict(motion.metadata)
    add_note(metadata, "skeleton-note", WITHOUT_CHANNELS)
    signals = (signal, *motion.signals[1:])
    made = replace(motion, skeleton=skeleton, signals=signals, source=None, metadata=metadata)
    return made.at_times(motion.timeline)


def settings_of_joints(clip: Clip) -> Settings:
    """The settings of a clip that suit some of its joints alone."""
    codec = clip.signals[0].codec
    settings = {k: v for k, v in settings_of(clip).items() if k not in OF_JOINTS}
    # Point positions of the base are kept: with fewer joints they would be derived again.
    return settings | {"domain": "channels"} if codec.has("domain") else settings
