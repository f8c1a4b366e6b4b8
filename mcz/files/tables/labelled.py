"""``to_xarray``: a motion as an ``xarray.Dataset``, every axis with its names and units."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mcz.errors import MotionError, OptionError
from mcz.files.tables.files import channel_names, channel_units
from mcz.kinematics.poses import point_names, positions, rotations
from mcz.model.clock import TIMES, numbers_or_rows
from mcz.model.extras import import_extra
from mcz.model.motion import Motion, Signal
from mcz.model.types import Settings

if TYPE_CHECKING:
    from xarray import Dataset

COMPONENTS = {
    "quat": ("rotation", ["w", "x", "y", "z"]),
    "rotvec": ("rotation", ["x", "y", "z"]),
    "6d": ("rotation", ["xx", "yx", "zx", "xy", "yy", "zy"]),
    "euler": ("rotation", ["X", "Y", "Z"]),
}


def to_xarray(
    motion: Motion, *, form: str = "quat", unit: str | None = None, dtype: DTypeLike = np.float64
) -> Dataset:
    """A motion as an ``xarray.Dataset``; needs xarray (``mcz[xarray]``).

    ``positions`` (time, point, axis) in length units or ``unit``; ``rotations`` (time, joint,
    rotation), local, as ``form``: quat, rotvec, 6d or euler (XYZ); ``channels`` (time, channel),
    the numbers of the file. Each other signal stands under its name (time_NAME, channel_NAME).
    ``time`` is in seconds (see ``mcz.times``), in frames from 0 on while that is unknown; ``frame``
    has the source's frame numbers. Facts are in ``attrs``; what is invalid is NaN. Without
    kinematics there are channels alone. Raises OptionError.
    """
    if form not in COMPONENTS:
        raise OptionError(f"rotations as {form!r}: one of {', '.join(COMPONENTS)}")
    xarray = import_extra("xarray", "xarray")
    skeleton, main = motion.skeleton, motion.signals[0]
    numbers = numbers_or_rows(motion.frame_numbers, motion.n_frames)
    variables: Settings = {
        "channels": (("time", "channel"), np.asarray(main.masked(), dtype), {}),
    }
    coordinates: Settings = {
        "time": ("time", *_times(motion, main)),
        "frame": ("time", np.repeat(numbers, main.samples_per_frame)),
        "channel": channel_names(skeleton, main.channels),
    }
    try:
        lengths = {"units": unit or _unit(skeleton.unit_cm), "long_name": "positions in the world"}
        places = positions(motion, unit=unit, dtype=dtype)
        variables["positions"] = (("time", "point", "axis"), places, lengths)
        coordinates |= {"point": list(point_names(skeleton)), "axis": ["x", "y", "z"]}
        axis, names = COMPONENTS[form]
        turns = rotations(motion, form, dtype=dtype)
        about = {"form": form, "space": "local", "convention": "active, identity in the rest pose"}
        variables["rotations"] = (("time", "joint", axis), turns, about)
        coordinates |= {"joint": list(skeleton.joint_names), axis: names}
        coordinates["parent"] = ("joint", skeleton.parents)
    except MotionError:
        variables.pop("positions", None)
    for signal in motion.signals[1:]:
        if signal.role != TIMES:  # that is the coordinate
            _add_signal(motion, signal, variables, coordinates)
    made: Dataset = xarray.Dataset(variables, coordinates, _facts(motion))
    return made


def _add_signal(motion: Motion, signal: Signal, variables: Settings, coordinates: Settings) -> None:
    name = signal.name
    while {name, f"time_{name}", f"channel_{name}"} & {*variables, *coordinates}:
        name = f"signal_{name}"  # of another, or one of ours
    axis, channel = f"time_{name}", f"channel_{name}"
    variables[name] = ((axis, channel), signal.masked(), {})
    coordinates[axis] = (axis, *_times(motion, signal))
    coordinates[channel] = channel_names(motion.skeleton, signal.channels)
    coordinates[f"unit_{name}"] = (channel, channel_units(motion.skeleton, signal.channels))


def row_times(motion: Motion, signal: Signal) -> tuple[NDArray[np.float64], str]:
    """The time of each row, and its unit: "s", or "frames", from 0 on, while that is unknown."""
    timeline = motion.timeline
    if timeline is None:
        return np.arange(signal.n_rows) / signal.samples_per_frame, "frames"
    return timeline.samples(signal.samples_per_frame), "s"


def _times(motion: Motion, signal: Signal) -> tuple[NDArray[np.float64], Settings]:
    times, units = row_times(motion, signal)
    facts: Settings = {"units": units}
    if units == "s" and motion.frame_rate is not None:
        facts["sample_rate"] = float(motion.frame_rate * signal.samples_per_frame)
    return times, facts


def _unit(unit_cm: float | None) -> str:
    return "unknown" if unit_cm is None else f"{unit_cm:.17g} cm"


def _facts(motion: Motion) -> Settings:
    """Texts and numbers alone, which every store of xarray keeps."""
    skeleton, rate = motion.skeleton, motion.frame_rate
    facts: Settings = {"name": motion.name, "up_axis": skeleton.up_axis or "unknown"}
    if skeleton.forward_axis:
        facts["forward_axis"] = skeleton.forward_axis
    if skeleton.handedness:
        facts["handedness"] = skeleton.handedness
    if rate is not None:
        facts |= {"frame_rate": float(rate), "frame_rate_exact": str(rate)}
    if skeleton.unit_cm is not None:
        facts["unit_cm"] = skeleton.unit_cm
    if motion.source is not None and motion.source.path:
        facts["source"] = motion.source.path
    return facts | {f"metadata_{key}": value for key, value in motion.metadata.items()}
