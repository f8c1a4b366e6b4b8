"""Interpretation of the arrays of a file: the motion, further signals, the frame rate.

Nothing here is normative: a template says where each column went.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import product

import numpy as np

from mcz.errors import SourceError
from mcz.model.clock import times_fault
from mcz.model.motion import Channel, Joint, Skeleton
from mcz.model.types import Items
from mcz.sources.arrays.columns import Array
from mcz.sources.arrays.skeletons import (
    BODIES,
    BODY_NAMES,
    JOINT_NAMES,
    JOINTS,
    BodyTree,
    decode_text,
    is_robot,
    joint_names,
    names_of,
    robot_channels,
    skeleton_of,
    tree,
)
from mcz.sources.tables.times import UNITS, rate_of_times

MAX_PER_FRAME = 1000  # rows a frame of an array that is longer than the motion


@dataclass(frozen=True, slots=True)
class ArraySignal:
    """The arrays of a signal: ``words`` are (rows, columns), whose columns it has in order."""

    name: str
    words: list[Items]
    per_frame: int = 1
    channels: tuple[Channel, ...] | None = None
    role: str = ""


@dataclass
class Interpretation:
    """Signals made of arrays; ``places``: by array, its signal and the channels of its columns."""

    skeleton: Skeleton
    rate: Fraction | None
    rate_is_exact: bool
    metadata: dict[str, str]
    parts: list[ArraySignal] = field(default_factory=list)
    places: dict[int, tuple[int, Sequence[int]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def has_times(self) -> bool:
        return any(part.role == "times" for part in self.parts)


def interpret_arrays(arrays: Sequence[Array]) -> Interpretation:
    """Interpret the arrays of a clip; raises SourceError if none of them is a motion."""
    body = find_body(arrays)
    n_frames = body.n_frames if body is not None else frames_of(arrays)
    rate, exact, notes = rate_of(arrays, n_frames)
    skeleton = body.skeleton if body is not None else Skeleton((), angle_unit="")
    result = Interpretation(skeleton, rate, exact, facts_of(arrays), notes=notes)
    if body is not None:
        result.parts.append(ArraySignal("motion", body.words, role="motion"))
        result.places |= {index: (0, columns) for index, columns in body.places.items()}
    else:
        _add_motion(result, arrays, n_frames)
    for index, array in enumerate(arrays):
        if index in result.places or array.kept or array.name == SHAPE:
            continue
        per_frame, rest = divmod(len(array.numbers), n_frames)
        if rest or per_frame > (1 if n_frames < 2 else MAX_PER_FRAME) or not per_frame:
            if array.is_large:
                shape = "x".join(map(str, array.head.shape))
                result.notes.append(f"{array.name} has {shape} numbers, and is kept as its bytes")
            continue
        place = len(result.parts), range(array.numbers.shape[1])
        result.places[index] = place
        channels, role = _channels(array, arrays), ""
        if per_frame == 1 and channels[0].unit == "s" and not result.has_times:
            if fault := times_fault(array.numbers[:, 0].astype(np.float64)):
                result.notes.append(f"the times do not count: {fault}")
            else:
                role = "times"
        part = ArraySignal(array.name, [array.numbers], per_frame, channels, role)
        result.parts.append(part)
    return result


def frames_of(arrays: Sequence[Array]) -> int:
    """The number of frames: of the times, of a robot's joints, else the longest first axis."""
    numbers = [array for array in arrays if not array.kept]
    times = [array.n_rows for array in numbers if array.name in TIMES and len(array.head.shape) < 2]
    if times and any(array.n_rows == times[0] for array in numbers if array.name not in TIMES):
        return times[0]
    robots = [array.n_rows for array in numbers if is_robot(array)]
    if robots:
        return robots[0]
    for n_axes in (3, 2):  # a mesh or a model has rows, too, but seldom three axes
        rows = [array.n_rows for array in numbers if len(array.head.shape) >= n_axes]
        if rows:
            return max(rows)
    raise SourceError("; ".join(("no array has a row for each frame", *_reasons(arrays))))


def _reasons(arrays: Sequence[Array]) -> list[str]:
    """Reasons why the first arrays are no motion."""
    listed = arrays[:4]
    reasons = [f"{a.name!r} is {a.kept or f'of shape {a.head.shape}'}" for a in listed]
    return [*reasons, "..."] if len(arrays) > len(listed) else reasons


def _add_motion(result: Interpretation, arrays: Sequence[Array], n_frames: int) -> None:
    """Add the motion: the joint angles of a robot, else the first array with the most axes."""
    candidates = [
        (index, array)
        for index, array in enumerate(arrays)
        if not array.kept and array.n_rows == n_frames and array.name not in TIMES
    ]
    if not candidates:
        raise SourceError("; ".join((f"no array of {n_frames} frames", *_reasons(arrays))))
    index, array = max(candidates, key=lambda item: (is_robot(item[1]), _n_axes(item[1])))
    result.parts.append(ArraySignal("motion", [array.numbers], role="motion"))
    result.places[index] = 0, range(array.numbers.shape[1])
    joints = plain_joints(array.head.shape[1:], array.name)
    if is_robot(array):
        channel = Channel("", "value", JOINTS[array.name])
        names, robot, note = joint_names(arrays, len(joints))
        names = names or tuple(joint.name for joint in joints)
        joints = tuple(Joint(name, channels=(channel,)) for name in names)
        if robot:
            result.metadata["x-robot"] = robot
        if note:
            result.notes.append(note)
    elif len(names := names_of(arrays, JOINT_NAMES)) == len(joints) and len(array.head.shape) > 2:
        pairs = zip(joints, names, strict=True)
        joints = tuple(replace(joint, name=name) for joint, name in pairs)
    result.skeleton = Skeleton(joints, angle_unit="")


def _n_axes(array: Array) -> int:
    """Axes of an array; more than three count as three."""
    return min(len(array.head.shape), 3)


def plain_joints(inner: Sequence[int], name: str) -> tuple[Joint, ...]:
    """Joints of plain scalars, named by number: one for each index of the second axis."""
    if not inner:
        return (Joint(name, channels=(Channel("", "value"),)),)
    if len(inner) == 1:
        channels: tuple[Channel, ...] = (Channel("", "value"),)
    else:
        channels = tuple(Channel("", label) for label in labels(inner[1:]))
    return tuple(Joint(str(number), channels=channels) for number in range(inner[0]))


def labels(inner: Sequence[int]) -> list[str]:
    """Names of the numbers of a row: their indices, separated by blanks."""
    return [" ".join(map(str, indices)) for indices in product(*map(range, inner))]


def _channels(array: Array, arrays: Sequence[Array]) -> tuple[Channel, ...]:
    """The channels of a signal of its own, named by the joints or bodies that ``arrays`` list."""
    inner = array.head.shape[1:]
    if (channels := robot_channels(array, arrays)) is not None:
        return channels
    bodies = names_of(arrays, BODY_NAMES)
    if array.name.startswith(BODIES) and inner[:1] == (len(bodies),):
        ends = [f" {label}".rstrip() for label in labels(inner[1:])]
        return tuple(Channel("", name + end) for name in bodies for end in ends)
    if not inner:
        is_time = array.name in TIMES and array.head.code.startswith("f")
        return (Channel("", array.name, "s" if is_time else ""),)
    return tuple(Channel("", label) for label in labels(inner))


TIMES = ("time", "times", "timestamp", "timestamps")
RATES = ("mocap_framerate", "mocap_frame_rate", "framerate", "frame_rate", "fps")
SHAPE = "betas"  # shape parameters of a body: only their number is metadata
LONGEST_TEXT = 200  # characters of a text that becomes metadata
EVEN = 1e-6  # of a step: deviation of times that count as uniform
_KEY = re.compile(r"[a-z0-9]+")


def rate_of(arrays: Sequence[Array], n_frames: int) -> tuple[Fraction | None, bool, list[str]]:
    """The frame rate, whether it is exactly as stated, and notes. None if times are not uniform."""
    numbers = (_number(array) for array in arrays if array.name.lower() in RATES)
    stated = next((number for number in numbers if number is not None), None)
    rate, exact = _round(*stated) if stated is not None else (None, True)
    for array in arrays:
        if array.kept or array.name not in TIMES or array.numbers.shape != (n_frames, 1):
            continue
        if array.head.code not in ("f4", "f8") or n_frames < 2:
            continue
        times = array.numbers[:, 0].astype(np.float64)
        half = 0.0
        if np.isfinite(times).all():
            half = float(np.spacing(np.abs(array.numbers).max())) / 2
            half = max(half, EVEN * abs(float(np.median(np.diff(times)))) / 2)
        times_rate, is_exact = rate_of_times(times, [half], () if rate is None else (rate,))
        if times_rate is None:
            return None, True, ["the times are not uniform"]
        notes = (
            []
            if rate in (None, times_rate)
            else [f"{float(times_rate):g} frames a second by {array.name}"]
        )
        return times_rate, is_exact, notes
    return rate, exact, []


def _number(array: Array) -> tuple[float, np.dtype[np.generic]] | None:
    """The single number of an array and its type; None if it cannot be a rate."""
    if array.words is None or array.words.size != 1:
        return None
    value = float(array.words.ravel()[0])
    return (value, array.words.dtype) if 1e-6 <= value <= 1e9 else None


def _round(value: float, dtype: np.dtype[np.generic]) -> tuple[Fraction, bool]:
    """The simplest rate that rounds to ``value`` in its type, and whether it is exact."""
    exact = Fraction(value)
    for unit in UNITS:
        rate = round(exact / unit) * unit
        if rate and float(np.array(float(rate)).astype(dtype)) == value:
            return rate, rate == exact
    return exact.limit_denominator(10**6), False


def facts_of(arrays: Sequence[Array]) -> dict[str, str]:
    """Metadata ``x-NAME`` of all single words and numbers; how many betas there are."""
    facts: dict[str, str] = {}
    for array in arrays:
        key = "x-" + "-".join(_KEY.findall(array.name.lower()))
        text = None if array.name.lower() in RATES else _text(array)
        if text is not None and len(key) > 2:
            facts.setdefault(key, text)
    for array in arrays:
        if array.name == SHAPE and array.head.shape:
            facts.setdefault("x-num-betas", str(array.head.shape[-1]))
    return facts


def _text(array: Array) -> str | None:
    """A single word or number as text; None for any other array."""
    if array.words is not None:
        if array.words.size != 1 or len(array.head.shape) > 1:
            return None
        return str(array.words.ravel()[0].item())
    if array.head.code[:1] not in ("U", "S") or np.prod(array.head.shape, dtype=np.float64) != 1:
        return None
    text = decode_text(array.text[: 4 * LONGEST_TEXT], array)
    return text if text and len(text) <= LONGEST_TEXT else None


WHOLE = ("poses", "fullpose", "full_pose")  # all joints
ROOT_POSITIONS = ("trans", "transl")  # position of the root
ROOT, BODY = ("root_orient", "global_orient"), ("pose_body", "body_pose")
FACE = (("pose_jaw", "jaw_pose"), ("pose_eye",), ("leye_pose",), ("reye_pose",))
HANDS = (("pose_hand",), ("left_hand_pose",), ("right_hand_pose",))
FACE_SIZE, HANDS_SIZE = 9, 90  # numbers of a face and of two hands that have all their joints
BODY_SIZES = {63: "smplh", 69: "smpl"}  # numbers of a body without its root, and its model
WITHOUT_HANDS = 22  # joints that SMPL-H and SMPL-X share
POSITION = 3  # channels of the root before its rotation
WITH_FACE = 165  # numbers of SMPL-X
# First number of parts in a whole pose.
PARTS = {**dict.fromkeys(ROOT, 0), **dict.fromkeys(BODY, 3)}
FACES = {"pose_jaw": 66, "jaw_pose": 66, "pose_eye": 69, "leye_pose": 69, "reye_pose": 72}


@dataclass(frozen=True, slots=True)
class ArrayBody:
    """The motion of a body: ``words`` side by side; ``places``: the columns of each array."""

    skeleton: Skeleton
    n_frames: int
    words: list[Items]
    places: dict[int, Sequence[int]]


def find_body(arrays: Sequence[Array]) -> ArrayBody | None:
    """The body whose pose the arrays hold; None if they hold no pose."""
    indices = {
        array.name: index
        for index, array in reversed([*enumerate(arrays)])
        if not array.kept and array.head.code.startswith("f")
    }
    whole = _first_of(WHOLE, indices)
    poses = [whole] if whole is not None else _pose_parts(arrays, indices)
    model = _model(sum(arrays[k].numbers.shape[1] for k in poses)) if poses else None
    if model is None:
        return None
    n_frames = arrays[poses[0]].n_rows
    if any(arrays[k].n_rows != n_frames for k in poses):
        return None
    places = [indices[name] for name in ROOT_POSITIONS if name in indices]
    root = [k for k in places if arrays[k].numbers.shape == (n_frames, POSITION)][:1]
    columns: dict[int, Sequence[int]] = {}
    at = 0
    for index in (*root, *poses):
        columns[index] = range(at, at + arrays[index].numbers.shape[1])
        at += len(columns[index])
    if whole is not None:
        columns |= dict(_repeated_parts(arrays, indices, whole, POSITION * len(root)))
    skeleton = skeleton_of(model, moves=bool(root))
    return ArrayBody(skeleton, n_frames, [arrays[k].numbers for k in (*root, *poses)], columns)


def _pose_parts(arrays: Sequence[Array], indices: Mapping[str, int]) -> list[int]:
    """The arrays that together are the joints of a model, in order; [] if there are none."""
    root, body = _first_of(ROOT, indices), _first_of(BODY, indices)
    if root is None or body is None or arrays[root].numbers.shape[1] != 3:
        return []
    if arrays[body].numbers.shape[1] not in BODY_SIZES:
        return []
    joined = [root, body]
    if BODY_SIZES[arrays[body].numbers.shape[1]] == "smpl":
        return joined
    for group, size in ((FACE, FACE_SIZE), (HANDS, HANDS_SIZE)):
        parts = [k for names in group if (k := _first_of(names, indices)) is not None]
        if sum(arrays[k].numbers.shape[1] for k in parts) == size:
            joined += parts
    return joined


def _first_of(names: Sequence[str], indices: Mapping[str, int]) -> int | None:
    """Index of the first array with one of ``names``, None if there is none."""
    return next((indices[name] for name in names if name in indices), None)


def _model(n_numbers: int) -> BodyTree | None:
    """The model, perhaps only its first joints, with rotation vectors of ``n_numbers`` numbers."""
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
    arrays: Sequence[Array], indices: Mapping[str, int], whole: int, first: int
) -> Iterator[tuple[int, Sequence[int]]]:
    """Arrays that repeat columns of ``whole``, whose channels begin with ``first``."""
    words = arrays[whole].numbers
    has_face = words.shape[1] == WITH_FACE
    hands = 66 + FACE_SIZE if has_face else 66
    starts = PARTS | dict.fromkeys(("pose_hand", "left_hand_pose"), hands)
    starts["right_hand_pose"] = hands + HANDS_SIZE // 2
    if has_face:
        starts |= FACES
    for name, at in starts.items():
        index = indices.get(name)
        if index is None:
            continue
        part = arrays[index].numbers
        stop = at + part.shape[1]
        if stop <= words.shape[1] and _is_equal(words[:, at:stop], part):
            yield index, range(first + at, first + stop)


def _is_equal(one: Items, other: Items) -> bool:
    """Return True if two arrays have the same type and bits."""
    if one.dtype != other.dtype or one.shape != other.shape:
        return False
    kind = f"u{one.dtype.itemsize}"
    words = [np.ascontiguousarray(each).view(kind) for each in (one, other)]
    return np.array_equal(words[0], words[1])
