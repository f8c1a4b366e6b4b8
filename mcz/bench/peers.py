"""General compressors on the same clips: the installed ones, and their inputs.

Extra ``bench`` in pyproject.toml installs them. None of them restores a motion file: text, skeleton
and spelling would have to be added.
"""

from __future__ import annotations

import gzip
import io
import lzma
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from time import process_time

import numpy as np
from numpy.typing import NDArray

import mcz
from mcz.bench.cases import LoadedCase
from mcz.bench.measure import cpu_seconds
from mcz.kinematics.angles import unwrap
from mcz.model.types import JsonObject

Record = JsonObject
Matrix = NDArray[np.float32]
Pack = Callable[[bytes], bytes]

TEXT, MATRIX = "source file", "float32 matrix"
DOUBLES, ORDINALS = "float64 matrix", "ordinals"
TOLERANCES = tuple(2.0**k for k in range(-8, 4))  # of zfp, in units of the channels
MODULES = {"zstd": "zstandard", "brotli": "brotli", "pcodec": "pcodec", "blosc2": "blosc2"} | {
    "fpzip": "fpzip",
    "zfp": "zfpy",
}


def installed_peers() -> tuple[str, ...]:
    """The peers that can run here."""
    return ("gzip", "xz", *(name for name, module in MODULES.items() if find_spec(module)))


def missing_peers() -> list[str]:
    """The peers that cannot run, by the name of the missing package."""
    return [module for name, module in MODULES.items() if name not in installed_peers()]


def measure(loaded: LoadedCase) -> list[Record]:
    """One record a peer and input; zfp also with bounds on the error of a value."""
    motion = loaded.motion
    values = np.asarray(motion.signals[0].masked(), np.float64)
    if motion.signals[0].has_poses:
        values = unwrap(values, motion.skeleton)
    matrix = np.ascontiguousarray(np.nan_to_num(values), np.float32)
    source = PeerInput(loaded.data, values, matrix, motion.signals[0].to_ordinals()[0])
    records = [_measure_peer(loaded, peer) for peer in _peers(source)]
    if "zfp" in installed_peers():
        records += _zfp_records(loaded, matrix)
    return records


def _measure_peer(loaded: LoadedCase, peer: Peer) -> Record:
    start = process_time()
    packed = peer.pack()
    took = max(process_time() - start, 1e-9)
    seconds = cpu_seconds(lambda: peer.unpack(packed))
    size = 8 * loaded.motion.signals[0].values.size
    rates = {"encode_fps": loaded.motion.n_frames / took, "decode_gbs": size / seconds / 1e9}
    return _record(loaded, peer.name, peer.what, len(packed)) | rates


def _record(loaded: LoadedCase, name: str, peer: str, size: int) -> Record:
    motion = loaded.motion
    return {
        "peer": name,
        "coded": peer,
        "coded_bytes": size,
        "cr_source": len(loaded.data) / size,
        "cr_float32": 4 * motion.signals[0].values.size / size,
        "cr_40B": 40 * motion.n_frames * motion.skeleton.n_joints / size,
    }


@dataclass(frozen=True, slots=True)
class PeerInput:
    """One clip as peers take it: its file, its values, and these as points of their grids."""

    text: bytes
    values: NDArray[np.float64]
    matrix: Matrix  # of the same values
    ordinals: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Peer:
    """A compressor, and its input."""

    name: str
    what: str
    pack: Callable[[], bytes]
    unpack: Callable[[bytes], object]


def _peers(source: PeerInput) -> Iterator[Peer]:
    """Yield each installed compressor with each kind of input."""
    have = installed_peers()
    general: dict[str, tuple[Pack, Pack]] = {
        "gzip -9": (lambda data: gzip.compress(data, 9, mtime=0), gzip.decompress),
        "xz -9e": (partial(lzma.compress, preset=9 | lzma.PRESET_EXTREME), lzma.decompress),
    }
    if "zstd" in have:
        zstandard = import_module("zstandard")
        packer, unpacker = zstandard.ZstdCompressor(level=19), zstandard.ZstdDecompressor()
        general["zstd -19"] = packer.compress, unpacker.decompress
    if "brotli" in have:
        brotli = import_module("brotli")
        general["brotli 11"] = lambda data: brotli.compress(data, quality=11), brotli.decompress
    for label, data in ((TEXT, source.text), (MATRIX, source.matrix.tobytes())):
        for name, (pack, unpack) in general.items():
            yield Peer(name, label, partial(pack, data), unpack)
    npy = partial(_npy, source.values)
    yield Peer("npy", DOUBLES, npy, lambda data: np.load(io.BytesIO(data)))
    if "pcodec" in have:
        for label, columns in ((ORDINALS, source.ordinals.T), (MATRIX, source.matrix.T)):
            yield Peer("pcodec 8, a column each", label, partial(_pcodec, columns), _unpcodec)
    if "blosc2" in have:
        blosc2 = import_module("blosc2")
        for label, matrix in ((DOUBLES, source.values), (MATRIX, source.matrix)):
            pack = partial(_blosc2, np.ascontiguousarray(matrix))
            yield Peer("blosc2, zstd 9, shuffle", label, pack, blosc2.decompress2)
    if "fpzip" in have:
        fpzip = import_module("fpzip")
        pack = partial(fpzip.compress, source.matrix, precision=0, order="C")
        yield Peer("fpzip", MATRIX, pack, partial(fpzip.decompress, order="C"))
    if "zfp" in have:
        zfpy = import_module("zfpy")
        pack = partial(zfpy.compress_numpy, source.matrix)
        yield Peer("zfp, reversible", MATRIX, pack, zfpy.decompress_numpy)


def _npy(matrix: NDArray[np.float64]) -> bytes:
    stream = io.BytesIO()
    np.save(stream, matrix)
    return stream.getvalue()


def _pcodec(columns: NDArray[np.generic]) -> bytes:
    standalone = import_module("pcodec").standalone
    config = import_module("pcodec").ChunkConfig(compression_level=8)
    columns = np.ascontiguousarray(columns)
    packed = [standalone.simple_compress(column, config) for column in columns]
    return b"".join(len(data).to_bytes(4, "little") + data for data in packed)


def _unpcodec(data: bytes) -> None:
    standalone, at = import_module("pcodec").standalone, 0
    while at < len(data):
        size = int.from_bytes(data[at : at + 4], "little")
        standalone.simple_decompress(data[at + 4 : at + 4 + size])
        at += 4 + size


def _blosc2(matrix: NDArray[np.generic]) -> bytes:
    blosc2 = import_module("blosc2")
    options = {"codec": blosc2.Codec.ZSTD, "clevel": 9, "filters": [blosc2.Filter.SHUFFLE]}
    return bytes(blosc2.compress2(matrix, typesize=matrix.itemsize, **options))


def _zfp_records(loaded: LoadedCase, matrix: Matrix) -> Iterator[Record]:
    """zfp with a bound on the error of a value, and the resulting errors of the motion."""
    zfpy = import_module("zfpy")
    motion = loaded.motion
    for tolerance in TOLERANCES:
        data = zfpy.compress_numpy(matrix, tolerance=tolerance)
        values = np.asarray(zfpy.decompress_numpy(data), np.float64)
        figures = mcz.compare(motion, motion.with_values(values)).entries()
        label = f"{MATRIX}, error of a value at most {tolerance:g}"
        keys = ("mse", "rms_coordinate_error", "mean_position_error", "sqnr_db")
        more = ("mean_position_error_cm", "max_position_error_cm", "virtual_marker_mean_cm")
        record = _record(loaded, "zfp, tolerance", label, len(data))
        yield record | {"params": {"tolerance": tolerance}} | {k: figures[k] for k in keys + more}
