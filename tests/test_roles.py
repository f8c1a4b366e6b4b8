"""Roles of signals: what a signal is, whatever its name."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import Channel, Motion, MotionError, Signal
from mcz.sources import sample
from mcz.sources.c3d import c3d
from tests.commands import run
from tests.formats.c3d_files import make_c3d
from tests.motions import write_bytes

C3D = c3d.read(make_c3d(3, 2, 2, 2, size=2).build(), "gait")


def beside(values: Sequence[float], unit: str = "s", **about: object) -> Signal:
    column = np.array(values)[:, None]
    return Signal(column, channels=(Channel("", "x", unit),), **about)  # type: ignore[arg-type]


def walk(*more: Signal, n: int = 4) -> Motion:
    plain = sample.bvh_walk()
    first = plain.signals[0].cut(0, n)
    return replace(plain, signals=(first, *more), source=None, frame_numbers=None)


def write_and_open(motion: Motion) -> mcz.File:
    return mcz.open(write_bytes(motion))


def test_signals_that_say_no_role_are_the_motion_and_others() -> None:
    motion = walk(beside([1, 2, 3, 4], name="motion"))
    assert [signal.role for signal in motion.signals] == ["motion", ""]
    assert motion.motion_signal is motion.signals[0]
    assert motion.signals_of("analog") == ()


def test_roles_come_back_under_any_names() -> None:
    renamed = replace(
        C3D, signals=tuple(replace(s, name=f"s{k}") for k, s in enumerate(C3D.signals))
    )
    with write_and_open(renamed) as file:
        clip = file.only_clip()
        assert [info.role for info in clip.signals] == [s.role for s in C3D.signals]
        assert clip.motion_signal is not None and clip.motion_signal.name == "s0"
        (residuals,) = clip.signals_of("residuals")
        assert residuals.of == 0
        assert clip.source_bytes() == c3d.write(C3D)
        again = clip.motion()
    assert mcz.compare(C3D, again).mse == 0
    assert c3d.write(replace(again, source=None)) == c3d.write(replace(C3D, source=None))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ((beside([0, 1, 2, 3], role="motion"),), "only the first signal can be a motion"),
        ((beside([0, 1, 2, 3], role="times"),) * 2, "more than one signal of times"),
        ((beside([0, 1, 1, 0], role="times"),), "decrease at frame 3"),
        ((beside([0, 1, np.nan, 3], role="times"),), "frame 2 is unknown"),
        ((beside([0, 1, 2, 3], "min", role="times"),), "unit 'min'"),
        ((beside([0, 1, 2, 3], role="residuals"),), "of is None"),
        ((beside([0, 1, 2, 3], role="residuals", of=1),), "residuals of signal 1"),
        ((beside([0, 1, 2, 3], role="residuals", of=2),), "residuals of signal 2"),
        ((beside([0, 1, 2, 3], of=0),), "of is 0"),
    ],
)
def test_roles_that_cannot_be(more: tuple[Signal, ...], words: str) -> None:
    with pytest.raises(MotionError, match=words):
        walk(*more)
    with pytest.raises(MotionError, match="role"):
        beside([0], role="forces")


def test_signals_that_are_left_out_take_their_residuals_role() -> None:
    motion = walk(beside([0, 1, 2, 3], role="analog"), beside([0, 1, 2, 3], role="residuals", of=1))
    assert [(s.role, s.of) for s in motion.with_signals([0, 2]).signals][1] == ("", None)
    turned = motion.with_signals([0, 2, 1]).signals
    assert [(s.role, s.of) for s in turned][1:] == [("residuals", 2), ("analog", None)]


def test_a_clip_without_a_motion(tmp_path: Path) -> None:
    channels = (Channel("", "emg", "V"),)
    signal = Signal(np.arange(8)[:, None], role="analog", samples_per_frame=2, channels=channels)
    motion = Motion(mcz.Skeleton(()), (signal,), 50)
    path = tmp_path / "emg.mcz"
    mcz.write(motion, path)
    with mcz.open(path) as file:
        clip = file.only_clip()
        assert clip.motion_signal is None and clip.signals[0].role == "analog"
        assert clip.read()[:, 0].tolist() == list(range(8))
        assert clip.motion((1, 3)).signals[0].role == "analog"
        with pytest.raises(MotionError, match="channels"):
            mcz.positions(clip)
    assert run("verify", str(path)) == 0
    assert run("info", str(path)) == 0


def test_info_names_roles(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "walk.mcz"
    mcz.write(walk(beside([0, 1, 2, 3], name="clock", role="times")), path)
    assert run("info", "--json", str(path)) == 0
    document = json.loads(capsys.readouterr().out)
    clip = document["clips"][0]
    assert [signal["role"] for signal in clip["codecs"]] == ["motion", "times"]
    assert run("info", str(path)) == 0
    assert "clock (times)" in capsys.readouterr().out
