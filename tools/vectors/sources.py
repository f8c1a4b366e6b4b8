"""Valid: clips and skeletons that give back their source files."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.container import payloads
from mcz.files.encoding import write_skeleton
from mcz.formats import amc, asf, bvh
from mcz.formats.layout import TEMPLATE
from mcz.motion import Motion, Skeleton
from mcz.schema import parse
from tools.vectors.craft import Crafter, Vector, Whole, file_of, finished

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


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/sources")
    _bvh(shelf)
    _shared_template(shelf)
    _acclaim(shelf)
    _derived(shelf)
    return shelf.vectors


def _bvh(shelf: Whole) -> None:
    _check_values(take(PLAIN, "plain"), ROWS.split()[5:])
    _check_values(take(ODD, "odd"), ODD_ROWS.decode().split()[5:])
    latin = (HIERARCHY % "R\xfccken" + ROWS).encode("latin-1")
    empty = (HIERARCHY % "Spine" + "Frames: 0\nFrame Time: 0.01\n").encode()
    cases = (
        ("plain", "A BVH file printed by one printf.", PLAIN, 0),
        (
            "odd",
            "Two line ends, tabs, a wrong count, odd numbers, no last line end; notes a segment.",
            ODD,
            2,
        ),
        ("padded", "Columns padded to a width, right justified.", _padded("9.2f"), 0),
        ("padded-left", "Columns padded to a width, left justified.", _padded("<9.2f"), 0),
        ("padded-sign", "A blank where a sign could be.", _padded(" .2f"), 0),
        ("latin-1", "A name that is not UTF-8: its bytes are in the template alone.", latin, 0),
        ("empty", "A BVH file without a frame.", empty, 0),
    )
    for name, purpose, source, segment_frames in cases:
        motion = take(source, name)
        assert ("padded" in name) == _has_widths(motion)
        data = file_of(motion, segment_frames=segment_frames)
        spec = f"{HEADING}; The text of AMC and BVH; Frame notes of AMC and BVH"
        sources = ((f"{name}.bvh", source),)
        shelf.hold(f"bvh-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def _padded(style: str) -> bytes:
    """A file whose numbers are in a style of ``format``, of as many widths as make that plain."""
    rows = []
    for row in range(20):
        values = [
            (row * row * 397 + c * 911) % 41 * (1, 3.25, 10.5, 34.25)[c % 4] - 20 for c in range(9)
        ]
        rows.append(" ".join(format(value, style) for value in values))
    text = "\n".join((f"Frames: {len(rows)}", "Frame Time: 0.01", *rows, ""))
    return (HIERARCHY % "Spine" + text).encode()


def _has_widths(motion: Motion) -> bool:
    assert motion.source is not None
    patterns = parse(TEMPLATE, motion.source.template, "template").patterns
    return any(run.width for pattern in patterns for run in pattern.runs)


def take(data: bytes, name: str) -> Motion:
    """The motion in a BVH file, its source called after it."""
    return called(bvh.read(data, name), f"{name}.bvh")


def called(motion: Motion, path: str) -> Motion:
    assert motion.source is not None
    return replace(motion, source=replace(motion.source, path=path))


def _check_values(motion: Motion, words: list[str]) -> None:
    """What this package parsed is what Python's own parser makes of the words."""
    values = motion.signals[0].values
    expected = np.array([float(word) for word in words]).reshape(values.shape)
    assert np.array_equal(values, expected, equal_nan=True)


def _shared_template(shelf: Whole) -> None:
    row = b"0.20 93.45 0.00 1.00 2.00 3.00 4.00 5.00 6.00\n"
    longer_text = PLAIN.replace(b"Frames: 4", b"Frames: 5") + row
    plain, longer = take(PLAIN, "plain"), take(longer_text, "longer")
    crafter = Crafter()
    crafter.clip(plain)
    crafter.clip(longer)
    crafter.alias("again/plain.bvh", payloads.OF_CLIP, b"plain")
    assert sorted(kind for kind, _ in crafter.directory.shared) == [b"SKEL", b"SRCE"]
    shelf.hold(
        "bvh-shared-template",
        f"{HEADING}; SRCE; ALIA",
        "Two clips share skeleton and template; a third file is the same as the first.",
        finished(crafter),
        plain,
        longer,
        sources=(("plain.bvh", PLAIN), ("longer.bvh", longer_text), ("again/plain.bvh", PLAIN)),
        modes=BOTH,
    )


def _acclaim(shelf: Whole) -> None:
    skeleton = asf.read(ASF, "mannequin")
    crafter, named = Crafter(), ("small.asf", ASF)
    _with_asf(crafter, skeleton)
    purpose = "A skeleton with a source file of its own."
    spec = f"SKEL; ALIA; {HEADING}"
    shelf.hold("asf", spec, purpose, finished(crafter), sources=(named,), modes=BOTH)
    motion = called(amc.read(AMC, "take", skeleton), "take.amc")
    assert motion.signals[0].mask is not None
    crafter = Crafter()
    _with_asf(crafter, skeleton)
    crafter.clip(motion, segment_frames=3)
    shelf.hold(
        "amc",
        f"{HEADING}; Frame notes of AMC and BVH; Masks; Registry",
        "Bones in another order than the skeleton's, a gap in the frame numbers, a frame without "
        "a bone, CR LF, no last line end, exponents of three digits.",
        finished(crafter),
        motion,
        sources=(("take.amc", AMC), named),
        modes=BOTH,
    )
    odd_numbers = AMC.replace(b"\r\n5\r", b"\r\n007\r").replace(b"\r\n6\r", b"\r\n+8\r")
    for name, purpose, source in (
        ("alone", "An AMC file without its ASF: a flat skeleton.", AMC),
        ("example", "The worked example of the specification.", EXAMPLE),
        ("odd-numbers", "Frame numbers with zeros and a sign before them.", odd_numbers),
    ):
        motion = called(amc.read(source, name), f"{name}.amc")
        spec, sources = f"{HEADING}; Frame notes of AMC and BVH", ((f"{name}.amc", source),)
        data = file_of(motion)
        shelf.hold(f"amc-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def _derived(shelf: Whole) -> None:
    skeleton = asf.read(ASF, "mannequin")
    wider = AMC.replace(b"ltibia 1", b"ltibia 0.5 1").replace(b"ltibia -1", b"ltibia 0.5 -1")
    derived = called(amc.read(wider, "wider", skeleton), "wider.amc")
    crafter = Crafter()
    base = _with_asf(crafter, skeleton)
    derived = replace(derived, skeleton=replace(derived.skeleton, base=base))
    shelf.hold(
        "amc-derived",
        f"{HEADING}; SKEL",
        "A bone with more values than its ASF says: a derived skeleton.",
        finished(crafter, derived),
        derived,
        sources=(("wider.amc", wider), ("small.asf", ASF)),
        modes=BOTH,
    )


def _with_asf(crafter: Crafter, skeleton: Skeleton) -> bytes:
    """Write the skeleton and the name of its file."""
    id_ = write_skeleton(crafter, skeleton)
    crafter.alias("small.asf", payloads.OF_SKELETON, id_)
    return id_
