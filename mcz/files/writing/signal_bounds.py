"""Bounds of the signals other than the motion: coarser numbers, whose errors are measured.

``analog.max_error=0.5mV`` or ``1N,10Nmm`` requests one. Each channel is put on a coarser number
grid, or on fewer numbers of its own grid if its source can be written only from that grid. Codec
``fast`` then codes it exactly, so that decoders need no change.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.fast.encoder import channel_bytes
from mcz.codecs.contract import Codec
from mcz.errors import OptionError
from mcz.files.writing.planning import MAX_ERROR, MEAN_ERROR
from mcz.kinematics.metrics.comparison import named_signals, signal_errors
from mcz.model.motion import ANGLE_KINDS, POSITION_KINDS, Channel, Motion, Signal, Skeleton, Source
from mcz.model.numbers import Grid, GridKind
from mcz.model.numbers.rules import MAX_SCALE, MIN_SCALE
from mcz.model.types import Bools, Floats, Params
from mcz.model.units import unit_ratio
from mcz.sources import recording_of, with_analog_scales

EXACT_ROLES = {"times": "they order the frames", "residuals": "they say which points are valid"}
FLOATS = (GridKind.BINARY32, GridKind.VAX_F)
MOST_MULTIPLES = 2**19  # steps in a number, beyond which fast may find no unit
SHORT_BITS = 8  # bits of a unit of floats: few of its multiples are rounded then
TRIALS = 10
GOOD_ENOUGH = 0.97  # share of a requested mean error at which the search ends


def with_bounds(motion: Motion, codec: Codec, options: Params) -> tuple[Motion, dict[str, str]]:
    """``motion`` with signals as coarse as the bounds in ``options`` allow.

    Also returns entries of the quality record. Raises OptionError for a bad bound.
    """
    if codec.lossless:
        raise OptionError(
            f"{next(iter(options))}: codec {codec.name} is lossless; choose a lossy codec "
            "(lossless=all keeps its motion exact)"
        )
    signals, numbers = list(motion.signals), {n: i for i, n in enumerate(named_signals(motion), 1)}
    remarks: dict[str, str] = {}
    for name in dict.fromkeys(key.rpartition(".")[0] for key in options):
        if name not in numbers:
            raise OptionError(
                f"no signal besides the motion is called {name!r}; there are {[*numbers]}"
            )
        source = signals[numbers[name]]
        if source.role in EXACT_ROLES:
            raise OptionError(f"signal {name!r} must stay exact: {EXACT_ROLES[source.role]}")
        limits = [
            _limits(motion.skeleton, source, f"{name}.{error}", options)
            for error in (MAX_ERROR, MEAN_ERROR)
        ]
        motion, coarse = _coarsen(motion, source, *limits)
        signals[numbers[name]] = coarse
        errors = signal_errors(motion.skeleton, source, coarse)
        figures = {"mse": errors.mse, MAX_ERROR: errors.greatest, MEAN_ERROR: errors.mean}
        known = {k: v for k, v in figures.items() if v is not None}
        remarks |= {f"signal.{name}.{key}": repr(value) for key, value in known.items()}
    remarks |= {f"param.{key}": str(value) for key, value in options.items()}
    return replace(motion, signals=tuple(signals)), remarks


def _limits(skeleton: Skeleton, signal: Signal, key: str, options: Params) -> Floats:
    """The bound of each channel in its own unit, (n_channels,); infinite without one."""
    channels = skeleton.channels if signal.channels is None else signal.channels
    if key not in options:
        return np.full(len(channels), math.inf)
    return limits_of(skeleton, channels, key, options[key])


@dataclass(frozen=True, slots=True)
class Column:
    """A channel: values in its unit, stored numbers, and their scaling.

    ``value = (number - offset) * scale * general``. ``kept``: values that stay unchanged.
    """

    values: Floats
    numbers: Floats
    grid: Grid
    kept: Bools
    valid: Bools
    offset: float = 0.0
    scale: float = 1.0
    general: float = 1.0

    def values_of(self, numbers: Floats) -> Floats:
        return (numbers - self.offset) * self.scale * self.general

    def with_numbers(self, grid: Grid, numbers: Floats) -> Column | None:
        """The column with other numbers, except kept ones; None if that is impossible."""
        numbers = np.where(self.kept, self.numbers, numbers + 0.0)  # no -0
        with np.errstate(all="ignore"):
            column = replace(self, grid=grid, numbers=numbers, values=self.values_of(numbers))
        return column if self.kept.any() <= _can_hold(self.grid, grid) else None

    def size(self) -> int:
        return channel_bytes(self.grid.ordinals(self.numbers)[0], self.grid)


def _can_hold(old: Grid, new: Grid) -> bool:
    return old == new or (old.is_text and new.is_text) or new.kind == GridKind.BINARY32


def _coarsen(
    motion: Motion, signal: Signal, greatest: Floats, mean: Floats
) -> tuple[Motion, Signal]:
    """The motion, with a source that fits, and the signal within the bounds of each channel."""
    source = list(_columns(signal))
    of_c3d = recording_of(motion.source) is not None
    rescales = of_c3d and signal.role == "analog" and _states_scales(motion.source, source)
    columns = [
        _coarsen_column(
            column, most, average, SourceRules(motion.source is not None, of_c3d, rescales)
        )
        for column, most, average in zip(source, greatest.tolist(), mean.tolist(), strict=True)
    ]
    scales = {c: new.scale for c, new in enumerate(columns) if new.scale != source[c].scale}
    if scales:
        assert motion.source is not None
        motion = replace(motion, source=with_analog_scales(motion.source, scales))
        signal = replace(signal, scaling=recording_of(motion.source).scaling, stored=signal.stored)
    changed = [c for c, new in enumerate(columns) if new is not source[c]]
    if not changed:
        return motion, signal
    grids = tuple(column.grid for column in columns)
    numbers = signal.stored.copy()
    if any(grid.kind != GridKind.INTEGER for grid in grids):
        numbers = numbers.astype(np.float64)
    ordinals = None if signal.ordinals is None else signal.ordinals.copy()
    for c in changed:
        numbers[:, c] = columns[c].numbers
        if ordinals is not None:  # also known for NaNs
            same = source[c].kept & (grids[c] == source[c].grid)
            ordinals[:, c] = np.where(same, ordinals[:, c], 0)
    signal = replace(
        signal,
        values=numbers if signal.scaling is None else signal.scaling.values(numbers),
        stored=numbers,
        grids=grids,
        grid_changes=tuple(change for change in signal.grid_changes if change[1] not in changed),
        ordinals=ordinals,
    )
    return motion, signal


def _states_scales(source: Source | None, columns: Sequence[Column]) -> bool:
    scales = {c: column.scale for c, column in enumerate(columns)}
    return source is not None and with_analog_scales(source, scales) is not None


def _columns(signal: Signal) -> Iterator[Column]:
    exempt = ~np.isfinite(signal.values)
    exempt[signal.exceptions.rows, signal.exceptions.channels] = True
    valid = np.ones(exempt.shape, np.bool_) if signal.mask is None else signal.mask
    scaling = signal.scaling
    for c, grid in enumerate(signal.grids):
        column = Column(
            signal.values[:, c].astype(np.float64),
            signal.stored[:, c].astype(np.float64),
            grid,
            exempt[:, c],
            valid[:, c] & ~exempt[:, c],
        )
        if scaling is not None:
            own = float(scaling.offsets[c]), float(scaling.scales[c]), float(scaling.general)
            column = replace(column, offset=own[0], scale=own[1], general=own[2])
        yield column


@dataclass(frozen=True, slots=True)
class SourceRules:
    """Restrictions that a source puts on grids."""

    has_source: bool
    of_c3d: bool
    rescales: bool


def _coarsen_column(column: Column, greatest: float, mean: float, rules: SourceRules) -> Column:
    """The column with the coarsest numbers within the bounds; unchanged if that saves nothing."""
    unit = abs(column.scale * column.general)
    most = 2 * greatest
    step, best, least = min(most, 4 * mean), column, 0.0
    for _ in range(TRIALS):
        if not 0 < step < math.inf or not 0 < unit < math.inf or column.kept.all():
            break
        rounded = _round_column(column, step, unit, rules)
        reached = math.inf if rounded is None else _mean_error(column, rounded, greatest)
        if rounded is not None and reached < math.inf and reached <= mean * (1 - 1e-9):
            if reached >= least:
                best, least = rounded, reached
            if step >= most or reached >= GOOD_ENOUGH * mean:
                break
            step = min(most, step * min(2.0, 0.99 * mean / max(reached, mean / 2)))
        else:
            step *= min(0.9, 0.99 * mean / reached) if reached < math.inf else 0.9
    return best if best is not column and best.size() < column.size() else column


def _mean_error(column: Column, rounded: Column, greatest: float) -> float:
    """The mean error of ``rounded``; infinite where one is beyond ``greatest``."""
    if not is_within(column.values, rounded.values, greatest)[~column.kept].all():
        return math.inf
    errors = np.abs(column.values[column.valid] - rounded.values[column.valid])
    return float(errors.mean()) if len(errors) else 0.0


def is_within(source: Floats, rounded: Floats, bound: float) -> Bools:
    """True where |source - rounded| <= bound, exactly."""
    if bound == math.inf:
        return np.isfinite(rounded)
    with np.errstate(all="ignore"):
        error = source - rounded
        back = error - source
        rest = (source - (error - back)) - (rounded + back)  # rounding error of the subtraction
        at_bound = (np.abs(error) == bound) & (rest * np.sign(error) <= 0)
        return np.asarray((np.abs(error) < bound) | at_bound)


def _round_column(column: Column, step: float, unit: float, rules: SourceRules) -> Column | None:
    """The column on numbers ``step`` apart, in its unit; None if there are none."""
    kind, numbers, own_step = column.grid.kind, column.numbers, step / unit
    with np.errstate(all="ignore"):
        if kind in FLOATS:
            return _on_floats(column, column.grid, own_step)
        if column.grid.is_text and (rules.has_source or column.kept.any()):
            digits = min(max(math.ceil(-math.log10(own_step) - 1e-9), 0), 22)
            grid = Grid(GridKind.FIXED, digits)
            return column.with_numbers(grid, grid.values(grid.ordinals(numbers)[0]))
        if kind == GridKind.INTEGER:
            own_step = 2 * math.floor(own_step / 2) + 1.0
        if rules.of_c3d:
            return (
                _rescale(column, own_step) if rules.rescales and kind == GridKind.INTEGER else None
            )
        own_step *= 1 - 2.0**-40 if kind != GridKind.INTEGER else 1  # for the rounding of products
        if column.kept.any() and kind != GridKind.INTEGER:
            return _on_floats(column, Grid(GridKind.BINARY32), own_step)
        if not MIN_SCALE <= own_step <= MAX_SCALE:
            return None
        grid = Grid(GridKind.SCALED, scale=own_step)
        return column.with_numbers(grid, grid.values(grid.ordinals(numbers)[0]))


def _on_floats(column: Column, grid: Grid, step: float) -> Column | None:
    """The floats nearest to multiples of a unit, which ``fast`` finds."""
    exponent = math.frexp(step)[1] - SHORT_BITS
    unit = math.ldexp(math.floor(math.ldexp(step, -exponent)), exponent)
    numbers = np.where(column.kept, 0.0, column.numbers)
    if not 2.0**-140 <= unit <= 2.0**79 or np.abs(numbers).max(initial=0) > MOST_MULTIPLES * unit:
        return None
    return column.with_numbers(grid, grid.values(grid.ordinals(np.rint(numbers / unit) * unit)[0]))


def _rescale(column: Column, step: float) -> Column | None:
    """Words of a converter that is coarser by ``step``; the source states the new scale."""
    scale = float(np.float32(column.scale * step))
    if step < 2 or not math.isfinite(scale):
        return None
    words = np.rint((column.numbers - column.offset) * (column.scale / scale)) + column.offset
    rescaled = replace(column, scale=scale)
    return replace(rescaled, numbers=words, values=rescaled.values_of(words))


_BOUND = re.compile(r"([0-9.]+(?:[eE][-+]?[0-9]+)?) ?([^\s0-9.,].*)?")
LENGTHS = (*POSITION_KINDS, "length")


def parse_bound(key: str, text: str) -> tuple[float, str]:
    """A bound and its unit, "" for the channel's own; raises OptionError.

    >>> parse_bound("analog.max_error", "0.5 mV"), parse_bound("analog.max_error", "2")
    ((0.5, 'mV'), (2.0, ''))
    """
    match = _BOUND.fullmatch(text.strip())
    try:
        size = float(match[1]) if match else math.nan
    except ValueError:
        size = math.nan
    if match is None or not 0 <= size < math.inf:
        raise OptionError(f"{key} is {text!r}; write a number and optionally a unit, such as 0.5mV")
    return size, match[2] or ""


def limits_of(
    skeleton: Skeleton, channels: Sequence[Channel], key: str, text: object
) -> NDArray[np.float64]:
    """The limit of each channel in its own unit: the first of the bounds in ``text`` that fits it.

    Raises OptionError for a channel that none fits.
    """
    bounds = [parse_bound(key, one) for one in str(text).split(",")]
    limits = []
    for number, channel in enumerate(channels):
        ratios = [(size, _ratio(skeleton, channel, unit) if unit else 1.0) for size, unit in bounds]
        fitting = [size * ratio for size, ratio in ratios if ratio is not None]
        if not fitting:
            own = _unit_of(skeleton, channel)
            raise OptionError(
                f"{key}: channel {channel.label or number} is in {own or 'an unknown unit'}, which "
                f"{text} does not fit; add a bound for it, such as {text},5 in its own unit"
            )
        limits.append(fitting[0])
    return np.array(limits)


def _unit_of(skeleton: Skeleton, channel: Channel) -> str:
    if channel.kind in ANGLE_KINDS:
        return skeleton.angle_unit
    if channel.kind in LENGTHS:
        return "" if skeleton.unit_cm is None else f"{skeleton.unit_cm:g} cm"
    return channel.unit


def _ratio(skeleton: Skeleton, channel: Channel, unit: str) -> float | None:
    """The size of ``unit`` in that of the channel; None if it does not fit."""
    if channel.kind not in LENGTHS:
        return unit_ratio(unit, _unit_of(skeleton, channel))
    ratio = unit_ratio(unit, "cm")
    return None if ratio is None or skeleton.unit_cm is None else ratio / skeleton.unit_cm
