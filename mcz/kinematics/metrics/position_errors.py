"""Distances between the points, markers, shells and feet of two motions."""

from __future__ import annotations

from collections.abc import Sequence

from mcz.errors import MotionError
from mcz.hints import Hint, Remark
from mcz.kinematics import Places, places_of, point_names, points_of
from mcz.kinematics.contacts import Contacts, FootTracks
from mcz.kinematics.joint_groups import find_feet
from mcz.kinematics.metrics.comparability import has_markers_of, same_axes
from mcz.kinematics.metrics.figures import JointFigures
from mcz.kinematics.metrics.sliding import Sliding, sliding
from mcz.kinematics.metrics.sums import (
    ChangeErrors,
    Distances,
    Number,
    PointErrors,
    ShellErrors,
    Values,
    times,
)
from mcz.model.motion import Motion

Feet = Contacts | Sequence[int | str] | bool


class PositionErrors:
    """Distances of points and, on request, of markers, shells and feet, in units of the original.

    ``scale`` brings lengths of the decoded side into these. Without ``placed`` there are no points
    in common, and no figures.
    """

    def __init__(self, original: Motion, decoded: Motion, scale: float, placed: bool) -> None:
        self._original, self._decoded, self._scale = original, decoded, scale
        self._a, self._b = original.skeleton, decoded.skeleton
        self._names = point_names(self._a) if placed else ()
        self.points = PointErrors(len(self._names))
        self.changes = ChangeErrors(len(self._names))
        self.markers, self.shell = PointErrors(0), ShellErrors(0)
        self.shell_cm: float | None = None
        self._contacts: Contacts | None = None
        self._feet: tuple[FootTracks, FootTracks] | None = None

    def enable(
        self, virtual_markers: bool, shell_cm: float | None, contacts: Feet, notes: list[str]
    ) -> None:
        """Measure these, too, where they can be compared; both sides' length units are known."""
        a, b = self._a, self._b
        if (virtual_markers or shell_cm is not None) and same_axes(a, b, notes):
            if virtual_markers:
                self.markers = PointErrors(3 * a.n_joints)
            if shell_cm is not None and has_markers_of(a, b):
                notes.append("the decoded side has virtual markers: no errors of shells")
            elif shell_cm is not None:
                self.shell, self.shell_cm = ShellErrors(a.n_joints), shell_cm
        if contacts is not False:
            self._track_feet(contacts, notes)

    def _track_feet(self, contacts: Feet, notes: list[str]) -> None:
        joints: Sequence[int | str] | None = None
        if isinstance(contacts, Contacts):
            self._contacts, joints = contacts, contacts.joints
            if not joints:  # nobody looked at any
                return
            if contacts.n_frames != self._original.n_frames:
                raise MotionError(
                    f"contacts of {contacts.n_frames} frames, "
                    f"{self._original.name!r} has {self._original.n_frames}"
                )
        elif not isinstance(contacts, bool):
            joints = contacts
        if not (find_feet(self._a) if joints is None else joints):
            notes.append(Remark("no joint is a foot by its name: no contacts", Hint.FEET))
            return
        n_frames = self._original.n_frames
        ours, theirs = (FootTracks(self._a, joints, n_frames) for _ in "ab")
        self._feet = ours, theirs

    def add(self, start: int, left: Values, right: Values) -> None:
        """Add the rows of both sides from row ``start`` on."""
        markers, shell_cm = len(self.markers.counts) > 0, self.shell_cm
        ours = places_of(self._a, left, markers=markers, shell_cm=shell_cm)
        theirs = self._decoded_places(right, markers)
        self.points.add_points(start, ours.points, theirs.points)
        self.changes.add_points(start, ours.points, theirs.points)
        if markers:
            self.markers.add_points(start, ours.markers, theirs.markers)
        if shell_cm is not None:
            self.shell.add_shell(start, ours.shell, theirs.shell)
        if self._feet is not None:
            per_frame = self._original.signals[0].samples_per_frame
            for tracks, places in zip(self._feet, (ours, theirs), strict=True):
                tracks.add(start // per_frame, places.points[::per_frame])

    def _decoded_places(self, values: Values, markers: bool) -> Places:
        """The places of the decoded side, in units of the original."""
        if has_markers_of(self._a, self._b):  # points and virtual markers as markers
            both = places_of(self._b, values).points
            n = len(self._names)
            places = Places(both[:, :n], both[:, n:], both[:, :0])
        else:
            places = places_of(self._b, values, markers=markers, shell_cm=self.shell_cm)
        if self._scale == 1.0:
            return places
        return Places(*(each * self._scale for each in places))

    def point_where(self) -> tuple[int, str] | None:
        """Frame and point of the greatest distance, the first of equals."""
        return self._where(self.points, self._names)

    def shell_where(self) -> tuple[int, str] | None:
        """Frame and joint of the greatest distance of the shell, the first of equals."""
        return self._where(self.shell, self._a.addresses())

    def _where(self, errors: Distances, names: Sequence[str]) -> tuple[int, str] | None:
        where = errors.where
        if where is None:
            return None
        return where[0] // self._original.signals[0].samples_per_frame, names[where[1]]

    def _frame(self, row: int | None) -> int | None:
        return None if row is None else row // self._original.signals[0].samples_per_frame

    def velocities(self, unit: Number) -> tuple[Number, Number]:
        """Mean and greatest error of velocities in cm/s, ``unit`` cm a length unit."""
        return self._scaled_errors(self.changes.velocity, unit, 1)

    def accelerations(self, unit: Number) -> tuple[Number, Number]:
        """Mean and greatest error of accelerations in cm/s2, ``unit`` cm a length unit."""
        return self._scaled_errors(self.changes.acceleration, unit, 2)

    def _scaled_errors(self, errors: Distances, unit: Number, order: int) -> tuple[Number, Number]:
        rate = self._original.frame_rate or self._decoded.frame_rate
        if unit is None or rate is None:
            return None, None
        factor = unit
        for _ in range(order):  # beyond binary64 it is infinite, and there is no figure
            factor *= float(rate * self._original.signals[0].samples_per_frame)
        return times(errors.mean, factor), times(errors.greatest, factor)

    def sliding(self) -> Sliding | None:
        """Sliding of the feet during the original's contacts; None if not requested."""
        if self._feet is None:
            return None
        if self._contacts is None:
            rate = self._original.frame_rate or self._decoded.frame_rate
            up = self._a.up_axis or self._b.up_axis
            timeline = self._original.timeline or self._decoded.timeline
            runs = None if timeline is None else timeline.runs
            known_rate = None if rate is None else float(rate)
            self._contacts = self._feet[0].contacts(known_rate, up, runs=runs)
        return sliding(self._contacts, *self._feet)

    def by_joint(self, unit: Number) -> tuple[JointFigures, ...]:
        """The figures of every joint, in order; none without points."""
        if not self._names:
            return ()
        names, sizes = self._a.addresses(), [len(own) for own in points_of(self._a)]
        points, shells = self.points.by_group(sizes), self.shell.by_group([1] * len(sizes))
        return tuple(
            JointFigures(
                joint=name,
                points=size,
                unit_cm=unit,
                mean_position_error=mean,
                max_position_error=most,
                frame=self._frame(row),
                shell_mean_cm=times(shell_mean, unit),
                shell_max_cm=times(shell_most, unit),
                shell_frame=self._frame(shell_row),
            )
            for name, size, (mean, most, row), (shell_mean, shell_most, shell_row) in zip(
                names, sizes, points, shells, strict=True
            )
        )
