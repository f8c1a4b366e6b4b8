"""Contacts: frames in which a point of a limb keeps the displacement that it has in the source.

SPEC.md, "Held contacts", is normative. They come after the finest details. A stream tells how a
point moves, on a fine grid, and a decoder turns the channels above it until it is there.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.posewave.contact_plan import (
    FADE,
    FINE,
    FIRST,
    LEAD,
    N_FIELDS,
    N_FRAMES,
    Contacts,
    X,
)
from mcz.codecs.posewave.rows import Stream
from mcz.codecs.posewave.skeleton_plan import Plan
from mcz.coding.logistic import rate_table, squash_table, stretch_table
from mcz.errors import FormatError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

USUAL = 0.4375, -0.3125, 0.15625, 0.4375, 0.3125, -0.0625, -0.3125
# Of a mean magnitude, class by class: how likely one is not 0, and how likely it is greater yet.
SOME = (
    *(3840, 7424, 11008, 15616, 21760, 29184, 36864, 44544),
    *(50688, 55296, 58624, 60928, 62464, 63488, 64256, 64512),
)
MORE = (
    *(2048, 4096, 5888, 8960, 13056, 18688, 25856, 33536),
    *(41216, 47872, 52992, 56832, 59648, 61440, 62720, 63744),
)
ROOM = 64  # bytes of a frame
CERTAIN = 8  # as if each had been seen so often
COARSE_GRID, FINE_GRID = 4.0, 0.0625  # of anchors, in steps


@cache
def _kernels() -> Any:
    from mcz.codecs.posewave import contact_kernels

    return contact_kernels


@cache
def _coding() -> Any:
    from mcz.codecs.posewave import displacement_kernels

    return displacement_kernels


@cache
def _mixing() -> Any:
    from mcz.coding import mixing

    return mixing


@cache
def start_models() -> Ints:
    """Probabilities and counts of a coder's contexts before the first contact, by turns."""
    coding = _coding()
    models = np.tile(np.array([32768, 0], np.int64), (coding.N_CONTEXTS, 1))
    sizes = models[coding.C_FAST : coding.C_SIGN].reshape(-1, coding.N_SIZES, coding.N_BITS, 2)
    sizes[:, :, 0, 0], sizes[:, :, 1:, 0] = SOME, np.array(MORE)[:, None]
    sizes[:, :, :, 1] = CERTAIN
    return models.reshape(-1)


class Coder:
    """Codes contacts in a stream that rows were coded in before, with contexts of its own."""

    def __init__(self, stream: Stream) -> None:
        mixing, coding = _mixing(), _coding()
        self.stream, self.state = stream, np.zeros(mixing.MODELS, np.int64)
        models = start_models()
        self.state[mixing.SQUASH : mixing.SQUASH + 4096] = squash_table()
        self.state[mixing.STRETCH : mixing.STRETCH + 4096] = stretch_table()
        self.state[mixing.RATES : mixing.RATES + len(rate_table())] = rate_table()
        self.state[mixing.WEIGHTS : mixing.MODELS] = 26214
        self.state = np.concatenate([self.state, models])
        self.state[: mixing.SQUASH] = stream.coder[: mixing.SQUASH]
        shape = coding.N_FEATURES
        self.learner = coding.Learner(
            squares=np.zeros((3, shape, shape)),
            products=np.zeros((3, shape)),
            weights=np.tile(np.array(USUAL), (3, 1)),
            usual=np.array(USUAL),
            sizes=np.full((3, 2), 2.0),
            scratch=np.zeros((9, shape)),
        )

    def count(self, count: int) -> int:
        return int(_coding().code_count(self.state, self.stream.data, count))

    def contact(self, fields: Ints, before: int, n_frames: int) -> bool:
        return not _coding().code_contact(self.state, self.stream.data, fields, before, n_frames)

    def moves(
        self, places: Floats, anchor: Floats, moves: Ints, wanted: Floats, radius: float
    ) -> bool:
        """Code ``moves`` in place."""
        args = self.learner, places, anchor, moves, wanted, radius
        return not _coding().code_displacements(self.state, self.stream.data, *args)

    def close(self) -> None:
        """Let the stream go on, or end."""
        self.stream.coder[: _mixing().SQUASH] = self.state[: _mixing().SQUASH]


class Place:
    """The point of a limb in frames that are being corrected."""

    def __init__(self, contacts: Contacts, plan: Plan, limb: int, values: Floats) -> None:
        self.contacts, self.plan, self.values = contacts, plan, values
        self.limb, self.step = contacts.limbs[limb], contacts.steps[limb]

    def around(self, first: int, n_frames: int) -> Floats:
        """Where it is in these frames, in that before and in that after, (n_frames + 2, 3)."""
        start, stop = max(first - 1, 0), min(first + n_frames + 1, len(self.values))
        found = self.within(start, stop - start)
        missing = start - (first - 1), first + n_frames + 1 - stop
        return np.pad(found, (missing, (0, 0)), mode="edge")

    def within(self, first: int, n_frames: int) -> Floats:
        """Where it is in these frames alone, (n_frames, 3)."""
        found = np.empty((n_frames, 3))
        _kernels().place(self.plan, self.limb, self.values, first, found)
        return found

    def correct(self, first: int, places: Floats) -> Floats:
        """Bring it to ``places``; the corrections of the first frame and the last."""
        fades = np.zeros((2, len(self.limb.columns)))
        rounds = self.contacts.rounds
        _kernels().correct(self.plan, self.limb, self.values, first, places, rounds, fades)
        return fades

    def fade(self, fields: Ints, fades: Floats) -> None:
        """Lead in to a contact and out of it."""
        first, stop = fields[FIRST], fields[FIRST] + fields[N_FRAMES]
        columns = self.limb.columns
        for n in range(1, int(fields[LEAD]) + 1):
            if first - n >= 0:
                self.values[first - n, columns] += fades[0] * (1.0 - n / (fields[LEAD] + 1))
        for n in range(1, int(fields[FADE]) + 1):
            if stop - 1 + n < len(self.values):
                share = 1.0 - n / (fields[FADE] + 1)
                self.values[stop - 1 + n, columns] += fades[1] * share

    def anchor(self, fields: Ints, before: Floats) -> Floats:
        """The place of the first frame of a contact, (3,)."""
        unit = (FINE_GRID if fields[FINE] else COARSE_GRID) * self.step
        found: Floats = before + fields[X:] * unit
        return found


def room_of(contacts: Contacts | None, n_frames: int) -> int:
    """As many bytes as the contacts of a segment may take."""
    return ROOM * (n_frames + 1) * len(contacts.limbs) + 64 if contacts else 0


def decode_contacts(
    contacts: Contacts, plan: Plan, stream: Stream, values: Floats, where: str
) -> None:
    """Correct ``values`` (n_frames, n_channels) in place."""
    coder = Coder(stream)
    for number in range(len(contacts.limbs)):
        place, before = Place(contacts, plan, number, values), 0
        count = coder.count(0)
        if not 0 <= count <= len(values):
            raise FormatError(f"{where}: {count} contacts of a limb")
        for _ in range(count):
            fields = np.zeros(N_FIELDS, np.int64)
            if not coder.contact(fields, before, len(values)):
                raise FormatError(f"{where}: a contact of limb {number} is out of range")
            first, n_frames = int(fields[FIRST]), int(fields[N_FRAMES])
            around = place.around(first, n_frames)
            start = place.anchor(fields, around[1])
            moves = np.zeros((n_frames, 3), np.int64)
            step = place.step
            if not coder.moves(around / step, start / step, moves, np.zeros((1, 3)), 0.0):
                raise FormatError(f"{where}: a displacement of limb {number} is out of range")
            place.fade(fields, place.correct(first, start + moves * step))
            before = first + n_frames
    coder.close()
