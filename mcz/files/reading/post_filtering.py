"""The post filter of clips of positions, against the jitter of a coarse codec.

The filter is a reader's choice: the file stores nothing of it, and hashes are of the unfiltered
values. SPEC.md, "Post filter", is normative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from mcz.codecs.transforms.post_filter import PostFilter, filter_rows
from mcz.errors import MotionError, OptionError
from mcz.files.reading.clip import Clip
from mcz.files.reading.source_files import SourceOptions
from mcz.files.reading.source_info import stating_rate
from mcz.files.reading.views import decimate_rows
from mcz.hints import Hint
from mcz.kinematics import point_set
from mcz.kinematics.marker_motion import SEPARATOR
from mcz.model.motion import Motion, Signal, Skeleton
from mcz.model.types import Bools, Floats, Values
from mcz.sources import FORMATS

NOTE = "post-filtered"  # the source-note of a filtered motion ends with it


def post_filter(motion: Motion, rate: Fraction | float | None = None) -> Motion:
    """Filter quantization noise out of the positions of a motion of markers.

    Each coordinate passes a low-pass of 1, 3 or 5 Hz over 25 rows, chosen by how well its past
    predicts it. That helps where positions are off by more than a centimeter or two, and harms
    where they are nearly exact. Unknown positions stay unknown. The other signals are kept; there
    is no source. ``rate`` replaces the frame rate of the motion.

    Raises MotionError for a motion that is not of markers alone, OptionError where the length unit
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
        motion,
        signals=(signal, *motion.signals[1:]),
        metadata=dict(motion.metadata) | metadata,
    )
    return filtered.without_source()


def live_filter(skeleton: Skeleton, rate: Fraction | None, name: str = "live") -> PostFilter:
    """A filter for the frames of a live clip ``name``; raises as ``post_filter``.

    Its rows are NaN where a position is unknown.
    """
    _check_markers(name, skeleton, False)
    return PostFilter(skeleton.n_channels, *_settings(name, skeleton, rate, 1))


def filtered_part(
    clip: Clip,
    frames: tuple[int, int] | None = None,
    joints: Sequence[int | str] | None = None,
    resolution: int = 0,
    *,
    rate: Fraction | None = None,
) -> tuple[Values, Bools | None]:
    """The whole clip is filtered, then the part cut out; shapes as of ``clip.read_masked``."""
    info, skeleton = clip.signals[0], clip.skeleton
    start, stop = clip.checked_range(frames)
    per_frame = info.layout.samples_per_frame
    _check_markers(clip.name, skeleton, info.channels is not None)
    settings = _settings(clip.name, skeleton, rate or clip.frame_rate, per_frame)
    values, mask = clip.read_masked(None, None, resolution)  # FILT-04
    rows = slice(start * per_frame, stop * per_frame)  # FILT-04
    columns: Any = slice(None)
    if joints is not None:
        columns = [c for joint in joints for c in skeleton.columns(skeleton.find(joint))]
    filtered = _filter(values, mask, *settings)[rows, columns]
    return filtered, None if mask is None else mask[rows, columns]


def filtered_motion(
    clip: Clip,
    frames: tuple[int, int] | None = None,
    resolution: int = 0,
    *,
    decimate: bool = False,
    rate: Fraction | None = None,
) -> Motion:
    """As ``clip.motion``, without a source: the whole clip is filtered, then the part cut out."""
    motion = _filtered_on_grids(clip, frames, resolution, decimate, rate)
    return _with_positions(motion, motion.signals[0].values)


def filtered_source(
    clip: Clip,
    frames: tuple[int, int] | None = None,
    resolution: int = 0,
    *,
    decimate: bool = False,
    rate: Fraction | None = None,
) -> bytes:
    """As ``clip.source_bytes``, with filtered positions in the style of the source."""
    motion = _filtered_on_grids(clip, frames, resolution, decimate, rate)
    if clip.source is None or motion.source is None:
        raise OptionError("no source file", clip=clip.name, hint=Hint.CONVERT)
    data: bytes = FORMATS[clip.source.format].write(stating_rate(motion, clip.frame_numbers))
    return data


def _filtered_on_grids(
    clip: Clip,
    frames: tuple[int, int] | None,
    resolution: int,
    decimate: bool,
    rate: Fraction | None,
) -> Motion:
    """``clip.motion`` with filtered values, on the grids of the clip where possible."""
    values, mask = filtered_part(clip, frames, None, resolution, rate=rate)
    motion = clip.motion(frames, resolution, decimate=decimate)
    first, step = motion.signals[0], 2**resolution if decimate else 1
    if step > 1:
        values = decimate_rows(values, first.samples_per_frame, step)
        mask = None if mask is None else decimate_rows(mask, first.samples_per_frame, step)
    if rate is not None:
        motion = replace(motion, frame_rate=rate / step, frame_rate_exact=True)
    grids = first.grids if first.values.dtype == np.float64 else ()
    signal = Signal(
        np.ascontiguousarray(values),
        grids,
        first.name,
        first.samples_per_frame,
        mask,
        grid_changes=first.grid_changes if grids else (),
    )
    return replace(motion, signals=(signal, *motion.signals[1:]))


def _check_markers(name: str, skeleton: Skeleton, has_channels: bool) -> None:
    """Raise MotionError for a motion of other joints than markers, or with channels of its own."""
    if has_channels or point_set(skeleton) != "markers":
        raise MotionError(
            f"motion {name!r} is not one of markers alone, and the post filter is for positions; "
            "mcz.in_positions makes them of a skeleton's motion"
        )


def _settings(
    name: str, skeleton: Skeleton, rate: Fraction | None, per_frame: int
) -> tuple[float, float]:
    """Rows a second, and the length unit in cm; raises OptionError where either is unknown."""
    if rate is None:  # FILT-03
        raise OptionError(
            "its frame rate is unknown, and the post filter's cutoffs are in Hz",
            clip=name,
            hint=Hint.RATE,
        )
    if skeleton.unit_cm is None:  # FILT-03
        raise OptionError(
            "its length unit is unknown, and the post filter's thresholds are 20 and 120 mm",
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
