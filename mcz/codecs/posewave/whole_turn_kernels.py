"""Compiled: joints that turn by a rotation vector or a quaternion, in the pose metric.

SPEC.md, "Pose metric", is normative. Arrays end in an axis of lanes, as those of
``pose_kernels``, one a frame; ``parts`` (n, width) are the numbers of a turn.
"""

from __future__ import annotations

from mcz.codecs.posewave.skeleton_plan import Plan
from mcz.kernels.types import Floats2, Floats3

LONGEST = 256.0  # the square of a vector's length in radians from which on it counts as 0
LEAST = 2.0**-100  # the square of a quaternion's length below which it turns nothing
HALVINGS = (0, 1, 2, 3)
# Of the Taylor series, the last factor first: 1 / (k (k + 1)).
FIRST = tuple(1.0 / (k * (k + 1.0)) for k in (16.0, 14.0, 12.0, 10.0, 8.0, 6.0, 4.0, 2.0))
SECOND = tuple(1.0 / (k * (k + 1.0)) for k in (17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0))
THIRD = tuple(1.0 / (k * (k + 1.0)) for k in (18.0, 16.0, 14.0, 12.0, 10.0, 8.0, 6.0, 4.0))
SIXTH = 0.16666666666666666


def exponential(square: float) -> tuple[float, float, float]:
    """sin t / t, (1 - cos t) / t^2 and (t - sin t) / t^3 of t^2, which is below 256.

    Those of a sixteenth of t by their series, then doubled four times.
    """
    q = square * 0.00390625
    a = b = c = 1.0
    for factor in FIRST:
        a = 1.0 - q * a * factor
    for factor in SECOND:
        b = 1.0 - q * b * factor
    for factor in THIRD:
        c = 1.0 - q * c * factor
    b = b * 0.5
    c = c * SIXTH
    for _ in HALVINGS:
        c = (c + a * b) * 0.25
        cosine = 1.0 - q * b
        b = a * a * 0.5
        a = a * cosine
        q = q * 4.0
    return a, b, c


def turn_by_vector(
    plan: Plan,
    turn: int,
    parts: Floats2,
    own: Floats2,
    origin: Floats2,
    motions: Floats3,
    lanes: int,
) -> None:
    """Turn ``own``, a joint's axes, by the rotation vector whose parts are from ``turn`` on."""
    radians = plan.rule.radians
    for p in range(lanes):
        x, y, z = (
            parts[turn, p] * radians,
            parts[turn + 1, p] * radians,
            parts[turn + 2, p] * radians,
        )
        square = x * x + y * y + z * z
        short = square < LONGEST
        x, y, z = x if short else 0.0, y if short else 0.0, z if short else 0.0
        a, b, c = exponential(square if short else 0.0)
        xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
        u, v, w = (a + c * xx) * radians, (c * xy + b * z) * radians, (c * xz - b * y) * radians
        _note(own, u, v, w, origin, motions, plan.turns[turn, 2], p)
        u, v, w = (c * xy - b * z) * radians, (a + c * yy) * radians, (c * yz + b * x) * radians
        _note(own, u, v, w, origin, motions, plan.turns[turn + 1, 2], p)
        u, v, w = (c * xz + b * y) * radians, (c * yz - b * x) * radians, (a + c * zz) * radians
        _note(own, u, v, w, origin, motions, plan.turns[turn + 2, 2], p)
        for i in (0, 3, 6):
            d, e, f = own[i, p], own[i + 1, p], own[i + 2, p]
            own[i, p] = (1.0 - b * (yy + zz)) * d + (b * xy + a * z) * e + (b * xz - a * y) * f
            own[i + 1, p] = (b * xy - a * z) * d + (1.0 - b * (xx + zz)) * e + (b * yz + a * x) * f
            own[i + 2, p] = (b * xz + a * y) * d + (b * yz - a * x) * e + (1.0 - b * (xx + yy)) * f


def turn_by_quaternion(
    plan: Plan,
    turn: int,
    parts: Floats2,
    own: Floats2,
    origin: Floats2,
    motions: Floats3,
    lanes: int,
) -> None:
    """Turn ``own``, a joint's axes, by the quaternion whose parts are from ``turn`` on."""
    for p in range(lanes):
        w, x, y, z = parts[turn, p], parts[turn + 1, p], parts[turn + 2, p], parts[turn + 3, p]
        square = w * w + x * x + y * y + z * z
        whole = square >= LEAST
        two = 2.0 / square if whole else 2.0  # POSE-01
        w = w if whole else 1.0
        x, y, z = x if whole else 0.0, y if whole else 0.0, z if whole else 0.0
        a, i, j, k = w * two, x * two, y * two, z * two
        _note(own, -i, -j, -k, origin, motions, plan.turns[turn, 2], p)
        _note(own, a, k, -j, origin, motions, plan.turns[turn + 1, 2], p)
        _note(own, -k, a, i, origin, motions, plan.turns[turn + 2, 2], p)
        _note(own, j, -i, a, origin, motions, plan.turns[turn + 3, 2], p)
        xx, yy, zz, xy, xz, yz = i * x, j * y, k * z, i * y, i * z, j * z
        for row in (0, 3, 6):
            d, e, f = own[row, p], own[row + 1, p], own[row + 2, p]
            own[row, p] = (1.0 - (yy + zz)) * d + (xy + k * w) * e + (xz - j * w) * f
            own[row + 1, p] = (xy - k * w) * d + (1.0 - (xx + zz)) * e + (yz + i * w) * f
            own[row + 2, p] = (xz + j * w) * d + (yz - i * w) * e + (1.0 - (xx + yy)) * f


def _note(
    own: Floats2,
    u: float,
    v: float,
    w: float,
    origin: Floats2,
    motions: Floats3,
    number: int,
    p: int,
) -> None:
    """Write the effect of one unit of a part: a turn by u, v, w, and the root's motion."""
    if number >= 0:
        x = own[0, p] * u + own[1, p] * v + own[2, p] * w
        y = own[3, p] * u + own[4, p] * v + own[5, p] * w
        z = own[6, p] * u + own[7, p] * v + own[8, p] * w
        motions[number, 0, p] = x
        motions[number, 1, p] = y
        motions[number, 2, p] = z
        motions[number, 3, p] = origin[1, p] * z - origin[2, p] * y
        motions[number, 4, p] = origin[2, p] * x - origin[0, p] * z
        motions[number, 5, p] = origin[0, p] * y - origin[1, p] * x
