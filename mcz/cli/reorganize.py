"""``mcz delete``, ``rename``, ``reorder``, ``split`` and ``merge``: clips without re-encoding."""

from __future__ import annotations

import click

from mcz.cli.archive_summary import print_clip_results
from mcz.cli.common import Exit, Failure, about, existing
from mcz.cli.options import force_option, json_option, output_option, where_option
from mcz.cli.terminal import Progress


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
def delete_command(
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
            file, names, where=where, aliases=aliases, output=output, force=force, progress=progress
        )
    return print_clip_results(report, output or file, as_json, listed=("deleted",))


@click.command(short_help="Rename clips of an .mcz.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.argument("names", metavar="OLD NEW...", nargs=-1, required=True)
@output_option
@force_option
@json_option
def rename_command(
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
def reorder_command(
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


@click.command(short_help="Split an .mcz into several by a key.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.argument("folder", metavar="DIR", type=click.Path(readable=False))
@click.option(
    "--by",
    metavar="KEY",
    default="folder",
    show_default=True,
    help="Split by a field or metadata key, such as subject; folder is the first part of the "
    "names.",
)
@click.option(
    "--rest",
    metavar="NAME",
    help="Put attachments and clips without KEY into this file. Default: refuse them.",
)
@force_option
@json_option
def split_command(
    file: str, folder: str, by: str, rest: str | None, force: bool, as_json: bool
) -> Exit:
    """Write DIR/VALUE.mcz for each value of KEY that clips of FILE.mcz have, with these clips.

    Chunks are copied, with the skeletons and templates that they need; FILE.mcz stays as it is.
    """
    import mcz

    existing(file)
    with about(file), Progress() as progress:
        report = mcz.split(file, folder, by=by, rest=rest, force=force, progress=progress)
    return print_clip_results(report, folder, as_json, listed=("written",))


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
def merge_command(
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
