"""Files whose bytes were written by hand as hex, from SPEC.md, and what they hold.

``by_hand/*.hex`` have bytes in hexadecimal, and comments behind ``#``. No encoder has a part in
them: where one of their structures is read otherwise, the reader is wrong, or SPEC.md has changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mcz.model.motion import Channel, Motion, Signal, Skeleton

FOLDER = Path(__file__).parent.parent / "by_hand"
ASF = b"""\
:version 1.10
:name small
:units
  length 0.45
  angle deg
:root
  order TX RX
  axis XYZ
  position 0 0 0
  orientation 0 0 90
:bonedata
:hierarchy
  begin
  end
"""
AMC = b":DEGREES\n1\nroot 1 2\ntoe 3\n002\nroot 4 5\ntoe 6"
TRC = (
    b"PathFileType\t4\t(X/Y/Z)\ta\nDataRate\tUnits\n50\tmm\nFrame#\tTime\tA\t\t\tB\n\n"
    b"8\t0.14\t1.5\t2.5\t3.5\t\t\t\n"
    b"9\t0.16\t1.6\t2.5\t3.4\t7.0\t8.0\t9.0\n"
)
C3D = bytes.fromhex("6865616401000200 0400FAFF0000 0A0014001E000100 54740000")
NPY = b"N2,  " + bytes.fromhex(
    "3F800000 C0000000 3F000000 40800000 41000000 BE800000 6F776E B06BE8BA 24000000 4B04822400"
)
NOTES = b"notes of the day\n"


def bytes_of(name: str) -> bytes:
    """The bytes of a file that is written in hexadecimal."""
    lines = (FOLDER / f"{name}.hex").read_text("utf-8").splitlines()
    return bytes.fromhex("".join(line.partition("#")[0] for line in lines))


def structures_of(name: str) -> list[str]:
    """The structures of SPEC.md that a file shows, as its comment lists them."""
    text = (FOLDER / f"{name}.hex").read_text("utf-8")
    return text.partition("# structures:")[2].partition("\n89 ")[0].replace("#", " ").split()


def clip(name: str, *signals: Signal) -> Motion:
    return Motion(Skeleton(()), signals, name=name)


def signal(name: str, rows: Sequence[Sequence[float]], **more: Sequence[Sequence[int]]) -> Signal:
    """Values, and perhaps their ``mask``, of channels without a name."""
    values = np.array(rows)
    channels = tuple(Channel("") for _ in range(values.shape[1]))
    mask = np.array(more["mask"], np.bool_) if more else None
    return Signal(values, name=name, mask=mask, channels=channels)


HELD: dict[str, tuple[tuple[Motion, ...], tuple[tuple[str, bytes], ...]]] = {
    "container": (
        (
            clip(
                "walk",
                signal(
                    "motion",
                    [[1.5, 1.0, 0.5], [np.nan, 1.01, 1.0], [-2.1, 1.02, 1.5]],
                    mask=[[1, 1, 1], [1, 1, 0], [1, 1, 1]],
                ),
                signal("doubt", [[-1], [4], [5]]),
                Signal(
                    np.array([[0.0], [0.25], [0.5], [3.0], [2.75], [2.5]]),
                    name="force",
                    samples_per_frame=2,
                    channels=(Channel(""),),
                ),
            ),
        ),
        (("notes.txt", NOTES), ("small.asf", ASF), ("again.txt", NOTES)),
    ),
    "stream": (
        (
            clip("live", signal("m", [[-0.4], [0.7], [-0.8]])),
            clip("next", signal("m", [[0.1], [0.2]])),
        ),
        (),
    ),
    "headers": (
        tuple(
            clip(name, signal("m", np.zeros((0, 3))))
            for name in (
                *("wavelet", "qbc", "pca", "lsdt-frame", "lsdt-clip", "online", "posewave"),
            )
        ),
        (),
    ),
    "sources": (
        (
            clip("amc", signal("motion", [[1.0, 2, 3], [4, 5, 6]])),
            clip(
                "trc",
                signal(
                    "motion",
                    [[1.5, 2.5, 3.5, 0, 0, 0], [1.6, 2.5, 3.4, 7, 8, 9]],
                    mask=[[1, 1, 1, 0, 0, 0], [1] * 6],
                ),
            ),
            clip(
                "c3d",
                signal("motion", [[1.0, 2, -3]]),
                signal("sure", [[0, 1]]),
                signal("force", [[5.0, 10, 15]]),
            ),
            clip("npy", signal("motion", [[1.0, -2, 0.5], [4, 8, -0.25]])),
        ),
        (("two.amc", AMC), ("ab.trc", TRC), ("p.c3d", C3D), ("p.npy", NPY)),
    ),
    "recovery": ((clip("a", signal("m", [[0.1], [0.2]])),), ()),
}
