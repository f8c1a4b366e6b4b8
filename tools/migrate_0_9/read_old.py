"""Everything that a file of format 0.9 holds, verified and decoded: JSON beside files of bytes.

This runs in the Python of package 0.9: ``read_old.py OLD.mcz DIR``.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import mcz

try:
    from mcz.editing.protecting import redundancy_of  # type: ignore[import-not-found]
except ImportError:  # tests have today's package in the place of 0.9
    from mcz.files.editing.appending import redundancy_of


class Folder:
    """Bytes in files with numbers."""

    def __init__(self, path: Path) -> None:
        self.path, self.n_files = path, 0

    def keep(self, data: bytes) -> str:
        self.n_files += 1
        name = f"{self.n_files}.bin"
        (self.path / name).write_bytes(data)
        return name

    def file(self, path: str, data: bytes) -> dict[str, Any]:
        """A file that comes back, with its path and its hash."""
        return {"path": path, "data": self.keep(data), "sha256": hashlib.sha256(data).hexdigest()}


def grid(found: Any) -> list[Any]:
    return [int(found.kind), found.digits, found.flags, found.scale, found.style]


def channels(found: Any) -> list[list[str]]:
    return [[channel.kind, channel.name, channel.unit] for channel in found]


def skeleton(file: Any, id_: bytes, folder: Folder) -> dict[str, Any]:
    found = file.skeleton(id_, with_source=True)
    source = found.source
    names = ("name", "parent", "offset", "tails", "axis", "axis_order", "adds_to_offset")
    return {
        "id": id_.hex(),
        "base": found.base.hex() if found.base else None,
        "facts": {
            name: getattr(found, name)
            for name in ("name", "unit_cm", "angle_unit", "up_axis", "intrinsic")
        },
        "joints": [
            {name: getattr(joint, name) for name in names} | {"channels": channels(joint.channels)}
            for joint in found.joints
        ],
        "file": folder.file(source.path, file.skeleton_bytes(id_)) if source else None,
    }


def signal(found: Any, sha256: bytes, folder: Folder) -> dict[str, Any]:
    """The stored numbers; ``sha256`` is the value hash that verification has confirmed."""
    odd, mask = found.exceptions, found.mask
    return {
        "name": found.name,
        "samples_per_frame": found.samples_per_frame,
        "channels": None if found.channels is None else channels(found.channels),
        "grids": [grid(one) for one in found.grids],
        "grid_changes": [[row, column, grid(new)] for row, column, new in found.grid_changes],
        "exceptions": [
            [int(row), int(column), text.hex()]
            for row, column, text in zip(odd.rows, odd.channels, odd.texts, strict=True)
        ],
        "shape": found.stored.shape,
        "type": found.stored.dtype.str,
        "values": folder.keep(found.stored.tobytes()),
        "mask": None if mask is None else folder.keep(mask.tobytes()),
        "is_times": is_times(found),
        "sha256": sha256.hex(),
    }


def is_times(found: Any) -> bool:
    """True of a column of times as SPEC.md 0.9, "Time", has it, whatever its name."""
    one = len(found.channels or ()) == found.samples_per_frame == 1
    if not one or found.channels[0].kind or found.channels[0].unit not in ("s", "ms", "us", "ns"):
        return False
    values = found.values[:, 0]
    rising = bool((values[1:] >= values[:-1]).all()) and bool(abs(values).max(initial=0) < 1e300)
    return rising and (found.mask is None or bool(found.mask.all()))


def clip(found: Any, folder: Folder) -> dict[str, Any]:
    motion, rate, source = found.motion(), found.frame_rate, found.source
    line = found.timeline
    pairs = zip(motion.signals, found.value_hashes, strict=True)
    return {
        "name": found.name,
        "codec": found.codec,
        "is_lossless": all(one.codec.lossless for one in found.signals),
        "skeleton": found.skeleton_id.hex(),
        "rate": None if rate is None else [rate.numerator, rate.denominator],
        "is_rate_exact": found.frame_rate_exact,
        "metadata": {k: v for k, v in found.metadata.items() if k != "frame-numbers"},
        "numbers_text": found.metadata.get("frame-numbers"),
        "frame_numbers": folder.keep(found.frame_numbers.astype("<i8").tobytes()),
        "times": None if line is None else folder.keep(line.times.astype("<f8").tobytes()),
        "rounding": 0.0 if line is None else line.rounding,
        "quality": found.quality,
        "signals": [signal(one, sha256, folder) for one, sha256 in pairs],
        "file": None if source is None else folder.file(source.path, found.source_bytes()),
    }


def content(file: Any, folder: Folder) -> dict[str, Any]:
    return {
        "package": mcz.__version__,
        "header": file.header,
        "has_copies": bool(file.container.copies()),
        "redundancy": redundancy_of(file.container),
        "metadata": dict(file.metadata),
        "skeletons": [skeleton(file, id_, folder) for id_, _ in file.skeletons],
        "clips": [clip(one, folder) for one in file],
        "attachments": [folder.file(name, held.read()) for name, held in file.attachments.items()],
        "aliases": [[name, *file.alias_of(name)] for name in file.aliases],
    }


def main(old: str, directory: str) -> None:
    problems = mcz.verify(old)
    if problems:
        sys.exit(f"{old}: {problems[0].message}")
    folder = Folder(Path(directory))
    with mcz.open(old, max_decoded=2**53) as file:
        found = content(file, folder)
    (folder.path / "content.json").write_text(json.dumps(found), "utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
