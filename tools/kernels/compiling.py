"""Compile units: Python to Cython (``unit``), Cython to C, C to an extension module."""

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
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from pathlib import Path

from tools.kernels.source import ROOT
from tools.kernels.unit import Unit

HERE = Path(__file__).parent
SCRATCH = ROOT / "build" / "kernels"
UNITS: dict[str, tuple[str, ...]] = runpy.run_path(str(ROOT / "mcz/kernels/units.py"))["UNITS"]
DIRECTIVES = {
    "language_level": 3,
    "cdivision": True,
    "initializedcheck": False,
    "wraparound": False,
    "auto_pickle": False,
    "show_performance_hints": False,
}
# Wrapping integers and products that are not fused with sums are part of what SPEC.md says.
EXACT = ["-fwrapv", "-ffp-contract=off"]
FLAGS = {
    "compiled": ["-O3"],
    "checked": ["-O1", "-DMCZ_CHECKED"],
    "sanitized": ["-O1", "-g", "-DMCZ_CHECKED", "-fsanitize=address,undefined"],
}


def compiler() -> list[str] | None:
    """The command of a C compiler: that of ``CC``, one on the path, or Zig's, or None."""
    if given := os.environ.get("CC"):
        return shlex.split(given)
    for name in ("gcc", "clang", "cc"):
        if path := shutil.which(name):
            return [path]
    return [sys.executable, "-m", "ziglang", "cc"] if find_spec("ziglang") else None


def build(folder: Path, mode: str, units: Mapping[str, tuple[str, ...]] = UNITS) -> list[Path]:
    """Compile units into ``folder``, as many at a time as there are processors.

    ``units``: the modules of each, by its name.

    Raises CalledProcessError where a compiler fails, FileNotFoundError where there is none.
    """
    command = compiler()
    if command is None:
        raise FileNotFoundError("there is no C compiler")
    folder.mkdir(parents=True, exist_ok=True)
    arguments = [*command, *_flags(mode)]  # before there are threads: sysconfig is made for one
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        jobs = [pool.submit(_build_unit, u, units[u], folder, mode, arguments) for u in units]
        return [job.result() for job in jobs]


def _build_unit(
    name: str, modules: tuple[str, ...], folder: Path, mode: str, arguments: list[str]
) -> Path:
    """Compile one unit where its text or the compiler changed."""
    unit = Unit(modules, checked=mode != "compiled")
    text = unit.text()
    suffix = EXTENSION_SUFFIXES[0]
    identity = [_full_name(name, mode), text, suffix, *arguments, *_own_sources()]
    key = hashlib.sha256("\0".join(identity).encode())
    scratch = SCRATCH / key.hexdigest()[:32]
    made = scratch / (name + suffix)
    if not made.is_file():
        own = scratch / str(os.getpid())  # another process may build the same
        own.mkdir(parents=True, exist_ok=True)
        pyx = own / f"{name}.pyx"
        pyx.write_text(text)
        _run([sys.executable, "-m", "tools.kernels.compiling", str(pyx), mode, str(unit.axes)])
        c, part = pyx.with_suffix(".c"), own / made.name
        _run([*arguments, str(c), "-o", str(part), *_libraries()])
        part.replace(made)
    target = folder / made.name
    part = target.with_suffix(f".{os.getpid()}.part")
    shutil.copyfile(made, part)
    part.replace(target)  # a process may have the old one loaded
    return target


def _full_name(unit: str, mode: str) -> str:
    """The name of a module in Python: without its package it would take that of another's."""
    return f"mcz.kernels.{mode}.{unit}"


def _own_sources() -> list[str]:
    return [path.read_text() for path in sorted(HERE.glob("arithmetic.h"))]


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


def _run(command: list[str]) -> None:
    """Run a command; what it prints goes with the error of one that fails."""
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.stderr.write(done.stdout + done.stderr)
        done.check_returncode()


def translate(path: str, mode: str, axes: str) -> int:
    """Translate a module whose arrays have so many axes to C; the number of errors."""
    from Cython.Compiler import Options
    from Cython.Compiler.Main import CompilationOptions, compile

    Options.buffer_max_dims = int(axes) + 1  # of 8: memoryviews are copied into each call
    directives = {**DIRECTIVES, "boundscheck": mode != "compiled"}
    options = CompilationOptions(compiler_directives=directives)
    return int(compile(path, options, _full_name(Path(path).stem, mode)).num_errors)


if __name__ == "__main__":
    sys.exit(translate(*sys.argv[1:]) > 0)
