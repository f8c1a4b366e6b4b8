"""``to_pandas``: one table of a motion as a ``pandas.DataFrame``."""

from __future__ import annotations

from typing import Any

from mcz.errors import OptionError
from mcz.extras import import_extra
from mcz.motion import Motion, Signal
from mcz.poses import accelerations, point_names, positions, rotations, velocities
from mcz.skeleton import Joints
from mcz.tables.files import channel_names
from mcz.tables.labelled import COMPONENTS, row_times
from mcz.types import Items

PLACES = {"positions": positions, "velocities": velocities, "accelerations": accelerations}


def to_pandas(
    motion: Motion,
    what: str = "positions",
    *,
    joints: Joints = None,
    unit: str | None = None,
    flat: bool = False,
) -> Any:
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
        pairs = _pairs(point_names(motion.skeleton, joints), ["x", "y", "z"])
        return _table(pandas, motion, motion.signals[0], array, pairs, flat)
    if what in COMPONENTS:
        array = rotations(motion, what, joints=joints)
        every = motion.skeleton.joint_names
        names = every if joints is None else _names(motion, joints)
        pairs = _pairs(names, COMPONENTS[what][1])
        return _table(pandas, motion, motion.signals[0], array, pairs, flat)
    if what == "channels" or what in signals:
        signal = motion.signals[0] if what == "channels" else signals[what]
        names = tuple(channel_names(motion.skeleton, signal.channels))
        return _table(pandas, motion, signal, signal.masked(), names, True)
    known = [*PLACES, *COMPONENTS, "channels", *signals]
    raise OptionError(f"a table of {what!r}: one of {', '.join(known)}")


def _names(motion: Motion, joints: Joints) -> tuple[str, ...]:
    from mcz.poses.moving import joint_numbers

    every = motion.skeleton.joint_names
    return tuple(every[joint] for joint in joint_numbers(motion.skeleton, joints))


def _pairs(names: tuple[str, ...], components: list[str]) -> list[tuple[str, str]]:
    return [(name, component) for name in names for component in components]


def _table(
    pandas: Any, motion: Motion, signal: Signal, array: Items, names: Any, flat: bool
) -> Any:
    columns = names
    if names and isinstance(names[0], tuple):
        columns = pandas.MultiIndex.from_tuples(names, names=["point", "component"])
        if flat:
            columns = [".".join(pair) for pair in names]
    times, units = row_times(motion, signal)
    index = pandas.Index(times, name="time" if units == "s" else "frame")
    return pandas.DataFrame(array.reshape(len(array), len(columns)), index=index, columns=columns)
