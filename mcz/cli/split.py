"""``mcz split``: split an .mcz into several."""

from __future__ import annotations

import click

from mcz.cli.archive_summary import print_clip_results
from mcz.cli.common import Exit, about, existing
from mcz.cli.options import force_option, json_option
from mcz.cli.progress import Progress


@click.command(short_help="Split an .mcz into several by a key.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.argument("folder", metavar="DIR", type=click.Path(readable=False))
@click.option(
    "--by",
    metavar="KEY",
    default="folder",
    show_default=True,
    help=(
        "Split by a field or metadata key, such as subject; folder is the first part of the names."
    ),
)
@click.option(
    "--rest",
    metavar="NAME",
    help=("Put attachments and clips without KEY into this file. Default: refuse them."),
)
@force_option
@json_option
def command(file: str, folder: str, by: str, rest: str | None, force: bool, as_json: bool) -> Exit:
    """Write DIR/VALUE.mcz for each value of KEY that clips of FILE.mcz have, with these clips.

    Chunks are copied, with the skeletons and templates that they need; FILE.mcz stays as it is.
    """
    import mcz

    existing(file)
    with about(file), Progress() as progress:
        report = mcz.split(file, folder, by=by, rest=rest, force=force, progress=progress)
    return print_clip_results(report, folder, as_json, listed=("written",))
