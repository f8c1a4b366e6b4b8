"""Source files of text, to order: BVH, AMC, ASF, their motions and templates."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mcz.codecs.contract import Codec
from mcz.model.motion import Motion, Signal
from mcz.model.numbers import Grid
from mcz.sources import FORMATS
from mcz.sources.text import bvh
from tools.vectors.build import wavelet_clips
from tools.vectors.build.edits import Edit
from tools.vectors.build.wavelet_clips import Plan, Wave

Columns = Sequence[tuple[Grid, Sequence[int]]]  # a grid, and the integers of its channel
BOTH = ("arrays", "sources")
HEADING = "Source reconstruction"
HIERARCHY = """\
HIERARCHY
ROOT Hips
{
\tOFFSET 0.00 -1.5e-003 0
\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
\tJOINT %s
\t{
\t\tOFFSET 0 10.5 0
\t\tCHANNELS 3 Zrotation Xrotation Yrotation
\t\tEnd Site
\t\t{
\t\t\tOFFSET 0 5 0
\t\t}
\t}
}
MOTION
"""
ROWS = """\
Frames: 4
Frame Time: 0.0083333
0.00 93.25 -0.00 1.00 -2.50 3.75 0.10 0.20 0.30
0.05 93.30 -0.01 1.10 -2.45 3.70 0.15 0.20 0.35
0.10 93.35 -0.02 1.20 -2.40 3.65 0.20 0.20 0.40
0.15 93.40 -0.03 1.30 -2.35 3.60 0.25 0.20 0.45
"""
PLAIN = (HIERARCHY % "Spine" + ROWS).encode()
# Nothing here is as a printf in a loop would have it.
ODD_ROWS = (
    b"frames:\t07 \r\nFrame Time: .04\r\n"
    b"0 93.25 -0 1e-3 -2.5 3.75 .1 0.20 3e+2\r\n"
    b"\t0.05 93.3 -0.01 1.1 -2.45 3.7 0.15 0.2 nan  \n"
    b"0.1 93.35 -0.02 1.2 -2.4 3.65 0.2 0.2 0.4 0.15 93.4\n\n"
    b" -0.03 1.3 -2.35 3.6 0.25 +0.2 0.45\t\r\n"
    b"1 2 3 4 5 6 7 8 9"
)
ODD = (HIERARCHY % "Spine").encode().replace(b"\n", b"\r\n", 9) + ODD_ROWS
ASF = b"""\
# A small skeleton
:version 1.10
:name mannequin
:units
  mass 1.0
  length 0.45
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name lfemur
     direction 0.34202 -0.939693 0
     length 7.04
     axis 0 0 20  XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
     id 2
     name ltibia
     direction 0.34202 -0.939693 0
     length 6.9
     axis 0 0 20  XYZ
    dof rx
  end
:hierarchy
  begin
    root lfemur
    lfemur ltibia
  end
""".replace(b"\n", b"\r\n")
# The last of a key's lines counts, a bone without an end does not; no name is none.
# The worked example of SPEC.md, "Source reconstruction".
EXAMPLE = b":DEGREES\n1\nroot 1 2\ntoe 3\n2\nroot 4 5\ntoe 6"
# Another order of bones, numbers with a gap, a frame without ltibia, no last line end.
AMC = b"""\
#!OML:ASF small.asf
:FULLY-SPECIFIED
:DEGREES
5
ltibia 12.5
root 1.5 -2.25 0.125 10 -20 30
lfemur 3.18055e-015 0.5 -0.25
6
ltibia 13
root 1.5625 -2.25 0.125 11 -20.5 30
lfemur 3.18055e-015 0.75 -0.5
9
root 1.625 -2.25 0.125 12 -21 30
lfemur -3.18055e-015 1 -0.75
10
ltibia -13.25
root 1.6875 -2.25 0.125 13 -21.5 30
lfemur 3.18055e-015 1.25 -1""".replace(b"\n", b"\r\n")
JOINT = """\
%(indent)sJOINT J%(number)d
%(indent)s{
%(indent)s\tOFFSET 0 0 0
%(indent)s\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
"""
TEXT_SPEC = f"{HEADING}; The text of AMC and BVH"


def take(data: bytes, name: str) -> Motion:
    """The motion in a BVH file, its source called after it."""
    return set_path(bvh.read(data, name), f"{name}.bvh")


def set_path(motion: Motion, path: str) -> Motion:
    assert motion.source is not None
    return replace(motion, source=replace(motion.source, path=path))


def hierarchy(n_joints: int) -> str:
    """A HIERARCHY of joints below each other, of six channels each."""
    lines, ends = "", ""
    for number in range(n_joints):
        lines += JOINT % {"indent": "\t" * number, "number": number}
        ends = "\t" * number + "}\n" + ends
    indent = "\t" * n_joints
    site = f"{indent}End Site\n{indent}{{\n{indent}\tOFFSET 0 1 0\n{indent}}}\n"
    return "HIERARCHY\n" + lines.replace("JOINT", "ROOT", 1) + site + ends


def restore_source(motion: Motion) -> bytes:
    """Bytes that the source of ``motion`` restores from it."""
    assert motion.source is not None
    return FORMATS[motion.source.format].write(motion)


def blank(n_rows: int, grids: Sequence[Grid], name: str) -> Motion:
    """Zeros and their source, a BVH file of plain numbers: as many joints as ``grids`` need.

    Columns behind the grids are on the last one.
    """
    every = [*grids, *[grids[-1]] * (-len(grids) % 6)]
    rows = [" ".join(["0"] * len(every))] * n_rows
    head = hierarchy(len(every) // 6) + f"MOTION\nFrames: {n_rows}\nFrame Time: 0.01\n"
    motion = take((head + "\n".join([*rows, ""])).encode(), name)
    return replace(motion, signals=(Signal(np.zeros((n_rows, len(every))), tuple(every)),))


def path_of(motion: Motion) -> str:
    assert motion.source is not None
    return motion.source.path


def with_source(motion: Motion, text: bytes, detail: Edit | None = None) -> Motion:
    """``motion`` with the size and the hash of ``text``, and its detail edited."""
    source = motion.source
    assert source is not None
    digest = hashlib.sha256(text).digest()
    own = detail(source.detail) if detail else source.detail
    return replace(motion, source=replace(source, size=len(text), sha256=digest, detail=own))


def lossy(
    plan: Plan, columns: Columns, name: str, details: Sequence[int] = ()
) -> tuple[Motion, Codec]:
    """A clip of mrdwt whose approximations are ``columns``, 0 behind their ends.

    ``details`` are those of level 1, of all channels; there are no others.
    """
    motion = blank(plan.n_frames, [grid for grid, _ in columns], name)
    channels = []
    for place in range(motion.signals[0].n_channels):
        own = columns[min(place, len(columns) - 1)][1]
        bands: list[Sequence[int]] = [[*own, *[0] * (plan.lengths[-1] - len(own))]]
        bands += [[0] * plan.lengths[level] for level in range(plan.levels, 0, -1)]
        if details:
            bands[-1] = details
        channels.append(Wave(bands))
    signal = replace(motion.signals[0], values=wavelet_clips.values_of(plan, channels))
    return replace(motion, signals=(signal,)), wavelet_clips.codec_of(plan, channels)
