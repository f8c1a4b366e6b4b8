"""``to_pandas``: one table of a motion as a ``pandas.DataFrame``."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import TYPE_CHECKING

from mcz.errors import OptionError
from mcz.files.tables.files import channel_names
from mcz.files.tables.labelled import COMPONENTS, row_times
from mcz.kinematics.poses import accelerations, point_names, positions, rotations, velocities
from mcz.model.extras import import_extra
from mcz.model.motion import Motion, Signal
from mcz.model.skeleton import Joints
from mcz.model.types import Items

if TYPE_CHECKING:
    from pandas import DataFrame

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
    a sample, indexed by its time in seconds ("time", see ``mcz.times``), or by rows ("frame") while
    that is unknown. Columns are pairs of a joint or point and a component, ``flat``: texts
    "lfoot.x"; of channels and signals always texts. What is invalid is NaN. Raises OptionError for
    another ``what``, and as ``mcz.positions``.
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
