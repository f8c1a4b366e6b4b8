"""Compare sizes of NPZ files: ``python -m tools.array_sizes FILES OR FOLDERS``.

Sums over all files: the NPZ as it is, ``numpy.savez_compressed``, xz -9e of the file, the arrays
by blosc2 (shuffle and zstd, by rows or columns, whichever is less) and by pcodec (column after
column), and mcz with --effort fast and best, whose files are decoded and compared byte for byte.
"""

from __future__ import annotations

import io
import lzma
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import blosc2
import numpy as np
from pcodec import ChunkConfig, standalone

import mcz

EFFORTS = ("fast", "best")
ZSTD = {"codec": blosc2.Codec.ZSTD, "clevel": 9, "filters": [blosc2.Filter.SHUFFLE]}
NAMES = ("npz", "npz_compressed", "xz -9e", "blosc2", "pcodec", *EFFORTS)


def compressed_size(arrays: dict[str, Any]) -> int:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.tell()


def blosc(array: Any) -> int:
    if array.dtype.kind not in "fiu":
        return int(array.nbytes)
    ways = (np.ascontiguousarray(array), np.ascontiguousarray(array.T))
    options: dict[str, Any] = {"typesize": array.dtype.itemsize, **ZSTD}
    return min(len(blosc2.compress2(way.tobytes(), **options)) for way in ways)


def pco(array: Any) -> int:
    if array.dtype.kind not in "fiu" or not array.ndim:
        return int(array.nbytes)
    columns = array.reshape(len(array), -1).T
    config = ChunkConfig()
    return sum(
        len(standalone.simple_compress(np.ascontiguousarray(column), config)) for column in columns
    )


def measure(path: Path, folder: Path, times: dict[str, float]) -> dict[str, int]:
    data = path.read_bytes()
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    sizes = {
        "npz": len(data),
        "npz_compressed": compressed_size(arrays),
        "xz -9e": len(lzma.compress(data, preset=9 | lzma.PRESET_EXTREME)),
        "blosc2": sum(map(blosc, arrays.values())),
        "pcodec": sum(map(pco, arrays.values())),
    }
    for effort in EFFORTS:
        target = folder / "out.mcz"
        start = time.perf_counter()
        mcz.encode(path, target, effort=effort, force=True)
        times[effort] += time.perf_counter() - start
        sizes[effort] = target.stat().st_size
        with mcz.open(target) as opened:
            if opened.only_clip(None).source_bytes() != data:
                raise SystemExit(f"{path}: {effort} does not give it back")
    return sizes


def main(arguments: list[str]) -> None:
    paths = [
        p for a in map(Path, arguments) for p in (sorted(a.glob("*.npz")) if a.is_dir() else [a])
    ]
    sums, times = dict.fromkeys(NAMES, 0), dict.fromkeys(EFFORTS, 0.0)
    with tempfile.TemporaryDirectory() as folder:
        for path in paths:
            for name, size in measure(path, Path(folder), times).items():
                sums[name] += size
    print(f"{len(paths)} files; encoded in {times}")
    for name, size in sums.items():
        print(f"{name:16s}{size:12,d}{sums['npz'] / size:8.2f} : 1")


if __name__ == "__main__":
    main(sys.argv[1:])
