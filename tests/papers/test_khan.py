"""tools.papers khan2014 and khan2016: a figure that is met, the papers' figures, the whole run."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from mcz.bench.cases import Case, Variant
from mcz.bench.measure import measure
from mcz.cli.common import run as run_command
from mcz.codecs import codec_by_name
from mcz.errors import OptionError
from tools.papers import at_figure, kinds
from tools.papers.__main__ import command


@pytest.fixture(scope="module")
def case(samples: Path) -> Case:
    return Case(str(samples / "walk.amc"))


def test_a_figure_out_of_reach_is_told(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    def of(case: Case, variant: Variant, params: dict[str, float], *, markers: bool) -> Any:
        return {"mse": min(50.0, 1 + params["T_g"])}

    monkeypatch.setattr(at_figure, "measure", of)
    with pytest.raises(OptionError, match="mse 60 is not reached, 1 to 50 is"):
        at_figure.at_figure(case, Variant("mrdwt"), "mse", 60.0)


# The whole run


def test_all_tables_of_generated_clips(
    samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    shutil.copy(samples / "walk.asf", tmp_path / "10.asf")
    shutil.copy(samples / "walk.asf", tmp_path / "09.asf")
    for name in ("10_03", "09_01"):
        shutil.copy(samples / "walk.amc", tmp_path / f"{name}.amc")

    def near(case: Case, variant: Variant, key: str, wanted: float, hint: float) -> Any:
        return measure(
            case, variant, {codec_by_name(variant.codec).dial.parameter: hint}, markers=False
        )

    monkeypatch.setattr(kinds, "at_figure", near)
    out = tmp_path / "out"
    for paper, n_tables in (("khan2014", 5), ("khan2016", 1)):
        arguments = [paper, str(tmp_path), "--jobs", "1", "--no-cache", "--out", str(out)]
        assert run_command(command, "papers", arguments) == 0
        shown, told = capsys.readouterr()
        document = json.loads((out / "results.json").read_text())["tables"]
        assert len(document) == n_tables and all(table["title"] in shown for table in document)
        assert all(table["rows"] for table in document)
        assert "clips that are not here" in told
