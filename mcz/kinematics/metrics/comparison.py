"""Comparison of two motions in blocks of frames; differences that prevent a figure become notes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mcz.errors import MczError, MotionError
from mcz.hints import Hint, Remark
from mcz.kinematics.contacts import Contacts, FootTracks
from mcz.kinematics.joint_names import find_feet
from mcz.kinematics.metrics.figures import Comparison, JointFigures, Sliding, sliding
from mcz.kinematics.metrics.sums import (
    ChangeErrors,
    ChannelErrors,
    Distances,
    Number,
    PointErrors,
    ShellErrors,
    scale_figure,
)
from mcz.kinematics.points import (
    SHELL_CM,
    Places,
    check_radius,
    places_of,
    point_names,
    point_set,
    points_of,
    positions_of,
)
from mcz.kinematics.rest_pose import NO_LENGTHS, has_no_lengths
from mcz.model.checks import check_arguments
from mcz.model.motion import A_MOTION, POSITION_KINDS, Motion, Signal, Skeleton
from mcz.model.types import Floats


def frames_text(signal: Signal) -> str:
    rate = signal.samples_per_frame
    return f"{signal.n_frames} frames" + (f" of {rate} rows" if rate > 1 else "")


def common_unit(a: Skeleton, b: Skeleton, notes: list[str]) -> tuple[Number, float]:
    """Unit of distances in cm, and the factor from lengths of ``b`` to it."""
    if a.unit_cm is not None and b.unit_cm is not None:
        return a.unit_cm, b.unit_cm / a.unit_cm
    if a.unit_cm is None and b.unit_cm is None:
        notes.append(Remark("the length unit is unknown: no figures in cm", Hint.UNIT))
    else:
        text = "only one side states its length unit; it is used for both: no figures in cm"
        notes.append(Remark(text, Hint.UNIT))
    return None, 1.0


def _kinds(motion: Motion) -> list[tuple[str, str]]:
    own = motion.signals[0].channels
    return [(c.kind, c.name) for c in (motion.skeleton.channels if own is None else own)]


def same_channels(original: Motion, decoded: Motion, notes: list[str]) -> bool:
    a, b = original.skeleton, decoded.skeleton
    kinds, decoded_kinds = _kinds(original), _kinds(decoded)
    units = a.unit_cm, b.unit_cm
    has_lengths = any(kind in {*POSITION_KINDS, "length"} for kind, _ in kinds)
    difference = None
    if kinds != decoded_kinds:
        difference = f"other channels ({len(kinds)} and {len(decoded_kinds)})"
    elif a.angle_unit != b.angle_unit:
        difference = f"angles in {a.angle_unit or '?'} and {b.angle_unit or '?'}"
    elif has_lengths and None not in units and units[0] != units[1]:
        difference = f"units of {units[0]:.6g} and {units[1]:.6g} cm"
    if difference:
        notes.append(f"{difference}: no errors of channels")
    return difference is None


def same_points(original: Motion, decoded: Motion, notes: list[str]) -> bool:
    """Return True if both have kinematics and the same number of points."""
    counts = []
    for motion in (original, decoded):
        signal, skeleton = motion.signals[0], motion.skeleton
        try:
            if not signal.has_poses:
                raise MotionError("its channels differ from those of the skeleton")
            positions_of(skeleton, rows_of(signal, 0, min(1, signal.n_frames)))
            counts.append(len(point_names(skeleton)))
        except MczError as error:
            notes.append(f"no positions of {motion.name!r}: {error}")
            return False
    is_same = counts[0] == counts[1] or has_markers_of(original.skeleton, decoded.skeleton)
    if not (is_same and counts[0]):
        sets = f"{point_set(original.skeleton)}, {point_set(decoded.skeleton)}"
        notes.append(f"{counts[0]} and {counts[1]} points ({sets}): no errors of positions")
        return False
    without = [m for m in (original, decoded) if has_no_lengths(m.skeleton)]
    if len(without) == 1:
        notes.append(f"{without[0].name!r}: {NO_LENGTHS}, unlike on the other side: no positions")
        return False
    pairs = zip(point_names(original.skeleton), point_names(decoded.skeleton), strict=False)
    unlike = [pair for pair in pairs if pair[0] != pair[1]]
    if unlike:
        first = " and ".join(map(repr, unlike[0]))
        notes.append(
            f"points are compared in order; {len(unlike)} of {counts[0]} have other "
            f"names on the other side, first {first}"
        )
    return True


def same_axes(a: Skeleton, b: Skeleton, notes: list[str]) -> bool:
    """Return True if both have the same number of joints with axes: turning ones or markers.

    Also if the other has virtual markers as markers.
    """
    if has_markers_of(a, b):
        return True
    sets = point_set(a), point_set(b)
    if "markers" in sets and sets[0] != sets[1]:
        notes.append(f"points of {sets[0]} and {sets[1]}: no errors of virtual markers and shells")
        return False
    if a.n_joints != b.n_joints:
        counts = f"{a.n_joints} and {b.n_joints} joints"
        notes.append(f"{counts}: no errors of virtual markers and shells")
        return False
    return True


def has_markers_of(a: Skeleton, b: Skeleton) -> bool:
    """Return True if ``b`` has the points of ``a``, then its virtual markers."""
    if point_set(b) != "markers" or point_set(a) == "markers":
        return False
    return b.n_joints == len(point_names(a)) + 3 * a.n_joints


def rows_of(signal: Signal, start: int, stop: int) -> Floats:
    """Frames start <= f < stop as binary64, NaN if invalid."""
    return signal.cut(start, stop).masked().astype(np.float64, copy=False)


BLOCK = 2**19  # numbers a block, which bounds the memory


@check_arguments(original=A_MOTION, decoded=A_MOTION)
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

    Raises MotionError if the two differ in frames or in rows a frame, or lack a joint in
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
    points, markers, shell = errors.points, errors.markers, errors.shell
    velocities = errors.derivative_errors(errors.changes.velocity, unit, 1)
    accelerations = errors.derivative_errors(errors.changes.acceleration, unit, 2)
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
    counts: dict[str, int] = {}
    for signal in motion.signals[1:]:
        key = signal.role or signal.name
        counts[key] = n = counts.get(key, -1) + 1
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
        """Enable figures that the options request, if both sides have them; units are known."""
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
        return self._worst_place(self.points, self._names)

    def shell_where(self) -> tuple[int, str] | None:
        """Frame and joint of the greatest distance of the shell; ties: the first."""
        return self._worst_place(self.shell, self._a.addresses())

    def _worst_place(self, errors: Distances, names: Sequence[str]) -> tuple[int, str] | None:
        if errors.where is None:
            return None
        row, point = errors.where
        return self._frame(row), names[point]

    def _frame(self, row: int) -> int:
        return row // self._original.signals[0].samples_per_frame

    def derivative_errors(
        self, errors: Distances, unit: Number, order: int
    ) -> tuple[Number, Number]:
        """Mean and greatest error in cm/s (order 1) or cm/s2 (2), ``unit`` cm a length unit."""
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
                frame=None if row is None else self._frame(row),
                shell_mean_cm=scale_figure(shell_mean, unit),
                shell_max_cm=scale_figure(shell_most, unit),
                shell_frame=None if shell_row is None else self._frame(shell_row),
            )
            for name, size, (mean, most, row), (shell_mean, shell_most, shell_row) in zip(
                names, sizes, points, shells, strict=True
            )
        )
