"""tools.papers: position error against size, along the dial of a codec."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import pytest

import mcz
from mcz.bench.cases import Case, Variant, load
from mcz.bench.tasks import Task, perform
from mcz.errors import OptionError
from tools.papers import curves
from tools.papers.curves import curve, point_of, reference_cases, references, walk
from tools.papers.kinds import KINDS

FRAME = Variant("lsdt-frame")


@pytest.fixture(scope="module")
def case(samples: Path) -> Case:
    return Case(str(samples / "walk.amc"))


def _record(setting: float, error: float) -> dict[str, Any]:
    return {"setting": setting, "cm": error, "cr": 100 * error**0.5, "cr_without_models": 1.0}


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
    trained = perform(Task("bases", case, arguments=(references([case]), recipe)), KINDS["bases"])
    assert trained["document"]["n_points"] == 31
    points = curve(case, FRAME, trained["data"])
    assert len(points) >= 4
    assert all(p["model_bytes"] > len(base64.b64decode(trained["data"])) for p in points)
    assert reference_cases(references([case])) == [case]


def test_without_a_unit_there_is_no_curve(samples: Path) -> None:
    task = Task("curve", Case(str(samples / "walk.bvh")), Variant("lsdt-clip"))
    found = perform(task, KINDS["curve"])
    assert "length unit" in found["error"]
    with pytest.raises(OptionError, match="no parameter that varies its rate"):
        curve(Case(str(samples / "walk.amc")), Variant("raw"))
