"""A script of a user, which runs, and which mypy and pyright check by the types of the package."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path
from typing import assert_type

import mcz

BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  End Site
  {
    OFFSET 0 10 0
  }
}
MOTION
Frames: 3
Frame Time: 0.01
0 90 0 0 0 0
1 90 0 5 0 0
2 90 0 9 0 0
"""


def main(folder: Path) -> None:
    """Read, write, encode, pack, verify and measure a walk in ``folder``."""
    source = folder / "walk.bvh"
    source.write_text(BVH)
    motion = mcz.read(source, unit="cm", up="y")
    assert_type(motion, mcz.Motion)
    written = mcz.write(motion, folder / "walk.mcz", codec="fast")
    assert_type(written.size, int)
    with mcz.open(folder / "walk.mcz") as file:
        for each in file:
            assert_type(each.name, str)
        clip = file.clips["walk"]
        assert_type(clip, mcz.Clip)
        assert_type(clip.n_frames, int)
        assert_type(clip.frame_rate, Fraction | None)
        assert_type(clip.motion(), mcz.Motion)
        first = clip.values[:2]
        print(first.shape, first.dtype, first[:, :3] * 2, first - first)
        places = clip.positions(unit="m")
        print((places[1:] - places[:-1]).shape, clip.joint_names[0].upper())
    encoded = mcz.encode(source, folder / "encoded.mcz", params={"segment_frames": 2}, codec="raw")
    assert_type(encoded.size, int)
    report = mcz.pack(folder, folder.with_suffix(".mcz"), codec="fast", keep_all=True)
    for outcome in report.outcomes:
        print(outcome.path.upper(), outcome.result.upper(), outcome.message)
    for problem in mcz.verify(folder.with_suffix(".mcz")):
        raise SystemExit(str(problem))
    print(mcz.positions(motion, joints=["Hips"]).shape)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
