"""Sums over frames for figures, block after block of frames."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from mcz.kinematics.angles import without_turns, without_whole_turns
from mcz.kinematics.points import point_names, point_set
from mcz.model.motion import Channel, Signal, Skeleton
from mcz.model.types import Bools, Floats, Settings

Number = float | None


def mean_of(total: float, n: int) -> Number:
    """``total / n``; None without values, or beyond binary64."""
    return total / n if n and math.isfinite(total) else None


def scale_figure(value: Number, factor: Number) -> Number:
    if value is None or factor is None:
        return None
    return mean_of(value * factor, 1)


def channel_errors(skeleton: Skeleton, signal: Signal, left: Floats, right: Floats) -> Floats:
    """Absolute differences of the channels of ``signal``, without whole turns."""
    return np.abs(_less_turns(left - right, left, right, skeleton, signal.channels))


def _less_turns(
    difference: Floats,
    left: Floats,
    right: Floats,
    skeleton: Skeleton,
    channels: tuple[Channel, ...] | None,
) -> Floats:
    """``difference`` of two sides without whole turns; ``channels``: a signal's own, or None."""
    wrapped = without_turns(difference, skeleton, channels)
    if channels is None:
        wrapped = -without_whole_turns(left, right, -wrapped, skeleton)
    return wrapped


class ChannelErrors:
    """Squared differences of two signals with the same channels."""

    def __init__(self, skeleton: Skeleton, signal: Signal) -> None:
        self._skeleton, self._channels = skeleton, signal.channels
        self._n = self.mismatched = 0
        self._squares, self._raw, self._sum = 0.0, 0.0, 0.0
        self._greatest = -1.0

    def add(self, left: Floats, right: Floats) -> None:
        valid = np.isfinite(left) & np.isfinite(right)
        raw = np.where(valid, left - right, 0.0)
        difference = _less_turns(raw, left, right, self._skeleton, self._channels)
        self._n += int(valid.sum())
        self.mismatched += int((np.isfinite(left) ^ np.isfinite(right)).sum())
        self._squares += float(np.sum(difference**2))
        self._raw += float(np.sum(raw**2))
        self._sum += float(np.sum(np.abs(difference)))
        self._greatest = max(self._greatest, float(np.abs(difference).max(initial=0.0)))

    @property
    def mse(self) -> Number:
        return mean_of(self._squares, self._n)

    @property
    def mse_raw(self) -> Number:
        return mean_of(self._raw, self._n)

    @property
    def mean(self) -> Number:
        """The mean of the absolute differences."""
        return mean_of(self._sum, self._n)

    @property
    def greatest(self) -> Number:
        return mean_of(self._greatest, 1) if self._n else None


class Distances:
    """Mean and greatest distance of each of ``n`` columns and of all."""

    def __init__(self, n: int) -> None:
        self.counts = np.zeros(n, np.int64)
        self.totals = np.zeros(n)
        self.greatest_by_column = np.full(n, -1.0)
        self.rows = np.zeros(n, np.int64)  # of the greatest, the first of equals

    def add(self, start: int, distances: Floats, valid: Bools) -> None:
        """Distances of shape (n_rows, n) from row ``start`` on, 0 where they are not ``valid``."""
        if not len(distances):
            return
        self.counts += valid.sum(axis=0)
        self.totals += distances.sum(axis=0)
        known = np.where(valid, distances, -1.0)
        at = known.argmax(axis=0)
        greatest = known[at, np.arange(known.shape[1])]
        more = greatest > self.greatest_by_column
        self.greatest_by_column[more] = greatest[more]
        self.rows[more] = start + at[more]

    @property
    def mean(self) -> Number:
        return mean_of(float(self.totals.sum()), int(self.counts.sum()))

    @property
    def greatest(self) -> Number:
        most = float(self.greatest_by_column.max(initial=-1.0))
        return None if most < 0 else mean_of(most, 1)

    @property
    def where(self) -> tuple[int, int] | None:
        """Row and column of the greatest distance; ties: the first row, then column."""
        if not self.counts.any():
            return None
        worst = self.greatest_by_column == self.greatest_by_column.max()
        column = int(np.argmin(np.where(worst, self.rows, np.iinfo(np.int64).max)))
        return int(self.rows[column]), column

    def by_group(self, sizes: Sequence[int]) -> Iterator[tuple[Number, Number, int | None]]:
        """Mean, greatest and the row of the greatest for each group of columns, in order."""
        counts, totals = self.counts.tolist(), self.totals.tolist()
        places = list(zip(self.greatest_by_column.tolist(), (-self.rows).tolist(), strict=True))
        first = 0
        for size in sizes:
            own = slice(first, first + size)
            n = sum(counts[own])
            most, row = max(places[own], default=(-1.0, 0))
            yield mean_of(sum(totals[own]), n), mean_of(most, min(1, n)), -row if n else None
            first += size


class PointErrors(Distances):
    """Distances of two sets of ``n`` points, in length units of the original."""

    def __init__(self, n: int) -> None:
        super().__init__(n)
        self.mismatched = 0
        self._squares, self._power = 0.0, 0.0

    def add_points(self, start: int, left: Floats, right: Floats) -> None:
        """Points of shape (n_rows, n, 3) from row ``start`` on, NaN where unknown."""
        left_known, right_known = known_points(left), known_points(right)
        valid = left_known & right_known
        self.mismatched += int((left_known ^ right_known).sum())
        squares = np.where(valid, squared_norms(left - right), 0.0)
        self._squares += float(squares.sum())
        self._power += float(np.where(valid, squared_norms(left), 0.0).sum())
        self.add(start, np.sqrt(squares), valid)

    @property
    def rms(self) -> Number:
        mean = mean_of(self._squares, 3 * int(self.counts.sum()))
        return None if mean is None else math.sqrt(mean)

    @property
    def sqnr_db(self) -> Number:
        n = int(self.counts.sum())
        noise, power = mean_of(self._squares, n), mean_of(self._power, n)
        if not noise or not power:
            return None
        return 10 * (math.log10(power) - math.log10(noise))


class ShellErrors(Distances):
    """Greatest distance of each joint's three shell points, in length units."""

    def add_shell(self, start: int, left: Floats, right: Floats) -> None:
        """Points of shape (n_rows, 3 n, 3), three a joint, from row ``start`` on."""
        valid = known_points(left) & known_points(right)
        whole = valid[:, 0::3] & valid[:, 1::3] & valid[:, 2::3]
        squares = squared_norms(left - right)
        worst = np.maximum(np.maximum(squares[:, 0::3], squares[:, 1::3]), squares[:, 2::3])
        self.add(start, np.sqrt(np.where(whole, worst, 0.0)), whole)


class ChangeErrors:
    """Differences of velocities and accelerations of ``n`` points, in lengths a row, a row squared.

    Blocks of rows follow one another: the last two rows of a block are kept for the next.
    """

    def __init__(self, n: int) -> None:
        self.velocity, self.acceleration = Distances(n), Distances(n)
        self._off, self._valid = np.zeros((0, n, 3)), np.zeros((0, n), np.bool_)

    def add_points(self, start: int, left: Floats, right: Floats) -> None:
        """Points of shape (n_rows, n, 3) from row ``start`` on, NaN where unknown."""
        n_before = len(self._off)
        known = known_points(left) & known_points(right)
        errors = np.concatenate([self._off, np.where(known[:, :, None], left - right, 0.0)])
        valid = np.concatenate([self._valid, known])
        for order, sums in ((1, self.velocity), (2, self.acceleration)):
            first = max(n_before - order, 0)
            n_rows = len(errors) - first - order
            if n_rows > 0:
                changed = np.sqrt(squared_norms(np.diff(errors[first:], order, axis=0)))
                both = [valid[first + k : first + k + n_rows] for k in range(order + 1)]
                counted = np.logical_and.reduce(both)
                sums.add(start + first + order - n_before, np.where(counted, changed, 0.0), counted)
        self._off, self._valid = errors[-2:], valid[-2:]


def known_points(points: Floats) -> Bools:
    """Mask of the points of (n_rows, n, 3) with three finite coordinates."""
    x, y, z = np.isfinite(np.moveaxis(points, 2, 0))  # much faster than along a short axis
    result: Bools = x & y & z
    return result


def squared_norms(vectors: Floats) -> Floats:
    """(n_rows, n) of vectors (n_rows, n, 3)."""
    x, y, z = np.moveaxis(vectors, 2, 0)
    result: Floats = x * x + y * y + z * z
    return result


class RunningFigures:
    """Errors of a quality record, frame by frame: of values and of marker positions."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        self._positions = bool(skeleton.joints) and point_set(skeleton) == "markers"
        self._frames = self._values = self._points = 0
        self._squares = self._sum = 0.0
        self._most = -1.0
        self._where: tuple[int, int] | None = None

    def add(self, values: Floats, decoded: Floats) -> None:
        """Add a frame; NaN in ``values`` does not count."""
        with np.errstate(all="ignore"):  # overflow is no figure
            squares = np.square(decoded - values)
            self._squares, self._values = _add_valid(self._squares, self._values, squares)
            if self._positions:
                distances = np.sqrt(squares.reshape(-1, 3).sum(axis=1))
                self._sum, self._points = _add_valid(self._sum, self._points, distances)
                distances[np.isnan(distances)] = -1.0
                point = int(distances.argmax())
                if distances[point] > self._most:
                    self._most, self._where = float(distances[point]), (self._frames, point)
        self._frames += 1

    def entries(self) -> Settings:
        """The figures by their metric ids, None where there is none."""
        unit = self.skeleton.unit_cm
        figures: Settings = {"frames": self._frames, "channels": self.skeleton.n_channels}
        figures["mse_raw"] = self._squares / self._values if self._values else None
        if self._positions and self._where is not None:
            mean, (frame, point) = self._sum / self._points, self._where
            figures |= {
                "point_set": point_set(self.skeleton),
                "points": self.skeleton.n_joints,
                "unit_cm": unit,
                "mean_position_error": mean,
                "mean_position_error_cm": mean * unit if unit is not None else None,
                "max_position_error": self._most,
                "max_position_error_cm": self._most * unit if unit is not None else None,
                "max_position_error_frame": frame,
                "max_position_error_point": point_names(self.skeleton)[point],
            }
        return {k: v for k, v in figures.items() if not isinstance(v, float) or np.isfinite(v)}


def _add_valid(total: float, count: int, more: Floats) -> tuple[float, int]:
    """Add the values of ``more`` that are not NaN to a sum and a count."""
    added = float(more.sum())
    if added == added:
        return total + added, count + more.size
    valid = ~np.isnan(more)
    return total + float(more[valid].sum()), count + int(np.count_nonzero(valid))
