"""Points of a skeleton: names, positions over time, and motions of a marker at each of them.

SPEC.md, "Kinematics", defines the points; its section "Positions" defines the fields of a marker
clip. ``mcz/exchange/conversion/marker_fit.py`` is the inverse.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.hints import Hint
from mcz.kinematics.chain import Chain, Pose, chain_of, multiply_matrices
from mcz.model.checks import check_arguments
from mcz.model.motion import A_MOTION, POSITION_KINDS, Channel, Joint, Motion, Signal, Skeleton
from mcz.model.text_format import named
from mcz.model.types import Floats

MARKER_DISTANCE_CM = 3.0  # of a virtual marker from its joint's point
SHELL_CM = 3.0  # from a joint's origin to a point of its shell, the default


class Places(NamedTuple):
    """Positions over time, each float64 (n_frames, n, 3) in length units.

    ``points`` as in ``positions``. ``markers``: three a joint, 3 cm off its first point along its
    local axes x, y and z. ``shell``: three a joint, at a radius from its origin along the axes that
    turn with it; in the rest pose these are the world's axes, independent of ``axis``. Markers and
    shell are empty (n = 0) if not requested.
    """

    points: Floats
    markers: Floats
    shell: Floats


def positions(motion: Motion) -> Floats:
    """Positions of the points of ``motion``, float64 (n_frames, n_points, 3), in length units.

    ``point_names`` lists these points. A point that depends on an invalid value is NaN. Raises
    MotionError if the skeleton has no kinematics: its angle unit is unknown, or all of its
    channels are plain scalars.
    """
    if not motion.signals[0].has_poses:
        raise MotionError(
            "the channels of its motion signal differ from those of its skeleton", clip=motion.name
        )
    return positions_of(motion.skeleton, np.asarray(motion.values, np.float64))


def positions_of(skeleton: Skeleton, values: Floats) -> Floats:
    """Positions of the points for ``values`` (n_frames, n_channels) in source units."""
    return _Positions(skeleton, values).points


def origins_of(skeleton: Skeleton, values: Floats) -> Floats:
    """Origins of the joints, for any point set, float64 (n_frames, n_joints, 3)."""
    origins = np.empty((len(values), skeleton.n_joints, 3))
    for rows, _, pose in chain_of(skeleton).poses(values):
        for joint, origin in enumerate(pose.origins):
            origins[rows, joint] = origin.T
    discard_infinite(origins)
    return origins


def points_and_markers_of(skeleton: Skeleton, values: Floats) -> tuple[Floats, Floats]:
    """Points and markers from one pass over the joints."""
    places = places_of(skeleton, values, markers=True)
    return places.points, places.markers


def places_of(
    skeleton: Skeleton, values: Floats, *, markers: bool = False, shell_cm: float | None = None
) -> Places:
    """Points and, on request, markers and a shell of this radius, in one pass over the joints.

    Raises OptionError if markers or a shell are requested and the length unit is unknown, otherwise
    as ``positions``.
    """
    positions = _Positions(skeleton, values, markers=markers, shell_cm=shell_cm)
    return Places(positions.points, positions.markers, positions.shell)


class _Positions:
    """Points (n_frames, n_points, 3) and, on request, virtual markers and shell points."""

    def __init__(
        self,
        skeleton: Skeleton,
        values: Floats,
        *,
        markers: bool = False,
        shell_cm: float | None = None,
    ) -> None:
        self._list = list(listed_points(skeleton))
        self._distance = marker_distance(skeleton) if markers else 0.0
        self._firsts = dict(reversed(self._list)) if markers else {}  # earlier points replace later
        self._radius = 0.0 if shell_cm is None else shell_radius(skeleton, shell_cm)
        n_shell = 0 if shell_cm is None else 3 * skeleton.n_joints
        self.points = np.empty((len(values), len(self._list), 3))
        self.markers = np.empty((len(values), 3 * len(self._firsts), 3))
        self.shell = np.empty((len(values), n_shell, 3))
        chain = chain_of(skeleton)
        for rows, columns, pose in chain.poses(values):
            self._place(chain, rows, columns, pose)
            if n_shell:
                self._place_shell(chain, rows, pose)

    def _place(self, chain: Chain, rows: slice, columns: Floats, pose: Pose) -> None:
        points, markers = self.points[rows], self.markers[rows]
        by_joint = markers.reshape(len(markers), len(self._firsts), 3, 3)
        for number, (joint, tail) in enumerate(self._list):
            point = point_position(chain, joint, tail, columns, pose)
            points[:, number] = point.T
            if self._firsts.get(joint) == tail:
                by_joint[:, joint] = (point[:, None] + self._distance * pose.axes[joint]).T
        discard_infinite(points)
        discard_infinite(markers)

    def _place_shell(self, chain: Chain, rows: slice, pose: Pose) -> None:
        shell = self.shell[rows]
        by_joint = shell.reshape(len(shell), len(pose.axes), 3, 3)
        for joint, (origin, axes, own) in enumerate(
            zip(pose.origins, pose.axes, chain.turned, strict=True)
        ):
            turned = (
                axes if own is None else multiply_matrices(axes, own.T[:, :, None])
            )  # W, as B = W C
            by_joint[:, joint] = (origin[:, None] + self._radius * turned).T
        discard_infinite(shell)


def marker_distance(skeleton: Skeleton) -> float:
    if skeleton.unit_cm is None:
        raise OptionError(
            f"the length unit of {named('skeleton', skeleton.name)} is unknown, but virtual "
            "markers lie 3 cm off its joints",
            hint=Hint.UNIT,
        )
    return MARKER_DISTANCE_CM / skeleton.unit_cm


def check_radius(radius_cm: float) -> None:
    """Raise OptionError for a bad radius of a shell."""
    if not 0 < radius_cm < np.inf:
        raise OptionError(f"the radius of the shell is {radius_cm} cm; it must be above 0")


def shell_radius(skeleton: Skeleton, radius_cm: float) -> float:
    """``radius_cm`` in length units; OptionError if the unit is unknown."""
    check_radius(radius_cm)
    if skeleton.unit_cm is None:
        raise OptionError(
            f"the length unit of {named('skeleton', skeleton.name)} is unknown, but the shell lies "
            f"{radius_cm:g} cm off its joints",
            hint=Hint.UNIT,
        )
    return radius_cm / skeleton.unit_cm


def discard_infinite(points: Floats) -> None:
    """Make points NaN that have a coordinate, in the last axis, that is not finite."""
    known = np.isfinite(points)
    if not known.all():  # a search in the last axis takes twenty times as long
        points[~known.all(axis=-1)] = np.nan


def point_position(chain: Chain, joint: int, tail: int, columns: Floats, pose: Pose) -> Floats:
    """Position of a point, (3, F) or (3, 1); ``tail`` -1 is the joint's origin."""
    return pose.origins[joint] if tail < 0 else chain.tail(joint, tail, columns, pose)


def point_set(skeleton: Skeleton) -> str:
    """Id of the point set in SPEC.md's registry: "acclaim", "bvh" or "markers"."""
    if skeleton.joints and all(map(is_marker, skeleton.joints)):
        return "markers"
    return "bvh" if skeleton.intrinsic else "acclaim"


def is_marker(joint: Joint) -> bool:
    """Return True for a marker: parentless, without tails, with only tx, ty and tz."""
    kinds = sorted(channel.kind for channel in joint.channels)
    return joint.parent < 0 and not joint.tails and kinds == list(POSITION_KINDS)


def point_names(skeleton: Skeleton) -> tuple[str, ...]:
    """Name of every point: its joint's name, with " end" for a tail of a BVH joint.

    From the second tail of a joint on a number follows. A name that repeats has ``#n``.
    """
    names = []
    addresses = skeleton.addresses()
    for joint, tail in listed_points(skeleton):
        name = addresses[joint]
        if tail >= 0 and (skeleton.intrinsic or tail):
            name += " end" if tail == 0 else f" end {tail + 1}"
        names.append(name)
    return tuple(names)


def listed_points(skeleton: Skeleton) -> Iterator[tuple[int, int]]:
    """The points in order, each as its joint and the number of its tail, -1 for the origin."""
    for index, joint in enumerate(skeleton.joints):
        if skeleton.intrinsic or not joint.tails:
            yield index, -1
        for tail in range(len(joint.tails)):
            yield index, tail


def points_of(skeleton: Skeleton) -> list[list[int]]:
    """The points of every joint, as numbers of its tails, -1 for its origin."""
    result: list[list[int]] = [[] for _ in skeleton.joints]
    for joint, tail in listed_points(skeleton):
        result[joint].append(tail)
    return result


def first_points(skeleton: Skeleton) -> list[int]:
    """The first point of every joint, as its index among all points."""
    firsts: dict[int, int] = {}
    for number, (joint, _) in enumerate(listed_points(skeleton)):
        firsts.setdefault(joint, number)
    return [firsts[joint] for joint in range(skeleton.n_joints)]


def depths(skeleton: Skeleton) -> Floats:
    """Relative depth of each joint, 0 for roots to 1 for the deepest, (n_joints,).

    All 0 if no joint has a parent. Joints without channels count as well.
    """
    steps = np.zeros(skeleton.n_joints)
    for index, joint in enumerate(skeleton.joints):
        if joint.parent >= 0:
            steps[index] = steps[joint.parent] + 1
    steps /= max(1.0, steps.max(initial=0.0))
    return steps


def reach(skeleton: Skeleton) -> float:
    """The size of a skeleton: greatest distance of a point from its root in the rest pose.

    In length units; 0.0 for roots alone, infinity beyond the range of floats.
    """
    origins: list[Floats] = []
    greatest = 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        for joint in skeleton.joints:
            origin = np.zeros(3)
            if joint.parent >= 0:
                origin = origins[joint.parent] + np.array(joint.offset)
            origins.append(origin)
            for end in (origin, *(origin + np.array(tail) for tail in joint.tails)):
                greatest = max(greatest, float(np.sqrt(end @ end)))
    return greatest


NOTE = "positions by forward kinematics"  # the source-note of a computed motion begins with it
SEPARATOR = "; "


@check_arguments(motion=A_MOTION)
def in_positions(motion: Motion, *, virtual_markers: bool = False) -> Motion:
    """Markers at the points of ``motion``; with ``virtual_markers`` three more for every joint.

    The markers have the length unit and up axis of the skeleton. ``skeleton.base`` is not set: the
    writer sets it. There is no source, since it could not be restored. An unknown position is 0
    under a mask. A motion of markers is returned unchanged.

    Raises MotionError if the skeleton has no kinematics, OptionError for virtual markers if
    its length unit is unknown.
    """
    skeleton, first = motion.skeleton, motion.signals[0]
    if point_set(skeleton) == "markers":
        return motion
    if not first.has_poses:
        raise MotionError(
            "the channels of its motion signal differ from those of its skeleton", clip=motion.name
        )
    values = np.asarray(motion.values, np.float64)
    positions = marker_values(skeleton, values, virtual_markers=virtual_markers)
    valid = ~np.isnan(positions)
    signal = Signal(
        np.where(valid, positions, 0.0),
        name=first.name,
        samples_per_frame=first.samples_per_frame,
        mask=None if valid.all() else valid,
    )
    markers = replace(
        motion,
        skeleton=marker_skeleton(skeleton, virtual_markers=virtual_markers),
        signals=(signal, *motion.signals[1:]),
        metadata=dict(motion.metadata) | {"source-note": _note(motion)},
        source=None,
    )
    return markers.at_times(motion.timeline)


def marker_skeleton(skeleton: Skeleton, *, virtual_markers: bool = False) -> Skeleton:
    """A marker for each point of ``skeleton``, then its virtual markers."""
    names = list(point_names(skeleton))
    if virtual_markers:
        names += virtual_marker_names(skeleton)
    channels = tuple(map(Channel, POSITION_KINDS))
    return Skeleton(
        tuple(Joint(name, channels=channels) for name in names),
        skeleton.name,
        skeleton.unit_cm,
        "",
        skeleton.up_axis,
        skeleton.forward_axis,
        skeleton.handedness,
    )


def marker_values(skeleton: Skeleton, values: Floats, *, virtual_markers: bool = False) -> Floats:
    """The values of ``marker_skeleton``, (n_frames, n_channels), NaN if a position is unknown.

    ``values`` are the values of ``skeleton``, (n_frames, its channels). Raises as ``in_positions``.
    """
    if virtual_markers:
        positions = np.concatenate(points_and_markers_of(skeleton, values), axis=1)
    else:
        positions = positions_of(skeleton, values)
    return positions.reshape(len(positions), 3 * positions.shape[1])


def virtual_marker_names(skeleton: Skeleton) -> list[str]:
    """The names of the virtual markers of a skeleton, in order: ``JOINT+x``, ``JOINT+y``, ..."""
    return [f"{address}+{axis}" for address in skeleton.addresses() for axis in "xyz"]


def _note(motion: Motion) -> str:
    note = NOTE if motion.source is None else f"{NOTE} of {motion.source.format.upper()}"
    return SEPARATOR.join(filter(None, [note, motion.metadata.get("source-note")]))


def without_note(motion: Motion) -> dict[str, str]:
    """The metadata of ``motion`` without the note that ``in_positions`` adds."""
    metadata = dict(motion.metadata)
    note = metadata.pop("source-note", "")
    if note.startswith(NOTE):
        note = note.partition(SEPARATOR)[2]
    return metadata | ({"source-note": note} if note else {})
