"""Motions as tables: CSV and NPZ files (docs/guides/tables.md), xarray and pandas.

xarray and pandas are imported on first use.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mcz.errors import MotionError, OptionError
from mcz.kinematics.frames import frame_poses_of, joint_numbers
from mcz.kinematics.poses import accelerations, point_names, positions, rotations, velocities
from mcz.model.checks import check_arguments
from mcz.model.clock import TIMES, numbers_or_rows
from mcz.model.extras import import_extra
from mcz.model.motion import A_MOTION, Channel, Joint, Motion, Signal, Skeleton
from mcz.model.skeleton import Joints
from mcz.model.text_format import printable, spreadsheet_cell
from mcz.model.types import Items, Settings

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

DECIMALS = 12  # of times in a CSV


@dataclass(frozen=True, slots=True)
class Table:
    """Some channels of some frames, a row a sample.

    ``values`` is float64 (n_rows, n_channels) in source units; ``mask`` (bool, same shape) is True
    where a value is valid; ``frame_numbers`` (int64, (n_rows,)) are the source's own, ``times``
    (float64, (n_rows,)) the seconds of ``mcz.times``, None while unknown.
    """

    names: list[str]
    values: NDArray[np.float64]
    mask: NDArray[np.bool_]
    frame_numbers: NDArray[np.int64]
    frame_rate: Fraction | None
    units: Sequence[str] = ()  # of the columns, "" if unknown; empty: those of the skeleton
    motion: Motion | None = None  # the motion with exactly these channels
    times: NDArray[np.float64] | None = None
    samples_per_frame: int = 1


def table_of(motion: Motion) -> Table:
    """The channels of the motion signal, with all facts of its poses for an NPZ."""
    signal = motion.signals[0]
    mask = np.ones(signal.values.shape, np.bool_) if signal.mask is None else signal.mask
    numbers, timeline = numbers_or_rows(motion.frame_numbers, motion.n_frames), motion.timeline
    per_frame = signal.samples_per_frame
    return Table(
        channel_names(motion.skeleton, signal.channels),
        np.asarray(signal.values, np.float64),
        mask,
        np.repeat(numbers, per_frame),
        motion.frame_rate,
        motion=motion,
        times=None if timeline is None else timeline.samples(per_frame),
        samples_per_frame=per_frame,
    )


def channel_names(skeleton: Skeleton, own: Sequence[Channel] | None = None) -> list[str]:
    """``joint.channel`` of every column, or ``joint`` with one number; ``joint#n`` if repeated.

    For a signal with ``own`` channels their names, or ``channel-n`` without one.
    """
    if own is not None:
        return [channel.label or f"channel-{n}" for n, channel in enumerate(own)]
    return [
        address if is_number(joint) else f"{address}.{channel.label}"
        for address, joint in zip(skeleton.addresses(), skeleton.joints, strict=True)
        for channel in joint.channels
    ]


def is_number(joint: Joint) -> bool:
    """Return True for a joint that is one plain scalar without a name, a column of a table."""
    return [(channel.kind, channel.label) for channel in joint.channels] == [("", "value")]


def channel_units(skeleton: Skeleton, own: Sequence[Channel] | None) -> list[str]:
    """The unit of every column, "" if the channel states none."""
    return [channel.unit for channel in (skeleton.channels if own is None else own)]


def to_csv(table: Table) -> bytes:
    """UTF-8 text: a header row, then a row a frame; an invalid value is an empty cell.

    Columns ``frame`` and, in seconds if times are known, ``time`` come first. Units follow the
    names, in brackets. Control characters are escaped in both, since text is often printed on a
    terminal, and an apostrophe precedes text that a spreadsheet would run. Values are the shortest
    decimals that read back as the same binary64.
    """
    units = table.units or [""] * len(table.names)
    heads = [f"{n} [{u}]" if u else n for n, u in zip(table.names, units, strict=True)]
    first: list[list[Any]] = [table.frame_numbers.tolist()]
    if table.times is not None and table.names[:1] != ["time"]:
        first.append(list(map(repr, table.times.round(DECIMALS).tolist())))
    rows = [[*("frame", "time")[: len(first)], *map(spreadsheet_cell, map(printable, heads))]]
    for *lead, values, valid in zip(
        *first, table.values.tolist(), table.mask.tolist(), strict=True
    ):
        cells = [repr(v) if ok else "" for v, ok in zip(values, valid, strict=True)]
        rows.append([*lead, *cells])
    return _csv_of(rows)


def _csv_of(rows: Iterable[Sequence[object]]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode("utf-8", "surrogateescape")


def to_npz(table: Table) -> bytes:
    """A NumPy archive of values, mask, frames, rate, names and, if known, times and units.

    A whole motion has also its skeleton and poses (``pose_arrays``). ``sample_rate`` counts rows a
    second; a frame may have several. No pickles.
    """
    rate = table.frame_rate
    if rate is not None and max(rate.numerator, rate.denominator) >= 2**63:
        raise MotionError(f"an NPZ cannot hold frame rate {float(rate):g}: a term exceeds 2^63")
    more: Settings = {"units": np.array(table.units, np.str_)} if table.units else {}
    more |= {} if table.times is None else {"times": table.times}
    if table.motion is not None:
        more |= pose_arrays(table.motion)
    return _npz_of(
        values=table.values,
        mask=table.mask,
        frame_numbers=table.frame_numbers,
        frame_rate=np.float64(np.nan if rate is None else float(rate)),
        sample_rate=np.float64(np.nan if rate is None else float(rate * table.samples_per_frame)),
        frame_rate_fraction=np.array(
            [0, 1] if rate is None else [rate.numerator, rate.denominator], np.int64
        ),
        names=np.array(table.names, dtype=np.str_),
        **more,
    )


def _npz_of(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


EXPORTS: dict[str, Callable[[Table], bytes]] = {"csv": to_csv, "npz": to_npz}


ABOUT = (
    "MCZ arrays 1. World rotation of joint j in frame f: W[f, j] = W[f, parents[j]] R(quaternions"
    "[f, j]), w first, active, column vectors; the identity in the rest pose. Its place: o[f, j] = "
    "o[f, parents[j]] + W[f, parents[j]] translations[f, j]; for parents[j] = -1 without the first "
    "term and W. Places of points are in positions, those of joint point_joints[p] at o[f, j] + "
    "W[f, j] point_tails[p] where nothing is scaled. Lengths in units of unit_cm centimeters. "
    "values are the channels as the file has them, called names; invalid where mask is False, and "
    "what depends on them is NaN."
)


def pose_arrays(motion: Motion) -> dict[str, Items]:
    """Skeleton, rotations, translations and positions of a motion, by name; see ``ABOUT``.

    Rotations and positions are left out if the skeleton has no kinematics.
    """
    skeleton = motion.skeleton
    known: dict[str, Items] = {
        "about": np.array(ABOUT),
        "name": np.array(motion.name),
        "joint_names": np.array(skeleton.joint_names, np.str_),
        "parents": skeleton.parents,
        "offsets": skeleton.offsets,
        "unit_cm": np.array(np.nan if skeleton.unit_cm is None else skeleton.unit_cm),
        "up_axis": np.array(skeleton.up_axis),
        "forward_axis": np.array(skeleton.forward_axis),
        "handedness": np.array(skeleton.handedness),
        "angle_unit": np.array(skeleton.angle_unit),
        "metadata_keys": np.array(list(motion.metadata), np.str_),
        "metadata_values": np.array(list(motion.metadata.values()), np.str_),
    }
    try:
        return known | _poses(motion)
    except MotionError:  # plain scalars, or angles of an unknown unit
        return known


def _poses(motion: Motion) -> dict[str, Items]:
    skeleton = motion.skeleton
    poses = frame_poses_of(skeleton)
    points = positions(motion)
    joints = range(skeleton.n_joints)
    values = np.asarray(motion.values, np.float64)
    origins, world = poses.origins(values, joints), poses.world(values, joints)
    translations = origins.copy()
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            step = origins[:, joint] - origins[:, parent]
            translations[:, joint] = np.einsum("fji,fj->fi", world[:, parent], step)
    return {
        "quaternions": rotations(motion, "quat"),
        "translations": translations,
        "positions": points,
        "point_names": np.array(point_names(skeleton), np.str_),
        "point_joints": np.array(poses.joints_of(range(points.shape[1])), np.int64),
        "point_tails": poses.tails(),
    }


TEXTS = ("label", "context", "subject", "description")


class Event(Protocol):
    """The part of a ``mcz.Event`` that a table shows: its time and ``TEXTS``."""

    @property
    def time(self) -> float: ...


Events = Sequence[Event]


def events_to_csv(events: Events) -> bytes:
    """UTF-8 text: a header row, then a row an event; times in seconds, see ``mcz.times``.

    Texts are escaped as in other tables.
    """
    rows = (
        [repr(event.time), *(spreadsheet_cell(printable(getattr(event, n))) for n in TEXTS)]
        for event in events
    )
    return _csv_of((["time", *TEXTS], *rows))


def events_to_npz(events: Events) -> bytes:
    """A NumPy archive of times (float64, seconds), label, context, subject, description."""
    columns: Settings = {
        name: np.array([getattr(event, name) for event in events], np.str_) for name in TEXTS
    }
    return _npz_of(times=np.array([event.time for event in events], np.float64), **columns)


EVENT_EXPORTS: dict[str, Callable[[Events], bytes]] = {"csv": events_to_csv, "npz": events_to_npz}


COMPONENTS = {
    "quat": ("rotation", ["w", "x", "y", "z"]),
    "rotvec": ("rotation", ["x", "y", "z"]),
    "6d": ("rotation", ["xx", "yx", "zx", "xy", "yy", "zy"]),
    "euler": ("rotation", ["X", "Y", "Z"]),
}


@check_arguments(motion=A_MOTION)
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
        raise OptionError(f"unknown rotations {form!r}; known are {', '.join(COMPONENTS)}")
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


@check_arguments(motion=A_MOTION)
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
        pairs = _pairs(pandas, _names(motion, joints), COMPONENTS[what][1], flat)
        return _table(pandas, motion, motion.signals[0], array, pairs)
    if what == "channels" or what in signals:
        signal = motion.signals[0] if what == "channels" else signals[what]
        names = tuple(channel_names(motion.skeleton, signal.channels))
        return _table(pandas, motion, signal, signal.masked(), names)
    known = [*PLACES, *COMPONENTS, "channels", *signals]
    raise OptionError(f"unknown table {what!r}; it must be one of {', '.join(known)}")


def _names(motion: Motion, joints: Joints) -> tuple[str, ...]:
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
