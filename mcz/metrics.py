"""How far a decoded motion is from the original: channels, points, virtual markers.

SPEC.md, "Metrics", defines every id. Figures are sums of binary64 in no fixed order: they agree
between machines to about 1e-9, not to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcz.angles import without_turns
from mcz.brief import brief
from mcz.errors import MczError, MotionError
from mcz.kinematics import point_names, point_set, points_and_markers_of, positions_of
from mcz.motion import POSITION_KINDS, Motion, Signal, Skeleton

Values = NDArray[np.float64]
Number = float | None

BLOCK = 2**19  # numbers that are worked on at a time: what bounds the memory


@dataclass(frozen=True, slots=True)
class Comparison:
    """The figures of one motion against another; None where there is no such figure.

    Distances are Euclidean, per point, in length units of the original or, ``_cm``, in
    centimeters; ``mse`` mixes degrees and length units, as the papers do. ``where`` is the frame
    (from 0) and the point of the greatest distance; ``notes`` say why a figure is missing.
    ``signals`` holds the MSE of every further signal, by name.
    """

    frames: int
    channels: int | None = None
    mse: Number = None
    mse_raw: Number = None
    mismatched_values: int | None = None
    point_set: str | None = None
    points: int | None = None
    unit_cm: Number = None
    rms_coordinate_error: Number = None
    mean_position_error: Number = None
    max_position_error: Number = None
    where: tuple[int, str] | None = None
    mismatched_points: int | None = None
    sqnr_db: Number = None
    virtual_marker_mean_cm: Number = None
    virtual_marker_max_cm: Number = None
    signals: Mapping[str, Number] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    __repr__ = brief

    @property
    def mean_position_error_cm(self) -> Number:
        return _times(self.mean_position_error, self.unit_cm)

    @property
    def max_position_error_cm(self) -> Number:
        return _times(self.max_position_error, self.unit_cm)

    def entries(self) -> dict[str, float | int | str | None]:
        """The figures by the metric ids of SPEC.md, in its order."""
        frame, point = self.where or (None, None)
        return {
            "frames": self.frames,
            "channels": self.channels,
            "mse": self.mse,
            "mse_raw": self.mse_raw,
            "mismatched_values": self.mismatched_values,
            "point_set": self.point_set,
            "points": self.points,
            "unit_cm": self.unit_cm,
            "rms_coordinate_error": self.rms_coordinate_error,
            "mean_position_error": self.mean_position_error,
            "mean_position_error_cm": self.mean_position_error_cm,
            "max_position_error": self.max_position_error,
            "max_position_error_cm": self.max_position_error_cm,
            "max_position_error_frame": frame,
            "max_position_error_point": point,
            "mismatched_points": self.mismatched_points,
            "sqnr_db": self.sqnr_db,
            "virtual_marker_mean_cm": self.virtual_marker_mean_cm,
            "virtual_marker_max_cm": self.virtual_marker_max_cm,
            **{f"signal.{name}.mse": value for name, value in self.signals.items()},
        }


def compare(original: Motion, decoded: Motion, *, virtual_markers: bool = True) -> Comparison:
    """The figures of ``decoded`` against ``original``; SPEC.md, "Metrics", defines them.

    Without ``virtual_markers``, which take most of the time, theirs are None. Figures that make no
    sense for these two (other channels, other points) are None too, with a note. Raises
    MotionError where the two differ in frames, or in rows a frame.
    """
    a, b = original.signals[0], decoded.signals[0]
    if a.n_frames != b.n_frames or a.samples_per_frame != b.samples_per_frame:
        raise MotionError(
            f"{original.name!r} has {_extent(a)}, {decoded.name!r} has {_extent(b)}: "
            "only the same frames can be compared"
        )
    notes: list[str] = []
    unit, scale = _common_unit(original.skeleton, decoded.skeleton, notes)
    channels, points, markers = _ChannelErrors(original.skeleton, a), _PointErrors(), _PointErrors()
    same = _same_channels(original, decoded, notes)
    placed = _same_points(original, decoded, notes)
    marked = placed and unit is not None and virtual_markers
    marked = marked and _same_axes(original.skeleton, decoded.skeleton, notes)
    n_points = len(point_names(original.skeleton)) if placed else 0
    with np.errstate(all="ignore"):  # what overflows is no figure
        for start, left, right in _blocks(original, decoded):
            if same:
                channels.add(left, right)
            if marked:
                ours, ours_marked = points_and_markers_of(original.skeleton, left)
                theirs, theirs_marked = _positions(original.skeleton, decoded.skeleton, right)
                points.add(start, ours, _scaled(theirs, scale))
                markers.add(start, ours_marked, _scaled(theirs_marked, scale))
            elif placed:
                ours = positions_of(original.skeleton, left)
                theirs = positions_of(decoded.skeleton, right)[:, :n_points]
                points.add(start, ours, _scaled(theirs, scale))
        further = _further_signals(original, decoded, notes)
    return Comparison(
        frames=a.n_frames,
        channels=a.n_channels if same else None,
        mse=channels.mse,
        mse_raw=channels.mse_raw,
        mismatched_values=channels.mismatched if same else None,
        point_set=point_set(original.skeleton) if placed else None,
        points=len(point_names(original.skeleton)) if placed else None,
        unit_cm=unit,
        rms_coordinate_error=points.rms,
        mean_position_error=points.mean,
        max_position_error=points.greatest,
        where=points.located(original.skeleton, a.samples_per_frame),
        mismatched_points=points.mismatched if placed else None,
        sqnr_db=points.sqnr_db,
        virtual_marker_mean_cm=_times(markers.mean, unit),
        virtual_marker_max_cm=_times(markers.greatest, unit),
        signals=further,
        notes=tuple(notes),
    )


class _ChannelErrors:
    """Squared differences of two signals with the same channels, block after block."""

    def __init__(self, skeleton: Skeleton, signal: Signal) -> None:
        self._skeleton, self._channels = skeleton, signal.channels
        self._n = self.mismatched = 0
        self._squares, self._raw = 0.0, 0.0

    def add(self, left: Values, right: Values) -> None:
        valid = np.isfinite(left) & np.isfinite(right)
        raw = np.where(valid, left - right, 0.0)
        difference = without_turns(raw, self._skeleton, self._channels)
        self._n += int(valid.sum())
        self.mismatched += int((np.isfinite(left) ^ np.isfinite(right)).sum())
        self._squares += float(np.sum(difference**2))
        self._raw += float(np.sum(raw**2))

    @property
    def mse(self) -> Number:
        return _mean(self._squares, self._n)

    @property
    def mse_raw(self) -> Number:
        return _mean(self._raw, self._n)


class _PointErrors:
    """Distances of two sets of points, block after block, in length units of the original."""

    def __init__(self) -> None:
        self._n = self.mismatched = 0
        self._distances, self._squares, self._power = 0.0, 0.0, 0.0
        self._worst, self._where = -1.0, (0, 0)

    def add(self, start: int, left: Values, right: Values) -> None:
        """Points of shape (n_rows, n_points, 3) from row ``start`` on, NaN where unknown."""
        known, found = (
            np.isfinite(x) & np.isfinite(y) & np.isfinite(z)
            for x, y, z in (np.moveaxis(left, 2, 0), np.moveaxis(right, 2, 0))
        )
        valid = known & found
        self.mismatched += int((known ^ found).sum())
        dx, dy, dz = np.moveaxis(left - right, 2, 0)  # much faster than a sum along a short axis
        squares = np.where(valid, dx * dx + dy * dy + dz * dz, 0.0)
        distances = np.sqrt(squares)
        self._n += int(valid.sum())
        self._squares += float(squares.sum())
        self._distances += float(distances.sum())
        x, y, z = np.moveaxis(left, 2, 0)
        self._power += float(np.where(valid, x * x + y * y + z * z, 0.0).sum())
        if not valid.any():
            return
        row, point = divmod(int(np.argmax(np.where(valid, distances, -1.0))), valid.shape[1])
        if distances[row, point] > self._worst:
            self._worst = float(distances[row, point])
            self._where = start + row, point

    @property
    def rms(self) -> Number:
        mean = _mean(self._squares, 3 * self._n)
        return None if mean is None else math.sqrt(mean)

    @property
    def sqnr_db(self) -> Number:
        noise, power = _mean(self._squares, self._n), _mean(self._power, self._n)
        if not noise or not power:
            return None
        return 10 * (math.log10(power) - math.log10(noise))

    @property
    def mean(self) -> Number:
        return _mean(self._distances, self._n)

    @property
    def greatest(self) -> Number:
        return _mean(self._worst, min(1, self._n))

    def located(self, skeleton: Skeleton, per_frame: int) -> tuple[int, str] | None:
        """Frame and point of the greatest distance, the first of equals."""
        if not self._n:
            return None
        return self._where[0] // per_frame, point_names(skeleton)[self._where[1]]


def _mean(total: float, n: int) -> Number:
    """``total / n``; None without values, or where it is beyond binary64."""
    return total / n if n and math.isfinite(total) else None


def _times(value: Number, factor: Number) -> Number:
    if value is None or factor is None:
        return None
    return _mean(value * factor, 1)


def _extent(signal: Signal) -> str:
    rate = signal.samples_per_frame
    return f"{signal.n_frames} frames" + (f" of {rate} rows" if rate > 1 else "")


def _common_unit(a: Skeleton, b: Skeleton, notes: list[str]) -> tuple[Number, float]:
    """The unit of distances in cm, and what lengths of ``b`` are multiplied by to be in it."""
    if a.unit_cm is not None and b.unit_cm is not None:
        return a.unit_cm, b.unit_cm / a.unit_cm
    if a.unit_cm is None and b.unit_cm is None:
        notes.append("the length unit is unknown: no figures in cm (--unit says it)")
    else:
        notes.append(
            "one side does not say its length unit: taken as the other's, no figures in cm "
            "(--unit says it)"
        )
    return None, 1.0


def _kinds(motion: Motion) -> list[tuple[str, str]]:
    """Kind and name of every channel of the motion signal."""
    own = motion.signals[0].channels
    return [(c.kind, c.name) for c in (motion.skeleton.channels if own is None else own)]


def _same_channels(original: Motion, decoded: Motion, notes: list[str]) -> bool:
    a, b = original.skeleton, decoded.skeleton
    kinds = _kinds(original)
    if kinds != _kinds(decoded):
        notes.append(
            f"other channels ({len(kinds)} and {len(_kinds(decoded))}): no errors of channels"
        )
        return False
    if a.angle_unit != b.angle_unit:
        notes.append(
            f"angles in {a.angle_unit or '?'} and {b.angle_unit or '?'}: no errors of channels"
        )
        return False
    lengths = {*POSITION_KINDS, "length"}
    apart = a.unit_cm is not None and b.unit_cm is not None and a.unit_cm != b.unit_cm
    if apart and any(kind in lengths for kind, _ in kinds):
        notes.append(f"units of {a.unit_cm:.6g} and {b.unit_cm:.6g} cm: no errors of channels")
        return False
    return True


def _same_points(original: Motion, decoded: Motion, notes: list[str]) -> bool:
    """Whether both have kinematics, with the same number of points."""
    counts = []
    for motion in (original, decoded):
        signal, skeleton = motion.signals[0], motion.skeleton
        try:
            if signal.channels is not None:
                raise MotionError("its channels are not those of the skeleton")
            positions_of(skeleton, _rows(signal, 0, min(1, signal.n_frames)))
            counts.append(len(point_names(skeleton)))
        except MczError as error:
            notes.append(f"no positions of {motion.name!r}: {error}")
            return False
    alike = counts[0] == counts[1] or _has_markers_of(original.skeleton, decoded.skeleton)
    if not (alike and counts[0]):
        sets = f"{point_set(original.skeleton)}, {point_set(decoded.skeleton)}"
        notes.append(f"{counts[0]} and {counts[1]} points ({sets}): no errors of positions")
        return False
    pairs = zip(point_names(original.skeleton), point_names(decoded.skeleton), strict=False)
    apart = [pair for pair in pairs if pair[0] != pair[1]]
    if apart:
        first = " and ".join(map(repr, apart[0]))
        notes.append(
            f"points are compared in order, and {len(apart)} of {counts[0]} have other names on "
            f"the other side, first {first}"
        )
    return True


def _same_axes(a: Skeleton, b: Skeleton, notes: list[str]) -> bool:
    """Whether both have joints that turn, or both markers, whose axes are those of the world."""
    sets = point_set(a), point_set(b)
    if "markers" in sets and sets[0] != sets[1] and not _has_markers_of(a, b):
        notes.append(f"points of {sets[0]} and {sets[1]}: no errors of virtual markers")
        return False
    return True


def _has_markers_of(a: Skeleton, b: Skeleton) -> bool:
    """Whether ``b`` holds the positions of points of ``a``, then of its virtual markers."""
    if point_set(b) != "markers" or point_set(a) == "markers":
        return False
    return b.n_joints == len(point_names(a)) + 3 * a.n_joints


def _positions(a: Skeleton, b: Skeleton, values: Values) -> tuple[Values, Values]:
    """Points and virtual markers of ``b``, which may hold both as markers, those of ``a``."""
    if _has_markers_of(a, b):
        both = positions_of(b, values)
        n_points = len(point_names(a))
        return both[:, :n_points], both[:, n_points:]
    return points_and_markers_of(b, values)


def _rows(signal: Signal, start: int, stop: int) -> Values:
    """Frames start <= f < stop as binary64, NaN where invalid."""
    return signal.cut(start, stop).masked().astype(np.float64, copy=False)


def _blocks(original: Motion, decoded: Motion) -> Iterator[tuple[int, Values, Values]]:
    """First row and values of both, a block of frames at a time."""
    a, b = original.signals[0], decoded.signals[0]
    widths = (
        max(1, m.signals[0].n_channels + 12 * m.skeleton.n_joints) for m in (original, decoded)
    )
    step = max(1, BLOCK // (max(widths) * a.samples_per_frame))
    for start in range(0, a.n_frames, step):
        stop = min(a.n_frames, start + step)
        yield start * a.samples_per_frame, _rows(a, start, stop), _rows(b, start, stop)


def _scaled(points: Values, scale: float) -> Values:
    return points if scale == 1.0 else points * scale


def _named(motion: Motion) -> dict[str, Signal]:
    """The further signals by name; ``name#n`` from the second of a name on."""
    found: dict[str, Signal] = {}
    seen: dict[str, int] = {}
    for signal in motion.signals[1:]:
        seen[signal.name] = n = seen.get(signal.name, -1) + 1
        found[signal.name if n == 0 else f"{signal.name}#{n}"] = signal
    return found


def _further_signals(original: Motion, decoded: Motion, notes: list[str]) -> dict[str, Number]:
    """The MSE of every signal that both have beside the motion."""
    figures: dict[str, Number] = {}
    left, right = _named(original), _named(decoded)
    for name in dict.fromkeys([*left, *right]):
        a, b = left.get(name), right.get(name)
        if a is None or b is None or a.values.shape != b.values.shape:
            notes.append(f"signal {name!r} is not in both, or of another shape")
            continue
        errors = _ChannelErrors(original.skeleton, a)
        step = max(1, BLOCK // max(1, a.n_channels * a.samples_per_frame))
        for start in range(0, a.n_frames, step):
            stop = min(a.n_frames, start + step)
            errors.add(_rows(a, start, stop), _rows(b, start, stop))
        figures[name] = errors.mse
    return figures
