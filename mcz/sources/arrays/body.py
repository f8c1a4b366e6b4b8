"""Arrays of a body model, as AMASS has them: one motion of a tree of joints.

The names are those of AMASS and of the package smplx. Rotations are rotation vectors, a joint after
the other in the order of the model; all lengths are meters.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mcz.model.motion import Skeleton
from mcz.model.types import Items
from mcz.sources.arrays.body_trees import BodyTree, skeleton_of, tree
from mcz.sources.arrays.files import Array

WHOLE = ("poses", "fullpose", "full_pose")  # all joints
PLACES = ("trans", "transl")  # where the root is
ROOT, BODY = ("root_orient", "global_orient"), ("pose_body", "body_pose")
FACE = (("pose_jaw", "jaw_pose"), ("pose_eye",), ("leye_pose",), ("reye_pose",))
HANDS = (("pose_hand",), ("left_hand_pose",), ("right_hand_pose",))
FACE_SIZE, HANDS_SIZE = 9, 90  # numbers of a face and of two hands that have all their joints
BODY_SIZES = {63: "smplh", 69: "smpl"}  # numbers of a body without its root, and its model
WITHOUT_HANDS = 22  # joints that SMPL-H and SMPL-X share
POSITION = 3  # channels of the root before its rotation
WITH_FACE = 165  # numbers of SMPL-X
PARTS = {**dict.fromkeys(ROOT, 0), **dict.fromkeys(BODY, 3)}  # where parts of all joints begin
FACES = {"pose_jaw": 66, "jaw_pose": 66, "pose_eye": 69, "leye_pose": 69, "reye_pose": 72}


@dataclass(frozen=True, slots=True)
class Body:
    """The motion signal of a body: ``words`` side by side, and where columns of arrays are."""

    skeleton: Skeleton
    n_frames: int
    words: list[Items]
    places: dict[int, Sequence[int]]


def body_of(arrays: Sequence[Array]) -> Body | None:
    """The body that the arrays of a file speak of, None where they do not."""
    named = {
        array.name: index
        for index, array in reversed([*enumerate(arrays)])
        if not array.kept and array.head.code.startswith("f")
    }
    whole = next((named[name] for name in WHOLE if name in named), None)
    turns = [whole] if whole is not None else _pose_parts(arrays, named)
    model = _model(sum(arrays[k].numbers.shape[1] for k in turns)) if turns else None
    if model is None:
        return None
    n_frames = arrays[turns[0]].n_rows
    if any(arrays[k].n_rows != n_frames for k in turns):
        return None
    places = [named[name] for name in PLACES if name in named]
    root = [k for k in places if arrays[k].numbers.shape == (n_frames, POSITION)][:1]
    repeats: dict[int, Sequence[int]] = {}
    at = 0
    for index in (*root, *turns):
        repeats[index] = range(at, at + arrays[index].numbers.shape[1])
        at += len(repeats[index])
    if whole is not None:
        repeats |= dict(_repeated_parts(arrays, named, whole, POSITION * len(root)))
    skeleton = skeleton_of(model, moves=bool(root))
    return Body(skeleton, n_frames, [arrays[k].numbers for k in (*root, *turns)], repeats)


def _pose_parts(arrays: Sequence[Array], named: Mapping[str, int]) -> list[int]:
    """The arrays of parts that are the joints of a model in its order, [] where there are none."""
    root, body = (next((named[n] for n in names if n in named), None) for names in (ROOT, BODY))
    if root is None or body is None or arrays[root].numbers.shape[1] != 3:
        return []
    if arrays[body].numbers.shape[1] not in BODY_SIZES:
        return []
    joined = [root, body]
    if BODY_SIZES[arrays[body].numbers.shape[1]] == "smpl":
        return joined
    for group, size in ((FACE, FACE_SIZE), (HANDS, HANDS_SIZE)):
        parts = [k for names in group for k in (next((named[n] for n in names if n in named), -1),)]
        parts = [k for k in parts if k >= 0]
        if sum(arrays[k].numbers.shape[1] for k in parts) == size:
            joined += parts
    return joined


def _model(n_numbers: int) -> BodyTree | None:
    """The model, or the first joints of one, that has so many rotation vectors."""
    n_joints, rest = divmod(n_numbers, 3)
    if rest:
        return None
    if n_joints in (24, 52, 55):
        return tree(n_joints)
    base = {WITHOUT_HANDS: "smplh", WITHOUT_HANDS + FACE_SIZE // 3: "smplx"}.get(n_joints)
    if base is None:
        return None
    full = tree(base)
    return replace(full, names=full.names[:n_joints], parents=full.parents[:n_joints])


def _repeated_parts(
    arrays: Sequence[Array], named: Mapping[str, int], whole: int, first: int
) -> Iterator[tuple[int, Sequence[int]]]:
    """Arrays that repeat columns of ``whole``, whose channels begin with ``first``."""
    words = arrays[whole].numbers
    starts = PARTS | dict.fromkeys(("pose_hand", "left_hand_pose"), 66)
    starts["right_hand_pose"] = 66 + HANDS_SIZE // 2
    if words.shape[1] == WITH_FACE:
        hands = [name for names in HANDS for name in names]
        starts = {n: at + FACE_SIZE * (n in hands) for n, at in starts.items()} | FACES
    for name, at in starts.items():
        index = named.get(name)
        if index is None:
            continue
        part = arrays[index].numbers
        stop = at + part.shape[1]
        if stop <= words.shape[1] and _same(words[:, at:stop], part):
            yield index, range(first + at, first + stop)


def _same(one: Items, other: Items) -> bool:
    """Return True if two arrays have the same type and bits."""
    if one.dtype != other.dtype or one.shape != other.shape:
        return False
    kind = f"u{one.dtype.itemsize}"
    words = [np.ascontiguousarray(each).view(kind) for each in (one, other)]
    return np.array_equal(words[0], words[1])
