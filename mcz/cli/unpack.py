"""``mcz unpack``: every source file out of an .mcz file."""

from __future__ import annotations

import click

from mcz.cli.archive_summary import print_file_results
from mcz.cli.common import Exit, about, existing
from mcz.cli.damage_hint import hinted
from mcz.cli.options import (
    clips_option,
    decoded_option,
    force_option,
    jobs_option,
    json_option,
    salvage_option,
    threads_option,
    where_option,
)
from mcz.cli.progress import Progress


@click.command(short_help="Restore every source file of an .mcz.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.argument("folder", metavar="DIR", type=click.Path(readable=False))
@clips_option
@where_option
@salvage_option
@click.option(
    "--names",
    type=click.Choice(("stored", "portable", "strict")),
    default="stored",
    show_default=True,
    help=(
        "Treat names that some systems cannot hold, or not beside another: write "
        "them as stored if this system can, write portable ones instead, or refuse "
        "them."
    ),
)
@click.option("--mtimes", is_flag=True, help="Set files to the time in their clips' metadata.")
@decoded_option
@force_option
@threads_option
@jobs_option
@json_option
def command(
    file: str,
    folder: str,
    clips: tuple[str, ...],
    where: str | None,
    names: str,
    mtimes: bool,
    salvage: bool,
    max_decoded: int | None,
    force: bool,
    as_json: bool,
) -> Exit:
    """Write every source file and attachment of FILE.mcz below DIR, under the path it had.

    With --clip or --where those of the clips alone, with their skeletons. No link that lies in DIR
    is followed, and no file replaces another of FILE.mcz. With --salvage those of a damaged file
    that are whole are written; each is checked as in a sound one.
    """
    import mcz

    existing(file)
    with about(file), hinted(file, {"salvage": salvage}), Progress() as progress:
        report = mcz.unpack(
            file,
            folder,
            clips=clips or None,
            where=where,
            salvage=salvage,
            force=force,
            names=names,
            mtimes=mtimes,
            max_decoded=max_decoded,
            progress=progress,
        )
    return print_file_results(report, folder, as_json)
