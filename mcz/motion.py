"""The data model: Joint, Skeleton, Signal, Source and Motion, checked on creation.

Nothing here reads or writes files. SPEC.md, "SKEL" and "CLIP", have the stored form.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from operator import itemgetter
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mcz import brief
from mcz.errors import MotionError
from mcz.numbers import Grid, GridKind
from mcz.numbers.blocks import grid_blocks as grid_blocks

Vector = tuple[float, float, float]
ORIGIN: Vector = (0.0, 0.0, 0.0)

POSITION_KINDS = ("tx", "ty", "tz")
ROTATION_KINDS = ("rx", "ry", "rz")
CHANNEL_KINDS = (
    *POSITION_KINDS,
    *ROTATION_KINDS,
    *("sx", "sy", "sz"),
    "length",
    *("qw", "qx", "qy", "qz"),
)


@dataclass(frozen=True, slots=True)
class Channel:
    """One scalar signal over time.

    ``kind`` is a name of ``CHANNEL_KINDS``, or "" for a plain scalar, which then has a ``name``
    and perhaps a ``unit`` of its own and takes no part in kinematics.
    """

    kind: str
    name: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        if self.kind and self.kind not in CHANNEL_KINDS:
            raise MotionError(f"channel kind {self.kind!r} is not in the registry; use kind ''")

    @property
    def label(self) -> str:
        return self.name or self.kind


@dataclass(frozen=True, slots=True)
class Joint:
    """A node of the skeleton.

    ``offset`` leads from the parent's origin to the joint's own, in length units, along the
    parent's axes. ``tails`` are the ends of bones without a joint of their own: the ASF bone's
    vector, or BVH end sites, along the joint's axes. ``axis`` are the Euler angles that orient the
    local axes (ASF ``axis``), applied in ``axis_order``, first letter first, about fixed axes.
    ``adds_to_offset``: position channels add to the offset; otherwise they replace it.
    """

    name: str
    parent: int = -1
    offset: Vector = ORIGIN
    tails: tuple[Vector, ...] = ()
    axis: Vector = ORIGIN
    axis_order: str = "XYZ"
    channels: tuple[Channel, ...] = ()
    adds_to_offset: bool = True

    def __post_init__(self) -> None:
        vectors = (self.offset, self.axis, *self.tails)
        if not all(map(_is_vector, vectors)):
            raise MotionError(f"joint {self.name!r}: not three finite numbers among {vectors}")
        if sorted(self.axis_order) != ["X", "Y", "Z"]:
            raise MotionError(f"joint {self.name!r}: axis order {self.axis_order!r}")


def _is_vector(vector: Any) -> bool:
    with suppress(TypeError):
        return len(vector) == 3 and all(map(math.isfinite, vector))  # SKEL-08
    return False


@dataclass(frozen=True, slots=True)
class Skeleton:
    """The joints of a clip, parents before children, and what their numbers mean.

    ``unit_cm`` is the length of one unit in centimeters, None while unknown; ``angle_unit`` is
    "deg", "rad" or "" (unknown); ``up_axis`` is "x", "y", "z" or "" (unknown).
    ``intrinsic``: the rotation channels of a joint apply about the axes that turn with it, as
    listed (BVH); otherwise about fixed axes (Acclaim).
    ``base`` is the id of the skeleton that this one was derived from.
    """

    joints: tuple[Joint, ...]
    name: str = ""
    unit_cm: float | None = None
    angle_unit: str = "deg"
    up_axis: str = ""
    intrinsic: bool = True
    base: bytes | None = None
    source: Source | None = field(default=None, compare=False, repr=False)

    __repr__ = brief.skeleton_text

    def __post_init__(self) -> None:
        for index, joint in enumerate(self.joints):
            if not -1 <= joint.parent < index:  # SKEL-05
                raise MotionError(
                    f"joint {index} ({joint.name!r}): parent {joint.parent} is not before it"
                )
        if self.unit_cm is not None and not 0 < self.unit_cm < math.inf:  # SKEL-01
            raise MotionError(f"unit of {self.unit_cm} cm")
        if self.angle_unit not in ("deg", "rad", ""):
            raise MotionError(f"angle unit {self.angle_unit!r}")
        if self.up_axis not in ("x", "y", "z", ""):
            raise MotionError(f"up axis {self.up_axis!r}")

    @property
    def channels(self) -> tuple[Channel, ...]:
        """All channels, in column order."""
        return tuple(channel for joint in self.joints for channel in joint.channels)

    @property
    def n_joints(self) -> int:
        return len(self.joints)

    @property
    def n_channels(self) -> int:
        return sum(len(joint.channels) for joint in self.joints)

    @property
    def parents(self) -> NDArray[np.int64]:
        return np.array([joint.parent for joint in self.joints], dtype=np.int64)

    def columns(self, joint: int) -> range:
        """The columns of joint ``joint``."""
        start = sum(len(j.channels) for j in self.joints[:joint])  # SKEL-06
        return range(start, start + len(self.joints[joint].channels))

    def addresses(self) -> list[str]:
        """The name of every joint, made unique: ``name#n`` from the second of a name on."""
        seen: dict[str, int] = {}
        names = []
        for joint in self.joints:
            seen[joint.name] = n = seen.get(joint.name, -1) + 1
            names.append(joint.name if n == 0 else f"{joint.name}#{n}")
        return names

    def find(self, joint: int | str) -> int:
        """The index of a joint given by index or by name, ``name[#n]`` where a name repeats.

        Raises MotionError where there is no such joint.
        """
        if isinstance(joint, str):
            addresses = self.addresses()
            if joint in addresses:
                return addresses.index(joint)
            if joint.isascii() and joint.isdigit() and len(joint) < 10:
                joint = int(joint)
        if isinstance(joint, (int, np.integer)) and 0 <= joint < self.n_joints:
            return int(joint)
        raise MotionError(f"no joint {joint!r} among {', '.join(self.addresses()) or 'no joints'}")


class FrameNotes(Protocol):
    """What a source says about each frame beside its values; a source format defines it."""

    def cut(self, start: int, stop: int) -> bytes:
        """The notes of frames start <= f < stop as bytes of a segment, b"" where all is usual."""


@dataclass(frozen=True, slots=True)
class Source:
    """What is needed, beside the values, to restore a source file byte for byte.

    ``template`` is shared by clips that were printed alike; ``detail`` belongs to this clip;
    ``notes`` holds what is said frame by frame. All three are defined by the source format.
    """

    format: str
    template: bytes = field(repr=False)
    detail: bytes = b""
    notes: FrameNotes | None = field(default=None, repr=False)
    path: str = ""
    size: int = 0
    sha256: bytes = b""

    __repr__ = brief.source_text


@dataclass(frozen=True, slots=True, eq=False)
class Exceptions:
    """Tokens of a text source that their grid does not print, sorted by row, then channel."""

    rows: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    channels: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    texts: tuple[bytes, ...] = ()

    __repr__ = brief.exceptions_text

    def __post_init__(self) -> None:
        if not len(self.rows) == len(self.channels) == len(self.texts):
            raise MotionError("exceptions: rows, channels and texts differ in number")

    def __len__(self) -> int:
        return len(self.texts)


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """Values of some channels over time.

    ``values`` has shape (n_frames * samples_per_frame, n_channels): binary64 in source units, or
    int64 where every grid is INTEGER. ``grids`` has one grid a channel; ``grid_changes`` lists
    (row, channel, grid) from that row on. ``mask`` (bool, same shape) is True where the value is
    valid; None means valid everywhere. Stored coordinates are kept beneath an invalid mark.
    """

    values: NDArray[Any]
    grids: tuple[Grid, ...] = ()
    name: str = "motion"
    samples_per_frame: int = 1
    mask: NDArray[np.bool_] | None = None
    exceptions: Exceptions = field(default_factory=Exceptions)
    grid_changes: tuple[tuple[int, int, Grid], ...] = ()
    channels: tuple[Channel, ...] | None = None  # None: those of the skeleton
    ordinals: NDArray[np.int64] | None = None  # on their grids; see ``to_ordinals``

    __repr__ = brief.signal_text

    def __post_init__(self) -> None:
        if self.values.ndim != 2:
            raise MotionError(f"signal {self.name!r}: values of shape {self.values.shape}, not 2-D")
        if self.values.dtype not in (np.float64, np.int64):
            raise MotionError(f"signal {self.name!r}: values of type {self.values.dtype}")
        if not self.grids:
            kind = GridKind.BINARY64 if self.values.dtype == np.float64 else GridKind.INTEGER
            object.__setattr__(self, "grids", (Grid(kind),) * self.n_channels)
        if len(self.grids) != self.n_channels:
            raise MotionError(
                f"signal {self.name!r}: {len(self.grids)} grids, {self.n_channels} channels"
            )
        integers = self.n_channels > 0 and all(g.kind == GridKind.INTEGER for g in self.grids)
        if integers != (self.values.dtype == np.int64):
            raise MotionError(
                f"signal {self.name!r}: {self.values.dtype} values on {self.grids[:1]}"
            )
        if self.samples_per_frame < 1 or len(self.values) % self.samples_per_frame:
            raise MotionError(
                f"signal {self.name!r}: {len(self.values)} rows at {self.samples_per_frame} a frame"
            )
        self._check_order()
        if self.ordinals is not None and self.ordinals.shape != self.values.shape:
            raise MotionError(f"signal {self.name!r}: ordinals do not match the values")
        if self.mask is not None and (
            self.mask.shape != self.values.shape or self.mask.dtype != np.bool_
        ):
            raise MotionError(f"signal {self.name!r}: mask does not match the values")

    def _check_order(self) -> None:
        """Exceptions and grid changes lie in the signal, exceptions in order."""
        rows, channels = self.exceptions.rows, self.exceptions.channels
        cells = rows * max(1, self.n_channels) + channels
        inside = (rows >= 0) & (rows < self.n_rows) & (channels >= 0) & (channels < self.n_channels)
        if not inside.all() or (np.diff(cells) <= 0).any():
            raise MotionError(f"signal {self.name!r}: exceptions outside of it or out of order")
        for row, channel, _ in self.grid_changes:
            whole = row >= 0 and row % self.samples_per_frame == 0
            if not (whole and 0 <= channel < self.n_channels):
                raise MotionError(f"signal {self.name!r}: grid change at {row}, {channel}")

    @property
    def n_rows(self) -> int:
        return int(self.values.shape[0])

    @property
    def n_channels(self) -> int:
        return int(self.values.shape[1])

    @property
    def n_frames(self) -> int:
        return self.n_rows // self.samples_per_frame

    def grid_blocks(self) -> Iterator[tuple[slice, list[int], Grid]]:
        """Blocks (rows, columns, grid) that cover the signal, each of one grid."""
        return grid_blocks(self.n_rows, self.grids, self.grid_changes)

    def cut(self, start: int, stop: int) -> Signal:
        """Frames start <= f < stop alone, with the grids that are in force there."""
        first, last = start * self.samples_per_frame, stop * self.samples_per_frame
        grids, changes = list(self.grids), []
        for row, channel, grid in sorted(self.grid_changes, key=itemgetter(0)):
            if row <= first:
                grids[channel] = grid
            elif row < last:
                changes.append((row - first, channel, grid))
        low, high = np.searchsorted(self.exceptions.rows, (first, last)).tolist()
        return replace(
            self,
            values=self.values[first:last],
            grids=tuple(grids),
            mask=None if self.mask is None else self.mask[first:last],
            exceptions=Exceptions(
                self.exceptions.rows[low:high] - first,
                self.exceptions.channels[low:high],
                self.exceptions.texts[low:high],
            ),
            grid_changes=tuple(changes),
            ordinals=None if self.ordinals is None else self.ordinals[first:last],
        )

    def to_ordinals(self) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """The ordinal of every value, and whether it gives exactly this value back.

        A binary grid has many NaNs, of which ``values`` shows only that they are NaN: where
        ``ordinals`` are given and still mean the value that is there, they are taken.
        """
        ordinals = np.empty(self.values.shape, np.int64)
        exact = np.empty(self.values.shape, np.bool_)
        for rows, columns, grid in self.grid_blocks():
            block = np.ascontiguousarray(self.values[rows][:, columns])
            found, on_grid = grid.ordinals(block)
            if self.ordinals is not None:
                given = np.ascontiguousarray(self.ordinals[rows][:, columns])
                meant = grid.values(given)
                same = (meant.view(np.int64) == block.view(np.int64)) | (
                    np.isnan(meant) & np.isnan(block)
                )
                found, on_grid = np.where(same, given, found), on_grid | same
            ordinals[rows, columns], exact[rows, columns] = found, on_grid
        return ordinals, exact

    def masked(self) -> NDArray[np.float64]:
        """The values with NaN where the mask says invalid."""
        if self.mask is None:
            return self.values
        return np.where(self.mask, self.values, np.nan)


def _positive(rate: Any, name: str) -> Fraction:
    """A frame rate as a Fraction, the nearest one to a number of another kind."""
    with suppress(TypeError, ValueError, OverflowError):  # no number, NaN, infinite
        exact = isinstance(rate, Fraction)
        value: Fraction = rate if exact else Fraction(float(rate)).limit_denominator(2**52)
        if value > 0:
            return value
    raise MotionError(f"motion {name!r}: frame rate {rate!r}")


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A skeleton in motion: the motion signal first, then any others (analog, ...).

    ``frame_rate`` in frames a second, None while unknown; ``frame_rate_exact`` is False where the
    source gave a rounded frame time. ``frame_numbers`` (int64) is None for 1, 2, 3, ...
    ``metadata`` maps keys of SPEC.md's registry, or private ``x-`` keys, to text.
    """

    skeleton: Skeleton
    signals: tuple[Signal, ...]
    frame_rate: Fraction | None = None
    frame_rate_exact: bool = True
    name: str = "motion"
    metadata: Mapping[str, str] = field(default_factory=dict)
    source: Source | None = None
    frame_numbers: NDArray[np.int64] | None = None

    __repr__ = brief.motion_text

    def __post_init__(self) -> None:
        if not self.signals:
            raise MotionError(f"motion {self.name!r} has no signal")
        if self.signals[0].channels is None and (
            self.signals[0].n_channels != self.skeleton.n_channels
        ):
            raise MotionError(
                f"motion {self.name!r}: {self.signals[0].n_channels} columns, "
                f"but the skeleton has {self.skeleton.n_channels} channels"
            )
        counts = {signal.n_frames for signal in self.signals}
        if len(counts) > 1:
            raise MotionError(f"motion {self.name!r}: signals of {sorted(counts)} frames")
        if self.frame_rate is not None:
            object.__setattr__(self, "frame_rate", _positive(self.frame_rate, self.name))
        if self.frame_numbers is not None and len(self.frame_numbers) != self.n_frames:
            raise MotionError(f"motion {self.name!r}: {len(self.frame_numbers)} frame numbers")

    @property
    def values(self) -> NDArray[np.float64]:
        """The motion signal, (n_frames, n_channels), NaN where invalid."""
        return self.signals[0].masked()

    @property
    def n_frames(self) -> int:
        return self.signals[0].n_frames

    def with_values(self, values: NDArray[np.float64]) -> Motion:
        """The same motion with other values of its motion signal, same shape."""
        signal = replace(self.signals[0], values=np.asarray(values, dtype=np.float64))
        source = self.source and replace(self.source, size=0, sha256=b"")  # of no known file
        return replace(self, signals=(signal, *self.signals[1:]), source=source)


def joint_columns(skeleton: Skeleton, joints: Sequence[int | str]) -> list[int]:
    """The columns of the named joints, in the order given."""
    return [c for joint in joints for c in skeleton.columns(skeleton.find(joint))]
