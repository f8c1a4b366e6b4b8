"""Text previews of ``mcz info --preview``: a sparkline of motion, bars of bytes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from mcz.cli.common import table
from mcz.cli.terminal import can_show
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip
    from mcz.kinematics.poses.motion_like import MotionLike

LEVELS, PLAIN_LEVELS = "▁▂▃▄▅▆▇█", "_.-=+*%#"
EIGHTHS, PLAIN = "▏▎▍▌▋▊▉█", "#"
Bar = tuple[str, int]  # what takes so many bytes

WIDTH = 24  # letters of the longest bar
MOST_BARS = 8


def preview_of(clip: Clip) -> JsonObject:
    """The keys of a clip's preview; ``motion`` is None where there is none."""
    from mcz.files.reading.sizes import byte_shares

    shares = [
        {"signal": s.signal, "joints": s.name, "resolution": s.resolution, "bytes": s.n_bytes}
        for s in byte_shares(clip)
    ]
    return {"motion": motion_of(clip), "payload": shares}


def motion_of(moving: MotionLike) -> JsonObject | None:
    """The speeds of equal parts of the time, and what they are in; None where they are unknown."""
    from mcz.show.pictures.energy import motion_energy

    speeds = motion_energy(moving)
    if speeds is None:
        return None
    unit = moving.skeleton.unit_cm
    values = [float(speed) * (unit or 1.0) for speed in speeds]
    length, time = "units" if unit is None else "cm", "s" if moving.timeline else "frame"
    known = [value if math.isfinite(value) else None for value in values]
    return {"unit": f"{length}/{time}", "mean_speeds": known}


def preview_lines(preview: JsonObject) -> Iterator[str]:
    """The preview as people read it."""
    motion = preview["motion"]
    if motion is not None and any(speed is not None for speed in motion["mean_speeds"]):
        speeds = motion["mean_speeds"]
        most = max(speed for speed in speeds if speed is not None)
        yield f"  motion     {sparkline(speeds)}  mean speed, up to {most:.4g} {motion['unit']}"
    bars, rest = bars_of(preview.get("payload", []))
    if len(bars) > 1:
        greatest, total = max(n for _, n in bars), sum(n for _, n in (*bars, *rest))
        rows = [(name, bar(n / greatest), n) for name, n in bars]
        rows += [(name, "", n) for name, n in rest]
        cells = [[name, own, f"{n:,}", f"{100 * n / total:.1f} %"] for name, own, n in rows]
        lines = table([["payload", "", "bytes", "share"], *cells], "llrr").split("\n")
        yield from (f"  {line}" for line in lines)


def sparkline(numbers: Sequence[float | None], blocks: bool | None = None) -> str:
    """Numbers from 0 as letters of growing height, a blank for None.

    >>> sparkline([0, 1.0, None, 8.0], blocks=True), sparkline([0, 1.0, None, 8.0], blocks=False)
    ('▁▂ █', '_. #')
    """
    letters = LEVELS if (can_show(LEVELS) if blocks is None else blocks) else PLAIN_LEVELS
    most = max((n for n in numbers if n is not None), default=0.0) or 1.0
    return "".join(
        " " if n is None else letters[min(7, max(0, int(8 * n / most)))] for n in numbers
    )


def bar(share: float, blocks: bool | None = None) -> str:
    """
    >>> bar(0.5, blocks=False), bar(1 / 24, blocks=True), bar(1.5 / 24, blocks=True)
    ('############', '█', '█▌')
    """
    eighths = math.ceil(share * WIDTH * 8 - 1e-9)
    if not (can_show(EIGHTHS) if blocks is None else blocks):
        return PLAIN * math.ceil(eighths / 8)
    return EIGHTHS[7] * (eighths // 8) + (EIGHTHS[eighths % 8 - 1] if eighths % 8 else "")


def bars_of(payload: Sequence[JsonObject]) -> tuple[list[Bar], list[Bar]]:
    """Bars and the rest: the joints that take most, or of one group its
    resolutions."""
    from mcz.files.reading.sizes import Share, by_group

    groups = by_group(
        Share(of["signal"], None, of["joints"], of["resolution"], of["bytes"]) for of in payload
    )
    if len(groups) == 1:
        ((_, parts),) = groups.items()
        return [(_called(resolution), n) for resolution, n in parts.items()], []
    sums = {name: sum(parts.values()) for name, parts in groups.items()}
    ordered = sorted(sums.items(), key=lambda each: -each[1])
    rest = ordered[MOST_BARS:]
    others = [(f"{len(rest)} others", sum(n for _, n in rest))] if rest else []
    return ordered[:MOST_BARS], others


def _called(resolution: int | None) -> str:
    if resolution is None:
        return "exceptions, masks"
    return f"resolution {resolution}" + (", coarsest" if resolution == 0 else "")
