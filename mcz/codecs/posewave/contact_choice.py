"""Encoder choice of contact points, and of the frames that hold each.

SPEC.md, "Held contacts", defines their effect; decoders do not need it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mcz.codecs.contract import SignalSource
from mcz.codecs.parameters import in_range
from mcz.codecs.posewave.contact_plan import (
    MAX_POINTS,
    MAX_RAMP,
    ContactsFields,
    PointFields,
    path_of,
)
from mcz.codecs.posewave.contacts import Piece
from mcz.codecs.posewave.header import NAME
from mcz.codecs.posewave.skeleton_plan import has_kinematics
from mcz.codecs.segments import skeleton_of
from mcz.codecs.source_readers import FrameReader
from mcz.errors import OptionError
from mcz.kinematics.contacts import USUAL_RATE, FootTracks
from mcz.kinematics.joint_names import find_feet
from mcz.kinematics.points import points_of, positions_of
from mcz.model.checks import merged_ranges
from mcz.model.motion import Skeleton
from mcz.model.text_format import named

Run = tuple[str, int, int]  # a joint whose first point stands, its first frame, number of frames
Runs = tuple[Run, ...] | str

AUTO = "auto"
_ENTRY = re.compile(r"(?P<name>.+?)(?::(?P<first>\d+)\+(?P<count>\d+))?")
BLOCK = 1024  # frames of a block

SPREAD = 0.866  # of the grid relative to the tolerance: every place is within 0.97 of it
ROUNDS = 4
RAMP_SECONDS = 1 / 15


@dataclass(frozen=True, slots=True)
class ContactSettings:
    """Fields of CONTACTS, and the pieces to hold, in the order of their points and frames."""

    fields: ContactsFields
    pieces: tuple[Piece, ...]


def parse_runs(option: Any) -> Runs:
    """Contacts as text or, from Python, as tuples of a joint, a first frame and a count.

    "auto": wherever a foot stands by the usual rule. A joint without frames: wherever it stands.

    >>> parse_runs("lfoot, rfoot:160+52")
    (('lfoot', 0, 0), ('rfoot', 160, 52))
    """
    if option == AUTO:
        return AUTO
    try:
        if isinstance(option, str):
            option = [_parse_entry(part.strip()) for part in option.split(",")]
        runs = tuple((str(name), int(first), int(count)) for name, first, count in option)
    except (TypeError, ValueError):
        raise OptionError(
            f"contacts is {option!r}; it must be auto or like lfoot,rfoot:160+52"
        ) from None
    for name, first, count in runs:
        if first < 0 or count < 0 or not name or (not count and first):
            raise OptionError(
                f"contacts: {name!r} cannot stand for {count} frames from frame {first} on"
            )
    return runs


def run_words(runs: Runs) -> str:
    """
    >>> run_words((("lfoot", 0, 0), ("rfoot", 160, 52)))
    'lfoot,rfoot:160+52'
    """
    if isinstance(runs, str):
        return runs
    return ",".join(f"{name}:{first}+{n}" if n else name for name, first, n in runs)


in_range("auto, or joints, each with frames (joint:first+count) or without", parse_runs)


def _parse_entry(text: str) -> Run:
    match = _ENTRY.fullmatch(text)
    if match is None:
        raise ValueError(text)
    return match["name"], int(match["first"] or 0), int(match["count"] or 0)


def runs_of(source: SignalSource, runs: Runs) -> tuple[Run, ...]:
    """Requested runs, detected by the contact rule if no frames are given.

    Raises OptionError for frames beyond the clip, for an unknown angle unit, and without a foot.
    """
    layout = source.layout
    skeleton, n_frames = skeleton_of(NAME, layout), layout.n_frames
    if not has_kinematics(skeleton, whole=True):
        raise OptionError(
            f"contacts: the angle unit of {named('skeleton', skeleton.name)} is unknown"
        )
    if isinstance(runs, str):
        if not find_feet(skeleton):
            raise OptionError(
                f"contacts: no joint of {named('skeleton', skeleton.name)} is named like a foot; "
                "name the feet, such as contacts=ankle_l,ankle_r"
            )
        return _detect_runs(source, skeleton, None)
    for name, first, count in runs:
        _joint_index(skeleton, name)
        if first + count > n_frames:
            raise OptionError(
                f"contacts: {name}:{first}+{count} ends after the last of {n_frames} frames"
            )
    shifted = tuple(run for run in runs if run[2])
    alone = [name for name, _, count in runs if not count]
    return (*shifted, *_detect_runs(source, skeleton, alone)) if alone else shifted


def _detect_runs(
    source: SignalSource, skeleton: Skeleton, joints: Sequence[str] | None
) -> tuple[Run, ...]:
    layout = source.layout
    tracks, reader = FootTracks(skeleton, joints, layout.n_frames), FrameReader(NAME, source)
    for start in range(0, layout.n_frames, BLOCK):
        values = reader.next(min(start + BLOCK, layout.n_frames))
        tracks.add(start, positions_of(skeleton, values))
    rate = None if layout.frame_rate is None else float(layout.frame_rate)
    contacts = tracks.contacts(rate, skeleton.up_axis)
    return tuple((run.joint, run.first, run.n_frames) for run in contacts.runs)


def choose_contacts(
    skeleton: Skeleton, runs: Iterable[Run], tolerance: float, frame_rate: float | None
) -> ContactSettings | None:
    """Contact settings that hold ``runs`` to ``tolerance``, in length units; None without runs.

    Raises OptionError for an unknown joint, or for too many.
    """
    by_joint: dict[int, list[tuple[int, int]]] = {}
    for name, first, count in runs:
        by_joint.setdefault(_joint_index(skeleton, name), []).append((first, first + count))
    if not by_joint:
        return None
    if len(by_joint) > MAX_POINTS:
        raise OptionError(f"contacts: {len(by_joint)} joints are more than {MAX_POINTS}")
    step = float(np.float32(SPREAD * tolerance))
    joints, points, pieces, n_stances = sorted(by_joint), [], [], 0
    for joint in joints:
        above = [j for j in path_of(skeleton.parents, joint)[:-1] if j in by_joint]
        follows = joints.index(above[-1]) + 1 if above else 0
        tail = points_of(skeleton)[joint][0] + 1
        points.append(PointFields(joint=joint, tail=tail, step=step, follows=follows))
    for group in _group_joints(skeleton, joints):
        stances = merged_ranges([span for joint in group for span in by_joint[joint]])
        for joint in group:
            for first, stop in merged_ranges(by_joint[joint]):
                stance = n_stances + sum(end <= first for _, end in stances)
                pieces.append(Piece(joints.index(joint), first, stop - first, first, stance))
        n_stances += len(stances)
    ramp = min(round(RAMP_SECONDS * (frame_rate or USUAL_RATE)), MAX_RAMP)
    return ContactSettings(ContactsFields(rounds=ROUNDS, ramp=ramp, points=points), tuple(pieces))


def _group_joints(skeleton: Skeleton, joints: Sequence[int]) -> list[list[int]]:
    """Groups of joints on one chain, such as a foot and its toe."""
    groups: list[list[int]] = []
    for joint in joints:
        path = set(path_of(skeleton.parents, joint))
        for group in groups:
            if not path.isdisjoint(group):
                group.append(joint)
                break
        else:
            groups.append([joint])
    return groups


def _joint_index(skeleton: Skeleton, name: str) -> int:
    addresses = list(skeleton.addresses())
    if name not in addresses:
        raise OptionError(f"contacts: no joint is called {name!r}")
    return addresses.index(name)
