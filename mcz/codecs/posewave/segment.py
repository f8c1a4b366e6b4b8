"""Segments of ``posewave``: streams from frames, and back.

SPEC.md, "Codec 3: posewave", is normative; ``level_coder.py`` goes from level to level. Segments
without levels may continue the previous state: "Segments that go on".
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import partial

import numpy as np

from mcz.codecs.posewave.contacts import ContactTracker, decode_contacts, room_of_contacts
from mcz.codecs.posewave.header import NAME, Header
from mcz.codecs.posewave.level_coder import LevelCoder, Pyramid
from mcz.codecs.posewave.model import start_coder
from mcz.codecs.posewave.orders import Orders
from mcz.codecs.posewave.row_coder import RowCoder, RowMemory, Stream, code_head
from mcz.codecs.transforms import lifting
from mcz.errors import FormatError, MotionError
from mcz.model.motion import ANGLE_KINDS, POSITION_KINDS, ROTATION_KINDS, Skeleton
from mcz.model.types import Bools, Floats, Ints

MOST_STILL = 4.0  # steps: a channel that stays so near its middle is constant
MAX_NUMBER = 2.0**40  # of a first value


@dataclass(frozen=True, slots=True)
class Weights:
    """Price of a bit in squared steps, for approximations and for details."""

    approximations: float
    details: float

    def of(self, level: int) -> float:
        return self.details if level else self.approximations


@dataclass(frozen=True, slots=True)
class Head:
    """Changing channels of a segment, and the first value of every channel, in steps."""

    moving: Bools
    numbers: Ints

    def kept(self, header: Header) -> Bools:
        """The channels that are coded in rows."""
        return self.moving & ~header.exact  # PWAVE-38

    def values(self, header: Header) -> Floats:
        """The pose of the numbers, (n_channels,)."""
        steps = np.where(self.moving, header.first, header.constant)
        return np.multiply(self.numbers, steps, dtype=np.float64)


def encode_segment(
    header: Header,
    skeleton: Skeleton,
    values: Floats,
    weights: Weights,
    refinement: Ints | None = None,
    contacts: ContactTracker | None = None,
    memory: RowMemory | None = None,
) -> tuple[tuple[bytes, ...], Floats]:
    """Encode a segment of unwrapped ``values``; return its streams and the decoded values.

    Both are (n_frames, n_channels). ``refinement`` (n_frames,) requests steps of 2^-r of the usual
    ones for rows that affect these frames, ``contacts`` are held, ``memory`` is of earlier encodes.
    Results for exact channels are undefined. Raises MotionError for values that are too large.
    """
    orders = Orders(header.orders, skeleton)
    coded = orders.to_coded_order(values)
    streams, decoded = encode_coded(header, skeleton, coded, weights, refinement, contacts, memory)
    notes, decoded = orders.notes_and_values(values, decoded)
    return (notes + streams[0], *streams[1:]), decoded


def encode_coded(
    header: Header,
    skeleton: Skeleton,
    values: Floats,
    weights: Weights,
    refinement: Ints | None = None,
    contacts: ContactTracker | None = None,
    memory: RowMemory | None = None,
) -> tuple[tuple[bytes, ...], Floats]:
    """Encode a segment of ``values`` whose angles are in the orders of the header."""
    pyramid = Pyramid(len(values), header.levels, header.borrowing)
    if refinement is None or not header.refining:
        refinement = np.zeros(len(values), np.int64)
    kept = choose_kept(header, values)
    approx, details = values[:, kept], []
    for _ in range(pyramid.n_details):
        approx, detail = lifting.split(approx)
        details.append(detail)
    bands = [approx, *reversed(details)]
    head = choose_head(header, values, kept, approx)
    classes, coder = classes_of(skeleton, header.whole), start_coder(header.start)
    rows = RowCoder(header, classes, kept, coder, NAME)
    levels = LevelCoder(header, skeleton, pyramid, kept, head.values(header))
    streams = []
    for level, band in enumerate(bands):
        room = room_of(pyramid, level, kept) + room_of_contacts(header.contacts, len(values))
        stream = Stream(coder, room, None)
        if level == 0:
            moving = head.moving.astype(np.int64)
            code_head(stream, kinds_of(skeleton, header.whole), moving, head.numbers.copy(), NAME)
        rows.begin(level, pyramid.kind(level), len(band), stream)
        exponents = pyramid.exponents(level, refinement)
        rows.exponents[:] = exponents
        if memory:
            memory.recall(level, rows)
        weight = weights.of(level)
        if level:
            levels.code_details(level, partial(rows.encode, weight), band, rows.exponents)
        else:
            levels.code_coarsest(level, partial(rows.encode_course, weight), band, rows.exponents)
        if memory:
            memory.note(level, exponents, rows)
        if level < pyramid.n_details:
            streams.append(stream.finish())
    decoded = levels.values()
    if header.contacts and kept.any():
        points = levels.held_points(header.contacts)
        (contacts or ContactTracker()).encode(
            header.contacts, levels.usual.plan, points, stream, values, decoded
        )
    streams.append(stream.finish())
    empty = [b""] * (header.levels - pyramid.n_details)
    return (streams[0], *empty, *streams[1:]), decoded


def room_of(pyramid: Pyramid, level: int, kept: Bools) -> int:
    """Buffer size in bytes for the stream of a level."""
    return 8 * len(kept) + pyramid.rows(level) * (8 * int(kept.sum()) + 1) + 1024


def decode_segment(
    header: Header, skeleton: Skeleton, streams: Sequence[bytes], n_frames: int, where: str
) -> Floats:
    """The values, (n_frames, n_channels); details without a stream are zero.

    Results for exact channels are undefined.
    """
    pyramid = Pyramid(n_frames, header.levels, header.borrowing)
    n_empty = header.levels - pyramid.n_details
    if any(streams[1 : 1 + n_empty]):  # PWAVE-17
        raise FormatError(f"a level has a stream that {n_frames} frames do not need", where=where)
    orders = Orders(header.orders, skeleton)
    notes, coarsest = orders.read_notes(streams[0], n_frames, where)
    streams = [coarsest, *streams[1 + n_empty :]]
    classes = classes_of(skeleton, header.whole)
    coder = start_coder(header.start)
    stream = Stream(coder, 0, streams[0])
    moving, numbers = np.zeros((2, len(classes)), np.int64)
    code_head(stream, kinds_of(skeleton, header.whole), moving, numbers, where)
    head = Head(moving == 1, numbers)
    kept = head.kept(header)
    levels = LevelCoder(header, skeleton, pyramid, kept, head.values(header))
    contacts = header.contacts if kept.any() else None
    points = levels.held_points(contacts) if contacts else None  # HOLD-07
    rows = RowCoder(header, classes, kept, coder, where)
    for level in range(pyramid.n_details + 1):
        if level >= len(streams):
            levels.skip(level)
            continue
        stream = Stream(coder, 0, streams[level]) if level else stream
        rows.begin(level, pyramid.kind(level), pyramid.rows(level), stream)
        coefficients = rows.decode(ends=level < pyramid.n_details or not points)
        (levels.take_details if level else levels.take_coarsest)(
            level, coefficients, rows.exponents
        )
    values = levels.values()
    if contacts and points and len(streams) > pyramid.n_details:
        plan = levels.usual.plan
        decode_contacts(contacts, plan, points, stream, values, f"{where}: contacts")
    return orders.values(values, notes)


def kinds_of(skeleton: Skeleton, whole: bool = False) -> Ints:
    """0 for rotation channels, 1 for positions, 2 for others."""
    kinds = [channel.kind for channel in skeleton.channels]
    turning = ANGLE_KINDS if whole else ROTATION_KINDS
    classes = [0 if k in turning else 1 if k in POSITION_KINDS else 2 for k in kinds]
    return np.array(classes, np.int64)


def classes_of(skeleton: Skeleton, whole: bool = False) -> Ints:
    """Class of each channel in the row model: by the number of joints a rotation moves."""
    turning = ANGLE_KINDS if whole else ROTATION_KINDS
    n_below = [1] * skeleton.n_joints
    for index in range(skeleton.n_joints - 1, -1, -1):
        parent = skeleton.joints[index].parent
        if parent >= 0:
            n_below[parent] += n_below[index]
    classes = []
    for joint, n in zip(skeleton.joints, n_below, strict=True):
        own = 1 if joint.parent < 0 else 2 + (n >= 2) + (n >= 4) + (n >= 8)
        classes += [own if channel.kind in turning else 0 for channel in joint.channels]
    return np.array(classes, np.int64)


def choose_kept(header: Header, values: Floats) -> Bools:
    """All channels except exact ones and those that hardly leave their middle."""
    moved: Bools = np.ptp(values, axis=0) > MOST_STILL * header.constant
    return moved & ~header.exact


def choose_head(header: Header, values: Floats, kept: Bools, approx: Floats) -> Head:
    """Kept channels begin near their first approximation, others stay in their middle.

    Exact ones, which only the pose needs, do so in coarse steps.
    """
    first = 0.5 * (values.min(axis=0) + values.max(axis=0))
    first[kept] = approx[0]
    moving = kept | header.exact
    numbers = first / np.where(moving, header.first, header.constant)
    if not (np.abs(numbers) < MAX_NUMBER).all():
        raise MotionError(f"{NAME}: a value exceeds 2^40 steps of {header.first.max():g}")
    return Head(moving, np.rint(numbers).astype(np.int64))


class SegmentChain:
    """State carried from segment to segment; after a refused one only a fresh one decodes."""

    def __init__(self, header: Header, skeleton: Skeleton) -> None:
        self.header, self.skeleton = header, skeleton
        self._classes = classes_of(skeleton, header.whole)
        self._kinds = kinds_of(skeleton, header.whole)
        self._level_coder: LevelCoder | None = None  # None: no segment can continue
        self._rows: RowCoder | None = None

    def copy(self) -> SegmentChain:
        """Return an independent copy."""
        clone = copy(self)
        if self._level_coder is not None and self._rows is not None:
            clone._level_coder, clone._rows = self._level_coder.copy(), self._rows.copy()
        return clone

    def decode(self, stream: bytes, n_frames: int, where: str, *, fresh: bool) -> Floats:
        """The values of a segment, (n_frames, n_channels); raises FormatError for bad bytes."""
        if fresh:
            coding = Stream(start_coder(self.header.start), 0, stream)
            kept, numbers = np.zeros((2, len(self._classes)), np.int64)
            code_head(coding, self._kinds, kept, numbers, where)
            level_coder, rows = self._begin(Head(kept == 1, numbers), n_frames, coding)
        else:
            level_coder, rows = self._continued_state(where)
            rows.go_on(n_frames, Stream(rows.model.coder, 0, stream))  # PWAVE-29
        self._level_coder = None
        rows.where = where
        level_coder.take_coarsest(0, rows.decode(), rows.exponents)
        self._level_coder, self._rows = level_coder, rows
        return level_coder.values()

    def encode(
        self, values: Floats, weight: float, exponent: int, *, fresh: bool
    ) -> tuple[bytes, Floats]:
        """Encode a segment of unwrapped ``values``; return its stream and the decoded values.

        Both are (n_frames, n_channels). A bit costs ``weight`` squared steps; the step is
        2^-``exponent`` of the usual one. Raises MotionError for values that are too large.
        """
        n_frames = len(values)
        if fresh:
            head = choose_head(self.header, values, np.ones(values.shape[1], np.bool_), values)
            coder = start_coder(self.header.start)
            coding = Stream(coder, room_of(Pyramid(n_frames, 0, 0), 0, head.moving), None)
            code_head(coding, self._kinds, head.moving.astype(np.int64), head.numbers.copy(), NAME)
            level_coder, rows = self._begin(head, n_frames, coding)
        else:
            level_coder, rows = self._continued_state(NAME)
            room = n_frames * (8 * rows.n_kept + 1) + 1024
            rows.go_on(n_frames, Stream(rows.model.coder, room, None))
        rows.exponents[:] = exponent
        code = partial(rows.encode_course, weight)
        level_coder.code_coarsest(0, code, values[:, level_coder.kept], rows.exponents)
        self._level_coder, self._rows = level_coder, rows
        return rows.stream.finish(), level_coder.values()

    def _continued_state(self, where: str) -> tuple[LevelCoder, RowCoder]:
        if self._level_coder is None or self._rows is None:  # DATA-11
            raise FormatError("the previous segment, which it continues, is missing", where=where)
        return self._level_coder, self._rows

    def _begin(self, head: Head, n_frames: int, coding: Stream) -> tuple[LevelCoder, RowCoder]:
        header = self.header
        pyramid = Pyramid(n_frames, 0, 0)
        level_coder = LevelCoder(header, self.skeleton, pyramid, head.moving, head.values(header))
        rows = RowCoder(header, self._classes, head.moving, coding.coder, NAME)
        rows.begin(0, pyramid.kind(0), n_frames, coding)
        return level_coder, rows
