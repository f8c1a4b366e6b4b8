"""Call kernels as the package does, and each again as plain Python.

``python -m tests.kernel_twins`` prints a line of JSON: how often each kernel was compared, and the
calls that differed. It replaces ``mcz.kernels.compiled_form``, which the first call of each kernel
asks for, hence a process of its own.
"""

from __future__ import annotations

import io
import json
import tempfile
import threading
import time
import zlib
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np

import mcz
from mcz import Channel, Joint, Motion, Signal, Skeleton, kernels
from mcz.codecs import CODECS
from mcz.codecs.coding.forms import BINARY32
from mcz.codecs.coding.forms.counts import Law
from mcz.codecs.coding.forms.units import DEGREE, of_products
from mcz.model.numbers import Grid, GridKind
from mcz.sources.sample import bvh_walk
from mcz.sources.text import bvh
from tests.codecs.lossy import encode_file, markers, rough
from tests.motions import smooth

VECTORS = Path(__file__).parents[1] / "conformance" / "vectors" / "valid"
SECONDS = 0.4  # that one kernel runs as plain Python, together
calls: Counter[str] = Counter()
compared: Counter[str] = Counter()
spent: dict[str, float] = defaultdict(float)
differences: list[str] = []
compiled_form = kernels.compiled_form
plain = threading.local()  # ``runs`` while a plain function runs, with plain ones below it


def twin(function: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel that compares what is compiled with ``function``."""
    name = f"{function.__module__}.{function.__name__}"
    compiled = compiled_form(function)

    @wraps(function)
    def call(*arguments: Any) -> Any:
        if getattr(plain, "runs", False):
            return function(*arguments)
        calls[name] += 1
        if calls[name].bit_count() > 1 or spent[name] > SECONDS:  # the 1st, 2nd, 4th, 8th, ...
            return compiled(*arguments)
        copies = tuple(map(copy_value, arguments))
        answer = compiled(*arguments)
        start = time.process_time()
        plain.runs = True
        try:
            with np.errstate(all="ignore"):
                other = function(*copies)
        finally:
            plain.runs = False
        spent[name] += time.process_time() - start
        compared[name] += 1
        if bits((answer, arguments)) != bits((other, copies)):
            differences.append(f"{name}: {answer} and {other}")
        return answer

    return call


def copy_value(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return np.array(value, order="K")
    if isinstance(value, tuple):
        items = list(map(copy_value, value))
        return type(value)(*items) if hasattr(value, "_fields") else tuple(items)
    return value


def bits(value: Any) -> Any:
    """Comparable form of answers and arrays: exact bits, with all NaNs equal."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind == "f":
            value = np.where(np.isnan(value), np.nan, value)
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, tuple):
        return tuple(map(bits, value))
    if isinstance(value, float):
        return "nan" if value != value else float(value).hex()
    return value if value is None else int(value)


def decode_vectors() -> None:
    """Decode the smallest conformance vectors, of which each codec has many."""
    for folder in sorted(VECTORS.iterdir()):
        files = sorted(folder.rglob("*.mcz"), key=lambda path: (path.stat().st_size, path.name))
        files = files[:: max(1, len(files) // 25)] + sorted(folder.glob("products-*.mcz"))
        for path in files:
            with mcz.open(path) as file:
                for clip in file.clips.values():
                    clip.read()


OPTIONS: dict[str, tuple[dict[str, Any], ...]] = {
    "qbc": ({}, {"breaks": "fewest"}),
    "awt": ({"iterations": 50}, {"iterations": 50, "distortion": "sampled"}),
}


def near_limits() -> Motion:
    """Numbers near the ends of floats."""
    values = np.round(np.random.default_rng(11).normal(size=(40, 4)).cumsum(axis=0), 4)
    values[20:22, 1] = 2.0**51 // 10**4
    values[:, 3] = np.round(values[:, 0] * 2, 4)
    bones = Skeleton((Joint("m", channels=tuple(Channel("", c) for c in "abcd")),))
    grids = (Grid(GridKind.FIXED, 4),) * 3 + (Grid(GridKind.BINARY64),)
    return Motion(bones, (Signal(values, grids),))


def encode_clips() -> None:
    """Encode a few frames with every codec, and decode them."""
    clips = smooth(40), rough(30, 1), markers(40), near_limits()
    for codec in CODECS.values():
        for motion in clips:
            for options in OPTIONS.get(codec.name, ({},)):
                try:
                    data = encode_file(codec.name, motion, **options)
                except mcz.MczError:  # some take no gaps, or markers alone
                    continue
                with mcz.open(data) as file:
                    file.only_clip().read()


def encode_counts() -> None:
    """Encode what a converter counted, but for a few numbers that its law is off; as decimals."""
    counts = 32768 + np.random.default_rng(3).integers(-40, 41, 300).cumsum()
    ordinals = Law(10 / 65535, -0.31).ordinals(counts)
    printed = Grid(GridKind.GENERAL, 6)
    save_channel(printed.values(Law(10 / 65535).ordinals(counts, printed)), printed)
    ordinals[::7] += 1
    save_channel(BINARY32.values(ordinals), BINARY32)


def encode_noise() -> None:
    """Encode angles of a few units in the last place, as printed in degrees."""
    units = np.random.default_rng(4).integers(-40, 41, 100)
    grid = Grid(GridKind.GENERAL, 6)
    save_channel(grid.values(of_products(units, DEGREE * 2.0**-60, 1, grid)), grid)


def save_channel(values: Any, grid: Grid) -> None:
    skeleton = Skeleton((Joint("plate", channels=(Channel("", "force", "V"),)),))
    encode_file("fast", Motion(skeleton, (Signal(values[:, None], (grid,)),)))


def print_numbers() -> None:
    """Print numbers by their grid, as those that the loop over a whole text leaves."""
    grid = Grid(GridKind.GENERAL, 6)
    ordinals, _ = grid.ordinals(np.array([0.0, -1.5e-40, 123456.0, 1e30]))
    assert grid.texts(ordinals).tolist() == [b"0", b"-1.5e-40", b"123456", b"1e+30"]


def encode_walk() -> None:
    """The sample as its codec for poses takes it, and the rest that kernels do with poses."""
    walk = bvh_walk().cut(0, 24)
    walk = replace(walk, skeleton=replace(walk.skeleton, unit_cm=1.0))
    data = encode_file("posewave", walk)
    with mcz.open(data) as file:
        file.only_clip().read()
    mcz.positions(walk)
    mcz.positions(walk, frames=(0, 3))
    mcz.to_glb(walk, key_error_mm=1.0)
    mcz.to_usda(walk)
    mcz.post_filter(markers(40))


def stream_frames() -> None:
    """Frames that are coded one by one."""
    walk = bvh_walk().cut(0, 6)
    for codec in ("online", "posewave"):
        parts = mcz.stream_encode(
            iter(walk.values), walk.skeleton, codec=codec, params={"step": 0.5}, unit="cm"
        )
        for _ in mcz.stream_decode(io.BytesIO(b"".join(parts))):
            pass


def deflate_streams() -> None:
    """A stream of zlib, taken apart and joined."""
    from mcz.sources.arrays.deflate import describe_stream, restore_stream

    contents = bytes(k * k % 251 for k in range(3000)) * 2
    stream = zlib.compress(contents)[2:-4]
    assert restore_stream(describe_stream(stream, contents), contents) == stream


def edit_files(folder: Path) -> None:
    """A text file to the byte, joints of a clip, and a damaged file that is repaired."""
    (folder / "texts").mkdir()
    text = bvh.write(bvh_walk().cut(0, 24))
    (folder / "texts" / "walk.bvh").write_bytes(text)
    *rows, last = text.rstrip().split(b"\n")
    odd = b"+1.50e+1" + last[last.index(b" ") :]  # a row whose cells are printed one by one
    (folder / "texts" / "odd.bvh").write_bytes(b"\n".join([*rows, odd, b""]))
    whole, bad = folder / "whole.mcz", folder / "bad.mcz"
    mcz.pack(folder / "texts", whole, profile="large")
    mcz.unpack(whole, folder / "again")
    vector = VECTORS / "fast" / "groups-channel.mcz"
    first = mcz.read(vector).skeleton.joints[0]
    mcz.extract(vector, folder / "part.mcz", joints=[first.name])
    mcz.protect(whole, 0.2)
    data = bytearray(whole.read_bytes())
    data[2000:2050] = bytes(50)
    bad.write_bytes(data)
    mcz.repair(bad, folder / "repaired.mcz")


def main() -> None:
    kernels.compiled_form = twin
    assert kernels.MODE != kernels.INTERPRETED
    assert not kernels.lacks_compiled_kernels()
    decode_vectors()
    encode_clips()
    encode_counts()
    encode_noise()
    print_numbers()
    encode_walk()
    stream_frames()
    deflate_streams()
    with tempfile.TemporaryDirectory() as folder:
        edit_files(Path(folder))
    print(json.dumps([compared, differences]))


if __name__ == "__main__":
    main()
