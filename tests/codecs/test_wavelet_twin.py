"""Codec 2, ``mrdwt``, against the plain decoder that was written from SPEC.md alone.

Values are compared bit for bit, and what one decoder refuses the other has to refuse.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import mcz
from mcz.codecs.base import Layout
from tests import plain_wavelets
from tests.codecs.twins import VECTORS, Segments, Twins, rough
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


def plain(
    header: bytes, layout: Layout, segments: Segments, resolution: int, stop: int
) -> list[list[float]]:
    sizes = layout.n_channels, layout.n_frames, layout.n_resolutions
    return plain_wavelets.decode(header, *sizes, segments, resolution, stop)


TWINS = Twins("mrdwt", plain)
# Vectors whose fault lies beside header and streams, or shows in the hash of the values alone.
BESIDE = (
    "groups resolutions-0 samples integers hash-near hash-order segment-not-fresh segment-tail "
    "segment-lead-less segment-lead-more segment-lead-none segment-lead-hidden "
    "approximation-byte-missing detail-byte-missing detail-half-missing"
).split()


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_smooth_clips(settings: dict[str, Any]) -> None:
    for n_frames in (0, 1, 2, 3, 33, 64, 100):
        TWINS.check(TWINS.written(smooth(n_frames), settings))


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
@pytest.mark.parametrize("seed", [1, 2])
def test_rough_clips(settings: dict[str, Any], seed: int) -> None:
    TWINS.check(TWINS.written(rough(70 + seed, seed), {**settings, "T_g": settings["T_g"] * 10}))


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
    TWINS.check_cut({"T_g": 0.1, "segment_frames": 32}, cut, tmp_path)


@pytest.mark.parametrize("path", sorted(VECTORS.glob("valid/mrdwt/*")), ids=lambda p: p.stem)
def test_valid_vectors(path: Path) -> None:
    TWINS.check(path.read_bytes())


@pytest.mark.parametrize("path", sorted(VECTORS.glob("invalid/mrdwt/*")), ids=lambda p: p.stem)
def test_invalid_vectors(path: Path) -> None:
    """Both decoders refuse them, where a decoder without a container can know the fault."""
    if path.stem not in BESIDE:
        TWINS.check_refused(path)


@pytest.mark.parametrize("seed", range(5))
def test_changed_streams(seed: int) -> None:
    signal = TWINS.loaded(smooth(40 + seed), SETTINGS[(2, 5, 6, 7, 8)[seed]])
    TWINS.check_changes(signal, 50, seed)


def canonical_sha256(path: Path) -> str:
    with mcz.open(path) as file:
        values = file.only_clip().read()
    return hashlib.sha256(values.astype("<f8").tobytes()).hexdigest()


def test_interpreted(tmp_path: Path) -> None:
    """The package decodes the same bits where numba compiles nothing."""
    path = tmp_path / "clip.mcz"
    path.write_bytes(TWINS.written(smooth(60), {"T_g": 0.3, "segment_frames": 32}))
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
    TWINS.check(TWINS.written(motion, settings))
