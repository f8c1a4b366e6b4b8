"""Salvaged values marked valid equal the whole file's, whichever segment is lost."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import mcz
from conformance.run import HERE
from mcz.container.chunks import OPEN_LENGTH

VECTORS = HERE / "vectors" / "valid"
CODECS = sorted(path.name for path in VECTORS.iterdir() if path.name != "random")
MOST_BYTES, MOST_FILES, MOST_SEGMENTS = 20_000, 12, 5

Arrays = dict[tuple[str, str], tuple[np.ndarray, np.ndarray]]


def segments_of(data: bytes) -> list[int]:
    """Offsets of the non-empty payloads of closed DATA."""
    starts = [match.end() for match in re.finditer(rb"DATA.\x00..(?=.{8})", data, re.DOTALL)]
    lengths = {at: int.from_bytes(data[at : at + 8], "little") for at in starts}
    return [at + 8 for at, n in lengths.items() if n != OPEN_LENGTH and 0 < n < len(data) - at]


def arrays_of(data: bytes, *, salvage: bool = False) -> Arrays:
    """Values and what of them is valid, by clip and signal."""
    found: Arrays = {}
    with mcz.open(data, salvage=salvage) as file:
        for clip in file.clips.values():
            for signal in clip.signals:
                values, mask = clip.read_masked(signal=signal.index)
                valid = np.ones(values.shape, np.bool_) if mask is None else mask.astype(np.bool_)
                found[clip.name, signal.name] = values, valid
    return found


def damaged_files(folder: str) -> list[tuple[Path, list[int]]]:
    """Files of a folder of vectors that have several segments, and where these are."""
    paths = sorted((VECTORS / folder).rglob("*.mcz"))
    several = [(path, segments_of(path.read_bytes())) for path in paths]
    several = [
        (path, at) for path, at in several if len(at) > 2 and path.stat().st_size < MOST_BYTES
    ]
    return several[:: max(1, len(several) // MOST_FILES)]


@pytest.mark.parametrize("folder", CODECS)
def test_what_is_called_valid_is_right(folder: str) -> None:
    for path, starts in damaged_files(folder):
        data = path.read_bytes()
        whole = arrays_of(data)
        for at in starts[1 : 1 + MOST_SEGMENTS]:
            harmed = bytearray(data)
            harmed[at] ^= 0xFF
            for key, (values, valid) in arrays_of(bytes(harmed), salvage=True).items():
                expected = whole[key][0][: len(values)]
                kept = valid[: len(expected)]
                assert np.array_equal(values[: len(expected)][kept], expected[kept], True), (
                    f"{path}: byte {at}"
                )
