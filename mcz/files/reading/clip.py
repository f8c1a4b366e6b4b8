"""A clip of an open file: values decoded on demand, in part if only a part is requested."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mcz.container.limits import check_decoded
from mcz.container.model_records import ValueDigest, value_hash
from mcz.container.reader import Container
from mcz.errors import ChecksumError, FormatError, OptionError
from mcz.files.reading.signal_info import SignalInfo, groups_of
from mcz.files.reading.signal_reader import SignalReader
from mcz.files.reading.source_files import SourceInfo, sourced_skeleton, stating_rate, stored_source
from mcz.files.reading.stored_clip import StoredClip
from mcz.files.reading.views import (
    ClipValues,
    FrameValues,
    Masked,
    PoseMethod,
    Preview,
    decimate_motion,
    decimate_rows,
    method_of,
    preview,
)
from mcz.hints import Hint
from mcz.kinematics.points import point_names
from mcz.model.clock import (
    TIMES,
    Counting,
    StoredTimes,
    Timeline,
    column_of,
    known_timeline,
    timeline_of,
    times_fault,
    times_index,
    unit_of_times,
)
from mcz.model.motion import Motion, Signal, Skeleton, Source, joint_columns
from mcz.model.notebook import html_of
from mcz.model.skeleton import Joints, joint_list
from mcz.model.text_format import quote_name
from mcz.model.types import Values
from mcz.sources import FORMATS

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

    from mcz.kinematics import poses
    from mcz.kinematics.contacts import ContactRule, Contacts


class Clip(StoredClip):
    """One clip; it is decoded on demand."""

    _repr_html_ = html_of
    if TYPE_CHECKING:  # as of ``mcz``
        positions = method_of(poses.positions)
        rotations = method_of(poses.rotations)
        root = method_of(poses.root)
        velocities = method_of(poses.velocities)
        accelerations = method_of(poses.accelerations)
    else:
        positions, rotations, root = PoseMethod(), PoseMethod(), PoseMethod()
        velocities, accelerations = PoseMethod(), PoseMethod()

    def __reduce__(self) -> tuple[object, ...]:
        return _reopen, (self.container, self.name)

    def __repr__(self) -> str:
        return f"<Clip {quote_name(self.name)}: {self.n_frames} frames, {self.n_channels} channels>"

    @property
    def values(self) -> ClipValues:
        """The motion signal for slicing: ``clip.values[100:200]`` decodes 100 frames."""
        return ClipValues(self.read, self.shape)

    def read(
        self,
        frames: tuple[int, int] | None = None,
        joints: Joints = None,
        resolution: int = 0,
        *,
        decimate: bool = False,
        signal: int | str = 0,
    ) -> Values:
        """The values of frames a <= f < b of some joints, NaN where invalid.

        Shape (rows, channels of the joints in the order given), binary64 in source units.
        ``signal`` is one of ``signals`` by index or name; analog samples are in the units of their
        channels, while ``read_masked`` returns the stored words. ``resolution`` leaves out that
        many of the finest details; with ``decimate`` only the rows of every 2^resolution-th frame
        are returned; ``motion`` also has their numbers. Raises OptionError for a range outside the
        clip and FormatError for bad bytes; a full read also checks the value hash, as set by
        ``mcz.open``.
        """
        signal = self.find_signal(signal)
        values, mask = self.read_masked(frames, joints, resolution, signal=signal)
        scaling = self.scaling(signal)
        if scaling is not None:
            values = scaling.values(values)
        if mask is not None:
            values = np.where(mask, values, np.nan)
        if not decimate:
            return values
        per_frame = self.signals[signal].layout.samples_per_frame
        return decimate_rows(values, per_frame, 2**resolution)

    def read_masked(
        self,
        frames: tuple[int, int] | None = None,
        joints: Joints = None,
        resolution: int = 0,
        *,
        signal: int | str = 0,
    ) -> Masked:
        """The stored numbers, also of invalid values and analog words; and the mask."""
        info = self._info(self.find_signal(signal))
        start, stop = self.checked_range(frames)
        self._check_resolution(info, resolution)
        groups, columns = (None, []) if joints is None else self.groups_of(info, joints)
        reader = SignalReader(self.container, info, groups, resolution, self.name)
        values, mask = reader.read(start + info.skip, stop + info.skip)  # CLIP-18
        if joints is not None:
            values = values[:, columns]
            mask = mask[:, columns] if mask is not None else None
        if (start, stop) == (0, self.n_frames) and joints is None and resolution == 0:
            self._check_whole(info, values, mask)
        if info.role == TIMES:
            self._check_times(info, values, mask)
        return Masked(values, mask)

    def _check_whole(
        self, info: SignalInfo, values: Values, mask: NDArray[np.bool_] | None
    ) -> None:
        if self.container.salvage:
            return
        if self.container.verify or not info.codec.hash_optional:  # CEND-05
            self.check_hash(info, values, mask)

    def _check_times(
        self, info: SignalInfo, values: Values, mask: NDArray[np.bool_] | None
    ) -> None:
        fault = times_fault(np.where(True if mask is None else mask, values, np.nan)[:, 0])
        if fault and not self.container.salvage:  # ROLE-04
            raise FormatError(
                f"its times are unusable: {fault}", clip=self.name, where=f"signal {info.index}"
            )

    def _info(self, signal: int) -> SignalInfo:
        if not 0 <= signal < len(self.signals):
            raise OptionError(f"no signal {signal}: it has {len(self.signals)}", clip=self.name)
        return self.signals[signal]

    def _check_resolution(self, info: SignalInfo, resolution: int) -> None:
        last = info.counts.n_resolutions - 1
        if not 0 <= resolution <= last:
            raise OptionError(
                f"no resolution {resolution}: it has resolutions 0 to {last}", clip=self.name
            )

    def groups_of(self, info: SignalInfo, joints: Joints) -> tuple[tuple[int, ...], list[int]]:
        """The groups with the channels of these joints, and the place of each among theirs."""
        if joints is None:
            return groups_of(info.layout, range(info.layout.n_channels))
        if info.channels is not None:
            raise OptionError(f"signal {info.name!r} is not made of joints")
        return groups_of(info.layout, joint_columns(self.skeleton, joint_list(joints)))

    def check_values(self, signal: int) -> None:
        """Decode a whole signal, a few segments in memory at a time, and compare its hash."""
        info = self._info(signal)
        digest = ValueDigest()
        reader = SignalReader(self.container, info, None, 0, self.name)
        for block in reader.blocks(info.skip, info.skip + self.n_frames):
            digest.update(block.values, block.mask)
        self._compare(info, digest.digest())

    def check_hash(self, info: SignalInfo, values: Values, mask: NDArray[np.bool_] | None) -> None:
        """Raise ChecksumError unless these are the values and the mask of a whole signal."""
        self._compare(info, value_hash(values, mask))

    def _compare(self, info: SignalInfo, digest: bytes) -> None:
        stored = self.value_hashes[info.index]
        if digest != stored:
            raise ChecksumError(
                f"the hash of the values is {digest.hex()}, but {stored.hex()} is stored",
                clip=self.name,
                where=f"signal {info.index}",
            )

    def motion(
        self, frames: tuple[int, int] | None = None, resolution: int = 0, *, decimate: bool = False
    ) -> Motion:
        """The whole clip, or frames a <= f < b of it, as a Motion with its source.

        ``resolution`` leaves out that many of the finest details of the motion, and of every other
        signal as many as it has. With ``decimate`` only frames a, a + 2^resolution, ... are kept,
        at a frame rate divided by 2^resolution, their numbers in ``frame_numbers``; the source is
        left out if its text states the rate.
        """
        motion = self._motion(frames, resolution, decimate)
        signals = tuple(s.in_units(self.scaling(n)) for n, s in enumerate(motion.signals))
        return replace(motion, skeleton=self._sourced_skeleton, signals=signals)

    @cached_property
    def _sourced_skeleton(self) -> Skeleton:
        """The skeleton with its own source file, unless salvage finds that damaged."""
        try:
            return sourced_skeleton(self.container, self.skeleton_id)
        except FormatError:
            if not self.container.salvage:
                raise
            return self.skeleton

    def _motion(self, frames: tuple[int, int] | None, resolution: int, decimate: bool) -> Motion:
        start, stop = self.checked_range(frames)
        self._check_resolution(self.signals[0], resolution)
        numbers = self.frame_numbers[start:stop]
        signals = [self._read_signal(s, start, stop, resolution) for s in self.signals]
        motion = Motion(
            skeleton=self.skeleton,
            signals=tuple(signals),
            frame_rate=self.frame_rate,
            frame_rate_exact=self.frame_rate_exact,
            name=self.name,
            metadata=self.metadata,
            frame_numbers=numbers if start or self._time_base is not None else None,
            first_time=self.first_time,
        )
        step = 2**resolution if decimate else 1
        motion = decimate_motion(motion, step) if step > 1 else motion
        motion = replace(motion, source=self._source(start, stop, resolution, step))
        if step == 1 and (not start or self.first_time is None):
            return motion
        return motion.at_times(self.timeline and self.timeline.cut(slice(start, stop, step)))

    def _read_signal(self, info: SignalInfo, start: int, stop: int, resolution: int) -> Signal:
        resolution = info.coarser(resolution)
        reader = SignalReader(self.container, info, None, resolution, self.name)
        signal = reader.signal(start + info.skip, stop + info.skip)
        if (start, stop, resolution) == (0, self.n_frames, 0):
            self._check_whole(info, signal.values, signal.mask)
        if info.role == TIMES:
            self._check_times(info, signal.values, signal.mask)
            if times_fault(signal.masked()[:, 0]):  # of salvage
                return replace(signal, role="")
        return signal

    def _source(self, start: int, stop: int, resolution: int, step: int) -> Source | None:
        info, fields = self.source, self._fields.source
        if info is None or fields is None or (step > 1 and FORMATS[info.format].states_rate):
            return None
        skip = self.signals[0].skip
        frames = range(start + skip, stop + skip, step)
        try:
            if self._row.skeleton != self._fields.skeleton:  # salvage has replaced it
                raise FormatError("the joint names of its skeleton are lost")
            source = stored_source(self.container, fields, info, self.signals[0], frames)
        except FormatError as error:
            self._complain(f"its source file is lost: {error}", error)
            return None
        whole = (start, stop, resolution) == (0, self.n_frames, 0)
        return source if whole else source.without_file()

    @cached_property
    def timeline(self) -> Timeline | None:
        """The times of all frames, None if neither times nor a rate are known."""
        counting = Counting(self.frame_numbers, self.frame_rate)
        return timeline_of(counting, self.first_time, self.times_column())

    @property
    def times(self) -> NDArray[np.float64]:
        """The time of every frame in seconds, (n_frames,): see ``mcz.times``; OptionError.

        At most the column of times is decoded.
        """
        return known_timeline(self.name, self.timeline).times

    def timeline_at(self, rate: Fraction | None) -> Timeline | None:
        """``timeline``, by ``rate`` if the clip states neither a rate nor times."""
        if self.timeline is None and rate is not None:
            return timeline_of(Counting(self.frame_numbers, rate), self.first_time)
        return self.timeline

    def times_column(self) -> StoredTimes | None:
        """The times among the values; None if there are none."""
        index = times_index(self.signals)
        if index is None:
            return None
        info = self.signals[index]
        return column_of(self.read(signal=index)[:, 0], info.grids[0], unit_of_times(info))

    def preview(self, joints: Joints = None) -> FrameValues:
        """Read the frames that need no decoding of the rest, counted from 0, and their values.

        The values, of shape (frames, channels of the joints), equal those of ``read`` for these
        frames if the codec stores some apart (qbc: its marks); otherwise they are its coarsest
        resolution. Raises OptionError for a codec without either.
        """
        preview = self.read_preview(joints)
        return FrameValues(preview.frames, preview.masked())

    def read_preview(self, joints: Joints = None) -> Preview:
        """``preview`` with a separate mask, and the distance of its frames."""
        info = self.signals[0]
        groups, columns = self.groups_of(info, joints)
        reader = SignalReader(
            self.container, info, groups, info.counts.n_resolutions - 1, self.name
        )
        return preview(reader, self.n_frames, columns)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the joints, ``name#n`` where one repeats."""
        return tuple(self.skeleton.addresses())

    @property
    def point_names(self) -> tuple[str, ...]:
        """The names of the points of ``positions``, in their order."""
        return point_names(self.skeleton)

    def to_xarray(
        self, *, form: str = "quat", unit: str | None = None, dtype: DTypeLike = np.float64
    ) -> Dataset:
        """The whole clip as an ``xarray.Dataset``: see ``mcz.to_xarray``."""
        from mcz.files.tables import to_xarray

        return to_xarray(self.motion(), form=form, unit=unit, dtype=dtype)

    def to_pandas(
        self,
        what: str = "positions",
        *,
        joints: Joints = None,
        unit: str | None = None,
        flat: bool = False,
    ) -> DataFrame:
        """A table of the whole clip as a ``pandas.DataFrame``: see ``mcz.to_pandas``."""
        from mcz.files.tables import to_pandas

        return to_pandas(self.motion(), what, joints=joints, unit=unit, flat=flat)

    def contacts(self, joints: Joints = None, rule: ContactRule | None = None) -> Contacts:
        """Frames of the whole clip in which feet stand, see ``mcz.contacts``."""
        from mcz.kinematics.contacts import RULE, contacts

        feet = None if joints is None else joint_list(joints)
        return contacts(self.motion(), feet, rule or RULE)

    def source_bytes(
        self, frames: tuple[int, int] | None = None, resolution: int = 0, *, decimate: bool = False
    ) -> bytes:
        """The source file, byte for byte (of a lossy clip: like it), or a part of it.

        The arguments are those of ``motion``. A changed file states the frame rate of the clip, if
        its format can. Raises ChecksumError if a lossless clip does not restore its file.
        """
        if (info := self.source) is None:
            raise OptionError("the clip has no source file", clip=self.name, hint=Hint.CONVERT)
        check_decoded(f"clip {self.name!r}: source", info.size, self.container.max_decoded)
        is_file = self.can_restore(frames, resolution)
        motion = self._motion(frames, resolution, decimate)
        if motion.source is None and self.container.salvage:
            raise FormatError(
                "the source file of the clip is lost", clip=self.name, hint=Hint.CONVERT
            )
        if not is_file:
            motion = stating_rate(motion, self.frame_numbers)
        data: bytes = FORMATS[info.format].write(motion)
        if is_file and not self.container.salvage:
            self._check_source(data, info)
        return data

    def can_restore(self, frames: tuple[int, int] | None = None, resolution: int = 0) -> bool:
        """Return whether ``source_bytes`` returns the original file of the clip."""
        whole = self.checked_range(frames) == (0, self.n_frames) and not resolution
        return whole and all(signal.codec.lossless for signal in self.signals)

    def _check_source(self, data: bytes, info: SourceInfo) -> None:
        digest = hashlib.sha256(data).digest()
        if len(data) != info.size or digest != info.sha256:  # SRC-01, SRC-02
            raise ChecksumError(
                f"the restored {info.path} has {len(data)} bytes and hash {digest.hex()}, but "
                f"{info.size} bytes and hash {info.sha256.hex()} are stored",
                clip=self.name,
            )


def _reopen(container: Container, name: str) -> Clip:
    """Reopen a pickled Clip; raises OptionError if the file has changed meanwhile."""
    row = container.directory.clips.get(name)
    if row is None:
        raise OptionError(f"clip {name!r} no longer exists", path=container.source.name)
    return Clip(container, row)
