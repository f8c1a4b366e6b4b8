"""mcz bench: Bjontegaard deltas, ladders, the cache, the report."""

from __future__ import annotations

import json
import math
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

import mcz
from mcz import Motion, OptionError
from mcz.bench import peers, report, sweep, tasks
from mcz.bench.cases import Case, Variant, find_cases, load, preset_of, variants_of
from mcz.bench.measure import DialRange, cpu_seconds, ladder, measure, peak_bytes, speeds
from mcz.bench.report import bench
from mcz.bench.sweep import bd_rate, bd_sqnr
from mcz.bench.tables import ResultTable
from mcz.bench.tasks import KINDS, Runner, Task, perform
from mcz.cli.common import run as run_command
from mcz.codecs.parameters import Dial
from tests.commands import run
from tests.motions import smooth

SIZES = (1000.0, 2000.0, 4000.0, 8000.0, 16000.0)


def line(factor: float = 1.0, lift: float = 0.0) -> list[tuple[float, float]]:
    """A curve that gains 6 dB with each doubling of its size."""
    return [(factor * size, 30 + lift + 6 * i) for i, size in enumerate(SIZES)]


# Bjontegaard deltas


def test_a_curve_of_half_the_bytes_is_50_percent_and_6_db_better() -> None:
    assert bd_rate(line(), line(0.5)) == pytest.approx(-50)
    assert bd_rate(line(0.5), line()) == pytest.approx(100)
    assert bd_sqnr(line(), line(0.5)) == pytest.approx(6)
    assert bd_sqnr(line(), line(lift=-2.5)) == pytest.approx(-2.5)
    assert bd_rate(line(), line()) == pytest.approx(0)


def test_curves_need_points_and_something_in_common() -> None:
    assert bd_rate(line()[:3], line()) is None
    assert bd_sqnr(line(), line(1000.0)) is None
    assert bd_rate(line(), line(lift=100)) is None
    assert bd_rate(line(), line(lift=24)) is None  # a single quality


def test_points_that_a_smaller_one_matches_do_not_count() -> None:
    bent = [*line(), (5000.0, 30.0), (2000.0, 10.0)]
    assert bd_rate(line(), bent) == pytest.approx(0)


@given(st.lists(st.floats(0.01, 10), min_size=4, max_size=12), st.integers(0, 2**32 - 1))
def test_the_interpolation_is_that_of_scipy(steps: list[float], seed: int) -> None:
    x = np.cumsum(steps)
    y = np.cumsum(np.random.default_rng(seed).uniform(0.01, 10, len(x)))
    low, high = x[0] + 0.1 * (x[-1] - x[0]), x[-1] - 0.2 * (x[-1] - x[0])
    wanted = PchipInterpolator(x, y).integrate(low, high)
    assert sweep._integral(x, y, low, high) == pytest.approx(float(wanted), rel=1e-9)


def test_sqnr_is_that_of_the_definition() -> None:
    motion = smooth(20)
    other = motion.with_values(motion.values + 0.5)
    a, b = mcz.positions(motion), mcz.positions(other)
    wanted = 10 * math.log10(np.sum(a**2) / np.sum((a - b) ** 2))
    assert mcz.compare(motion, other).sqnr_db == pytest.approx(wanted, rel=1e-9)
    assert mcz.compare(motion, motion).sqnr_db is None


# Ladders


@pytest.mark.parametrize("rises", [False, True])
@pytest.mark.parametrize("whole", [False, True])
def test_a_ladder_has_evenly_spaced_sizes(rises: bool, whole: bool) -> None:
    dial = Dial("q", 1.0 if whole else 2.0**-20, 2.0**20, rises=rises, is_integer=whole)

    def size(setting: float) -> float:
        return 50.0 * setting**0.5 if rises else 50_000.0 / setting**0.5

    found = ladder(size, DialRange(dial), (10_000.0, 1_000.0), 8)
    sizes = [size(setting) for setting in found]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] == pytest.approx(10_000, rel=0.2)
    assert sizes[-1] == pytest.approx(1_000, rel=0.2)
    ratios = [a / b for a, b in zip(sizes, sizes[1:], strict=False)]
    assert max(ratios) < 1.7
    assert not whole or all(setting == int(setting) for setting in found)


def test_a_ladder_ends_where_the_dial_or_the_codec_does() -> None:
    settings = DialRange(Dial("q", 2.0**-20, 2.0**20))

    def size(setting: float) -> float:
        if setting > 100:
            raise OptionError("too coarse")
        return 5_000.0 / max(setting, 0.5)

    found = ladder(size, settings, (1e6, 1.0), 6)
    assert size(found[0]) == 10_000
    assert 50 <= size(found[-1]) <= 100
    assert ladder(lambda setting: 7.0, settings, (100.0, 10.0), 6) != []


def test_a_dial_that_does_little_at_first_is_followed() -> None:
    settings = DialRange(Dial("a", 0.25, 2.0**20, rises=True))

    def size(setting: float) -> float:
        return 300.0 + 6 * math.sin(setting) if setting < 20 else 15.0 * setting

    found = ladder(size, settings, (20_000.0, 800.0), 8)
    assert len(found) == 8
    assert 15_000 < size(found[0]) < 25_000


# On generated clips


@pytest.fixture(scope="module")
def case(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Case:
    """The first 48 frames of the walk: points at many settings are measured of them."""
    walk = tmp_path_factory.mktemp("short") / "walk.amc"
    assert run("convert", samples / "walk.amc", walk, "--frames", "0:48") == 0
    shutil.copy(samples / "walk.asf", walk.parent)
    return Case(str(walk))


def test_variants(monkeypatch: pytest.MonkeyPatch) -> None:
    labels = [variant.label for variant in variants_of([])]
    assert {"raw", "best", "mrdwt", "mrdwt khan2016"} <= set(labels)
    (narrow,) = variants_of(["mrdwt:khan2016:N=3"])
    assert narrow == Variant("mrdwt", (("preset", "khan2016"), ("N", 3)))
    assert narrow.label == "mrdwt khan2016 N=3"
    assert [v.label for v in variants_of(["raw", "raw"])] == ["raw"]
    with pytest.raises(OptionError, match="no codec is called"):
        variants_of(["nonsense"])
    with pytest.raises(OptionError, match="has no parameter"):
        variants_of(["raw:x=1"])


def test_cases_of_folders(samples: Path, tmp_path: Path) -> None:
    assert [Path(c.path).suffix for c in find_cases([str(samples)], None)] == [
        *(".amc", ".bvh", ".c3d")
    ]
    twice = find_cases([str(samples / "walk.bvh"), str(samples)], "cm")
    assert twice[0] == Case(str(samples / "walk.bvh"), "cm") and len(twice) == 3
    with pytest.raises(OptionError, match="no clip"):
        find_cases([str(tmp_path)], None)


def test_a_point_is_what_the_quality_record_says(case: Case, tmp_path: Path) -> None:
    found = measure(case, Variant("mrdwt"), {"T_g": 0.5})
    mcz.write(load(case).motion, tmp_path / "a.mcz", codec="mrdwt", T_g=0.5)
    with mcz.open(tmp_path / "a.mcz") as file:
        quality = file.only_clip().quality
    assert quality is not None
    for key in ("mse", "sqnr_db", "mean_position_error_cm", "virtual_marker_max_cm"):
        assert float(quality[key]) == pytest.approx(found[key], rel=1e-9)
    assert found["cr_source"] == pytest.approx(len(load(case).data) / found["coded_bytes"])


def test_speeds_and_memory_are_of_the_codec(case: Case) -> None:
    found = speeds(case, Variant("raw"), {})
    for name in ("encode", "decode", "write", "read"):
        wanted = found[f"{name}_fps"] / found["parse_fps"]
        assert found[f"{name}_to_parse"] == pytest.approx(wanted)
    assert found["decode_peak_bytes"] >= load(case).motion.values.nbytes // 2
    assert peak_bytes(lambda: np.zeros(2**20, "u1")) >= 2**20
    assert cpu_seconds(lambda: None) > 0


def test_speeds_of_a_file_of_mcz(samples: Path, tmp_path: Path) -> None:
    path = tmp_path / "walk.mcz"
    mcz.encode(samples / "walk.bvh", path, unit="cm")
    assert speeds(Case(str(path)), Variant("raw"), {})["parse_fps"] > 0


def test_a_second_run_comes_from_the_cache(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = tasks.Cache(tmp_path / "cache")
    task = Task("point", case, preset_of("mrdwt", "khan2016"), (("T_g", 3.0),))
    first = Runner(1, kept).run([task, task])
    monkeypatch.setattr(tasks, "perform", lambda *given: pytest.fail("measured again"))
    again = Runner(1, kept)
    assert again.run([task]) == first
    assert (again.n_cached, again.n_run) == (1, 0)
    for path in (tmp_path / "cache").rglob("*.json"):
        path.write_text("{")
    assert kept.get(tasks.key_of(task)) is None  # damaged is the same as not there


def test_keys_tell_apart_what_matters(case: Case, samples: Path) -> None:
    base = Task("point", case, Variant("mrdwt"), (("T_g", 3.0),))
    others = [
        Task("speeds", case, Variant("mrdwt"), (("T_g", 3.0),)),
        Task("point", case, Variant("mrdwt"), (("T_g", 3.5),)),
        Task("point", case, preset_of("mrdwt", "khan2016"), (("T_g", 3.0),)),
        Task("point", Case(case.path, "cm"), Variant("mrdwt"), (("T_g", 3.0),)),
        Task("point", Case(str(samples / "walk.bvh")), Variant("mrdwt"), (("T_g", 3.0),)),
    ]
    assert len({tasks.key_of(task) for task in (base, *others)}) == 1 + len(others)


def test_a_cache_that_cannot_be_written_is_none(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    kept = tasks.Cache(tmp_path / "file")
    kept.put("a", 1)
    assert kept.get("a") is None
    assert tasks.Cache(None).get("a") is None


def test_what_a_codec_refuses_is_told(case: Case) -> None:
    found = perform(Task("point", case, Variant("mrdwt"), (("T_g", -1.0),)), KINDS["point"])
    assert "T_g" in found["error"]


def test_peers_say_what_they_code(case: Case) -> None:
    records = peers.measure(load(case))
    assert {"gzip -9", "xz -9e"} <= {r["peer"] for r in records}
    kinds = {peers.TEXT, peers.MATRIX, peers.DOUBLES}
    assert kinds <= {r["coded"].split(",")[0] for r in records} <= kinds | {peers.ORDINALS}
    assert all(r["coded_bytes"] > 0 and r["decode_gbs"] > 0 for r in records)


def test_whole_run_with_report(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    from mcz.cli.codecs import bench_command

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(tasks, "default_folder", lambda: tmp_path / "cache")
    out = tmp_path / "out"
    arguments = [case.path, "--codecs", "fast,mrdwt", "--no-speeds", "--jobs", "1"]
    assert run_command(bench_command, "bench", [*arguments, "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "walk: points" in shown
    assert "Bjontegaard delta rate" in shown
    results = json.loads((out / "results.json").read_text())
    (clip,) = results["clips"]
    assert [c["label"] for c in clip["codecs"]] == ["fast", "mrdwt", "mrdwt khan2016"]
    sizes = [p["coded_bytes"] for p in clip["codecs"][1]["points"]]
    assert len(sizes) >= 8
    assert sizes == sorted(sizes, reverse=True)
    assert len(clip["codecs"][0]["points"]) == 1
    markdown = (out / "report.md").read_text()
    assert "| codec | setting |" in markdown
    if report.can_draw():
        assert {path.name for path in out.glob("*.png")} == {"walk.png", "walk_mrdwt.png"}
        assert "![walk.png](walk.png)" in markdown
    page = (out / "index.html").read_text("utf-8")
    for table in results["tables"]:
        assert f">{table['title']}</h2>" in page
    assert page.count("<img") == page.count('src="data:image/png;base64,')
    assert page.count("<img") == (2 if report.can_draw() else 0)
    assert page.count('prefers-color-scheme: dark)" srcset') == page.count("<img")
    pictures = re.findall(r'(?:src|srcset)="(data:[^"]*)"', page)
    assert len(set(pictures)) == 2 * page.count("<img")  # dark ones are others
    assert "http" not in page.replace("http-equiv", "")  # all is in it
    assert page.count("default-src 'none'") == 1
    assert "<script" not in page
    # Without matplotlib: everything else, and a plain word about it.
    monkeypatch.setattr(report, "can_draw", lambda: False)
    assert run_command(bench_command, "bench", [*arguments, "--out", str(tmp_path / "bare")]) == 0
    assert "matplotlib is not installed" in capsys.readouterr().err
    assert not list((tmp_path / "bare").glob("*.png"))
    assert (tmp_path / "bare" / "index.html").exists()
    assert run_command(bench_command, "bench", [*arguments, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["clips"] == results["clips"]


def test_errors_are_one_line(samples: Path, tmp_path: Path, capsys: Any) -> None:
    from mcz.cli.codecs import bench_command

    walk = str(samples / "walk.amc")
    assert run_command(bench_command, "bench", [str(tmp_path / "no.amc")]) == 1
    assert run_command(bench_command, "bench", [walk, "--codecs", "nonsense"]) == 2
    assert run_command(bench_command, "bench", [walk, "--tables", "khan2014"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    assert "python -m tools.papers khan2014" in lines[2]


def test_tables_escape_and_leave_out() -> None:
    table = ResultTable("t", "c", (("a|b", ""), ("n", ".1f")), [("x", None), ("y", 2.0)])
    assert list(table.markdown())[4:8] == [
        *("| a\\|b | n |", "| --- | ---: |", "| x | - |", "| y | 2.0 |")
    ]
    assert table.document()["rows"] == [["x", None], ["y", 2.0]]


def test_a_clip_without_unit_has_length_units(samples: Path, tmp_path: Path) -> None:
    mcz.write(mcz.read(samples / "walk.bvh")[:60], tmp_path / "walk.mcz")
    outcome = bench(
        [str(tmp_path / "walk.mcz")],
        Runner(1, tasks.Cache(None)),
        codecs=["mrdwt:khan2016"],
        speeds=False,
    )
    (clip,) = outcome.clips
    assert (clip.unit_cm, clip.unit, clip.error_key) == (
        None,
        "length units",
        "mean_position_error",
    )
    assert any("length units" in table.caption for table in outcome.tables)


def test_a_clip_of_markers(samples: Path) -> None:
    case = Case(str(samples / "walk.c3d"))
    motion: Motion = load(case).motion
    found = perform(Task("point", case, Variant("mrdwt"), (("T_g", 1.0),)), KINDS["point"])
    assert found["cr_float32"] > 1
    assert (found["cr_source"] is None) == (len(motion.signals) > 1)


def test_without_clips_it_takes_a_walk_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    from mcz.cli.codecs import bench_command

    options = ["--codecs", "qbc:khan2014", "--no-speeds", "--no-cache", "--jobs", "1", "--json"]
    assert run_command(bench_command, "bench", options) == 0
    (clip,) = json.loads(capsys.readouterr().out)["clips"]
    assert clip["name"] == "walk" and clip["codecs"][0]["points"]
