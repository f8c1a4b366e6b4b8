"""Kernels under AddressSanitizer and UBSan: ``python -m tools.fuzz --sanitized``.

They are compiled without bounds checks (``python -m tools.kernels sanitized``): a read or write
outside of memory ends the process, which counts as a finding. An index that leaves its row but not
its array only shows in checked kernels, which the fuzzers run otherwise.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from tools.kernels.compiling import compiler

MEMORY = 1536  # MiB of one allocation; a larger one is refused, as Python expects
SETTINGS = {
    "MCZ_LOOPS": "sanitized",
    "PYTHONMALLOC": "malloc",  # small objects have their own memory, with zones around it
    "ASAN_OPTIONS": f"detect_leaks=0:allocator_may_return_null=1:max_allocation_size_mb={MEMORY}"
    ":quarantine_size_mb=64",
    "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1",
}


def environment() -> dict[str, str]:
    """The environment of a Python that runs sanitized kernels.

    Raises FileNotFoundError where the C compiler has no sanitizers.
    """
    libraries = " ".join(str(_library(name)) for name in ("libasan.so", "libubsan.so"))
    return {**os.environ, **SETTINGS, "LD_PRELOAD": libraries}


def _library(name: str) -> Path:
    """A library of gcc's: Python itself is not linked with it, so that it is loaded before."""
    command = compiler() or ["gcc"]
    told = subprocess.run(
        [*command, f"-print-file-name={name}"], capture_output=True, text=True, check=True
    )
    path = Path(told.stdout.strip())
    if not path.is_absolute():
        raise FileNotFoundError(f"{command[0]} has no {name}")
    return path
