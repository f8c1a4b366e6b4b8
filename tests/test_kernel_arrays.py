"""The door of kernels: whatever arrays are given, the answer is that of clean ones, or an error."""

from __future__ import annotations

import math
import tempfile
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Channel, Joint, Motion, Signal, Skeleton
from tests.kernel_builds import MODES, sample

Array = np.ndarray
ERRORS = (TypeError, ValueError, OverflowError)
GUARD = 0xA5  # bytes around an array, which nothing writes


class Own(np.ndarray):
    """A subclass that has its own idea of nearly everything."""

    def __getitem__(self, key: Any) -> Any:
        raise AssertionError("a kernel looked into a subclass")

    def __array_finalize__(self, parent: Any) -> None:
        self.note = "own"


# How a clean array is laid out otherwise; each returns the array, and the memory that it is in.


def unaligned_copy(clean: Array) -> tuple[Array, Array]:
    memory = np.full(clean.nbytes + 17, GUARD, np.uint8)
    found = np.ndarray(clean.shape, clean.dtype, memory.data, offset=1)
    found[...] = clean
    return found, memory


def packed_copy(clean: Array) -> tuple[Array, Array]:
    record = np.dtype([("head", "u1"), ("values", clean.dtype), ("tail", "u2")])
    memory = np.full(clean.size * record.itemsize, GUARD, np.uint8)
    found = np.ndarray(clean.shape, record, memory.data)["values"]
    found[...] = clean
    return found, memory


def big_endian(clean: Array) -> tuple[Array, Array]:
    found = clean.astype(clean.dtype.newbyteorder(">"))
    return found, found.view(np.uint8).reshape(-1)


def fortran(clean: Array) -> tuple[Array, Array]:
    found = np.asfortranarray(clean)
    return found, found.T.view(np.uint8).reshape(-1)


def strided_copy(clean: Array) -> tuple[Array, Array]:
    rows, columns = clean.shape
    memory = np.full((rows * 3, columns * 2 * clean.itemsize), GUARD, np.uint8).view(clean.dtype)
    found = memory[1::3, ::2]
    found[...] = clean
    return found, memory.view(np.uint8).reshape(-1)


def backward(clean: Array) -> tuple[Array, Array]:
    memory = np.ascontiguousarray(clean[::-1, ::-1])
    return memory[::-1, ::-1], memory.view(np.uint8).reshape(-1)


def masked_copy(clean: Array) -> tuple[Array, Array]:
    memory = clean.copy()
    return np.ma.masked_array(memory, memory > 1), memory.view(np.uint8).reshape(-1)


def own(clean: Array) -> tuple[Array, Array]:
    memory = clean.copy()
    return memory.view(Own), memory.view(np.uint8).reshape(-1)


def mapped_copy(clean: Array) -> tuple[Array, Array]:
    with tempfile.TemporaryFile() as file:
        file.write(bytes(7) + clean.tobytes())
        file.flush()
        whole = np.memmap(file, np.uint8, "r+")
        found = np.ndarray(clean.shape, clean.dtype, whole, offset=7)
    return found, np.asarray(whole)


def transposed_copy(clean: Array) -> tuple[Array, Array]:
    memory = np.ascontiguousarray(clean.T)
    return memory.T, memory.view(np.uint8).reshape(-1)


LAYOUTS = (
    unaligned_copy,
    packed_copy,
    big_endian,
    fortran,
    strided_copy,
    backward,
    masked_copy,
    own,
    mapped_copy,
    transposed_copy,
)
SHAPES = st.tuples(st.integers(1, 4), st.integers(1, 4))
MODE = st.sampled_from(MODES)


@given(MODE, SHAPES, st.sampled_from(LAYOUTS), st.sampled_from(LAYOUTS), st.data())
def test_strange_arrays(
    mode: str,
    shape: tuple[int, int],
    of_values: Callable[[Array], tuple[Array, Array]],
    of_out: Callable[[Array], tuple[Array, Array]],
    data: st.DataObject,
) -> None:
    numbers = st.lists(st.floats(-9, 9), min_size=16, max_size=16)
    values = np.array(data.draw(numbers))[: math.prod(shape)].reshape(shape)
    start = np.array(data.draw(numbers))[: math.prod(shape)].reshape(shape)
    out = start.copy()
    total = sample("add", mode)(values, 0.5, out)
    assert (out == start + 0.5 * values).all()

    strange, memory = of_values(values)
    before = memory.tobytes()
    into, around = of_out(start)
    assert sample("add", mode)(strange, 0.5, into) == total
    assert memory.tobytes() == before
    assert around.tobytes() == of_out(out)[1].tobytes()  # and nothing beside it


@given(MODE, st.integers(0, 5), st.sampled_from(LAYOUTS), st.sampled_from(LAYOUTS))
def test_strange_columns(
    mode: str,
    n: int,
    of_values: Callable[[Array], tuple[Array, Array]],
    of_out: Callable[[Array], tuple[Array, Array]],
) -> None:
    values, _ = of_values(np.arange(3.0 * max(n, 1)).reshape(-1, 3))
    out, _ = of_out(np.ones((max(n, 1), 2)))
    sample("add_column", mode)(values.view(np.ndarray)[:n, 1], out.view(np.ndarray)[:n, 1])
    meant = np.ones((max(n, 1), 2))
    meant[:n, 1] += np.arange(n) * 3 + 1
    assert np.asarray(out).tolist() == meant.tolist()


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("shape", [(0, 0), (0, 3), (3, 0), (1, 1)])
def test_small_and_empty_arrays(shape: tuple[int, int], mode: str) -> None:
    values = np.ones((shape[0], 2 * shape[1]))[:, ::2]  # one column: NumPy calls it contiguous
    out = np.zeros((2 * shape[0], shape[1]), order="F")[::2]
    assert sample("add", mode)(values, 2.0, out) == 2.0 * math.prod(shape)
    assert (out == 2.0).all()


@pytest.mark.parametrize("mode", MODES)
def test_an_array_that_is_broadcast(mode: str) -> None:
    values = np.broadcast_to(np.array([1.0, 2.0]), (3, 2))
    out = np.zeros((3, 2))
    assert sample("add", mode)(values, 1.0, out) == 9.0
    assert out.tolist() == [[1.0, 2.0]] * 3
    alias = np.lib.stride_tricks.as_strided(np.zeros(2), (3, 2), (0, 8))  # rows are the same one
    sample("add", mode)(values, 1.0, alias)
    assert alias[0].tolist() == [1.0, 2.0]
    with pytest.raises(ValueError, match="read-only"):
        sample("add", mode)(out, 1.0, values)


def read_only() -> dict[str, Array]:
    clean = np.zeros((2, 2))
    clean.flags.writeable = False
    of_bytes = np.frombuffer(bytes(32), np.float64).reshape(2, 2)
    return {
        "flag": clean,
        "bytes": of_bytes,
        "unaligned": np.frombuffer(bytes(33), np.uint8)[1:].view(np.float64).reshape(2, 2),
        "big endian": np.frombuffer(bytes(32), ">f8").reshape(2, 2),
        "column": np.frombuffer(bytes(64)).reshape(2, 4)[:, ::2],
        "subclass": of_bytes.view(Own),
    }


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", read_only())
def test_no_kernel_writes_what_is_read_only(name: str, mode: str) -> None:
    array = read_only()[name]
    before = np.asarray(array).tobytes()
    with pytest.raises(ValueError, match="read-only"):
        sample("add", mode)(np.ones((2, 2)), 1.0, array)
    out = np.ones((2, 2))
    assert sample("add", mode)(array, 1.0, out) == 4.0
    assert np.asarray(array).tobytes() == before == bytes(32)


ROW = np.arange(5)
WRONG: list[Any] = [
    ROW.astype(np.int32),
    ROW.astype(np.uint64),
    ROW.astype(np.float64),
    ROW.astype(object),
    ROW.astype("M8[s]"),
    ROW.astype("S8"),
    ROW.view([("field", "<i8")]),
    ROW.reshape(1, 5),
    np.array(5),
    np.int64(5),
    5,
    1.5,
    None,
    "text",
    b"12345678",
    {1: 2},
    object(),
    [[1], [1, 2]],
    [0.5],
    2**64,
]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("given_row", WRONG, ids=lambda item: f"{type(item).__name__}")
def test_what_is_no_such_array(given_row: Any, mode: str) -> None:
    for name in ("item", "set_item"):
        with pytest.raises(ERRORS):
            sample(name, mode)(given_row, 0)
    assert ROW.tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("mode", MODES)
def test_lists_are_read_and_never_written(mode: str) -> None:
    row = [3, 4]
    assert sample("item", mode)(row, 1) == 4
    with pytest.raises(TypeError, match="list"):
        sample("set_item", mode)(row, 1)
    assert row == [3, 4]


@pytest.mark.parametrize("mode", MODES)
def test_flags_are_bytes_below(mode: str) -> None:
    marks = np.zeros((3, 2), bool)
    assert sample("store_flags", mode)(np.array([2, 1, 4]), marks[:, 1]) == (2, False)
    assert marks.tolist() == [[False, True], [False, False], [False, True]]
    with pytest.raises(TypeError):
        sample("store_flags", mode)(np.arange(3), np.zeros(3, np.uint8))


@pytest.mark.parametrize("mode", MODES)
def test_input_and_output_overlap(mode: str) -> None:
    memory = np.ones((5, 3))
    sample("add", mode)(memory[:-1], 1.0, memory[1:])  # one after the other, as the kernel goes
    assert memory[:, 0].tolist() == [1, 2, 3, 4, 5]
    turned = np.ones((3, 5)).T
    sample("add", mode)(turned[:-1], 1.0, turned[1:])  # copies
    assert turned[0].tolist() == [1.0] * 3
    assert (turned[1:] == 2).all()


@pytest.mark.parametrize("at", [5, -1, -6, 2**40, -(2**40), 2**63 - 1, -(2**63)])
def test_an_index_out_of_range(at: int) -> None:
    """Kernels that return a number, a tuple or nothing all raise."""
    row = np.arange(5)
    for name, array in (
        ("item", row),
        ("item_pair", np.zeros((2, 5), np.int64)),
        ("set_item", row),
    ):
        with pytest.raises(IndexError):
            sample(name, "checked")(array, at)
    assert row.tolist() == [0, 1, 2, 3, 4]
    assert sample("item", "checked")(row, 4) == 4


def test_an_index_out_of_range_in_several_threads() -> None:
    def outcome(at: int) -> int | str:
        try:
            return int(sample("item", "checked")(np.arange(5), at))
        except IndexError:
            return "IndexError"

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(outcome, [1, 7, 2**40, 4, -9] * 100))
    assert found == [1, "IndexError", "IndexError", 4, "IndexError"] * 100


@pytest.mark.parametrize("mode", MODES)
def test_a_kernel_in_several_threads(mode: str) -> None:
    def total(seed: int) -> float:
        out = np.zeros((50, 4)).T
        values = np.full((4, 50), float(seed))
        return float(sample("add", mode)(values, 1.0, out)) + sample("allocate", mode)(seed, 5)[0]

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(total, range(200))) == [201.0 * seed + 5 for seed in range(200)]


@pytest.mark.parametrize("mode", MODES)
def test_other_threads_run_beside_a_kernel(mode: str) -> None:
    """This thread sees a kernel in the middle of its work, which takes the lock of Python."""
    marks = np.zeros(4, np.int64)
    n, is_seen = 1_000_000, False
    while not is_seen and n < 10**9:
        marks[:] = 0
        thread = threading.Thread(target=sample("fill_long", mode), args=(marks, n))
        thread.start()
        while thread.is_alive():
            is_seen |= marks[0] == 1 and marks[3] == 0 and bool(marks[1] or marks[2])
        thread.join()
        n *= 4
    assert is_seen


def motion_of(values: Array) -> Motion:
    joint = Joint("hip", channels=tuple(map(Channel, ("tx", "ty", "rz"))))
    return Motion(Skeleton((joint,)), (Signal(values),), frame_rate=Fraction(60), name="clip")


def test_decoded_arrays_stay(tmp_path: Path) -> None:
    """Decoded arrays keep their numbers while more is decoded and buffers are freed."""
    path = tmp_path / "clip.mcz"
    mcz.write(motion_of(np.arange(300.0).reshape(100, 3)), path, codec="fast")
    first = mcz.read(path).values
    others = [mcz.read(path).values for _ in range(20)]
    for other in others:
        other.flags.writeable = True
        other[...] = -1.0
    del others
    assert first.tolist() == np.arange(300.0).reshape(100, 3).tolist()
