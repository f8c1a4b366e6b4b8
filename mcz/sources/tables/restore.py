"""The text of a table: restored from its source, or of a motion without one in a plain style.

SPEC.md, "The text of tables", is normative for what is restored.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError, MotionError
from mcz.hints import Hint
from mcz.model.clock import TIMES, TOLERANCE, Timeline, numbers_or_rows
from mcz.model.motion import POSITION_KINDS, Channel, Exceptions, Motion, Signal, Source
from mcz.model.numbers import Grid, GridKind
from mcz.model.types import Ints
from mcz.sources.restore import printed_count, text_limit, write_rows
from mcz.sources.tables.layout import Clock, Section, build_table, fill_marks, parse_sections
from mcz.sources.text.layout import FRAME_NUMBER, FrameLayout, Pattern, runs_of
from mcz.sources.text.source import TableNotes

INTEGERS = Grid(GridKind.FIXED)


def restore_table(motion: Motion) -> bytes:
    """The text that the source and all signals of ``motion`` make.

    Raises FormatError if the source does not belong to such a motion, and LimitError for a text
    beyond the limits of ``restore``.
    """
    source, signals = motion.source, motion.signals
    assert source is not None
    sizes = [signal.n_channels for signal in signals]
    sections = parse_sections(source.template, source.detail, sizes)
    notes = source.notes if isinstance(source.notes, TableNotes) else TableNotes(())
    if len(notes.sections) > len(sections):  # TABLE-09
        raise FormatError(
            f"source notes have {len(notes.sections)} sections, but the template {len(sections)}"
        )
    tables = [_section_table(motion, section) for section in sections]
    limit = text_limit(source, [table.values.shape for table, _ in tables])
    names = [joint.name for joint in motion.skeleton.joints]
    out = BytesIO()
    for k, (section, (table, numbers)) in enumerate(zip(sections, tables, strict=True)):
        mine = notes.of(k, table.samples_per_frame, table.n_rows)
        header = section.header
        if section.marked:
            header = fill_marks(header, names, printed_count(section.rows, table.n_rows))
        out.write(header)
        begin = out.tell()
        write_rows(out, table, section.rows, mine, numbers, limit, section.missing)
        limit -= out.tell() - begin
    return out.getvalue()


def _section_table(motion: Motion, section: Section) -> tuple[Signal, Ints]:
    """The columns of a section, and the number of the frame of each row."""
    signals = [motion.signals[number] for number in section.signals]
    n_each = signals[0].samples_per_frame
    if any(signal.samples_per_frame != n_each for signal in signals):  # TABLE-06
        raise FormatError("source template: signals of a section differ in their rows a frame")
    signal = join_signals(signals)
    frame, within = np.divmod(np.arange(signal.n_rows), n_each)
    numbers = numbers_or_rows(motion.frame_numbers, motion.n_frames)[frame]
    more, grids = [], []
    if section.clock is not None:
        counted = [n * n_each + k for n, k in zip(numbers.tolist(), within.tolist(), strict=True)]
        ordinals = np.array(section.clock.ordinals(counted), np.int64)
        more.append(section.clock.grid.values(ordinals))
        grids.append(section.clock.grid)
    last = signal.n_channels + len(more)
    runs = (run for pattern in section.rows.patterns for run in pattern.runs)
    if any(run.column + run.n_columns > last for run in runs):
        more.append(within.astype(np.float64))
        grids.append(INTEGERS)
    return _with_columns(signal, more, grids), numbers


def join_signals(signals: Sequence[Signal]) -> Signal:
    """One signal with the channels of all, in order."""
    if len(signals) == 1:
        return signals[0]
    starts = np.cumsum([0, *(signal.n_channels for signal in signals)])[:-1].tolist()
    placed = list(zip(starts, signals, strict=True))
    masks = [np.ones(s.values.shape, np.bool_) if s.mask is None else s.mask for s in signals]
    mask = np.hstack(masks)
    return Signal(
        np.hstack([signal.values.astype(np.float64, copy=False) for signal in signals]),
        tuple(grid for signal in signals for grid in signal.grids),
        samples_per_frame=signals[0].samples_per_frame,
        mask=None if mask.all() else mask,
        exceptions=_exceptions(placed),
        grid_changes=tuple(
            (row, at + channel, grid)
            for at, signal in placed
            for row, channel, grid in signal.grid_changes
        ),
    )


def _exceptions(placed: Sequence[tuple[int, Signal]]) -> Exceptions:
    rows = np.concatenate([signal.exceptions.rows for _, signal in placed])
    channels = np.concatenate([signal.exceptions.channels + at for at, signal in placed])
    texts = [text for _, signal in placed for text in signal.exceptions.texts]
    order = np.lexsort((channels, rows))
    return Exceptions(rows[order], channels[order], tuple(texts[k] for k in order.tolist()))


def _with_columns(
    signal: Signal, more: Sequence[NDArray[np.float64]], grids: Sequence[Grid]
) -> Signal:
    """``signal`` with more columns after its own."""
    if not more:
        return signal
    mask = signal.mask
    if mask is not None:
        mask = np.hstack([mask, np.ones((len(mask), len(more)), np.bool_)])
    return Signal(
        np.column_stack([signal.values, *more]),
        (*signal.grids, *grids),
        samples_per_frame=signal.samples_per_frame,
        mask=mask,
        exceptions=signal.exceptions,
        grid_changes=signal.grid_changes,
    )


UNITS = {0.1: "mm", 1.0: "cm", 100.0: "m"}
DECIMALS = 6  # of times that are whole microseconds
MORE_DECIMALS = 9
MISSING = b"NaN"  # as OpenSim writes it; it does not count blank cells at the end of a row
SECONDS = Channel("", "time", "s")


def plain_trc(motion: Motion) -> Motion:
    """``motion`` with the source of a plain TRC; MotionError for what TRC cannot say."""
    skeleton = motion.skeleton
    for joint in skeleton.joints:
        kinds = tuple(channel.kind for channel in joint.channels)
        if joint.parent >= 0 or kinds != POSITION_KINDS:
            raise MotionError(f"TRC holds markers only; joint {joint.name!r} is not a marker")
    unit = UNITS.get(skeleton.unit_cm or 0.0)
    if unit is None:
        raise MotionError("TRC needs a length unit of mm, cm or m", hint=Hint.UNIT)
    rate = f"{float(_rate(motion)):.6f}"
    first = int(numbers_or_rows(motion.frame_numbers, motion.n_frames)[0]) if motion.n_frames else 1
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
    n = len(labels)
    degrees = "yes" if skeleton.angle_unit == "deg" else "no"
    header = f"{_printable(motion.name)}\nversion=1\nnRows=\3\nnColumns={n + 1}\n"
    header += f"inDegrees={degrees}\nendheader\n"
    header += "\t".join(("time", *labels)) + "\n"
    items = [(b"\t" if k else b"", column, 0) for k, column in enumerate((n, *range(n)))]
    return _with_source(motion, format_name, header, b"nan", items)


def _with_source(
    motion: Motion,
    format_name: str,
    header: str,
    missing: bytes,
    items: Sequence[tuple[bytes, int, int]],
) -> Motion:
    """``motion`` as its first signal and its times, with the source.

    The times are a clock, or a signal if frame numbers do not give them.
    """
    clock, times = _times(motion)
    signals = (motion.signals[0], *times)
    rows = FrameLayout((), (Pattern(runs_of(items), b"\n"),))
    numbers = tuple(range(len(signals)))
    template, detail = build_table([Section(numbers, header.encode(), True, missing, clock, rows)])
    source = Source(format_name, template, detail)
    return replace(motion, signals=signals, source=source)


def _times(motion: Motion) -> tuple[Clock | None, tuple[Signal, ...]]:
    """The clock that prints the times of ``motion``, or else a signal of times."""
    timeline = motion.timeline
    if timeline is None:
        raise MotionError(
            "its frame rate is unknown, but a table must state times", clip=motion.name
        )
    times = timeline.times
    noise = TOLERANCE + float(np.spacing(np.abs(times).max(initial=0.0)))
    exact = (np.abs(np.round(times, DECIMALS) - times) < noise).all()
    grid = Grid(GridKind.FIXED, DECIMALS if exact else MORE_DECIMALS)
    clock = _clock(motion, timeline, grid)
    if clock is not None:
        return clock, ()
    rounded = np.round(times, grid.digits)[:, None]
    return None, (Signal(rounded, (grid,), "time", channels=(SECONDS,), role=TIMES),)


def _clock(motion: Motion, timeline: Timeline, grid: Grid) -> Clock | None:
    """A clock that counts frame numbers; None if there is none that gives the times."""
    if motion.frame_rate is None:
        return None
    numbers = numbers_or_rows(motion.frame_numbers, motion.n_frames)
    step = 10**grid.digits / motion.frame_rate / motion.number_step
    start = Fraction(float(timeline.times[0])).limit_denominator(10**12) * 10**grid.digits
    offset = start * step.denominator - int(numbers[0]) * step.numerator + step.denominator // 2
    clock = Clock(grid, step.numerator, step.denominator, math.floor(offset))
    most = max(abs(clock.offset), step.numerator, step.denominator)
    if most >= 2**52 or int(numbers.max()) * step.numerator >= 2**62:
        return None
    off = np.abs(grid.values(np.array(clock.ordinals(numbers.tolist()))) - timeline.times)
    return clock if off.max() <= 0.5 * 10.0**-grid.digits + timeline.rounding + TOLERANCE else None


def _rate(motion: Motion) -> Fraction:
    if motion.frame_rate is None:
        raise MotionError(
            "its frame rate is unknown, but a table must state times", clip=motion.name
        )
    return motion.frame_rate


def _names(names: Sequence[str], n_frames: int) -> list[str]:
    """The names, checked: a cell holds no control code, and no blanks around what it says."""
    for name in names:
        if not name or name != name.strip() or any(ord(character) < 32 for character in name):
            raise MotionError(f"a table cannot hold the name {name!r}")
    if not n_frames:
        raise MotionError("there are no rows of numbers")
    return list(names)


def _printable(name: str) -> str:
    """The name of the motion on a line of its own."""
    name = name.encode("utf-8", "replace").decode()
    return "".join(character if ord(character) >= 32 else "_" for character in name)
