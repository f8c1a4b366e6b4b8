"""``mcz encode``: a source file to an .mcz file."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import click

from mcz.cli.common import Exit, Failure, about, existing, opened, plural, print_json, printable
from mcz.cli.options import chosen, encoding_options, force_option, json_option
from mcz.cli.progress import Progress


@click.command(short_help="A .bvh, .amc or .asf file to .mcz.")
@click.argument("source", metavar="SRC", type=click.Path())
@click.option(
    "-o",
    "--output",
    metavar="OUT.mcz",
    help="Default: SRC with the suffix .mcz; - is standard output.",
)
@click.option(
    "--skeleton",
    metavar="FILE.asf",
    type=click.Path(),
    help="The ASF of an AMC. Default: the same stem, the subject's prefix beside it, a sibling "
    "folder asf/, or the only ASF beside it.",
)
@encoding_options
@force_option
@json_option
def command(
    source: str,
    output: str | None,
    skeleton: str | None,
    force: bool,
    as_json: bool,
    **options: Any,
) -> Exit:
    """Encode SRC (.bvh, .amc or .asf) into OUT.mcz; an ASF alone makes a file of a skeleton."""
    import mcz
    from mcz.report import info

    target = output or str(Path(source).with_suffix(".mcz"))
    existing(source)
    if output == "-" and as_json:
        raise Failure("-o - leaves no room for --json", Exit.USAGE)
    piped = io.BytesIO()
    with about(source, target), Progress() as progress:
        mcz.encode(
            source,
            piped if output == "-" else target,
            skeleton=skeleton,
            force=force,
            progress=progress,
            **chosen(**options),
        )
    if output == "-":
        sys.stdout.buffer.write(piped.getvalue())
        return Exit.FINE
    with opened(target) as file:
        document = info(file)
    if as_json:
        print_json({"output": target, **document})
    else:
        click.echo(summary(target, document, Path(source).stat().st_size))
    return Exit.FINE


def summary(target: str, document: dict[str, Any], source_size: int) -> str:
    """One line about a file just written."""
    held = [
        f"{plural(clip['n_frames'], 'frame')} of {plural(clip['n_channels'], 'channel')}"
        for clip in document["clips"]
    ]
    held += ["a skeleton" for _ in document["skeletons"] if not document["clips"]]
    held += ["verbatim" for _ in document["attachments"]]
    size = document["file_bytes"]
    ratio = f", {source_size / size:.2f} : 1" if source_size else ""
    return printable(f"{target}: {', '.join(held)}; {source_size:,} -> {size:,} bytes{ratio}")
