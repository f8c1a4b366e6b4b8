"""Clips of ``online``, to order: units, steps and coefficients that no encoder chooses.

The bits are written here as SPEC.md, "Codec 21: online", reads them, so that whatever can be said
can be written, and what must not be, too. All that is coded is integers, written out or counted, so
the bytes do not depend on a machine's arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mcz.codecs.basis_models import Basis
from mcz.codecs.coding import mixing
from mcz.codecs.coding.residuals import N_CONTEXTS, N_MIXERS, code_residual
from mcz.codecs.coding.streams import start_states
from mcz.codecs.contract import Segment
from mcz.codecs.online.units import Unit, build_units
from tools.vectors.build import spatial_clips
from tools.vectors.build.spatial_clips import FRAME, Ints, waves

ONLINE = "online"
STR, LTR, INTRA = 0, 1, 2  # what the first frame of a unit is predicted from
MIXED, GOLOMB = 0, 1  # coders
AS_IS, REORDERED = 0, 1  # orders
ONE = 256  # the code of a ratio of 1
MOST = 2**40  # of a coefficient
FIRSTS, OTHERS = 1, 2  # residuals behind those of lengths
SAME, LONGER, N_FLAGS = 4, 5, 15  # contexts behind the first of FLAGS
UNEXAMINED = 2**16  # bytes, more than any crafted unit has


def usual(number: int, kind: int) -> int:
    """Half the step in LTRs, and one that changes now and then in others."""
    return ONE - 8 if kind else ONE + (number // 7) % 3


@dataclass(frozen=True, slots=True)
class Plan:
    """Header, units and coefficients of a signal.

    ``units`` are those of each segment: "I5 L5 S2" has five frames, the first an intra coded LTR,
    five more, the first an LTR, and two STRs. ``fill`` gives all coefficients, (frames, rows), as
    ``fill(0, frames, rows)``, ``steps`` the code of a frame's step by its number and its kind.
    Frames in ``said`` are `here` although all of their coefficients are 0. The other fields are
    those of a Plan of ``spatial``.
    """

    units: tuple[str, ...] = ("I10 L10",)
    n_channels: int = 3
    coder: int = MIXED
    order: int = AS_IS
    apart: bool = False
    weights: bytes | None = None
    bases: tuple[Basis, ...] = ()
    known: str = ""
    embedded: bool = False
    step: float = 1.0
    steps: Callable[[int, int], int] = usual
    fill: Callable[[int, int, int], Ints] = waves
    said: tuple[int, ...] = ()
    preset: int = 0

    @property
    def parts(self) -> list[list[tuple[int, int]]]:
        """Units of each segment, (kind, frames)."""
        texts = [segment.split() for segment in self.units]
        return [[("SLI".index(text[0]), int(text[1:])) for text in own] for own in texts]

    @property
    def segments(self) -> tuple[int, ...]:
        """The frames of each."""
        return tuple(sum(n for _, n in own) for own in self.parts)

    @property
    def kinds(self) -> list[int]:
        """Kind of each frame."""
        units = [unit for own in self.parts for unit in own]
        return [kind if i == 0 else STR for kind, n in units for i in range(n)]

    @property
    def space(self) -> spatial_clips.Plan:
        """The same matrices, of lsdt-frame."""
        names = "n_channels", "segments", "apart", "weights", "bases", "known", "embedded", "step"
        return spatial_clips.Plan(FRAME, **{name: getattr(self, name) for name in names})

    @property
    def table(self) -> Ints:
        """The coefficients of all frames."""
        return self.fill(0, sum(self.segments), int(self.space.starts[-1]))


def header(plan: Plan, **parts: bytes) -> bytes:
    """The header; ``parts`` are said in place of what the plan says."""
    own = {"order": bytes((plan.order,)), "coder": bytes((plan.coder,))} | parts
    last = own.pop("order") + own.pop("coder")
    return spatial_clips.header(plan.space, **own, coder=last)


# Streams


def _adaptive(state: Ints, data: Any, bit: int, context: int) -> int:
    return mixing.code_adaptive(state, data, bit, context)


def _number(state: Ints, data: Any, value: int, n: int) -> int:
    return mixing.code_bits(state, data, value, n)


def _residual(
    state: Ints, data: Any, value: int, scales: tuple[int, int], near: int, sides: Any, which: int
) -> int:
    places = which * N_CONTEXTS, which * N_MIXERS
    return code_residual(state, data, value, scales, near, sides, places)


class Coding:
    """State of a coder for a signal. Nothing is checked, so that faults can be written too.

    What may not be ends with the fault, if it is the last that a frame has.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.starts: list[int] = plan.space.starts.tolist()
        self.flags = 0 if plan.coder == GOLOMB else 3 * N_CONTEXTS  # the first of FLAGS
        self.step = self.ltr_step = self.present = 0
        self.data = np.zeros(0, np.uint8)
        self.state = start_states("online")[2 * plan.coder].copy()
        self._forget()

    def _forget(self) -> None:
        n_rows = self.starts[-1]
        self.lengths = [0] * (len(self.starts) - 1)
        self.tracks = [[0, 0, 0, 0] for _ in range(n_rows)]  # last, before, fast, slow
        self.sizes = [0] * n_rows

    def unit(self, kind: int, frames: Sequence[tuple[Sequence[int], int, bool]]) -> bytes:
        """The data of a unit of frames, each its coefficients, its step, whether it is `here`."""
        if kind != STR:
            table = 2 * self.plan.coder + (kind == LTR)
            self.state = start_states("online")[table].copy()
            self._forget()
        self.data = np.zeros(UNEXAMINED, np.uint8)
        mixing.start(self.state, self.data, 1)
        for row, step, here in frames:
            self.frame(kind, row, step, here=here)
            kind = STR
        return self.data[: mixing.finish(self.state, self.data)].tobytes()

    def adaptive(self, bit: bool, context: int) -> bool:
        return bool(_adaptive(self.state, self.data, int(bit), context))

    def number(self, value: int, n: int) -> None:
        _number(self.state, self.data, value % 2**n, n)

    def frame(self, kind: int, row: Sequence[int], step: int, *, here: bool) -> None:
        self.adaptive(here, self.flags + (kind + 1 if kind else self.present))
        self.present = 0 if kind else int(here)
        before = (self.step, self.ltr_step, ONE)[kind]
        self.step = step if here else before
        if here:
            self.code_step(kind, step, before)
            self.coefficients(kind, row)
        if kind:
            self.ltr_step = self.step

    def code_step(self, kind: int, step: int, before: int) -> None:
        if kind == INTRA:
            self.number(step, 9)
        elif not self.adaptive(step == before, self.flags + SAME + (kind > 0)):
            change = abs(step - before)
            self.number(int(step < before), 1)
            n = 1
            while n < 10 and self.adaptive(change.bit_length() > n, self.flags + LONGER + n):
                n += 1
            self.number(change, n - 1)

    def coefficients(self, kind: int, row: Sequence[int]) -> None:
        code = self._golomb if self.plan.coder == GOLOMB else self._code_mixed
        code(kind, list(row))

    def length_of(self, row: Sequence[int]) -> int:
        """Number of coded coefficients of a matrix row: up to the last that is not 0."""
        return max((i + 1 for i, c in enumerate(row) if c), default=0)

    def _code_mixed(self, kind: int, row: list[int]) -> None:
        for m, start in enumerate(self.starts[:-1]):
            length = self.length_of(row[start : self.starts[m + 1]])
            scales = 16 * self.lengths[m], 16 * self.lengths[max(m - 1, 0)]
            self.residual(length, scales, 0, (0, 0, 0), 0)
            self.lengths[m] = length
            above = higher = 0
            for r in range(start, start + length):
                before = self.starts[m - 1] + r - start if m else start
                side = row[before] if before < start else 0
                self._one(kind, row[r], start + length - r, self.tracks[r], side, above, higher)
                above, higher = row[r], above
        for c, track in zip(row, self.tracks, strict=False):
            if kind == STR:
                last, _, fast, slow = track
                change = 16 * abs(c) - fast, 16 * abs(c) - slow
                track[:] = c, last, fast + (change[0] >> 1), slow + (change[1] >> 4)

    def _one(
        self, kind: int, c: int, left: int, track: Sequence[int], side: int, above: int, higher: int
    ) -> None:
        """A coefficient, of rows of which ``left`` are to be coded."""
        if kind:
            scales = 16 * abs(above), 16 * abs(side)
            self.residual(c, scales, 0, (_side(above), _side(side), 0), FIRSTS)
            return
        last, before, fast, slow = track
        scales = (3 * fast + 16 * abs(side)) >> 2, (slow + 8 * abs(above) + 4 * abs(higher)) >> 1
        sides = _side(last), _side(side), _side(before)
        self.residual(c, scales, min(left.bit_length(), 7), sides, OTHERS)

    def residual(
        self,
        value: int,
        scales: tuple[int, int],
        near: int,
        sides: tuple[int, int, int],
        which: int,
    ) -> None:
        _residual(self.state, self.data, value, scales, near, sides, which)

    def _golomb(self, kind: int, row: list[int]) -> None:
        for start, stop in zip(self.starts, self.starts[1:], strict=False):
            one = two = 0
            for r in range(start, stop):
                beside = self.sizes[r + 1] if r + 1 < stop else 0
                self.size(kind, abs(row[r]), 2 * one + two + 2 * self.sizes[r] + beside)
                one, two = abs(row[r]), one
        for c in row:
            if c:
                self.number(int(c < 0), 1)
        self.sizes = [0 if kind else abs(c) for c in row]

    def size(self, kind: int, size: int, activity: int) -> None:
        rice = max(0, activity.bit_length() - 3)
        klass = 7 + min(rice, 8) if rice else activity
        first = N_FLAGS + 4 * (16 * (kind > 0) + klass)
        prefix, n = size >> rice, 0
        while self.adaptive(prefix > n, first + min(n, 3)):
            n += 1
            if n == 16:
                self.escape(prefix - 15)
                break
        self.number(size, rice)

    def escape(self, rest: int) -> None:
        """Write the part of a prefix beyond 15, at least 1."""
        self.number(rest.bit_length(), 6)
        self.number(rest, rest.bit_length() - 1)


def _side(value: int) -> int:
    return 0 if value == 0 else 1 if value > 0 else 2


def units_of(plan: Plan, coding: type[Coding] = Coding) -> list[list[Unit]]:
    """The units of each segment."""
    coder, table = coding(plan), plan.table
    here = [bool(row.any()) or f in plan.said for f, row in enumerate(table)]
    made: list[list[Unit]] = []
    at = ltr = 0
    for own in plan.parts:
        made.append([])
        for kind, n in own:
            numbers = range(at, at + n)
            kinds = [kind, *[STR] * (n - 1)]
            steps = [plan.steps(f, k) for f, k in zip(numbers, kinds, strict=True)]
            rows = table[at : at + n].tolist()
            data = coder.unit(kind, list(zip(rows, steps, here[at : at + n], strict=True)))
            made[-1].append(Unit(kind, n, data, at - ltr))
            ltr = at if kind else ltr
            at += n
    return made


def segments_of(plan: Plan, coding: type[Coding] = Coding) -> list[Segment]:
    rows = zip(plan.space.firsts, plan.segments, plan.parts, strict=True)
    heads = [(first, n, own[0][0] == INTRA) for first, n, own in rows]
    if not plan.n_channels:
        return [Segment(first, n, (), fresh=fresh) for first, n, fresh in heads]
    return [
        Segment(first, n, (build_units(units),), fresh=fresh)
        for (first, n, fresh), units in zip(heads, units_of(plan, coding), strict=True)
    ]
