"""Codec 2, ``mrdwt``, against the plain decoder that was written from SPEC.md alone.

Values are compared bit for bit, and what one decoder refuses the other has to refuse.
"""

from __future__ import annotations

import hashlib
import io
import os
import random
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import mcz
from mcz.codecs.base import Request, Span
from mcz.errors import FormatError
from mcz.files.signal_info import SignalInfo
from mcz.motion import Motion, Signal
from mcz.numbers import Grid, GridKind
from tests import plain_wavelets
from tests.motions import smooth

SETTINGS: tuple[dict[str, Any], ...] = (
    {"T_g": 1},
    {"T_g": 1e-4},
    {"T_g": 0.2, "segment_frames": 32},
    {"T_g": 1, "segment_frames": 64, "wavelet": "db8", "N": 3},
    {"T_g": 0.5, "wavelet": "haar", "N": 16},
    {"T_g": 0.5, "wavelet": "coif2", "segment_frames": 32, "N": 2},
    {"T_g": 2, "wavelet": "sym4", "N": 0},
    {"T_g": 0.1, "wavelet": "db2", "Q": 4, "threshold_rule": "flat"},
    {"T_g": 3, "preset": "khan2016"},
)
REAL_SETTINGS: tuple[dict[str, Any], ...] = (
    {},
    {"T_g": 0.2, "segment_frames": 64},
    {"T_g": 10, "preset": "khan2016"},
)


class Stored(NamedTuple):
    """A signal as a file holds it: (first frame, frames, streams) of its segments."""

    info: SignalInfo
    segments: list[tuple[int, int, list[bytes]]]

    def plain(self, resolution: int = 0) -> np.ndarray:
        """What the plain decoder makes of the frames that the clip shows."""
        layout = self.info.layout
        stop = layout.n_frames - self.info.spare
        rows = plain_wavelets.decode(
            self.info.header,
            layout.n_channels,
            layout.n_frames,
            layout.n_resolutions,
            self.segments,
            resolution,
            stop,
        )
        return np.array(rows, "<f8").reshape(stop, layout.n_channels)[self.info.skip :]

    def fast(self, resolution: int = 0) -> np.ndarray:
        """What the codec makes of all stored frames."""
        layout = self.info.layout
        headers = [row.header for row in self.info.rows]
        return self.info.codec.decode(
            self.info.header,
            layout,
            [Span(h.first, h.n_frames, h.lead, h.tail, True) for h in headers],
            Request(0, layout.n_frames, tuple(range(layout.n_channels)), resolution),
            lambda segment, r, group: self.segments[segment][2][r * layout.n_channels + group],
        )


def stored(file: Any, clip: Any) -> Stored:
    info = clip.signals[0]
    layout, segments = info.layout, []
    for row in info.rows:
        table, streams = file.container.streams(row, info.counts, None)
        places = [
            table.codec(r, g) for r in range(layout.n_resolutions) for g in range(layout.n_channels)
        ]
        segments.append((row.header.first, row.header.n_frames, [streams[i] for i in places]))
    return Stored(info, segments)


def written(motion: Motion, settings: dict[str, Any]) -> bytes:
    target = io.BytesIO()
    mcz.write(motion, target, codec="mrdwt", **settings)
    return target.getvalue()


def loaded(motion: Motion, settings: dict[str, Any]) -> Stored:
    with mcz.open(io.BytesIO(written(motion, settings))) as file:
        return stored(file, file.only_clip())


def check_twins(data: bytes) -> None:
    """Every resolution of the only clip, bit for bit."""
    with mcz.open(io.BytesIO(data)) as file:
        clip = file.only_clip()
        signal = stored(file, clip)
        for resolution in range(signal.info.layout.n_resolutions):
            values, _ = clip.read_masked(resolution=resolution)
            assert signal.plain(resolution).tobytes() == values.astype("<f8").tobytes()


VECTORS = Path(__file__).parents[2] / "conformance" / "vectors"
# Vectors whose fault lies beside header and streams, or shows in the hash of the values alone.
BESIDE = (
    "groups resolutions-0 samples integers hash-near hash-order segment-not-fresh segment-tail "
    "segment-lead-less segment-lead-more segment-lead-none "
    "approximation-byte-missing detail-byte-missing detail-half-missing"
).split()


def rough(n_frames: int, seed: int) -> Motion:
    """Noise, spikes, steps, turns, constants and gaps beside the sines."""
    generator = np.random.default_rng(seed)
    motion = smooth(n_frames)
    values = np.array(motion.signals[0].values)
    values[:, 0] = generator.normal(size=n_frames) * 1e4
    values[:, 1] += (generator.random(n_frames) < 0.05) * 1e6
    values[:, 2] = np.cumsum(generator.integers(-9, 10, n_frames))
    values[:, 3] = (np.arange(n_frames) * 17.0 + 180) % 360 - 180
    values[:, 4] = 12.5
    values[:, 5] = -0.0
    mask = generator.random(values.shape) < np.linspace(0, 2, 10)
    grids = (Grid(GridKind.BINARY64),) * 10
    return replace(motion, signals=(Signal(np.where(mask, values, np.nan), grids, mask=mask),))


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_smooth_clips(settings: dict[str, Any]) -> None:
    for n_frames in (0, 1, 2, 3, 33, 64, 100):
        check_twins(written(smooth(n_frames), settings))


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
@pytest.mark.parametrize("seed", [1, 2])
def test_rough_clips(settings: dict[str, Any], seed: int) -> None:
    check_twins(written(rough(70 + seed, seed), {**settings, "T_g": settings["T_g"] * 10}))


@pytest.mark.parametrize(
    "cut",
    [
        {"resolution": 2},
        {"joints": ["spine", "knee"]},
        {"frames": (70, 90)},
        {"frames": (0, 5), "resolution": 1},
        {"frames": (149, 150)},
    ],
    ids=str,
)
def test_extracted_clips(cut: dict[str, Any], tmp_path: Path) -> None:
    source, target = tmp_path / "all.mcz", tmp_path / "cut.mcz"
    source.write_bytes(written(smooth(150), {"T_g": 0.1, "segment_frames": 32}))
    mcz.extract(source, target, **cut)
    check_twins(target.read_bytes())


@pytest.mark.parametrize("path", sorted(VECTORS.glob("valid/mrdwt/*")), ids=lambda p: p.stem)
def test_valid_vectors(path: Path) -> None:
    check_twins(path.read_bytes())


@pytest.mark.parametrize("path", sorted(VECTORS.glob("invalid/mrdwt/*")), ids=lambda p: p.stem)
def test_invalid_vectors(path: Path) -> None:
    """Both decoders refuse them, where a decoder without a container can know the fault."""
    with mcz.open(path) as file:
        if path.stem not in BESIDE:
            signal = stored(file, file.only_clip())
            assert outcome(signal.plain, 0) is None
            assert outcome(signal.fast, 0) is None


def changed(signal: Stored, chance: random.Random) -> Stored:
    """One change of the header or of a stream."""
    header = bytearray(signal.info.header)
    segments = [(first, n, [bytearray(s) for s in own]) for first, n, own in signal.segments]
    full = [s for _, _, own in segments for s in own if s]
    chosen = header if chance.random() < 0.15 else chance.choice(full)
    at = chance.randrange(len(chosen))
    match chance.randrange(6):
        case 0:
            del chosen[at:]
        case 1:
            chosen += bytes([chance.choice((0, 255))])
        case 2:
            chosen[:] = chance.choice(full)
        case 3:
            chosen[0] = chance.randrange(256)
        case _:
            chosen[at] ^= 1 << chance.randrange(8)
    info = replace(signal.info, header=bytes(header))
    return Stored(info, [(first, n, [bytes(s) for s in own]) for first, n, own in segments])


def outcome(decode: Any, resolution: int) -> bytes | None:
    """The bytes of the values; None where they are refused."""
    try:
        values: np.ndarray = decode(resolution)
    except (ValueError, FormatError):
        return None
    return values.astype("<f8").tobytes()


@pytest.mark.parametrize("seed", range(5))
def test_changed_streams(seed: int) -> None:
    chance = random.Random(seed)
    refused = 0
    settings = SETTINGS[(2, 5, 6, 7, 8)[seed]]
    signal = loaded(smooth(40 + seed), settings)
    for _ in range(50):
        other = changed(signal, chance)
        resolution = chance.randrange(signal.info.layout.n_resolutions)
        plain = outcome(other.plain, resolution)
        assert plain == outcome(other.fast, resolution)
        refused += plain is None
    assert 10 < refused < 50


def canonical_sha256(path: Path) -> str:
    with mcz.open(path) as file:
        values = file.only_clip().read()
    return hashlib.sha256(values.astype("<f8").tobytes()).hexdigest()


def test_interpreted(tmp_path: Path) -> None:
    """The package decodes the same bits where numba compiles nothing."""
    path = tmp_path / "clip.mcz"
    path.write_bytes(written(smooth(60), {"T_g": 0.3, "segment_frames": 32}))
    program = (
        "import sys; from pathlib import Path\n"
        "from tests.codecs.test_wavelet_twin import canonical_sha256\n"
        "print(canonical_sha256(Path(sys.argv[1])))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(path)],
        cwd=Path(__file__).parents[2],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == canonical_sha256(path)


@pytest.mark.real
@pytest.mark.parametrize("settings", REAL_SETTINGS, ids=str)
def test_real_clip(settings: dict[str, Any], data: Path) -> None:
    motion = mcz.read(data / "cmu" / "amc" / "05_01.amc")
    check_twins(written(motion, settings))
