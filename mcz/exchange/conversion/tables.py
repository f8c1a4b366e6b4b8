"""A motion for tables of numbers: markers of TRC, columns of STO and MOT."""

from __future__ import annotations

from dataclasses import replace

from mcz.exchange.conversion.markers import to_c3d
from mcz.model.motion import Motion
from mcz.model.numbers import Grid, GridKind

PRINTED = Grid(GridKind.FIXED, 6)  # of points that are computed: far below noise


def to_trc(motion: Motion) -> Motion:
    """Its points as markers of their names, in mm where the length unit is known.

    A motion of markers is returned as it is.
    """
    made = to_c3d(motion)
    signal = made.signals[0]
    if signal is motion.signals[0]:
        return replace(made, signals=(signal,))
    signal = replace(signal, grids=(PRINTED,) * signal.n_channels, grid_changes=(), ordinals=None)
    return replace(made, signals=(signal,))


def to_storage(motion: Motion) -> Motion:
    """Its motion signal, a column a channel."""
    return replace(motion, signals=motion.signals[:1])


def needs_rate(motion: Motion, to: str) -> bool:
    """Return whether a table needs a frame rate: TRC states it, others have times."""
    return to == "trc" or motion.timeline is None
