"""``mcz rename``: rename clips, attachments and aliases."""

from __future__ import annotations

import click

from mcz.cli.archive_summary import print_clip_results
from mcz.cli.common import Exit, Failure, about
from mcz.cli.options import force_option, json_option, output_option
from mcz.cli.progress import Progress


@click.command(short_help="Rename clips of an .mcz.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.argument("names", metavar="OLD NEW...", nargs=-1, required=True)
@output_option
@force_option
@json_option
def command(
    file: str, names: tuple[str, ...], output: str | None, force: bool, as_json: bool
) -> Exit:
    """Call the clip, attachment or alias OLD of FILE.mcz NEW; pairs may be repeated, and swap.

    The source of a clip, where it was called like the clip, follows, so that unpack gives it under
    the new name.
    """
    import mcz

    if len(names) % 2:
        raise Failure("give pairs: the old name and the new one", Exit.USAGE)
    pairs = dict(zip(names[::2], names[1::2], strict=True))
    if len(pairs) < len(names) // 2:
        raise Failure("one old name is given twice", Exit.USAGE)
    with about(file), Progress() as progress:
        report = mcz.rename_clips(file, pairs, output=output, force=force, progress=progress)
    return print_clip_results(report, output or file, as_json, listed=("renamed",))
