"""What an encoder of ``posewave`` does for contacts: where points are held, and how well.

A decoder needs none of it. SPEC.md, "Held contacts", says what comes of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from warnings import warn

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.posewave.contact_plan import (
    FADE,
    FINE,
    FIRST,
    LEAD,
    N_FIELDS,
    N_FRAMES,
    USUAL_FADE,
    Contacts,
    Limb,
    X,
)
from mcz.codecs.posewave.contacts import COARSE_GRID, FINE_GRID, Coder, Place
from mcz.codecs.posewave.rows import Stream
from mcz.codecs.posewave.skeleton_plan import Plan
from mcz.errors import ContactWarning
from mcz.motion import Skeleton

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SLACK = 0.015  # of the tolerance that is left to the decoder's last round
SHARES = 0.0, 0.5, 1.0  # of how far a decoded point is off its source, that may stay
MILD_TURN = 0.02  # radians, of a correction
TRIALS = 8  # of shifts


@dataclass(frozen=True, slots=True)
class Piece:
    """Frames of a contact that are corrected together, of a segment or, first, of a clip.

    ``origin`` is the first frame of the whole contact, a frame of the clip. ``exact``: the place
    itself is that of the source, and holds to half the tolerance, for others rest upon it.
    """

    limb: int
    first: int
    n_frames: int
    origin: int
    exact: bool = False

    @property
    def stop(self) -> int:
        return self.first + self.n_frames


@dataclass(frozen=True, slots=True)
class Outcome:
    """How far the displacement of a piece is off, at most, in length units."""

    piece: Piece
    error: float


@dataclass(slots=True)
class Keeper:
    """What an encoder knows of contacts: the pieces of a clip, and where they are held.

    ``shifts`` are how far the place that is held is off the source's, by limb group and origin.
    """

    tolerance: float = 0.0
    pieces: Sequence[Piece] = ()
    first: int = 0  # frame of the clip that the segment begins with
    shifts: dict[tuple[int, int], Floats] = field(default_factory=dict)
    outcomes: list[Outcome] = field(default_factory=list)

    def encode(
        self, contacts: Contacts, plan: Plan, stream: Stream, source: Floats, values: Floats
    ) -> None:
        """Code the pieces in the segment and correct ``values`` as a decoder will."""
        own = self._within(len(values))
        # What another trial of these frames has left does not count.
        self.shifts = {key: x for key, x in self.shifts.items() if key[1] < self.first}
        self.outcomes = [done for done in self.outcomes if done.piece.first < self.first]
        coder = Coder(stream)
        for number in range(len(contacts.limbs)):
            pieces = [piece for piece in own if piece.limb == number]
            target = Place(contacts, plan, number, source)
            place = Place(contacts, plan, number, values)
            coder.count(len(pieces))
            before = 0
            for piece in pieces:
                leads = fades_of(contacts.limbs, piece, own)
                self._encode_piece(coder, target, place, piece, leads, before)
                before = piece.stop
        coder.close()
        for piece in own:
            target = Place(contacts, plan, piece.limb, source)
            place = Place(contacts, plan, piece.limb, values)
            off = place.within(piece.first, piece.n_frames)
            off -= target.within(piece.first, piece.n_frames) + self.shifts[_key(place, piece)]
            error = float(np.sqrt((off * off).sum(axis=1).max()))
            self.outcomes.append(Outcome(replace(piece, first=piece.first + self.first), error))

    def warn(self, skeleton: Skeleton, contacts: Contacts) -> None:
        """Say of which joints a piece is off by more than the tolerance."""
        missed: dict[int, list[Outcome]] = {}
        for outcome in self.outcomes:
            if not outcome.error <= self.tolerance:
                joint = int(contacts.limbs[outcome.piece.limb].joints[-1])
                missed.setdefault(joint, []).append(outcome)
        for joint, outcomes in missed.items():
            worst = max(outcomes, key=lambda outcome: outcome.error)
            first, last = worst.piece.first, worst.piece.stop - 1
            message = f"{skeleton.addresses()[joint]} does not keep its place in {len(outcomes)} "
            message += f"contacts; at most it is {worst.error:.3g} length units off, in frames "
            warn(f"{message}{first} to {last}", ContactWarning, stacklevel=2)

    def _within(self, n_frames: int) -> list[Piece]:
        found = []
        for piece in self.pieces:
            first = max(piece.first - self.first, 0)
            stop = min(piece.stop - self.first, n_frames)
            if first < stop:
                found.append(replace(piece, first=first, n_frames=stop - first))
        return found

    def _encode_piece(
        self,
        coder: Coder,
        target: Place,
        place: Place,
        piece: Piece,
        leads: tuple[int, int],
        before: int,
    ) -> None:
        """Bring ``place`` to ``target``; ``before``: the frame after the limb's last piece."""
        key = _key(place, piece)
        wanted = target.within(piece.first, piece.n_frames)
        around = place.around(piece.first, piece.n_frames)
        if piece.exact:
            self.shifts[key] = np.zeros(3)
        fine = key in self.shifts
        shift = self.shifts[key] if fine else find_shift(place, piece, wanted, self.tolerance)
        fields = np.zeros(N_FIELDS, np.int64)
        fields[FIRST], fields[N_FRAMES] = piece.first, piece.n_frames
        fields[LEAD], fields[FADE] = leads
        fields[FINE] = int(fine)
        unit = (FINE_GRID if fine else COARSE_GRID) * place.step
        fields[X:] = np.rint((wanted[0] + shift - around[1]) / unit)
        coder.contact(fields, before, len(place.values))
        start = place.anchor(fields, around[1])
        if not fine:
            self.shifts[key] = start - wanted[0]
        moves = np.zeros((piece.n_frames, 3), np.int64)
        goal = (wanted + self.shifts[key] - start) / place.step
        radius = ((0.5 if piece.exact else 1.0) - 2 * SLACK) * self.tolerance / place.step
        coder.moves(around / place.step, start / place.step, moves, goal, radius)
        place.fade(fields, place.correct(piece.first, start + moves * place.step))


def _key(place: Place, piece: Piece) -> tuple[int, int]:
    return int(place.limb.joints[-1]), piece.origin


def find_shift(place: Place, piece: Piece, wanted: Floats, tolerance: float) -> Floats:
    """How far off the source's places those should be that are held, (3,).

    Not at all, where the limb reaches them by small turns. A leg that is almost straight would
    have to bend a lot for a little; then as far off as the decoded point is in the mean, or half.
    """
    rows = place.values[piece.first : piece.stop]
    drift = (place.within(piece.first, piece.n_frames) - wanted).mean(axis=0)
    found: list[tuple[bool, float, Floats]] = []
    for share in SHARES:
        trial = Place(place.contacts, place.plan, piece.limb, rows.copy())
        shift, is_held = _reachable(trial, wanted, share * drift, SLACK * tolerance)
        turn = float(np.abs(trial.values - rows).max()) * place.plan.rule.radians
        if is_held and turn <= MILD_TURN:
            return shift
        found.append((not is_held, turn, shift))
    return min(found, key=lambda one: one[:2])[2]


def _reachable(trial: Place, wanted: Floats, shift: Floats, enough: float) -> tuple[Floats, bool]:
    """A shift near ``shift`` with which the limb reaches the place in every frame, if it can."""
    rows = trial.values.copy()
    for _ in range(TRIALS):
        trial.values[:] = rows
        trial.correct(0, wanted + shift)
        off = trial.within(0, len(rows)) - (wanted + shift)
        far = (off * off).sum(axis=1)
        worst = int(far.argmax())
        if far[worst] <= enough * enough:
            return shift, True
        shift = shift + 1.1 * off[worst]
    return shift, False


def fades_of(limbs: Sequence[Limb], piece: Piece, own: Sequence[Piece]) -> tuple[int, int]:
    """Of a piece, how many frames lead in and out, so that none of another piece is harmed."""
    mine = set(limbs[piece.limb].columns.tolist())
    lead = fade = USUAL_FADE
    for other in own:
        if other.limb > piece.limb or mine.isdisjoint(limbs[other.limb].columns.tolist()):
            continue
        if other.stop <= piece.first:
            lead = min(lead, piece.first - other.stop)
        elif other.first >= piece.stop:
            fade = min(fade, other.first - piece.stop)
    return lead, fade
