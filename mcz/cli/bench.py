"""``mcz bench``: every codec on the same clips."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import click

from mcz.cli.common import Exit, Failure, echo, errors_about, print_json, require_file, say, table
from mcz.cli.hints import in_options
from mcz.cli.options import json_option, unit_option
from mcz.cli.terminal import Progress
from mcz.errors import reason_of

if TYPE_CHECKING:
    from mcz.bench.report import Outcome

PAPERS = "python -m tools.papers"


@click.command(short_help="Compare codecs: size, error, speed, memory.")
@click.argument("clips", metavar="[CLIPS]...", nargs=-1, type=click.Path())
@click.option(
    "--codecs",
    metavar="A,B",
    help="Compare these codecs, each with its presets; qbc:khan2014 or qbc:delta=40 is that "
    "setting alone. Default: all.",
)
@click.option("--tables", "paper", hidden=True)  # an internal option of tools/papers
@click.option("--peers", is_flag=True, help="Add the general compressors that are installed.")
@click.option("--speeds/--no-speeds", default=True, help="Also measure speed and memory (default).")
@unit_option("files that state none")
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
@json_option
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

    Print compression ratios over three numerators, errors of channels and positions, comparisons
    at equal error and at equal size, Bjontegaard deltas, speed relative to parsing the text, and
    memory. Results are cached in the user's cache folder; speeds are measured one at a time.
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


def show(outcome: Outcome, out: Path | None, *, as_json: bool) -> None:
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


def _lines(outcome: Outcome) -> Iterator[str]:
    for report in outcome.tables:
        yield report.title
        yield from (f"  {line}" for line in table(report.cells(), report.right))
        yield f"  {report.caption}"
        yield ""


def _write(outcome: Outcome, folder: Path) -> list[str]:
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
