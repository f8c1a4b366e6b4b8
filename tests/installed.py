"""``python -m tests.installed PROGRAM [ARGUMENT ...]``: with what ``pip install mcz`` brings alone.

PROGRAM is ``mcz``, ``mcz-info`` or a file of Python. Packages that pyproject.toml does not require
are refused, installed or not.
"""

from __future__ import annotations

import re
import runpy
import sys
import tomllib
from pathlib import Path

from tests.bare import OWN, Only

PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"
MODULES = {"PyWavelets": "pywt"}  # packages whose module has another name


def required_modules() -> set[str]:
    """The modules that ``pip install mcz`` brings."""
    rows = tomllib.loads(PYPROJECT.read_text("utf-8"))["project"]["dependencies"]
    names = [re.match(r"[\w-]+", row)[0] for row in rows]  # type: ignore[index]
    return {MODULES.get(name, name) for name in names}


def main(program: str, *arguments: str) -> int:
    allowed = OWN | required_modules()
    sys.meta_path[:] = [Only(finder, allowed) for finder in sys.meta_path]
    if program not in ("mcz", "mcz-info"):
        runpy.run_path(program, run_name="__main__")
        return 0
    from mcz.cli.common import run
    from mcz.cli.info import info_command
    from mcz.cli.main import cli

    return run(cli if program == "mcz" else info_command, program, arguments)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
