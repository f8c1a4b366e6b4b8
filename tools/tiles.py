"""Archives' worth of recordings made of a few: tiles of BVH and C3D files, of differing lengths.

    python tools/tiles.py FOLDER TARGET --clips 20000 [--frames 150] [--seed 1] [--robot]

Each tile is a file of a recording below FOLDER: some of its frames in a row, from a random one on,
the first again behind the last, so that a tile may be longer than its recording. Lengths are
between a third and five thirds of --frames. No two tiles are the same. TARGET gets a folder for
every 100 of them, and TARGET/index.csv, which says of each a subject, a session and a description.
Below TARGET/part lie links to the first eighth, quarter and half of them, for measuring how times
grow. With ``--robot`` the tiles are pairs as BONES-SEED has them: BVH of --frames each, and a CSV
file of as many rows for a Unitree G1, whose angles are the first ones of the BVH.
"""

from __future__ import annotations

import argparse
import csv
import os
import random
import re
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

from mcz.sources.robots import robot_layouts

LEAST = 100  # frames of a recording that is taken
A_FOLDER = 100  # tiles
BLOCK = 512  # bytes of a block of C3D
Tile = Callable[[int, int], bytes]  # the first frame and how many: a file


def bvh(data: bytes) -> tuple[int, Tile] | None:
    """Frames of a BVH file, and what makes tiles of it; None where it has too few."""
    head, mark, text = data.partition(b"Frame Time:")
    time, _, text = text.partition(b"\n")
    found = re.search(rb"Frames:[ \t]*(\d+)", head)
    rows = [row for row in text.split(b"\n") if row.strip()]
    if not mark or found is None or not LEAST <= len(rows) == int(found[1]):
        return None

    def tile(first: int, n: int) -> bytes:
        start = head[: found.start(1)] + b"%d" % n + head[found.end(1) :] + mark + time
        return b"\n".join([start, *(rows[(first + i) % len(rows)] for i in range(n)), b""])

    return len(rows), tile


def c3d(data: bytes) -> tuple[int, Tile] | None:
    """The same of a C3D file of an Intel processor."""
    points, analog, first, last = struct.unpack_from("<HHHH", data, 2)
    (scale,) = struct.unpack_from("<f", data, 12)
    (block,) = struct.unpack_from("<H", data, 16)
    start, size = (block - 1) * BLOCK, (4 * points + analog) * (4 if scale < 0 else 2)
    named = re.search(rb"[\x06\xfa].FRAMES", data[:start], re.DOTALL)  # of 6 letters; locked: -6
    n_frames = last - first + 1
    if named is None or n_frames < LEAST or not size or len(data) < start + n_frames * size:
        return None
    at = named.end() + 2 + 2  # offset of the next parameter, type, number of dimensions
    if struct.unpack_from("<H", data, at)[0] != n_frames:
        return None
    rows = [data[start + i * size : start + (i + 1) * size] for i in range(n_frames)]

    def tile(own: int, n: int) -> bytes:
        head = bytearray(data[:start])
        struct.pack_into("<HH", head, 6, 1, n)
        struct.pack_into("<H", head, at, n)
        body = b"".join(rows[(own + i) % n_frames] for i in range(n))
        return bytes(head) + body + bytes(-len(body) % BLOCK)

    return n_frames, tile


READERS = {".bvh": bvh, ".c3d": c3d}
ROOT = [f"root_{what}{axis}" for what in ("translate", "rotate") for axis in "XYZ"]


def robot_csv(tile: bytes) -> bytes:
    """The rows of a BVH tile as a G1 has them: frame, root in centimeters and degrees, angles."""
    names = ["Frame", *ROOT, *(f"{j}_dof" for j in robot_layouts()["unitree-g1-29"].joints)]
    rows = tile.partition(b"Frame Time:")[2].split(b"\n")[1:-1]
    lines = [",".join(names)]
    for number, row in enumerate(rows):
        values = (f"{float(word):.6f}" for word in row.split()[: len(names) - 1])
        lines.append(",".join([str(number), *values]))
    return "\n".join([*lines, ""]).encode()


def recordings(folder: Path) -> Iterator[tuple[Path, int, Tile]]:
    """Files below a folder that can be tiled, sorted by name."""
    for path in sorted(folder.rglob("*")):
        reader = READERS.get(path.suffix.lower())
        data = reader(path.read_bytes()) if reader is not None else None
        if data is not None:
            yield path, *data


def write(folder: Path, target: Path, clips: int, frames: int, seed: int, robot: bool) -> int:
    """Write the tiles, and say how many bytes they have."""
    chance = random.Random(seed)
    found = [each for each in recordings(folder) if not robot or each[0].suffix == ".bvh"]
    if not found:
        raise SystemExit(f"{folder}: no BVH or C3D file of {LEAST} frames that can be tiled")
    rows, size, seen = [], 0, set()
    while len(rows) < clips:
        path, n_frames, tile = chance.choice(found)
        n = frames if robot else chance.randint(frames // 3, 5 * frames // 3)
        first = chance.randrange(n_frames)
        if (path, first, n) in seen:
            continue
        seen.add((path, first, n))
        subject = len(rows) // A_FOLDER
        data = tile(first, n)
        pair = {path.suffix.lower(): data} | ({".csv": robot_csv(data)} if robot else {})
        text = f"{n} frames of {path.stem} from {first} on"
        for suffix, content in pair.items():
            name = f"{subject:03d}/{subject:03d}_{len(rows) % A_FOLDER:02d}{suffix}"
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            (target / name).write_bytes(content)
            size += len(content)
            rows.append((name, f"{subject:03d}", f"{len(rows) % 7}", text))
    with (target / "index.csv").open("w", newline="") as stream:
        csv.writer(stream).writerows([("path", "subject", "session", "description"), *rows])
    return size


def link_parts(target: Path) -> None:
    """Folders of links to the first tiles, a half, a quarter and an eighth of all."""
    with (target / "index.csv").open(newline="") as stream:
        head, *rows = csv.reader(stream)
    for share in (8, 4, 2):
        part = target / "part" / str(len(rows) // share)
        own = rows[: len(rows) // share]
        for name, *_ in own:
            (part / name).parent.mkdir(parents=True, exist_ok=True)
            os.link(target / name, part / name)
        with (part / "index.csv").open("w", newline="") as stream:
            csv.writer(stream).writerows([head, *own])


def main() -> None:
    assert __doc__
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("target", type=Path)
    parser.add_argument("--clips", type=int, default=20000)
    parser.add_argument("--frames", type=int, default=150, help="of a tile, in the mean")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--robot", action="store_true", help="pairs of BVH and G1 CSV")
    given = parser.parse_args()
    if given.target.exists():
        raise SystemExit(f"{given.target} exists")
    whole = given.target / "all"
    size = write(given.folder, whole, given.clips, given.frames, given.seed, given.robot)
    link_parts(whole)
    (whole / "part").rename(given.target / "part")
    print(f"{given.clips:,} tiles of {size:,} bytes in {whole}")


if __name__ == "__main__":
    main()
