"""``movement``: a poses dataset of xarray, keypoints of individuals over time."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError
from mcz.files.reading.source_files import SourceOptions
from mcz.kinematics.poses import point_names, positions
from mcz.model.checks import check_arguments
from mcz.model.clock import Timeline, numbers_or_rows
from mcz.model.extras import import_extra
from mcz.model.motion import A_MOTION, Channel, Joint, Motion, Signal, Skeleton, frame_rate_of
from mcz.model.numbers import Grid, GridKind
from mcz.model.skeleton import AXES
from mcz.model.types import Floats, JsonObject, Reals, Values
from mcz.model.units import UNIT_CM

if TYPE_CHECKING:
    from xarray import DataArray, Dataset

DIMS = ("time", "space", "keypoints", "individuals")
# names of dimensions in other versions
SINGULAR = {"keypoint": "keypoints", "individual": "individuals"}
CONFIDENCE = "confidence"  # the signal of it
SEPARATOR = ":"  # between an individual and its keypoint, as in labels of C3D
SLACK = 1e-3  # greatest deviation of a time, in frames


@check_arguments(motion=A_MOTION)
def to_movement(motion: Motion, *, unit: str | None = None) -> Dataset:
    """The points of a motion as a poses dataset of ``movement``; needs xarray (``mcz[xarray]``).

    ``position`` (time, space, keypoints, individuals) in length units or ``unit``, NaN if
    unknown; ``confidence`` is the motion's if it has one, else 1, and 0 where a point is unknown.
    Times are those of ``mcz.times``, frames from 0 on if unknown. Points called
    ``individual:keypoint`` are individuals, if all of these have the same keypoints; otherwise
    there is one, with the name of the motion. Raises as ``mcz.positions``.
    """
    xarray = import_extra("xarray", "xarray")
    names = point_names(motion.skeleton)
    individuals, keypoints = _grid_of(names, motion.name)
    shape = (motion.n_frames, len(individuals), len(keypoints))
    places = positions(motion, unit=unit).reshape(*shape, 3)
    is_flat = bool(names) and all(channel.kind != "tz" for channel in motion.skeleton.channels)
    is_flat &= set(motion.skeleton.parents.tolist()) == {-1}
    places = places[..., :2] if is_flat and not places[..., 2].any() else places
    numbers, rate = numbers_or_rows(motion.frame_numbers, motion.n_frames), motion.frame_rate
    timeline = motion.timeline
    facts: JsonObject = {"ds_type": "poses", "source_software": "mcz"}
    facts["time_unit"] = "frames" if timeline is None else "seconds"
    facts |= {} if rate is None else {"fps": float(rate)}
    unit_cm = motion.skeleton.unit_cm
    length = unit or next((name for name, cm in UNIT_CM.items() if cm == unit_cm), "")
    facts |= {"length_unit": length} if length else {}
    facts |= {"up_axis": motion.skeleton.up_axis} if motion.skeleton.up_axis else {}
    dataset: Dataset = xarray.Dataset(
        {
            "position": (DIMS, places.transpose(0, 3, 2, 1)),
            "confidence": (
                (DIMS[0], *DIMS[2:]),
                _confidence(motion, places).reshape(shape).transpose(0, 2, 1),
            ),
        },
        {
            "time": numbers - 1 if timeline is None else timeline.times,
            "space": ["x", "y", "z"][: places.shape[3]],
            "keypoints": keypoints,
            "individuals": individuals,
        },
        facts,
    )
    return dataset


def from_movement(
    dataset: Dataset, *, name: str = "motion", unit: str | None = None, up: str | None = None
) -> Motion:
    """A poses dataset of ``movement``, or any of its layout, as markers.

    Keypoints of several individuals are called ``individual:keypoint``. NaN is an unknown position;
    a confidence that varies is a signal ``confidence``. Positions keep their float32 or float64
    numbers. Times are kept; frame numbers follow the times, from 1 on, or the frames from the first
    time on. Other variables and attributes are left out. ``unit`` and ``up`` state facts that the
    dataset lacks. Raises OptionError for another layout, and for times that are not at frames of
    its rate.
    """
    if not hasattr(dataset, "data_vars") or "position" not in dataset:
        raise OptionError("not a poses dataset of movement: it has no variable 'position'")
    position = _transpose(dataset["position"], DIMS)
    space = [str(axis) for axis in position["space"].values]
    if space not in (["x", "y"], ["x", "y", "z"]):
        raise OptionError(f"positions are along {', '.join(space)}, not x, y or x, y, z")
    places = position.values.transpose(0, 3, 2, 1)
    keypoints = [str(each) for each in position["keypoints"].values]
    individuals = [str(each) for each in position["individuals"].values]
    names = keypoints
    if len(individuals) != 1:
        names = [SEPARATOR.join((one, key)) for one in individuals for key in keypoints]
    channels = tuple(Channel(f"t{axis}") for axis in space)
    joints = tuple(Joint(each, channels=channels) for each in names)
    signals = [_signal(places.reshape(len(places), -1), "motion", None)]
    if "confidence" in dataset:
        sure = _transpose(dataset["confidence"], (DIMS[0], *DIMS[2:])).values.transpose(0, 2, 1)
        if np.isfinite(sure).any():
            of_points = tuple(Channel("", each) for each in names)
            signal = _signal(sure.reshape(len(sure), -1), CONFIDENCE, of_points)
            signals.append(replace(signal, role=CONFIDENCE))
    times = np.asarray(position["time"].values, np.float64)
    rate, numbers = _frames(dataset, times, name)
    facts = dataset.attrs
    unit = unit or (facts.get("length_unit") if facts.get("length_unit") in UNIT_CM else None)
    up = up or (facts.get("up_axis") if facts.get("up_axis") in AXES[1:] else None)
    skeleton = Skeleton(joints, angle_unit="")
    motion = Motion(skeleton, tuple(signals), None, name=name, frame_numbers=numbers)
    motion = SourceOptions(unit=unit, up=up).applied_to(replace(motion, frame_rate=rate))
    if rate is None or dataset.attrs.get("time_unit", "seconds") != "seconds":
        return motion
    return motion.at_times(Timeline(times.copy(), rate))


def _grid_of(names: tuple[str, ...], name: str) -> tuple[list[str], list[str]]:
    """Individuals and keypoints whose product the points are, in order."""
    pairs = [name.rpartition(SEPARATOR) for name in names]
    individuals = list(dict.fromkeys(one for one, _, _ in pairs))
    keypoints = list(dict.fromkeys(key for _, _, key in pairs))
    if len(individuals) > 1 and "" not in individuals:
        every = [SEPARATOR.join((one, key)) for one in individuals for key in keypoints]
        if every == list(names):
            return individuals, keypoints
    return [name], list(names)


def _confidence(motion: Motion, places: Reals) -> Floats:
    for signal in motion.signals[1:]:
        if signal.role == CONFIDENCE and signal.n_channels == places.shape[1] * places.shape[2]:
            return np.asarray(signal.masked(), np.float64)
    return np.asarray(np.isfinite(places).all(axis=3), np.float64)


def _transpose(array: DataArray, dims: tuple[str, ...]) -> DataArray:
    """The array with its axes in this order; raises OptionError for other axes."""
    array = array.rename({old: new for old, new in SINGULAR.items() if old in array.dims})
    if set(array.dims) != set(dims):
        dims_text = ", ".join(map(str, array.dims))
        raise OptionError(f"{array.name} is along {dims_text}, not {', '.join(dims)}")
    for dim in dims:
        if dim not in array.coords:
            raise OptionError(f"{array.name} has no coordinates along {dim}")
    return array.transpose(*dims)


def _signal(values: Values, name: str, channels: tuple[Channel, ...] | None) -> Signal:
    """Values on the grid of their type, invalid if they are NaN."""
    kind = GridKind.BINARY32 if values.dtype == np.float32 else GridKind.BINARY64
    known = np.isfinite(values)
    return Signal(
        np.where(known, values, 0.0).astype(np.float64),
        (Grid(kind),) * values.shape[1],
        name,
        mask=None if known.all() else known,
        channels=channels,
    )


def _frames(
    dataset: Dataset, times: Floats, name: str
) -> tuple[Fraction | None, NDArray[np.int64] | None]:
    """The rate, None while unknown, and the frame numbers, None for 1, 2, 3, ..."""
    fps = dataset.attrs.get("fps")
    in_seconds = dataset.attrs.get("time_unit", "seconds" if fps else "frames") == "seconds"
    if fps is None and in_seconds:
        raise OptionError("times are in seconds, but the attribute 'fps' is missing")
    counted = times if fps is None or not in_seconds else times * float(fps)
    numbers = np.rint(counted)
    if not (np.abs(counted - numbers) <= SLACK).all():
        counted = counted - counted[:1]
        numbers = np.rint(counted)
    if not (np.abs(counted - numbers) <= SLACK).all():
        raise OptionError(f"times do not match {fps or 1} frames a second")
    counts = numbers.astype(np.int64) + 1
    rate = None if fps is None else frame_rate_of(fps, name)
    return rate, None if (counts == np.arange(1, len(counts) + 1)).all() else counts
