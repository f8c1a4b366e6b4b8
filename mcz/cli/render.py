"""``mcz render``: a motion as a film, a still or a sheet of poses."""

from __future__ import annotations

import re
from dataclasses import asdict
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
    plural,
    print_json,
    say,
)
from mcz.cli.hints import in_options
from mcz.cli.motion_input import cut_of, moving_of, moving_options
from mcz.cli.options import force_option, json_option
from mcz.cli.progress import Progress
from mcz.cli.suffixes import file_in

VIEWS = ("front", "side", "top", "three-quarter")  # as in mcz.show.pictures, which takes longer


def to_size(
    ctx: click.Context, param: click.Parameter, value: str | None
) -> tuple[int, int] | None:
    """Callback of ``640x480``, or ``640`` for a square."""
    if value is None:
        return None
    match = re.fullmatch(r"([0-9]{1,6})(?:[xX]([0-9]{1,6}))?", value)
    if not match:
        raise click.BadParameter(f"{value!r} is not a size such as 640x480 or 640")
    return int(match[1]), int(match[2] or match[1])


@click.command(short_help="Render a motion as GIF, MP4, WebM, PNG or SVG.", epilog=EXIT_CODES)
@click.argument("file", metavar="FILE", type=click.Path(readable=False))
@click.option(
    "-o",
    "--output",
    metavar="OUT",
    type=click.Path(readable=False),
    help=("Write a .gif, .mp4, .webm, .png or .svg. Default: FILE as .gif, a sheet as .png."),
)
@moving_options
@click.option("--sheet", metavar="N", type=int, help="Draw N poses on one .png or .svg.")
@click.option(
    "--fps", metavar="R", type=float, help="Set the pictures a second. Default: GIF 25, else 30."
)
@click.option("--speed", metavar="X", type=float, default=1.0, help="Set the speed. Default: 1.")
@click.option(
    "--size", metavar="WxH", callback=to_size, help="Set the size in pixels. Default: 640x640."
)
@click.option(
    "--view",
    type=click.Choice(VIEWS),
    default="three-quarter",
    help=("Set the view, relative to the figure's first facing. Default: three-quarter."),
)
@click.option(
    "--theme", type=click.Choice(("light", "dark")), default="light", help="Set the colors."
)
@click.option(
    "--follow/--no-follow",
    default=None,
    help="Move the camera along. Default: if the figure would be small otherwise.",
)
@force_option
@json_option
def command(
    file: str,
    output: str | None,
    name: str | None,
    frames: tuple[int, int | None] | None,
    skeleton: str | None,
    max_decoded: int | None,
    as_json: bool,
    force: bool,
    **options: Any,
) -> Exit:
    """Draw the motion in FILE: a film, a still or a sheet of poses.

    FILE is an .mcz, .bvh, .amc, .c3d, .trc, .csv of Motive or Vicon, or .npz; a .mot, a .sto and
    other .csv have no points to draw, nor has a plain .npy unless --arrays says what it is.

    A .png or .svg without --sheet shows the middle frame of --frames. A grid on the floor has its
    length, left and right have colors of their own. It needs pip install 'mcz[render]'.
    """
    import mcz
    from mcz.files.writing.atomic import refuse_inputs

    if file == "-" and output is None:
        raise Failure("standard input has no name; say where to write with -o", Exit.USAGE)
    suffix = ".gif" if options["sheet"] is None else ".png"
    target = file_in(output or str(Path(file).with_suffix(suffix)), file, suffix)
    refuse_inputs(target, (file, skeleton))
    if "://" not in target:
        check_new(Path(target), force)
    facts = {key: options[key] for key in ("rate", "up", "unit")}
    own = {key: options.pop(key) for key in ("arrays", "model")}
    wanted = {"name": name, "skeleton": skeleton, "max_decoded": max_decoded, **facts, **own}
    with moving_of(file, **wanted) as moving, about(file), Progress() as progress:
        drawn = mcz.render(
            moving,
            target,
            frames=cut_of(frames, moving),
            force=force,
            progress=progress,
            **options,
        )
    for note in drawn.notes:
        say(f"{file}: {in_options(note)}")
    if as_json:
        document = asdict(drawn)
        document["bytes"] = document.pop("n_bytes")
        print_json(document)
        return Exit.FINE
    what = plural(drawn.n_pictures, "picture" if drawn.fps else "pose")
    at = f" at {drawn.fps:g} a second" if drawn.fps else ""
    echo(f"{target}: {what}{at}, {drawn.width} x {drawn.height} pixels, {drawn.n_bytes:,} bytes")
    return Exit.FINE
