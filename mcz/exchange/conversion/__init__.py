"""A motion for another format: the same points over time, in its terms."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.exchange.conversion.hierarchy import to_amc, to_bvh
from mcz.exchange.conversion.losses import (
    COUNTING,
    conversion_losses,
    drop_time_signal,
    keep_supported_signals,
)
from mcz.exchange.conversion.marker_fit import Fit, from_positions
from mcz.files.reading.source_files import SourceOptions
from mcz.hints import Hint
from mcz.kinematics.points import in_positions, point_set
from mcz.model.checks import STRING, check_arguments
from mcz.model.clock import Timeline
from mcz.model.motion import A_MOTION, Motion
from mcz.model.numbers import Grid, GridKind
from mcz.sources import FORMATS

PRINTED = Grid(GridKind.FIXED, 6)  # of computed points: far below noise


def to_trc(motion: Motion) -> Motion:
    """The points as markers of their names, in mm if the length unit is known.

    A motion of markers is returned unchanged.
    """
    converted = to_c3d(motion)
    signal = converted.signals[0]
    if signal is motion.signals[0]:
        return replace(converted, signals=(signal,))
    signal = replace(signal, grids=(PRINTED,) * signal.n_channels, grid_changes=(), ordinals=None)
    return replace(converted, signals=(signal,))


def to_storage(motion: Motion) -> Motion:
    """The motion with only its motion signal, a column a channel."""
    return replace(motion, signals=motion.signals[:1])


def needs_rate(motion: Motion, to: str) -> bool:
    """Return whether a table needs a frame rate: TRC states it, others have times."""
    return to == "trc" or motion.timeline is None


MM_CM = 0.1
MM_PER_CM = 10.0


def to_c3d(motion: Motion) -> Motion:
    """The points as markers of their names, in mm if the length unit is known.

    A motion of markers is returned unchanged. A point with an unknown position is invalid.
    """
    converted = in_positions(motion)
    unit_cm = motion.skeleton.unit_cm
    if converted is motion or unit_cm is None:
        return replace(converted, metadata=motion.metadata)
    with np.errstate(over="ignore"):
        values = np.asarray(converted.signals[0].values, np.float64) * (unit_cm * MM_PER_CM)
    if np.isinf(values).any():
        raise MotionError("a position in mm exceeds float64", clip=motion.name)
    signal = replace(converted.signals[0], values=values)
    return replace(
        converted,
        skeleton=replace(converted.skeleton, unit_cm=MM_CM),
        signals=(signal, *converted.signals[1:]),
        metadata=motion.metadata,
    )


__all__ = [
    "TARGETS",
    "Fit",
    "conversion_losses",
    "convert",
    "converted_files",
    "from_positions",
]

TARGETS = {
    "bvh": to_bvh,
    "amc": to_amc,
    "c3d": to_c3d,
    "trc": to_trc,
    "sto": to_storage,
    "mot": to_storage,
}


@check_arguments(motion=A_MOTION, to=STRING)
def convert(motion: Motion, to: str, rate: Fraction | float | None = None) -> Motion:
    """``motion`` on a skeleton that files of the format ``to`` can hold: a key of ``TARGETS``.

    Its points are at the same positions, in the same order wherever both formats have the same
    points, to 1e-9 of the skeleton's size; computed numbers have a grid of 6 decimals, to which
    they are rounded when printed. It has no source: it prints plainly. ``rate`` replaces the frame
    rate of the motion.

    Raises MotionError, with the reason, if that format cannot hold the motion, and OptionError for
    an unknown format or a frame rate that is needed and unknown.
    """
    if to not in TARGETS:
        scene = "; mcz.to_glb writes scenes" if to in ("glb", "gltf") else ""
        raise OptionError(f"cannot convert to {to!r}; the formats are {', '.join(TARGETS)}{scene}")
    motion = SourceOptions(rate=rate).applied_to(motion)
    same = to == "c3d" and point_set(motion.skeleton) == "markers"
    same = same or (FORMATS[to].is_table and not needs_rate(motion, to))
    if to != "amc" and not same and motion.frame_rate is None:
        raise OptionError(
            f"its frame rate is unknown, but {to.upper()} must state one",
            clip=motion.name,
            hint=Hint.RATE,
        )
    timeline = motion.timeline
    if timeline is not None and FORMATS[to].is_table:  # prints as the source
        timeline = Timeline(timeline.times, timeline.rate)
    converted = TARGETS[to](keep_supported_signals(motion, to))
    converted = replace(converted, source=None).at_times(timeline)
    return drop_time_signal(converted, to) if to in COUNTING else converted


def converted_files(
    motion: Motion, to: str, rate: Fraction | float | None = None, with_skeleton: bool = False
) -> dict[str, bytes]:
    """The plain file of ``convert``, under ``to``, and of an AMC its ASF under "asf" if requested.

    Raises MotionError and OptionError as ``convert``.
    """
    converted = convert(motion, to, rate)
    files: dict[str, bytes] = {to: FORMATS[to].write(converted)}
    if with_skeleton and to == "amc":
        files["asf"] = FORMATS["asf"].write(converted.skeleton)
    return files
