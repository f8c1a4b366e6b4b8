"""Translate a module in Cython to C: ``translating.py FILE.pyx NAME MODE``.

In a process of its own, for Cython is one thread's. NAME is the module's in Python.
"""

from __future__ import annotations

import sys

from Cython.Compiler import Options
from Cython.Compiler.Main import CompilationOptions, compile

DIRECTIVES = {
    "language_level": 3,
    "cdivision": True,
    "initializedcheck": False,
    "wraparound": False,
    "auto_pickle": False,
    "show_performance_hints": False,
}


def translate(path: str, name: str, mode: str) -> int:
    """Write the C beside a module; the number of errors."""
    # Of 8: memoryviews are copied into each call. With as few as there are, `best` is slower.
    Options.buffer_max_dims = 5
    directives = {**DIRECTIVES, "boundscheck": mode == "checked"}
    options = CompilationOptions(compiler_directives=directives)
    return int(compile(path, options, name).num_errors)


if __name__ == "__main__":
    sys.exit(translate(*sys.argv[1:]) > 0)
