"""``mcz codecs``, ``mcz train``, ``mcz bench``: parameters, learned bases, and a comparison."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from mcz.cli import shared_options
from mcz.cli.common import (
    Exit,
    Failure,
    check_new,
    errors_about,
    in_options,
    require_file,
    write_output,
)
from mcz.cli.terminal import Progress, echo, plural, print_json, say, table
from mcz.errors import reason_of
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.bench.report import BenchResult
    from mcz.codecs.contract import Codec
    from mcz.model.motion import Motion


WIDEST = 44  # characters of a line of the meaning


@click.command(short_help="List codecs and their parameters.")
@click.argument("names", metavar="[NAME]...", nargs=-1)
@shared_options.json
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
        first, *rest = _wrap_lines(facts["meaning"])
        rows.append([facts["name"], default, facts["range"], first])
        rows += [["", "", "", line] for line in rest]
    yield from (f"  {line}" for line in table(rows))


def text_of(value: object) -> str:
    """
    >>> text_of(False), text_of(0.5), text_of("64 KiB")
    ('false', '0.5', '64 KiB')
    """
    return str(value).lower() if isinstance(value, bool) else str(value)


def _wrap_lines(text: str) -> list[str]:
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
    help="First iterate N times with each smaller P; 0: the published algorithm. Default: 40.",
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
@shared_options.unit("files that state none")
@shared_options.force
@shared_options.json
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


PAPERS = "python -m tools.papers"


@click.command(short_help="Compare codecs: size, error, speed, memory.")
@click.argument("clips", metavar="[CLIPS]...", nargs=-1, type=click.Path())
@click.option(
    "--codecs",
    metavar="A,B",
    help="Compare these codecs, each with its presets; qbc:khan2014 or qbc:delta=40 is one "
    "setting. Default: all.",
)
@click.option("--tables", "paper", hidden=True)  # an internal option of tools/papers
@click.option("--peers", is_flag=True, help="Add the general compressors that are installed.")
@click.option("--speeds/--no-speeds", default=True, help="Also measure speed and memory (default).")
@shared_options.unit("files that state none")
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(file_okay=False, path_type=Path),
    help="Write index.html, results.json, report.md and plots into DIR; overwrite earlier ones.",
)
@click.option(
    "--jobs",
    metavar="N",
    type=click.IntRange(1),
    help="Use N processes. Default: one per processor.",
)
@click.option("--cache/--no-cache", default=True, help="Reuse earlier results (default).")
@shared_options.json
def bench_command(
    clips: tuple[str, ...],
    codecs: str | None,
    paper: str | None,
    peers: bool,
    speeds: bool,
    unit: str | None,
    out: Path | None,
    jobs: int | None,
    cache: bool,
    as_json: bool,
) -> Exit:
    """Sweep the quality of every codec on CLIPS: files, or folders of .amc, .bvh and .c3d.

    Without CLIPS, use a generated walk.

    Print compression ratios, errors of channels and positions, comparisons at equal error and at
    equal size, Bjontegaard deltas, speed relative to parsing the text, and memory. Results are
    cached in the user's cache folder; speeds are measured one at a time.
    """
    from mcz.bench.report import bench
    from mcz.bench.tasks import Cache, Runner, default_folder

    if paper is not None:
        raise Failure(f"the papers' tables are in the source tree: {PAPERS} {paper}", Exit.USAGE)
    for path in clips:
        if not Path(path).is_dir():
            require_file(path)
    with TemporaryDirectory() as folder, Progress() as progress, ExitStack() as stack:
        clips = clips or (_sample(folder),)
        stack.enter_context(errors_about(clips[0]))
        runner = Runner(jobs or os.cpu_count() or 1, Cache(default_folder() if cache else None))
        runner.progress = progress
        outcome = bench(
            clips,
            runner,
            codecs=[name for name in (codecs or "").split(",") if name],
            with_peers=peers,
            speeds=speeds,
            unit=unit,
        )
    show(outcome, out, as_json=as_json)
    return Exit.FINE


def show(outcome: BenchResult, out: Path | None, *, as_json: bool) -> None:
    """Print the results, and write the files of a report if ``out`` is given."""
    document = outcome.document() | {"files": _write(outcome, out) if out else []}
    if as_json:
        print_json(document)
        return
    for line in _lines(outcome):
        echo(line)
    for note in outcome.notes:
        say(in_options(note))
    for path in document["files"]:
        echo(path)


def _sample(folder: str) -> str:
    from mcz.sources.sample import write_samples

    write_samples(Path(folder))
    return str(Path(folder) / "walk.amc")


def _lines(outcome: BenchResult) -> Iterator[str]:
    for report in outcome.tables:
        yield report.title
        yield from (f"  {line}" for line in table(report.cells(), report.right))
        yield f"  {report.caption}"
        yield ""


def _write(outcome: BenchResult, folder: Path) -> list[str]:
    from mcz.bench.report import MISSING, can_draw, draw_all

    try:
        folder.mkdir(parents=True, exist_ok=True)
        drawn: list[Path] = []
        if can_draw():
            drawn = draw_all(outcome.figures, folder, "light")
        elif outcome.figures:
            outcome.notes.append(MISSING)
        text = "\n".join(outcome.markdown([path.name for path in drawn]))
        report, results = folder / "report.md", folder / "results.json"
        page = folder / "index.html"
        report.write_text(text, "utf-8")
        with TemporaryDirectory() as other:
            dark = draw_all(outcome.figures, Path(other), "dark") if drawn else []
            page.write_bytes(outcome.page(list(zip(drawn, dark, strict=True))))
        document = json.dumps(outcome.document(), indent=1, ensure_ascii=False, allow_nan=False)
        results.write_text(document + "\n", "utf-8")
    except OSError as error:
        raise Failure(reason_of(error), path=folder) from None
    return [str(path) for path in (results, report, page, *drawn)]
