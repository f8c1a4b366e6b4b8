"""Valid: the container, skeletons, attachments."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction

import numpy as np

from mcz.container import payloads
from mcz.container.limits import ARCHIVE
from mcz.files.encoding import write_skeleton
from mcz.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.schema import build
from tools.vectors.craft import Crafter, Vector, Whole, file_of, finished, partial
from tools.vectors.motions import HUNDREDTHS, channels, dance, numbers, puppet


def vectors() -> Iterable[Vector]:
    container, skeletons = Whole("valid/container"), Whole("valid/skeletons")
    _clips(container)
    _attachments(container)
    _quality(container)
    _skeletons(skeletons)
    _derived(skeletons)
    _empty(skeletons)
    return [*container.vectors, *skeletons.vectors]


def _clips(shelf: Whole) -> None:
    purpose = "A file may hold nothing at all."
    shelf.hold("minimal", "Grammar; HEAD; FOOT", purpose, file_of())
    two = dance(), dance(3, name="encore", frame_rate=None)
    purpose = "Two clips share a skeleton; the second has an unknown frame rate."
    parts = (partial(two[1], (0, 3)), partial(two[0], (3, 4)))
    shelf.hold("two-clips", "Grammar; CLIP", purpose, file_of(*two), *two, parts=parts)
    metadata = {"subject": "Åsa", "x-mood": ""}
    ntsc = dance(name="ntsc", frame_rate=Fraction(30000, 1001), frame_rate_exact=False)
    ntsc = replace(ntsc, metadata=metadata)
    purpose = "A rounded rational frame rate, metadata of the registry and private ones."
    shelf.hold("metadata", "CLIP; Registry", purpose, file_of(ntsc), ntsc)
    numbered = dance(frame_numbers=np.array([-3, -2, 10, 11]))
    purpose = "Frame numbers that do not begin at 1 and have a gap."
    shelf.hold("frame-numbers", "Registry", purpose, file_of(numbered), numbered)
    data = finished(Crafter(profile=ARCHIVE), dance())
    shelf.hold("archive-profile", "Limits and profiles", "The archive profile.", data, dance())


def _attachments(shelf: Whole) -> None:
    first, second = b"notes, notes, notes, notes\n" * 9, bytes(range(60))
    crafter = Crafter()
    crafter.parts("takes/notes.txt", first, second)
    crafter.parts("empty.txt", b"")
    crafter.alias("copy.txt", payloads.OF_ATTACHMENT, b"takes/notes.txt")
    shelf.hold(
        "attachments",
        "ATTA; ALIA",
        "An attachment in a deflated and a stored part, an empty one, and a second name of one.",
        finished(crafter),
        sources=(
            ("takes/notes.txt", first + second),
            ("empty.txt", b""),
            ("copy.txt", first + second),
        ),
        modes=("arrays", "sources"),
    )


def _quality(shelf: Whole) -> None:
    crafter = Crafter()
    crafter.clip(dance())
    entries = [{"key": "position_error_cm", "value": "0.0"}, {"key": "encoder", "value": "none"}]
    crafter.ancillary(b"QUAL", build(payloads.QUAL, {"entries": entries, "extension": b""}, "QUAL"))
    shelf.hold("quality", "QUAL", "A quality record behind CEND.", finished(crafter), dance())


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
