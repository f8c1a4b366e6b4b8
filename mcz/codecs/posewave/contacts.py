"""Contacts: frames in which a point keeps its displacement of the source.

SPEC.md, "Held contacts", is normative. They follow the finest details. A stream codes the
displacements of points on a fine grid, and a decoder changes the pose as little as possible to meet
them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from warnings import warn

import numpy as np

from mcz.codecs.coding import mixing
from mcz.codecs.coding.mixing import rate_table, squash_table, stretch_table
from mcz.codecs.posewave import contact_kernels, displacement_kernels
from mcz.codecs.posewave.contact_plan import START_UNITS, Contacts, HeldPoints
from mcz.codecs.posewave.displacement_kernels import Leader, Track
from mcz.codecs.posewave.row_coder import Stream
from mcz.codecs.posewave.skeleton_plan import Plan
from mcz.errors import ContactWarning, FormatError, MotionError
from mcz.model.motion import Skeleton
from mcz.model.types import Floats

USUAL = 0.25, -0.125, 0.0625, 0.0, 0.6875, 0.125, -0.25, 0.75, 0.1875
# By class of a mean magnitude: probability that one is not 0, and that it is greater still.
SOME = (
    *(3840, 7424, 11008, 15616, 21760, 29184, 36864, 44544),
    *(50688, 55296, 58624, 60928, 62464, 63488, 64256, 64512),
)
MORE_PROBABILITY = (
    *(2048, 4096, 5888, 8960, 13056, 18688, 25856, 33536),
    *(41216, 47872, 52992, 56832, 59648, 61440, 62720, 63744),
)
ROOM = 64  # bytes of a frame
CERTAIN = 8  # initial count of observations
WEIGHT = 26214  # of each opinion, in 2^-16


class Coder:
    """Codes contacts after the rows of a stream, with contexts of its own."""

    def __init__(self, stream: Stream) -> None:
        self.stream = stream
        models = np.tile(np.array([32768, 0], np.int64), displacement_kernels.N_CONTEXTS)
        likely = np.repeat(
            np.array([MORE_PROBABILITY], np.int64).T, displacement_kernels.N_BITS, axis=1
        )
        likely[:, 0] = SOME
        for first in (
            displacement_kernels.C_FAST,
            displacement_kernels.C_SLOW,
            displacement_kernels.C_OTHER,
        ):
            own = slice(2 * first, 2 * (first + likely.size))
            models[own] = np.stack([likely.ravel(), np.full(likely.size, CERTAIN)], axis=1).ravel()
        self.state = np.zeros(mixing.MODELS, np.int64)
        self.state[mixing.SQUASH : mixing.SQUASH + 4096] = squash_table()
        self.state[mixing.STRETCH : mixing.STRETCH + 4096] = stretch_table()
        self.state[mixing.RATES : mixing.RATES + len(rate_table())] = rate_table()
        self.state[mixing.WEIGHTS : mixing.MODELS] = WEIGHT
        self.state = np.concatenate([self.state, models])
        self.state[: mixing.SQUASH] = stream.coder[: mixing.SQUASH]
        shape = displacement_kernels.N_FEATURES
        self.learner = displacement_kernels.Learner(
            squares=np.zeros((3, shape, shape)),
            products=np.zeros((3, shape)),
            weights=np.tile(np.array(USUAL), (3, 1)),
            usual=np.array(USUAL),
            sizes=np.full((3, 2), 2.0),
            features=np.zeros((3, shape)),
            means=np.zeros(3),
            scratch=np.zeros((shape + 2, shape)),
        )

    def point(
        self,
        places: Floats,
        step: float,
        track: Track,
        leader: Leader,
        target: Floats,
        radii: Floats,
    ) -> int:
        """Code the contacts of a point in place; -1, or the frame of one that is impossible."""
        args = self.learner, places, step, track, leader, target, radii
        return int(displacement_kernels.code_point(self.state, self.stream.data, *args))

    def close(self) -> None:
        """Code whether the stream goes on or ends."""
        self.stream.coder[: mixing.SQUASH] = self.state[: mixing.SQUASH]


class Corrections:
    """Decoded point positions, and their corrections by contacts.

    By point and frame: ``places`` (..., 3), in length units, ``stands``, ``starts`` (..., 3) and
    ``moves`` (..., 3), as in ``displacement_kernels``, ``shifts`` (..., 3) and ``active`` as in
    ``contact_kernels``.
    """

    def __init__(self, contacts: Contacts, plan: Plan, points: HeldPoints, values: Floats) -> None:
        self.contacts, self.plan, self.held, self.values = contacts, plan, points, values
        self.lanes = contact_kernels.lanes_of(plan, 1)
        self.places = self.positions_of(values)
        self.stands = np.zeros(self.places.shape[:2], np.int64)
        self.starts = np.zeros(self.places.shape, np.int64)
        self.moves = np.zeros(self.places.shape, np.int64)
        self.shifts = np.zeros(self.places.shape)
        self.active = np.zeros_like(self.stands)

    def positions_of(self, values: Floats) -> Floats:
        """Positions of the points in frames ``values``, (n_points, n_frames, 3)."""
        positions = np.empty((len(self.contacts.joints), len(values), 3))
        contact_kernels.place_points(self.plan, self.held, self.lanes, values, positions)
        return positions

    def track(self, point: int) -> Track:
        return Track(self.stands[point], self.starts[point], self.moves[point])

    def code(self, coder: Coder, point: int, target: Floats, radii: Floats) -> int:
        """Code one point, as ``Coder.point``."""
        contacts, places = self.contacts, self.places[point]
        step, followed = contacts.steps[point], contacts.follows[point] - 1
        leader = Leader(np.zeros(len(places), np.int64), self.shifts[0])
        if followed >= 0:
            leader = Leader(self.stands[followed], self.shifts[followed])
        padded = np.pad(places, ((1, 1), (0, 0)), "edge")
        fault = coder.point(padded, step, self.track(point), leader, target, radii)
        goal = self.shifts[point], self.active[point]
        goal[0][:], goal[1][:] = 0.0, 0
        contact_kernels.set_shifts(places, self.track(point), step, contacts.ramp, *goal)
        return fault

    def correct(self) -> None:
        """Move the points to their places by changing the values."""
        args = self.held, self.lanes, self.values, self.active, self.shifts, self.contacts.rounds
        contact_kernels.correct_poses(self.plan, *args)


def room_of_contacts(contacts: Contacts | None, n_frames: int) -> int:
    """Buffer size in bytes for the contacts of a segment."""
    return ROOM * (n_frames + 1) * len(contacts.joints) + 64 if contacts else 0


def decode_contacts(
    contacts: Contacts, plan: Plan, points: HeldPoints, stream: Stream, values: Floats, where: str
) -> None:
    """Correct ``values`` (n_frames, n_channels) in place."""
    corrections, coder = Corrections(contacts, plan, points, values), Coder(stream)
    nothing = np.zeros((1, 3)), np.zeros(1)
    for point in range(len(contacts.joints)):
        fault = corrections.code(coder, point, *nothing)
        if fault >= 0:
            raise FormatError(
                f"a contact of point {point} at or after frame {fault} is out of range", where=where
            )
    coder.close()
    if not stream.is_whole:  # HOLD-07
        raise FormatError(f"{where} should not have {len(stream.data)} bytes")
    corrections.correct()


SLACK = 0.02  # of the tolerance, reserved for the decoder's last round
TRIALS = 10  # of a segment, with less room for displacements after a miss
LESS_ROOM = 0.7
COUNTERED = 0.5  # of the error of a point


@dataclass(frozen=True, slots=True)
class Piece:
    """Frames of a contact, in a segment or, before the split, in a clip.

    ``point`` is its number in the header, ``origin`` the first frame of the whole contact, a frame
    of the clip. ``stance``: pieces of the same number are contacts of a foot that overlap in time;
    all are shifted alike, so that parts of a foot fit each other.
    """

    point: int
    first: int
    n_frames: int
    origin: int
    stance: int

    @property
    def stop(self) -> int:
        return self.first + self.n_frames


@dataclass(frozen=True, slots=True)
class Outcome:
    """Displacement error of a piece: ``off``, (n_frames, 3), in length units."""

    piece: Piece
    off: Floats

    @property
    def errors(self) -> Floats:
        result: Floats = np.sqrt((self.off * self.off).sum(axis=1))
        return result


@dataclass(slots=True)
class ContactTracker:
    """Contacts of a clip as an encoder tracks them: pieces, and their target positions.

    ``shifts`` are the distances of the held place from the source's, by stance, with the frame in
    which they were measured.
    """

    tolerance: float = 0.0
    pieces: Sequence[Piece] = ()
    first: int = 0  # frame of the clip that the segment begins with
    shifts: dict[int, tuple[int, Floats]] = field(default_factory=dict)
    origins: dict[tuple[int, int], Floats] = field(default_factory=dict)
    outcomes: list[Outcome] = field(default_factory=list)

    def encode(
        self,
        contacts: Contacts,
        plan: Plan,
        points: HeldPoints,
        stream: Stream,
        source: Floats,
        values: Floats,
    ) -> None:
        """Code the pieces in the segment and correct ``values`` as a decoder will."""
        # Results of another trial of these frames do not count.
        self.shifts = {key: x for key, x in self.shifts.items() if x[0] < self.first}
        self.outcomes = [done for done in self.outcomes if done.piece.first < self.first]
        pieces = self._pieces_within(len(values))
        corrections = Corrections(contacts, plan, points, values.copy())
        targets = corrections.positions_of(source)
        self._choose_shifts(corrections, pieces, targets)
        radii = np.full(targets.shape[:2], (1.0 - 2 * SLACK) * self.tolerance)
        aims = np.zeros(targets.shape)
        for _ in range(TRIALS):
            corrections.values[:] = values
            coder = self._code(corrections, stream, pieces, targets, aims, radii)
            corrections.correct()
            outcomes = self._outcomes(corrections, pieces, targets)
            worst = max((float(o.errors.max()) for o in outcomes), default=0.0)
            if worst <= self.tolerance:
                break
            for outcome in outcomes:
                piece, missed = outcome.piece, outcome.errors > self.tolerance
                rows = slice(piece.first, piece.stop)
                radii[:, rows][:, missed] *= LESS_ROOM  # of others too, which may be fastened
                aims[piece.point, rows][missed] -= COUNTERED * outcome.off[missed]
        coder.close()
        values[:] = corrections.values
        for outcome in outcomes:
            piece = outcome.piece
            clip_piece = replace(piece, first=piece.first + self.first)
            self.outcomes.append(replace(outcome, piece=clip_piece))

    def warn(self, skeleton: Skeleton, contacts: Contacts) -> None:
        """Warn of joints whose displacements are off by more than the tolerance."""
        missed: dict[int, list[Outcome]] = {}
        for outcome in self.outcomes:
            if not outcome.errors.max() <= self.tolerance:
                missed.setdefault(contacts.joints[outcome.piece.point], []).append(outcome)
        for joint, outcomes in missed.items():
            worst = max(outcomes, key=lambda outcome: float(outcome.errors.max()))
            first, last = worst.piece.first, worst.piece.stop - 1
            message = f"{skeleton.addresses()[joint]} does not keep its place in {len(outcomes)} "
            message += (
                f"contacts; it is up to {worst.errors.max():.3g} length units off, in frames "
            )
            warn(f"{message}{first} to {last}", ContactWarning, stacklevel=2)

    def _pieces_within(self, n_frames: int) -> list[Piece]:
        clipped = []
        for piece in self.pieces:
            first = max(piece.first - self.first, 0)
            stop = min(piece.stop - self.first, n_frames)
            if first < stop:
                clipped.append(replace(piece, first=first, n_frames=stop - first))
        return clipped

    def _choose_shifts(
        self, corrections: Corrections, pieces: Sequence[Piece], targets: Floats
    ) -> None:
        """Set the shift of each new stance to the mean error of its decoded points."""
        for stance in sorted({piece.stance for piece in pieces} - set(self.shifts)):
            own = [piece for piece in pieces if piece.stance == stance]
            first = min(piece.first for piece in own)
            distances = [
                corrections.places[p.point, p.first : p.stop] - targets[p.point, p.first : p.stop]
                for p in own
            ]
            shift = np.concatenate(distances).mean(axis=0)
            self.shifts[stance] = self.first + first, shift

    def _code(
        self,
        corrections: Corrections,
        stream: Stream,
        pieces: Sequence[Piece],
        targets: Floats,
        aims: Floats,
        radii: Floats,
    ) -> Coder:
        """Code the pieces, their points as near to ``targets`` as ``radii`` allow.

        ``aims`` are offsets of an encoder's targets, to counter the effect of other points.
        """
        coder = Coder(stream)
        shifts = np.zeros(targets.shape)
        for array in (corrections.stands, corrections.starts, corrections.moves):
            array[:] = 0
        for piece in pieces:
            point, first, rows = piece.point, piece.first, slice(piece.first, piece.stop)
            unit = corrections.contacts.steps[point] / START_UNITS
            corrections.stands[point, rows] = 2
            corrections.stands[point, first] = 1
            goal = targets[point, rows] + self.shifts[piece.stance][1]
            here = corrections.places[point, first]
            corrections.starts[point, first] = np.rint((goal[0] - here) / unit)
            shifts[point, rows] = (
                goal + aims[point, rows] - (here + corrections.starts[point, first] * unit)
            )
        for point in range(len(targets)):
            fault = corrections.code(coder, point, shifts[point], radii[point])
            if fault >= 0:
                raise MotionError(
                    f"contacts: from frame {self.first + fault} on a point moves or is off by "
                    "more than 2^30 steps of its grid; use a larger contact_tolerance"
                )
        return coder

    def _outcomes(
        self, corrections: Corrections, pieces: Sequence[Piece], targets: Floats
    ) -> list[Outcome]:
        """Error of each piece relative to the position at which its contact began."""
        places = corrections.positions_of(corrections.values)
        outcomes = []
        for piece in pieces:
            rows = slice(piece.first, piece.stop)
            shifts = places[piece.point, rows] - targets[piece.point, rows]
            origin = piece.point, piece.origin
            if piece.first + self.first == piece.origin:
                self.origins[origin] = shifts[0].copy()
            shifts -= self.origins[origin]
            outcomes.append(Outcome(piece, shifts))
        return outcomes
