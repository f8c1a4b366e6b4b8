"""C3D files to order: of counted words, in any byte order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.model.motion import Motion
from mcz.sources.c3d import c3d
from tests.formats.c3d_files import DEC, INTEL, SGI, Made, real
from tools.vectors.build.source_files import set_path

ORDERS = {"intel": INTEL, "dec": DEC, "sgi": SGI}


def words(shape: tuple[int, ...], processor: int, size: int, seed: int = 0) -> NDArray[np.uint32]:
    """Counted numbers: words of integers, or floats with a fraction."""
    counted = [(seed + k * k * 7) % 997 for k in range(int(np.prod(shape)))]
    if size == 2:
        return np.array(counted, np.uint32).reshape(shape)
    kind = ">u4" if processor == SGI else "<u4"
    data = b"".join(real(n / 4 + 0.125, processor) for n in counted)
    return np.frombuffer(data, kind).astype(np.uint32).reshape(shape)


def c3d_file(
    n_frames: int = 4,
    n_points: int = 2,
    channels: int = 2,
    subframes: int = 2,
    processor: int = INTEL,
    size: int = 4,
    **more: Any,
) -> Made:
    """A file of counted words, all points valid."""
    points = words((n_frames, n_points, 4), processor, size)
    analog = words((n_frames, subframes, channels), processor, size, 5)
    return Made(points, analog, processor=processor, size=size, **more)


def lists(file: Made, **listed: list[str]) -> dict[str, Any]:
    """Parameters of POINT that list labels, such as ANGLES, and name units, such as ANGLE_UNITS."""
    return {name: file.texts([text.encode() for text in texts]) for name, texts in listed.items()}


def c3d_outputs(n_points: int = 5, **more: Any) -> Made:
    """Points p0, p1, ..., of which p1 and p3 are an angle and a moment."""
    file = c3d_file(n_points=n_points, **more)
    said = lists(file, ANGLES=["p1"], ANGLE_UNITS=["deg"], MOMENTS=["p3"], MOMENT_UNITS=["Nmm"])
    file.parameters = {"POINT": said}
    return file


def take_c3d(source: bytes, name: str) -> Motion:
    """The motion in a C3D file, its source called after it; it must come back."""
    motion = set_path(c3d.read(source, name), f"{name}.c3d")
    assert c3d.write(motion) == source, name
    return motion
