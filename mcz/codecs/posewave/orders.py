"""Joints that are coded as Euler angles in another order of axes than the source has.

SPEC.md, "Axis orders", is normative. When the middle angle of the source comes near a quarter turn,
its other two turn fast although the joint does not; in another order all three may be calm.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from mcz.codecs.contract import SignalSource
from mcz.codecs.posewave import order_kernels
from mcz.codecs.posewave.trigonometry import BEYOND, RULES, VECTOR
from mcz.codecs.segments import skeleton_of
from mcz.codecs.source_readers import FrameReader
from mcz.errors import FormatError, MotionError
from mcz.kinematics.angles import FULL_TURN
from mcz.model.motion import QUATERNION_KINDS, ROTATION_KINDS, VECTOR_KINDS, Joint, Skeleton
from mcz.model.schema import read_varint, varint
from mcz.model.types import Floats, Ints

AxisSequence = tuple[int, int, int]  # axes as their rotations are multiplied from the left

SEQUENCES: tuple[AxisSequence, ...] = (
    (0, 1, 2),
    (0, 2, 1),
    (1, 0, 2),
    (1, 2, 0),
    (2, 0, 1),
    (2, 1, 0),
)
CODED = (*SEQUENCES, (VECTOR, VECTOR, VECTOR))  # code n: CODED[n - 1]
N_ORDERS = VECTOR_CODE = len(CODED)
N_NOTES = 4  # kinds: a switch, turns about x, y, z
MAX_TURNS = 2**41
PRICE = 0.25  # of a switch, in turns


class ReorderedJoint(NamedTuple):
    """A coded joint: its columns by axis x y z, the sequence coded, and the source's."""

    columns: Ints
    coded: Ints
    own: Ints


def own_sequence(joint: Joint, skeleton: Skeleton) -> AxisSequence | None:
    """Axis sequence of a joint that can be reordered, None otherwise.

    It has three rotation channels about three axes, no other, and angles of a known unit.
    """
    kinds = [channel.kind for channel in joint.channels]
    axes = [ROTATION_KINDS.index(kind) for kind in kinds if kind in ROTATION_KINDS]
    if sorted(axes) != [0, 1, 2] or not skeleton.angle_unit:
        return None
    if any(kind in (*QUATERNION_KINDS, *VECTOR_KINDS) for kind in kinds):
        return None
    a, b, c = axes if skeleton.intrinsic else axes[::-1]
    return a, b, c


def columns_by_axis(skeleton: Skeleton, index: int) -> list[int]:
    """Columns of a joint's rotations about x, y and z; the joint has one of each."""
    kinds = [channel.kind for channel in skeleton.joints[index].channels]
    start = skeleton.columns(index).start
    return [start + kinds.index(kind) for kind in ROTATION_KINDS]


def vector_codes(skeleton: Skeleton) -> dict[int, int]:
    """The codes of a header with the flag of vectors and without records."""
    return {
        index: VECTOR_CODE
        for index, joint in enumerate(skeleton.joints)
        if joint.parent >= 0 and own_sequence(joint, skeleton) is not None
    }


def check_orders(codes: Mapping[int, int], skeleton: Skeleton, where: str) -> None:
    """Raises FormatError for a joint that cannot have an order."""
    for index, code in codes.items():
        if own_sequence(skeleton.joints[index], skeleton) is None:  # PWAVE-23
            raise FormatError(f"joint {index} cannot have axis order {code}", where=where)


class Orders:
    """The orders of a clip: ``codes`` by joint, ascending."""

    def __init__(self, codes: Mapping[int, int], skeleton: Skeleton) -> None:
        self.rule = RULES[skeleton.angle_unit]
        self.full = FULL_TURN.get(skeleton.angle_unit, 0.0)
        self.places = [_reordered_joint(skeleton, joint, code) for joint, code in codes.items()]

    def to_coded_order(self, values: Floats) -> Floats:
        """Convert ``values`` of the source, (n_frames, n_channels), to coded orders."""
        if not self.places:
            return values
        coded, nothing = values.copy(), np.zeros((len(values), N_NOTES), np.int64)
        for place in self.places:
            if not (np.abs(values[:, place.columns]) < BEYOND).all():
                raise MotionError(
                    "posewave: an angle is 2^40 or more, too large for another axis order"
                )
            if place.coded[0] == VECTOR:
                angles = np.ascontiguousarray(values[:, place.columns])
                order_kernels.follow_vectors(angles, place.own, self.full, self.rule)
            else:
                angles = self._reorder_axes(values, place, place.own, place.coded)
                order_kernels.follow_angles(angles, place.coded, self.full, nothing)
            coded[:, place.columns] = angles
        return coded

    def notes_and_values(self, source: Floats, coded: Floats) -> tuple[bytes, Floats]:
        """Notes for a decoder of ``to_coded_order`` values, and the values that it restores."""
        if not self.places:
            return b"", coded
        notes = np.zeros((len(coded), len(self.places), N_NOTES), np.int64)
        for index, place in enumerate(self.places):
            angles = self._reorder_axes(coded, place, place.coded, place.own)
            turns, own = source[:, place.columns], notes[:, index]
            order_kernels.choose_switches(
                angles, turns, place.own, self.full, PRICE * self.full, own
            )
            order_kernels.follow_angles(angles, place.own, self.full, own)
            order_kernels.choose_turns(angles, turns, self.full, own)
        return _build_notes(notes), self.values(coded, notes)

    def read_notes(self, stream: bytes, n_frames: int, where: str) -> tuple[Ints, bytes]:
        """The notes, (n_frames, n_places, 4), at the start of a stream, and the rest of it."""
        notes = np.zeros((n_frames, len(self.places), N_NOTES), np.int64)
        return (notes, _read_notes(stream, notes, where)) if self.places else (notes, stream)

    def values(self, coded: Floats, notes: Ints) -> Floats:
        """Restore the source's values by the notes of ``read_notes``."""
        values = coded.copy() if self.places else coded
        for index, place in enumerate(self.places):
            angles = self._reorder_axes(coded, place, place.coded, place.own)
            order_kernels.follow_angles(angles, place.own, self.full, notes[:, index])
            values[:, place.columns] = angles
        return values

    def _reorder_axes(
        self, values: Floats, place: ReorderedJoint, old_order: Ints, order: Ints
    ) -> Floats:
        angles = np.ascontiguousarray(values[:, place.columns])
        order_kernels.reorder_axes(angles, old_order, order, self.rule)
        return angles


def _reordered_joint(skeleton: Skeleton, index: int, code: int) -> ReorderedJoint:
    columns = columns_by_axis(skeleton, index)
    own = own_sequence(skeleton.joints[index], skeleton)
    return ReorderedJoint(*(np.array(x, np.int64) for x in (columns, CODED[code - 1], own)))


def _build_notes(notes: Ints) -> bytes:
    """Build the notes: their count, then the distance to the previous one and the turns of each."""
    flat = notes.ravel()
    numbers = np.flatnonzero(flat).tolist()
    out = bytearray(varint(len(numbers)))
    for before, number in pairwise([-1, *numbers]):
        out += varint(number - before - 1)
        if number % N_NOTES:
            turns = int(flat[number])
            out += varint(2 * turns if turns >= 0 else -2 * turns - 1)
    return bytes(out)


def _read_notes(stream: bytes, notes: Ints, where: str) -> bytes:
    """Fill ``notes``; return the rest of the stream."""
    flat, number = notes.reshape(-1), -1
    count, at = read_varint(stream, 0)
    for _ in range(count):
        gap, at = read_varint(stream, at)
        number += 1 + gap
        if number >= len(flat):  # PWAVE-25
            raise FormatError(f"note {number} does not exist; there are {len(flat)}", where=where)
        flat[number] = 1
        if number % N_NOTES:
            turns, at = read_varint(stream, at)
            if not 0 < turns < MAX_TURNS:  # PWAVE-26
                raise FormatError(f"{turns} turns are out of range", where=where)
            flat[number] = (turns >> 1) ^ -(turns & 1)  # PWAVE-24
    return stream[at:]


SOURCE_ORDER = 0  # code of the order of the source
RUNS, RUN_FRAMES = 8, 128  # sampled runs of a long clip
DUE = 0.985  # an order is chosen if its score is below this share of the source's
VECTOR_SHARE = 0.96  # of their score: vectors suit the metric better than angles
STILL = 1e-4  # of a turn: a joint whose steps change by less keeps its order
GREATEST = 2.0**20  # of an angle, whose sine is exact enough in any unit


def choose_orders(name: str, source: SignalSource, exact: Container[int] = ()) -> dict[int, int]:
    """Choose an order for each joint that is calmer in another order than the source's.

    Joints with ``exact`` channels keep the source's order. Angles that jump or turn fast cost
    bytes: bits by the logarithms of their second differences, approximated by roots.
    """
    skeleton = skeleton_of(name, source.layout)
    joints = [
        index
        for index, joint in enumerate(skeleton.joints)
        if own_sequence(joint, skeleton) is not None
        and not any(channel in exact for channel in skeleton.columns(index))
    ]
    if not joints:
        return {}
    columns = np.array([columns_by_axis(skeleton, index) for index in joints])
    scores, highest, n_rows = np.zeros((1 + N_ORDERS, len(joints))), np.zeros(len(joints)), 0
    roots = [skeleton.joints[joint].parent < 0 for joint in joints]
    orders = [
        Orders(dict.fromkeys(joints, code) if code != SOURCE_ORDER else {}, skeleton)
        for code in range(1 + N_ORDERS)
    ]
    for values in _runs(name, source):
        n_rows += len(values)
        highest = np.maximum(highest, np.abs(values[:, columns]).max(axis=(0, 2), initial=0.0))
        values = np.clip(values, -GREATEST, GREATEST)
        for code, order in enumerate(orders):
            coded = order.to_coded_order(values)[:, columns]
            scores[code] += np.sqrt(np.abs(np.diff(coded, 2, axis=0))).sum(axis=(0, 2))
    scores[VECTOR_CODE] = np.where(roots, math.inf, VECTOR_SHARE * scores[VECTOR_CODE])
    full = orders[SOURCE_ORDER].full
    moves = (scores[SOURCE_ORDER] > np.sqrt(STILL * full) * n_rows) & (highest < GREATEST)
    worth = moves & (scores.min(axis=0) < DUE * scores[SOURCE_ORDER])
    best = np.where(worth, scores.argmin(axis=0), SOURCE_ORDER).tolist()
    return {joint: code for joint, code in zip(joints, best, strict=True) if code != SOURCE_ORDER}


def _runs(name: str, source: SignalSource) -> Iterator[Floats]:
    """Runs of frames, evenly spread; the whole of a short clip."""
    n_frames = source.layout.n_frames
    starts, length = np.zeros(1, np.int64), n_frames
    if n_frames > RUNS * RUN_FRAMES:
        starts, length = np.linspace(0, n_frames - RUN_FRAMES, RUNS).astype(np.int64), RUN_FRAMES
    for start in starts.tolist():
        reader = FrameReader(name, source)
        reader.at = start
        yield reader.next(start + length)
