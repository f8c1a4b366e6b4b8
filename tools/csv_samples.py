"""CSV files as Motive and Vicon Nexus write them, of real clips.

``python -m tools.csv_samples OUT FILES``: a C3D file of markers becomes a Motive file and one of
Vicon, with its analog channels as devices; a BVH or AMC file one of a skeleton as Motive exports
it. To measure sizes with, see ``tools/source_sizes.py``: programs that write such files are not at
hand.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import mcz
from mcz.model.motion import Motion

Floats = NDArray[np.float64]
MOST_FRAMES = 2000


def motive(motion: Motion) -> bytes:
    """Bones with quaternions and positions, or markers, in meters; CRLF, six decimals."""
    unit = (motion.skeleton.unit_cm or 1.0) / 100
    names = list(motion.skeleton.joint_names)
    is_markers = {c.kind for c in motion.skeleton.channels} <= {"tx", "ty", "tz"}
    points = mcz.positions(motion, range(len(names)))
    n_frames, rate = min(motion.n_frames, MOST_FRAMES), float(motion.frame_rate or 120)
    columns: list[Floats] = []
    heads: list[list[str]] = [[], [], [], [], []]
    turned = None if is_markers else mcz.rotations(motion, space="world")
    for j, name in enumerate(names):
        parts = [("Position", axis, points[:, j, k] * unit) for k, axis in enumerate("XYZ")]
        if turned is not None:
            order = ("W", "X", "Y", "Z")
            parts = [
                *(("Rotation", order[k], turned[:, j, k]) for k in (1, 2, 3, 0)),
                *parts,
            ]
        for what, axis, values in parts:
            kind = "Marker" if is_markers else "Bone"
            texts = (kind, f"Subject:{name}", f'"{j + 1:X}A{j * 7919 % 65536:04X}"', what, axis)
            for row, text in zip(heads, texts, strict=True):
                row.append(text)
            columns.append(values[:n_frames])
    first = (
        f"Format Version,1.21,Take Name,{motion.name},Capture Frame Rate,{rate:.6f},"
        f"Export Frame Rate,{rate:.6f},Capture Start Time,2016-01-05 03.49.50.755 PM,Total Frames"
        f" in Take,{n_frames},Total Exported Frames,{n_frames},Rotation Type,Quaternion,"
        "Length Units,Meters,Coordinate Space,Global"
    )
    lines = [first, "", *(",,".rstrip(",") + ",," + ",".join(row) for row in heads[:4])]
    lines.append("Frame,Time," + ",".join(heads[4]))
    table = np.column_stack(columns)
    lines += [
        f"{k},{k / rate:.6f}," + ",".join("" if x != x else f"{x:.6f}" for x in row)
        for k, row in enumerate(table.tolist())
    ]
    return ("\r\n".join(lines) + "\r\n").encode()


def vicon(motion: Motion) -> bytes:
    """Devices, where there are analog channels, and trajectories; six significant digits."""
    lines: list[str] = []
    rate, n_frames = float(motion.frame_rate or 120), min(motion.n_frames, MOST_FRAMES)
    numbers = motion.frame_numbers
    first = int(numbers[0]) if numbers is not None and len(numbers) else 1
    for signal in motion.signals[1:]:
        if signal.name == "analog" and signal.n_channels and signal.channels:
            n_each = signal.samples_per_frame
            names = [channel.label for channel in signal.channels]
            lines += ["Devices", f"{rate * n_each:g}"]
            lines.append(",," + ",".join(f"Imported Analog - {name}" for name in names))
            lines.append("Frame,Sub Frame," + ",".join(names))
            lines.append(",," + ",".join(channel.unit or "V" for channel in signal.channels))
            for k, row in enumerate(signal.values[: n_frames * n_each].tolist()):
                cells = ",".join(f"{x:g}" for x in row)
                lines.append(f"{first + k // n_each},{k % n_each},{cells}")
            lines.append("")
    joints = motion.skeleton.joints
    lines += ["Trajectories", f"{rate:g}"]
    lines.append(",," + ",".join(f"Subject:{joint.name},," for joint in joints))
    lines.append("Frame,Sub Frame," + ",".join("X,Y,Z" for _ in joints))
    lines.append(",," + ",".join("mm,mm,mm" for _ in joints))
    unit = (motion.skeleton.unit_cm or 0.1) * 10
    points = mcz.positions(motion)[:n_frames].reshape(n_frames, -1) * unit
    for k, row in enumerate(points.tolist()):
        lines.append(f"{first + k},0," + ",".join("" if x != x else f"{x:g}" for x in row))
    return ("\n".join(lines) + "\n").encode()


def main(arguments: Sequence[str]) -> None:
    out, *files = arguments
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    for name in files:
        motion = mcz.read(name)
        stem = Path(name).stem
        (folder / f"{stem}.motive.csv").write_bytes(motive(motion))
        if Path(name).suffix.lower() == ".c3d":
            (folder / f"{stem}.vicon.csv").write_bytes(vicon(motion))


if __name__ == "__main__":
    main(sys.argv[1:])
