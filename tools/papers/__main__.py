"""``python -m tools.papers``: a paper's tables with ours beside them."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import click

from mcz.bench.tasks import Cache, Runner, default_folder
from mcz.cli import shared_options
from mcz.cli.codecs import show
from mcz.cli.common import Exit, errors_about, require_file, run
from mcz.cli.terminal import Progress
from tools.papers.hou2016.run import hou2016
from tools.papers.khan2014.run import khan2014
from tools.papers.khan2016.run import khan2016
from tools.papers.kinds import CODE, KINDS
from tools.papers.kwak.run import kwak
from tools.papers.outcome import BenchResult

PAPERS = {"khan2014": khan2014, "khan2016": khan2016, "hou2016": hou2016, "kwak": kwak}


@click.command()
@click.argument("paper", type=click.Choice([*PAPERS, "all"]))
@click.argument("clips", nargs=-1, required=True, type=click.Path())
@shared_options.unit("files that state none")
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(file_okay=False, path_type=Path),
    help="Write results.json, report.md and plots into DIR, over those of an earlier run.",
)
@click.option(
    "--jobs", metavar="N", type=click.IntRange(1), help="Processes. Default: one a processor."
)
@click.option("--cache/--no-cache", default=True, help="Reuse earlier results. Default: do.")
@shared_options.json
def command(
    paper: str,
    clips: tuple[str, ...],
    unit: str | None,
    out: Path | None,
    jobs: int | None,
    cache: bool,
    as_json: bool,
) -> Exit:
    """Print the tables of PAPER for its clips among CLIPS: files, or folders of them.

    Of hou2016 also for clips that bases are learned from, of kwak also for other C3D files of
    1,000 frames and more. Results are kept where those of ``mcz bench`` are.
    """
    for path in clips:
        if not Path(path).is_dir():
            require_file(path)
    runner = Runner(
        jobs or os.cpu_count() or 1, Cache(default_folder() if cache else None, CODE), KINDS
    )
    outcome = BenchResult()
    with Progress() as progress, errors_about(clips[0]):
        runner.progress = progress
        for name in PAPERS if paper == "all" else (paper,):
            PAPERS[name](outcome, clips, unit, runner)
    show(outcome, out, as_json=as_json)
    return Exit.FINE


if __name__ == "__main__":
    sys.exit(run(command, "python -m tools.papers"))
