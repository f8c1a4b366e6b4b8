"""``mcz delete``, ``rename``, ``reorder``, ``split`` and ``merge``: clips without re-encoding."""

from __future__ import annotations

import click

from mcz.cli import shared_options
from mcz.cli.archive_summary import print_clip_results
from mcz.cli.common import Exit, Failure, errors_about, require_file
from mcz.cli.terminal import Progress


@click.command(short_help="Delete clips from an .mcz, and all their bytes.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.argument("names", metavar="[NAME]...", nargs=-1)
@shared_options.where
@click.option(
    "--aliases", is_flag=True, help="Also delete aliases of the same content. Default: refuse."
)
@shared_options.output
@shared_options.force
@shared_options.json
def delete_command(
    file: str,
    names: tuple[str, ...],
    where: str | None,
    aliases: bool,
    output: str | None,
    force: bool,
    as_json: bool,
) -> Exit:
    """Delete clips, attachments or aliases from FILE.mcz, and what no other clip needs.

    The new file contains none of their bytes: values, skeletons, templates, models, metadata. Other
    copies of FILE.mcz, and remains of the old file on the disk or in a backup, are not affected.
    """
    import mcz

    if not names and where is None:
        raise Failure("name what to delete, or use --where", Exit.USAGE)
    with errors_about(file), Progress() as progress:
        report = mcz.delete_clips(
            file, names, where=where, aliases=aliases, output=output, force=force, progress=progress
        )
    return print_clip_results(report, output or file, as_json, listed=("deleted",))


@click.command(short_help="Rename clips of an .mcz.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.argument("names", metavar="OLD NEW...", nargs=-1, required=True)
@shared_options.output
@shared_options.force
@shared_options.json
def rename_command(
    file: str, names: tuple[str, ...], output: str | None, force: bool, as_json: bool
) -> Exit:
    """Rename the clip, attachment or alias OLD to NEW; more pairs may follow.

    Names may be swapped. A source with the name of its clip is renamed too, and unpack writes it
    under the new name.
    """
    import mcz

    if len(names) % 2:
        raise Failure("give pairs: the old name and the new one", Exit.USAGE)
    pairs = dict(zip(names[::2], names[1::2], strict=True))
    if len(pairs) < len(names) // 2:
        raise Failure("an old name occurs twice", Exit.USAGE)
    with errors_about(file), Progress() as progress:
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
@shared_options.output
@shared_options.force
@shared_options.json
def reorder_command(
    file: str,
    names: tuple[str, ...],
    by: str | None,
    output: str | None,
    force: bool,
    as_json: bool,
) -> Exit:
    """Put the named clips first, then the others in their order, or sorted --by KEY.

    KEY is a field or a metadata key, see docs/reference/queries.md.
    """
    import mcz

    if not names and by is None:
        raise Failure("name the clips that come first, or use --by", Exit.USAGE)
    with errors_about(file), Progress() as progress:
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
@shared_options.force
@shared_options.json
def split_command(
    file: str, folder: str, by: str, rest: str | None, force: bool, as_json: bool
) -> Exit:
    """Write one DIR/VALUE.mcz for each value of KEY, with its clips.

    Chunks are copied without re-encoding; FILE.mcz does not change.
    """
    import mcz

    require_file(file)
    with errors_about(file), Progress() as progress:
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
    help="If the name of a clip is already used, prefix it with the name of its file: day2/walk.",
)
@click.option(
    "--skip-identical",
    is_flag=True,
    help="Copy content that two files share under one name only once.",
)
@shared_options.force
@shared_options.json
def merge_command(
    sources: tuple[str, ...],
    output: str,
    rename: bool,
    skip_identical: bool,
    force: bool,
    as_json: bool,
) -> Exit:
    """Join files into OUT.mcz. Chunks are copied without re-encoding, shared ones once.

    Equal names are refused, unless --rename or --skip-identical is given. If all files have
    recovery data (mcz protect), so has OUT.mcz.
    """
    import mcz

    for source in sources:
        require_file(source)
    with errors_about(output), Progress() as progress:
        report = mcz.merge(
            sources,
            output,
            rename=rename,
            skip_identical=skip_identical,
            force=force,
            progress=progress,
        )
    return print_clip_results(report, output, as_json, listed=("renamed",))
