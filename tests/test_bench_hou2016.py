"""mcz bench --tables hou2016: curves, claims, the way back, the whole run on generated clips."""

from __future__ import annotations

import base64
import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.bench import curves, hou2016, hou2016_claims, hou2016_tasks, panels, ways_back
from mcz.bench.cache import Cache
from mcz.bench.cases import Case, Variant, find_cases, load
from mcz.bench.curves import at, curve, point_of, referenced, references, walk
from mcz.bench.hou2016_tasks import CLIPS, COSINES, FRAME, Found
from mcz.bench.run import bench
from mcz.bench.tasks import Runner, Task, perform
from mcz.cli.common import run as run_command
from mcz.errors import MotionError, OptionError


@pytest.fixture(scope="module")
def case(samples: Path) -> Case:
    return Case(str(samples / "walk.amc"))


@pytest.fixture(scope="module")
def folder(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The generated walk under names of the paper's clips."""
    found = tmp_path_factory.mktemp("cmu")
    shutil.copy(samples / "walk.asf", found / "17.asf")
    for name in ("17_10", "17_03"):
        shutil.copy(samples / "walk.amc", found / f"{name}.amc")
    shutil.copy(samples / "walk.asf", found / "05.asf")
    shutil.copy(samples / "walk.amc", found / "05_01.amc")
    return found


def _record(setting: float, error: float) -> dict[str, Any]:
    return {"setting": setting, "cm": error, "cr": 100 * error**0.5, "cr_without_models": 1.0}


# Curves


@pytest.mark.parametrize("start", [0.001, 0.5, 40.0])
@pytest.mark.parametrize("slope", [0.5, 0.8, 1.2])
def test_a_walk_covers_the_errors_of_the_tables(start: float, slope: float) -> None:
    points = walk(lambda s: _record(s, 0.3 * s**slope), start, lambda s: s)
    errors = [point["cm"] for point in points]
    assert errors == sorted(errors)
    assert errors[0] <= curves.LOW and errors[-1] >= curves.HIGH
    inside = [e for e in errors if curves.LOW <= e <= curves.HIGH]
    assert 4 <= len(inside) <= 9
    assert max(b / a for a, b in zip(inside, inside[1:], strict=False)) < 3


def test_a_walk_ends_where_the_codec_does() -> None:
    def measured(setting: float) -> dict[str, Any]:
        if not 0.2 < setting < 3:
            raise MotionError("no further")
        return _record(setting, setting)

    points = walk(measured, 1.0, lambda s: s)
    assert all(0.2 < point["setting"] < 3 for point in points)
    assert len(points) >= 3


def test_figures_between_points_lie_on_lines_in_logarithms() -> None:
    points = [_record(s, 0.1 * s) for s in (1.0, 4.0, 16.0)]
    assert at(points, "cm", 0.2, "cr") == pytest.approx(100 * math.sqrt(0.2))
    assert at(points, "cr", 100 * math.sqrt(0.8), "cm") == pytest.approx(0.8)
    assert at(points, "cm", 0.05, "cr") is None
    assert at(points[:1], "cm", 0.1, "cr") is None


def test_a_point_has_96_bits_a_point_and_frame(case: Case, tmp_path: Path) -> None:
    loaded = load(case)
    found = point_of(loaded, Variant("lsdt-clip"), {"step": 0.1})
    path = tmp_path / "a.mcz"
    mcz.write(loaded.motion, path, codec="lsdt-clip", step=0.1)
    with mcz.open(path) as file:
        quality = file.only_clip().quality
        again = mcz.compare(loaded.motion, file.only_clip().motion(), virtual_markers=False)
    assert quality is not None
    assert found["cm"] == pytest.approx(again.mean_position_error_cm)
    assert found["cm"] == pytest.approx(float(quality["mean_position_error_cm"]))
    size = 12 * 31 * loaded.motion.n_frames
    assert found["cr"] == pytest.approx(size / found["coded_bytes"])
    without = found["coded_bytes"] - found["model_bytes"]
    assert found["cr_without_models"] == pytest.approx(size / without)


def test_bases_that_are_given_are_in_the_file(case: Case) -> None:
    recipe = (("iterations", 2), ("growth", 0))
    trained = perform(Task("bases", case, arguments=(references([case]), recipe)))
    assert trained["document"]["n_points"] == 31
    points = curve(case, FRAME, trained["data"])
    assert len(points) >= 4
    assert all(p["model_bytes"] > len(base64.b64decode(trained["data"])) for p in points)
    assert referenced(references([case])) == [case]


def test_without_a_unit_there_is_no_curve(samples: Path) -> None:
    found = perform(Task("curve", Case(str(samples / "walk.bvh")), Variant("lsdt-clip")))
    assert "length unit" in found["error"]
    with pytest.raises(OptionError, match="nothing to turn"):
        curve(Case(str(samples / "walk.amc")), Variant("raw"))


def test_speeds_beside_each_other(case: Case) -> None:
    rows = curves.speeds_beside(case, [(Variant("mrdwt"), 1.0), (FRAME, 0.1)])
    assert [(row["label"], row["live"]) for row in rows] == [
        *(("mrdwt", False), ("lsdt-frame", False), ("lsdt-frame", True))
    ]
    assert all(row["encode_fps"] > 0 and row["decode_fps"] > 0 for row in rows)


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
    monkeypatch.setattr(hou2016_tasks, "STEPS_CM", (None,))
    for module in (hou2016_tasks, hou2016_claims):
        monkeypatch.setattr(module, "SPARSITIES", (2, 8))
    monkeypatch.setattr(hou2016_tasks, "ITERATIONS", 2)


@pytest.mark.usefixtures("short")
def test_all_tables_of_a_generated_clip(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    from mcz.cli.bench import command

    monkeypatch.setattr("mcz.bench.cache.default_folder", lambda: tmp_path / "cache")
    out = tmp_path / "out"
    arguments = [str(folder), "--tables", "hou2016", "--jobs", "1"]
    assert run_command(command, "bench", [*arguments, "--out", str(out)]) == 0
    shown, told = capsys.readouterr()
    assert "Hou 2016, claim by claim" in shown
    assert "clips that are not here: 14_08" in told
    tables = {t["title"]: t for t in json.loads((out / "results.json").read_text())["tables"]}
    assert len(tables) == 11
    for title, table in tables.items():
        assert table["rows"], title
    rates = tables["Hou 2016, Fig. 6 and 7: CR at equal D, our coder"]
    assert {row[0] for row in rates["rows"]} == {"17_10"}
    assert "17_03" in str(tables["Bases on a subject that they never saw"]["rows"])
    claimed = {row[0]: row[2] for row in tables["Hou 2016, claim by claim"]["rows"]}
    assert "CR of L = 60 < 120 < 240" in claimed
    assert claimed["LSDT distorts less than DCT and DWT at equal non-zeros"] == "yes"
    assert claimed["clip-LSDT beats frame-LSDT"] == "yes"
    if mcz.bench.plots.can_draw():
        names = {path.name for path in out.glob("*.png")}
        assert {"hou2016_rates.png", "hou2016_convergence.png", "hou2016_spatial.png"} <= names
    monkeypatch.setattr("mcz.bench.tasks.perform", lambda task: pytest.fail("measured again"))
    assert run_command(command, "bench", arguments) == 0


@pytest.mark.usefixtures("short")
def test_without_training_clips_the_rest_remains(folder: Path, tmp_path: Path) -> None:
    alone = tmp_path / "17_10.amc"
    shutil.copy(folder / "17.asf", tmp_path / "17.asf")
    shutil.copy(folder / "17_10.amc", alone)
    outcome = bench(
        [str(alone)], Runner(1, Cache(None)), papers=["hou2016"], with_sweep=False, speeds=False
    )
    titles = [table.title for table in outcome.tables if table.rows]
    assert "Hou 2016, Fig. 6 and 7: CR at equal D, preset hou2016: prefix codes" in titles
    assert "Hou 2016, Fig. 4: P" not in titles


def test_what_cannot_be_measured_is_left_out(tmp_path: Path) -> None:
    found = Found({"17_10": Case("nowhere.amc")}, (), {})
    found.results[Task("curve", found.one, FRAME)] = {"error": "no"}
    assert found.curve("17_10", FRAME) == []
    assert found.cr("17_10", FRAME, 1.0) is None
    (claims,) = [table for table in hou2016.tables(found) if table.rows]
    assert {row[2] for row in claims.rows} == {"-"}
    assert list(panels.draw(list(hou2016.panels(found)), tmp_path)) == []


def test_claims_are_judged_by_the_figures() -> None:
    found = Found({"17_10": Case("nowhere.amc")}, (), {})

    def curve_of(scale: float) -> list[dict[str, Any]]:
        errors = (0.05, 0.5, 5.0)
        return [_record(e, e) | {"cr": scale * 100 * e**0.5, "n_frames": 2783} for e in errors]

    scales = {FRAME: 1.3, COSINES: 0.6, CLIPS[0]: 2.0, CLIPS[1]: 2.6, CLIPS[2]: 2.8}
    for variant, scale in (scales | {hou2016_tasks.MDTT: 2.4, hou2016_tasks.RDO: 3.2}).items():
        found.results[Task("curve", found.one, variant)] = curve_of(scale)
    rows = {row[0]: row[2:] for row in hou2016_claims.claims(found).rows if row[1] == "adaptive"}
    assert rows["frame-LSDT has less distortion than frame-DCT at equal CR"][0] == "yes"
    assert rows["by up to 70% at high CR"][0] == "yes"  # 1 - (0.6 / 1.3)^2 = 79 %
    assert rows["CR of L = 60 < 120 < 240"] == (
        *("yes", "60 to 120, 120 to 240: 17_10 +30.0%, +7.7%"),
    )
    assert rows["little gain from 120 to 240"][0] == "yes"
    assert rows["clip-LSDT beats PCA-RDO"][0] == "no"
    short_clips = [row for head, row in rows.items() if "MDTT on short" in head]
    assert short_clips == [("yes", "CR / CR: 17_10 (2,783) 1.17 (1.17 to 1.17)")]


@pytest.mark.real
def test_the_papers_order_on_a_clip_of_the_paper(data: Path) -> None:
    (case,) = find_cases([str(data)], None, ["17_10"])
    rates = {}
    for variant in (FRAME, COSINES, *CLIPS):
        rates[variant] = at(curve(case, variant), "cm", 0.5, "cr") or 0.0
    assert rates[FRAME] > 1.2 * rates[COSINES]
    assert rates[CLIPS[0]] < rates[CLIPS[1]] < rates[CLIPS[2]]
    assert rates[CLIPS[0]] > rates[FRAME]
