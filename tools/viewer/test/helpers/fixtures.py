"""Writes the files that the tests of the page open: ``python fixtures.py FOLDER [--all]``."""

from __future__ import annotations

import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np

import mcz
from mcz.codecs import codec_by_name
from mcz.container.limits import LARGE
from mcz.container.writer import Writer
from mcz.files.writing.clip_writer import write_clip
from mcz.model.motion import Motion, Signal
from mcz.sources.sample import acclaim_walk, sample_files

HOSTILE = [
    "<img src=x onerror=alert(1)>",
    "<script>alert(2)</script>",
    "\"'><svg/onload=alert(3)>",
    "__proto__",
    "constructor",
    "toString/__proto__/hasOwnProperty",
    "javascript:alert(4)",
    "evil\u202egnp.exe",
    "line\nbreak\ttab\x00null\x1b[2J",
    "=HYPERLINK(1)",
    "x" * 10_000,
    "/".join("d" * 200),
    "   ",
    "{{7*7}}${7*7}",
]


def archive(path: Path, motions: list[Motion]) -> None:
    """One file of all the motions, each under its name."""
    with path.open("xb+") as stream:
        writer = Writer(stream, profile=LARGE)
        for motion in motions:
            write_clip(writer, motion, codec_by_name("raw"), {})
        writer.finish()


def with_names(motion: Motion, names: list[str]) -> Motion:
    """The motion, its joints called otherwise as far as there are names."""
    skeleton = motion.skeleton
    joints = [
        replace(joint, name=name) for joint, name in zip(skeleton.joints, names, strict=False)
    ]
    joints += skeleton.joints[len(joints) :]
    return replace(motion, skeleton=replace(skeleton, joints=tuple(joints)))


def main(folder: Path, is_all: bool) -> None:
    motion = acclaim_walk()
    mcz.write(motion, folder / "walk.mcz")
    mcz.write(motion, folder / "walk-small.mcz", "mrdwt", T_g=2.0)
    mcz.write(motion, folder / "walk-rough.mcz", "mrdwt", T_g=8.0)
    for name, data in sample_files().items():
        (folder / name).write_bytes(data)
    mcz.encode(folder / "walk.c3d", folder / "markers.mcz")
    markers = mcz.read(folder / "walk.c3d")
    numbered = with_names(markers, [f"M{k:03}" for k in range(len(markers.skeleton.joints))])
    mcz.write(replace(numbered, source=None), folder / "numbered.mcz")
    (first, *others) = markers.signals
    mask = np.ones(first.values.shape, np.bool_)
    mask[:20] = False
    late = replace(markers, signals=(replace(first, mask=mask), *others), source=None)
    mcz.write(late, folder / "late.mcz")
    mcz.encode(folder / "walk.bvh", folder / "bvh.mcz")
    mcz.encode(folder / "walk.bvh", folder / "bvh-small.mcz", codec="mrdwt", params={"T_g": 2.0})
    mcz.write(replace(motion, frame_rate=Fraction(60)), folder / "steps.mcz")
    parts = ["walks/slow", "walks/fast", "runs/a", "runs/b", "stand"]
    archive(folder / "folders.mcz", [replace(cut(motion, 30), name=name) for name in parts])

    aliases(folder)
    mcz.write(replace(motion, frame_rate=None, source=None), folder / "no-rate.mcz")

    whole = (folder / "walk.mcz").read_bytes()
    raw = folder / "parts.mcz"
    mcz.write(motion, raw, "raw", segment_frames=20)
    damaged = bytearray(raw.read_bytes())
    damaged[len(damaged) // 2] ^= 0xFF
    (folder / "damaged.mcz").write_bytes(damaged)
    (folder / "cut.mcz").write_bytes(whole[: len(whole) // 3])
    (folder / "none.mcz").write_bytes(b"")

    short = cut(motion, 4)
    names = [f"hostile/{k} {name}" for k, name in enumerate(HOSTILE)]
    hostile = [replace(short, name=name) for name in [*HOSTILE[:-2], *names]]
    joints = [name.replace("/", " ") for name in HOSTILE if "\n" not in name]
    hostile[0] = with_names(hostile[0], joints)
    archive(folder / "hostile.mcz", hostile)
    if not is_all:
        return
    many = [replace(short, name=f"take {k // 100:03}/clip {k:05}") for k in range(20_000)]
    archive(folder / "many.mcz", many)
    mcz.write(long(motion, 100_000), folder / "long.mcz", "raw")


def aliases(folder: Path) -> None:
    """An archive in which a clip has a second name, and the same with a damaged segment."""
    walk = (folder / "walk.bvh").read_bytes()
    for name, data in {"a/walk": walk, "b/again": walk, "c/other": walk + b"\n"}.items():
        path = folder / "takes" / f"{name}.bvh"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    mcz.pack(folder / "takes", folder / "aliases.mcz")
    damaged = bytearray((folder / "aliases.mcz").read_bytes())
    damaged[len(damaged) * 7 // 10] ^= 0xFF
    (folder / "aliases-damaged.mcz").write_bytes(damaged)


def cut(motion: Motion, n_frames: int) -> Motion:
    """The first frames, without a source."""
    return replace(motion, signals=tuple(s.cut(0, n_frames) for s in motion.signals), source=None)


def long(motion: Motion, n_frames: int) -> Motion:
    """The motion again and again."""
    (first, *_) = motion.signals
    values = np.resize(first.values, (n_frames, first.values.shape[1]))
    return replace(motion, signals=(Signal(values, first.grids),), source=None)


if __name__ == "__main__":
    main(Path(sys.argv[1]), is_all="--all" in sys.argv)
