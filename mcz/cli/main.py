"""``mcz``: the table of commands; each is loaded when it is called."""

from __future__ import annotations

import os
import sys

import click

from mcz.cli.common import EXIT_CODES, run
from mcz.cli.lazy import lazy_group
from mcz.cli.options import version_option

COMMANDS = (
    "sample",
    "encode",
    "decode",
    "convert",
    "info",
    "verify",
    "bag",
    "protect",
    "repair",
    "pack",
    "append",
    "merge",
    "unpack",
    "export",
    "list",
    "meta",
    "delete",
    "rename",
    "reorder",
    "split",
    "extract",
    "replace",
    "diff",
    "view",
    "render",
    "plot",
    "stream",
    "bench",
    "train",
    "codecs",
    "completion",
)


@click.command(
    cls=lazy_group("mcz.cli.", COMMANDS),
    help="Motion capture files (BVH, ASF, AMC, C3D, TRC, MOT, STO), compressed and given back byte "
    "for byte.\n\n"
    "Every command has its own --help. Nothing is overwritten without --force.",
    epilog=EXIT_CODES,
)
@version_option
def cli() -> None:
    pass


def main() -> None:
    for library in ("OMP", "OPENBLAS", "MKL"):  # sums in one order, however many cores there are
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    sys.exit(run(cli, "mcz"))


if __name__ == "__main__":
    main()
