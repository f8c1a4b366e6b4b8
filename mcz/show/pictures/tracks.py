"""Frames of a motion as nodes in one frame of reference: forward x, left y, up z, in cm if known.

Only bounds of the whole are kept: positions are read again, block after block.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mcz.errors import MotionError
from mcz.kinematics.chain import Floats
from mcz.kinematics.joint_groups import find_feet
from mcz.kinematics.points import point_set
from mcz.kinematics.poses.motion_like import MotionLike, values_of
from mcz.model.skeleton import signs_of
from mcz.model.types import Ints
from mcz.model.units import unit_cm_of
from mcz.show.pictures.bodies import (
    LEFT,
    RIGHT,
    Body,
    are_known,
    body_of,
    figure_size,
    near_others,
    radii,
    remove_false_bones,
)

BLOCK = 2**19  # numbers a block, which bounds the memory
SAMPLES = 64  # frames that determine sizes and facing
MOST_LEAD = 2**14  # greatest number of frames that are read, but not drawn, between two drawn ones
TURNS = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}  # the axes of the file that are x, y, z
FARTHEST = 1e12  # cm or units from the origin: farther points are unknown
MOST_SIZES = 300  # sizes of the figure from its usual place: farther points are faults
STEADY = 0.5  # of 1: how much of the time it faces one way, or the first frame counts


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Some frames of a motion, in order, and their common facts.

    ``size`` is the figure's, ``radii`` (n_bones, 2) the thickness of its bones, ``floor`` the
    height of the floor, ``forward`` (3,) its facing; all in ``unit``, "cm" or "units". ``centers``
    (n_frames, 3) is its position, NaN where unknown; ``up`` the axis of the file.
    """

    moving: MotionLike
    body: Body
    frames: Ints
    up: str
    up_assumed: bool
    scale: float
    unit: str
    size: float
    radii: Floats
    floor: float
    forward: Floats
    centers: Floats

    def __iter__(self) -> Iterator[tuple[int, Floats]]:
        """Every frame, counted as in the file, and its nodes (n_nodes, 3), NaN where unknown."""
        for frames, places in _blocks(self.moving, self.body, self.frames, self.up, self.scale):
            yield from zip(frames.tolist(), places, strict=True)

    def blocks(self) -> Iterator[tuple[Ints, Floats]]:
        """The same by blocks: frames (n,), nodes (n, n_nodes, 3)."""
        return _blocks(self.moving, self.body, self.frames, self.up, self.scale)


def track_of(moving: MotionLike, frames: Ints, unit: str | None, up: str | None) -> Track:
    """The track of these frames, ascending; ``unit`` and ``up`` where the skeleton states none.

    Raises MotionError where the motion has no kinematics, no joint, no frame, or no known position.
    """
    skeleton = moving.skeleton
    if not skeleton.joints or not len(frames):
        what = "joint" if not skeleton.joints else "frame"
        raise MotionError(f"{moving.name!r} has no {what}: nothing to draw")
    body = body_of(skeleton)
    chosen = frames[np.unique(np.linspace(0, len(frames) - 1, SAMPLES).astype(np.int64))]
    unit_cm = skeleton.unit_cm or (unit and unit_cm_of(unit))
    scale = unit_cm or 1.0
    seen = np.concatenate([p for _, p in _blocks(moving, body, chosen, "z", scale)])
    if not are_known(seen).any():
        raise unknown(moving)
    axis = skeleton.up_axis or up or guess_up_axis(body, seen)
    seen = _turned(seen, axis)
    body = remove_false_bones(body, seen)
    size = figure_size(seen[:, body.drawn_nodes])
    track = Track(
        moving=moving,
        body=body,
        frames=frames,
        up=axis,
        up_assumed=not (skeleton.up_axis or up),
        scale=scale,
        unit="cm" if unit_cm else "units",
        size=size,
        radii=radii(body, seen, size),
        floor=0.0,
        forward=facing(body, seen),
        centers=np.empty((0, 3)),
    )
    return _measure_track(track)


def unknown(moving: MotionLike) -> MotionError:
    return MotionError("no position is known in these frames: nothing to draw", clip=moving.name)


def _measure_track(track: Track) -> Track:
    """``track`` with its floor and its centers, from one pass over all frames."""
    shown = track.body.drawn_nodes
    lows, centers = [], []
    for _, places in track.blocks():
        for nodes in places[:, shown]:
            known = nodes[near_others(nodes)]
            lows.append(known[:, 2].min() if len(known) else np.nan)
            centers.append(
                (known.min(axis=0) + known.max(axis=0)) / 2 if len(known) else np.full(3, np.nan)
            )
    heights = np.array(lows)
    heights = heights[np.isfinite(heights)]
    low = float(np.quantile(heights, 0.02)) if len(heights) else 0.0
    low = 0.0 if 0 <= low < 0.06 * track.size else low - 0.004 * track.size
    middles = np.array(centers).reshape(-1, 3)
    if not are_known(middles).any():
        raise unknown(track.moving)
    usual = np.median(middles[are_known(middles)], axis=0)
    with np.errstate(invalid="ignore"):
        middles[~(np.abs(middles - usual).max(axis=1) <= MOST_SIZES * track.size)] = np.nan
    return replace(track, floor=low, centers=middles)


def _blocks(
    moving: MotionLike, body: Body, frames: Ints, up: str, scale: float
) -> Iterator[tuple[Ints, Floats]]:
    skeleton = moving.skeleton
    width = max(1, skeleton.n_channels + 12 * skeleton.n_joints)
    longest = max(1, min(MOST_LEAD, BLOCK // width))
    every = range(skeleton.n_joints)
    per_frame = _samples_per_frame(moving)
    at = 0
    while at < len(frames):
        stop = max(at + 1, int(np.searchsorted(frames, frames[at] + longest)))
        first, last = int(frames[at]), int(frames[stop - 1]) + 1
        values = values_of(moving, (first, last), every)[::per_frame][frames[at:stop] - first]
        places = _turned(body.places(values), up)
        with np.errstate(all="ignore"):
            places *= scale
            unseen = ~(np.abs(places) < FARTHEST)
        places[unseen] = np.nan
        yield frames[at:stop], places
        at = stop


def _turned(places: Floats, up: str) -> Floats:
    turned_places: Floats = (places * signs_of(up))[:, :, TURNS[up[-1]]]
    return turned_places


def _samples_per_frame(moving: MotionLike) -> int:
    signal: Any = moving.signals[0]  # of a Motion, or the facts of a Clip
    return int(getattr(signal, "samples_per_frame", 0) or signal.layout.samples_per_frame)


def guess_up_axis(body: Body, places: Floats) -> str:
    """The axis along which all is farthest from the feet; without feet y, of markers z."""
    feet = find_feet(body.skeleton)
    if feet:
        with np.errstate(all="ignore"):
            known = are_known(places)
            sums = np.where(known[..., None], places, 0.0)
            middle = sums.sum(axis=(0, 1)) / max(1, known.sum())
            low = sums[:, feet].sum(axis=(0, 1)) / max(1, known[:, feet].sum())
        apart = np.abs(middle - low)
        if known[:, feet].any() and apart.max() > 0:
            return "xyz"[int(apart.argmax())]
    return "z" if point_set(body.skeleton) == "markers" else "y"


def facing(body: Body, places: Floats) -> Floats:
    """Facing of the figure, a horizontal unit vector: across its left and its right.

    The facing of most frames, or if it turns much of the first; x if no name shows sides.
    """
    across = np.zeros((len(places), 3))
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        nodes = places[:, body.sides == side]
        known = are_known(nodes)
        count = known.sum(axis=1)
        if not len(nodes) or not nodes.shape[1]:
            return np.array([1.0, 0.0, 0.0])
        with np.errstate(all="ignore"):
            mean = np.where(known[..., None], nodes, 0.0).sum(axis=1) / count[:, None]
        across += sign * mean
    across[:, 2] = 0.0
    with np.errstate(all="ignore"):
        across /= np.sqrt((across**2).sum(axis=1))[:, None]
    across = across[are_known(across)]
    if not len(across):
        return np.array([1.0, 0.0, 0.0])
    mean = across.mean(axis=0)
    left = mean if np.linalg.norm(mean) > STEADY else across[0]
    left = left / np.linalg.norm(left)
    return np.array([left[1], -left[0], 0.0])  # left x up
