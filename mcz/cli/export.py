"""``mcz export``: every clip of an .mcz file in another format."""

from __future__ import annotations

from fractions import Fraction

import click

from mcz.cli.archive_summary import print_file_results
from mcz.cli.common import Exit, about, existing
from mcz.cli.options import (
    clips_option,
    decoded_option,
    force_option,
    jobs_option,
    json_option,
    key_error_option,
    rate_option,
    threads_option,
    unit_option,
    where_option,
)
from mcz.cli.progress import Progress
from mcz.cli.suffixes import TARGETS


@click.command(short_help="Write every clip in another format: NPZ, CSV, BVH, AMC, C3D, GLB, USD.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.argument("folder", metavar="DIR", type=click.Path(readable=False))
@click.option("--to", "target", type=click.Choice(TARGETS), required=True, help="Set the format.")
@clips_option
@where_option
@rate_option()
@unit_option("Length unit of clips that say none.")
@key_error_option
@decoded_option
@force_option
@threads_option
@jobs_option
@json_option
def command(
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

    What a format cannot hold fails with the reason, and the other clips are written all the same.
    With an AMC comes its ASF. mcz unpack gives the original files.
    """
    import mcz

    existing(file)
    with about(file), Progress() as progress:
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
