"""Compile units: Python to Cython (``unit``), to C (``translating``), to an extension module."""

from __future__ import annotations

import hashlib
import os
import platform
import runpy
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from pathlib import Path

import Cython

from tools.kernels.source import ROOT
from tools.kernels.unit import Unit

HERE = Path(__file__).parent
KEPT = ROOT / "build" / "kernels"
SUFFIX = EXTENSION_SUFFIXES[0]
UNITS: dict[str, tuple[str, ...]] = runpy.run_path(str(ROOT / "mcz/kernels/units.py"))["UNITS"]
# Wrapping integers and products that are not fused with sums are part of what SPEC.md says.
EXACT = ["-fwrapv", "-ffp-contract=off"]
SANITIZERS = "address,undefined,float-cast-overflow"
FLAGS = {
    "compiled": ["-O3", "-g0"],  # Zig would add 4 times as much of what debuggers want
    "checked": ["-O1", "-DMCZ_CHECKED"],
    "sanitized": ["-O1", "-g", f"-fsanitize={SANITIZERS}"],  # unchecked: they see what is left
}


def compiler() -> list[str] | None:
    """The command of a C compiler: that of ``CC``, one on the path that works, Zig's, or None."""
    if given := os.environ.get("CC"):
        return shlex.split(given)
    for name in ("gcc", "clang", "cc"):
        if (path := shutil.which(name)) and _works([path]):
            return [path]
    return [sys.executable, "-m", "ziglang", "cc"] if find_spec("ziglang") else None


def _works(command: list[str]) -> bool:
    """True if a compiler has headers and a linker; some systems lack one of them."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "try.c").write_text("#include <math.h>\ndouble f(double a){return sin(a);}\n")
        words = [*command, "-shared", "-fPIC", "try.c", "-o", "try.so", "-lm"]
        done = subprocess.run(words, cwd=folder, capture_output=True, check=False)
        return done.returncode == 0


def has_headers() -> bool:
    """True if Python's headers are installed; Debian packages them separately."""
    return Path(sysconfig.get_path("include"), "Python.h").is_file()


def build(
    folder: Path, mode: str, units: Mapping[str, tuple[str, ...]] = UNITS, kept: Path = KEPT
) -> list[Path]:
    """Compile units into ``folder``, as many at a time as there are processors.

    ``units``: the modules of each, by its name. ``kept``: the folder of earlier builds, which are
    copied where nothing has changed.

    Raises CalledProcessError where a compiler fails, FileNotFoundError where there is none.
    """
    command = compiler()
    if command is None:
        raise FileNotFoundError("there is no C compiler")
    if not has_headers():
        raise FileNotFoundError("there is no Python.h")
    arguments = [*command, *_flags(mode)]
    version = _run([*command, "--version"], ROOT).partition("\n")[0]
    folder.mkdir(parents=True, exist_ok=True)
    # One after the other: a module that another thread is importing is not yet whole.
    texts = {
        name: Unit(modules, checked=mode == "checked").text() for name, modules in units.items()
    }

    def build_unit(name: str) -> Path:
        text = texts[name]
        full = f"mcz.kernels.{mode}.{name}"  # other packages have a "numbers"
        made = kept / _key(full, text, version) / (name + SUFFIX)
        if not made.is_file():
            _compile(text, made, [full, mode], arguments)
        part = folder / f"{made.name}.{os.getpid()}.part"
        shutil.copyfile(made, part)
        part.replace(folder / made.name)  # a process may have the old one loaded
        return folder / made.name

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(build_unit, units))


def _key(*given: str) -> str:
    """A name for everything that an extension module depends on."""
    parts = [*given, SUFFIX, Cython.__version__, (HERE / "arithmetic.h").read_text()]
    parts += [(HERE / f"{name}.py").read_text() for name in ("compiling", "translating")]
    parts.append(sysconfig.get_path("include"))
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def _compile(text: str, made: Path, wanted: list[str], arguments: list[str]) -> None:
    """Compile a module in Cython, in a folder of its own: others may build the same."""
    made.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=made.parent) as folder:
        own = Path(folder)
        name = made.name.removesuffix(SUFFIX)
        (own / f"{name}.pyx").write_text(text)
        _run([sys.executable, str(HERE / "translating.py"), f"{name}.pyx", *wanted], own)
        _run([*arguments, f"{name}.c", "-o", made.name, *_libraries()], own)
        (own / made.name).replace(made)


def _flags(mode: str) -> list[str]:
    link = ["-bundle", "-undefined", "dynamic_lookup"] if sys.platform == "darwin" else ["-shared"]
    position = [] if sys.platform == "win32" else ["-fPIC"]
    # As NumPy has it since 2.4: with it rounding a float is one instruction.
    processor = ["-msse4.2"] if platform.machine() in ("x86_64", "AMD64") else []
    includes = [f"-I{HERE}", f"-I{sysconfig.get_path('include')}"]
    return [*link, *position, *processor, *EXACT, *FLAGS[mode], "-DNDEBUG", "-w", *includes]


def _libraries() -> list[str]:
    if sys.platform != "win32":
        return ["-lm"]
    number = f"{sys.version_info.major}{sys.version_info.minor}"
    return [f"-L{Path(sys.base_prefix, 'libs')}", f"-lpython{number}"]


def _run(command: list[str], folder: Path) -> str:
    """The output of a command; that of one that fails goes with the error."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.stderr.write(done.stdout + done.stderr)
        done.check_returncode()
    return done.stdout
