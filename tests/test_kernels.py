"""Compiled kernels compute what their source computes as plain Python."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import kernel_samples
from tests.kernel_builds import MODES, sample
from tools.kernels import source
from tools.kernels.annotations import KernelError
from tools.kernels.unit import Unit

LEAST, MOST = -(2**63), 2**63 - 1
EDGES = [LEAST, LEAST + 1, -(2**32), -2, -1, 0, 1, 2, 2**31, 2**40 - 1, MOST - 1, MOST]
LONGS = st.integers(LEAST, MOST) | st.sampled_from(EDGES)
FLOATS = st.floats() | st.sampled_from([0.0, -0.0, math.nan, math.inf, -math.inf, 1e300, 2.0**63])
SMALL = st.integers(-5, 15)


def wrap_integers(answer: Any) -> Any:
    """Integers as 64 bits hold them."""
    if isinstance(answer, tuple):
        return tuple(map(wrap_integers, answer))
    if type(answer) is int:
        return (answer - LEAST) % 2**64 + LEAST
    return answer


def bits(answer: Any) -> Any:
    """Comparable form of an answer: numbers by their bits, with all NaNs equal."""
    if isinstance(answer, tuple):
        return tuple(map(bits, answer))
    if isinstance(answer, np.ndarray):
        return answer.dtype, answer.shape, answer.tobytes()
    if isinstance(answer, float):
        return "nan" if answer != answer else float(answer).hex()
    return answer if answer is None else int(answer)


def agree(name: str, *arguments: Any) -> Any:
    """The answer of a sample, which is the same compiled and as plain Python."""
    plain = getattr(kernel_samples, name)
    own = [np.copy(a) if isinstance(a, np.ndarray) else a for a in arguments]
    with np.errstate(all="ignore"):
        answer = wrap_integers(plain(*own))
    for mode in MODES:
        theirs = [np.copy(a) if isinstance(a, np.ndarray) else a for a in arguments]
        found = sample(name, mode)(*theirs)
        assert bits(found) == bits(answer), (name, mode, found, answer)
        for one, other in zip(own, theirs, strict=True):
            if isinstance(one, np.ndarray):
                assert bits(one) == bits(other), (name, mode)
    return answer


@given(LONGS, LONGS)
def test_integers_wrap_around(a: int, b: int) -> None:
    agree("arithmetic", a, b)
    agree("bits", a, b)


@given(LONGS, LONGS)
def test_division_rounds_down(a: int, b: int) -> None:
    if b:
        agree("divide", a, b)
        agree("remainder", a, b)
    agree("by_constants", a)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("a", EDGES)
def test_no_division_stops_the_process(a: int, mode: str) -> None:
    divide, remainder = sample("divide", mode), sample("remainder", mode)
    assert divide(a, 0) == remainder(a, 0) == remainder(a, -1) == 0
    assert divide(a, -1) == (-a if a > LEAST else a)


@given(LONGS, st.integers(0, 63))
def test_shifts(a: int, n: int) -> None:
    agree("shifts", a, n)


@given(LONGS, LONGS, LONGS)
def test_least_and_greatest(a: int, b: int, c: int) -> None:
    agree("extremes", a, b, c)
    agree("length_of", max(a, 0))


@given(st.binary(min_size=24, max_size=24), st.integers(0, 16), st.integers(0, 16))
def test_eight_bytes(data: bytes, at: int, to: int) -> None:
    agree("move_bytes", np.frombuffer(data, np.uint8), at, to)


@given(LONGS | SMALL, LONGS | SMALL, LONGS | SMALL)
def test_comparisons(a: int, b: int, c: int) -> None:
    agree("compare", a, b, c)
    agree("choose", a, b)


@given(LONGS, FLOATS, st.booleans())
def test_truth(a: int, x: float, flag: bool) -> None:
    agree("is_true", a, x, flag)
    agree("mix", a, x, flag)


@given(FLOATS, FLOATS, FLOATS)
def test_floats_are_neither_fused_nor_reordered(a: float, b: float, c: float) -> None:
    agree("compute", np.float64(a), np.float64(b))
    agree("round_off", np.float64(a))
    agree("order", a, b, c)
    agree("float_extremes", a, b, c)


@given(st.floats(-16, 16), st.integers(-60, 60))
def test_powers_of_two_are_exact(a: float, power: int) -> None:
    agree("scale", a, power)


@given(FLOATS)
def test_floats_become_the_nearest_integers(a: float) -> None:
    meant = 0 if a != a else LEAST if a < LEAST else MOST if a >= 2.0**63 else int(a)
    for mode in MODES:
        assert sample("to_integer", mode)(a) == meant
    if abs(a) < 2.0**63:
        agree("to_integer_in_range", a)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("pair", [(1,), (1, 2.0, 3), (1.5, 2.0), ("1", 2.0), (1, "2"), None, 5])
def test_tuples_that_do_not_fit(pair: Any, mode: str) -> None:
    with pytest.raises((TypeError, ValueError)):
        sample("pair_sum", mode)(pair)


@pytest.mark.parametrize("at", [-1, 4, 2**40, LEAST])
def test_an_index_out_of_a_table(at: int) -> None:
    with pytest.raises(IndexError):
        sample("table", "checked")(at)


@given(st.integers(0, 9), st.integers(0, 4), st.integers(0, 4))
def test_lengths_are_signed(n: int, n_rows: int, n_columns: int) -> None:
    agree("lengths", np.zeros(n, np.int64), np.zeros((n_rows, n_columns)))


@given(st.integers(0, 6), st.integers(-9, 9) | LONGS, st.integers(-9, 9) | LONGS)
def test_slices(n: int, start: int, stop: int) -> None:
    agree("slices", np.arange(1, n + 1), start, stop)


@given(st.lists(st.integers(0, 255), max_size=9))
def test_bytes(values: list[int]) -> None:
    table = np.zeros((2, 3), np.uint8)
    agree("store_bytes", np.array(values, np.int64), np.zeros(len(values), np.uint8), table)


@given(st.lists(LONGS, max_size=9))
def test_flags_are_zero_or_one(values: list[int]) -> None:
    agree("store_flags", np.array(values, np.int64), np.zeros(len(values), bool))


@given(st.integers(0, 9), st.integers(0, 9))
def test_allocations(n: int, m: int) -> None:
    agree("allocate", n, m)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    "sizes", [(-1, 1), (1, -1), (2**62, 1), (2**40, 2**40), (MOST, MOST), (LEAST, LEAST)]
)
def test_allocations_that_fail(sizes: tuple[int, int], mode: str) -> None:
    with pytest.raises((MemoryError, ValueError)):
        sample("allocate", mode)(*sizes)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("name", "arguments", "fault"),
    [
        ("divide", (1,), TypeError),
        ("divide", (1, 2, 3), TypeError),
        ("divide", (2**63, 1), OverflowError),
        ("divide", (1, -(2**63) - 1), OverflowError),
        ("divide", (2**64, 1), OverflowError),
        ("divide", (1.5, 2), TypeError),
        ("divide", (math.nan, 2), TypeError),
        ("divide", (np.float64(2), 2), TypeError),
        ("divide", ("1", 2), TypeError),
        ("divide", (None, 2), TypeError),
        ("scale", (10**400, 1), OverflowError),
        ("scale", (1j, 1), TypeError),
        ("scale", ("1", 1), TypeError),
        ("scale", (None, 1), TypeError),
    ],
)
def test_numbers_that_do_not_fit(
    name: str, arguments: tuple[Any, ...], fault: type[Exception], mode: str
) -> None:
    with pytest.raises(fault):
        sample(name, mode)(*arguments)


@pytest.mark.parametrize("mode", MODES)
def test_numbers_of_numpy(mode: str) -> None:
    assert sample("divide", mode)(np.int64(7), np.uint8(2)) == 3
    assert sample("divide", mode)(True, np.int8(-1)) == -1
    assert sample("scale", mode)(np.float32(0.5), np.int32(2)) == 2.0


HEAD = "from mcz.kernels import kernel\nfrom mcz.kernels.types import Floats, Ints\n"
Refuse = Callable[[str], pytest.ExceptionInfo[KernelError]]


@pytest.fixture
def refuse(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Refuse:
    """Translates a module of this text, which fails."""
    monkeypatch.setattr(source, "ROOT", tmp_path)

    def refuse(text: str) -> pytest.ExceptionInfo[KernelError]:
        path = tmp_path / f"refused_{len(list(tmp_path.iterdir()))}.py"
        path.write_text(HEAD + text)
        source.source.cache_clear()
        with pytest.raises(KernelError) as caught:
            Unit((path.stem,), checked=False)
        return caught

    return refuse


@pytest.mark.parametrize(
    ("body", "complaint"),
    [
        ("x = 1\n    x = 0.5", "is float, not int"),
        ("x = a < 3\n    x = a", "is int, not bool"),
        ("return 0.5", "is float, not int"),
        ("return [a]", "is not compiled"),
        ("return print(a)", "cannot be called"),
        ("return a or 3", "is no bool"),
        ("return unknown", "is no number here"),
        ("return row[-1]", "an index counts from the front"),
        ("return row[0:4:2][0]", "slices have no steps"),
        ("return row", "not int"),
        ("for i in range(0, 9, a):\n        pass", "the step of a range is a constant"),
        ("return 2 ** a", "is float, not int"),
        ("return a / 2", "is float, not int"),
        ("try:\n        pass\n    finally:\n        pass", "is not compiled"),
        ("return step(row) - step(row)", "C leaves open"),
        ("return step(row) < step(row)", "C leaves open"),
        ("return less(step(row), step(row))", "C leaves open"),
        ("row[step(row)] = step(row)", "C leaves open"),
        ("row[step(row)] += 1", "C leaves open"),
        ("row[0] = a < 3 or step(row)", "is no bool"),
        ("x = nothing()\n    x = a", "is int, not None"),
    ],
)
def test_what_is_not_compiled_is_refused_with_its_line(
    refuse: Refuse, body: str, complaint: str
) -> None:
    caught = refuse(
        f"@kernel\ndef refused(a: int, row: Ints) -> int:\n    {body}\n"
        "def step(row: Ints) -> int:\n    row[0] += 1\n    return row[0]\n"
        "def nothing() -> None:\n    pass\n"
        "def less(a: int, b: int) -> int:\n    return a - b\n"
    )
    caught.match(complaint)
    caught.match(r"refused_0\.py:[5-7]: ")


@pytest.mark.parametrize(
    "head",
    [
        "(row: Ints) -> Ints",
        "(row) -> int",
        "(row: Ints)",
        "(row: list) -> int",
        "(row: Ints) -> list",
    ],
)
def test_types_that_kernels_do_not_have(refuse: Refuse, head: str) -> None:
    """No kernel returns an array: none can return memory that is gone."""
    refuse(f"@kernel\ndef refused{head}:\n    return row\n")
