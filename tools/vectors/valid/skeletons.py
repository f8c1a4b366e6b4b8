"""Valid: skeletons."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.skeleton import AXES, HANDS
from mcz.writing.clip_writer import write_skeleton
from tools.vectors.build.files import Crafter, Vector, Whole, file_of, finished
from tools.vectors.build.motions import HUNDREDTHS, channels, dance, numbers, puppet


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/skeletons")
    _skeletons(shelf)
    _derived(shelf)
    _empty(shelf)
    _axes(shelf)
    return shelf.vectors


def _skeletons(shelf: Whole) -> None:
    crafter = Crafter()
    write_skeleton(crafter, puppet())
    shelf.hold("alone", "SKEL; Grammar", "A skeleton without any clip.", finished(crafter))
    limb = Joint("limb", 0, (1.0, 0.0, 0.0), axis=(0.0, -90.0, 20.5), axis_order="ZYX")
    joints = (
        Joint("a", channels=channels("tx rx sx length qw"), adds_to_offset=False),
        replace(limb, name="bröstkorg", tails=((0.0, 1.0, 0.0), (0.0, 0.0, -0.0))),
        Joint("", -1, channels=(Channel("", "grip", "N"), Channel("tz", "height"))),
    )
    odd = Skeleton(joints, "odd", 2.54 / 0.45, "rad", "z", intrinsic=False)
    motion = Motion(odd, (Signal(numbers(3, 7), (HUNDREDTHS,) * 7),), name="odd")
    purpose = "Two roots, axes, two tails, an empty name, named channels, unit, angle, up axis."
    shelf.hold("every-field", "SKEL", purpose, file_of(motion), motion)
    same = replace(puppet(), joints=tuple(replace(j, name="twin") for j in puppet().joints))
    motion = dance(skeleton=same)
    purpose = "Joint names need not be unique."
    shelf.hold("repeated-names", "SKEL", purpose, file_of(motion), motion)


def _derived(shelf: Whole) -> None:
    crafter = Crafter()
    derived = replace(puppet(), name="derived", base=write_skeleton(crafter, puppet()))
    motion = dance(skeleton=derived)
    purpose = "A skeleton that names the one it was derived from."
    shelf.hold("derived", "SKEL", purpose, finished(crafter, motion), motion)


def _empty(shelf: Whole) -> None:
    for name, bones in (("no-joints", Skeleton(())), ("no-channels", Skeleton((Joint("rock"),)))):
        motion = Motion(bones, (Signal(np.empty((4, 0))),), name=name)
        purpose = f"A clip of 4 frames without a channel: {name}."
        shelf.hold(name, "SKEL; CEND", purpose, file_of(motion), motion)


def _axes(shelf: Whole) -> None:
    """A skeleton of each up axis, facing along the next; the hands in turn."""
    crafter = Crafter()
    for number, up in enumerate(AXES):
        forward = AXES[number % 6 + 1] if up else "-z"
        skeleton = replace(puppet(), up_axis=up, forward_axis=forward, handedness=HANDS[number % 3])
        write_skeleton(crafter, replace(skeleton, name=f"up {up or 'unknown'}"))
    purpose = "Skeletons of all up axes, forward axes and hands; no value depends on them."
    motion = dance(skeleton=skeleton)
    shelf.hold("axes", "SKEL", purpose, finished(crafter, motion), motion)
