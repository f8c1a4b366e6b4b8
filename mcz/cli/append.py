"""``mcz append``: add files, folders or archives to an .mcz file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from mcz.cli.archive_summary import print_file_results
from mcz.cli.common import Exit, Failure, about, existing
from mcz.cli.options import (
    check_force_rate,
    copies_option,
    encoding_options,
    force_rate_option,
    jobs_option,
    json_option,
    rate_option,
    skeleton_option,
    threads_option,
)
from mcz.cli.progress import Progress
from mcz.model.types import Settings


@click.command(short_help="Add files to an .mcz.")
@click.argument(
    "sources", metavar="SRC...", nargs=-1, required=True, type=click.Path(readable=False)
)
@click.argument("target", metavar="FILE.mcz", type=click.Path(readable=False))
@skeleton_option("The ASF of the AMCs, or none.")
@click.option(
    "--root",
    metavar="DIR",
    type=click.Path(readable=False),
    help="Store paths relative to DIR. Default: names without folders.",
)
@click.option(
    "--salvage", is_flag=True, help="Keep whole clips at the end of a file that was cut short."
)
@click.option(
    "--force", is_flag=True, help="Drop whole clips at the end of a file that was cut short."
)
@click.option(
    "--rename",
    is_flag=True,
    help="Put clips of an .mcz whose name is taken below the name of their file.",
)
@click.option(
    "--skip-identical",
    is_flag=True,
    help="Skip clips of an .mcz that are here already, the same under the same name.",
)
@click.option(
    "--replace",
    is_flag=True,
    help="Replace a file of the same path; rewrites FILE.mcz.",
)
@copies_option("where the file has some")
@encoding_options
@rate_option()
@force_rate_option
@threads_option
@jobs_option
@json_option
def command(
    sources: tuple[str, ...],
    target: str,
    skeleton: str | None,
    root: str | None,
    salvage: bool,
    force: bool,
    rename: bool,
    skip_identical: bool,
    replace: bool,
    copies: bool | None,
    as_json: bool,
    **options: Any,
) -> Exit:
    """Append SRC... to FILE.mcz; when one of them cannot be added, none is.

    SRC is a motion file, a folder of such files, or an .mcz, of which all is carried over as it is.

    What the file held stays readable at every moment, even if the computer stops in between. After
    that, the next append takes the file up from its last end; whole clips behind it are named, and
    --salvage or --force must say what becomes of them.
    """
    import mcz

    for path in (*sources, target):
        if path == target or not Path(path).is_dir():
            existing(path)
    check_force_rate(options)
    if salvage and force:
        raise Failure("--salvage keeps what --force drops; choose one", Exit.USAGE)
    if "-" in sources:
        raise Failure("append reads files, not standard input", Exit.USAGE)
    with about(target), Progress() as progress:
        report = mcz.append(
            sources,
            target,
            skeleton=skeleton,
            root=root,
            salvage=salvage,
            force=force,
            rename=rename,
            skip_identical=skip_identical,
            replace=replace,
            copies=copies,
            progress=progress,
            **_known(options),
        )
    return print_file_results(report, target, as_json)


def _known(options: Settings) -> Settings:
    """Without --profile: the file's own profile stays."""
    return {key: value for key, value in options.items() if key != "profile"}
