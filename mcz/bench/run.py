"""A whole run: what is measured, the document, the report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import mcz
from mcz.bench import peers, plots, sweep
from mcz.bench.cases import find_cases, named, variants_of
from mcz.bench.sweep import ClipResult
from mcz.bench.tables import Table
from mcz.bench.tasks import Runner
from mcz.model.types import JsonObject
from mcz.show.pictures.chart_pages import ChartPage, Sheet, data_uri


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of a run: clips that were swept, tables, plots and remarks."""

    clips: list[ClipResult] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    figures: list[plots.Figures] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def document(self) -> JsonObject:
        return {
            "mcz": mcz.__version__,
            "clips": [clip.document() for clip in self.clips],
            "tables": [table.document() for table in self.tables],
            "notes": self.notes,
        }

    def markdown(self, plots: Sequence[str]) -> Iterator[str]:
        yield "# Codecs compared"
        yield ""
        yield f"By mcz {mcz.__version__}; its SPEC.md defines sizes, ratios and metrics."
        yield ""
        for note in self.notes:
            yield f"- {note}"
        if self.notes:
            yield ""
        for plot in plots:
            yield f"![{plot}]({plot})"
            yield ""
        for table in self.tables:
            yield from table.markdown()

    def page(self, plots: Sequence[tuple[Path, Path]]) -> bytes:
        """One page with all tables and the ``plots``, on light and on dark ground; UTF-8."""
        known = f"By mcz {mcz.__version__}; its SPEC.md defines sizes, ratios and metrics."
        page = ChartPage("Codecs compared", [known, *self.notes])
        for pair in plots:
            light, dark = (data_uri(plot.read_bytes(), "png") for plot in pair)
            page.add_picture(pair[0].stem, light, dark)
        for table in self.tables:
            page.add_table(Sheet(table.title, table.cells(), table.right, table.caption))
        return page.html()


def bench(
    paths: Sequence[str],
    runner: Runner,
    *,
    codecs: Sequence[str] = (),
    with_peers: bool = False,
    speeds: bool = True,
    unit: str | None = None,
) -> Outcome:
    """Measure the clips of ``paths``; raises OptionError for an unknown codec or no clip at all."""
    variants = variants_of(codecs)
    cases = named(find_cases(paths, unit))
    asked = peers.installed() if with_peers else ()
    clips = sweep.measured(runner, cases, variants, speeds=speeds, peers=asked)
    outcome = Outcome(clips, figures=[partial(plots.draw, clips)])
    for clip in clips:
        outcome.tables.extend(sweep.tables(clip))
        outcome.notes.extend(
            f"{clip.name}, {curve.label}: {curve.error}" for curve in clip.curves if curve.error
        )
    if with_peers and peers.missing():
        outcome.notes.append(f"peers that are not installed: {', '.join(peers.missing())}")
    return outcome
