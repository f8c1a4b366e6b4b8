"""``mcz merge``: merge several .mcz files."""

from __future__ import annotations

import click

from mcz.cli.archive_summary import print_clip_results
from mcz.cli.common import Exit, about, existing
from mcz.cli.options import force_option, json_option
from mcz.cli.progress import Progress


@click.command(short_help="Merge several .mcz without re-encoding.")
@click.argument(
    "sources", metavar="IN.mcz...", nargs=-1, required=True, type=click.Path(readable=False)
)
@click.option("-o", "--output", metavar="OUT.mcz", required=True, help="Write to this file.")
@click.option(
    "--rename",
    is_flag=True,
    help="Put clips whose name is taken below the name of their file: day2/walk.",
)
@click.option(
    "--skip-identical", is_flag=True, help="Take content that two files share under one name once."
)
@force_option
@json_option
def command(
    sources: tuple[str, ...],
    output: str,
    rename: bool,
    skip_identical: bool,
    force: bool,
    as_json: bool,
) -> Exit:
    """Put all that the files hold into OUT.mcz; chunks are copied, what they share once.

    A name that two of them have is refused, unless --rename or --skip-identical says what becomes
    of it. Where all files have recovery data (mcz protect), OUT.mcz has its own.
    """
    import mcz

    for source in sources:
        existing(source)
    with about(output), Progress() as progress:
        report = mcz.merge(
            sources,
            output,
            rename=rename,
            skip_identical=skip_identical,
            force=force,
            progress=progress,
        )
    return print_clip_results(report, output, as_json, listed=("renamed",))
