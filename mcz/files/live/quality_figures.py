"""The figures of a live clip's quality record, taken frame by frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.kinematics import point_names, point_set
from mcz.model.motion import Skeleton
from mcz.model.types import Settings

Floats = NDArray[np.float64]


class Figures:
    """The errors of a quality record, frame by frame: of values and, of markers, of positions."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        self._positions = bool(skeleton.joints) and point_set(skeleton) == "markers"
        self._frames = self._values = self._points = 0
        self._squares = self._sum = 0.0
        self._most = -1.0
        self._where: tuple[int, int] | None = None

    def add(self, given: Floats, decoded: Floats) -> None:
        """Add a frame; NaN in ``given`` does not count."""
        with np.errstate(all="ignore"):  # what overflows is no figure
            squares = np.square(decoded - given)
            self._squares, self._values = _added(self._squares, self._values, squares)
            if self._positions:
                distances = np.sqrt(squares.reshape(-1, 3).sum(axis=1))
                self._sum, self._points = _added(self._sum, self._points, distances)
                distances[np.isnan(distances)] = -1.0
                point = int(distances.argmax())
                if distances[point] > self._most:
                    self._most, self._where = float(distances[point]), (self._frames, point)
        self._frames += 1

    def entries(self) -> Settings:
        """The figures by their metric ids, None where there is none."""
        unit = self.skeleton.unit_cm
        found: Settings = {"frames": self._frames, "channels": self.skeleton.n_channels}
        found["mse_raw"] = self._squares / self._values if self._values else None
        if self._positions and self._where is not None:
            mean, (frame, point) = self._sum / self._points, self._where
            found |= {
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
        return {key: value for key, value in found.items() if not _is_absurd(value)}


def _added(total: float, count: int, more: Floats) -> tuple[float, int]:
    """Sum and number with those of ``more`` that are not NaN."""
    found = float(more.sum())
    if found == found:
        return total + found, count + more.size
    valid = ~np.isnan(more)
    return total + float(more[valid].sum()), count + int(np.count_nonzero(valid))


def _is_absurd(value: object) -> bool:
    return isinstance(value, float) and not np.isfinite(value)
