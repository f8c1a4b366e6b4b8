"""TRC, STO and MOT files of motions that have no such source, in one plain style each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from mcz.clock import has_times
from mcz.errors import MotionError
from mcz.formats.layout import FRAME_NUMBER, Layout, Pattern, runs_of
from mcz.formats.restore import numbers_of
from mcz.formats.table_layout import Clock, Section, build_table
from mcz.motion import POSITION_KINDS, Motion, Source
from mcz.numbers import Grid, GridKind

UNITS = {0.1: "mm", 1.0: "cm", 100.0: "m"}
DECIMALS = 6  # of times
MISSING = b"NaN"  # as OpenSim writes it, to which blank cells at the end of a row are none
TIMES = Grid(GridKind.FIXED, DECIMALS)


def plain_trc(motion: Motion) -> Motion:
    """``motion`` with the source of a plain TRC; MotionError for what TRC cannot say."""
    skeleton = motion.skeleton
    for joint in skeleton.joints:
        kinds = tuple(channel.kind for channel in joint.channels)
        if joint.parent >= 0 or kinds != POSITION_KINDS:
            raise MotionError(f"TRC holds markers alone, and joint {joint.name!r} is none")
    unit = UNITS.get(skeleton.unit_cm or 0.0)
    if unit is None:
        raise MotionError("TRC states a length unit: mm, cm or m; say which it is")
    rate = f"{float(_rate(motion)):.6f}"
    first = int(numbers_of(motion, motion.n_frames)[0]) if motion.n_frames else 1
    names = _names([joint.name for joint in skeleton.joints], motion.n_frames)
    values = (rate, rate, "\3", str(len(names)), unit, rate, str(first), str(motion.n_frames))
    axes = "".join("\tX\1\tY\2\tZ\2" for _ in names)
    header = (
        f"\4{_printable(motion.name)}.trc\n\5\n"
        + "\t".join(values)
        + "\n\6"
        + "".join("\t\0\t\t" for _ in names)
        + f"\n\t{axes}\n\n"
    )
    items = [(b"", FRAME_NUMBER, 0), (b"\t", 3 * len(names), 0)]
    items += [(b"\t", column, 0) for column in range(3 * len(names))]
    return _with_source(motion, "trc", header, MISSING, items)


def plain_storage(motion: Motion, format_name: str = "sto") -> Motion:
    """``motion`` with the source of a plain STO or MOT, one number a cell."""
    skeleton = motion.skeleton
    labels = [
        f"{address}.{channel.label}" if len(joint.channels) > 1 or channel.kind else address
        for address, joint in zip(skeleton.addresses(), skeleton.joints, strict=True)
        for channel in joint.channels
    ]
    labels = _names(labels, motion.n_frames)
    n, timed = len(labels), has_times(skeleton)
    degrees = "yes" if skeleton.angle_unit == "deg" else "no"
    header = f"{_printable(motion.name)}\nversion=1\nnRows=\3\nnColumns={n + (not timed)}\n"
    header += f"inDegrees={degrees}\nendheader\n"
    header += "\t".join(labels if timed else ("time", *labels)) + "\n"
    columns = [*range(n)] if timed else [n, *range(n)]
    items = [(b"\t" if k else b"", column, 0) for k, column in enumerate(columns)]
    return _with_source(motion, format_name, header, b"nan", items, timed=timed)


def _with_source(
    motion: Motion,
    format_name: str,
    header: str,
    missing: bytes,
    items: Sequence[tuple[bytes, int, int]],
    *,
    timed: bool = False,
) -> Motion:
    """``motion`` as its first signal alone, with the source; ``timed``: the times are in it.

    Else they begin with 0.
    """
    clock = None if timed else _clock(motion)
    rows = Layout((), (Pattern(runs_of(items), b"\n"),))
    template, detail = build_table([Section((0,), header.encode(), True, missing, clock, rows)])
    source = Source(format_name, template, detail, clock=clock)
    return replace(motion, signals=motion.signals[:1], source=source)


def _clock(motion: Motion) -> Clock:
    step = 10**DECIMALS / _rate(motion)
    first = int(numbers_of(motion, motion.n_frames)[0]) if motion.n_frames else 1
    offset = step.denominator // 2 - first * step.numerator
    if max(abs(offset), step.numerator, step.denominator) >= 2**52:
        raise MotionError(
            f"motion {motion.name!r}: its frame rate or numbers are too large for TRC"
        )
    return Clock(TIMES, step.numerator, step.denominator, offset)


def _rate(motion: Motion) -> Fraction:
    if motion.frame_rate is None:
        raise MotionError(f"motion {motion.name!r}: its frame rate is unknown; a table has times")
    return motion.frame_rate


def _names(names: Sequence[str], n_frames: int) -> list[str]:
    """The names, checked: a cell holds no control code, and no blanks around what it says."""
    for name in names:
        if not name or name != name.strip() or any(ord(character) < 32 for character in name):
            raise MotionError(f"a table cannot hold the name {name!r}")
    if not n_frames:
        raise MotionError("a table without rows of numbers is none")
    return list(names)


def _printable(name: str) -> str:
    """The name of the motion on a line of its own."""
    return "".join(character if ord(character) >= 32 else "_" for character in name)
