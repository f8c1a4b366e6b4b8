"""Compiled kernels are modules of the package: they take no name of another's module."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from mcz.kernels.units import UNITS

SCRIPT = """
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
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    first, *loaded = done.stdout.split()
    assert first == "numbers"
    assert set(UNITS) & set(loaded) == {"numbers"}
