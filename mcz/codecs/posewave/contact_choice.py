"""What the encoder of ``posewave`` makes of contacts: limbs, and the pieces that each corrects.

A decoder needs none of it. SPEC.md, "Held contacts", says what comes of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import SignalSource
from mcz.codecs.gaps import FrameReader
from mcz.codecs.parameters import in_range
from mcz.codecs.posewave.contact_keeper import Piece
from mcz.codecs.posewave.contact_plan import MAX_CHAIN, MAX_JOINTS, MAX_LIMBS, path_of
from mcz.codecs.posewave.header import NAME
from mcz.codecs.segments import skeleton_of
from mcz.errors import OptionError
from mcz.kinematics.contacts import FootTracks
from mcz.kinematics.feet import feet_of
from mcz.kinematics.points import points_of, positions_of
from mcz.motion import POSITION_KINDS, ROTATION_KINDS, Skeleton

Run = tuple[str, int, int]  # a joint whose first point stands, its first frame, how many there are
Runs = tuple[Run, ...] | str

FEET = "feet"
BLOCK = 1024  # frames that are looked at together

TURNING_JOINTS = 3  # that give way above a point
SPREAD = 0.866  # of the grid against the tolerance: no place is farther from it than 0.97
ROUNDS = 6


@dataclass(frozen=True, slots=True)
class Wanted:
    """Fields of CONTACTS, and the pieces to hold, in the order of their limbs and frames."""

    fields: dict[str, Any]
    pieces: tuple[Piece, ...]


def parse_runs(given: Any) -> Runs:
    """Contacts as "lfoot:120+45,rfoot:160+52", or as tuples of a name and two numbers.

    "feet": wherever a foot stands, by the usual rule.
    """
    if given == FEET:
        return FEET
    try:
        if isinstance(given, str):
            parts = [part.rpartition(":") for part in given.split(",") if part]
            given = [(name, *span.split("+")) for name, _, span in parts]
        runs = tuple((str(name), int(first), int(count)) for name, first, count in given)
    except (TypeError, ValueError):
        raise OptionError(f"contacts are {given!r}, not like lfoot:120+45,rfoot:160+52") from None
    for name, first, count in runs:
        if first < 0 or count < 1:
            raise OptionError(f"contacts: {count} frames of {name} from frame {first} on")
    return runs


in_range("feet, or joint:first+frames, ...", parse_runs)


def runs_of(source: SignalSource, wanted: Runs) -> tuple[Run, ...]:
    """What is ``wanted``, feet found: of each leg the first joint that is one by its name.

    Raises OptionError for what is beyond the clip, MotionError where no joint is a foot.
    """
    layout = source.layout
    skeleton, n_frames = skeleton_of(NAME, layout), layout.n_frames
    if isinstance(wanted, tuple):
        if any(first + count > n_frames for _, first, count in wanted):
            raise OptionError(f"contacts go beyond {n_frames} frames")
        return wanted
    feet = set(feet_of(skeleton))
    highest = [foot for foot in sorted(feet) if not feet.intersection(path_of(skeleton, foot)[:-1])]
    tracks, reader = FootTracks(skeleton, highest, n_frames), FrameReader(NAME, source)
    for start in range(0, n_frames, BLOCK):
        values = reader.next(min(start + BLOCK, n_frames))
        tracks.add(start, positions_of(skeleton, values))
    rate = None if layout.frame_rate is None else float(layout.frame_rate)
    found = tracks.contacts(rate, skeleton.up_axis)
    return tuple((run.joint, run.first, run.n_frames) for run in found.runs)


def choose_contacts(
    skeleton: Skeleton, runs: Iterable[Run], tolerance: float, moving: NDArray[np.bool_]
) -> Wanted:
    """What keeps the places of ``runs`` to ``tolerance``, in length units.

    ``moving`` (n_channels,) tells which channels change at all. Raises OptionError for a joint
    that no limb moves.
    """
    by_joint: dict[int, list[tuple[int, int]]] = {}
    for name, first, count in runs:
        by_joint.setdefault(_joint(skeleton, name), []).append((first, first + count))
    joints = sorted(by_joint, key=lambda joint: len(path_of(skeleton, joint)))
    limbs: list[dict[str, Any]] = []
    pieces: list[Piece] = []
    done: dict[int, list[tuple[int, int]]] = {}
    for joint in joints:
        spans = _joined(by_joint[joint])
        path = path_of(skeleton, joint)
        above = [other for other in done if other in path]
        others = [o for o in joints if o not in path and joint not in path_of(skeleton, o)]
        columns = _chain(skeleton, joint, others, moving)
        held = _joined([span for other in above for span in done[other]])
        below = any(joint in path_of(skeleton, other) for other in joints if other != joint)
        exact = bool(above) or below
        step = float(np.float32(SPREAD * tolerance * (0.5 if exact else 1.0)))
        limb = {"joint": joint, "tail": _tail(skeleton, joint), "step": step, "columns": columns}
        _add(limbs, pieces, limb, spans, held, (False, exact))
        if above:
            deepest = max(above, key=path.index)
            free = [
                c
                for c in columns
                if _owner(skeleton, c)
                in path[path.index(deepest) + bool(_tail(skeleton, deepest)) :]
            ]
            _add(limbs, pieces, {**limb, "columns": free}, spans, held, (True, exact))
        done[joint] = spans
    if len(limbs) > MAX_LIMBS:
        raise OptionError(f"contacts: {len(limbs)} limbs, {MAX_LIMBS} at most")
    return Wanted({"rounds": ROUNDS, "limbs": limbs}, tuple(pieces))


def _joint(skeleton: Skeleton, name: str) -> int:
    addresses = list(skeleton.addresses())
    if name not in addresses:
        raise OptionError(f"contacts: there is no joint {name!r}")
    return addresses.index(name)


def _tail(skeleton: Skeleton, joint: int) -> int:
    """The first point of a joint, 0 for its origin, n for its tail n - 1."""
    return points_of(skeleton)[joint][0] + 1


def _joined(spans: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """In order, those that touch as one."""
    found: list[tuple[int, int]] = []
    for first, stop in sorted(spans):
        if found and first <= found[-1][1]:
            found[-1] = found[-1][0], max(stop, found[-1][1])
        else:
            found.append((first, stop))
    return found


def _owner(skeleton: Skeleton, column: int) -> int:
    return next(j for j in range(skeleton.n_joints) if column in skeleton.columns(j))


def _chain(
    skeleton: Skeleton, joint: int, others: Sequence[int], moving: NDArray[np.bool_]
) -> list[int]:
    """Rotation channels of the joints above a point, but for the root and what others share."""
    path = path_of(skeleton, joint)
    kinds = {skeleton.channels[c].kind for j in path for c in skeleton.columns(j)}
    name = skeleton.joints[joint].name
    if kinds - {*POSITION_KINDS, *ROTATION_KINDS, ""} or len(path) > MAX_JOINTS:
        raise OptionError(f"contacts: {name} is not moved by rotations and positions alone")
    shared = {j for other in others for j in path_of(skeleton, other)}
    found: list[int] = []
    n_joints = 0
    for above in reversed(path[1:] if _tail(skeleton, joint) else path[1:-1]):
        own = [
            c
            for c in skeleton.columns(above)
            if skeleton.channels[c].kind in ROTATION_KINDS and moving[c]
        ]
        if not own:
            continue
        if above in shared or n_joints == TURNING_JOINTS or len(found) + len(own) > MAX_CHAIN:
            break
        found = own + found
        n_joints += 1
    if len(found) < 3:
        raise OptionError(f"contacts: {len(found)} rotations above {name} move it alone")
    return found


def _add(
    limbs: list[dict[str, Any]],
    pieces: list[Piece],
    limb: dict[str, Any],
    spans: Sequence[tuple[int, int]],
    held: Sequence[tuple[int, int]],
    kind: tuple[bool, bool],
) -> None:
    """Add a limb and the pieces of ``spans`` that are, or are not, within those ``held``.

    ``kind``: whether they are, and whether they are exact.
    """
    within, exact = kind
    own: list[Piece] = []
    for origin, stop in spans:
        taken = np.full(stop - origin, not within)
        for first, end in held:
            taken[max(first - origin, 0) : max(end - origin, 0)] = within
        edges = np.flatnonzero(np.diff(taken.astype(np.int64), prepend=0, append=0))
        for first, end in edges.reshape(-1, 2).tolist():
            own.append(Piece(len(limbs), origin + first, end - first, origin, exact))
    if own:
        limbs.append(limb)
        pieces += own
