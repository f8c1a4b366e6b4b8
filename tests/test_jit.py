"""Compiled loops: they compute what Python computes, and machine code is never of other sources."""

from __future__ import annotations

import importlib.util
import itertools
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcz import jit
from mcz.jit import calling, store
from mcz.jit.calling import Kernel
from mcz.jit.types import INT, Array, LoopError

HEAD = """
from __future__ import annotations
import math
import numpy as np
from mcz.jit import inner, kernel
"""
LONGS = st.integers(-(2**63), 2**63 - 1)
FLOATS = st.floats(width=64)
NUMBERS = itertools.count()

Load = Callable[..., ModuleType]


@pytest.fixture(scope="module")
def load(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Load]:
    """Makes a module of loops from text."""
    folder = tmp_path_factory.mktemp("loops")
    names = []

    def make(text: str, name: str = "") -> ModuleType:
        name = name or f"loops_{next(NUMBERS)}"
        names.append(name)
        path = folder / f"{name}.py"
        path.write_text(HEAD + text)
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
        return module

    yield make
    for name in names:
        sys.modules.pop(name, None)


@pytest.fixture(autouse=True)
def compiled(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Loops are compiled, even where all others are interpreted, and kept apart."""
    monkeypatch.setattr(jit, "MODE", jit.COMPILED)
    monkeypatch.setenv("MCZ_CACHE_DIR", str(tmp_path / "cache"))


@pytest.fixture(scope="module")
def integers(load: Load) -> ModuleType:
    jit.MODE = jit.COMPILED
    return load("""
@kernel
def divide(a: int, b: int) -> int:
    return a // b

@kernel
def rest(a: int, b: int) -> int:
    return a % b

@kernel
def by_eight(a: int) -> tuple[int, int]:
    return a // 8, a % 8

@kernel
def by_seven(a: int) -> tuple[int, int]:
    return a // 7, a % -7

@kernel
def shifted(a: int, b: int) -> tuple[int, int]:
    return a >> b, (a & 0xFFFF) << b

@kernel
def least(a: int, b: int, c: int) -> tuple[int, int, int]:
    return min(a, b, c), max(a, b, c), abs(b >> 1)

@kernel
def chosen(a: int, b: int) -> int:
    if a < b <= 10 or not (a == 3 and b != 4):
        return 1 if a > b else 2 if a == b else 3
    return 4
""")


@given(LONGS, LONGS)
def test_division_rounds_down(integers: ModuleType, a: int, b: int) -> None:
    if b not in (0, -1):
        assert integers.divide(a, b) == a // b
    if b:
        assert integers.rest(a, b) == a % b
    assert integers.by_eight(a) == (a // 8, a % 8)
    assert integers.by_seven(a) == (a // 7, a % -7)


@pytest.mark.parametrize("a", [0, 5, -5, 2**63 - 1, -(2**63)])
def test_no_division_stops_the_process(integers: ModuleType, a: int) -> None:
    assert integers.divide(a, 0) == integers.rest(a, 0) == integers.rest(a, -1) == 0
    assert integers.divide(a, -1) == (-a if a > -(2**63) else a)


@given(LONGS, st.integers(0, 40))
def test_shifts(integers: ModuleType, a: int, b: int) -> None:
    assert integers.shifted(a, b) == (a >> b, (a & 0xFFFF) << b)


@given(LONGS, LONGS, LONGS)
def test_least_and_greatest(integers: ModuleType, a: int, b: int, c: int) -> None:
    assert integers.least(a, b, c) == (min(a, b, c), max(a, b, c), abs(b >> 1))


@given(st.integers(-5, 15), st.integers(-5, 15))
def test_conditions(integers: ModuleType, a: int, b: int) -> None:
    assert integers.chosen(a, b) == integers.chosen.loop(a, b)


@pytest.fixture(scope="module")
def floats(load: Load) -> ModuleType:
    jit.MODE = jit.COMPILED
    return load("""
@kernel
def computed(a: float, b: float) -> tuple[float, float, float, float]:
    return a * b + a, a - b / 3, (a + b) ** 2, -a

@kernel
def rounded(a: float) -> tuple[float, float, float]:
    return np.floor(a), np.rint(a), abs(a)

@kernel
def ordered(a: float, b: float) -> tuple[int, int, int, float, float]:
    return (
        1 if a < b else 0, 1 if not a <= b else 0, 1 if a != b else 0, min(a, b), max(a, b),
    )

@kernel
def scaled(a: float, power: int) -> float:
    return math.ldexp(a, power)
""")


def same(found: Any, meant: Any) -> bool:
    pairs = zip(np.atleast_1d(found), np.atleast_1d(meant), strict=True)
    return all(
        np.float64(a).tobytes() == np.float64(b).tobytes() or (a != a and b != b) for a, b in pairs
    )


@given(FLOATS, FLOATS)
def test_floats_are_neither_fused_nor_reordered(floats: ModuleType, a: float, b: float) -> None:
    with np.errstate(all="ignore"):
        x, y = np.float64(a), np.float64(b)
        assert same(floats.computed(a, b), (x * y + x, x - y / 3, (x + y) * (x + y), -x))
        assert same(floats.rounded(a), (np.floor(x), np.rint(x), abs(x)))
    assert same(floats.ordered(a, b), floats.ordered.loop(a, b))


@pytest.fixture(scope="module")
def lengths(load: Load) -> ModuleType:
    jit.MODE = jit.COMPILED
    return load("""
from mcz.jit import bit_length, inlined, truncated

@inlined
def both(size: int, number: float) -> tuple[int, int]:
    return bit_length(size), truncated(number)

@kernel
def lengths(size: int, number: float) -> tuple[int, int]:
    n, whole = both(size, number)
    return n, whole
""")


@given(st.integers(0, 2**63 - 1), st.floats(-(2.0**62), 2.0**62))
def test_lengths_and_whole_parts(lengths: ModuleType, size: int, number: float) -> None:
    assert lengths.lengths(size, number) == (size.bit_length(), int(number))


@given(st.floats(-16, 16), st.integers(-60, 60))
def test_powers_of_two_are_exact(floats: ModuleType, a: float, power: int) -> None:
    assert floats.scaled(a, power) == math.ldexp(a, power)


ARRAYS = """
@inner
def row_sum(row: object, least: int) -> tuple[int, bool]:
    total = 0
    for value in row:
        if value == 99:
            break
        if value < least:
            continue
        total += value
    return total, total > 10

@kernel
def work(grid: object, out: object, marks: object) -> int:
    n_rows, n = grid.shape
    spare = np.zeros((n_rows, 2), np.int64)
    for r in range(n_rows - 1, -1, -1):
        total, is_large = row_sum(grid[r], -3)
        spare[r] = spare[r, 1] = total
        marks[r] = is_large
        out[r, :2] = spare[r]
        out[r, 2:n] = 7
        out[r, -1] += grid[r, -2] if n > 1 else -1
        k = 0
        while k < n and grid[r, k] != 5:
            k += 1
        for step in (1, -1):
            out[r, 0] = 2 * out[r, 0] + step * k
    column, last = grid[:, 1], out[n_rows - 1]
    last[0] += len(column) + row_sum(column[1:], 0)[0]
    return spare[0, 0]
"""


@pytest.fixture(scope="module")
def arrays(load: Load) -> ModuleType:
    jit.MODE = jit.COMPILED
    return load(ARRAYS)


@given(st.integers(1, 5), st.integers(2, 6), st.data())
def test_arrays(arrays: ModuleType, n_rows: int, n: int, data: st.DataObject) -> None:
    values = st.lists(st.sampled_from([-9, -2, 0, 3, 5, 8, 99]), min_size=n, max_size=n)
    grid = np.array(data.draw(st.lists(values, min_size=n_rows, max_size=n_rows)), np.int64)
    spaced = np.zeros((n_rows, 2 * n), np.int64)[:, ::2]  # not contiguous
    spaced[:] = grid
    answers = []
    for given_grid, call in ((grid, arrays.work.loop), (grid, arrays.work), (spaced, arrays.work)):
        out, marks = np.zeros_like(grid), np.zeros(n_rows, bool)
        answers.append((call(given_grid, out, marks), out.tolist(), marks.tolist()))
    assert answers[0] == answers[1] == answers[2]


@pytest.mark.parametrize(
    ("body", "complaint"),
    [
        ("    x = 1\n    x = 0.5\n", "one type"),
        ("    return [a]\n", "List is not compiled"),
        ("    return print(a)\n", "cannot be called"),
        ("    for _ in range(3):\n        x = np.zeros(3)\n", "in front of loops"),
        ("    return a or 3\n", "is not bool"),
        ("    return unknown\n", "no number"),
        ("    try:\n        pass\n    finally:\n        pass\n", "Try is not compiled"),
    ],
)
def test_what_is_not_compiled_is_refused_by_its_line(load: Load, body: str, complaint: str) -> None:
    module = load(f"@kernel\ndef refused(a: int) -> int:\n{body}")
    with pytest.raises(LoopError, match=complaint) as caught:
        module.refused(1)
    assert "refused, line" in caught.value.__notes__[0]


def test_arguments_that_do_not_fit(integers: ModuleType) -> None:
    with pytest.raises(TypeError, match="takes 2 arguments"):
        integers.divide(1)
    with pytest.raises(TypeError):
        integers.divide(1.5, 2)
    with pytest.raises(OverflowError):
        integers.divide(2**63, 2)
    with pytest.raises(TypeError, match="no arrays of float32"):
        integers.divide(np.zeros(3, np.float32), 1)


def test_checked_loops_name_the_line(load: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "@kernel\ndef item(row: object, at: int) -> int:\n    row[at] += 1\n    return row[at]\n"
    monkeypatch.setattr(jit, "MODE", jit.CHECKED)
    module, row = load(text), np.arange(5)
    assert [module.item(row, at) for at in (0, 4, -5)] == [1, 5, 2]
    for at in (5, -6, 2**40):
        with pytest.raises(IndexError, match="line 8"):
            module.item(row, at)
    assert row.tolist() == [2, 1, 2, 3, 5]


def test_interpreted_loops_are_plain_functions(load: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit, "MODE", jit.INTERPRETED)
    module = load("@kernel\ndef double(a: int) -> int:\n    return 2 * a\n")
    assert not isinstance(module.double, Kernel)
    assert module.double(2**70) == 2**71


def test_without_a_compiler_loops_are_interpreted(
    load: Load, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = load("@kernel\ndef double(a: int) -> int:\n    return 2 * a\n")
    monkeypatch.setitem(sys.modules, "llvmlite.binding", None)
    calling.missing_compiler.cache_clear()
    calling._warn.cache_clear()
    try:
        with pytest.warns(RuntimeWarning, match="plain Python") as said:
            assert (module.double(21), module.double(22)) == (42, 44)
        assert len(said) == 1
        assert jit.lacks_compiler()
    finally:
        calling.missing_compiler.cache_clear()
        calling._warn.cache_clear()


# What is kept.

TWICE = "@kernel\ndef scaled(a: int) -> int:\n    return FACTOR * a\n"


def name_of(loop: Any, *types: Any) -> str:
    return calling._name_of(loop.loop, types or (INT,), False)


def test_names_say_all_that_code_depends_on(load: Load) -> None:
    one = load("FACTOR = 2\n" + TWICE)
    names = [name_of(one.scaled), name_of(one.scaled, Array("int64", 1))]
    names += [name_of(load(text + TWICE).scaled) for text in ("FACTOR = 3\n", "FACTOR = 2 \n")]
    assert len(set(names)) == 4
    assert name_of(one.scaled) == names[0]


def test_names_follow_numbers_and_loops_of_other_modules(load: Load) -> None:
    names = []
    for place, other in enumerate(("FACTOR = 2", "FACTOR = 5")):
        home = f"loops_other_{place}"
        load(other + "\n", home)
        by_name = load(f"from {home} import FACTOR\n{TWICE}")
        assert by_name.scaled(3) == 3 * by_name.FACTOR
        names.append(name_of(by_name.scaled).split("-")[1])
    deep = "@inner\ndef deep(a: int) -> int:\n    return a + {}\n"
    for place in range(2):
        home = f"loops_deep_{place}"
        load(deep.format(place), home)
        text = f"from {home} import deep\n@kernel\ndef outer(a: int) -> int:\n    return deep(a)\n"
        module = load(text)
        assert module.outer(3) == 3 + place
        names.append(name_of(module.outer).split("-")[1])
    assert len(set(names)) == 4


PROGRAM = "import looped; print(looped.scaled(21))"


def run(folder: Path, cache: Path, **more: str) -> subprocess.Popen[str]:
    environment = os.environ | {"MCZ_CACHE_DIR": str(cache), "MCZ_LOOPS": ""} | more
    paths = [str(folder), str(Path(__file__).parents[1])]
    environment["PYTHONPATH"] = os.pathsep.join([*paths, os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-B", "-c", PROGRAM]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)


def answer(folder: Path, cache: Path, **more: str) -> int:
    process = run(folder, cache, **more)
    shown, _ = process.communicate()
    assert process.returncode == 0
    return int(shown)


def test_an_edit_is_seen_at_once_even_within_a_tick_of_the_clock(tmp_path: Path) -> None:
    source, cache = tmp_path / "looped.py", tmp_path / "cache"
    for factor in (2, 3, 2):
        source.write_text(f"{HEAD}FACTOR = {factor}\n{TWICE}")
        os.utime(source, (1_000_000_000, 1_000_000_000))
        assert answer(tmp_path, cache) == 21 * factor
        assert answer(tmp_path, cache) == 21 * factor
    assert len(list(cache.iterdir())) == 2


@pytest.mark.parametrize("damage", ["cut", "flip", "empty", "other"])
def test_damaged_files_are_made_anew(tmp_path: Path, damage: str) -> None:
    (tmp_path / "looped.py").write_text(f"{HEAD}FACTOR = 2\n{TWICE}")
    cache = tmp_path / "cache"
    assert answer(tmp_path, cache) == 42
    (file,) = cache.iterdir()
    whole = bytearray(file.read_bytes())
    damaged = bytearray(whole)
    damaged[len(whole) // 2] ^= 1
    contents = {"cut": whole[:-9], "flip": damaged, "empty": b"", "other": b"x" * 100}
    file.write_bytes(contents[damage])
    assert answer(tmp_path, cache) == 42
    assert file.read_bytes() == whole


def test_processes_at_once(tmp_path: Path) -> None:
    (tmp_path / "looped.py").write_text(f"{HEAD}FACTOR = 2\n{TWICE}")
    running = [run(tmp_path, tmp_path / "cache") for _ in range(4)]
    assert [process.communicate()[0].strip() for process in running] == ["42"] * 4
    (file,) = (tmp_path / "cache").iterdir()
    assert file.name.startswith("scaled-")


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "looped.py").write_text(f"{HEAD}FACTOR = 2\n{TWICE}")
    file = tmp_path / "file"
    file.write_text("no folder")
    assert answer(tmp_path, file) == 42
    assert answer(tmp_path, file / "below") == 42


def test_interpreted_nothing_is_kept(tmp_path: Path) -> None:
    (tmp_path / "looped.py").write_text(f"{HEAD}FACTOR = 2\n{TWICE}")
    assert answer(tmp_path, tmp_path / "cache", MCZ_LOOPS="interpreted") == 42
    assert not (tmp_path / "cache").exists()


def test_the_store_without_a_home(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless(*_: object) -> Path:
        raise RuntimeError

    monkeypatch.delenv("MCZ_CACHE_DIR")
    monkeypatch.setattr(Path, "home", homeless)
    store.save("name", b"code")
    assert store.load("name") is None


def test_a_compiler_that_finds_no_memory_is_no_reason_to_run_for_minutes() -> None:
    """As under ``ulimit -v``: the library of LLVM cannot be mapped."""
    code = (
        "import resource, sys, numpy as np\n"
        "from mcz.transforms import lsdt_kernels\n"
        "from mcz.jit import calling\n"
        "used = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (used + 2**25, resource.RLIM_INFINITY))\n"
        "try:\n"
        "    calling._has_compiler()\n"
        "except MemoryError as error:\n"
        "    print(error)\n"
    )
    if not Path("/proc/self/statm").exists():
        pytest.skip("no limit of memory that could be set")
    environment = {**os.environ, "MCZ_LOOPS": "compiled"}
    shown = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, env=environment
    )
    assert shown.stdout == "the compiler of loops cannot be loaded\n"
