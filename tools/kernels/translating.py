"""Translate a module in Cython to C: ``translating.py FILE.pyx NAME MODE``.

In a process of its own, for Cython is one thread's. NAME is the module's in Python.
"""

from __future__ import annotations

import sys
from pathlib import Path

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
    errors = int(compile(path, options, name).num_errors)
    if not errors:
        file = Path(path).with_suffix(".c")
        file.write_text(without_counts(file.read_text()))
    return errors


def without_counts(text: str) -> str:
    """C in which slices of arrays are counted only where ``mcz_counts`` is true.

    Cython counts each slice up and down, atomically, which can take longer than what a kernel does
    with it. Should another version of Cython count in another way, ``text`` stays as it is: slower.
    """
    changed = text
    for name in ("INC", "XCLEAR"):
        macro = f"#define __PYX_{name}_MEMVIEW(slice, have_gil) "
        call = f"__Pyx_{name}_MEMVIEW(slice, have_gil, __LINE__)"
        if text.count(f"{macro}{call}\n") != 1:
            return text
        guarded = f"(__pyx_v_mcz_counts ? {call} : (void)0)"
        changed = changed.replace(f"{macro}{call}\n", f"{macro}{guarded}\n")
    return changed


if __name__ == "__main__":
    sys.exit(translate(*sys.argv[1:]) > 0)
