"""A motion whose text arrives line by line -> a live clip.

Part of the joint between motion, codec and container (see ``file.py``).
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType
from typing import Any

from mcz.codecs import by_name
from mcz.container.writer import Sink
from mcz.errors import OptionError
from mcz.files.live import LiveWriter
from mcz.files.sources import in_unit, read_skeleton
from mcz.formats import FORMATS, sniffed
from mcz.formats.arriving import Arriving

NOTE = "coded live, frame by frame, from {format} text, which was not kept"


@dataclass(slots=True)
class LiveReport:
    """What ``encode_live`` wrote, and what it could not say in the clip."""

    n_frames: int = 0
    n_channels: int = 0
    remarks: tuple[str, ...] = ()


def encode_live(
    lines: Iterable[bytes],
    sink: Sink,
    source_format: str,
    codec: str,
    params: Mapping[str, Any] = MappingProxyType({}),
    *,
    skeleton: str | os.PathLike[str] | None = None,
    rate: Fraction | None = None,
    unit: str | None = None,
    name: str = "live",
) -> LiveReport:
    """Write the motion that ``lines`` spell to ``sink``, each frame before the next line is read.

    ``source_format`` is ``bvh`` or ``amc``; an AMC needs ``skeleton``, the path of its ASF. Raises
    SourceError at text that is none of the format; the clip is closed then with all frames
    before it. Otherwise raises as ``LiveWriter`` does.
    """
    found = FORMATS.get(source_format)
    if found is None or found.arrive is None:
        able = ", ".join(f.name for f in FORMATS.values() if f.arrive is not None)
        raise OptionError(f"format {source_format!r} cannot come line by line; these can: {able}")
    if found.wants_skeleton and skeleton is None:
        raise OptionError(f"{source_format} that comes line by line needs its skeleton file")
    base = read_skeleton(skeleton) if found.wants_skeleton and skeleton is not None else None
    base = None if base is None else in_unit(base, unit)
    arriving: Arriving = found.arrive(iter(lines), base)
    notes = [arriving.metadata.get("source-note", ""), NOTE.format(format=source_format.upper())]
    writer = LiveWriter(
        sink,
        in_unit(arriving.skeleton, unit),
        codec,
        params,
        frame_rate=arriving.frame_rate if rate is None else rate,
        frame_rate_exact=arriving.frame_rate_exact if rate is None else True,
        name=name,
        metadata=dict(arriving.metadata) | {"source-note": "; ".join(filter(None, notes))},
        first_number=arriving.first_number,
        base=base,
    )
    report = LiveReport(n_channels=arriving.skeleton.n_channels)
    with writer:
        due = arriving.first_number
        for number, values in arriving.frames:
            if number is not None and number != due:
                remark = f"frame {number} comes where {due} is due; the clip counts on"
                report.remarks = report.remarks or (remark,)
                due = number
            writer.push(values)
            due += 1
            report.n_frames += 1
    if arriving.declared not in (None, report.n_frames):
        remark = f"{arriving.declared} frames are declared, {report.n_frames} came"
        report.remarks = (*report.remarks, remark)
    return report


def codes_live(codec: str) -> bool:
    """Whether the codec of that name codes frame by frame; raises OptionError without one."""
    return by_name(codec).live is not None


def format_name_of(data: bytes) -> str:
    """The name of the source format that ``data`` looks like; raises OptionError."""
    name = sniffed(data)
    if name is None:
        raise OptionError("it looks like no known format; say which it is")
    return name
