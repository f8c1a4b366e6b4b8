"""tools.papers hou2016: curves, claims, the way back, the whole run on generated clips."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcz.bench import plots
from mcz.bench.cache import Cache
from mcz.bench.cases import Case
from mcz.bench.tasks import Runner, Task
from mcz.cli.common import run as run_command
from tests.papers.walks import put_walk
from tools.papers import curves, panels
from tools.papers.__main__ import command
from tools.papers.curves import at, curve
from tools.papers.hou2016 import claims, tables, tasks, ways_back
from tools.papers.hou2016 import panels as plotted
from tools.papers.hou2016.run import hou2016
from tools.papers.hou2016.tasks import CLIPS, COSINES, FRAME, Found
from tools.papers.kinds import KINDS
from tools.papers.outcome import Outcome, named


@pytest.fixture(scope="module")
def case(samples: Path) -> Case:
    return Case(str(samples / "walk.amc"))


@pytest.fixture(scope="module")
def folder(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The generated walk under names of the paper's clips."""
    found = tmp_path_factory.mktemp("cmu")
    for name in ("17_10", "17_03", "05_01"):
        put_walk(samples, found, name, 80)
    return found


def _record(setting: float, error: float) -> dict[str, Any]:
    return {"setting": setting, "cm": error, "cr": 100 * error**0.5, "cr_without_models": 1.0}


# The way back


def test_exact_places_lead_back(case: Case) -> None:
    found = ways_back.way_back(case, None, True)
    assert found["coded_bytes"] is None and found["seen_cm"] == 0
    assert found["cm"] < 0.001 and found["turn_deg"] < 0.01 and found["channel_deg"] < 0.01


def test_angles_between_orientations() -> None:
    angles = np.array([0.0, 1e-9, 0.3, 3.0])
    turned = np.zeros((3, 3, 4))
    turned[0, 0] = turned[1, 1] = np.cos(angles)
    turned[1, 0], turned[0, 1], turned[2, 2] = np.sin(angles), -np.sin(angles), 1.0
    found = ways_back._angles(np.repeat(np.eye(3)[:, :, None], 4, axis=2), turned)
    assert found == pytest.approx(angles, abs=1e-12)


# The whole run


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few points, few settings."""
    monkeypatch.setattr(curves, "MOST_POINTS", 2)
    monkeypatch.setattr(tasks, "STEPS_CM", (None,))
    for module in (tasks, claims):
        monkeypatch.setattr(module, "SPARSITIES", (2, 8))
    monkeypatch.setattr(tasks, "ITERATIONS", 2)


@pytest.mark.usefixtures("short")
def test_all_tables_of_a_generated_clip(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setattr("tools.papers.__main__.default_folder", lambda: tmp_path / "cache")
    out = tmp_path / "out"
    arguments = ["hou2016", str(folder), "--jobs", "1"]
    assert run_command(command, "papers", [*arguments, "--out", str(out)]) == 0
    shown, told = capsys.readouterr()
    assert "Hou 2016, claim by claim" in shown
    assert "clips that are not here: 14_08" in told
    here = {t["title"]: t for t in json.loads((out / "results.json").read_text())["tables"]}
    assert len(here) == 11
    for title, table in here.items():
        assert table["rows"], title
    rates = here["Hou 2016, Fig. 6 and 7: CR at equal D, our coder"]
    assert {row[0] for row in rates["rows"]} == {"17_10"}
    assert "17_03" in str(here["Bases on a subject that they never saw"]["rows"])
    claimed = {row[0]: row[2] for row in here["Hou 2016, claim by claim"]["rows"]}
    assert "CR of L = 60 < 120 < 240" in claimed
    assert claimed["LSDT distorts less than DCT and DWT at equal non-zeros"] == "yes"
    assert claimed["clip-LSDT beats frame-LSDT"] == "yes"
    if plots.can_draw():
        names = {path.name for path in out.glob("*.png")}
        assert {"hou2016_rates.png", "hou2016_convergence.png", "hou2016_spatial.png"} <= names
    monkeypatch.setattr("mcz.bench.tasks.perform", lambda *given: pytest.fail("measured again"))
    assert run_command(command, "papers", arguments) == 0


@pytest.mark.long
@pytest.mark.usefixtures("short")
def test_without_training_clips_the_rest_remains(folder: Path, tmp_path: Path) -> None:
    alone = tmp_path / "17_10.amc"
    shutil.copy(folder / "17.asf", tmp_path / "17.asf")
    shutil.copy(folder / "17_10.amc", alone)
    outcome = Outcome()
    hou2016(outcome, [str(alone)], None, Runner(1, Cache(None), KINDS))
    titles = [table.title for table in outcome.tables if table.rows]
    assert "Hou 2016, Fig. 6 and 7: CR at equal D, preset hou2016: prefix codes" in titles
    assert "Hou 2016, Fig. 4: P" not in titles


def test_what_cannot_be_measured_is_left_out(tmp_path: Path) -> None:
    found = Found({"17_10": Case("nowhere.amc")}, (), {})
    found.results[Task("curve", found.one, FRAME)] = {"error": "no"}
    assert found.curve("17_10", FRAME) == []
    assert found.cr("17_10", FRAME, 1.0) is None
    (judged,) = [table for table in tables.tables(found) if table.rows]
    assert {row[2] for row in judged.rows} == {"-"}
    assert list(panels.draw(list(plotted.panels(found)), tmp_path)) == []


def test_claims_are_judged_by_the_figures() -> None:
    found = Found({"17_10": Case("nowhere.amc")}, (), {})

    def curve_of(scale: float) -> list[dict[str, Any]]:
        errors = (0.05, 0.5, 5.0)
        return [_record(e, e) | {"cr": scale * 100 * e**0.5, "n_frames": 2783} for e in errors]

    scales = {FRAME: 1.3, COSINES: 0.6, CLIPS[0]: 2.0, CLIPS[1]: 2.6, CLIPS[2]: 2.8}
    for variant, scale in (scales | {tasks.MDTT: 2.4, tasks.RDO: 3.2}).items():
        found.results[Task("curve", found.one, variant)] = curve_of(scale)
    rows = {row[0]: row[2:] for row in claims.claims(found).rows if row[1] == "adaptive"}
    assert rows["frame-LSDT has less distortion than frame-DCT at equal CR"][0] == "yes"
    assert rows["by up to 70% at high CR"][0] == "yes"  # 1 - (0.6 / 1.3)^2 = 79 %
    assert rows["CR of L = 60 < 120 < 240"] == (
        *("yes", "60 to 120, 120 to 240: 17_10 +30.0%, +7.7%"),
    )
    assert rows["little gain from 120 to 240"][0] == "yes"
    assert rows["clip-LSDT beats PCA-RDO"][0] == "no"
    short_clips = [row for head, row in rows.items() if "MDTT on short" in head]
    assert short_clips == [("yes", "CR / CR: 17_10 (2,783) 1.17 (1.17 to 1.17)")]


@pytest.mark.long
@pytest.mark.real
def test_the_papers_order_on_a_clip_of_the_paper(data: Path) -> None:
    case = named([str(data)], None)["17_10"]
    rates = {}
    for variant in (FRAME, COSINES, *CLIPS):
        rates[variant] = at(curve(case, variant), "cm", 0.5, "cr") or 0.0
    assert rates[FRAME] > 1.2 * rates[COSINES]
    assert rates[CLIPS[0]] < rates[CLIPS[1]] < rates[CLIPS[2]]
    assert rates[CLIPS[0]] > rates[FRAME]
