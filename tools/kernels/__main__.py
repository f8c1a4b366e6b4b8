"""Build kernels in place, for a checkout: ``python -m tools.kernels [MODE] [UNIT ...]``."""

from __future__ import annotations

import argparse

from tools.kernels.compiling import FLAGS, UNITS, build
from tools.kernels.source import ROOT


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.kernels", description=__doc__)
    parser.add_argument("mode", nargs="?", choices=FLAGS, default="compiled")
    parser.add_argument("units", nargs="*", metavar="unit", help=", ".join(UNITS))
    given = parser.parse_args()
    units = {name: UNITS[name] for name in given.units or UNITS}
    for path in build(ROOT / "mcz" / "kernels" / given.mode, given.mode, units):
        print(path.relative_to(ROOT))


if __name__ == "__main__":
    main()
