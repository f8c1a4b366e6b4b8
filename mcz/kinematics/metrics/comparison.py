"""Two motions, read side by side in blocks of frames, and the figures of one against the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mcz.errors import MotionError
from mcz.hints import Hint, Remark
from mcz.kinematics import SHELL_CM, Places, places_of, point_names, point_set, points_of
from mcz.kinematics.contacts import Contacts, FootTracks
from mcz.kinematics.joint_groups import find_feet
from mcz.kinematics.metrics.comparability import (
    common_unit,
    frames_text,
    has_markers_of,
    rows_of,
    same_axes,
    same_channels,
    same_points,
)
from mcz.kinematics.metrics.figures import Comparison, JointFigures
from mcz.kinematics.metrics.sliding import Sliding, sliding
from mcz.kinematics.metrics.sums import (
    ChangeErrors,
    ChannelErrors,
    Distances,
    Number,
    PointErrors,
    ShellErrors,
    scale_figure,
)
from mcz.kinematics.points import check_radius
from mcz.model.motion import Motion, Signal, Skeleton
from mcz.model.types import Floats

BLOCK = 2**19  # numbers a block, which bounds the memory


def compare(
    original: Motion,
    decoded: Motion,
    *,
    virtual_markers: bool = True,
    shell_cm: float | None = SHELL_CM,
    contacts: Contacts | Sequence[int | str] | bool = False,
) -> Comparison:
    """The figures of ``decoded`` against ``original``, defined in docs/reference/measures.md.

    ``virtual_markers=False`` leaves out the figures of virtual markers, ``shell_cm=None`` (the
    radius) those of the shell; each costs about a quarter of the time. ``contacts`` measures the
    sliding of feet that stand in the original: True finds feet by their names, joints (index or
    name) name them, ``Contacts`` give their runs. Figures that do not apply to the two motions
    (different channels or points) are None, with a note.

    Raises MotionError where the two differ in frames or in rows a frame, or lack a joint in
    ``contacts``, and OptionError for a bad ``shell_cm``.
    """
    a, b = original.signals[0], decoded.signals[0]
    if a.n_frames != b.n_frames or a.samples_per_frame != b.samples_per_frame:
        raise MotionError(
            f"{original.name!r} has {frames_text(a)}, but {decoded.name!r} has "
            f"{frames_text(b)}; only equal frames can be compared"
        )
    if shell_cm is not None:
        check_radius(shell_cm)
    notes: list[str] = []
    unit, scale = common_unit(original.skeleton, decoded.skeleton, notes)
    channels = ChannelErrors(original.skeleton, a)
    has_same_channels = same_channels(original, decoded, notes)
    has_same_points = same_points(original, decoded, notes)
    errors = PositionErrors(original, decoded, scale, has_same_points)
    if has_same_points and unit is not None:
        errors.enable(virtual_markers, shell_cm, contacts, notes)
    with np.errstate(all="ignore"):  # overflow gives inf, which is reported as None
        for start, left, right in _blocks(original, decoded):
            if has_same_channels:
                channels.add(left, right)
            if has_same_points:
                errors.add(start, left, right)
        further = _further_signals(original, decoded, notes)
    velocities, accelerations = (errors.velocities(unit), errors.accelerations(unit))
    points, markers, shell = errors.points, errors.markers, errors.shell
    return Comparison(
        frames=a.n_frames,
        channels=a.n_channels if has_same_channels else None,
        mse=channels.mse,
        mse_raw=channels.mse_raw,
        mismatched_values=channels.mismatched if has_same_channels else None,
        point_set=point_set(original.skeleton) if has_same_points else None,
        points=len(points.counts) if has_same_points else None,
        unit_cm=unit,
        rms_coordinate_error=points.rms,
        mean_position_error=points.mean,
        max_position_error=points.greatest,
        where=errors.point_where(),
        mismatched_points=points.mismatched if has_same_points else None,
        sqnr_db=points.sqnr_db,
        mean_velocity_error_cm_s=velocities[0],
        max_velocity_error_cm_s=velocities[1],
        mean_acceleration_error_cm_s2=accelerations[0],
        max_acceleration_error_cm_s2=accelerations[1],
        virtual_marker_mean_cm=scale_figure(markers.mean, unit),
        virtual_marker_max_cm=scale_figure(markers.greatest, unit),
        shell_radius_cm=None if shell.mean is None else errors.shell_cm,
        shell_mean_cm=scale_figure(shell.mean, unit),
        shell_max_cm=scale_figure(shell.greatest, unit),
        shell_where=errors.shell_where(),
        sliding=errors.sliding(),
        by_joint=errors.by_joint(unit),
        signals=further,
        notes=tuple(notes),
    )


def _blocks(original: Motion, decoded: Motion) -> Iterator[tuple[int, Floats, Floats]]:
    """First row and values of both, a block of frames at a time."""
    a, b = original.signals[0], decoded.signals[0]
    widths = (
        max(1, m.signals[0].n_channels + 12 * m.skeleton.n_joints) for m in (original, decoded)
    )
    step = max(1, BLOCK // (max(widths) * a.samples_per_frame))
    for start in range(0, a.n_frames, step):
        stop = min(a.n_frames, start + step)
        yield start * a.samples_per_frame, rows_of(a, start, stop), rows_of(b, start, stop)


def named_signals(motion: Motion) -> dict[str, Signal]:
    """Signals other than the motion by role, else name; the second of a name is NAME#1."""
    signals: dict[str, Signal] = {}
    seen: dict[str, int] = {}
    for signal in motion.signals[1:]:
        key = signal.role or signal.name
        seen[key] = n = seen.get(key, -1) + 1
        signals[key if n == 0 else f"{key}#{n}"] = signal
    return signals


def _further_signals(original: Motion, decoded: Motion, notes: list[str]) -> dict[str, Number]:
    figures: dict[str, Number] = {}
    left, right = named_signals(original), named_signals(decoded)
    for name in dict.fromkeys([*left, *right]):
        a, b = left.get(name), right.get(name)
        if a is None or b is None or a.values.shape != b.values.shape:
            notes.append(f"signal {name!r} is not in both, or has another shape")
            continue
        figures[name] = signal_errors(original.skeleton, a, b).mse
    return figures


def signal_errors(skeleton: Skeleton, original: Signal, decoded: Signal) -> ChannelErrors:
    """The errors of a signal; both have one shape."""
    errors = ChannelErrors(skeleton, original)
    step = max(1, BLOCK // max(1, original.n_channels * original.samples_per_frame))
    for start in range(0, original.n_frames, step):
        stop = min(original.n_frames, start + step)
        with np.errstate(all="ignore"):  # overflow gives inf, which is reported as None
            errors.add(rows_of(original, start, stop), rows_of(decoded, start, stop))
    return errors


Feet = Contacts | Sequence[int | str] | bool


class PositionErrors:
    """Distances of points and, on request, of markers, shells and feet, in units of the original.

    ``scale`` converts lengths of the decoded side to these. Without ``has_same_points`` there are
    no figures.
    """

    def __init__(
        self, original: Motion, decoded: Motion, scale: float, has_same_points: bool
    ) -> None:
        self._original, self._decoded, self._scale = original, decoded, scale
        self._a, self._b = original.skeleton, decoded.skeleton
        self._names = point_names(self._a) if has_same_points else ()
        self.points = PointErrors(len(self._names))
        self.changes = ChangeErrors(len(self._names))
        self.markers, self.shell = PointErrors(0), ShellErrors(0)
        self.shell_cm: float | None = None
        self._contacts: Contacts | None = None
        self._feet: tuple[FootTracks, FootTracks] | None = None

    def enable(
        self, virtual_markers: bool, shell_cm: float | None, contacts: Feet, notes: list[str]
    ) -> None:
        """Enable figures that the options ask for, where both sides have them; units are known."""
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
            if not joints:  # contacts of no joint
                return
            if contacts.n_frames != self._original.n_frames:
                raise MotionError(
                    f"contacts have {contacts.n_frames} frames, but {self._original.name!r} "
                    f"has {self._original.n_frames}"
                )
        elif not isinstance(contacts, bool):
            joints = contacts
        if not (find_feet(self._a) if joints is None else joints):
            notes.append(Remark("no joint is named like a foot: no contacts", Hint.FEET))
            return
        n_frames = self._original.n_frames
        ours, theirs = (FootTracks(self._a, joints, n_frames) for _ in "ab")
        self._feet = ours, theirs

    def add(self, start: int, left: Floats, right: Floats) -> None:
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

    def _decoded_places(self, values: Floats, markers: bool) -> Places:
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
        """Frame and point of the greatest distance; ties: the first."""
        return self._where(self.points, self._names)

    def shell_where(self) -> tuple[int, str] | None:
        """Frame and joint of the greatest distance of the shell; ties: the first."""
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
        for _ in range(order):  # overflow gives inf, which is reported as None
            factor *= float(rate * self._original.signals[0].samples_per_frame)
        return scale_figure(errors.mean, factor), scale_figure(errors.greatest, factor)

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
        names, sizes = self._a.addresses(), [len(points) for points in points_of(self._a)]
        points, shells = self.points.by_group(sizes), self.shell.by_group([1] * len(sizes))
        return tuple(
            JointFigures(
                joint=name,
                points=size,
                unit_cm=unit,
                mean_position_error=mean,
                max_position_error=most,
                frame=self._frame(row),
                shell_mean_cm=scale_figure(shell_mean, unit),
                shell_max_cm=scale_figure(shell_most, unit),
                shell_frame=self._frame(shell_row),
            )
            for name, size, (mean, most, row), (shell_mean, shell_most, shell_row) in zip(
                names, sizes, points, shells, strict=True
            )
        )
