"""mcz info --preview: the line is the motion's, the bars are the payload, little is decoded."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.cli.common import run
from mcz.cli.info import info_command
from mcz.cli.info_lines import CELLS, LEVELS, PLAIN_LEVELS, bar, bars_of, motion_energy, sparkline
from mcz.errors import FormatError
from mcz.files.reading.signal_reader import SignalReader
from mcz.model.motion import Motion
from tests.motions import smooth

Call = Any


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Call:
    def call(*words: object) -> tuple[int, str, str]:
        return int(run(info_command, "mcz-info", list(map(str, words)))), *capsys.readouterr()

    return call


@pytest.fixture
def walk(samples: Path, tmp_path: Path) -> Path:
    mcz.encode(samples / "walk.bvh", tmp_path / "walk.mcz")
    return tmp_path / "walk.mcz"


def step_motion(n_frames: int, at: int) -> Motion:
    """Stands still but from frame ``at`` to the next."""
    values = np.zeros((n_frames, 10))
    values[at + 1 :, 0] = 6.0
    return smooth(n_frames).with_values(values)


@given(st.integers(2, 400), st.data())
def test_energy_is_where_it_moves(n_frames: int, data: st.DataObject) -> None:
    at = data.draw(st.integers(0, n_frames - 2))
    found = motion_energy(step_motion(n_frames, at))
    assert found is not None
    assert len(found) == min(CELLS, n_frames - 1)
    edges = np.linspace(0, n_frames - 1, len(found) + 1).astype(int)
    (cell,) = np.flatnonzero(found)
    assert edges[cell] <= at < edges[cell + 1]
    width = edges[cell + 1] - edges[cell]
    assert found[cell] * width == pytest.approx(6.0 * 120, rel=1e-9)  # all points alike


def test_energy_is_the_mean_speed() -> None:
    motion = smooth(241)
    found = motion_energy(motion)
    steps = np.diff(mcz.positions(motion), axis=0)
    speeds = np.linalg.norm(steps, axis=2).mean(axis=1) * 120
    np.testing.assert_allclose(found, speeds.reshape(CELLS, -1).mean(axis=1), rtol=1e-9)


def test_energy_of_what_is_unknown() -> None:
    motion = smooth(97)
    values = motion.values.copy()
    values[48:] = np.nan
    found = motion_energy(motion.with_values(values))
    assert found is not None
    assert np.isnan(found[24:]).all() and np.isfinite(found[:23]).all()
    assert motion_energy(smooth(1)) is None
    assert motion_energy(smooth(0)) is None


def test_of_a_long_clip_few_segments_are_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = smooth(4000)
    mcz.write(motion, tmp_path / "a.mcz", "raw", segment_frames=8)
    read: list[int] = []
    before = SignalReader.read

    def count_read(self: SignalReader, start: int, stop: int) -> Any:
        read.append(stop - start)
        return before(self, start, stop)

    monkeypatch.setattr(SignalReader, "read", count_read)
    with mcz.open(tmp_path / "a.mcz") as file:
        found = motion_energy(file.only_clip())
    assert read == [2] * CELLS
    assert found is not None
    middles = np.linspace(0, 3999, CELLS + 1).astype(int)
    middles = (middles[:-1] + middles[1:]) // 2
    steps = np.linalg.norm(np.diff(mcz.positions(motion), axis=0), axis=2).mean(axis=1)
    np.testing.assert_allclose(found, steps[middles] * 120, rtol=1e-9)


def test_info_adds_it_where_it_is_asked(walk: Path, call: Call) -> None:
    plain = call(walk)[1]
    code, shown, _ = call(walk, "--preview")
    assert code == 0
    assert shown.startswith(plain.rstrip("\n"))
    line = next(line for line in shown.splitlines() if "  motion     " in line)
    assert sum(letter in LEVELS for letter in line) == CELLS
    assert "units/s" in line
    assert "23 others" in shown
    before, after = (json.loads(call(walk, *more, "--json")[1]) for more in ((), ("--preview",)))
    preview = after["clips"][0].pop("preview")
    assert before == after
    assert sum(each["bytes"] for each in preview["payload"]) == after["clips"][0]["payload_bytes"]
    assert len(preview["motion"]["mean_speeds"]) == CELLS


def test_on_a_terminal_it_is_there_by_itself(
    walk: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mcz.cli.info.is_terminal", lambda: True)
    assert "mean speed" in call(walk)[1]
    assert "mean speed" not in call(walk, "--no-preview")[1]
    assert "preview" not in call(walk, "--json")[1]
    monkeypatch.setattr("mcz.cli.info_lines.CHEAP", 1000)
    assert "mean speed" not in call(walk)[1]
    assert "mean speed" in call(walk, "--preview")[1]


def test_a_source_file_has_a_line(samples: Path, call: Call) -> None:
    assert "units/s" in call(samples / "walk.bvh", "--preview")[1]
    assert "cm/frame" in call(samples / "walk.amc", "--preview")[1]
    assert "mean speed" not in call(samples / "walk.bvh")[1]


def test_what_is_damaged_is_shown_without(
    walk: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: Any) -> Any:
        raise FormatError("damaged")

    monkeypatch.setattr("mcz.cli.info.preview_of", fails)
    assert call(walk, "--preview")[:2] == call(walk)[:2]


def test_plain_letters_where_no_others_are(monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = [0.0, 1.0, 2.0, None, 3.99, 4.0]
    for encoding, letters in (
        ("ascii", PLAIN_LEVELS),
        ("utf-8", LEVELS),
        ("latin-1", PLAIN_LEVELS),
    ):
        monkeypatch.setattr(sys, "stdout", type("Out", (), {"encoding": encoding})())
        assert sparkline(numbers) == "".join(
            " " if k is None else letters[k] for k in (0, 2, 4, None, 7, 7)
        )
        assert bar(1.0).encode(encoding)
    monkeypatch.setattr(sys, "stdout", None)
    assert set(bar(0.3)) == {"#"}


@given(st.lists(st.one_of(st.none(), st.floats(0, 1e300)), max_size=60))
def test_a_line_has_a_letter_a_number(numbers: list[float | None]) -> None:
    shown = sparkline(numbers, blocks=True)
    assert [letter == " " for letter in shown] == [number is None for number in numbers]
    heights = {n: LEVELS.index(c) for n, c in zip(numbers, shown, strict=True) if n is not None}
    assert [heights[n] for n in sorted(heights)] == sorted(heights.values())


@given(st.floats(1e-9, 1))
def test_a_bar_is_as_long_as_its_share(share: float) -> None:
    eighths = sum(8 if c == "█" else "▏▎▍▌▋▊▉".index(c) + 1 for c in bar(share, blocks=True))
    assert 0 <= eighths - share * 24 * 8 <= 1 + 1e-6
    assert len(bar(share, blocks=False)) == len(bar(share, blocks=True))


def test_bars_are_the_greatest_and_the_rest() -> None:
    rows = [
        {"signal": "motion", "joints": f"j{n}", "resolution": 0, "bytes": n + 1} for n in range(12)
    ]
    found, rest = bars_of(rows)
    assert found[0] == ("j11", 12)
    assert (len(found), rest) == (8, [("4 others", 1 + 2 + 3 + 4)])
    parts = [{**row, "joints": "all", "resolution": n} for n, row in enumerate(rows[:3])]
    wanted = ["resolution 0, coarsest", "resolution 1", "resolution 2"]
    assert bars_of(parts) == (list(zip(wanted, (1, 2, 3), strict=True)), [])
    assert bars_of([]) == ([], [])
