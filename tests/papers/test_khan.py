"""tools.papers khan2014 and khan2016: a figure that is met, the papers' figures, the whole run."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from mcz.bench import cache
from mcz.bench.cases import Case, Variant
from mcz.bench.measure import point
from mcz.bench.tables import Table
from mcz.bench.tasks import Runner
from mcz.cli.common import run as run_command
from mcz.codecs import CODECS, by_name
from mcz.errors import OptionError
from tools.papers import at_figure, kinds
from tools.papers.__main__ import command
from tools.papers.khan2014 import tables as khan2014
from tools.papers.khan2016 import tables as khan2016
from tools.papers.kinds import KINDS
from tools.papers.outcome import named


@pytest.fixture(scope="module")
def case(samples: Path) -> Case:
    return Case(str(samples / "walk.amc"))


@pytest.mark.parametrize(("key", "wanted"), [("cr_source", 50.0), ("mean_position_error_cm", 0.3)])
def test_a_figure_is_met_between_two_points(case: Case, key: str, wanted: float) -> None:
    found = at_figure.at_figure(case, Variant("mrdwt"), key, wanted, 4.0)
    assert found[key] == pytest.approx(wanted)
    around = [point(case, Variant("mrdwt"), {"T_g": T_g})[key] for T_g in found["bracket"]]
    assert min(around) <= wanted <= max(around)


def test_a_figure_out_of_reach_is_told(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    def of(case: Case, variant: Variant, params: dict[str, float], *, markers: bool) -> Any:
        return {"mse": min(50.0, 1 + params["T_g"])}

    monkeypatch.setattr(at_figure, "point", of)
    with pytest.raises(OptionError, match="mse 60 is not reached, 1 to 50 is"):
        at_figure.at_figure(case, Variant("mrdwt"), "mse", 60.0)


def test_the_papers_codecs_that_are_missing_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(khan2014, "CODECS", {2: CODECS[2]})
    assert khan2014.here() == []
    assert khan2014.missing() == ["qbc", "dwt", "awt", "pca"]
    assert list(khan2014.tables({}, {})) == []


# The papers' figures


@pytest.mark.real
def test_khan_2016_row(data: Path) -> None:
    outcome = _tables(data, khan2016, "17_10", [12])
    (row,) = [row for row in outcome.rows if row[0] == 12]
    T_g, paper_cr, cr, times, deflate, paper_eps, eps = row[:7]
    assert (paper_cr, paper_eps) == (64.5, 0.2041)
    assert eps == pytest.approx(paper_eps, abs=0.0001)
    assert isinstance(cr, float)
    assert cr > 2 * 64.5
    assert times == pytest.approx(cr / 64.5)
    assert 1.9 * 64.5 < deflate < cr  # one deflated blob was measured at 2.04 times the paper's
    assert T_g == 12


def _tables(data: Path, module: Any, clip: str, thresholds: list[int]) -> Table:
    """Fig. 7 of a clip at some thresholds alone."""
    case = named([str(data)], None)[clip]
    wanted = [
        task(case, T_g) for T_g in thresholds for task in (module._threshold, module._deflated)
    ]
    known = Runner(1, cache.Cache(None), KINDS).run(wanted)
    every = {task: {} for task in module.tasks({clip: case})} | known
    found = [t for t in module.tables({clip: case}, every) if "Fig. 7" in t.title]
    return found[0]


# The whole run


def test_all_tables_of_generated_clips(
    samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    shutil.copy(samples / "walk.asf", tmp_path / "10.asf")
    shutil.copy(samples / "walk.asf", tmp_path / "09.asf")
    for name in ("10_03", "09_01"):
        shutil.copy(samples / "walk.amc", tmp_path / f"{name}.amc")

    def near(case: Case, variant: Variant, key: str, wanted: float, hint: float) -> Any:
        return point(case, variant, {by_name(variant.codec).dial.parameter: hint}, markers=False)

    monkeypatch.setattr(kinds, "at_figure", near)
    out = tmp_path / "out"
    for paper, n_tables in (("khan2014", 5), ("khan2016", 1)):
        arguments = [paper, str(tmp_path), "--jobs", "1", "--no-cache", "--out", str(out)]
        assert run_command(command, "papers", arguments) == 0
        shown, told = capsys.readouterr()
        found = json.loads((out / "results.json").read_text())["tables"]
        assert len(found) == n_tables and all(table["title"] in shown for table in found)
        assert all(table["rows"] for table in found)
        assert "clips that are not here" in told


def test_a_paper_without_its_clips_is_one_line(samples: Path) -> None:
    called = [sys.executable, "-m", "tools.papers", "khan2014", str(samples / "walk.amc")]
    done = subprocess.run(called, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.endswith(
        "khan2014: none of its clips is here: 38_01, 10_03, 05_01, 143_37\n"
    )
    assert done.stderr.count("\n") == 1
