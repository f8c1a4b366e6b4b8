"""Windows a second of a data set, beside array files of the same numbers.

    python tools/dataset_speed.py FOLDER [--copies N] [--windows N]

FOLDER has BVH or AMC files of one skeleton (by names). They are packed N times over with the
default codec, and written as .npy (memory-mapped), .npz (compressed, a clip a file), HDF5 (gzip),
Zarr and Parquet (their defaults), the last three in chunks of 64 frames, each with float64 channels
and with float32 features. Windows of 64 frames, on one core unless it says workers; cold is a new
data set, warm the second time round. CPU: windows for each second of processor time, which other
programs on the machine change less. Needs h5py, pyarrow and zarr; without PyTorch no workers are
measured.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import mcz

WINDOW = 64
BATCH = 64
FIELDS = "rot6d,positions,root"


def pack_copies(folder: Path, target: Path, copies: int) -> None:
    """One archive a copy: the same bytes under other names would be found as duplicates."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mcz.pack(folder, target / "0.mcz")
    for copy in range(1, copies):
        (target / f"{copy}.mcz").write_bytes((target / "0.mcz").read_bytes())


class Rate(NamedTuple):
    """Windows a second, by the clock and by the processor."""

    wall: float
    cpu: float


def windows_a_second(
    get: Callable[[Any], Any], numbers: np.ndarray[Any, Any], seconds: float = 20, size: int = 1
) -> Rate:
    """The rate of ``get`` for each number or, with a size, for batches of numbers."""
    start, used = time.perf_counter(), time.process_time()
    done = 0
    for at in range(0, len(numbers), size):
        get(numbers[at : at + size] if size > 1 else int(numbers[at]))
        done += min(size, len(numbers) - at)
        if time.perf_counter() - start > seconds:
            break
    return Rate(done / (time.perf_counter() - start), done / (time.process_time() - used))


def count_decoded(count: list[int]) -> Callable[[], None]:
    """Count the frames that are decoded, from now on; returns what stops it."""
    from mcz.files.reading.signal_reader import SignalReader

    whole = SignalReader._decode

    def count_read(self: Any, spans: Any, start: int, stop: int) -> Any:
        count[0] += stop - start
        return whole(self, spans, start, stop)

    SignalReader._decode = count_read  # type: ignore[method-assign]

    def stop() -> None:
        SignalReader._decode = whole  # type: ignore[method-assign]

    return stop


def say(what: str, rate: Rate, size: int = 0, more: str = "") -> None:
    both = f"{rate.wall:9,.0f}/s {rate.cpu:9,.0f}/s CPU"
    print(f"{what:56} {both} {size / 1e6:10,.1f} MB  {more}", flush=True)


def of_mcz(folder: Path, n_windows: int) -> None:
    size = size_of(folder)
    for fields in (FIELDS, "channels"):
        arguments: dict[str, Any] = {"window": WINDOW, "stride": WINDOW, "dtype": "float32"}
        data = mcz.dataset(folder, fields, **arguments)
        n_bytes = data.n_frames * data._first_subject().skeleton.n_channels * 8
        print(f"{data!r}: {n_bytes / 1e6:,.0f} MB decoded")
        random = np.random.default_rng(1)
        orders = {
            "in sequence": np.arange(len(data)),
            "order(seed)": data.order(1),
            "at random": random.integers(0, len(data), n_windows),
        }
        for name, numbers in orders.items():
            data = mcz.dataset(folder, fields, **arguments)
            count = [0]
            stop = count_decoded(count)
            numbers = numbers[:n_windows]
            rate = windows_a_second(data.__getitem__, numbers, 1000, BATCH)
            stop()
            say(
                f"mcz, {fields}, cold, {name}", rate, size, f"{count[0] / len(numbers):.0f} decoded"
            )
        few = random.integers(0, min(len(data), 500), n_windows)
        windows_a_second(data.__getitem__, few)
        say(f"mcz, {fields}, warm, at random", windows_a_second(data.__getitem__, few), size)
        at_random = np.array_split(orders["at random"], n_windows // BATCH)
        for workers in (0, 1, 2):
            data = mcz.dataset(folder, fields, **arguments)
            order = list(data.batch_sampler(BATCH, 2, max(1, workers)))[: n_windows // BATCH]
            for name, batches in {"order(seed)": order, "at random": at_random}.items():
                rate = loader_rate(folder, fields, arguments, batches, workers)
                if rate is not None:
                    say(f"mcz, {fields}, cold, {name}, {workers} workers", rate, size)


def loader_rate(
    folder: Path, fields: str, arguments: dict[str, Any], batches: list[Any], workers: int
) -> Rate | None:
    """The rate of a DataLoader, of all its processes together; None without PyTorch."""
    try:
        from torch.utils.data import DataLoader
    except ImportError:
        return None
    numbers = [list(map(int, batch)) for batch in batches]
    tensors = mcz.dataset(folder, fields, **arguments).torch()
    seen, start, used = 0, time.perf_counter(), processor_time()
    for batch in DataLoader(tensors, batch_sampler=numbers, num_workers=workers):
        seen += len(next(iter(batch.values())))
    return Rate(seen / (time.perf_counter() - start), seen / (processor_time() - used))


def processor_time() -> float:
    """Seconds of this process and of its children that have ended."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


Clips = list[dict[str, np.ndarray[Any, Any]]]
Reader = Callable[[int, int], Any]  # of a clip, WINDOW frames from one on


def as_npy(clips: Clips, folder: Path) -> Reader:
    for number, clip in enumerate(clips):
        for name, array in clip.items():
            np.save(folder / f"{number}-{name}.npy", array)
    mapped = [
        {name: np.load(folder / f"{number}-{name}.npy", mmap_mode="r") for name in clip}
        for number, clip in enumerate(clips)
    ]
    return lambda c, a: {name: np.array(array[a : a + WINDOW]) for name, array in mapped[c].items()}


def as_npz(clips: Clips, folder: Path) -> Reader:
    for number, clip in enumerate(clips):
        np.savez_compressed(folder / f"{number}.npz", **clip)

    def read(c: int, a: int) -> Any:
        with np.load(folder / f"{c}.npz") as file:
            return {name: file[name][a : a + WINDOW] for name in file}

    return read


def as_hdf5(clips: Clips, folder: Path) -> Reader:
    import h5py

    with h5py.File(folder / "clips.h5", "w") as file:
        for number, clip in enumerate(clips):
            for name, array in clip.items():
                chunks = (min(WINDOW, len(array)), *array.shape[1:])
                file.create_dataset(
                    f"{number}/{name}", data=array, chunks=chunks, compression="gzip"
                )
    opened = h5py.File(folder / "clips.h5")
    return lambda c, a: {name: array[a : a + WINDOW] for name, array in opened[str(c)].items()}


def as_zarr(clips: Clips, folder: Path) -> Reader:
    import zarr

    root = zarr.open_group(folder / "clips.zarr", mode="w")
    arrays: list[dict[str, Any]] = []
    for number, clip in enumerate(clips):
        arrays.append({})
        for name, array in clip.items():
            chunks = (min(WINDOW, len(array)), *array.shape[1:])
            made = root.create_array(
                f"{number}-{name}", shape=array.shape, chunks=chunks, dtype=array.dtype
            )
            made[:] = array
            arrays[-1][name] = made
    return lambda c, a: {name: array[a : a + WINDOW] for name, array in arrays[c].items()}


def as_parquet(clips: Clips, folder: Path) -> Reader:
    import pyarrow as pa
    import pyarrow.parquet as pq

    files = []
    for number, clip in enumerate(clips):
        columns = {
            name: pa.FixedSizeListArray.from_arrays(
                pa.array(array.ravel()), int(np.prod(array.shape[1:]))
            )
            for name, array in clip.items()
        }
        path = folder / f"{number}.parquet"
        pq.write_table(pa.table(columns), path, row_group_size=WINDOW)
        files.append(pq.ParquetFile(path))
    shapes = {name: array.shape[1:] for name, array in clips[0].items()}

    def read(c: int, a: int) -> Any:
        first, last = a // WINDOW, (a + WINDOW - 1) // WINDOW
        table = files[c].read_row_groups(list(range(first, last + 1)), use_threads=False)
        a -= first * WINDOW
        return {
            name: table[name].combine_chunks().flatten().to_numpy().reshape(-1, *shape)[a:][:WINDOW]
            for name, shape in shapes.items()
        }

    return read


PEERS = {
    "npy, memory-mapped": as_npy,
    "npz": as_npz,
    "HDF5, gzip": as_hdf5,
    "Zarr": as_zarr,
    "Parquet": as_parquet,
}


def of_arrays(source: Path, folder: Path, n_windows: int) -> None:
    """One copy of the clips as arrays, read at random, warm: the second time round."""
    for fields in ("channels", FIELDS):
        dtype = "float64" if fields == "channels" else "float32"
        clips = list(mcz.dataset(source, fields, dtype=dtype))
        starts = [len(next(iter(clip.values()))) - WINDOW + 1 for clip in clips]
        random = np.random.default_rng(1)
        chosen = [int(c) for c in random.integers(0, len(clips), n_windows) if starts[c] > 0]
        places = [(c, int(random.integers(0, starts[c]))) for c in chosen]
        for number, (name, make) in enumerate(PEERS.items()):
            own = folder / f"{fields[:4]}{number}"
            own.mkdir()
            read_from(name, fields, make(clips, own), places, size_of(own))
        windows = mcz.dataset(source, fields, window=WINDOW, stride=1, dtype=dtype, cache="4 GB")
        firsts = np.cumsum([0, *(max(0, start) for start in starts)])

        def read(c: int, a: int, data: mcz.Dataset = windows, at: Any = firsts) -> Any:
            return data[int(at[c]) + a]

        read_from("mcz, all cached", fields, read, places, size_of(source))


def read_from(
    name: str, fields: str, read: Reader, places: list[tuple[int, int]], size: int
) -> None:
    numbers = np.arange(200 if name == "npz" else len(places))  # npz inflates all for each
    windows_a_second(lambda number: read(*places[number]), numbers)
    rate = windows_a_second(lambda number: read(*places[number]), numbers, 5)
    say(f"{name}, {fields}, warm, at random", rate, size)


def size_of(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--copies", type=int, default=1)
    parser.add_argument("--windows", type=int, default=5000)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        for part in ("one", "many", "arrays"):
            (Path(name) / part).mkdir()
        pack_copies(given.folder, Path(name) / "one", 1)
        of_arrays(Path(name) / "one", Path(name) / "arrays", given.windows)
        for copy in range(given.copies):
            data = (Path(name) / "one" / "0.mcz").read_bytes()
            (Path(name) / "many" / f"{copy}.mcz").write_bytes(data)
        of_mcz(Path(name) / "many", given.windows)


if __name__ == "__main__":
    sys.exit(main())
