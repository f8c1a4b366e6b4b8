"""``mcz codecs`` and ``mcz train``: the parameters of each codec, and bases learned from clips."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mcz.cli.common import (
    Exit,
    check_new,
    echo,
    errors_about,
    plural,
    print_json,
    require_file,
    table,
    write_output,
)
from mcz.cli.options import force_option, json_option, unit_option
from mcz.cli.terminal import Progress
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.codecs.contract import Codec
    from mcz.model.motion import Motion


WIDEST = 44  # characters of a line of the meaning


@click.command(short_help="List codecs and their parameters.")
@click.argument("names", metavar="[NAME]...", nargs=-1)
@json_option
def codecs_command(names: tuple[str, ...], as_json: bool) -> Exit:
    """List the codecs, or the parameters of each NAME: default, range and meaning.

    Set one with mcz encode --codec NAME --param KEY=VALUE.
    """
    from mcz.codecs import CODECS, DEFAULT, codec_by_name

    codecs = [codec_by_name(name) for name in names] or list(CODECS.values())
    if as_json:
        print_json({"default": DEFAULT, "codecs": [codec.document() for codec in codecs]})
        return Exit.FINE
    if names:
        for number, codec in enumerate(codecs):
            echo(*([""] if number else []), *_codec_lines(codec))
    else:
        echo(*_overview(codecs, DEFAULT))
    return Exit.FINE


def _overview(codecs: list[Codec], default: str) -> Iterator[str]:
    rows = [["codec", "id", "keeps", "codes", "quality by"]]
    for codec in codecs:
        keeps = "every byte" if codec.lossless else "what matters"
        codes = "positions" if codec.positions else "channels"
        codes += ", live" if codec.live else ""
        name = f"{codec.name} (default)" if codec.name == default else codec.name
        rows.append([name, str(codec.id), keeps, codes, codec.dial.parameter if codec.dial else ""])
    yield from table(rows, "lrlll")
    yield "mcz codecs NAME lists the parameters of one."


def _codec_lines(codec: Codec) -> Iterator[str]:
    kind = "lossless" if codec.lossless else "lossy"
    dial = f"; {codec.dial.parameter} trades quality for size" if codec.dial else ""
    yield f"{codec.name} (codec {codec.id}, {kind}){dial}"
    rows = [["parameter", "default", "range", "meaning"]]
    for facts in codec.document()["parameters"]:
        default = "none" if facts["default"] is None else text_of(facts["default"])
        first, *rest = _wrapped(facts["meaning"])
        rows.append([facts["name"], default, facts["range"], first])
        rows += [["", "", "", line] for line in rest]
    yield from (f"  {line}" for line in table(rows))


def text_of(value: object) -> str:
    """
    >>> text_of(False), text_of(0.5), text_of("64 KiB")
    ('false', '0.5', '64 KiB')
    """
    return str(value).lower() if isinstance(value, bool) else str(value)


def _wrapped(text: str) -> list[str]:
    from textwrap import wrap

    return wrap(text, WIDEST) or [""]


AXES = "xyz"


@click.command(short_help="Learn the bases of a transform from clips.")
@click.argument("clips", metavar="CLIPS...", nargs=-1, required=True, type=click.Path())
@click.option(
    "-o",
    "--output",
    metavar="OUT",
    required=True,
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the bases to a file, for --param basis=OUT of mcz encode.",
)
@click.option(
    "--P",
    "sparsity",
    metavar="N",
    type=click.IntRange(1),
    default=8,
    help="Keep N coefficients of each frame while learning. Default: 8.",
)
@click.option(
    "--iterations",
    metavar="N",
    type=click.IntRange(0, 100_000),
    default=300,
    help="Iterate at most N times, fewer if nothing is gained. Default: 300.",
)
@click.option(
    "--growth",
    metavar="N",
    type=click.IntRange(0, 10_000),
    default=40,
    help="Iterate N times with each smaller P before; 0: the published algorithm. Default: 40.",
)
@click.option(
    "--start",
    type=click.Choice(("dct", "haar")),
    default="dct",
    help="Set the first basis. Default: dct.",
)
@click.option(
    "--of",
    "kind",
    type=click.Choice(("frames", "steps", "windows")),
    default="steps",
    help="Choose the data to make sparse: steps between frames, frames as published, or DCT "
    "coefficients of windows. Default: steps.",
)
@click.option(
    "--mirror/--no-mirror", default=False, help="Add mirror images, left points for right ones."
)
@click.option(
    "--headings",
    metavar="N",
    type=click.IntRange(1, 360),
    default=1,
    help="Add copies turned about the up axis, 180 / N degrees apart. Default: 1, none.",
)
@click.option(
    "--every", metavar="N", type=click.IntRange(1), default=1, help="Use only every N-th frame."
)
@unit_option("files that state none")
@force_option
@json_option
def train_command(
    clips: tuple[str, ...],
    output: Path,
    unit: str | None,
    force: bool,
    as_json: bool,
    **options: Any,
) -> Exit:
    """Learn one orthogonal basis per coordinate from positions of CLIPS (.amc, .bvh, .c3d, .mcz).

    All clips must have the same points. Each iteration keeps the largest coefficients of each
    frame, then finds the basis nearest to them. OUT holds the bases as integers (SPEC.md, "Bases").
    """
    from mcz.codecs.training import Recipe, train
    from mcz.files.writing.atomic import refuse_inputs

    refuse_inputs(output, clips)
    check_new(output, force)
    for path in clips:
        require_file(path)
    with errors_about(clips[0]), Progress() as progress:
        trained = train(_motions(clips, unit, progress), Recipe(**options), progress)
    write_output(output, trained.data, force)
    document = {"output": str(output), **trained.document()}
    if as_json:
        print_json(document)
    else:
        for line in _training_lines(document):
            echo(line)
    return Exit.FINE


def _motions(paths: tuple[str, ...], unit: str | None, progress: Progress) -> Iterator[Motion]:
    import mcz

    for number, path in enumerate(paths):
        progress(number, len(paths), f"reading {path}")
        with errors_about(path):
            motion = mcz.read(path, unit=unit)
        yield replace(motion, name=path)  # errors name the file


def _training_lines(document: JsonObject) -> Iterator[str]:
    yield (
        f"{document['output']}: {plural(document['n_points'], 'point')}, "
        f"{document['bytes']:,} bytes, from {plural(document['n_vectors'], 'vector')} of "
        f"{plural(document['n_frames'], 'frame')} in {plural(document['n_clips'], 'clip')}"
    )
    if document["n_filled"]:
        yield f"  missing points were filled in {plural(document['n_filled'], 'frame')}"
    head = ("coordinate", "iterations", f"at the start, {document['unit']}", "at the end")
    rows = [
        (axis, str(stage["iterations"]), f"{stage['start']:.5g}", f"{stage['end']:.5g}")
        for axis, stage in zip(AXES, document["coordinates"], strict=True)
    ]
    yield from (f"  {line}" for line in table([head, *rows], "lrrr"))
