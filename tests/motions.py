"""Motions for tests: small skeletons and values, by hand and by hypothesis."""

from __future__ import annotations

import io
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from hypothesis import strategies as st

import mcz
from mcz import Channel, Exceptions, Joint, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind

ROTATIONS = (Channel("rz"), Channel("ry"), Channel("rx"))
POSITIONS = (Channel("tx"), Channel("ty"), Channel("tz"))


def skeleton() -> Skeleton:
    """Four joints of 6, 3, 0 and 1 channels."""
    return Skeleton(
        (
            Joint("hips", -1, (0.0, 1.0, -0.0), (), channels=POSITIONS + ROTATIONS),
            Joint("spine", 0, (0.0, 2.0, 0.5), ((0.0, 1.5, 0.0),), channels=ROTATIONS),
            Joint("fixed", 1, axis=(0.0, 0.0, 20.0), axis_order="ZYX"),
            Joint("knee", 0, (0.0, -2.0, 0.0), channels=(Channel("rx"),), adds_to_offset=False),
        ),
        name="puppet",
        unit_cm=2.5,
        up_axis="y",
    )


def smooth(n_frames: int = 50, **changes) -> Motion:
    """A motion of sines on a grid of four decimals."""
    frames = np.arange(n_frames)[:, None]
    values = np.round(30 * np.sin(frames * np.linspace(0.05, 0.2, 10) + np.arange(10)), 4)
    signal = Signal(values, (Grid(GridKind.FIXED, 4),) * 10)
    arguments = {"frame_rate": Fraction(120), "name": "smooth"} | changes
    return Motion(skeleton(), (signal,), **arguments)


def rich(n_frames: int = 40) -> Motion:
    """Masks, exceptions, a change of grid, frame numbers, copied and constant channels."""
    motion = smooth(n_frames)
    values = motion.values.copy()
    values[:, 9] = values[:, 6]  # the knee repeats the spine
    values[:, 1] = 3.5
    values[n_frames // 2 :, 4] = np.round(values[n_frames // 2 :, 4], 1)
    values[2, 0], values[-1, 9] = 1000, np.nan
    mask = np.ones(values.shape, bool)
    mask[4:6, 3], mask[-3:, 8] = False, False
    signal = Signal(
        values,
        motion.signals[0].grids,
        mask=mask,
        exceptions=Exceptions(np.array([2, n_frames - 1]), np.array([0, 9]), (b"1e3", b"nan")),
        grid_changes=((n_frames // 2, 4, Grid(GridKind.FIXED, 1)),),
    )
    analog = Signal(
        np.arange(2 * n_frames, dtype=np.int64).reshape(-1, 1) ** 2,
        name="analog",
        role="analog",
        samples_per_frame=2,
        channels=(Channel("", "emg", "V"),),
    )
    numbers = np.arange(n_frames) + 5
    numbers[n_frames // 3 :] += 4
    return replace(
        motion, signals=(signal, analog), frame_numbers=numbers, metadata={"subject": "7"}
    )


def write_bytes(motion: Motion, *codec: str, **params: Any) -> bytes:
    """The file that ``mcz.write`` makes."""
    out = io.BytesIO()
    mcz.write(motion, out, *codec, **params)
    return out.getvalue()


def write_and_read(motion: Motion, **params: Any) -> Motion:
    """``motion`` after a file."""
    with mcz.open(write_bytes(motion, **params)) as file:
        return file.only_clip().motion()


@st.composite
def motions(draw: st.DrawFn) -> Motion:
    """Any binary64 values, with masks, other signals and odd names."""
    n_frames = draw(st.integers(0, 12))
    bones = skeleton()
    bits = st.integers(0, 2**64 - 1)
    words = draw(st.lists(bits, min_size=n_frames * 10, max_size=n_frames * 10))
    values = np.array(words, "<u8").view("<f8").reshape(n_frames, 10).astype(np.float64)
    values = np.where(np.isnan(values), np.nan, values)
    mask = None
    if draw(st.booleans()):
        flags = draw(st.lists(st.booleans(), min_size=values.size, max_size=values.size))
        mask = np.array(flags, bool).reshape(values.shape)
    signals = [Signal(values, mask=mask)]
    if draw(st.booleans()):
        rate = draw(st.integers(1, 3))
        integers = st.integers(-(2**53), 2**53)
        samples = draw(st.lists(integers, min_size=n_frames * rate, max_size=n_frames * rate))
        analog = np.array(samples, np.int64).reshape(n_frames * rate, 1)
        channels = (Channel("", "emg", "V"),)
        signals.append(
            Signal(analog, name="analog", role="analog", samples_per_frame=rate, channels=channels)
        )
    name = draw(st.text(min_size=1, max_size=8).filter(_encodable))
    rate = draw(st.one_of(st.none(), st.fractions(Fraction(1, 1000), 10_000, max_denominator=1001)))
    return Motion(bones, tuple(signals), frame_rate=rate, name=name)


def _encodable(text: str) -> bool:
    return all(not 0xD800 <= ord(character) < 0xE000 for character in text)
