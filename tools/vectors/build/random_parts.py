"""Shared parts of random clips: numbers, texts, skeletons, grids, signals, notes."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Codec
from mcz.model.motion import CHANNEL_KINDS, Channel, Joint, Motion, Skeleton

Chance = random.Random
Ints = NDArray[np.int64]
MOST = 2**40  # of an integer that a lossy codec codes
SPELLED = "fast, forms told"  # fast, whose heads may say the form that their grid has
OLDER = ("raw", SPELLED, *"mrdwt qbc pca dwt awt lsdt-frame lsdt-clip mdtt pca-rdo online".split())
NAMES = (*(name for name in OLDER if name != SPELLED), "best", "posewave", "fast")
LETTERS = "abc\u00e4\u00df 0\u03c9\U0001f6b6\ufeff"


@dataclass(frozen=True, slots=True)
class Clip:
    """A clip and the codec that has its content."""

    codec: Codec
    motion: Motion
    grouping: str


def integer(chance: Chance, most: int = MOST) -> int:
    """An integer of any length, often small, often 0."""
    if chance.random() < 0.3:
        return 0
    n = chance.randrange(1, most.bit_length() + 1 if chance.random() < 0.2 else 9)
    return min(chance.getrandbits(n), most) * chance.choice((-1, 1))


def integers(chance: Chance, n: int, most: int = MOST) -> list[int]:
    """So many: noise, a walk, or all alike."""
    how = chance.randrange(3)
    if how == 0:
        return [integer(chance, most) for _ in range(n)]
    if how == 1:
        return [integer(chance, most)] * n
    found, at = [], 0
    for _ in range(n):
        at = max(-most, min(most, at + chance.randrange(-9, 10)))
        found.append(at)
    return found


def split_count(chance: Chance, n: int, unit: int = 1) -> list[int]:
    """``n`` in parts, all but the last multiples of ``unit``, now and then all of one unit."""
    parts: list[int] = []
    sizes = (1,) if chance.random() < 0.3 else (1, 1, 2, 3, 5, 9)
    while n:
        part = min(n, unit * chance.choice(sizes))
        parts.append(part)
        n -= part
    return parts


def ends(parts: Sequence[int]) -> tuple[int, ...]:
    """Ends of all parts but the last."""
    return tuple(np.cumsum(parts).tolist()[:-1])


def text(chance: Chance, most: int = 9) -> str:
    return "".join(chance.choice(LETTERS) for _ in range(chance.randrange(most)))


def skeleton(chance: Chance, sizes: Sequence[int]) -> Skeleton:
    """Joints of so many channels, others without any between them."""
    joints: list[Joint] = []
    for size in sizes:
        for own in (*[0] * chance.choice((0, 0, 1)), size):
            channels = tuple(any_channel(chance) for _ in range(own))
            parent = chance.randrange(-1, len(joints))
            joints.append(_joint(chance, parent, channels))
    return Skeleton(
        tuple(joints),
        text(chance),
        chance.choice((None, 0.1, 2.54 / 0.45)),
        chance.choice(("", "deg", "rad")),
        chance.choice(("", "x", "y", "z")),
        intrinsic=chance.random() < 0.5,
    )


KINDS = ("", *CHANNEL_KINDS[:14])  # others would change all files that are made at random


def any_channel(chance: Chance) -> Channel:
    kind = chance.choice(KINDS)
    return Channel(kind, text(chance, 4), text(chance, 3))


def _joint(chance: Chance, parent: int, channels: tuple[Channel, ...]) -> Joint:
    def vector() -> tuple[float, float, float]:
        x, y, z = (chance.randrange(-40, 41) / 8 for _ in range(3))
        return x, y, z

    order = chance.choice(("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"))
    turned = chance.random() < 0.3
    return Joint(
        text(chance),
        parent,
        vector() if chance.random() < 0.6 else (0.0, 0.0, 0.0),
        tuple(vector() for _ in range(chance.choice((0, 0, 1, 3)))),
        axis=vector() if turned else (0.0, 0.0, 0.0),
        axis_order=order if turned else "XYZ",
        channels=channels,
        adds_to_offset=chance.random() < 0.5,
    )


def partition(chance: Chance, n: int) -> list[int]:
    """Sizes of joints with ``n`` channels together."""
    found: list[int] = []
    while n:
        found.append(chance.randrange(1, min(n, 4) + 1))
        n -= found[-1]
    return found
