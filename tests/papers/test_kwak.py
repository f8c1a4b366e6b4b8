"""tools.papers kwak: clips, rates, coders, losses, fits, the whole run on generated clips."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.bench.cases import Case
from mcz.bench.report import can_draw
from mcz.cli.common import run as run_command
from mcz.codecs import codec_by_name
from mcz.errors import OptionError
from tests.papers.walks import put_walk
from tools import fit_bit_allocation
from tools.papers.__main__ import command
from tools.papers.kwak import (
    claims,
    clips,
    coder,
    fit,
    losses,
    measure,
    printed,
    tables,
    tasks,
    versus,
)
from tools.papers.kwak.clips import (
    MADE,
    POINTS,
    VIRTUAL,
    Clip,
    find_clips,
    motion_in_positions,
)
from tools.papers.kwak.fit import Point
from tools.papers.kwak.losses import INTRA, LTR, STR, receive, regardless
from tools.papers.kwak.measure import (
    errors,
    rates,
)
from tools.papers.kwak.tasks import (
    CHAINED,
    FIL,
    MOD,
    OURS,
    RC,
    RCA,
    Found,
    rates_task,
)
from tools.papers.kwak.versus import bd


@pytest.fixture(scope="module")
def folder(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The generated walk under names of the paper's clips."""
    found = tmp_path_factory.mktemp("cmu")
    for name in ("13_29", "17_10"):
        put_walk(samples, found, name, 120)
    shutil.copy(samples / "walk.c3d", found / "86_02.c3d")
    shutil.copy(samples / "walk.bvh", found / "unknown.bvh")
    return found


@pytest.fixture(scope="module")
def clip(folder: Path) -> Clip:
    return Clip(Case(str(folder / "17_10.amc")), POINTS)


# Clips


def test_clips_are_markers_then_skeletons(folder: Path) -> None:
    assert [found.name for found in find_clips([str(folder)], None)] == [
        *("13_29.amc, 41 markers", "86_02.c3d", "17_10.amc")
    ]


def test_a_set_of_41_markers_in_mm(folder: Path) -> None:
    case = Case(str(folder / "13_29.amc"))
    made, whole = motion_in_positions(Clip(case, MADE)), motion_in_positions(Clip(case, VIRTUAL))
    assert made.skeleton.n_joints == 41 and made.skeleton.unit_cm == 0.1
    assert len({joint.name for joint in made.skeleton.joints}) == 41
    assert made.frame_rate == 120
    names = [joint.name for joint in whole.skeleton.joints]
    column = 3 * names.index("ltoes+x")
    ours = 3 * [joint.name for joint in made.skeleton.joints].index("ltoes+x")
    scale = 10 * (whole.skeleton.unit_cm or 0)
    expected = whole.values[:, column : column + 3] * scale
    assert made.values[:, ours : ours + 3] == pytest.approx(expected)
    with pytest.raises(OptionError, match="no virtual marker"):
        bvh = mcz.read(folder / "unknown.bvh")
        clips._virtual_markers(replace(bvh, skeleton=replace(bvh.skeleton, unit_cm=1.0)))


# Rates and errors


def test_rates_are_held_or_searched_for(clip: Clip) -> None:
    (free,) = rates(clip, MOD.params, [5.0])
    assert free["kbps"] == pytest.approx(5.0, rel=0.05)
    (held,) = rates(clip, CHAINED.params, [5.0])
    assert held["setting"] == held["target"] == 5.0
    assert held["kbps"] == pytest.approx(5.0, rel=0.2)
    assert held["framed_kbps"] > held["kbps"]


def test_errors_are_those_of_valid_places() -> None:
    source = np.array([[3.0, 0, 0, 9, 9, 9], [0, 4, 0, 8, 8, 8]])
    mask = np.array([[True] * 3 + [False] * 3, [True] * 3 + [False] * 3])
    markers = tuple(
        mcz.Joint(name, channels=tuple(map(mcz.Channel, ("tx", "ty", "tz")))) for name in "ab"
    )
    skeleton = mcz.Skeleton(markers, "s", 0.1)
    motion = mcz.Motion(skeleton, (mcz.Signal(source, mask=mask),))
    sqnr, cm = errors(motion, source + np.array([[0, 0, 0.5, 100, 0, 0], [0, 0, 0, 0, 7, 0]]))
    assert sqnr == pytest.approx(10 * np.log10(25 / 0.25))
    assert cm == pytest.approx(0.1 * 0.25)


# Losses


def test_a_decoder_that_goes_on_regardless_errs_for_good() -> None:
    values = np.arange(8.0)[:, None]
    kinds = [INTRA, STR, LTR, STR, LTR, STR, INTRA, STR]
    lost = np.zeros(8, np.bool_)
    lost[2] = True
    out, decoded = regardless(values, kinds, lost, chain=False)
    assert decoded.tolist() == [True, True, False, False, True, True, True, True]
    # It shows frame 1 for frame 2, and is off by their difference until something intra comes.
    assert out[:, 0].tolist() == [0, 1, 1, 1, 3, 4, 6, 7]
    out, decoded = regardless(values, kinds, lost, chain=True)
    assert decoded.tolist() == [True, True, False, True, True, True, True, True]
    assert out[:, 0].tolist() == [0, 1, 1, 2, 3, 4, 6, 7]


def test_a_live_decoder_goes_on_where_it_can(clip: Clip) -> None:
    motion, codec = motion_in_positions(clip), codec_by_name("online")
    pushed = losses.pushed_by(codec, motion, {"step": 0.5, "gof": 10, "intra_period": 2})
    lost = np.zeros(motion.n_frames, np.bool_)
    whole, _ = receive(codec, pushed, lost)
    lost[25] = lost[30] = True  # an STR frame, and an LTR that is not intra coded
    out, decoded = receive(codec, pushed, lost)
    assert np.flatnonzero(~decoded).tolist() == list(range(25, 40))
    assert (out[25:40] == whole[24]).all()
    assert (out[40:] == whole[40:]).all()


# Fits


def test_the_tool_fits_the_papers_training_clips(
    folder: Path, samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    for path in (folder / "17.asf", folder / "17_10.amc"):
        shutil.copy(path, tmp_path)
    shutil.copy(samples / "walk.asf", tmp_path / "05.asf")
    shutil.copy(samples / "walk.amc", tmp_path / "05_02.amc")
    shutil.copy(samples / "walk.c3d", tmp_path / "01_01.c3d")

    def few(motion: mcz.Motion) -> list[Point]:
        return fit.points_of(motion, (20, 30), (5.0, 9.0), (5.0, 20.0))

    monkeypatch.setattr(fit_bit_allocation, "points_of", few)
    monkeypatch.setattr(fit_bit_allocation, "FEWEST", 5)
    fit_bit_allocation.main(str(tmp_path))
    shown = capsys.readouterr().out
    assert "01_01.c3d: 4 points" in shown and "05_02.amc, 41 markers: 4 points" in shown
    assert "skeletons: 1 clips" in shown and "too few points" in shown
    assert "published -0.4121, 3.2745" in shown
    monkeypatch.setattr(fit_bit_allocation, "FEWEST", 1)
    fit_bit_allocation.main(str(tmp_path))
    shown = capsys.readouterr().out
    assert "17_10.amc, published: BD" in shown and "17_10.amc, fitted: BD" in shown


# Claims


def _points(kbps: tuple[float, ...], sqnr: float) -> list[dict[str, Any]]:
    return [
        {
            "target": t,
            "kbps": r,
            "framed_kbps": r + 0.1,
            "deviation": 9.0,
            "groups": [1],
            "model_kbps": 0.0,
            "sqnr": sqnr + 3 * r,
            "cm": 1.0,
            "sqnr_filtered": sqnr + 3 * r + 2,
            "cm_filtered": 0.8,
        }
        for t, r in zip(printed.TARGETS, kbps, strict=True)
    ]


def test_claims_are_judged_by_the_figures(clip: Clip) -> None:
    found = Found([clip])
    exact = printed.TARGETS
    off = (3.2, *exact[1:])
    for method, kbps, sqnr in ((MOD, exact, 20.0), (RC, off, 22.0), (RCA, exact, 21.0)):
        found.results[rates_task(clip, method, exact)] = _points(kbps, sqnr)
    rows = {row[:2]: row[2:] for row in claims.claims(found).rows}
    assert rows["MOD < RC", "skeletons"] == ("yes", "17_10.amc +2.00 dB")
    assert rows["RC < RCA", "skeletons"][0] == "no"
    assert rows["RCA < FIL", "skeletons"] == ("yes", "17_10.amc +2.00 dB")
    assert rows["MOD < RC < RCA < FIL", "skeletons"][0] == "no"
    assert rows["rates of RC within 1 %", "skeletons"] == ("no", "17_10.amc 6.67 %")
    assert rows["rates of RCA within 1 %", "skeletons"][0] == "yes"
    assert rows["RC deviates by as few bytes a group", "skeletons"] == (
        *("yes", "17_10.amc 9.0 (11.9)"),
    )
    assert rows["MOD < RC", "markers"] == ("-", "no such clip here")
    assert bd(found, clip, MOD, FIL)[0] == pytest.approx(3)
    assert bd(found, clip, MOD, OURS) == (None, None)


# The whole run


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few points, few schemes."""
    monkeypatch.setattr(measure, "MOST_TRIES", 4)
    monkeypatch.setattr("tools.papers.curves.MOST_POINTS", 2)
    monkeypatch.setattr("mcz.bench.measure.MOST_RUNS", 1)
    monkeypatch.setattr(losses, "SCHEMES", losses.SCHEMES[:1])
    monkeypatch.setattr(losses, "SHARES", (0.0, 0.05))
    monkeypatch.setattr(tasks, "SPEEDS", tasks.SPEEDS[:1])
    monkeypatch.setattr(tasks, "OTHER_SPEEDS", ())
    monkeypatch.setattr(tasks, "FILE_RATES", (4.0, 10.0))
    for module in (tasks, versus):
        monkeypatch.setattr(module, "MARKER_RATES", (3.0, 5.0, 7.0))
    for module in (tasks, tables):
        monkeypatch.setattr(module, "CODER_KBPS", (5.0,))
    # Learning a basis takes longer than all else.
    for name in ("CODED", "HELD"):
        monkeypatch.setattr(tasks, name, getattr(tasks, name)[:-1])
    monkeypatch.setattr("tools.papers.kwak.coder.PLACES", coder.PLACES[:3])
    monkeypatch.setattr("tools.papers.kwak.coder.PERIODS", (4, 0))
    monkeypatch.setattr("tools.papers.kwak.coder.GOFS", (30, 2**20))


@pytest.mark.long
@pytest.mark.usefixtures("short")
def test_all_tables_of_generated_clips(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setattr("tools.papers.__main__.default_folder", lambda: tmp_path / "cache")
    out = tmp_path / "out"
    arguments = ["kwak", str(folder), "--jobs", "1"]
    assert run_command(command, "papers", [*arguments, "--out", str(out)]) == 0
    shown, told = capsys.readouterr()
    assert "Kwak and Bajic, claim by claim" in shown
    assert "clips that are not here: 85_12" in told
    document = {t["title"]: t for t in json.loads((out / "results.json").read_text())["tables"]}
    assert len(document) == 14
    for title, table in document.items():
        assert table["rows"], title
    held = document["Kwak and Bajic, Tables VIII and IX: rate control"]["rows"]
    assert [row[1] for row in held] == list(printed.TARGETS)
    assert held[0][-2:] == [3.01, 3.02]
    markers = document["Kwak and Bajic, Table VI: bytes a group"]["rows"]
    assert [row[0] for row in markers] == ["13_29.amc, 41 markers", "86_02.c3d"]
    bd_rows = document["Kwak and Bajic, Table III: BD SQNR and BD rate"]["rows"]
    assert {"MOD", "RC", "RCA", "FIL", "ours", "ours + filter"} <= {row[1] for row in bd_rows}
    if can_draw():
        names = {path.name for path in out.glob("*.png")}
        assert {"kwak_sqnr_markers.png", "kwak_sizes.png", "kwak_losses.png"} <= names
    monkeypatch.setattr("mcz.bench.tasks.perform", lambda *given: pytest.fail("measured again"))
    assert run_command(command, "papers", arguments) == 0
