"""``mcz pack``, ``append``, ``unpack`` and ``export``: many motion files into an .mcz, and back."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mcz.cli import shared_options
from mcz.cli.archive_summary import print_file_results
from mcz.cli.common import Exit, Failure, add_salvage_hint, errors_about, require_file
from mcz.cli.outputs import TARGETS, resolve_output
from mcz.cli.shared_options import check_force_rate
from mcz.cli.terminal import Progress

if TYPE_CHECKING:
    from mcz.files.editing import Report


@click.command(short_help="Pack a folder of motion files into one .mcz.")
@click.argument("folder", metavar="DIR", type=click.Path(readable=False))
@click.argument("target", metavar="OUT.mcz", type=click.Path(readable=False))
@shared_options.encoding
@shared_options.rate()
@shared_options.force_rate
@click.option("--keep-all", is_flag=True, help="Keep files of other kinds too, as attachments.")
@click.option(
    "--scheduler",
    metavar="tcp://HOST:PORT",
    help="Read and encode on the machines of this Dask scheduler; DIR and OUT.mcz may be URLs.",
)
@click.option(
    "--mtimes",
    is_flag=True,
    help="Keep the modification time of each file; unpack --mtimes restores it.",
)
@shared_options.copies("yes")
@shared_options.force
@shared_options.threads
@shared_options.jobs
@shared_options.json
def pack_command(
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
    """Pack every motion file below DIR into OUT.mcz; shared skeletons are stored once.

    A file that cannot be parsed is left out and listed at the end, and the exit code is 1.
    --verbatim keeps it as an attachment instead.
    """
    check_force_rate(options)
    if scheduler is not None and mtimes:
        raise Failure("--mtimes and --scheduler exclude each other", Exit.USAGE)
    if "://" not in folder:
        if Path(folder).is_file():
            raise Failure(
                f"it is a file, not a folder; use mcz encode {shlex.quote(folder)}",
                Exit.USAGE,
                path=folder,
            )
        target = resolve_output(target, str(Path(folder).resolve()) + ".mcz")
    if mtimes:
        options["mtimes"] = True
    with errors_about(folder), Progress() as progress:
        report = _pack_function(scheduler)(
            folder,
            target,
            keep_all=keep_all,
            copies=copies is not False,
            force=force,
            progress=progress,
            **options,
        )
    return print_file_results(report, target, as_json)


def _pack_function(scheduler: str | None) -> Callable[..., Report]:
    """The ``pack`` function: local, or on a Dask scheduler."""
    if scheduler is None:
        from mcz.files.editing.archive import pack

        return pack
    from mcz.files.dask import pack as pack_there

    return partial(pack_there, client=scheduler)


@click.command(short_help="Add files to an .mcz.")
@click.argument(
    "sources", metavar="SRC...", nargs=-1, required=True, type=click.Path(readable=False)
)
@click.argument("target", metavar="FILE.mcz", type=click.Path(readable=False))
@shared_options.skeleton("Use this ASF for the AMCs; none: read them without one.")
@click.option(
    "--root",
    metavar="DIR",
    type=click.Path(readable=False),
    help="Store paths relative to DIR. Default: names without folders.",
)
@click.option(
    "--salvage",
    is_flag=True,
    help="Keep complete clips behind the last valid end of an interrupted file.",
)
@click.option(
    "--force",
    is_flag=True,
    help="Drop complete clips behind the last valid end of an interrupted file.",
)
@click.option(
    "--rename",
    is_flag=True,
    help="If the name of a clip of an .mcz is already used, prefix it with the name of its file: "
    "day2/walk.",
)
@click.option(
    "--skip-identical",
    is_flag=True,
    help="Skip clips of an .mcz that FILE.mcz already has, identical and under the same name.",
)
@click.option("--replace", is_flag=True, help="Replace a file of the same path; rewrites FILE.mcz.")
@shared_options.copies("yes if the file has copies")
@shared_options.encoding
@shared_options.rate()
@shared_options.force_rate
@shared_options.threads
@shared_options.jobs
@shared_options.json
def append_command(
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
    """Append SRC... to FILE.mcz, all or none.

    SRC is a motion file, a folder of motion files, or an .mcz, whose contents are copied unchanged.

    The existing contents stay readable at every moment, even after a crash. The next append then
    continues from the last valid end. If complete clips lie behind it, choose --salvage to keep
    them or --force to drop them.
    """
    import mcz

    for path in (*sources, target):
        if path == target or not Path(path).is_dir():
            require_file(path)
    check_force_rate(options)
    if salvage and force:
        raise Failure(
            "--salvage and --force exclude each other: one keeps what the other drops", Exit.USAGE
        )
    if "-" in sources:
        raise Failure("append reads files, not standard input", Exit.USAGE)
    with errors_about(target), Progress() as progress:
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
            **{key: value for key, value in options.items() if key != "profile"},
        )
    return print_file_results(report, target, as_json)


@click.command(short_help="Restore every source file of an .mcz.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.argument("folder", metavar="DIR", type=click.Path(readable=False))
@shared_options.clips
@shared_options.where
@shared_options.salvage
@click.option(
    "--names",
    type=click.Choice(("stored", "portable", "strict")),
    default="stored",
    show_default=True,
    help="Handle names that some systems cannot store: write them as stored if possible, write "
    "portable names, or refuse them (strict).",
)
@click.option(
    "--mtimes", is_flag=True, help="Restore the modification times that pack --mtimes kept."
)
@shared_options.max_decoded
@shared_options.force
@shared_options.threads
@shared_options.jobs
@shared_options.json
def unpack_command(
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
    """Write every source file and attachment of FILE.mcz below DIR, under its original path.

    --clip and --where write only the files of those clips and of their skeletons. --salvage writes
    the intact files of a damaged FILE.mcz; each is verified. Links in DIR are not followed, and no
    file replaces another of FILE.mcz.
    """
    import mcz

    require_file(file)
    with errors_about(file), add_salvage_hint(file, {"salvage": salvage}), Progress() as progress:
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


@click.command(short_help="Write every clip in another format: NPZ, CSV, BVH, C3D, GLB, BIDS, ...")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.argument("folder", metavar="DIR", type=click.Path(readable=False))
@click.option(
    "--to",
    "target",
    type=click.Choice((*TARGETS, "bids")),
    required=True,
    help="Set the format; bids makes a data set of Motion-BIDS.",
)
@shared_options.clips
@shared_options.where
@shared_options.rate("Set the frame rate of clips that state none (120, 29.97, 30000/1001).")
@shared_options.unit("clips that state none")
@shared_options.key_error
@shared_options.max_decoded
@shared_options.force
@shared_options.threads
@shared_options.jobs
@shared_options.json
def export_command(
    file: str,
    folder: str,
    target: str,
    clips: tuple[str, ...],
    where: str | None,
    rate: Fraction | None,
    unit: str | None,
    key_error: float | None,
    max_decoded: int | None,
    force: bool,
    as_json: bool,
) -> Exit:
    """Write every clip of FILE.mcz below DIR under its name, as numbers or as another format.

    A clip that the format cannot hold fails with the reason; the other clips are still written. An
    AMC comes with its ASF. mcz unpack gives the original files.
    """
    import mcz

    require_file(file)
    with errors_about(file), Progress() as progress:
        report = mcz.export(
            file,
            folder,
            target,
            clips=clips or None,
            where=where,
            rate=rate,
            unit=unit,
            key_error_mm=key_error,
            force=force,
            max_decoded=max_decoded,
            progress=progress,
        )
    return print_file_results(report, folder, as_json)
