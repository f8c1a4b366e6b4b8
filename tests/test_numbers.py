"""Number grids against Python's own formatting, numpy's binary32 and struct."""

from __future__ import annotations

import math
import os
import struct
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mcz import FormatError, SourceError
from mcz.kernels import PACKAGE
from mcz.model.numbers import (
    Grid,
    GridFlag,
    GridKind,
    Tokens,
    choose_grid,
    decimal_kernels,
    fit_grid,
    print_values,
    scan,
)

INT64 = st.integers(-(2**63), 2**63 - 1)
PLAIN = [flag for flag in GridFlag if flag not in (GridFlag.POINT, GridFlag.EXPONENT1)]
DOUBLES = st.floats(allow_nan=False, allow_infinity=False) | st.floats(-400, 400)


def tokens_of(*texts: str | bytes) -> Tokens:
    parts = [text.encode() if isinstance(text, str) else text for text in texts]
    stop = np.cumsum([len(part) + 1 for part in parts]) - 1
    start = stop - [len(part) for part in parts]
    return scan(b" ".join(parts), start, stop)


def bits(values: np.ndarray) -> list[int]:
    return np.asarray(values, np.float64).view(np.int64).tolist()


def check_printed(grid: Grid, texts: list[str]) -> np.ndarray:
    """Each text is one that the grid prints: token -> ordinal -> value -> ordinal -> token."""
    tokens = tokens_of(*texts)
    ordinals, printed = grid.ordinals_of_tokens(tokens)
    assert printed.all(), (grid, [text for text, ok in zip(texts, printed, strict=True) if not ok])
    assert grid.texts(ordinals).tolist() == [text.encode() for text in texts]
    values = grid.values(ordinals)
    assert bits(values) == bits(np.array([float(text) for text in texts]))
    assert bits(values) == bits(tokens.values())
    again, exact = grid.ordinals(values)
    assert exact.all()
    assert again.tolist() == ordinals.tolist()
    return ordinals


@given(
    st.lists(DOUBLES | st.floats(width=32, allow_nan=False, allow_infinity=False), max_size=8),
    st.sampled_from([0, 3, 6, 15, 32, 64]),
    st.integers(0, 40),
    st.sampled_from(["f", "e", "g"]),
)
def test_printed_as_python_prints(
    numbers: list[float], digits: int, places: int, letter: str
) -> None:
    """Numbers of a base print as Python's format does, and come back from their texts."""
    places = max(1, places % 18) if letter == "g" else places
    style = {"f": 0, "g": 128, "e": 192}[letter] + places
    grid = Grid(GridKind.PRINTED, digits, style=style)
    ordinals, _ = grid.ordinals(np.array(numbers, np.float64))
    base = Grid(
        {32: GridKind.BINARY32, 64: GridKind.BINARY64}.get(digits, GridKind.FIXED), digits % 32
    )
    texts = [f"{x:.{places}{letter}}" for x in base.values(ordinals).tolist()]
    assert [text.decode() for text in grid.texts(ordinals).tolist()] == texts
    assert bits(grid.values(ordinals)) == bits(np.array([float(text) for text in texts]))
    if texts:
        again, printed = grid.ordinals_of_tokens(tokens_of(*texts))
        assert grid.texts(again[printed]).tolist() == [
            text.encode() for text, ok in zip(texts, printed, strict=True) if ok
        ]


@given(st.lists(st.floats(0, 1e20), min_size=1, max_size=8), st.integers(0, 40))
def test_printed_with_17_digits(numbers: list[float], places: int) -> None:
    """C libraries of Windows print zeros after the 17th digit."""
    grid = Grid(GridKind.PRINTED, 64, style=64 + places)
    for text, x in zip(grid.texts(grid.ordinals(np.array(numbers))[0]), numbers, strict=True):
        exact = Decimal(f"{x:.16e}")
        cut = exact if exact.adjusted() - 16 >= -places else Decimal(x)
        assert text.decode() == f"{cut:.{places}f}" or x == 0
        assert len(text.replace(b".", b"").lstrip(b"0").rstrip(b"0")) <= max(17, 1)


def trim_zeros(text: str, end: str = "") -> str:
    """``text`` without the zeros at the end of its fraction; ``end`` if it had nothing else."""
    head, point, fraction = text.partition(".")
    fraction = fraction.rstrip("0")
    return f"{head}.{fraction}" if point and fraction else head + end


def restyle_number(text: str, flags: int) -> str:
    """A number as C's %g prints it, in the style of ``flags``, POINT and EXPONENT1 left out."""
    head, e, exponent = text.partition("e")
    if flags & GridFlag.NO_ZERO and "." in head and abs(float(head)) < 1:
        head = head.replace("0.", ".", 1)
    if flags & GridFlag.POINT_ZERO and not e and "." not in head:
        head += ".0"
    if flags & GridFlag.PLUS and head[0] != "-":
        head = "+" + head
    if e and flags & GridFlag.EXPONENT3:
        exponent = exponent[0] + exponent[1:].rjust(3, "0")
    return head + ("E" if flags & GridFlag.UPPER else e) + exponent if e else head


@given(st.lists(st.floats(-99999, 99999), min_size=1), st.integers(0, 10))
def test_fixed_is_printf(values: list[float], digits: int) -> None:
    check_printed(Grid(GridKind.FIXED, digits), [f"{value:.{digits}f}" for value in values])


@given(
    st.lists(st.floats(-99999, 99999), min_size=1), st.integers(1, 10), st.sampled_from((0, 1, 2))
)
def test_trimmed_is_printf_without_zeros(values: list[float], digits: int, flags: int) -> None:
    texts = [trim_zeros(f"{value:.{digits}f}", ("", ".0", ".")[flags]) for value in values]
    check_printed(Grid(GridKind.TRIMMED, digits, flags), texts)


@given(
    st.lists(DOUBLES.filter(lambda x: x == 0 or 1e-306 < abs(x) < 1e307), min_size=1),
    st.integers(1, 15),
    st.sets(st.sampled_from(PLAIN)),
)
def test_general_is_printf_g(values: list[float], digits: int, chosen: set[GridFlag]) -> None:
    flags = sum(chosen)
    texts = [restyle_number(f"{value:.{digits}g}", flags) for value in values]
    check_printed(Grid(GridKind.GENERAL, digits, flags), texts)


@given(st.lists(DOUBLES, min_size=1))
def test_text64_is_repr(values: list[float]) -> None:
    ordinals = check_printed(
        Grid(GridKind.TEXT64, 0, GridFlag.POINT_ZERO), [repr(value) for value in values]
    )
    magnitudes = struct.unpack(
        f"<{len(values)}Q", struct.pack(f"<{len(values)}d", *map(abs, values))
    )
    signs = [math.copysign(1, value) < 0 for value in values]
    assert ordinals.tolist() == [~m if s else m for m, s in zip(magnitudes, signs, strict=True)]


@given(st.lists(DOUBLES, min_size=1), st.sampled_from((16, 17)))
def test_text64_is_printf_g(values: list[float], digits: int) -> None:
    texts = [f"{value:.{digits}g}" for value in values]
    if digits == 16:  # not every binary64 comes back from 16 digits
        texts = [text for text in texts if f"{float(text):.16g}" == text and float(text) < 1e308]
    check_printed(Grid(GridKind.TEXT64, digits), texts or ["0"])


@given(st.lists(st.floats(-1e6, 1e6), min_size=1), st.integers(17, 40))
def test_text64_is_printf_f(values: list[float], decimals: int) -> None:
    texts = [f"{value:.{decimals}f}" for value in values]
    texts = [text for text in texts if f"{float(text):.{decimals}f}" == text]
    check_printed(Grid(GridKind.TEXT64, 64 + decimals), texts or ["0." + "0" * decimals])


@pytest.mark.parametrize(
    ("value", "text"),
    [(1e-6, "0.000001"), (1.5e-7, "1.5e-7"), (1e20, "100000000000000000000"), (-1e21, "-1e+21"),
     (123456789012345680000.0, "123456789012345680000"), (0.1, "0.1"), (5e-324, "5e-324"),
     (4.35, "4.35"), (0.0, "0"), (2.0**-44, "5.684341886080802e-14")],
)  # fmt: skip
def test_text64_is_javascript(value: float, text: str) -> None:
    grid = Grid(GridKind.TEXT64, 1, GridFlag.EXPONENT1)
    assert grid.texts(grid.ordinals(np.array([value]))[0])[0] == text.encode()
    check_printed(grid, [text])


@given(st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=1))
def test_text32_is_the_shortest_binary32(values: list[float]) -> None:
    numbers = np.array(values, np.float32)
    # numpy's own digits, in Python's layout (numpy's depends on its version)
    digits = [np.format_float_scientific(x, unique=True, trim="-") for x in numbers]
    texts = [repr(float(text)) for text in digits]
    ordinals = check_printed(Grid(GridKind.TEXT32, 0, GridFlag.POINT_ZERO), texts)
    words = np.abs(numbers).view(np.uint32).astype(np.int64)
    assert np.array_equal(ordinals, np.where(np.signbit(numbers), ~words, words))


@given(INT64, st.integers(1, 15))
def test_general_ordinals_are_in_order(ordinal: int, digits: int) -> None:
    """The number of an ordinal is where the specification puts it."""
    grid = Grid(GridKind.GENERAL, digits)
    m = ordinal % grid.limit
    below, above = (Decimal(text.decode()) for text in grid.texts(np.array([m, m + 1])).tolist())
    power, rest = divmod(m, 9 * 10 ** (digits - 1))
    expected = Decimal(rest + 10 ** (digits - 1)).scaleb(power - 307 - digits + 1)
    assert below < above == expected
    values = grid.values(np.array([m, -1 - m]))
    assert bits(values) == bits(np.array([float(below), -float(below)]))


GRIDS = [
    Grid(GridKind.FIXED, 0),
    Grid(GridKind.FIXED, 6),
    Grid(GridKind.FIXED, 22, GridFlag.NO_ZERO),
    Grid(GridKind.TRIMMED, 4, GridFlag.POINT_ZERO | GridFlag.NO_ZERO),
    Grid(GridKind.TRIMMED, 22, GridFlag.POINT | GridFlag.PLUS),
    Grid(GridKind.GENERAL, 1),
    Grid(GridKind.GENERAL, 6, GridFlag.EXPONENT3),
    Grid(GridKind.GENERAL, 15, GridFlag.POINT_ZERO | GridFlag.UPPER),
    Grid(GridKind.TEXT64, 0, GridFlag.POINT_ZERO),
    Grid(GridKind.TEXT64, 1, GridFlag.EXPONENT1),
    Grid(GridKind.TEXT64, 17),
    Grid(GridKind.TEXT64, 64 + 20),
    Grid(GridKind.TEXT32),
    Grid(GridKind.INTEGER),
    Grid(GridKind.SCALED, scale=0.1),
    Grid(GridKind.SCALED, scale=2.0**-200 * 1.9),
    Grid(GridKind.SCALED, scale=1.1e60),
    Grid(GridKind.BINARY32),
    Grid(GridKind.BINARY64),
    Grid(GridKind.VAX_F),
]


def edges(grid: Grid) -> list[int]:
    low = ~grid.limit if grid.signed_magnitude else -grid.limit
    return [low, low + 1, -2, -1, 0, 1, 2, grid.limit - 1, grid.limit]


@pytest.mark.parametrize("grid", GRIDS, ids=repr)
@given(st.lists(INT64, max_size=8), st.lists(DOUBLES, max_size=8))
def test_every_ordinal(grid: Grid, extra: list[int], values: list[float]) -> None:
    """In range: a value, a text and back. Out of range: FormatError."""
    low = edges(grid)[0]
    span = grid.limit - low + 1
    ordinals = np.array(edges(grid) + [low + x % span for x in extra], np.int64)
    decoded = grid.values(ordinals)
    again, exact = grid.ordinals(decoded)
    kept = ~np.isnan(decoded)
    if grid.kind == GridKind.VAX_F:
        kept &= decoded != 0  # a zero may have any fraction
    assert exact[kept].all()
    assert again[kept].tolist() == ordinals[kept].tolist()
    nearest, exact = grid.ordinals(np.array(values))
    assert (bits(grid.values(nearest)) == np.array(bits(np.array(values))))[exact].all()
    if grid.is_text:
        texts = grid.texts(ordinals).tolist()
        wide = grid.digits >= 16  # their texts may stand for a neighbour
        if grid.kind != GridKind.TEXT64 or not wide:
            assert bits(decoded) == bits(tokens_of(*texts).values())
            tokens = [text for text in texts if len(text) <= 18]  # LONG ones in JavaScript style
            assert grid.ordinals_of_tokens(tokens_of(*tokens))[1].all()
    for wild in extra:
        if not low <= wild <= grid.limit:
            with pytest.raises(FormatError, match=str(wild)):
                grid.values(np.array([wild]))
            if grid.is_text:
                with pytest.raises(FormatError):
                    grid.texts(np.array([wild]))


@pytest.mark.parametrize("grid", GRIDS, ids=repr)
def test_values_that_a_grid_lacks(grid: Grid) -> None:
    """NaN is 0 and inexact, infinities are the ends, except on IEEE grids."""
    ordinals, exact = grid.ordinals(np.array([np.nan, np.inf, -np.inf, -0.0]))
    if grid.kind in (GridKind.BINARY32, GridKind.BINARY64):
        assert exact.all()
        return
    low = edges(grid)[0]
    assert ordinals[:3].tolist() == [0, grid.limit, low]
    assert not exact[:3].any()
    signed_zero = grid.signed_magnitude and grid.kind != GridKind.VAX_F
    assert (ordinals[3], exact[3]) == ((-1, True) if signed_zero else (0, False))


@given(st.floats(-1e9, 1e9), st.integers(0, 6))
def test_the_nearest_number_of_a_grid(value: float, digits: int) -> None:
    fixed = Grid(GridKind.FIXED, digits)
    found = fixed.values(fixed.ordinals(np.array([value]))[0])[0]
    assert abs(found - value) <= 0.5000001 * 10.0**-digits + abs(value) * 1e-15
    general = Grid(GridKind.GENERAL, digits + 1)
    found = general.values(general.ordinals(np.array([value]))[0])[0]
    assert abs(found - value) <= abs(value) * 10.0**-digits * 0.51 or abs(value) < 1e-306


def by_steps(value: float, digits: int) -> int:
    """The ordinal on GENERAL by the steps of SPEC.md, "Value to ordinal", of a value of 1e-6 on."""
    power = math.floor(math.log10(value)) + 1
    while Fraction(10) ** power > Fraction(value):
        power -= 1
    shift = digits - 1 - power
    mantissa = round(value * 10.0**shift if shift >= 0 else value / 10.0**-shift)
    if abs(shift) > 22 or len(str(mantissa)) != digits:
        text = f"{value:.{digits - 1}e}"
        mantissa, power = int(text.split("e")[0].replace(".", "")), int(text.split("e")[1])
    block: int = 10 ** (digits - 1)
    return (power + 307) * 9 * block + mantissa - block + 1


@given(st.integers(-6, 36), st.integers(-60, 60), st.integers(1, 15))
@example(5, -7, 15)
def test_around_powers_of_ten(power: int, steps: int, digits: int) -> None:
    """The logarithm of a value may round to an integer that the value has not reached."""
    value = 10.0**power
    for _ in range(abs(steps)):
        value = math.nextafter(value, math.copysign(math.inf, steps))
    (found,), _ = Grid(GridKind.GENERAL, digits).ordinals(np.array([value]))
    assert found == by_steps(value, digits)


@pytest.mark.parametrize(
    ("grid", "texts"),
    [
        (Grid(GridKind.FIXED, 2), "1.0 1.000 01.00 +1.00 1.00e0 .50 1. 1 --1.00 -.50 1e2 nan inf"),
        (Grid(GridKind.FIXED, 0), "1. 1.0 01 +1 00 -00 1e0 99999999999999999999"),
        (Grid(GridKind.FIXED, 1, GridFlag.PLUS), "1.0 +-1.0 0.0"),
        (Grid(GridKind.FIXED, 1, GridFlag.NO_ZERO), "0.5 -0.5 0.0"),
        (Grid(GridKind.FIXED, 4), "225179981368.5248 9999999999999.0000"),
        (Grid(GridKind.TRIMMED, 4), "1.0 1.50 0.0 1.23456 1. 1e1 0.00 -0.0"),
        (Grid(GridKind.TRIMMED, 4, 1), "1 1.50 0 1.00 0.00 -0 .0"),
        (Grid(GridKind.TRIMMED, 4, 2), "1 1.0 1.50 0"),
        (Grid(GridKind.GENERAL, 6), "1.0 1.50 1234567 0.00001 1e05 1e5 1e+5 1e+05 1.0e-05 1e-005"),
        (Grid(GridKind.GENERAL, 6), "1E-05 10e-06 0.1e-05 1.234567 0e-05 1.e-05 0.0 100000.0 -00"),
        (Grid(GridKind.GENERAL, 6), "1e+308 1e-308 1e-5 1e999"),
        (Grid(GridKind.GENERAL, 6, GridFlag.EXPONENT3), "1e-05 1e-0005 1e+06"),
        (Grid(GridKind.GENERAL, 3), "1234 1000 1e+02"),
        (Grid(GridKind.TEXT64, 0, 1), "0.10000000000000001 1 1e16 1e+15 0.00001"),
        (Grid(GridKind.TEXT64, 0, 1), "5e-325 1e400 1e+400 1e-400 4e-324"),
        (Grid(GridKind.TEXT64, 17), "0.1 0.10000000000000002220"),
        (Grid(GridKind.TEXT64, 84), "0.10000000000000000556 0.1"),
        (Grid(GridKind.TEXT32), "0.10000000149 16777217 1e39 1e+39 1e-46"),
    ],
)  # fmt: skip
def test_other_forms_are_exceptions(grid: Grid, texts: str) -> None:
    ordinals, printed = grid.ordinals_of_tokens(tokens_of(*texts.split()))
    assert not printed.any(), np.array(texts.split())[printed]
    assert not ordinals.any()


NUMBERISH = st.text("0123456789.-+eE", min_size=1, max_size=24) | st.from_regex(
    r"\A[-+]?[0-9]{0,9}\.?[0-9]{0,9}(e[-+]?[0-9]{1,4})?\Z"
).map(str.strip).filter(bool)


@given(
    st.lists(NUMBERISH, min_size=1, max_size=20), st.sampled_from([g for g in GRIDS if g.is_text])
)
def test_printed_means_the_same_text(texts: list[str], grid: Grid) -> None:
    """A token is printed exactly if it is the text of the number that is nearest to it."""
    good = [is_number(text) for text in texts]
    tokens = tokens_of(*texts)
    assert (~tokens.bad()).tolist() == good
    chosen, fitted, fits = fit_grid(tokens, [grid])
    assert chosen == choose_grid(tokens, [grid])
    assert chosen.texts(fitted[fits]).tolist() == tokens[fits].texts().tolist()

    numbers = [text for text, ok in zip(texts, good, strict=True) if ok]
    tokens = tokens[~tokens.bad()]
    values = tokens.values()
    assert bits(values) == bits(np.array([float(text) for text in numbers]))
    again = grid.texts(grid.ordinals(values)[0]).tolist()
    ordinals, printed = grid.ordinals_of_tokens(tokens)
    assert printed.tolist() == [a == b.encode() for a, b in zip(again, numbers, strict=True)]
    assert not ordinals[~printed].any()
    assert np.count_nonzero(fits) >= np.count_nonzero(printed) or chosen != grid


def is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def test_tokens_that_are_no_finite_numbers() -> None:
    tokens = tokens_of("nan", "-NaN", "INF", "-infinity", "1.#QNAN", "-1.#IND", "1.#INF00", "1e999")
    assert not tokens.bad().any()
    values = tokens.values()
    assert np.isnan(values[[0, 1, 4, 5]]).all()
    assert {bits(values)[k] for k in (0, 1, 4, 5)} == {0x7FF8000000000000}
    assert values[[2, 3, 6, 7]].tolist() == [np.inf, -np.inf, np.inf, np.inf]
    assert tokens_of("x", "1.2.3", "-", "e5", "1e", "1e+", "0x10", "1_000", "1").bad().sum() == 8
    with pytest.raises(SourceError, match="offset 4: '1,5' is not"):
        tokens_of("1.5", "1,5").values()


def test_long_tokens() -> None:
    texts = ["0" * 400 + "1." + "3" * 400, "1" * 310, "-0." + "0" * 330 + "7", "1e-" + "9" * 30]
    assert bits(tokens_of(*texts).values()) == bits(np.array([float(text) for text in texts]))


@given(
    st.from_regex(r"[-+]?[0-9]{1,9}(\.[0-9]{0,9})?|[-+]?[0-9]{0,6}\.[0-9]{1,12}", fullmatch=True),
    st.sampled_from(["", "e-07", "E+9"]),
    st.sampled_from([0, 16]),  # what lies before a token decides how it is read
)
def test_notation_of_a_number(text: str, exponent: str, start: int) -> None:
    data = b"9" * start + (text + exponent).encode()
    mantissa, power, shape = scan(data, [start], [len(data)]).fields[0].tolist()
    first, point, last = text.lstrip("+-").partition(".")
    assert mantissa == int(first + last)
    assert power == int(exponent[1:] or 0)
    assert shape >> decimal_kernels.SIGNIFICANT & 31 == len((first + last).strip("0"))
    assert shape >> decimal_kernels.FRACTION_DIGITS & 65535 == len(last)
    assert bool(shape & decimal_kernels.POINT) == bool(point)
    assert bool(shape & decimal_kernels.NO_INTEGER) == (first == "")
    assert bool(shape & decimal_kernels.ZERO_INTEGER) == (first == "0")
    assert bool(shape & decimal_kernels.EXTRA_ZERO) == (first[:1] == "0" and len(first) > 1)
    assert shape & (decimal_kernels.MINUS | decimal_kernels.PLUS) == "-+".find(text[0]) + 1
    assert not shape & (decimal_kernels.BAD | decimal_kernels.LONG)


@pytest.mark.parametrize(
    "text", ["1.2.3", "1234567.9.", "1/2", "1:2", ".", "-", "12345678,5", "1\xe9"]
)
def test_words_like_numbers_are_none(text: str) -> None:
    word = text.encode("latin-1")
    assert scan(b"9" * 16 + word, [16], [16 + len(word)]).bad().all()


def test_tokens_can_be_chosen() -> None:
    tokens = tokens_of("1", "2.5", "x", "-4")
    assert tokens[~tokens.bad()].values().tolist() == [1, 2.5, -4]
    assert tokens[::3].values().tolist() == [1, -4]
    assert tokens.token(2) == b"x"
    with pytest.raises(IndexError):
        scan(b"12", [0], [3])


@pytest.mark.parametrize(
    ("texts", "grid"),
    [
        ("0 0 131 -2", Grid(GridKind.FIXED, 0)),
        ("5.2300 -0.0000 17.1234", Grid(GridKind.FIXED, 4)),
        ("12.313 0.0 8.9283 -4.5 7.0", Grid(GridKind.TRIMMED, 4, GridFlag.POINT_ZERO)),
        ("12.313 0 8.9283 -4.5 7", Grid(GridKind.TRIMMED, 4)),
        (".0083333 -.5000000", Grid(GridKind.FIXED, 7, GridFlag.NO_ZERO)),
        ("1.23457e-014 -3.4 1.5", Grid(GridKind.GENERAL, 6, GridFlag.EXPONENT3)),
        ("1.23457e-14 -3.4 24.0", Grid(GridKind.GENERAL, 6, GridFlag.POINT_ZERO)),
        ("1.234567E-05 -3.4 24", Grid(GridKind.GENERAL, 7, GridFlag.UPPER)),
        ("9.297450065612793 -0.0 1.5e-06", Grid(GridKind.TEXT64, 0, GridFlag.POINT_ZERO)),
        ("9.297450065612793 0.0000015 -1e-7", Grid(GridKind.TEXT64, 1, GridFlag.EXPONENT1)),
        ("0.12345678901234567 7.2999999999999998", Grid(GridKind.TEXT64, 17)),
        ("0.10000000000000001 0.25", Grid(GridKind.PRINTED, 2, style=145)),
        ("0.10000000000000000555 1.50000000000000000000", Grid(GridKind.TEXT64, 84)),
        ("nan nan", Grid(GridKind.FIXED, 0)),
    ],
)  # fmt: skip
def test_choose_grid(texts: str, grid: Grid) -> None:
    assert choose_grid(tokens_of(*texts.split())) == grid


def test_choose_grid_counts_exceptions() -> None:
    """One stray token does not give a whole channel 14 decimals; a preferred grid wins ties."""
    texts = [trim_zeros(f"{k / 1000:.3f}") for k in range(1001, 3000)]
    tokens = tokens_of(*texts, "-0.00709999999999")
    assert choose_grid(tokens) == Grid(GridKind.TRIMMED, 3)
    general = Grid(GridKind.GENERAL, 6)
    assert choose_grid(tokens[:-1], [general]) == general
    assert choose_grid(tokens_of()) == Grid(GridKind.FIXED, 0)


def test_choose_grid_sees_every_column() -> None:
    """``.0`` in one column of a table of 60 is seen, whatever the number of rows."""
    row = ["0.1234"] * 59 + ["7.0"]
    assert choose_grid(tokens_of(*row * 4096)) == Grid(GridKind.TRIMMED, 4, GridFlag.POINT_ZERO)


@given(st.lists(st.integers(0, 2**64 - 1), min_size=1))
def test_ieee_bits(words: list[int]) -> None:
    wide = np.array(words, "<u8")
    doubles = Grid(GridKind.BINARY64)
    ordinals = doubles.ordinals_of_bits(wide)
    assert doubles.bits(ordinals).tolist() == words
    expected = np.array(struct.unpack(f"<{len(words)}d", wide.tobytes()))
    expected[np.isnan(expected)] = np.nan
    assert bits(doubles.values(ordinals)) == bits(np.where(np.isnan(expected), np.nan, expected))

    narrow = (wide & 0xFFFFFFFF).astype("<u4")
    singles = Grid(GridKind.BINARY32)
    ordinals = singles.ordinals_of_bits(narrow)
    assert singles.bits(ordinals).tolist() == narrow.tolist()
    values = singles.values(ordinals)
    for word, value in zip(narrow.tolist(), values.tolist(), strict=True):
        expected_value = struct.unpack("<f", struct.pack("<I", word))[0]
        assert value == expected_value or (math.isnan(value) and math.isnan(expected_value))

    vax = Grid(GridKind.VAX_F)
    assert vax.bits(vax.ordinals_of_bits(narrow)).tolist() == narrow.tolist()


VAX = [  # stored bytes, value: C3D.org and DEC's manuals
    ("80400000", 1.0),
    ("80c00000", -1.0),
    ("60410000", 3.5),
    ("60c10000", -3.5),
    ("00000000", 0.0),
    ("7f00ffff", 0.0),
    ("00800000", math.nan),
    ("80000000", 2.0**-128),
    ("ff7fffff", 2.0**127 * (1 - 2.0**-24)),
    ("ffffffff", -(2.0**127) * (1 - 2.0**-24)),
    ("4941db0f", 3.1415927410125732),
]


@pytest.mark.parametrize(("stored", "value"), VAX, ids=str)
def test_vax_values(stored: str, value: float) -> None:
    grid = Grid(GridKind.VAX_F)
    word = np.frombuffer(bytes.fromhex(stored), "<u4")
    ordinals = grid.ordinals_of_bits(word)
    assert grid.bits(ordinals).tobytes().hex() == stored
    found = grid.values(ordinals)[0]
    assert found == value or math.isnan(value) == math.isnan(found) is True


@pytest.mark.parametrize(
    ("token", "grid"),
    [
        (b"-1.797693134862316e+308", Grid(GridKind.TEXT64, 16)),
        (b"-2e+308", Grid(GridKind.PRINTED, 64, style=129)),
    ],
)
def test_text_of_the_greatest_number_that_reads_as_infinity(token: bytes, grid: Grid) -> None:
    """A grid would print it so, but its number is another: an exception."""
    assert not grid.ordinals_of_tokens(scan(token, [0], [len(token)]))[1].any()


def _rounds_plainly(value: float, digits: int) -> bool:
    """The number of so many digits that is nearest is neither a tie nor the next power of ten."""
    if not 1e-4 < abs(value) < 100:
        return False
    power = math.floor(math.log10(abs(value)))
    scaled = abs(value) * 10.0 ** (digits - 1 - power)
    return abs(scaled % 1 - 0.5) > 1e-3 and scaled < 10.0**digits - 0.5


@given(
    st.lists(DOUBLES | st.integers(-999, 999).map(lambda n: n / 64), max_size=30),
    st.sampled_from([0, 1, 4, 6, 15, 22]),
    st.sampled_from([0, GridFlag.POINT_ZERO, GridFlag.NO_ZERO, GridFlag.PLUS, GridFlag.EXPONENT3]),
)
def test_a_matrix_is_printed_as_number_by_number(
    numbers: list[float], digits: int, flag: int
) -> None:
    grids = [Grid(GridKind.FIXED, digits)]
    if digits:
        grids.append(Grid(GridKind.TRIMMED, digits, flag & GridFlag(15)))
    if 1 <= digits <= 15:
        grids.append(Grid(GridKind.GENERAL, digits, flag))
    grids.append(Grid(GridKind.TEXT64))
    values = np.repeat(np.array([*numbers, -0.0, math.nan])[:, None], len(grids), axis=1)
    start, size = np.zeros((2, *values.shape), np.int64)
    text = print_values(values, grids, 7, start, size).tobytes()
    for column, grid in enumerate(grids):
        ordinals, _ = grid.ordinals(values[:, column])
        for row, expected in enumerate(grid.texts(ordinals)):
            first = start[row, column] - 7
            found = text[first : first + size[row, column]]
            assert found in (b"", expected)
            likely = -100 < values[row, column] < 100 and digits < 13 and grid.is_text
            easy = values[row, column] == 0 or _rounds_plainly(values[row, column], digits)
            assert found or not (likely and easy and grid.kind != GridKind.TEXT64)


def test_no_tokens_have_a_grid() -> None:
    """In a process of its own, where kernels are plain Python and no remainder by zero is 0."""
    code = "from mcz.model.numbers import scan; from mcz.model.numbers.choose import choose_grid; "
    code += "print(choose_grid(scan(b'', [], [])).kind.name)"
    plain = dict(os.environ, MCZ_LOOPS="interpreted")
    ran = subprocess.run([sys.executable, "-c", code], env=plain, capture_output=True, check=True)
    assert ran.stdout.split() == [b"FIXED"]


def test_plain_kernels_compute_as_silently_as_compiled_ones(tmp_path: Path) -> None:
    """In a process of its own; -0 is told from 0 by a division by zero."""
    (tmp_path / "zeros.csv").write_bytes(b"x,y\n-0.0,1\n0,2\n")
    code = "import mcz; mcz.encode('zeros.csv', 'zeros.mcz'); "
    code += "print(next(iter(mcz.open('zeros.mcz'))).source_bytes().decode(), end='')"
    plain = dict(os.environ, MCZ_LOOPS="interpreted", PYTHONPATH=str(PACKAGE.parent))
    command = [sys.executable, "-W", "error::RuntimeWarning", "-c", code]
    ran = subprocess.run(
        command, cwd=tmp_path, env=plain, capture_output=True, text=True, check=False
    )
    assert (ran.stdout, ran.stderr) == ("x,y\n-0.0,1\n0,2\n", "")
