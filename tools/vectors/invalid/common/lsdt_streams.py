"""Invalid, one fault each: streams of lsdt-frame and lsdt-clip.

Where a reader can overlook the fault, the hash is that of what it then decodes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.basis_models import Basis
from mcz.coding.residuals import code_residual
from tools.vectors.build.edits import Edit, plus, stream
from tools.vectors.build.files import Broken, rehash
from tools.vectors.build.spatial_clips import (
    FRAME,
    SCATTERED,
    Ints,
    Lengths,
    Plan,
    basis_of,
    file_with,
    listed,
    motion_of,
    noise,
    still,
)
from tools.vectors.build.spatial_streams import (
    Bits,
    adaptive,
    faulty_bits,
    longer_frame,
    longer_row,
    overlooked,
    sized,
    spec_of,
    stream_with,
    values_from,
)

MOST = 2**40
PAIR: Lengths = ((1, 1), (1, 1))  # codes of 0 and 1


def add(shelf: Broken, name: str) -> None:
    _coefficients(shelf, name)
    _lists(shelf, name)
    _bits(shelf, name)
    _values(shelf, name)


def _with(plan: Plan, data: bytes, seen: Plan | None = None) -> bytes:
    """The file of ``plan`` with other bits; ``seen``: what a lax reader makes of them."""
    edits: dict[str, Any] = {"segments": stream_with(plan, data)}
    if seen is not None:
        edits["CEND"] = rehash(values_from(seen))
    return file_with(plan, **edits)


def _coefficients(shelf: Broken, name: str) -> None:
    """Adaptive bits that say what may not be."""
    spec = spec_of(name, "Residuals", "Space")
    cases: dict[str, tuple[str, list[list[int]]]] = {
        "first-beyond": ("A first coefficient of 2^40 + 1", [[MOST + 1]]),
        "first-below": ("A first coefficient of -2^40 - 1", [[-MOST - 1]]),
        "first-54-bits": ("A first coefficient of 54 bits", [[2**53]]),
        "first-61-bits": ("A first coefficient of more than 60 bits", [[2**61]]),
        "other-beyond": ("Another coefficient of 2^40 + 1", [[5, MOST + 1]]),
        "other-below": ("Another coefficient of -2^40 - 1", [[-MOST, -MOST - 1]]),
        "other-54-bits": ("Another coefficient of 54 bits", [[MOST, -(2**53)]]),
    }
    for case, (purpose, table) in cases.items():
        n = len(table[0])
        plan = Plan(name, 1, (n,), window=n, fill=still)
        if name == FRAME:
            table = np.array(table).T.tolist()
        loud = replace(plan, fill=listed(table))
        bits = faulty_bits(plan, np.array(table, np.int64))
        shelf.add(case, spec, f"{purpose}.", _with(plan, bits, loud))
    for case, purpose, length in (
        ("length-minus", "A length of -1", -1),
        ("length-5", "A length of 5, where there are 4", 5),
        ("length-54-bits", "A length of 54 bits", 2**53),
    ):
        plan = Plan(name, 4, (1,), fill=still)
        if name != FRAME:
            plan = Plan(name, 1, (4,), window=4, fill=still)
        said = _length(name, length, 4)
        if length == 5:
            row = np.zeros(5, np.int64)
            said = longer_frame(row) if name == FRAME else longer_row(row, 4)
        shelf.add(case, spec, f"{purpose}.", _with(plan, said))


def _code_length(state: Ints, data: Any, length: int, expected: int, near: int) -> bool:
    """Code the first length of a stream."""
    code_residual(state, data, length, 0, (16 * expected, 16 * expected), near, (0, 0, 0), (0, 0))
    return True


def _length(name: str, length: int, n: int) -> bytes:
    """The bits of a first length."""
    expected, near = (0, 0) if name == FRAME else (n, 3)

    def loop(state: Ints, data: Any) -> bool:
        return bool(_code_length(state, data, length, expected, near))

    return adaptive(name, loop, faulty=False)


def _lists(shelf: Broken, name: str) -> None:
    """Sparse lists that are none."""
    spec = spec_of(name, "Sparse lists", "Prefix codes")
    ends = (*(0,) * 88, 1, 1)  # classes 88 and 89
    mixed = ((1, 1), (*(0,) * 87, 1, 1))
    quiet: Lengths = ((), ())
    single: Lengths = ((1,), (1,))
    cases: dict[str, tuple[str, int, Lengths, Bits]] = {
        "gap-4": (
            "A gap of 4 in a list of 4",
            4,
            ((0, 0, 0, 1, 1), (1,)),
            Bits(((0, 0, 0, 1, 1), (1,))).sparse(4, (4, 1)),
        ),
        "gap-rest": (
            "A gap of 2 where 2 entries are left",
            4,
            ((0, 1, 1), (1,)),
            Bits(((0, 1, 1), (1,))).sparse(4, (1, 1), (2, 1)),
        ),
        "gap-2-40": (
            "A gap of 2^40",
            4,
            (ends, (1,)),
            Bits((ends, (1,))).sparse(4, (MOST, 1)),
        ),
        "count-5": (
            "5 coefficients in a list of 4",
            4,
            single,
            Bits(single).sparse(4, *[(0, 1)] * 5),
        ),
        "size-beyond": (
            "A coefficient of 2^40 + 1",
            1,
            mixed,
            Bits(mixed).sparse(1, (0, MOST + 1)),
        ),
        "size-below": (
            "A coefficient of -2^40 - 1",
            1,
            mixed,
            Bits(mixed).sparse(1, (0, -MOST - 1)),
        ),
        "size-greatest-class": (
            "A coefficient of 2^41, the greatest that a code can say",
            1,
            ((1,), ends),
            Bits(((1,), ends)).sparse(1, (0, 2 * MOST)),
        ),
        "no-gap-code": (
            "A coefficient, but no code of a gap",
            4,
            quiet,
            Bits().plain(1, 3).plain(0, 31),
        ),
        "no-value-code": (
            "A coefficient, but no code of a value",
            4,
            ((1,), ()),
            Bits().plain(1, 3).plain(0, 16),
        ),
        "no-gap-class": (
            "Bits that are not the one code of a gap",
            4,
            single,
            Bits().plain(1, 3).plain(2**14, 15),
        ),
        "no-value-class": (
            "Bits that are not the one code of a value",
            4,
            single,
            Bits().plain(1, 3).plain(0, 1).plain(2**14, 15),
        ),
    }
    for case, (purpose, n, lengths, bits) in cases.items():
        plan = Plan(name, n, (1,), fill=still, prefix=True, lengths=lengths)
        if name != FRAME:
            plan = replace(plan, n_channels=1, segments=(n,), window=n)
        size = {"size-beyond": MOST + 1, "size-below": -MOST - 1}.get(case, 2 * MOST)
        seen = {"gap-rest": [0, 1], "count-5": [1] * 4, "size": [size], "no": [1]}
        row = seen.get(case, seen.get(case.partition("-")[0]))
        loud = None if row is None else replace(plan, fill=listed([row]))
        shelf.add(case, spec, f"{purpose}.", _with(plan, bits.data(), loud))


def _bits(shelf: Broken, name: str) -> None:
    """Bytes and bits behind those that are due, or too few."""
    for prefix, heading in ((False, "Entropy coding"), (True, "Bits")):
        end, how = ("-prefix", ", of prefix codes") if prefix else ("", "")
        plan = Plan(name, 4, (6,), prefix=prefix)
        for case, purpose, edit in (
            ("byte-behind", f"A byte 255 behind the bits{how}.", plus(b"\xff")),
            ("byte-0-behind", f"A byte 0 behind the bits{how}.", plus(b"\0")),
            ("byte-missing", f"Bits without their last byte{how}.", lambda data: data[:-1]),
        ):
            edits = {"segments": stream(0, _window_edit(name, edit))}
            if case == "byte-missing" and prefix:  # else zeros are as good, but for the hash
                edits["CEND"] = rehash(values_from(overlooked(plan, edit)))
            data = file_with(plan, **edits)
            shelf.add(f"{case}{end}", spec_of(name, heading), purpose, data)
    bits = Bits(PAIR).sparse(4, (1, 2), (0, -1))
    plan = Plan(name, 4, (1,), prefix=True, lengths=PAIR, fill=listed([[0, 2, -1]]))
    if name != FRAME:
        plan = replace(plan, n_channels=1, segments=(4,), window=4)
    assert len(bits.text) % 8
    purpose = "The bits behind the last one are 1."
    shelf.add("padding", spec_of(name, "Bits"), purpose, _with(plan, bits.data("1")))
    last = bits.data()
    last = last[:-1] + bytes((last[-1] | 1,))
    purpose = "The last bit of the last byte is 1."
    shelf.add("padding-last", spec_of(name, "Bits"), purpose, _with(plan, last))
    empty = file_with(plan, segments=stream(0, lambda _: b""))
    shelf.add("stream-empty", spec_of(name, "Bits"), "An empty stream of a list.", empty)
    if name == FRAME:
        plan = Plan(name, 4, (5, 5), fresh=(True, False))
        edits = {"segments": lambda made: [made[0], (made[1][0], [made[1][1][0] + b"\0"])]}
        purpose = "A byte 0 behind the bits of a segment that is not fresh."
        data = file_with(plan, **edits)
        shelf.add("byte-0-behind-on", spec_of(name, "Entropy coding"), purpose, data)


def _window_edit(name: str, edit: Edit) -> Edit:
    """An edit of the bits of the only window, behind its length, or of a segment."""
    if name == FRAME:
        return edit

    def changed(data: bytes) -> bytes:
        assert data[0] == len(data) - 1 < 128
        return sized(edit(data[1:]))

    return changed


def _values(shelf: Broken, name: str) -> None:
    bases = (basis_of(9, 9, shifts=SCATTERED),)
    plan = Plan(name, 9, (12,), step=0.1, bases=bases, window=12, fill=noise)
    motion = motion_of(plan)
    near = motion.signals[0].values.copy()
    near[7, 3] = np.nextafter(near[7, 3], np.inf)
    turned = values_from(replace(plan, bases=(_turned(plan),), fill=_backwards(plan)))
    for case, purpose, other in (
        ("hash-near", "One value is the neighbor of the one hashed.", near),
        ("hash-order", "The hash is of values summed from their last row on.", turned),
    ):
        assert other.tobytes() != motion.signals[0].values.tobytes()
        np.testing.assert_allclose(other, motion.signals[0].values, rtol=1e-9)
        data = file_with(plan, motion, CEND=rehash(other))
        shelf.add(case, spec_of(name, "CEND"), purpose, data)


def _turned(plan: Plan) -> Basis:
    """The basis from its last vector on."""
    (basis,) = plan.bases
    return Basis(basis.shifts[::-1].copy(), basis.entries[::-1].copy())


def _backwards(plan: Plan) -> Any:
    """The coefficients that belong to the vectors then."""

    def fill(number: int, n_rows: int, n: int) -> Ints:
        table = plan.fill(number, n_rows, n)
        turned: Ints = table[:, ::-1] if plan.codec == FRAME else table[::-1]
        return turned.copy()

    return fill
