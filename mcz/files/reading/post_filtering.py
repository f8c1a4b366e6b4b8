"""The post filter of clips of positions, against the jitter of a coarse codec.

The filter is a reader's choice: the file stores nothing of it, and hashes are of the unfiltered
values. SPEC.md, "Post filter", is normative.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from mcz.codecs.transforms.post_filter import PostFilter, filter_rows
from mcz.errors import MotionError, OptionError
from mcz.files.reading.clip import Clip
from mcz.files.reading.signal_info import SignalInfo
from mcz.files.reading.source_files import SourceOptions
from mcz.files.reading.views import Masked
from mcz.hints import Hint
from mcz.kinematics.points import SEPARATOR, point_set
from mcz.model.checks import check_arguments
from mcz.model.motion import A_MOTION, Motion, Signal, Skeleton, joint_columns
from mcz.model.skeleton import Joints, joint_list
from mcz.model.types import Bools, Floats, Values

NOTE = "post-filtered"  # the source-note of a filtered motion ends with it


@check_arguments(motion=A_MOTION)
def post_filter(motion: Motion, rate: Fraction | float | None = None) -> Motion:
    """Filter quantization noise out of the positions of a motion of markers.

    Each coordinate passes a low-pass of 1, 3 or 5 Hz over 25 rows, chosen by how well its past
    predicts it. That helps where positions are off by more than a centimeter or two, and harms
    where they are nearly exact. Unknown positions stay unknown. The other signals are kept; there
    is no source. ``rate`` replaces the frame rate of the motion.

    Raises MotionError for a motion that is not of markers alone, OptionError if the length unit
    or the frame rate is unknown.
    """
    motion = SourceOptions(rate=rate).applied_to(motion)
    first = motion.signals[0]
    _check_markers(motion.name, motion.skeleton, first.channels is not None)
    settings = _settings(motion.name, motion.skeleton, motion.frame_rate, first.samples_per_frame)
    return _with_positions(motion, _filter(first.values, first.mask, *settings))


def _with_positions(motion: Motion, values: Values) -> Motion:
    """``motion`` with filtered positions, which lie on no grid, a note on them, and no source."""
    first, notes = motion.signals[0], motion.metadata.get("source-note")
    signal = Signal(
        values, name=first.name, samples_per_frame=first.samples_per_frame, mask=first.mask
    )
    metadata = {"source-note": SEPARATOR.join(filter(None, (notes, NOTE)))}
    filtered = replace(
        motion, signals=(signal, *motion.signals[1:]), metadata=dict(motion.metadata) | metadata
    )
    return filtered.without_source()


def live_filter(skeleton: Skeleton, rate: Fraction | None, name: str = "live") -> PostFilter:
    """A filter for the frames of a live clip ``name``; raises as ``post_filter``.

    Its rows are NaN where a position is unknown.
    """
    _check_markers(name, skeleton, False)
    return PostFilter(skeleton.n_channels, *_settings(name, skeleton, rate, 1))


class FilteredClip(Clip):
    """``clip`` with the post filter; ``rate`` replaces its frame rate. Raises as ``post_filter``.

    The whole motion is filtered, then cut. Its source has filtered positions, in the style of the
    original file.
    """

    def __init__(self, clip: Clip, rate: Fraction | None = None) -> None:
        super().__init__(clip.container, clip._row)
        self._rate, info = rate, clip.signals[0]
        _check_markers(self.name, self.skeleton, info.channels is not None)
        per_frame = info.samples_per_frame
        self._settings = _settings(self.name, self.skeleton, self.frame_rate, per_frame)

    @property
    def frame_rate(self) -> Fraction | None:
        return self._rate or super().frame_rate

    @property
    def frame_rate_exact(self) -> bool:
        return self._rate is not None or super().frame_rate_exact

    def read_masked(
        self,
        frames: tuple[int, int] | None = None,
        joints: Joints = None,
        resolution: int = 0,
        *,
        signal: int | str = 0,
    ) -> Masked:
        if self.find_signal(signal):
            return super().read_masked(frames, joints, resolution, signal=signal)
        start, stop = self.checked_range(frames)
        values, mask = super().read_masked(None, None, resolution)  # FILT-04
        per_frame = self.signals[0].samples_per_frame
        rows = slice(start * per_frame, stop * per_frame)  # FILT-04
        columns: slice | list[int] = slice(None)
        if joints is not None:
            columns = joint_columns(self.skeleton, joint_list(joints))
        filtered = _filter(values, mask, *self._settings)[rows, columns]
        return Masked(filtered, None if mask is None else mask[rows, columns])

    def _read_signal(self, info: SignalInfo, start: int, stop: int, resolution: int) -> Signal:
        """The positions on the grids of the clip where possible."""
        signal = super()._read_signal(info, start, stop, resolution)
        if info.index:
            return signal
        values, mask = self.read_masked((start, stop), None, resolution)
        on_grids = signal.values.dtype == np.float64
        return Signal(
            np.ascontiguousarray(values),
            signal.grids if on_grids else (),
            signal.name,
            signal.samples_per_frame,
            mask,
            grid_changes=signal.grid_changes if on_grids else (),
        )

    def motion(
        self, frames: tuple[int, int] | None = None, resolution: int = 0, *, decimate: bool = False
    ) -> Motion:
        """The filtered motion, without a source."""
        motion = super().motion(frames, resolution, decimate=decimate)
        return _with_positions(motion, motion.signals[0].values)

    def can_restore(self, frames: tuple[int, int] | None = None, resolution: int = 0) -> bool:
        return False


def _check_markers(name: str, skeleton: Skeleton, has_channels: bool) -> None:
    """Raise MotionError unless all joints are markers without further channels."""
    if has_channels or point_set(skeleton) != "markers":
        raise MotionError(
            f"the post filter works on markers, and motion {name!r} has joints; convert it "
            "with mcz.in_positions"
        )


def _settings(
    name: str, skeleton: Skeleton, rate: Fraction | None, per_frame: int
) -> tuple[float, float]:
    """Rows a second, and the length unit in cm; raises OptionError if either is unknown."""
    if rate is None:  # FILT-03
        raise OptionError(
            "its frame rate is unknown, but the post filter needs it: its cutoffs are in Hz",
            clip=name,
            hint=Hint.RATE,
        )
    if skeleton.unit_cm is None:  # FILT-03
        raise OptionError(
            "its length unit is unknown, but the post filter needs it: its thresholds are 20 "
            "and 120 mm",
            clip=name,
            hint=Hint.UNIT,
        )
    return rate.numerator / rate.denominator * per_frame, skeleton.unit_cm  # FILT-07


def _filter(values: Values, mask: Bools | None, rate: float, unit_cm: float) -> Floats:
    rows = np.asarray(values, np.float64)
    if mask is None:
        return filter_rows(rows, rate, unit_cm)
    # FILT-05, FILT-06
    return np.where(mask, filter_rows(np.where(mask, rows, np.nan), rate, unit_cm), rows)
