"""What the encoder of ``posewave`` chooses before the first segment; a decoder needs none of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import SignalSource
from mcz.codecs.gaps import FrameReader
from mcz.codecs.posewave.contact_choice import choose_contacts, runs_of
from mcz.codecs.posewave.contact_keeper import Keeper
from mcz.codecs.posewave.header import NAME, Header, build_header, parse_header
from mcz.codecs.posewave.metric import Metric
from mcz.codecs.posewave.order_choices import choose_orders
from mcz.codecs.posewave.orders import Orders
from mcz.codecs.posewave.segment import Weights, encode_coded
from mcz.codecs.segments import skeleton_of
from mcz.codecs.steps import code_of
from mcz.kinematics import reach
from mcz.motion import Skeleton

Floats = NDArray[np.float64]

RADIUS_CM = 3.0  # of the shell, as ACL measures it
PROPORTION = 1 / 30  # of the shell to the skeleton where the unit is unknown: 3 cm of 90 cm
GREATEST_DEGREES, GREATEST_CM = 4.0, 20.0  # steps beyond which the metric says nothing any more
SHELL = 8  # sixteenths
COARSE_CM = 0.065  # a step from which on the second start table is nearer
FINE_CM = 0.08  # a step below which first poses are told more exactly
LEVELS = (2, 3, 4, 5)  # that are tried
TRIAL_FRAMES = 2048
SAMPLED = 8  # every so many frames an error is measured in a trial
EXCHANGE = 0.75  # how fast bytes fall as errors rise, in logarithms: where a trial is better
STEPS_CM = 0.01, 0.3  # between these steps the weight of a bit goes from the first to the second
RATE_WEIGHTS = 0.09, 0.2
USUAL = (0.0047, 0.03, 0.1, 0.28, 1.0), (0.01, 0.048, 0.1, 0.19, 0.5)  # steps, mean errors
MEAN_TO_BOUND = 0.22  # the mean error with which a bound takes the fewest bytes
COARSEST_WEIGHT = 0.12  # of a bit at level 0, whose errors later rows are predicted from


@dataclass(frozen=True, slots=True)
class Choice:
    """The header of a clip, and the weight of a bit against a squared step."""

    header: bytes
    weights: Weights
    keeper: Keeper | None = None


def choose(source: SignalSource, params: Mapping[str, Any]) -> Choice:
    """Raises MotionError for values that cannot be coded."""
    skeleton = skeleton_of(NAME, source.layout)
    unit = skeleton.unit_cm
    step = default_step(skeleton) if params["step"] is None else params["step"] / (unit or 1.0)
    # With the unit unknown, a skeleton of 90 cm stands for all: only ratios follow from it.
    step_cm = step * (unit or RADIUS_CM / PROPORTION / (reach(skeleton) or 1.0))
    weights = weights_of(step_cm)
    fields = _fields(skeleton, step, step_cm)
    keeper = None
    if params["contacts"]:
        tolerance = params["contact_tolerance"] * step / step_cm
        runs = runs_of(source, params["contacts"])
        wanted = choose_contacts(skeleton, runs, tolerance, moving_of(source))
        fields["contacts"], keeper = [wanted.fields], Keeper(tolerance, wanted.pieces)
    octaves = params.get("refinement")
    fields["refining"] = int(octaves is not None and bool(np.any(octaves)))
    fields["orders"] = choose_orders(source)
    if params.get("weights") is not None:
        fields["weights"] = [code_of(float(weight)) for weight in params["weights"]]
    fields["levels"] = params["levels"]
    if fields["levels"] is None:
        fields["levels"] = best_levels(source, skeleton, fields, weights)
    fields["borrowing"] = min(1, fields["levels"])
    return Choice(build_header(**fields), weights, keeper)


def moving_of(source: SignalSource) -> NDArray[np.bool_]:
    """Which channels change in the beginning of the clip, (n_channels,)."""
    n_frames = min(TRIAL_FRAMES, source.layout.n_frames, source.layout.most_frames)
    if not n_frames:
        return np.zeros(source.layout.n_channels, np.bool_)
    values = FrameReader(NAME, source).next(n_frames)
    found: NDArray[np.bool_] = values.max(axis=0) > values.min(axis=0)
    return found


def guess(target: str, limit: float) -> float | None:
    """A step in cm that comes near a mean error, or with which few frames miss a bound."""
    if target == "max_error_cm":
        limit *= MEAN_TO_BOUND
    elif target != "mean_error_cm":
        return None
    steps, errors = np.log(USUAL)
    place = min(max(math.log(limit), errors[0]), errors[-1])
    step = float(np.interp(place, errors, steps)) + math.log(limit) - place
    return math.exp(step)


def default_step(skeleton: Skeleton) -> float:
    """In length units: 0.5 mm where the unit is known."""
    if skeleton.unit_cm:
        return 0.05 / skeleton.unit_cm
    return (reach(skeleton) or 1.0) / 2000


def weights_of(step_cm: float) -> Weights:
    places = [math.log(step) for step in STEPS_CM]
    return Weights(COARSEST_WEIGHT, float(np.interp(math.log(step_cm), places, RATE_WEIGHTS)))


def _fields(skeleton: Skeleton, step: float, step_cm: float) -> dict[str, Any]:
    in_cm = step / step_cm  # length units a centimeter
    degree = math.pi / 180 if skeleton.angle_unit == "rad" else 1.0
    is_fine = step_cm <= FINE_CM
    return {
        "start": 0 if step_cm < COARSE_CM else 1,
        "refining": 0,
        "step": step,
        "radius": RADIUS_CM * in_cm,
        "shell": SHELL,
        "rotation": code_of(GREATEST_DEGREES * degree),
        "position": code_of(GREATEST_CM * in_cm),
        "first": 2 if is_fine else 0,
        "constant": 8 if is_fine else 6,
        "plain": [],
        "weights": [],
        "orders": [],
    }


def best_levels(
    source: SignalSource, skeleton: Skeleton, fields: Mapping[str, Any], weights: Weights
) -> int:
    """How many levels make the beginning of the clip smallest for what they get wrong."""
    layout = source.layout
    n_frames = min(TRIAL_FRAMES, layout.n_frames, layout.most_frames)
    if not layout.n_channels or n_frames < 1 << min(LEVELS):
        return min(LEVELS)
    values = FrameReader(NAME, source).next(n_frames)
    values = Orders(fields["orders"], skeleton).coded(values)

    def score(levels: int) -> float:
        header = parse_header(
            build_header(**{**fields, "levels": levels, "borrowing": min(1, levels)}), layout
        )
        streams, found = encode_coded(header, skeleton, values, weights)
        error = distortion(header, skeleton, values[::SAMPLED], found[::SAMPLED])
        return math.log(sum(map(len, streams))) + EXCHANGE * math.log(max(error, 1e-300))

    return min(LEVELS, key=score)


def distortion(header: Header, skeleton: Skeleton, values: Floats, found: Floats) -> float:
    """How far points and axes of decoded frames are off: a root of a mean square, about."""
    kept = (values != found).any(axis=0)
    if not kept.any():
        return 0.0
    metric = Metric(header, skeleton, kept, values[0])
    rows = metric.into(
        metric.factors(values[:, kept]), (found - values)[:, kept], np.arange(len(values))
    )
    return float(np.sqrt(np.mean(np.sum(rows * rows, axis=1))))
