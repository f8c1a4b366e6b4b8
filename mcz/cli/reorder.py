"""``mcz reorder``: reorder the clips of an .mcz."""

from __future__ import annotations

import click

from mcz.cli.archive_summary import print_clip_results
from mcz.cli.common import Exit, Failure, about
from mcz.cli.options import force_option, json_option, output_option
from mcz.cli.progress import Progress


@click.command(short_help="Reorder the clips of an .mcz.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.argument("names", metavar="[NAME]...", nargs=-1)
@click.option(
    "--by",
    metavar="KEY",
    help="Sort by a field or metadata key, -KEY: descending; take2 comes before take10.",
)
@output_option
@force_option
@json_option
def command(
    file: str,
    names: tuple[str, ...],
    by: str | None,
    output: str | None,
    force: bool,
    as_json: bool,
) -> Exit:
    """Put the clips NAME first, then the others: as they were, or sorted --by KEY.

    What is sorted by is a field or a metadata key, as in docs/reference/queries.md.
    """
    import mcz

    if not names and by is None:
        raise Failure("name the clips that come first, or say --by", Exit.USAGE)
    with about(file), Progress() as progress:
        report = mcz.reorder_clips(
            file, names, by=by, output=output, force=force, progress=progress
        )
    return print_clip_results(report, output or file, as_json, listed=())
