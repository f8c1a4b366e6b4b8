"""``mcz pack``: a folder of motion files to one .mcz file."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mcz.cli.archive_summary import print_file_results
from mcz.cli.common import Exit, Failure, about
from mcz.cli.options import (
    check_force_rate,
    copies_option,
    encoding_options,
    force_option,
    force_rate_option,
    jobs_option,
    json_option,
    rate_option,
    threads_option,
)
from mcz.cli.progress import Progress
from mcz.cli.suffixes import file_in

if TYPE_CHECKING:
    from mcz.files.editing.batch_report import Report


@click.command(short_help="Pack a folder of motion files into one .mcz.")
@click.argument("folder", metavar="DIR", type=click.Path(readable=False))
@click.argument("target", metavar="OUT.mcz", type=click.Path(readable=False))
@encoding_options
@rate_option()
@force_rate_option
@click.option("--keep-all", is_flag=True, help="Keep files of other kinds too, as attachments.")
@click.option(
    "--scheduler",
    metavar="tcp://HOST:PORT",
    help=("Read and encode on the machines of this Dask scheduler; DIR and OUT.mcz may be URLs."),
)
@click.option(
    "--mtimes",
    is_flag=True,
    help="Keep the time of last change of each file; unpack --mtimes sets it.",
)
@copies_option("yes")
@force_option
@threads_option
@jobs_option
@json_option
def command(
    folder: str,
    target: str,
    keep_all: bool,
    scheduler: str | None,
    mtimes: bool,
    copies: bool | None,
    force: bool,
    as_json: bool,
    **options: Any,
) -> Exit:
    """Pack every motion file below DIR into OUT.mcz, skeletons that are shared only once.

    A file that cannot be parsed is left out, listed at the end, and makes the exit code 1;
    --verbatim keeps it as an attachment instead.
    """
    check_force_rate(options)
    if scheduler is not None and mtimes:
        raise Failure("--mtimes are not kept with --scheduler", Exit.USAGE)
    if "://" not in folder:
        if Path(folder).is_file():
            raise Failure(f"is a file: mcz encode {shlex.quote(folder)}", Exit.USAGE, path=folder)
        target = file_in(target, str(Path(folder).resolve()) + ".mcz")
    if mtimes:
        options["mtimes"] = True
    with about(folder), Progress() as progress:
        report = _packing(scheduler)(
            folder,
            target,
            keep_all=keep_all,
            copies=copies is not False,
            force=force,
            progress=progress,
            **options,
        )
    return print_file_results(report, target, as_json)


def _packing(scheduler: str | None) -> Callable[..., Report]:
    """The ``pack`` function: local, or on a Dask scheduler."""
    if scheduler is None:
        from mcz.files.editing.archive import pack

        return pack
    from mcz.files.dask import pack as pack_there

    return partial(pack_there, client=scheduler)
