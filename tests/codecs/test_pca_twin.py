"""Codec 4, ``pca``, against the plain decoder that was written from SPEC.md alone.

Values are compared bit for bit, and what one decoder refuses the other has to refuse.
"""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcz.errors import FormatError
from mcz.motion import Motion
from tests import plain_pca
from tests.codecs.lossy import Direct, amc, clip_of, wandering
from tests.motions import smooth

SETTINGS: tuple[dict[str, Any], ...] = (
    {},
    {"q": 3, "segment_frames": 17},
    {"q": 1},
    {"q": 99, "Q": 5},
    {"q": 4, "Q": 0},
    {"preset": "khan2014", "q": 4},
    {"preset": "khan2014", "q": 99, "segment_frames": 20},
)


def plain(coded: Direct, **changes: Any) -> bytes | None:
    """The bytes of the values, None where they are refused."""
    header = changes.get("header", coded.header)
    streams = changes.get("streams", [segment.streams[0] for segment in coded.segments])
    sizes = [segment.n_frames for segment in coded.segments]
    try:
        rows = plain_pca.decode(
            header, coded.layout.n_channels, list(zip(sizes, streams, strict=True))
        )
    except ValueError:
        return None
    return np.array(rows, "<f8").tobytes()


def fast(coded: Direct, **changes: Any) -> bytes | None:
    given: dict[str, Any] = {"header": changes.get("header", coded.header)}
    if "streams" in changes:
        given["fetch"] = lambda segment, r, g: changes["streams"][segment]
    try:
        return coded.read(changes=given).astype("<f8").tobytes()
    except FormatError:
        return None


def rough(n_frames: int, seed: int) -> Motion:
    """Noise, spikes, steps, turns and constants."""
    generator = np.random.default_rng(seed)
    values = np.array(smooth(n_frames).values)
    values[:, 0] = generator.normal(size=n_frames) * 1e4
    values[:, 1] += (generator.random(n_frames) < 0.05) * 1e6
    values[:, 2] = np.cumsum(generator.integers(-9, 10, n_frames))
    values[:, 4], values[:, 5] = 12.5, -0.0
    return clip_of(values, ["tx"] * values.shape[1])


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_clips(settings: dict[str, Any]) -> None:
    motions = [smooth(n) for n in (1, 2, 3, 4, 40)] + [rough(70, 1), wandering(50, ["rx"])]
    for motion in motions:
        coded = Direct("pca", motion, **settings)
        assert plain(coded) == fast(coded)
        assert plain(coded) is not None


@pytest.mark.parametrize("seed", range(4))
def test_changed_streams(seed: int) -> None:
    chance = random.Random(seed)
    coded = Direct("pca", smooth(30 + seed), **SETTINGS[(1, 3, 5, 6)[seed]])
    refused = 0
    for _ in range(80):
        header = bytearray(coded.header)
        streams = [bytearray(segment.streams[0]) for segment in coded.segments]
        chosen = header if chance.random() < 0.1 else chance.choice(streams)
        at = chance.randrange(len(chosen))
        match chance.randrange(5):
            case 0:
                del chosen[at:]
            case 1:
                chosen += bytes([chance.choice((0, 255))])
            case 2:
                chosen[chance.randrange(min(12, len(chosen)))] = chance.randrange(256)
            case _:
                chosen[at] ^= 1 << chance.randrange(8)
        changes = {"header": bytes(header), "streams": [bytes(s) for s in streams]}
        found = plain(coded, **changes)
        assert found == fast(coded, **changes)
        refused += found is None
    assert 10 < refused < 80


@pytest.mark.real
@pytest.mark.parametrize("settings", [{}, {"preset": "khan2014"}], ids=str)
def test_real_clip(settings: dict[str, Any], data: Path) -> None:
    coded = Direct("pca", amc(data, "10_03"), **settings)
    assert plain(coded) == fast(coded) is not None
