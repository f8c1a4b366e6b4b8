"""Facts in small arrays of a file: the frame rate, and single words and numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from mcz.sources.arrays.files import Array
from mcz.sources.tables.times import UNITS, rate_of_times

TIMES = ("time", "times", "timestamp", "timestamps")
RATES = ("mocap_framerate", "mocap_frame_rate", "framerate", "frame_rate", "fps")
JOINT_NAMES = ("joint_names", "dof_names")
BODY_NAMES = ("body_names", "link_names")
JOINTS = {  # arrays of robots that have a column for each joint, and their units
    "joint_pos": "rad",
    "dof_pos": "rad",
    "dof": "rad",
    "joint_vel": "rad/s",
    "dof_vel": "rad/s",
}
SHAPE = "betas"  # numbers of a body, of which it is said how many there are
LONGEST = 200  # characters of a word
EVEN = 1e-6  # of a step: times that are off by less are uniform
_KEY = re.compile(r"[a-z0-9]+")


def rate_of(arrays: Sequence[Array], n_frames: int) -> tuple[Fraction | None, bool, list[str]]:
    """The frame rate, whether that is exactly what the file says, and what is odd about it.

    Of times that are there and are not uniform there is none.
    """
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
        own, own_exact = rate_of_times(times, [half], () if rate is None else (rate,))
        if own is None:
            return None, True, ["the times are not uniform"]
        odd = [] if rate in (None, own) else [f"{float(own):g} frames a second by {array.name}"]
        return own, own_exact, odd
    return rate, exact, []


def _number(array: Array) -> tuple[float, np.dtype[np.generic]] | None:
    """The only number of an array and its type, None where it is none of a rate."""
    if array.words is None or array.words.size != 1:
        return None
    value = float(array.words.ravel()[0])
    return (value, array.words.dtype) if 1e-6 <= value <= 1e9 else None


def _round(value: float, dtype: np.dtype[np.generic]) -> tuple[Fraction, bool]:
    """The simplest rate that is this number in its type, and whether it is exactly that."""
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


def names_of(arrays: Sequence[Array], keys: Sequence[str]) -> tuple[str, ...]:
    """The texts of the first array that has one of the names ``keys``, () where there is none."""
    for array in arrays:
        if array.name in keys and array.words is None and len(array.head.shape) == 1:
            code = array.head.code
            size = int(code[1:]) * (4 if code[0] == "U" else 1) if code[:1] in ("U", "S") else 0
            if size and size * array.head.shape[0] <= len(array.text):
                parts = [array.text[k : k + size] for k in range(0, len(array.text), size)]
                texts = [_decoded(part, array) for part in parts[: array.head.shape[0]]]
                return tuple(text for text in texts if text) if all(texts) else ()
    return ()


def _decoded(data: bytes, array: Array) -> str | None:
    """A text of an array of texts, None where it is empty or not printable."""
    encoding = "utf-8"
    if array.head.code[0] == "U":
        encoding = "utf-32-be" if array.head.big_endian else "utf-32-le"
    try:
        text = data.decode(encoding).rstrip("\0")
    except UnicodeDecodeError:
        return None
    return text if text.isprintable() and text else None


def _text(array: Array) -> str | None:
    """A single word or number as text, None of all else."""
    if array.words is not None:
        if array.words.size != 1 or len(array.head.shape) > 1:
            return None
        return str(array.words.ravel()[0].item())
    if array.head.code[:1] not in ("U", "S") or np.prod(array.head.shape, dtype=np.float64) != 1:
        return None
    text = _decoded(array.text[: 4 * LONGEST], array)
    return text if text and len(text) <= LONGEST else None
