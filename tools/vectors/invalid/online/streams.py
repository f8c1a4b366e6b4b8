"""Invalid, one fault each: bits of online.

Where a reader can overlook the fault, the hash is that of what it then decodes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import partial

import numpy as np

from mcz.codecs.basis_models import Basis
from mcz.codecs.online.coder import Coder
from mcz.codecs.online.units import build_units
from mcz.errors import FormatError
from tools.vectors.build.files import Broken, rehash
from tools.vectors.build.online_clips import (
    both,
    file_with,
    numbered,
    only_units,
    values_of,
    with_stream,
)
from tools.vectors.build.online_units import (
    GOLOMB,
    HEADING,
    MIXED,
    MOST,
    ONE,
    Coding,
    Plan,
    header,
    units_of,
)
from tools.vectors.build.spatial_clips import SCATTERED, Ints, basis_of, listed, noise, still, waves

RESIDUALS = f"{HEADING}; Residuals"


def add(shelf: Broken) -> None:
    _steps(shelf)
    _coefficients(shelf)
    _prefixes(shelf)
    _bits(shelf)
    _values(shelf)
    _wrapped_step(shelf)
    _rest_of_unit(shelf)


def _steps(shelf: Broken) -> None:
    cases: dict[str, tuple[str, str, Sequence[int]]] = {
        "below": ("A step of -1, of an STR", "I2", (0, -1)),
        "below-ltr": ("A step of -1, of an LTR", "I1 L1", (0, -1)),
        "below-far": ("A step of -511, of an STR", "I2", (0, -511)),
        "above": ("A step of 512, of an STR", "I2", (511, 512)),
        "above-ltr": ("A step of 512, of an LTR", "I1 L1", (511, 512)),
        "above-far": ("A step of 1022, of an STR", "I2", (511, 1022)),
        "length-10": ("A change of a step by 512, which has 10 bits", "I2", (ONE, ONE + 512)),
        "length-10-below": ("A change of a step by -512", "I2", (511, -1)),
    }
    for case, (said, units, steps) in cases.items():
        plan = Plan((units,), steps=numbered(steps))
        for name, purpose, made in both(f"step-{case}", said, plan):
            shelf.add(name, HEADING, purpose, file_with(made))
    for case, said, step, taken in (
        ("below-wrapped", "A step of -1, taken for 511.", -1, 511),
        ("below-clamped", "A step of -1, taken for 0.", -1, 0),
        ("above-wrapped", "A step of 512, taken for 0.", 512, 0),
        ("above-clamped", "A step of 512, taken for 511.", 512, 511),
    ):
        first = 0 if step < 0 else 511
        plan = Plan(("I2",), steps=numbered((first, step)))
        overlooked = values_of(replace(plan, steps=numbered((first, taken))))
        shelf.add(f"step-{case}", HEADING, said, file_with(plan, CEND=rehash(overlooked)))


def _coefficients(shelf: Broken) -> None:
    """Bits of coder 0 that say what may not be; they end with the fault."""
    cases: dict[str, tuple[str, list[list[int]]]] = {
        "first-beyond": ("A first coefficient of 2^40 + 1", [[MOST + 1]]),
        "first-below": ("A first coefficient of -2^40 - 1", [[-MOST - 1]]),
        "first-54-bits": ("A first coefficient of 54 bits", [[2**53]]),
        "first-61-bits": ("A first coefficient of more than 60 bits", [[2**61]]),
        "other-beyond": ("Another coefficient of 2^40 + 1", [[5], [MOST + 1]]),
        "other-below": ("Another coefficient of -2^40 - 1", [[-MOST], [-MOST - 1]]),
        "other-54-bits": ("Another coefficient of 54 bits", [[MOST], [-(2**53)]]),
    }
    for case, (purpose, rows) in cases.items():
        plan = Plan((f"I{len(rows)}",), 1, fill=listed(rows))
        shelf.add(case, RESIDUALS, f"{purpose}.", file_with(plan))
    plan = Plan(("I1",), 4, fill=still, said=(0,))
    purpose = "A length of -1."
    shelf.add("length-minus", RESIDUALS, purpose, file_with(plan, coding=_Negative))
    (wide,) = units_of(Plan(("I1",), 5, fill=listed([[3, 0, -1, 0, 1]])))
    plan = Plan(("I1",), 4, fill=listed([[3, 0, -1]]))
    purpose = "A length of 5, where there are 4."
    shelf.add("length-5", RESIDUALS, purpose, with_stream(plan, build_units(wide)))


class _Negative(Coding):
    def length_of(self, row: Sequence[int]) -> int:
        return -1


def _prefixes(shelf: Broken) -> None:
    """Golomb-Rice codes that say what may not be."""
    cases: dict[str, tuple[str, list[int]]] = {
        "size-beyond": ("A size of 2^40 + 1, without plain bits", [MOST + 1]),
        "size-below": ("The same, negative", [-MOST - 1]),
        "size-plain": ("A size of 2^40 + 1, of which 3 bits are plain", [16, MOST + 1]),
        "size-prefix": ("A size of 2^40 + 8, of which 3 bits are plain", [16, MOST + 8]),
        "length-42": ("A prefix of 2^41 + 15 ones, whose length is 42", [2**41 + 15]),
        "length-43": ("A length of 43", [2**42 + 15]),
        "length-62": ("A length of 62", [2**61 + 15]),
    }
    for case, (said, row) in cases.items():
        plan = Plan(("I1",), len(row), GOLOMB, fill=listed([row]))
        shelf.add(f"prefix-{case}", HEADING, f"{said}.", file_with(plan))
    plan = Plan(("I2",), 3, GOLOMB, fill=listed([[100, 100, 100], [2, 3 * MOST]]))
    purpose = "A size of 3 * 2^40, of an STR."
    shelf.add("prefix-size-str", HEADING, purpose, file_with(plan))
    plan = Plan(("I1",), 2, GOLOMB, fill=listed([[MOST, 0]]))
    purpose = "A size of 2^64, 0 in 64 bits."
    shelf.add("prefix-size-wrapped", HEADING, purpose, file_with(plan, coding=_Wrapping))
    plan = Plan(("I1",), 1, GOLOMB, fill=listed([[15]]))
    purpose = "A prefix that goes on behind 16 ones by a number of no bits."
    shelf.add("prefix-length-0", HEADING, purpose, file_with(plan, coding=_Endless))


class _Wrapping(Coding):
    def size(self, kind: int, size: int, activity: int) -> None:
        super().size(kind, size or 2**64, activity)


class _Endless(Coding):
    """A prefix of 16 ones and a length of 0, which stands for 15 ones, if for anything."""

    def size(self, kind: int, size: int, activity: int) -> None:
        super().size(kind, size + 1, activity)

    def escape(self, rest: int) -> None:
        assert rest == 1
        self.number(0, 6)


def _bits(shelf: Broken) -> None:
    """Bytes behind those that are due, or too few, of a unit in each place."""
    spec = f"{HEADING}; Entropy coding"
    for coder, end, how in ((MIXED, "", ""), (GOLOMB, "-golomb", ", Golomb")):
        plan = Plan(("I3 S3 L3",), coder=coder, fill=_loud)
        edits: dict[str, tuple[str, Callable[[int], bytes]]] = {
            "byte-behind": ("A byte 255 behind the bits", _behind(plan, b"\xff")),
            "byte-0-behind": ("A byte 0 behind the bits", _behind(plan, b"\0")),
            "bytes-missing": ("Bits without their last bytes", partial(_shortened, plan)),
        }
        for case, (what, edit) in edits.items():
            for at, where in enumerate(("intra coded unit", "unit of STRs", "last unit")):
                name = f"{case}-{('intra', 'str', 'ltr')[at]}{end}"
                shelf.add(name, spec, f"{what} of the {where}{how}.", with_stream(plan, edit(at)))


def _behind(plan: Plan, tail: bytes) -> Callable[[int], bytes]:
    """The stream with ``tail`` behind the bits of a unit."""

    def edit(at: int) -> bytes:
        units = only_units(plan)
        units[at] = replace(units[at], data=units[at].data + tail)
        return build_units(units)

    return edit


def _shortened(plan: Plan, at: int) -> bytes:
    """The stream without as many bytes of a unit as its bits miss, whatever they then say.

    Fewer may be the bits of other coefficients.
    """
    units, coder = only_units(plan), Coder(header(plan), plan.space.layout)
    for unit in units[:at]:
        coder.decode(unit)
    for size in range(len(units[at].data) - 1, -1, -1):
        units[at] = replace(units[at], data=units[at].data[:size])
        try:
            deepcopy(coder).decode(units[at])
        except FormatError:
            break
    return build_units(units)


def _rest_of_unit(shelf: Broken) -> None:
    """Faults behind the frames that are asked for, in the unit that holds these."""
    parts = ((("--frames", "0:2"), ()), (("--frames", "1:2"), ()))
    for coder, end, how in ((MIXED, "", ""), (GOLOMB, "-golomb", ", Golomb")):
        plan = Plan(("I6 L6",), coder=coder, fill=_loud)
        purpose = f"A byte behind the bits of a unit of six frames, two asked for{how}."
        data = with_stream(plan, _behind(plan, b"\xff")(0))
        shelf.add(f"rest-byte-behind{end}", HEADING, purpose, data, parts=parts)
        steps = replace(plan, units=("I6",), steps=numbered((511, 511, 511, 511, 512, 511)))
        purpose = f"A step of 512 in the fifth frame of a unit, two asked for{how}."
        shelf.add(f"rest-step{end}", HEADING, purpose, file_with(steps), parts=parts)


def _loud(number: int, n_rows: int, n: int) -> Ints:
    return waves(5, n_rows, n) | 1


def _values(shelf: Broken) -> None:
    plan = Plan(("I6 L6",), 9, step=0.1, fill=noise, bases=(basis_of(9, 9, shifts=SCATTERED),))
    values = values_of(plan)
    near = values.copy()
    near[7, 3] = np.nextafter(near[7, 3], np.inf)
    basis = plan.bases[0]
    turned = Basis(basis.shifts[::-1].copy(), basis.entries[::-1].copy())
    backwards = replace(plan, bases=(turned,), fill=lambda *a: noise(*a)[:, ::-1].copy())
    for case, purpose, other in (
        ("hash-near", "One value is the neighbor of the one hashed.", near),
        (
            "hash-order",
            "The hash is of values summed from their last row on.",
            values_of(backwards),
        ),
    ):
        assert other.tobytes() != values.tobytes()
        np.testing.assert_allclose(other, values, rtol=1e-9)
        data = file_with(plan, CEND=rehash(other))
        shelf.add(case, f"{HEADING}; CEND", purpose, data)


def _wrapped_step(shelf: Broken) -> None:
    plan = Plan(("I2",), steps=numbered((ONE, ONE + 512)))
    said = "A change of a step by 512, taken for none"
    for name, purpose, made in both("step-length-10-wrapped", said, plan):
        seen = values_of(replace(made, steps=numbered((ONE, ONE))))
        shelf.add(name, HEADING, purpose, file_with(made, CEND=rehash(seen)))
