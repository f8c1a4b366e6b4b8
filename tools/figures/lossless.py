"""Sizes and speeds of lossless codecs beside general compressors, on source files."""

from __future__ import annotations

import lzma
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib import import_module
from pathlib import Path
from time import process_time

import numpy as np

import mcz
from mcz.files.reading.sizes import clip_ratios
from tools.figures.table import Table, bold, table

SETS = {  # name: folder below the data, suffix
    "AMC": ("cmu/amc", ".amc"),
    "BVH, MotionBuilder": ("cmu/bvh", ".bvh"),
    "BVH, Daz": ("cmu/bvh-daz", ".bvh"),
    "BVH, 3ds Max": ("cmu/bvh-3dsmax", ".bvh"),
    "BVH, iClone": ("cmu/bvh-iclone", ".bvh"),
}
TEXT_PEERS = ("xz -9e", "zstd -19", "brotli 11", "7z -mx=9")
SPEED_CLIP = "cmu/amc/14_02.amc"
LEAST_SECONDS = 0.5  # of CPU time, for the fastest of several runs


def tables(data: Path, jobs: int) -> Iterator[Table]:
    """The sizes of all sets, those of README, and the speeds on one clip."""
    rows = dict[str, list[str]]()
    for name, (folder, suffix) in SETS.items():
        files = sorted((data / folder).rglob(f"*{suffix}"))
        with ProcessPoolExecutor(jobs) as pool:
            sizes = list(pool.map(sizes_of, files))
        total = sum(size["source"] for size in sizes)
        columns = [column for column in sizes[0] if column != "source"]
        ratios = [total / sum(size[column] for size in sizes) for column in columns]
        texts = bold([f"{ratio:.2f}" for ratio in ratios], int(np.argmax(ratios)))
        rows[name] = [f"{len(files)} {name}, {total / 1e6:.1f} MB", *texts]
    head = ["files", *columns]
    yield table("lossless", head, list(rows.values()))
    short = [head.index(name) for name in ("files", "`fast`", "`best`", *TEXT_PEERS[:3])]
    readme = [[rows[name][k] for k in short] for name in ("AMC", "BVH, MotionBuilder")]
    yield table("lossless-short", [head[k] for k in short], readme)
    yield _speeds(data / SPEED_CLIP)


def sizes_of(path: Path) -> dict[str, int]:
    """Bytes by column, without the skeleton, which the clips of a subject share."""
    data, sizes = path.read_bytes(), dict[str, int]()
    sizes["source"] = len(data)
    with tempfile.TemporaryDirectory() as folder:
        for effort in ("fast", "best"):
            target = Path(folder, f"{effort}.mcz")
            mcz.encode(path, target, effort=effort)
            with mcz.open(target) as file:
                clip = next(iter(file.clips.values()))
                if clip.source_bytes() != data:
                    raise AssertionError(f"{path} is not restored")
                ratio = clip_ratios(file, clip)["cr_source"]
                assert ratio
                sizes[f"`{effort}`"] = round(len(data) / ratio)
    for name, pack in text_peers().items():
        sizes[name] = len(pack(data))
    sizes["pcodec, values only"] = _pcodec_bytes(mcz.read(path).values)
    return sizes


def text_peers() -> Mapping[str, Callable[[bytes], bytes]]:
    """Compressors of text that are installed here."""
    peers: dict[str, Callable[[bytes], bytes]] = {
        "xz -9e": partial(lzma.compress, preset=9 | lzma.PRESET_EXTREME),
        "zstd -19": import_module("zstandard").ZstdCompressor(level=19).compress,
        "brotli 11": partial(import_module("brotli").compress, quality=11),
    }
    if shutil.which("7z"):
        peers["7z -mx=9"] = _seven_zip
    return peers


def _seven_zip(data: bytes) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "in").write_bytes(data)
        command = ["7z", "a", "-mx=9", "-bso0", "-bsp0", "out.7z", "in"]
        subprocess.run(command, cwd=folder, check=True)
        return Path(folder, "out.7z").read_bytes()


def _pcodec_bytes(values: np.ndarray) -> int:  # type: ignore[type-arg]
    pcodec = import_module("pcodec")
    config, columns = pcodec.ChunkConfig(compression_level=8), np.asarray(values, np.float32).T
    return sum(
        len(pcodec.standalone.simple_compress(np.ascontiguousarray(c), config)) for c in columns
    )


def _speeds(path: Path) -> Table:
    """Seconds of CPU from bytes in memory to binary64 values, as GB and frames a second."""
    motion = mcz.read(path)
    values = np.ascontiguousarray(motion.values)
    ordinals = np.ascontiguousarray(motion.signals[0].to_ordinals()[0].T)
    rows = list[list[str]]()

    def row(name: str, size: int, run: Callable[[], object]) -> None:
        seconds = cpu_seconds(run)
        speed = [f"{values.nbytes / seconds / 1e9:.2f}", f"{len(values) / seconds / 1e3:,.0f}"]
        rows.append([name, f"{values.nbytes / size:.2f}", *speed])

    with tempfile.TemporaryDirectory() as folder:
        for effort in ("fast", "best"):
            target = Path(folder, f"{effort}.mcz")
            mcz.encode(path, target, effort=effort)
            packed = target.read_bytes()
            row(f"`{effort}`, from opening the file", len(packed), partial(read_values, packed))
    pcodec, blosc2 = import_module("pcodec"), import_module("blosc2")
    config = pcodec.ChunkConfig(compression_level=8)
    columns = [pcodec.standalone.simple_compress(column, config) for column in ordinals]
    row(
        "pcodec 8, a column of ordinals each",
        sum(map(len, columns)),
        lambda: [pcodec.standalone.simple_decompress(column) for column in columns],
    )
    shuffled = blosc2.compress2(values, clevel=9, codec=blosc2.Codec.ZSTD, nthreads=1)
    row("blosc2, shuffle and zstd 9", len(shuffled), lambda: blosc2.decompress2(shuffled))
    row("a copy in memory", values.nbytes, values.copy)
    row("the AMC, parsed by `mcz`", path.stat().st_size, lambda: mcz.read(path))
    head = ["read", "values / bytes", "GB a second", "thousand frames a second"]
    return table("lossless-speed", head, rows)


def read_values(packed: bytes) -> object:
    with mcz.open(packed) as file:
        return next(iter(file.clips.values())).values[:]


def cpu_seconds(run: Callable[[], object]) -> float:
    """CPU time of the fastest run."""
    run()
    best, spent = float("inf"), 0.0
    while spent < LEAST_SECONDS:
        start = process_time()
        run()
        took = process_time() - start
        best, spent = min(best, max(took, 1e-9)), spent + max(took, 1e-3)
    return best
