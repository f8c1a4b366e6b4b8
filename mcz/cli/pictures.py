"""``mcz render`` and ``mcz plot``: a motion as a film, a still, a sheet of poses or a chart."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mcz.cli import shared_options
from mcz.cli.common import (
    Exit,
    Failure,
    check_new,
    errors_about,
    in_options,
    open_input,
    require_file,
)
from mcz.cli.outputs import resolve_output
from mcz.cli.terminal import Progress, echo, plural, print_json, say, table
from mcz.model.text_format import shorten

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip
    from mcz.model.motion import Motion


motion_options = shared_options.combine(
    click.option(
        "--clip", "name", metavar="NAME", help="Choose the clip of an .mcz. Default: the only one."
    ),
    shared_options.frames("Use only frames A <= f < B, counted from 0."),
    shared_options.rate(),
    shared_options.unit("a file that states none"),
    shared_options.up("Set the up axis of a file that states none."),
    shared_options.skeleton(shared_options.SKELETON_HELP),
    shared_options.arrays,
    shared_options.model,
    shared_options.max_decoded,
)


@contextmanager
def open_motion(
    path: str, *, name: str | None, max_decoded: int | None, **facts: Any
) -> Iterator[Motion | Clip]:
    """The motion of a source file, or a clip of an .mcz that stays open; errors name the file.

    ``facts`` are fields of ``SourceOptions``. They change only a source file: a clip gets them from
    its drawing function.
    """
    import mcz
    from mcz.files.reading.file import is_mcz
    from mcz.files.reading.source_files import SourceOptions

    if path == "-" or is_mcz(path):
        with open_input(path, max_decoded=max_decoded) as file, errors_about(path):
            yield file.only_clip(name)
        return
    require_file(path)
    with errors_about(path):
        read = {name: facts.pop(name) for name in ("skeleton", "arrays", "model")}
        yield SourceOptions(**facts).complete(mcz.read(path, **read))


def frame_bounds(
    frames: tuple[int, int | None] | None, motion: Motion | Clip
) -> tuple[int, int] | None:
    """``--frames`` as (start, stop) of this motion."""
    if frames is None:
        return None
    start, stop = frames
    return start, motion.n_frames if stop is None else stop


VIEWS = ("front", "side", "top", "three-quarter")  # as in mcz.show.pictures, whose import is slow


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


@click.command(short_help="Render a motion as GIF, MP4, WebM, PNG or SVG.")
@click.argument("file", metavar="FILE", type=click.Path(readable=False))
@click.option(
    "-o",
    "--output",
    metavar="OUT",
    type=click.Path(readable=False),
    help="Write a .gif, .mp4, .webm, .png or .svg. Default: FILE as .gif, a sheet as .png.",
)
@motion_options
@click.option("--sheet", metavar="N", type=int, help="Draw N poses on one .png or .svg.")
@click.option(
    "--fps", metavar="R", type=float, help="Set the pictures per second. Default: GIF 25, else 30."
)
@click.option(
    "--speed", metavar="X", type=float, default=1.0, help="Play X times as fast. Default: 1."
)
@click.option(
    "--size", metavar="WxH", callback=to_size, help="Set the size in pixels. Default: 640x640."
)
@click.option(
    "--view",
    type=click.Choice(VIEWS),
    default="three-quarter",
    help="Look from this side of the figure, as it faces at first. Default: three-quarter.",
)
@click.option(
    "--theme", type=click.Choice(("light", "dark")), default="light", help="Set the colors."
)
@click.option(
    "--follow/--no-follow",
    default=None,
    help="Move the camera along. Default: if the figure would be small otherwise.",
)
@shared_options.force
@shared_options.json
def render_command(
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

    FILE is an .mcz or a source file with joints or markers. A .mot, a .sto and plain columns of
    numbers have no points to draw; plain arrays need --arrays.

    A .png or .svg without --sheet shows the middle frame of --frames. The picture states the
    spacing of the floor grid, and colors left and right differently. Requires pip install
    'mcz[plot]', or 'mcz[render]' for .mp4 and .webm.
    """
    import mcz
    from mcz.files.writing.atomic import refuse_inputs

    if file == "-" and output is None:
        raise Failure("standard input has no name; set the output with -o", Exit.USAGE)
    suffix = ".gif" if options["sheet"] is None else ".png"
    target = resolve_output(output or str(Path(file).with_suffix(suffix)), file, suffix)
    refuse_inputs(target, (file, skeleton))
    if "://" not in target:
        check_new(Path(target), force)
    facts = {key: options[key] for key in ("rate", "up", "unit")}
    own = {key: options.pop(key) for key in ("arrays", "model")}
    input_options = {"name": name, "skeleton": skeleton, "max_decoded": max_decoded, **facts, **own}
    with open_motion(file, **input_options) as motion, errors_about(file), Progress() as progress:
        drawn = mcz.render(
            motion,
            target,
            frames=frame_bounds(frames, motion),
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
    noun = plural(drawn.n_pictures, "picture" if drawn.fps else "pose")
    at = f" at {drawn.fps:g} a second" if drawn.fps else ""
    echo(f"{target}: {noun}{at}, {drawn.width} x {drawn.height} pixels, {drawn.n_bytes:,} bytes")
    return Exit.FINE


PLOTS = ("channels", "spectrum", "error", "bytes", "rate-distortion")  # as in mcz.show.pictures
MOST_ROWS = 24  # of a table that is printed
MOST_TEXT = 120  # characters of a name that is printed


@click.command(short_help="Plot channels, errors, spectra or bytes as PNG, SVG or a page.")
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
    type=click.Choice(PLOTS),
    help="Choose the plot. Default: channels; of two files the error of FILE2 against FILE.",
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
@motion_options
@click.option(
    "--size", metavar="WxH", callback=to_size, help="Set the size in pixels. Default: by the plot."
)
@click.option(
    "--theme", type=click.Choice(("light", "dark")), default="light", help="Set the colors."
)
@shared_options.force
@shared_options.json
def plot_command(
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

    --what chooses the plot: channels or spectrum of a --joint or --signal; error of FILE2 against
    FILE, the original, as in mcz diff; bytes of a clip by joint and resolution, as in mcz info
    --layout; rate-distortion of lossy codecs at a few settings. Requires pip install 'mcz[plot]'.
    """
    import mcz
    from mcz.files.writing.atomic import refuse_inputs

    if "-" in (file, other) and output is None:
        raise Failure("standard input has no name; set the output with -o", Exit.USAGE)
    if file == other == "-":
        raise Failure("only one of FILE and FILE2 can be standard input", Exit.USAGE)
    target = resolve_output(output or str(Path(file).with_suffix(".png")), file, ".png")
    refuse_inputs(target, (file, other, skeleton))
    check_new(Path(target), force)
    facts = {key: options[key] for key in ("rate", "up", "unit")}
    own = {key: options.pop(key) for key in ("arrays", "model")}
    input_options = {"name": name, "skeleton": skeleton, "max_decoded": max_decoded, **facts, **own}
    if codecs is not None:
        options["codecs"] = [each for each in codecs.split(",") if each]
    with ExitStack() as stack:
        motion = stack.enter_context(open_motion(file, **input_options))
        if other is not None:
            options["other"] = stack.enter_context(open_motion(other, **input_options))
        stack.enter_context(errors_about(file))
        progress = stack.enter_context(Progress())
        cut = frame_bounds(frames, motion)
        plotted = mcz.plot(
            motion, target, what, frames=cut, force=force, progress=progress, **options
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
        echo(*_plot_lines(target, plotted))
    return Exit.FINE


def _plot_lines(target: str, plotted: Any) -> Iterator[str]:
    yield f"{target}: {shorten(plotted.title, MOST_TEXT)}"
    for rows in plotted.tables:
        more = len(rows) - 1 - MOST_ROWS
        lines = [[shorten(cell, MOST_TEXT) for cell in row] for row in rows[: MOST_ROWS + 1]]
        yield from (f"  {line}" for line in table(lines, "l" + "r" * (len(rows[0]) - 1)))
        if more > 0:
            yield f"  {more:,} more rows; --json and a .html have them"
