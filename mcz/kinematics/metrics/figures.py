"""Figures of one motion against another, foot sliding included.

docs/guides/contacts.md defines foot sliding, during the contacts of the original.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from mcz.kinematics.contacts import Contact, Contacts, FootTracks
from mcz.kinematics.metrics.sums import Number, mean_of, scale_figure
from mcz.model.text_format import fields_text
from mcz.model.types import Floats

MM = 10.0  # millimeters in a centimeter


@dataclass(frozen=True, slots=True)
class ContactSlide:
    """One contact: the distance of the decoded foot from the original's place.

    ``mean_mm`` and ``max_mm`` are differences of both feet's displacements from the first frame,
    over the later frames. ``path_mm`` is the length of the decoded foot's path,
    ``path_original_mm`` of the original's. None if no position is known.
    """

    joint: str
    first: int
    n_frames: int
    mean_mm: Number
    max_mm: Number
    path_mm: Number
    path_original_mm: Number


@dataclass(frozen=True, slots=True)
class Sliding:
    """The slides of all contacts of the original, and figures over all of them.

    ``where`` is the frame and joint of the greatest difference; ``slides`` are in the order of
    ``contacts.runs``.
    """

    contacts: Contacts
    slides: tuple[ContactSlide, ...]
    mean_mm: Number = None
    max_mm: Number = None
    where: tuple[int, str] | None = None
    path_mm: Number = None
    path_original_mm: Number = None

    __repr__ = fields_text

    def entries(self) -> dict[str, float | int | str | None]:
        """The figures by the metric ids of SPEC.md."""
        frame, joint = self.where or (None, None)
        return {
            "contacts": len(self.slides),
            "contact_frames": sum(slide.n_frames for slide in self.slides),
            "slide_mean_mm": self.mean_mm,
            "slide_max_mm": self.max_mm,
            "slide_max_frame": frame,
            "slide_max_joint": joint,
            "slide_path_mm": self.path_mm,
            "slide_path_original_mm": self.path_original_mm,
        }


@dataclass(frozen=True, slots=True)
class _ContactDistances:
    """Distances of a contact after its first frame, NaN if unknown, and both path lengths."""

    run: Contact
    apart: Floats
    path: float
    path_original: float
    steps: int  # of the paths

    def slide(self) -> ContactSlide:
        known = self.apart[np.isfinite(self.apart)]
        return ContactSlide(
            joint=self.run.joint,
            first=self.run.first,
            n_frames=self.run.n_frames,
            mean_mm=mean_of(float(known.sum()), len(known)),
            max_mm=mean_of(float(known.max(initial=0.0)), min(1, len(known))),
            path_mm=mean_of(self.path, min(1, self.steps)),
            path_original_mm=mean_of(self.path_original, min(1, self.steps)),
        )


def sliding(contacts: Contacts, ours: FootTracks, theirs: FootTracks) -> Sliding:
    """The figures of ``theirs``, the decoded feet, in the ``contacts`` of ``ours``.

    Both have the same joints, in length units of the original; ``contacts`` may lack some.
    """
    with np.errstate(all="ignore"):  # overflow is no figure
        measured = list(_measure_contacts(contacts, ours, theirs))
        slides = tuple(each.slide() for each in measured)
        apart = [each.apart[np.isfinite(each.apart)] for each in measured]
        n_known = sum(map(len, apart))
        steps = min(1, sum(each.steps for each in measured))
        return Sliding(
            contacts,
            slides,
            mean_mm=mean_of(float(sum(each.sum() for each in apart)), n_known),
            max_mm=max((s.max_mm for s in slides if s.max_mm is not None), default=None),
            where=_worst_frame(measured),
            path_mm=mean_of(sum(each.path for each in measured), steps),
            path_original_mm=mean_of(sum(each.path_original for each in measured), steps),
        )


def _measure_contacts(
    contacts: Contacts, ours: FootTracks, theirs: FootTracks
) -> Iterator[_ContactDistances]:
    to_mm = ours.unit_cm * MM
    for run in contacts.runs:
        foot = ours.joints.index(run.joint)
        frames = slice(run.first, run.first + run.n_frames)
        a, b = ours.feet[foot, frames] * to_mm, theirs.feet[foot, frames] * to_mm
        differences = _lengths((b - b[:1]) - (a - a[:1]))[1:]
        original, decoded = (_lengths(np.diff(places, axis=0)) for places in (a, b))
        known = np.isfinite(original) & np.isfinite(decoded)
        yield _ContactDistances(
            run,
            differences,
            float(decoded[known].sum()),
            float(original[known].sum()),
            int(known.sum()),
        )


def _worst_frame(measured: list[_ContactDistances]) -> tuple[int, str] | None:
    """Frame and joint of the greatest difference; ties: the first frame, then joint."""
    worst: list[tuple[float, int, str]] = []
    for each in measured:
        known = np.where(np.isfinite(each.apart), each.apart, -1.0)
        if known.max(initial=-1.0) >= 0:
            at = int(known.argmax())
            worst.append((-float(known[at]), each.run.first + 1 + at, each.run.joint))
    return min(worst, key=lambda one: one[:2])[1:] if worst else None


def _lengths(vectors: Floats) -> Floats:
    x, y, z = vectors.T
    result: Floats = np.sqrt(x * x + y * y + z * z)
    return result


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
    shell. None if there is no such figure.
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
    """The figures of one motion against another; None if there is no such figure.

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

    __repr__ = fields_text

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
