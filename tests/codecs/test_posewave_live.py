"""Codec qbc, ``posewave``, frame by frame: segments that go on, what is lost, what is promised."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.codecs import by_name
from mcz.codecs.contract import Layout
from mcz.codecs.posewave.choices import PRESETS
from mcz.errors import OptionError
from mcz.motion import Motion
from mcz.writing.signal_source import MemorySource
from tests.codecs.lossy import clip_of

CODEC = by_name("posewave")


def turning(n_frames: int) -> Motion:
    """Sines of several speeds, on a chain of joints."""
    frames = np.arange(n_frames)[:, None]
    values = 30 * np.sin(frames * np.linspace(0.05, 0.2, 8) + np.arange(8))
    return clip_of(values, ["tx", "ty", "tz", "rx", "ry", "rz", "rx", "ry"])


def layout_of(motion: Motion) -> Layout:
    return MemorySource(motion, 0, CODEC, 2**26).layout


def pair(motion: Motion, **params: Any) -> tuple[Any, Any]:
    layout = replace(layout_of(motion), n_frames=0)
    encoder = CODEC.live(layout, CODEC.options(params))
    return encoder, CODEC.follow(encoder.header, layout)


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_holds_in_every_frame(preset: str) -> None:
    motion = turning(60)
    jump = motion.values.copy()
    jump[30:] += 25.0
    motion = replace(motion, signals=(replace(motion.signals[0], values=jump),))
    out = io.BytesIO()
    with mcz.LiveWriter(out, motion.skeleton, "lossy", {"preset": preset}) as live:
        for row in motion.values:
            live.push(row)
    with mcz.open(out.getvalue()) as file:
        error = mcz.compare(motion, file.clips["live"].motion(), virtual_markers=False)
    assert error.max_position_error_cm is not None
    assert error.max_position_error_cm <= PRESETS[preset] * (1 + 1e-9)


def test_a_preset_needs_a_unit_of_length() -> None:
    motion = turning(1)
    unknown = replace(motion, skeleton=replace(motion.skeleton, unit_cm=None))
    with pytest.raises(OptionError, match="step has to be given"):
        pair(unknown)
    encoder, decoder = pair(unknown, step=0.01)
    assert np.abs(decoder.push(*encoder.push(motion.values[0])) - motion.values[0]).max() < 1


def test_nothing_changes_while_frames_come() -> None:
    encoder, _ = pair(turning(1), step=0.1)
    with pytest.raises(OptionError, match="step cannot change"):
        encoder.change({"step": 0.2})
