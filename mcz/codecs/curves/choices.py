"""Encoder decisions of qbc before the first segment.

mcz/codecs/curves/README.md describes the encoder.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from mcz.codecs.contract import Layout
from mcz.codecs.parameters import SCALED, preset_values
from mcz.codecs.segments import segment_frames_of
from mcz.errors import MotionError, OptionError
from mcz.kinematics.points import reach
from mcz.model.motion import ANGLE_KINDS, POSITION_KINDS, Skeleton
from mcz.model.types import Bools, Floats, Ints, Params, Settings

MAX_INDEX = 2**40
LEAST_STEP = 2.0**-100
LEAST_LEVER = 2.0**-30
STEP_SHARE = 0.75  # step as a share of the allowed distance, if no decimals are given
MOST_FEWEST_DELTA = 512  # greatest ``delta`` with breaks=fewest, whose search takes long

PRESETS: dict[str, Settings] = {
    "default": {"d2_lmt": 1.0, "delta": 40, "Q": None, "middle": "least-squares"},
    "khan2014": {"d2_lmt": 4.0, "delta": 80, "Q": 2, "middle": "published"},
}
MIDDLES = ("published", "least-squares")  # in the order of their numbers in ``kernels``
BREAKS = ("split", "fewest")


@dataclass(frozen=True, slots=True)
class Plan:
    """Encoder decisions before the first segment."""

    limit: float
    delta: int
    decimals: int | None
    step: float
    lever: float  # length units of a position that weigh as one angle unit, if steps are scaled
    method: int
    is_closed: bool  # the bound applies to decoded points, not to those before rounding
    has_fewest_breaks: bool
    segment_frames: int  # 0: the size decides

    @property
    def grid(self) -> tuple[float, float]:
        """``per`` and ``step`` of ``kernels.Rule``."""
        return (0.0, self.step) if self.decimals is None else (10.0**self.decimals, 1.0)

    def indices(self, points: Floats) -> Ints:
        """Points as integers, halves away from zero."""
        per, step = self.grid
        with np.errstate(over="ignore"):
            sizes = np.abs(points) * per if per else np.abs(points) / step
        indices = np.floor(sizes + 0.5)
        if not (indices <= MAX_INDEX).all():  # a fit of huge points may be NaN
            raise MotionError("qbc: a control point exceeds 2^40 quantizer steps")
        return np.where(points < 0, -indices, indices).astype(np.int64)

    def points(self, indices: Ints) -> Floats:
        per, step = self.grid
        return np.asarray(indices / per if per else indices * step, np.float64)


def position_channels(layout: Layout) -> Bools:
    """Mask of the channels that are lengths and use the position step."""
    if layout.skeleton is None:
        return np.zeros(layout.n_channels, np.bool_)
    kinds = (channel.kind for channel in layout.skeleton.channels)
    return np.array([kind in (*POSITION_KINDS, "length") for kind in kinds], np.bool_)


def _lever(skeleton: Skeleton | None) -> float:
    """Distance that the farthest point moves per angle unit of a root; 1 without rotations."""
    if skeleton is None or not any(c.kind in ANGLE_KINDS for c in skeleton.channels):
        return 1.0
    lever = reach(skeleton) * (math.pi / 180 if skeleton.angle_unit != "rad" else 1.0)
    return lever if LEAST_LEVER <= lever <= 1 / LEAST_LEVER else 1.0


def plan_of_options(params: Params, layout: Layout) -> Plan:
    """The plan for a clip; raises OptionError for parameters that do not fit."""
    chosen, published = preset_values(PRESETS, params), params["preset"] == "khan2014"
    limit, decimals = chosen["d2_lmt"], chosen["Q"]
    if decimals is None and not limit > 0:
        raise OptionError("qbc: with d2_lmt 0 there is no step; give Q")
    fewest = params["breaks"] == "fewest"
    if fewest and chosen["delta"] > MOST_FEWEST_DELTA:
        raise OptionError(f"qbc: breaks=fewest allows delta up to {MOST_FEWEST_DELTA}")
    step = STEP_SHARE * limit**0.5 if decimals is None else 1.0
    lever = _lever(layout.skeleton) if decimals is None else 1.0
    if step < LEAST_STEP or step * lever < LEAST_STEP:
        raise OptionError(
            f"qbc: d2_lmt {limit} is too small to derive a step; set the decimals with Q"
        )
    return Plan(
        limit=limit,
        delta=chosen["delta"],
        decimals=decimals,
        step=step,
        lever=lever,
        method=MIDDLES.index(chosen["middle"]),
        is_closed=not published,
        has_fewest_breaks=fewest,
        segment_frames=segment_frames_of(layout, params["segment_frames"], as_published=published),
    )


def plan_of_header(fields: Any, options: Params) -> Plan:
    """Recover an encoder's plan from a clip's header and recorded options."""
    preset = PRESETS[options["preset"]]
    scaled = fields.decimals == SCALED
    limit = options["d2_lmt"]
    if limit is None:
        limit = (fields.step / STEP_SHARE) ** 2 if scaled else preset["d2_lmt"]
    return Plan(
        limit=limit,
        delta=fields.delta,
        decimals=None if scaled else fields.decimals,
        step=fields.step if scaled else 1.0,
        lever=fields.position_step / fields.step if scaled else 1.0,
        method=MIDDLES.index(options["middle"] or preset["middle"]),
        is_closed=options["preset"] != "khan2014",
        has_fewest_breaks=options["breaks"] == "fewest" and fields.delta <= MOST_FEWEST_DELTA,
        segment_frames=0,
    )
