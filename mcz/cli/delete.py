"""``mcz delete``: delete clips from an .mcz, and all their bytes."""

from __future__ import annotations

import click

from mcz.cli.archive_summary import print_clip_results
from mcz.cli.common import Exit, Failure, about
from mcz.cli.options import force_option, json_option, output_option, where_option
from mcz.cli.progress import Progress


@click.command(short_help="Delete clips from an .mcz, and all their bytes.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.argument("names", metavar="[NAME]...", nargs=-1)
@where_option
@click.option(
    "--aliases", is_flag=True, help="Also delete further names of the same content, else refused."
)
@output_option
@force_option
@json_option
def command(
    file: str,
    names: tuple[str, ...],
    where: str | None,
    aliases: bool,
    output: str | None,
    force: bool,
    as_json: bool,
) -> Exit:
    """Take clips, attachments or aliases out of FILE.mcz, and what only they needed.

    Their bytes are in no part of the new file: neither their skeletons, templates and models nor
    what was said of them, unless another clip has the same. Other copies of FILE.mcz, and what the
    disk or a backup keeps of the old one, are not touched.
    """
    import mcz

    if not names and where is None:
        raise Failure("name what to delete, or say --where", Exit.USAGE)
    with about(file), Progress() as progress:
        report = mcz.delete_clips(
            file,
            names,
            where=where,
            aliases=aliases,
            output=output,
            force=force,
            progress=progress,
        )
    return print_clip_results(report, output or file, as_json, listed=("deleted",))
