"""Axis orders of posewave: rotations stay, and the source's angles come back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mcz.codecs.posewave.choices import choose, choose_orders
from mcz.codecs.posewave.header import joint_codes, order_settings, parse_posewave_header
from mcz.codecs.posewave.orders import SEQUENCES, VECTOR_CODE, Orders, vector_codes
from mcz.codecs.posewave.posewave import CODEC
from mcz.codecs.posewave.segment import decode_segment, encode_segment
from mcz.errors import MotionError
from mcz.files.writing.signal_source import MemorySource
from mcz.kinematics.angles import FULL_TURN, unwrap
from mcz.kinematics.points import positions_of
from mcz.model.motion import ROTATION_KINDS, Channel, Joint, Motion, Signal, Skeleton

Floats = np.ndarray
UNITS = st.sampled_from(["deg", "rad"])
SEQUENCE = st.sampled_from(SEQUENCES)
CODES = st.integers(1, VECTOR_CODE)
PARAMETERS = {"step": 0.2, "levels": 3, "weights": None}


def single(own: tuple[int, ...], unit: str, intrinsic: bool = True) -> Skeleton:
    """A joint with two ends that turns about the axes of ``own``, from the left, and moves."""
    turning = [Channel(ROTATION_KINDS[axis]) for axis in (own if intrinsic else own[::-1])]
    channels = (turning[0], Channel("ty"), *turning[1:])
    ends = ((1.0, 2.0, 3.0), (-2.0, 1.0, 0.5))
    return Skeleton(
        (Joint("hip", -1, (0.0, 0.0, 0.0), ends, channels=channels),),
        unit_cm=10.0,
        angle_unit=unit,
        intrinsic=intrinsic,
    )


def rotations(skeleton: Skeleton, values: Floats, sequence: tuple[int, ...]) -> Floats:
    """The matrices of the joint's angles, taken in an order of axes."""
    columns = Orders([1], skeleton).places[0].columns
    letters = "".join("XYZ"[axis] for axis in sequence)
    degrees = skeleton.angle_unit == "deg"
    turns = Rotation.from_euler(letters, values[:, columns][:, sequence], degrees)
    return np.asarray(turns.as_matrix())


def random_angles(unit: str, n_frames: int, seed: int, speed: float = 0.05) -> Floats:
    """Angles of four channels that go on and on, now and then by whole turns and half ones."""
    random = np.random.default_rng(seed)
    steps = random.normal(0, speed, (n_frames, 4))
    steps = np.cumsum(steps, axis=0) * 0.3 + random.uniform(-1, 1, 4)
    jumps = random.random((n_frames, 4)) < 0.02
    steps += np.cumsum(jumps * random.choice([-0.5, 0.5, 0.25], (n_frames, 4)), axis=0)
    return steps * FULL_TURN[unit]


@given(SEQUENCE, CODES, UNITS, st.integers(0, 10**6), st.integers(1, 300))
def test_angles_come_back(
    own: tuple[int, ...], code: int, unit: str, seed: int, n_frames: int
) -> None:
    """Turns and solutions of the source, too, but for those that gimbal lock leaves open."""
    skeleton, orders = single(own, unit), Orders({0: code}, single(own, unit))
    source = unwrap(random_angles(unit, n_frames, seed), skeleton)
    place = orders.places[0]
    middle = source[:, place.columns[own[1]]] / FULL_TURN[unit]
    clear = np.abs(middle * 2 - np.floor(middle * 2) - 0.5) > 1e-6
    _, decoded = orders.notes_and_values(source, orders.to_coded_order(source))
    off = np.abs(decoded - source)[clear].max(initial=0.0) / FULL_TURN[unit]
    assert off < 1e-8


def source_of(skeleton: Skeleton, values: Floats) -> MemorySource:
    """A motion as an encoder sees it."""
    return MemorySource(Motion(skeleton, (Signal(values),)), 0, CODEC, 2**26)


def turning_person(unit: str = "deg", n_frames: int = 3000) -> tuple[Skeleton, Floats]:
    """Someone who turns about y, which is the middle one of the source's axes."""
    steps = np.linspace(0, 20, n_frames)
    true = np.stack([0.2 * np.sin(3 * steps), 2 * np.sin(steps), 0.1 * np.cos(2 * steps)], axis=1)
    source = np.insert(Rotation.from_euler("YXZ", true[:, [1, 0, 2]]).as_euler("ZYX"), 1, steps, 1)
    factor = FULL_TURN[unit] / (2 * np.pi)
    skeleton = single((2, 1, 0), unit)
    return skeleton, unwrap(source * [factor, 1, factor, factor], skeleton)


@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_the_calm_order_is_found(unit: str) -> None:
    skeleton, values = turning_person(unit)
    assert SEQUENCES[choose_orders("posewave", source_of(skeleton, values))[0] - 1][0] == 1
    assert choose_orders("posewave", source_of(skeleton, values * [1, 1, 0, 1])) == {}
    assert choose_orders("posewave", source_of(skeleton, values[:0])) == {}
    assert choose_orders("posewave", source_of(skeleton, values * [1, 1, 1e200, 1])) == {}
    assert choose_orders("posewave", source_of(replace(skeleton, angle_unit=""), values)) == {}


def test_codec() -> None:
    skeleton, values = turning_person()
    source = source_of(skeleton, values)
    choice = choose(source, PARAMETERS)
    header = parse_posewave_header(choice.header, source.layout)
    assert header.orders
    streams, expected = encode_segment(header, skeleton, values, choice.weights)
    plain = replace(header, orders={})
    longer = encode_segment(plain, skeleton, values, choice.weights)[0]
    assert sum(map(len, streams)) < 0.9 * sum(map(len, longer))
    found = decode_segment(header, skeleton, streams, len(values), "here")
    assert np.array_equal(found, expected)
    error = positions_of(skeleton, found) - positions_of(skeleton, values)
    assert np.abs(error).max() < 0.2
    coarse = decode_segment(header, skeleton, streams[:2], len(values), "here")
    error = positions_of(skeleton, coarse) - positions_of(skeleton, values)
    assert np.abs(error).max() < 1
    wild = values.copy()
    wild[7, 3] = 2.0**40
    with pytest.raises(MotionError, match="an angle is"):
        encode_segment(header, skeleton, wild, choice.weights)


def arm(n_joints: int) -> Skeleton:
    """A chain of joints that turn about z, x and y, each with an end."""
    hip = single((2, 0, 1), "deg").joints[0]
    joints = [replace(hip, name=f"joint {j}", parent=j - 1) for j in range(n_joints)]
    return replace(single((2, 0, 1), "deg"), joints=tuple(joints))


def test_vectors_are_chosen() -> None:
    """Joints, but no root, that swing about a line which turns."""
    skeleton, t = arm(3), np.linspace(0, 20, 400)
    swings = 1.2 * np.stack([np.cos(t), np.sin(t), np.sin(1.7 * t)], axis=1)
    angles = Rotation.from_rotvec(swings).as_euler("ZXY", degrees=True)
    values = unwrap(np.tile(np.insert(angles, 1, t, axis=1), (1, 3)), skeleton)
    codes = choose_orders("posewave", source_of(skeleton, values))
    assert {joint: codes.get(joint) for joint in (1, 2)} == vector_codes(skeleton)
    assert codes.get(0) != VECTOR_CODE
    source = source_of(skeleton, values)
    choice = choose(source, PARAMETERS)
    header = parse_posewave_header(choice.header, source.layout)
    assert header.orders == codes
    streams, expected = encode_segment(header, skeleton, values, choice.weights)
    found = decode_segment(header, skeleton, streams, len(values), "here")
    assert np.array_equal(found, expected)
    assert np.abs(positions_of(skeleton, found) - positions_of(skeleton, values)).max() < 0.5


@given(st.dictionaries(st.integers(0, 4), CODES))
def test_codes_of_a_header(codes: dict[int, int]) -> None:
    """The flag of vectors and the fewest records say what every joint has."""
    skeleton = arm(5)
    flag, records = order_settings(codes, skeleton)
    assert joint_codes(flag, records, skeleton) == codes
    assert len(records) <= len(codes)
