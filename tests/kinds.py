"""Files of ten kinds of content, codec and source format, and where their chunks lie."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import mcz
from mcz.container.chunks import FOOT, HEADER
from mcz.container.scan import scan
from mcz.container.source import open_source
from mcz.sources.sample import write_samples

Values = dict[str, dict[str, np.ndarray]]  # by clip and signal


def live(folder: Path) -> bytes:
    rows = np.cumsum(np.random.default_rng(1).normal(size=(60, 12)), 0)
    names = [f"m{number}" for number in range(4)]
    stream = mcz.stream_encode(rows, names, repeat=20, unit="mm", params={"step": 0.5})
    return b"".join(stream)


def acclaim(folder: Path) -> bytes:
    takes = folder / "takes"
    takes.mkdir()
    for name, other in (("walk.asf",) * 2, ("walk.amc",) * 2, ("walk.amc", "same.amc")):
        (takes / other).write_bytes((folder / name).read_bytes())
    (takes / "notes.txt").write_bytes(b"taken on a Sunday\n" * 99)
    target, params = folder / "takes.mcz", {"segment_frames": 60}
    mcz.pack(takes, target, rate=120, params=params, keep_all=True, copies=False)
    return target.read_bytes()


def write_described(folder: Path) -> bytes:
    target = folder / "described.mcz"
    target.write_bytes(
        encode_sample("walk.c3d", effort="best", params={"segment_frames": 60})(folder)
    )
    mcz.set_metadata(target, {"walk": {"subject": "7"}})
    return target.read_bytes()


def write_protected(folder: Path) -> bytes:
    target = folder / "protected.mcz"
    target.write_bytes(encode_sample("walk.bvh")(folder))
    mcz.protect(target, 0.1)
    return target.read_bytes()


def table(folder: Path) -> bytes:
    rows = "".join(f"{row},{row / 4},{row * row}\n" for row in range(200))
    (folder / "table.csv").write_text("frame,a,b\n" + rows)
    return encode_sample("table.csv", effort="fast", rate=100)(folder)


def arrays(folder: Path) -> bytes:
    angles = np.round(np.random.default_rng(3).normal(size=(60, 12)), 3)
    np.savez(folder / "arrays.npz", poses=angles, trans=np.arange(60))
    return encode_sample("arrays.npz", rate=30)(folder)


def encode_sample(name: str, **options: Any) -> Callable[[Path], bytes]:
    def make(folder: Path) -> bytes:
        target = folder / f"{name}.mcz"
        mcz.encode(folder / name, target, force=True, **options)
        return target.read_bytes()

    return make


KINDS: dict[str, Callable[[Path], bytes]] = {
    "bvh-fast": encode_sample("walk.bvh", params={"segment_frames": 60}),
    "acclaim": acclaim,
    "c3d-best": write_described,
    "posewave": encode_sample("walk.bvh", codec="posewave", unit="cm"),
    "mrdwt": encode_sample("walk.bvh", codec="mrdwt", params={"segment_frames": 50}),
    "mdtt-archive": encode_sample("walk.c3d", codec="mdtt", profile="large"),
    "live": live,
    "csv-normal": table,
    "npz": arrays,
    "protected": write_protected,
}


def files(folder: Path) -> dict[str, bytes]:
    write_samples(folder)
    return {name: make(folder) for name, make in KINDS.items()}


def chunks_of(data: bytes) -> list[tuple[str, int, int]]:
    """Type, offset and size of every chunk and FOOT, in file order."""
    container = scan(open_source(data))
    rows = [
        (
            c.type.decode(),
            c.offset,
            container.ends[c.offset] - c.offset if c.length is None else c.size,
        )
        for c in container.chunks
    ]
    return sorted(
        [*rows, *(("FOOT", at, FOOT.size) for at in container.feet)], key=lambda row: row[1]
    )


def body_of(kind: str, offset: int, size: int) -> int:
    """A byte in the middle of what a chunk holds."""
    return offset + (20 if kind == "FOOT" else HEADER.size + max(0, size - HEADER.size - 4) // 2)


def values_of(data: bytes, *, salvage: bool = False) -> Values:
    """Every value, NaN where it is invalid, as it is stored; nothing of an unknown codec."""
    values_by_clip: Values = {}
    with mcz.open(data, salvage=salvage) as file:
        for clip in file:
            values_by_clip[clip.name] = {}
            for signal in clip.signals:
                try:
                    values, mask = clip.read_masked(signal=signal.index)
                except mcz.UnsupportedError:
                    continue
                valid = True if mask is None else mask.astype(bool)
                values_by_clip[clip.name][signal.name] = np.where(valid, values, np.nan)
    return values_by_clip


def origin(name: str, whole: Values) -> tuple[str, int]:
    """The clip that a repaired one was a run of frames of, and its first frame."""
    of = max((one for one in whole if name == one or name.startswith(f"{one}.")), key=len)
    span = name[len(of) :].strip(".").partition("-")[0]
    return of, int(span or 0)


def count_kept_values(repaired: bytes, whole: Values) -> int:
    """Count the values of a repaired file, each of which must be as it was."""
    count = 0
    for name, signals in values_of(repaired).items():
        of, start = origin(name, whole)
        with mcz.open(repaired) as file:
            rows = {s.name: s.layout.samples_per_frame for s in file.clips[name].signals}
        for signal, values in signals.items():
            first = start * rows[signal]
            expected = whole[of][signal][first : first + len(values)]
            np.testing.assert_array_equal(values, expected, err_msg=f"{name} {signal}")
            count += values.size
    return count
