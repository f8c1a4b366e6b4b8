"""Clips that tables are trained on, as the encoder of posewave takes them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import mcz
from mcz.codecs.contract import Layout
from mcz.kinematics.angles import unwrap
from mcz.kinematics.points import reach
from mcz.model.motion import Motion, Skeleton

Floats = NDArray[np.float64]

LEAST_FRAMES = 200  # of a piece behind the first
MOST_NUMBERS = 120_000  # of a piece: one of many channels is cut short
USUAL_CM = 90.0  # of a skeleton whose unit is unknown, as the codec takes it


@dataclass(frozen=True)
class Piece:
    """Frames of a clip, as an encoder's source. ``levels``: the chosen levels by step."""

    layout: Layout
    frames: Floats
    levels: dict[float, int]

    def values(self, first: int, stop: int) -> Floats:
        return self.frames[first:stop]

    def valid(self, first: int, stop: int) -> None:
        return None

    @property
    def skeleton(self) -> Skeleton:
        assert self.layout.skeleton is not None
        return self.layout.skeleton


def pieces_of(motion: Motion, pieces: Sequence[tuple[int, int]]) -> Iterator[Piece]:
    skeleton = motion.skeleton
    assert skeleton is not None
    values = unwrap(np.asarray(motion.values, np.float64), skeleton)
    fill(values)
    channels = tuple(range(values.shape[1]))
    ends = set()
    for first, stop in pieces:
        stop = min(stop, len(values), first + MOST_NUMBERS // len(channels))
        if (first, stop) in ends or (first and stop - first < LEAST_FRAMES):
            continue
        ends.add((first, stop))
        layout = Layout(stop - first, (channels,), skeleton=skeleton)
        yield Piece(layout, values[first:stop], {})


def fill(values: Floats) -> None:
    """Go straight through the gaps of markers, in place."""
    frames = np.arange(len(values))
    for column in values.T:
        known = np.isfinite(column)
        column[:] = np.interp(frames, frames[known], column[known]) if known.any() else 0.0


def step_of(skeleton: Skeleton, step_cm: float) -> float:
    return step_cm if skeleton.unit_cm else step_cm * reach(skeleton) / USUAL_CM


def read(name: str) -> Motion:
    path, _, skeleton = name.partition(":")
    return mcz.read(path, skeleton=skeleton) if skeleton else mcz.read(path)
