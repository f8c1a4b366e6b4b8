"""``to_xarray`` and ``to_pandas``: a motion with the names and units of its axes."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mcz.errors import MotionError, OptionError
from mcz.files.tables.files import channel_names, channel_units
from mcz.kinematics.poses import accelerations, point_names, positions, rotations, velocities
from mcz.model.clock import TIMES, numbers_or_rows
from mcz.model.extras import import_extra
from mcz.model.motion import Motion, Signal
from mcz.model.skeleton import Joints
from mcz.model.types import Items, Settings

if TYPE_CHECKING:
    from pandas import DataFrame
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
    the numbers of the file. Each other signal has its name (time_NAME, channel_NAME). ``time`` is
    in seconds (see ``mcz.times``), in frames from 0 on if unknown; ``frame`` has the source's frame
    numbers. Facts are in ``attrs``; invalid values are NaN. Without kinematics there are only
    channels. Raises OptionError.
    """
    if form not in COMPONENTS:
        raise OptionError(f"rotations as {form!r}: one of {', '.join(COMPONENTS)}")
    xarray = import_extra("xarray", "xarray")
    skeleton, main = motion.skeleton, motion.signals[0]
    numbers = numbers_or_rows(motion.frame_numbers, motion.n_frames)
    variables: Settings = {"channels": (("time", "channel"), np.asarray(main.masked(), dtype), {})}
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
        name = f"signal_{name}"  # used by another, or by us
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
    """Only texts and numbers, which every store of xarray keeps."""
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


PLACES = {"positions": positions, "velocities": velocities, "accelerations": accelerations}


def to_pandas(
    motion: Motion,
    what: str = "positions",
    *,
    joints: Joints = None,
    unit: str | None = None,
    flat: bool = False,
) -> DataFrame:
    """A table of a motion as a ``pandas.DataFrame``; needs pandas (``mcz[pandas]``).

    ``what``: "positions", "velocities", "accelerations"; local rotations as "quat", "rotvec", "6d"
    or "euler" (XYZ); "channels"; or the name of another signal, such as "analog". A row a frame, or
    a sample, indexed by its time in seconds ("time", see ``mcz.times``), or by rows ("frame") if
    unknown. Columns are pairs of a joint or point and a component, ``flat``: texts "lfoot.x"; of
    channels and signals always texts. Invalid values are NaN. Raises OptionError for another
    ``what``, and as ``mcz.positions``.
    """
    pandas = import_extra("pandas", "pandas")
    signals = {signal.name: signal for signal in motion.signals[1:]}
    if what in PLACES:
        array = PLACES[what](motion, joints, unit=unit)
        pairs = _pairs(pandas, point_names(motion.skeleton, joints), ["x", "y", "z"], flat)
        return _table(pandas, motion, motion.signals[0], array, pairs)
    if what in COMPONENTS:
        array = rotations(motion, what, joints=joints)
        every = motion.skeleton.joint_names
        names = every if joints is None else _names(motion, joints)
        pairs = _pairs(pandas, names, COMPONENTS[what][1], flat)
        return _table(pandas, motion, motion.signals[0], array, pairs)
    if what == "channels" or what in signals:
        signal = motion.signals[0] if what == "channels" else signals[what]
        names = tuple(channel_names(motion.skeleton, signal.channels))
        return _table(pandas, motion, signal, signal.masked(), names)
    known = [*PLACES, *COMPONENTS, "channels", *signals]
    raise OptionError(f"a table of {what!r}: one of {', '.join(known)}")


def _names(motion: Motion, joints: Joints) -> tuple[str, ...]:
    from mcz.kinematics.poses.motion_like import joint_numbers

    every = motion.skeleton.joint_names
    return tuple(every[joint] for joint in joint_numbers(motion.skeleton, joints))


def _pairs(
    pandas: ModuleType, names: tuple[str, ...], components: list[str], flat: bool
) -> Sequence[object]:
    pairs = [(name, component) for name in names for component in components]
    if flat or not pairs:
        return [".".join(pair) for pair in pairs]
    columns: Sequence[object] = pandas.MultiIndex.from_tuples(pairs, names=["point", "component"])
    return columns


def _table(
    pandas: ModuleType, motion: Motion, signal: Signal, array: Items, columns: Sequence[object]
) -> DataFrame:
    times, units = row_times(motion, signal)
    index = pandas.Index(times, name="time" if units == "s" else "frame")
    array = array.reshape(len(array), len(columns))
    table: DataFrame = pandas.DataFrame(array, index=index, columns=columns)
    return table
