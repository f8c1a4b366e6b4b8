"""Codec posewave: errors, bounds, quality, and what is promised frame by frame."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.codecs import codec_by_name
from mcz.codecs.posewave.choices import PRESETS
from mcz.files.writing.signal_source import MemorySource
from mcz.model.motion import Motion, Signal
from mcz.model.numbers import Grid, GridKind
from tests.codecs.lossy import (
    Array,
    Direct,
    amc,
    bytes_of,
    clip_of,
    encode_and_decode,
    encode_file,
    random_walks,
)
from tests.motions import smooth

NAME = "posewave"
CODEC = codec_by_name(NAME)
KINDS = ["tx", "ty", "tz", "rz", "rx", "ry", "rz", "rx"]


def mean_error_cm(motion: Motion, values: Array) -> float:
    found = replace(motion, signals=(Signal(values),))
    error = mcz.compare(motion, found, virtual_markers=False).mean_position_error_cm
    assert error is not None
    return float(error)


@given(
    n_frames=st.integers(0, 70),
    kinds=st.lists(st.sampled_from([*KINDS, "sx", "length", "qw"]), max_size=9),
    step=st.floats(1e-4, 10),
    levels=st.integers(0, 8),
    seed=st.integers(0, 2**32 - 1),
)
def test_what_is_read_is_what_the_encoder_had(
    n_frames: int, kinds: list[str], step: float, levels: int, seed: int
) -> None:
    """An encoder decodes what it codes; a file of it is closed with a hash of the values."""
    motion = random_walks(n_frames, kinds, seed)
    with mcz.open(encode_file(NAME, motion, step=step, levels=levels)) as file:
        assert file.only_clip().read().shape == (n_frames, len(kinds))


@given(step=st.floats(1e-3, 1), seed=st.integers(0, 2**32 - 1))
def test_errors_follow_the_step(step: float, seed: int) -> None:
    motion = random_walks(90, KINDS, seed)
    values = Direct(NAME, motion, step=step).read()
    assert mean_error_cm(motion, values) < 2 * step


@pytest.mark.parametrize("levels", [0, 1, 3, 8])
def test_resolutions(levels: int) -> None:
    motion = smooth(200)
    coded = Direct(NAME, motion, step=0.01, levels=levels)
    assert coded.layout.n_resolutions == levels + 1
    errors = [mean_error_cm(motion, coded.read(resolution=k)) for k in range(levels + 1)]
    assert errors[0] < 0.05
    assert all(a <= 1.05 * b for a, b in zip(errors, errors[1:], strict=False))


def test_channels_that_stand_still_cost_nothing() -> None:
    motion = smooth(400)
    values = np.array(motion.values)
    still = np.repeat(values[:1], len(values), axis=0)
    one = np.where(np.arange(values.shape[1]) == 4, values, still)
    signals = [(Signal(v),) for v in (still, one)]
    sizes = [Direct(NAME, replace(motion, signals=s), step=0.05).n_bytes for s in signals]
    assert sizes[0] < 60 and sizes[1] < 1500


@pytest.mark.parametrize("angle_unit", ["deg", "rad", ""])
def test_angle_units(angle_unit: str) -> None:
    """Channels of an unknown angle unit are coded one by one."""
    motion = clip_of(
        random_walks(120, ["rx", "ry", "rz"], 1).values / 60, ["rx", "ry", "rz"], angle_unit
    )
    full = {"deg": 360.0, "rad": 2 * np.pi, "": 360.0}[angle_unit]
    missed = encode_and_decode(NAME, motion, step=0.01) - motion.values
    missed -= full * np.rint(missed / full)
    assert np.abs(missed).max() < {"deg": 1.0, "rad": 0.5, "": 6.0}[angle_unit]


def test_a_bound_is_met_by_refining_frames() -> None:
    motion = smooth(400)
    data = encode_file(NAME, motion, max_error_cm=0.2)
    with mcz.open(data) as file:
        decoded = file.only_clip().motion()
        quality = file.only_clip().quality
    error = mcz.compare(motion, decoded).max_position_error_cm
    assert error is not None and error <= 0.2
    assert not any("refinement" in key for key in quality)


def test_unknown_units_have_steps_in_their_own() -> None:
    motion = smooth(60)
    motion = replace(motion, skeleton=replace(motion.skeleton, unit_cm=None))
    assert np.isfinite(encode_and_decode(NAME, motion, step=0.05)).all()
    with pytest.raises(mcz.OptionError, match="set the unit"):
        encode_file(NAME, motion, mean_error_cm=0.1)
    with pytest.raises(mcz.OptionError, match="preset bounds the error .*or give step"):
        encode_file(NAME, motion)


@pytest.mark.parametrize(
    ("params", "words"),
    [
        ({"max_error_cm": 1e-9}, "exceeds 2.29 quantizer steps"),
        ({"target_bytes": 10}, r"target_bytes 10 cannot be met: step 1e\+09 gives"),
        (
            {"step": 1, "weights": 1},
            "has no parameter 'weights'; its parameters are preset, step, levels, con",
        ),
        ({"step": 1, "refinement": 1}, "has no parameter 'refinement'"),
        (
            {"step": 1, "quality": "nobdy=1mm"},
            "no joint or group 'nobdy'; the names are feet, hands",
        ),
        ({"step": 1, "lossless": "spne"}, "the names are feet, hands, .*; did you mean 'spine'"),
    ],
)
def test_options_out_of_reach(params: dict[str, Any], words: str) -> None:
    with pytest.raises(mcz.MczError, match=words):
        encode_file(NAME, smooth(20), **params)


def test_errors_where_nothing_is_placed() -> None:
    motion = random_walks(20, ["rx", "ry"])
    motion = replace(motion, skeleton=replace(motion.skeleton, angle_unit=""))
    with pytest.raises(mcz.OptionError, match="max_error_cm 0.5 has no meaning: .*; give step"):
        encode_file(NAME, motion)
    with pytest.raises(
        mcz.OptionError, match="no joint is named like one of the feet; name the joints"
    ):
        encode_file(NAME, motion, step=0.1, lossless="feet")
    assert np.isfinite(encode_and_decode(NAME, motion, step=0.1)).all()


def test_text_of_many_grids() -> None:
    """Numbers off the grid of their channel are as lossy as the others: nothing of them is kept."""
    values = np.random.default_rng(3).uniform(-180, 180, (40, 4))
    values[7], values[9, 2] = 1e-9, -0.0
    motion = clip_of(values)
    motion = replace(motion, signals=(Signal(values, (Grid(GridKind.FIXED, 3),) * 4),))
    with mcz.open(encode_file(NAME, motion, step=0.05)) as file:
        decoded = file.only_clip().motion()
    assert not len(decoded.signals[0].exceptions)
    assert not np.isin([1e-9], decoded.values).any()


@pytest.mark.real
@pytest.mark.parametrize("name", ["16_02", "49_01"])
def test_half_of_mrdwt_at_equal_error(data: Path, name: str) -> None:
    motion = amc(data, name)
    ours = encode_file(NAME, motion, mean_error_cm=0.05)
    theirs = encode_file("mrdwt", motion, mean_error_cm=0.05)
    assert bytes_of(ours) < 0.6 * bytes_of(theirs)


def test_quality_by_joint() -> None:
    """The tails of the arm keep their limit; what the others weigh stays as it was."""
    motion = smooth(300)
    name = motion.skeleton.joints[-1].name
    plain = encode_file(NAME, motion, step=0.2)
    data = encode_file(NAME, motion, step=0.2, quality=f"{name}=0.2mm")
    with mcz.open(data) as file:
        clip = file.only_clip()
        figures = mcz.compare(motion, clip.motion()).by_joint[-1]
        quality = clip.quality
    assert figures.mean_position_error * motion.skeleton.unit_cm <= 0.02
    assert f"quality_reached.{name}" in quality and "param.weights" not in quality
    assert bytes_of(plain) < bytes_of(data) < bytes_of(encode_file(NAME, motion, step=0.01))


@pytest.mark.parametrize("text", ["feet", "feet=1", "feet=1furlong", "feet=0mm", "nobody=1mm"])
def test_qualities_that_mean_nothing(text: str) -> None:
    with pytest.raises(mcz.OptionError, match="quality"):
        encode_file(NAME, smooth(20), step=0.1, quality=text)


# Frame by frame


def sine_chain(n_frames: int) -> Motion:
    """Sines of several speeds, on a chain of joints."""
    frames = np.arange(n_frames)[:, None]
    values = 30 * np.sin(frames * np.linspace(0.05, 0.2, 8) + np.arange(8))
    return clip_of(values, ["tx", "ty", "tz", "rx", "ry", "rz", "rx", "ry"])


def pair(motion: Motion, **params: Any) -> tuple[Any, Any]:
    layout = replace(MemorySource(motion, 0, CODEC, 2**26).layout, n_frames=0)
    encoder = CODEC.live(layout, CODEC.options(params))
    return encoder, CODEC.follow(encoder.header, layout)


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_holds_in_every_frame(preset: str) -> None:
    motion = sine_chain(60)
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
    motion = sine_chain(1)
    unknown = replace(motion, skeleton=replace(motion.skeleton, unit_cm=None))
    with pytest.raises(mcz.OptionError, match="a step must be given"):
        pair(unknown)
    encoder, decoder = pair(unknown, step=0.01)
    decoded = decoder.push(*encoder.push(motion.values[0]))[None]
    again = replace(motion, signals=(replace(motion.signals[0], values=decoded),))
    error = mcz.compare(motion, again, virtual_markers=False).max_position_error_cm
    assert error is not None and error < 0.05  # five steps


def test_nothing_changes_while_frames_come() -> None:
    encoder, _ = pair(sine_chain(1), step=0.1)
    with pytest.raises(mcz.OptionError, match="step cannot change"):
        encoder.change({"step": 0.2})
