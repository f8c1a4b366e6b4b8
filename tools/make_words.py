"""Write mcz/annex/words.bin, what the deflate of short texts may refer to.

    python tools/make_words.py

SPEC.md, "Conventions" ("deflate after words"). The bytes are the vocabulary of BVH and ASF, laid
out as common writers do, and joint names that many rigs share. Nothing is taken from a recording.
What is used most often stands last: near distances cost fewer bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

TARGET = Path(__file__).resolve().parent.parent / "mcz" / "annex" / "words.bin"
MOST = 32506  # bytes that deflate of zlib reaches back to: 32,768 less 262

CENTER = """Hips Chest Chest2 Chest3 Chest4 Spine Spine1 Spine2 Spine3 LowerBack Neck Neck1 Head
HeadTop_End"""
ARM = """Collar Shoulder UpArm LowArm Arm ForeArm Elbow Wrist Hand FingerBase HandIndex1 HandIndex2
HandIndex3 HandThumb1 HandThumb2 HandThumb3 HandMiddle1 HandRing1 HandPinky1 Thumb"""
LEG = "Hip UpLeg Knee LowLeg Leg Ankle Foot Toe ToeBase Toe_End"
CMU_CENTER = "root lowerback upperback thorax lowerneck upperneck head"
CMU_LIMB = "hipjoint femur tibia foot toes clavicle humerus radius wrist hand fingers thumb"
DAZ = """hip abdomen chest neck lThigh lShin lFoot lCollar lShldr lForeArm lHand rThigh rShin rFoot
rCollar rShldr rForeArm rHand"""

ASF = """# AST/ASF file generated using VICON BodyLanguage
# -----------------------------------------------
:version 1.10
:name VICON
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
   .ast/.asf automatically generated from VICON data using
   VICON BodyBuilder and BodyLanguage model FoxedUp or BRILLIANT.MOD
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name lhipjoint
     direction 0.0 0.0 0.0
     length 0
     axis 0 0 0  XYZ
  end
  begin
     id 2
     name lfemur
     direction 0.34202 -0.939693 0
     length 1.0
     axis 0 0 20  XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
:hierarchy
  begin
    root lhipjoint rhipjoint lowerback
    lhipjoint lfemur
    lfemur ltibia
    ltibia lfoot
    lfoot ltoes
    rhipjoint rfemur
    rfemur rtibia
    rtibia rfoot
    rfoot rtoes
    lowerback upperback
    upperback thorax
    thorax lowerneck lclavicle rclavicle
    lowerneck upperneck
    upperneck head
    lclavicle lhumerus
    lhumerus lradius
    lradius lwrist
    lwrist lhand lthumb
    lhand lfingers
    rclavicle rhumerus
    rhumerus rradius
    rradius rwrist
    rwrist rhand rthumb
    rhand rfingers
  end
#!OML:ASF
:FULLY-SPECIFIED
:DEGREES
"""


def names() -> list[str]:
    """Joint names that skeletons of MotionBuilder, Mixamo, CMU and Daz share."""
    sides = [f"{side}{part}" for side in ("Left", "Right") for part in (LEG + " " + ARM).split()]
    cmu = [f"{side}{part}" for side in "lr" for part in CMU_LIMB.split()]
    return [*CENTER.split(), *sides, "mixamorig:Hips", *CMU_CENTER.split(), *cmu, *DAZ.split()]


def fields(joints: Sequence[str]) -> bytes:
    """JOINT fields as SKEL has them: an offset of zeros, three rotations."""
    rows = []
    for index, name in enumerate(joints):
        head = bytes((len(name), *name.encode(), index, 3))
        rows.append(head + bytes(24) + b"\0\3" + b"\6\0\0\5\0\0\4\0\0")
    return b"".join(rows)


def hierarchy(joints: Sequence[str], end: str, indent: str, order: str) -> str:
    """The head of a BVH in which each joint is the child of the one before."""
    lines = ["HIERARCHY", f"ROOT {joints[0]}", "{"]
    for depth, name in enumerate(joints[1:], 1):
        channels = "6 Xposition Yposition Zposition" if depth == 1 else "3"
        lines += ["OFFSET 0.00 0.00 0.00", f"CHANNELS {channels} {order}", f"JOINT {name}", "{"]
        lines[-4:] = [indent * min(depth, 9) + line for line in lines[-4:]]
    inner = indent * 6
    lines += [f"{inner}OFFSET 0.000000 0.000000 0.000000", f"{inner}CHANNELS 3 {order}"]
    lines += [f"{inner}End Site", f"{inner}{{", f"{inner}{indent}OFFSET 0.0 0.0 0.0"]
    lines += [indent * depth + "}" for depth in range(7, -1, -1)]
    lines += ["MOTION", "Frames: 2", "Frame Time: 0.033333", "Frame Time: 0.008333"]
    return end.join([*lines, "Frame Time:\t0.016667", ""])


def words() -> bytes:
    """The bytes of the annex."""
    all_names = names()
    common = all_names[:45]
    texts = (
        ASF.replace("\n", " \n"),  # as Vicon's files end lines
        ASF.replace("\n", "\r\n"),
        hierarchy(common, "\r\n", "\t", "Zrotation Xrotation Yrotation"),
        hierarchy(all_names[-18:], "\n", "  ", "Xrotation Yrotation Zrotation"),
        hierarchy(common[:8], "\n", "    ", "Zrotation Yrotation Xrotation"),
        hierarchy(common, "\n", "\t", "Zrotation Yrotation Xrotation"),
    )
    made = fields(all_names) + "".join(texts).encode()
    assert len(made) <= MOST, len(made)
    return made


if __name__ == "__main__":
    TARGET.write_bytes(words())
