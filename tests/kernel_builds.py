"""The kernels of ``kernel_samples``, compiled once."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from mcz.kernels import load_unit
from tools.kernels.compiling import build

MODES = "compiled", "checked"
UNIT = {"samples": ("tests.kernel_samples",)}


@cache
def built_samples() -> dict[str, Any]:
    """The module of each of ``MODES``."""
    folder = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    modules = {}
    for mode in MODES:
        build(folder / mode, mode, UNIT)
        modules[mode], fault = load_unit(folder / mode, "samples")
        assert not fault
    return modules


def sample(name: str, mode: str) -> Callable[..., Any]:
    """A kernel of ``kernel_samples`` as it is compiled."""
    found: Callable[..., Any] = getattr(built_samples()[mode], f"call_tests_kernel_samples__{name}")
    return found
