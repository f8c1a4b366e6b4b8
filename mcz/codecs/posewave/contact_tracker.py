"""Contact state of a ``posewave`` encoder: target positions, and their errors.

A decoder needs none of it. SPEC.md, "Held contacts", says what comes of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from warnings import warn

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.posewave.contact_plan import START_UNITS, Contacts, HeldPoints
from mcz.codecs.posewave.contacts import Coder, Corrections
from mcz.codecs.posewave.row_coder import Stream
from mcz.codecs.posewave.skeleton_plan import Plan
from mcz.errors import ContactWarning, MotionError
from mcz.model.motion import Skeleton

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SLACK = 0.02  # of the tolerance that is left to the decoder's last round
TRIALS = 10  # of a segment, with less room for displacements where a point was off
LESS_ROOM = 0.7
COUNTERED = 0.5  # of what a point is off


@dataclass(frozen=True, slots=True)
class Piece:
    """Frames of a contact: of a segment or, before, of a clip.

    ``point`` is its number in the header, ``origin`` the first frame of the whole contact, a frame
    of the clip. ``stance``: pieces of the same number are contacts of a foot that do not all end
    before another begins; all are shifted alike, so that parts of a foot fit each other.
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
        errors: Floats = np.sqrt((self.off * self.off).sum(axis=1))
        return errors


@dataclass(slots=True)
class ContactTracker:
    """Contacts of a clip as an encoder tracks them: pieces, and their target positions.

    ``shifts`` are how far the place that is held is off the source's, by stance, with the frame in
    which that was found.
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
        held: HeldPoints,
        stream: Stream,
        source: Floats,
        values: Floats,
    ) -> None:
        """Code the pieces in the segment and correct ``values`` as a decoder will."""
        # What another trial of these frames has left does not count.
        self.shifts = {key: x for key, x in self.shifts.items() if x[0] < self.first}
        self.outcomes = [done for done in self.outcomes if done.piece.first < self.first]
        pieces = self._within(len(values))
        corrections = Corrections(contacts, plan, held, values.copy())
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
                radii[:, rows][:, missed] *= LESS_ROOM  # of others, too, which may be fastened
                aims[piece.point, rows][missed] -= COUNTERED * outcome.off[missed]
        coder.close()
        values[:] = corrections.values
        for outcome in outcomes:
            piece = outcome.piece
            clip_piece = replace(piece, first=piece.first + self.first)
            self.outcomes.append(replace(outcome, piece=clip_piece))

    def warn(self, skeleton: Skeleton, contacts: Contacts) -> None:
        """Say of which joints displacements are off by more than the tolerance."""
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

    def _within(self, n_frames: int) -> list[Piece]:
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
            off = [
                corrections.places[p.point, p.first : p.stop] - targets[p.point, p.first : p.stop]
                for p in own
            ]
            shift = np.concatenate(off).mean(axis=0)
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

        ``aims`` are how far beside them an encoder aims, to counter what others do.
        """
        coder = Coder(stream)
        wanted = np.zeros(targets.shape)
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
            wanted[point, rows] = (
                goal + aims[point, rows] - (here + corrections.starts[point, first] * unit)
            )
        for point in range(len(targets)):
            fault = corrections.code(coder, point, wanted[point], radii[point])
            if fault >= 0:
                raise MotionError(
                    f"contacts: from frame {self.first + fault} on a point moves or is off by more "
                    "than 2^30 steps of its grid; give a greater contact_tolerance"
                )
        return coder

    def _outcomes(
        self, corrections: Corrections, pieces: Sequence[Piece], targets: Floats
    ) -> list[Outcome]:
        """Error of each piece against the position in which its contact began."""
        places = corrections.positions_of(corrections.values)
        outcomes = []
        for piece in pieces:
            rows = slice(piece.first, piece.stop)
            off = places[piece.point, rows] - targets[piece.point, rows]
            origin = piece.point, piece.origin
            if piece.first + self.first == piece.origin:
                self.origins[origin] = off[0].copy()
            off -= self.origins[origin]
            outcomes.append(Outcome(piece, off))
        return outcomes
