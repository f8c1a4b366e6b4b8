"""The rest pose: every joint at its offset, unturned; a check of its lengths."""

from __future__ import annotations

import re
from decimal import ROUND_HALF_UP, Decimal

import numpy as np

from mcz.kinematics.joint_names import find_feet
from mcz.model.checks import check_arguments
from mcz.model.motion import A_SKELETON, POSITION_KINDS, Skeleton
from mcz.model.types import Floats

NO_LENGTHS = "no bone has a length"
PEOPLE_CM = 80.0, 260.0  # from a small child to a tall person with arms stretched out
_HEAD = re.compile("head|neck", re.IGNORECASE)


def has_no_lengths(skeleton: Skeleton) -> bool:
    """Return True if joints turn, but all coincide with their root in any pose.

    Arrays of body models are such: a model has the lengths of the bones, not the arrays.
    """
    below = [joint for joint in skeleton.joints if joint.parent >= 0]
    turned = any(channel.kind for joint in below for channel in joint.channels)
    moved = any(any(joint.offset) or joint.tails for joint in below)
    placed = any(channel.kind in POSITION_KINDS for joint in below for channel in joint.channels)
    return turned and not moved and not placed


@check_arguments(skeleton=A_SKELETON)
def rest_positions(skeleton: Skeleton) -> Floats:
    """Positions of the joints at rest, float64 (n_joints, 3), in length units.

    No joint is turned, moved or stretched: rotation and length channels are 0, scales are 1. A
    joint whose position channels replace its offset also lies at its offset, for 0 would put it
    onto its parent.
    """
    positions = skeleton.offsets
    for index, joint in enumerate(skeleton.joints):
        if joint.parent >= 0:
            positions[index] += positions[joint.parent]
    return positions


def figure_height(skeleton: Skeleton) -> float | None:
    """The greatest extent at rest of a figure that has feet and a head by name, in length units.

    None for any other, such as a hand, a face, a prop or markers. It is the height of a standing
    figure, and about the width of one with arms stretched out.
    """
    names = (joint.name for joint in skeleton.joints)
    if len(find_feet(skeleton)) < 2 or not any(map(_HEAD.search, names)):
        return None
    places = rest_positions(skeleton)
    tails = [
        place + np.array(tail)
        for place, joint in zip(places, skeleton.joints, strict=True)
        for tail in joint.tails
    ]
    points = np.vstack([places, *tails])
    return float(np.ptp(points, axis=0).max()) or None


def height_note(skeleton: Skeleton) -> str:
    """A note on a figure of an inhuman height, perhaps of a wrong unit; or ""."""
    height, unit_cm = figure_height(skeleton), skeleton.unit_cm
    return "" if height is None or unit_cm is None else note_on_height(height, unit_cm)


def note_on_height(height: float, unit_cm: float) -> str:
    """A note on an inhuman height in length units; or "".

    >>> note_on_height(27.5, 2.54)
    'height 27.5 units = 69.9 cm, which is not human; is 1 unit = 2.54 cm right?'
    >>> note_on_height(27.5, 5.6444)
    ''
    """
    if PEOPLE_CM[0] <= height * unit_cm <= PEOPLE_CM[1]:
        return ""
    # Halves of the printed decimals round up: 27.5 units of 2.54 cm are 69.9 cm.
    height_cm = Decimal(f"{height * unit_cm:.6g}").quantize(Decimal("0.1"), ROUND_HALF_UP)
    return (
        f"height {height:.3g} units = {height_cm:,} cm, which is not human; "
        f"is 1 unit = {unit_cm:.6g} cm right?"
    )
