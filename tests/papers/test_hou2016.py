"""tools.papers hou2016: curves, claims, the way back, the whole run on generated clips."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from mcz.bench.cases import Case
from mcz.bench.report import can_draw
from mcz.bench.tasks import Task
from mcz.cli.common import run as run_command
from tests.papers.walks import put_walk
from tools.papers import curves
from tools.papers.__main__ import command
from tools.papers.hou2016 import claims, tasks, ways_back
from tools.papers.hou2016.tasks import CLIPS, COSINES, FRAME, Found


@pytest.fixture(scope="module")
def case(samples: Path) -> Case:
    return Case(str(samples / "walk.amc"))


@pytest.fixture(scope="module")
def folder(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The generated walk under names of the paper's clips."""
    found = tmp_path_factory.mktemp("cmu")
    for name in ("17_10", "17_03", "05_01"):
        put_walk(samples, found, name, 40)
    return found


def _record(setting: float, error: float) -> dict[str, Any]:
    return {"setting": setting, "cm": error, "cr": 100 * error**0.5, "cr_without_models": 1.0}


# The way back


def test_exact_places_lead_back(case: Case) -> None:
    found = ways_back.way_back(case, None, True)
    assert found["coded_bytes"] is None and found["seen_cm"] == 0
    assert found["cm"] < 0.001 and found["turn_deg"] < 0.01 and found["channel_deg"] < 0.01


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
    if can_draw():
        names = {path.name for path in out.glob("*.png")}
        assert {"hou2016_rates.png", "hou2016_convergence.png", "hou2016_spatial.png"} <= names
    monkeypatch.setattr("mcz.bench.tasks.perform", lambda *given: pytest.fail("measured again"))
    assert run_command(command, "papers", arguments) == 0


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
