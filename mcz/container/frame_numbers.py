"""Frame numbers <-> the metadata key ``frame-numbers``. SPEC.md, "Registry", is normative."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError, MotionError

KEY = "frame-numbers"  # of the registry
_INTEGER = r"(?:0|-?[1-9][0-9]{0,15})"
_TEXT = re.compile(rf"{_INTEGER}(?: [1-9][0-9]{{0,15}}:{_INTEGER})*", re.ASCII)


def frame_number_metadata(frame_numbers: NDArray[np.int64] | None) -> dict[str, str]:
    """Registry key ``frame-numbers``: the first number, then row:number after every gap."""
    if frame_numbers is None or len(frame_numbers) == 0:
        return {}
    jumps = np.nonzero(np.diff(frame_numbers) != 1)[0] + 1
    words = [str(frame_numbers[0]), *(f"{row}:{frame_numbers[row]}" for row in jumps)]
    text = " ".join(words)
    if not _TEXT.fullmatch(text):
        raise MotionError("a frame number has more than 16 digits")
    return {} if words == ["1"] else {KEY: text}


def parse_frame_numbers(text: str, n_frames: int, name: str) -> NDArray[np.int64]:
    """The numbers that the registry key ``frame-numbers`` spells."""
    frame_numbers = np.arange(n_frames, dtype=np.int64)
    try:
        if not _TEXT.fullmatch(text):  # REG-01
            raise ValueError("not first row:number row:number ...")
        first, *jumps = text.split(" ")
        starts = [(0, int(first)), *(_jump(jump) for jump in jumps)]
        rows = [row for row, _ in starts]
        if rows != sorted(set(rows)) or rows[-1] >= max(1, n_frames):
            raise ValueError("its rows do not ascend within the clip")
        for (row, number), end in zip(starts, [*rows[1:], n_frames], strict=True):
            frame_numbers[row:end] += number - row
    except (ValueError, OverflowError) as error:
        raise FormatError(f"frame-numbers {text[:80]!r}: {error}", clip=name) from None
    return frame_numbers


def _jump(text: str) -> tuple[int, int]:
    row, number = text.split(":")
    return int(row), int(number)
