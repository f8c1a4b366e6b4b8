"""Tables of numbers and events as files, CSV and NPZ; docs/guides/tables.md describes them."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError
from mcz.kinematics.frames import frame_poses_of
from mcz.kinematics.poses import point_names, positions, rotations
from mcz.model.clock import numbers_or_rows
from mcz.model.motion import Channel, Joint, Motion, Skeleton
from mcz.model.text_format import printable, spreadsheet_cell
from mcz.model.types import Items, Settings

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
    units: Sequence[str] = ()  # of the columns, "" where unknown; empty: those of the skeleton
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

    Of a signal with ``own`` channels their names, or ``channel-n`` without one.
    """
    if own is not None:
        return [channel.label or f"channel-{n}" for n, channel in enumerate(own)]
    return [
        address if is_number(joint) else f"{address}.{channel.label}"
        for address, joint in zip(skeleton.addresses(), skeleton.joints, strict=True)
        for channel in joint.channels
    ]


def is_number(joint: Joint) -> bool:
    """Return whether a joint is a column of a table: one plain scalar without a name of its own."""
    return len(joint.channels) == 1 and (joint.channels[0].kind, joint.channels[0].label) == (
        "",
        "value",
    )


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
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    units = table.units or [""] * len(table.names)
    heads = [f"{n} [{u}]" if u else n for n, u in zip(table.names, units, strict=True)]
    first: list[list[Any]] = [table.frame_numbers.tolist()]
    if table.times is not None and table.names[:1] != ["time"]:
        first.append(list(map(repr, table.times.round(DECIMALS).tolist())))
    writer.writerow(
        [*("frame", "time")[: len(first)], *map(spreadsheet_cell, map(printable, heads))]
    )
    for *lead, values, valid in zip(
        *first, table.values.tolist(), table.mask.tolist(), strict=True
    ):
        cells = [repr(v) if ok else "" for v, ok in zip(values, valid, strict=True)]
        writer.writerow([*lead, *cells])
    return text.getvalue().encode("utf-8", "surrogateescape")


def to_npz(table: Table) -> bytes:
    """A NumPy archive of values, mask, frames, rate, names and, if known, times and units.

    Of a whole motion also its skeleton and poses (``pose_arrays``). ``sample_rate`` counts rows a
    second, of which a frame may have several. No pickles.
    """
    rate = table.frame_rate
    if rate is not None and max(rate.numerator, rate.denominator) >= 2**63:
        raise MotionError(f"a frame rate of {float(rate):g}: an NPZ has terms below 2^63")
    more: Settings = {"units": np.array(table.units, np.str_)} if table.units else {}
    more |= {} if table.times is None else {"times": table.times}
    if table.motion is not None:
        more |= pose_arrays(table.motion)
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
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
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time", *TEXTS])
    for event in events:
        texts = (spreadsheet_cell(printable(getattr(event, name))) for name in TEXTS)
        writer.writerow([repr(event.time), *texts])
    return text.getvalue().encode("utf-8", "surrogateescape")


def events_to_npz(events: Events) -> bytes:
    """A NumPy archive of times (float64, seconds), label, context, subject, description."""
    buffer = io.BytesIO()
    columns: Settings = {
        name: np.array([getattr(event, name) for event in events], np.str_) for name in TEXTS
    }
    np.savez_compressed(
        buffer, times=np.array([event.time for event in events], np.float64), **columns
    )
    return buffer.getvalue()


EVENT_EXPORTS: dict[str, Callable[[Events], bytes]] = {"csv": events_to_csv, "npz": events_to_npz}
