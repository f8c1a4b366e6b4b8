"""Small files of every format that states times, of frames with these numbers."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np


def trc(
    numbers: Sequence[int],
    rate: object = "100.00",
    places: int = 3,
    hz: float = 100,
    times: Sequence[float] | None = None,
) -> bytes:
    times = [(n - 1) / hz for n in numbers] if times is None else times
    pairs = zip(numbers, times, strict=True)
    rows = "".join(f"{n}\t{time:.{places}f}\t{n}.5\t7\t14\n" for n, time in pairs)
    return (
        "PathFileType\t4\t(X/Y/Z)\tin.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
        f"{rate}\t{rate}\t{len(numbers)}\t1\tmm\nFrame#\tTime\tRASI\n\t\tX1\tY1\tZ1\n\n{rows}"
    ).encode()


def sto(numbers: Sequence[int], header: str = "", places: int = 3, hz: float = 100) -> bytes:
    rows = "".join(f"{(n - 1) / hz:.{places}f}\t{n}.5\n" for n in numbers)
    return f"a\n{header}nRows={len(numbers)}\nendheader\ntime\tknee\n{rows}".encode()


def motive(numbers: Sequence[int], stated: str = "100.000000", hz: float = 100) -> bytes:
    rows = "".join(f"{n},{n / hz:.6g},{n}.5,1,2\n" for n in numbers)
    return (
        "Format Version,1.23,Take Name,a,Capture Frame Rate,"
        f"{stated},Export Frame Rate,{stated},Length Units,Meters\n\n"
        ",Type,Marker,Marker,Marker\n,Name,m,m,m\n,ID,1,1,1\n,,Position,Position,Position\n"
        f"Frame,Time (Seconds),X,Y,Z\n{rows}"
    ).encode()


def csv(numbers: Sequence[int], hz: float = 100) -> bytes:
    return ("time,a\n" + "".join(f"{n / hz:.3f},{n}.5\n" for n in numbers)).encode()


def vicon(numbers: Sequence[int]) -> bytes:
    rows = "".join(f"{n},0,{n}.5,1,2\n" for n in numbers)
    head = "Trajectories\n100\n,,s:A,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n"
    return (head + rows).encode()


def npz(numbers: Sequence[int], hz: float = 100) -> bytes:
    buffer = io.BytesIO()
    times = np.array(numbers) / hz
    np.savez(buffer, joints=np.arange(6.0 * len(numbers)).reshape(-1, 2, 3), times=times)
    return buffer.getvalue()


def bvh(*rows: str, time: str = "0.01") -> str:
    """One joint that turns about x."""
    head = "HIERARCHY\nROOT hips\n{\n  OFFSET 0 0 0\n  CHANNELS 1 Xrotation\n}\nMOTION\n"
    return f"{head}Frames: {len(rows)}\nFrame Time: {time}\n" + "".join(f"{row}\n" for row in rows)
