"""The choice of compiled kernels: only those built from the package's present sources."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import pytest

from mcz import kernels
from mcz.kernels import PACKAGE
from mcz.kernels.units import UNIT_OF, UNITS
from tests.kernel_builds import built_samples
from tools.kernels.compiling import build

MODE, UNIT = "checked", "best"
PROGRAM = """
import json, warnings
import numpy as np
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    from mcz.codecs.coding import mixing
    state = np.array([0, 0xFFFFFFFF, 0, 10, 0])
    sizes = [mixing.coded_size(state) for _ in range(3)]
    try:
        is_plain = mixing.coded_size(state.astype(np.float64)) == sizes[0]
    except TypeError:  # no kernel is compiled for these
        is_plain = False
print(json.dumps([is_plain, sizes, [str(warning.message) for warning in caught]]))
"""
SIZES = [6, 6, 6]


@dataclass
class Installation:
    """A copy of the package, of whose units one is compiled."""

    home: Path
    kernels: Path

    def run(self, **environment: str) -> tuple[bool, list[int], list[str]]:
        """Call a kernel: whether it is plain Python, what it returns, and what was warned of."""
        done = self.start(**environment)
        assert done.returncode == 0, done.stderr
        is_plain, sizes, warned = json.loads(done.stdout)
        return is_plain, sizes, warned

    def start(self, **environment: str) -> subprocess.CompletedProcess[str]:
        given = os.environ | {"PYTHONPATH": str(self.home), "MCZ_LOOPS": MODE} | environment
        command = [sys.executable, "-B", "-c", PROGRAM]
        return subprocess.run(
            command, cwd=self.home, env=given, capture_output=True, text=True, check=False
        )

    @property
    def module(self) -> Path:
        (path,) = self.kernels.glob(f"{UNIT}*")
        return path

    def edit(self, path: str, old: str, new: str) -> None:
        file = self.home / "mcz" / path
        text = file.read_text()
        assert text.count(old) == 1
        file.write_text(text.replace(old, new))


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("original")
    build(home / "mcz" / "kernels" / MODE, MODE, {UNIT: UNITS[UNIT]})
    ignored = shutil.ignore_patterns("compiled", "checked", "sanitized", "annex", "__pycache__")
    shutil.copytree(PACKAGE, home / "mcz", ignore=ignored, dirs_exist_ok=True)
    return home


@pytest.fixture
def installation(original: Path, tmp_path: Path) -> Installation:
    home = tmp_path / "home"
    shutil.copytree(original, home)
    return Installation(home, home / "mcz" / "kernels" / MODE)


def test_compiled_kernels_run_silently(installation: Installation) -> None:
    assert installation.run() == (False, SIZES, [])
    os.utime(installation.home / "mcz" / "codecs" / "coding" / "mixing.py", (2e9, 2e9))
    assert installation.run() == (False, SIZES, [])
    assert installation.run(MCZ_LOOPS="interpreted") == (True, SIZES, [])


def test_an_edited_kernel_is_never_run_stale(installation: Installation) -> None:
    path = "codecs/coding/mixing.py"
    old = "return int(state[POSITION] - 4 + last_bytes(state))"
    installation.edit(path, old, old[:-1] + " + 1000)")
    is_plain, sizes, (warned,) = installation.run()
    assert is_plain
    assert sizes == [1006, 1006, 1006]
    assert "50 to 500 times slower: mcz/codecs/coding/mixing.py is newer" in warned
    installation.edit(path, old[:-1] + " + 1000)", old)
    assert installation.run() == (False, SIZES, [])


def test_an_edited_constant_of_another_module_is_never_run_stale(
    installation: Installation,
) -> None:
    installation.edit("codecs/coding/mixing.py", "COUNT_LIMIT = 250 ", "COUNT_LIMIT = 251 ")
    is_plain, sizes, (warned,) = installation.run()
    assert (is_plain, sizes) == (True, SIZES)
    assert "mcz/codecs/coding/mixing.py is newer" in warned


DAMAGE = {
    "empty": lambda whole: b"",
    "garbage": lambda whole: b"\x90" * len(whole),
    "a head and garbage": lambda whole: whole[:64] + b"\x90" * 1000,
    "text": lambda whole: b"no module\n",
    **{f"cut to {k} of 8": lambda whole, k=k: whole[: len(whole) * k // 8] for k in range(1, 8)},
    "cut by a byte": lambda whole: whole[:-1],
    "another's": lambda whole: Path(built_samples()[MODE].__file__).read_bytes(),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_module_is_left_aside(installation: Installation, damage: str) -> None:
    whole = installation.module.read_bytes()
    installation.module.write_bytes(DAMAGE[damage](whole))
    is_plain, sizes, (warned,) = installation.run()
    assert (is_plain, sizes) == (True, SIZES)
    assert "50 to 500 times slower" in warned
    assert f"{installation.module.name} cannot be loaded" in warned


def test_without_compiled_kernels(installation: Installation) -> None:
    shutil.rmtree(installation.kernels)
    is_plain, sizes, (warned,) = installation.run()
    assert (is_plain, sizes) == (True, SIZES)
    assert "50 to 500 times slower: no compiled ones are installed" in warned


def test_machine_code_comes_from_the_package_alone(
    installation: Installation, tmp_path: Path
) -> None:
    """Sound modules lie wherever one might look, but for the package."""
    sound = tmp_path / "sound"
    installation.kernels.rename(sound)
    cache = tmp_path / "user" / ".cache"
    inside = Path("mcz", "kernels", MODE)
    for folder in (installation.home, tmp_path / "other" / inside, cache / inside, cache / "mcz"):
        shutil.copytree(sound, folder, dirs_exist_ok=True)
    paths = {
        "HOME": str(tmp_path / "user"),
        "XDG_CACHE_HOME": str(cache),
        "MCZ_CACHE_DIR": str(cache / "mcz"),
        "PYTHONPATH": os.pathsep.join([str(installation.home), str(tmp_path / "other")]),
    }
    is_plain, sizes, warned = installation.run(**paths)
    assert (is_plain, sizes, len(warned)) == (True, SIZES, 1)


def test_a_kernel_that_its_unit_lacks_runs_as_plain_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its module has another name since the unit was compiled."""

    def doubled(value: int) -> int:
        return 2 * value

    monkeypatch.setitem(UNIT_OF, __name__, UNIT)
    monkeypatch.setattr(kernels, "_unit", lambda name: (ModuleType(name), ""))
    with pytest.warns(RuntimeWarning, match="__doubled is newer than its compiled form"):
        assert kernels.compiled_form(doubled)(4) == 8


@pytest.mark.parametrize("word", ["fast", "Compiled", "checked/../compiled", "..", "/"])
def test_other_modes_are_refused(installation: Installation, word: str) -> None:
    done = installation.start(MCZ_LOOPS=word)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        f"ValueError: MCZ_LOOPS={word}: one of compiled, checked, sanitized, interpreted"
    )


def test_compiled_kernels_and_their_sources_agree() -> None:
    """On every kernel of the package, called as it calls them."""
    mode = MODE if kernels.MODE == kernels.INTERPRETED else kernels.MODE
    done = subprocess.run(
        [sys.executable, "-m", "tests.kernel_twins"],
        cwd=Path(__file__).parents[1],
        env=os.environ | {"MCZ_LOOPS": mode},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    compared, differences = json.loads(done.stdout)
    assert differences == []
    found = set()
    for module in UNIT_OF:
        path = PACKAGE.parent.joinpath(*module.split(".")).with_suffix(".py")
        names = re.findall(r"^@kernel\ndef (\w+)", path.read_text(), re.MULTILINE)
        found |= {f"{module}.{name}" for name in names}
    assert set(compared) == found, "kernels that nothing calls here, or that nothing calls at all"


def test_every_kernel_is_in_a_unit() -> None:
    found = set()
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text()
        if re.search(r"^@kernel$", text, re.MULTILINE):
            found.add(".".join(["mcz", *path.relative_to(PACKAGE).with_suffix("").parts]))
        other_spellings = re.findall(
            r"^ +@kernel|@\w+\.kernel\b|import kernel as", text, re.MULTILINE
        )
        assert other_spellings == [], path
    assert found == set(UNIT_OF)
    assert sum(map(len, UNITS.values())) == len(UNIT_OF), "a module is in two units"


THREADS = """
import sys, threading
from mcz.kernels import lacks_compiled_kernels

sys.setswitchinterval(1e-6)
start, found = threading.Barrier(16), []

def ask():
    start.wait()
    found.append(lacks_compiled_kernels())

threads = [threading.Thread(target=ask) for _ in range(16)]
for thread in threads: thread.start()
for thread in threads: thread.join()
print(found)
"""


def test_threads_load_a_compiled_module_once() -> None:
    """Whichever is first; another one that met a module half executed would fail."""
    done = subprocess.run(
        [sys.executable, "-c", THREADS], capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == (f"{[False] * 16}\n", "")


NAMES = """
import sys
import mcz.kernels
mcz.kernels.lacks_compiled_kernels()
import numbers
print(numbers.Integral.__module__, *sys.modules)
"""


@pytest.mark.parametrize("seed", ["1", "3"])  # of the order in which they are loaded
def test_names_of_compiled_modules(seed: str) -> None:
    """``numbers`` stays that of Python, and ``import fast`` finds no kernels."""
    environment = {**os.environ, "PYTHONHASHSEED": seed}
    command = [sys.executable, "-c", NAMES]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    first, *loaded = done.stdout.split()
    assert first == "numbers"
    assert set(UNITS) & set(loaded) == {"numbers"}
