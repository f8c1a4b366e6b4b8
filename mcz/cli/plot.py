"""``mcz plot``: numbers of a motion as a chart."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click

from mcz.cli.common import (
    EXIT_CODES,
    Exit,
    Failure,
    about,
    check_new,
    echo,
    print_json,
    say,
    table,
)
from mcz.cli.hints import in_options
from mcz.cli.motion_input import cut_of, moving_of, moving_options
from mcz.cli.options import force_option, json_option
from mcz.cli.progress import Progress
from mcz.cli.render import to_size
from mcz.cli.suffixes import file_in

WHAT = ("channels", "spectrum", "error", "bytes", "rate-distortion")  # as in mcz.show.pictures
MOST_ROWS = 24  # of a table that is printed


@click.command(
    short_help="Plot channels, errors, spectra or bytes as PNG, SVG or a page.", epilog=EXIT_CODES
)
@click.argument("file", metavar="FILE", type=click.Path(readable=False))
@click.argument("other", metavar="[FILE2]", required=False, type=click.Path(readable=False))
@click.option(
    "-o",
    "--output",
    metavar="OUT",
    type=click.Path(readable=False),
    help="Write a .png, a .svg, or a .html with the tables. Default: FILE as .png.",
)
@click.option(
    "--what",
    type=click.Choice(WHAT),
    help=("Choose the plot. Default: channels; of two files the error of FILE2 against FILE."),
)
@click.option(
    "--joint",
    metavar="NAME",
    help="Plot the channels or the spectrum of this joint. Default: the first.",
)
@click.option(
    "--signal", metavar="NAME", help="Plot another signal than the motion, such as analog."
)
@click.option(
    "--channel",
    "channels",
    metavar="A,B",
    callback=lambda context, parameter, value: value and tuple(value.split(",")),
    help="Plot these channels of a signal, by name. Default: the first 8.",
)
@click.option(
    "--codecs",
    metavar="A,B",
    help="Set the lossy codecs of rate-distortion. Default: posewave,mrdwt.",
)
@moving_options
@click.option(
    "--size", metavar="WxH", callback=to_size, help="Set the size in pixels. Default: by the plot."
)
@click.option(
    "--theme", type=click.Choice(("light", "dark")), default="light", help="Set the colors."
)
@force_option
@json_option
def command(
    file: str,
    other: str | None,
    output: str | None,
    what: str | None,
    codecs: str | None,
    frames: tuple[int, int | None] | None,
    name: str | None,
    skeleton: str | None,
    max_decoded: int | None,
    force: bool,
    as_json: bool,
    **options: Any,
) -> Exit:
    """Draw numbers of FILE (.mcz or of any source format), and print them.

    channels and spectrum of a --joint, or of a --signal; error of FILE2 against FILE, the original,
    as mcz diff has it; bytes of a clip by joint and resolution, as mcz info --layout has them;
    rate-distortion at a few settings of lossy codecs. It needs pip install 'mcz[plot]'.
    """
    import mcz
    from mcz.files.writing.atomic import refuse_inputs

    if "-" in (file, other) and output is None:
        raise Failure("standard input has no name; say where to write with -o", Exit.USAGE)
    if file == other == "-":
        raise Failure("only one of FILE and FILE2 can be standard input", Exit.USAGE)
    target = file_in(output or str(Path(file).with_suffix(".png")), file, ".png")
    refuse_inputs(target, (file, other, skeleton))
    check_new(Path(target), force)
    facts = {key: options[key] for key in ("rate", "up", "unit")}
    own = {key: options.pop(key) for key in ("arrays", "model")}
    wanted = {"name": name, "skeleton": skeleton, "max_decoded": max_decoded, **facts, **own}
    if codecs is not None:
        options["codecs"] = [each for each in codecs.split(",") if each]
    with ExitStack() as stack:
        moving = stack.enter_context(moving_of(file, **wanted))
        if other is not None:
            options["other"] = stack.enter_context(moving_of(other, **wanted))
        stack.enter_context(about(file))
        progress = stack.enter_context(Progress())
        cut = cut_of(frames, moving)
        plotted = mcz.plot(
            moving, target, what, frames=cut, force=force, progress=progress, **options
        )
    for note in plotted.notes:
        say(in_options(note))
    if as_json:
        print_json(
            {
                "path": target,
                "what": plotted.what,
                "title": plotted.title,
                "tables": [list(map(list, rows)) for rows in plotted.tables],
                "notes": [in_options(note) for note in plotted.notes],
            }
        )
    else:
        echo(*_lines(target, plotted))
    return Exit.FINE


def _lines(target: str, plotted: Any) -> Iterator[str]:
    yield f"{target}: {plotted.title}"
    for rows in plotted.tables:
        more = len(rows) - 1 - MOST_ROWS
        shown = [list(row) for row in rows[: MOST_ROWS + 1]]
        yield from (
            f"  {line}" for line in table(shown, "l" + "r" * (len(rows[0]) - 1)).split("\n")
        )
        if more > 0:
            yield f"  {more:,} more rows; --json and a .html have them"
