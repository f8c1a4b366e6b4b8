"""MVNX files, to order: the XML of Xsens MVN with numbers of our own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from xml.sax.saxutils import quoteattr

import numpy as np

SIZES = {  # numbers of a part: of a segment, a sensor, a joint, a contact, or of the body
    "orientation": ("segments", 4),
    "position": ("segments", 3),
    "velocity": ("segments", 3),
    "acceleration": ("segments", 3),
    "angularVelocity": ("segments", 3),
    "footContacts": ("contacts", 1),
    "sensorFreeAcceleration": ("sensors", 3),
    "sensorOrientation": ("sensors", 4),
    "jointAngle": ("joints", 3),
    "jointAngleXZY": ("joints", 3),
    "centerOfMass": ("body", 3),
}
DATE = "Tue Nov 3 05:17:11.827 2026"
CALIBRATION = ("identity", "tpose", "tpose-isb")


@dataclass(frozen=True)
class MvnxFile:
    """An MVNX file of ``version``; ``text`` has its bytes.

    ``elements`` are those of a frame in order, ``attributes`` those of its tag. ``left_out``:
    elements that single frames lack. ``ending`` is what follows the last frame.
    """

    segments: Sequence[str] = ("Pelvis", "L5", "RightUpperLeg")
    n_frames: int = 5
    rate: int = 60
    elements: Sequence[str] = tuple(SIZES)
    attributes: Sequence[str] = ("time", "index", "tc", "ms")
    calibration: Sequence[str] = CALIBRATION
    left_out: Sequence[tuple[int, str]] = ()
    first: int = 0
    decimals: int = 6
    version: int = 4
    quote: str = '"'
    line: str = "\n"
    indent: str = "\t"
    ending: str = "</frames></subject><securityCode code='0'/></mvnx>"
    prolog: str = '<?xml version="1.0" encoding="UTF-8"?>'

    def text(self) -> bytes:
        """The bytes of the file."""
        frames = [self._frame(row, kind) for row, kind in enumerate(self.calibration)]
        frames += [self._frame(row, "normal") for row in range(self.n_frames)]
        parts = [self.prolog, *self._head(), *frames, self.ending]
        return self.line.join(parts).encode() + self.line.encode()

    def _head(self) -> list[str]:
        tab = self.indent
        points = "pos_b" if self.version == 4 else "pos_s"
        lines = [
            "<!-- <!DOCTYPE mvnx> in a comment is none -->",
            f'<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="{self.version}">',
            f'{tab}<mvn version="2026.0.0" build="made"/>',
            f"{tab}<comment>a walk &amp; a turn</comment>",
            f'{tab}<subject label="S &lt;1&gt;" frameRate="{self.rate}" recDate="{DATE}">',
            f"{tab}<segments>",
        ]
        for number, name in enumerate(self.segments):
            lines.append(f'{tab * 2}<segment label={quoteattr(name)} id="{number + 1}"><points>')
            for k in range(2):
                place = f"0.0 0.0 {k * 0.25 * (number + 1):.6f}"
                lines.append(f'<point label="j{number + k}"><{points}>{place}</{points}></point>')
            lines.append("</points></segment>")
        lines += [f"{tab}</segments>", f"{tab}<sensors>"]
        lines += [f"{tab * 2}<sensor label={quoteattr(name)}/>" for name in self._sensors]
        lines += [f"{tab}</sensors>", f"{tab}<joints>"]
        for number, (near, far) in enumerate(pairwise(map(quoteattr, self.segments))):
            label, names = f"j{number + 1}", (near[1:-1], far[1:-1])
            ends = [f"<connector{k + 1}>{names[k]}/{label}</connector{k + 1}>" for k in range(2)]
            lines.append(f'{tab * 2}<joint label="{label}">{"".join(ends)}</joint>')
        lines += [f"{tab}</joints>", f"{tab}<footContactDefinition>"]
        lines += [f'<contactDefinition label="{name}"/>' for name in ("Heel", "Toe")]
        return [*lines, f"{tab}</footContactDefinition>", f"{tab}<frames>"]

    @property
    def _sensors(self) -> Sequence[str]:
        return self.segments[:1]

    def _frame(self, row: int, kind: str) -> str:
        tab, number = self.indent, self.first + row
        stamp = round(number * 1000 / self.rate)
        seconds, part = divmod(number, self.rate)
        values = {
            "time": f"{stamp}",
            "index": f"{number}",
            "tc": f"11:59:{50 + seconds % 10:02d}:{part:02d}",
            "ms": f"{1512140373478 + stamp}",
        }
        if kind != "normal":
            values |= {"time": "0", "index": "", "tc": "", "ms": "0"}
        pairs = [(name, values[name]) for name in self.attributes] + [("type", kind)]
        tag = " ".join(f"{name}={self.quote}{value}{self.quote}" for name, value in pairs)
        names = self.elements if kind == "normal" else self.elements[:2]
        lines = [f"{tab * 2}<frame {tag}>"]
        for name in names:
            if kind == "normal" and (row, name) in self.left_out:
                continue
            numbers = " ".join(self._numbers(name, number))
            lines.append(f"{tab * 3}<{name}>{numbers}</{name}>")
        return self.line.join([*lines, f"{tab * 2}</frame>"])

    def _numbers(self, name: str, number: int) -> list[str]:
        parts, size = SIZES[name]
        n = len(self.segments)
        counts = {"segments": n, "sensors": len(self._sensors), "joints": n - 1, "contacts": 2}
        count = counts.get(parts, 1) * size
        if name == "footContacts":
            return [str((number + k) % 2) for k in range(count)]
        phase = np.arange(count) * 0.7 + number * 0.05 + len(name)
        values = np.round(np.sin(phase), 9) * (30 if name.startswith("joint") else 1)
        if size == 4:  # about z
            half = np.round(number * 0.01 + np.arange(count // 4), 9)
            values = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1).ravel()
        return [f"{value:.{self.decimals}f}" for value in values.tolist()]
