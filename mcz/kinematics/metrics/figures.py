"""The figures of one motion against another, as results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mcz.kinematics.metrics.sliding import Sliding
from mcz.kinematics.metrics.sums import Number, scale_figure
from mcz.model.text_format import brief

Entries = dict[str, float | int | str | None]
NO_CONTACTS = dict.fromkeys(
    (
        *("contacts", "contact_frames", "slide_mean_mm", "slide_max_mm", "slide_max_frame"),
        *("slide_max_joint", "slide_path_mm", "slide_path_original_mm"),
    )
)


@dataclass(frozen=True, slots=True)
class JointFigures:
    """One joint: distances of its points, in length units of the original, and of its shell.

    ``frame`` is the frame (from 0) of the greatest distance of its points, ``shell_frame`` of its
    shell. None where there is no such figure.
    """

    joint: str
    points: int
    unit_cm: Number = None
    mean_position_error: Number = None
    max_position_error: Number = None
    frame: int | None = None
    shell_mean_cm: Number = None
    shell_max_cm: Number = None
    shell_frame: int | None = None

    def entries(self) -> Entries:
        """The figures by the metric ids of SPEC.md."""
        return {
            "joint": self.joint,
            "points": self.points,
            "mean_position_error": self.mean_position_error,
            "mean_position_error_cm": scale_figure(self.mean_position_error, self.unit_cm),
            "max_position_error": self.max_position_error,
            "max_position_error_cm": scale_figure(self.max_position_error, self.unit_cm),
            "max_position_error_frame": self.frame,
            "shell_mean_cm": self.shell_mean_cm,
            "shell_max_cm": self.shell_max_cm,
            "shell_max_frame": self.shell_frame,
        }


@dataclass(frozen=True, slots=True)
class Comparison:
    """The figures of one motion against another; None where there is no such figure.

    Distances are Euclidean, per point, in length units of the original or, ``_cm``, in centimeters;
    ``mse`` mixes degrees and length units, as the papers do. ``where`` is the frame (from 0) and
    the point of the greatest distance, ``shell_where`` the frame and the joint of the greatest
    distance of the shell; ``notes`` explain missing figures. ``signals`` holds the MSE of every
    further signal, by name; ``by_joint`` the distances of every joint of the original, ``sliding``
    the distances of its feet where they stand.
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
    mean_velocity_error_cm_s: Number = None
    max_velocity_error_cm_s: Number = None
    mean_acceleration_error_cm_s2: Number = None
    max_acceleration_error_cm_s2: Number = None
    virtual_marker_mean_cm: Number = None
    virtual_marker_max_cm: Number = None
    shell_radius_cm: Number = None
    shell_mean_cm: Number = None
    shell_max_cm: Number = None
    shell_where: tuple[int, str] | None = None
    sliding: Sliding | None = None
    by_joint: tuple[JointFigures, ...] = ()
    signals: Mapping[str, Number] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    __repr__ = brief

    @property
    def mean_position_error_cm(self) -> Number:
        return scale_figure(self.mean_position_error, self.unit_cm)

    @property
    def max_position_error_cm(self) -> Number:
        return scale_figure(self.max_position_error, self.unit_cm)

    def entries(self) -> Entries:
        """The figures by the metric ids of SPEC.md, in its order."""
        frame, point = self.where or (None, None)
        shell_frame, joint = self.shell_where or (None, None)
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
            "mean_velocity_error_cm_s": self.mean_velocity_error_cm_s,
            "max_velocity_error_cm_s": self.max_velocity_error_cm_s,
            "mean_acceleration_error_cm_s2": self.mean_acceleration_error_cm_s2,
            "max_acceleration_error_cm_s2": self.max_acceleration_error_cm_s2,
            "virtual_marker_mean_cm": self.virtual_marker_mean_cm,
            "virtual_marker_max_cm": self.virtual_marker_max_cm,
            "shell_radius_cm": self.shell_radius_cm,
            "shell_mean_cm": self.shell_mean_cm,
            "shell_max_cm": self.shell_max_cm,
            "shell_max_frame": shell_frame,
            "shell_max_joint": joint,
            **(NO_CONTACTS if self.sliding is None else self.sliding.entries()),
            **{f"signal.{name}.mse": value for name, value in self.signals.items()},
        }
