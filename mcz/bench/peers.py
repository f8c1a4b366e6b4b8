"""General compressors on the same clips: those that are installed, and what of the clip they code.

Extra ``bench`` in pyproject.toml brings them. None of them gives a motion file back from the
matrix: text, skeleton and spelling would come on top.
"""

from __future__ import annotations

import gzip
import lzma
from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.util import find_spec
from time import process_time

import numpy as np
from numpy.typing import NDArray

import mcz
from mcz.angles import unwrap
from mcz.bench.cases import Loaded
from mcz.types import JsonObject

Record = JsonObject
Matrix = NDArray[np.float32]
Pack = Callable[[bytes], bytes]

TEXT, MATRIX = "source file", "float32 matrix"
TOLERANCES = tuple(2.0**k for k in range(-8, 4))  # of zfp, in units of the channels
MODULES = {"zstd": "zstandard", "brotli": "brotli", "pcodec": "pcodec", "blosc2": "blosc2"} | {
    "fpzip": "fpzip",
    "zfp": "zfpy",
}


def installed() -> tuple[str, ...]:
    """The peers that can run here."""
    return ("gzip", "xz", *(name for name, module in MODULES.items() if find_spec(module)))


def missing() -> list[str]:
    """The peers that cannot, by the name of what would have to be installed."""
    return [module for name, module in MODULES.items() if name not in installed()]


def measure(loaded: Loaded) -> list[Record]:
    """One record a peer and what it codes; zfp also with bounds on the error of a value."""
    motion = loaded.motion
    values = np.asarray(motion.signals[0].masked(), np.float64)
    if motion.signals[0].has_poses:
        values = unwrap(values, motion.skeleton)
    matrix = np.ascontiguousarray(np.nan_to_num(values), np.float32)
    records = []
    for name, what, pack in _packers(matrix):
        start = process_time()
        size = len(pack(loaded.data if what == TEXT else matrix.tobytes()))
        took = max(process_time() - start, 1e-9)
        records.append(_record(loaded, name, what, size) | {"encode_fps": motion.n_frames / took})
    if "zfp" in installed():
        records += _bounded(loaded, matrix)
    return records


def _record(loaded: Loaded, name: str, what: str, size: int) -> Record:
    motion = loaded.motion
    return {
        "peer": name,
        "coded": what,
        "coded_bytes": size,
        "cr_source": len(loaded.data) / size,
        "cr_float32": 4 * motion.signals[0].values.size / size,
        "cr_40B": 40 * motion.n_frames * motion.skeleton.n_joints / size,
    }


def _packers(matrix: Matrix) -> Iterator[tuple[str, str, Pack]]:
    """Name, what is coded, and a function of its bytes."""
    have = installed()
    general: dict[str, Pack] = {
        "gzip -9": lambda data: gzip.compress(data, 9, mtime=0),
        "xz -9e": lambda data: lzma.compress(data, preset=9 | lzma.PRESET_EXTREME),
    }
    if "zstd" in have:
        zstandard = import_module("zstandard")
        general["zstd -19"] = lambda data: zstandard.ZstdCompressor(level=19).compress(data)
    if "brotli" in have:
        brotli = import_module("brotli")
        general["brotli 11"] = lambda data: brotli.compress(data, quality=11)
    for what in (TEXT, MATRIX):
        for name, pack in general.items():
            yield name, what, pack
    if "pcodec" in have:
        yield "pcodec, channel by channel", MATRIX, lambda data: _pcodec(matrix)
    if "blosc2" in have:
        yield "blosc2, zstd 9, shuffle", MATRIX, lambda data: _blosc2(matrix)
    if "fpzip" in have:
        fpzip = import_module("fpzip")
        yield "fpzip", MATRIX, lambda data: bytes(fpzip.compress(matrix, precision=0, order="C"))
    if "zfp" in have:
        zfpy = import_module("zfpy")
        yield "zfp, reversible", MATRIX, lambda data: bytes(zfpy.compress_numpy(matrix))


def _pcodec(matrix: Matrix) -> bytes:
    pcodec = import_module("pcodec")
    columns = np.ascontiguousarray(matrix.T)
    config = pcodec.ChunkConfig()
    return b"".join(pcodec.standalone.simple_compress(column, config) for column in columns)


def _blosc2(matrix: Matrix) -> bytes:
    blosc2 = import_module("blosc2")
    options = {"codec": blosc2.Codec.ZSTD, "clevel": 9, "filters": [blosc2.Filter.SHUFFLE]}
    return bytes(blosc2.compress2(matrix, typesize=4, **options))


def _bounded(loaded: Loaded, matrix: Matrix) -> Iterator[Record]:
    """zfp with a bound on the error of a value, and what that does to the motion."""
    zfpy = import_module("zfpy")
    motion = loaded.motion
    for tolerance in TOLERANCES:
        data = zfpy.compress_numpy(matrix, tolerance=tolerance)
        values = np.asarray(zfpy.decompress_numpy(data), np.float64)
        found = mcz.compare(motion, motion.with_values(values)).entries()
        what = f"{MATRIX}, error of a value at most {tolerance:g}"
        keys = ("mse", "rms_coordinate_error", "mean_position_error", "sqnr_db")
        more = ("mean_position_error_cm", "max_position_error_cm", "virtual_marker_mean_cm")
        record = _record(loaded, "zfp, tolerance", what, len(data))
        yield record | {"params": {"tolerance": tolerance}} | {k: found[k] for k in keys + more}
