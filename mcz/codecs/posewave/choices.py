"""Encoder choices of ``posewave`` before the first segment.

mcz/codecs/posewave/README.md describes it; decoders do not need it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mcz.codecs.contract import SignalSource
from mcz.codecs.parameters import code_of
from mcz.codecs.posewave.contact_choice import choose_contacts, runs_of
from mcz.codecs.posewave.contact_plan import ContactsFields
from mcz.codecs.posewave.contacts import ContactTracker
from mcz.codecs.posewave.exact_channels import partition
from mcz.codecs.posewave.header import (
    DEPENDENT,
    MAX_FINE,
    NAME,
    REFINING,
    SPREADS,
    START_TABLES,
    VECTORS,
    WHOLE_TURNS,
    Header,
    PosewaveHeader,
    build_header,
    has_whole_turns,
    joint_codes,
    order_settings,
    parse_posewave_header,
)
from mcz.codecs.posewave.model import number_of
from mcz.codecs.posewave.orders import N_NOTES, Orders, choose_orders
from mcz.codecs.posewave.segment import Weights, encode_coded
from mcz.codecs.posewave.skeleton_plan import has_kinematics
from mcz.codecs.segments import sample, skeleton_of
from mcz.codecs.source_readers import FrameReader
from mcz.errors import MotionError, OptionError
from mcz.hints import Hint
from mcz.kinematics.chain import chain_of
from mcz.kinematics.points import reach
from mcz.model.motion import ANGLE_KINDS, POSITION_KINDS, QUATERNION_KINDS, ROTATION_KINDS, Skeleton
from mcz.model.schema import parse
from mcz.model.text_format import named
from mcz.model.types import Floats, Params, Settings

# The greatest error of a point in any frame that a preset promises, in cm.
PRESETS = {"mm": 0.1, "visible": 0.5, "preview": 3.0}
RADIUS_CM = 3.0  # of the shell, as ACL measures it
PROPORTION = 1 / 30  # of the shell to the skeleton where the unit is unknown: 3 cm of 90 cm
GREATEST_DEGREES = 4.8  # fine steps beyond which the metric is meaningless
GREATEST_FROM_CM = 0.03  # from this step on they are coarser
SHELL = 8  # sixteenths
DEPENDENT_STEP = 1.2  # steps of dependent quantization that err as a plain one does
DEPENDENT_PRICE = 0.8  # of a bit, in its squared steps, beside that of plain quantization
FINE_SPREAD, COARSE_SPREAD = 2, 3  # octaves above 2^-10
COARSE_CM = 0.065  # from this step on the second start table is nearer
SHARE_OF_CONSTANT = 0.25  # of a step: greatest effect of a constant channel on points
SPREAD_CM = 2.0  # a step of this size equals the spread of a plain channel
SAMPLED_FRAMES = 128  # for measuring it
FINE_CM = 0.08  # below this step first poses are coded more precisely
SPATIAL = (*ROTATION_KINDS, *POSITION_KINDS)
LEVELS = (  # step below which they are tried, levels, frames for it
    (0.06, (2, 3, 4, 5), 1024),
    (0.2, (3, 4, 5, 6), 1024),
    (math.inf, (4, 5, 6, 7), 2048),
)
PLAIN_TRIALS_CM = 0.2  # steps below which levels are tried with plain quantization
SAMPLE_DISTANCE = 8  # frames between measured ones in a trial
EXCHANGE = 0.75  # fall of bytes per rise of errors, in logarithms, for comparing trials
STEPS_CM = 0.01, 0.045  # between these steps the weight of a bit goes from the first to the second
RATE_WEIGHTS = 0.072, 0.112
USUAL = (  # steps, mean errors
    (0.0045, 0.009, 0.018, 0.036, 0.07, 0.14, 0.28, 0.56, 1.2, 2.6),
    (0.0083, 0.0158, 0.0297, 0.0516, 0.0851, 0.131, 0.202, 0.322, 0.556, 1.01),
)
MEAN_TO_BOUND = 0.2  # the mean error with which a bound takes few bytes and trials
STEP_OF_BOUND = 0.2  # live, where rows of frames that are farther off get finer ones
CONTACT_TOLERANCES_CM = 0.01, 0.05  # between which it is the step
COARSEST_WEIGHT = 0.096  # of a bit at level 0, whose errors affect later rows


@dataclass(frozen=True, slots=True)
class Choice:
    """The header of a clip, the weight of a bit against a squared step, contacts to keep.

    ``frame_bytes`` is an estimate of the bytes of a frame, 0 if there is none.
    """

    header: bytes
    weights: Weights
    tracker: ContactTracker | None = None
    frame_bytes: float = 0.0


def choose(source: SignalSource, params: Params) -> Choice:
    """Raises MotionError for values that cannot be coded."""
    skeleton = skeleton_of(NAME, source.layout)
    unit = skeleton.unit_cm
    step = default_step(skeleton) if params["step"] is None else params["step"] / (unit or 1.0)
    # With the unit unknown, a skeleton of 90 cm is assumed: only ratios follow from it.
    step_cm = step * (unit or RADIUS_CM / PROPORTION / _extent(skeleton))
    weights = weights_of(step_cm)
    fields = _header_fields(skeleton, step, step_cm)
    limits = params.get("limits")
    spreads = _sampled_spreads(source, skeleton) if limits is None else limits
    fields |= _plain_steps(skeleton, spreads, step_cm, turning=limits is None)
    if limits is not None:
        fields |= _greatest_steps(skeleton, fields, limits, step_cm)
    octaves = params.get("refinement")
    if octaves is not None and np.any(octaves):
        fields["flags"] |= REFINING
    groups = partition(skeleton, params)
    fields["exact"] = groups[1] if groups else ()
    exact = {channel for group in fields["exact"] for channel in source.layout.groups[group]}
    like = None if params.get("like") is None else parse(PosewaveHeader, params["like"], NAME)
    if like:
        vectors, fields["orders"] = like.flags & VECTORS, like.orders
    else:
        vectors, fields["orders"] = order_settings(choose_orders(NAME, source, exact), skeleton)
    fields["flags"] |= vectors
    if params.get("weights") is not None:
        fields["weights"] = [code_of(float(weight)) for weight in params["weights"]]
    fields["levels"], frame_bytes = like.levels if like else params["levels"], 0.0
    if fields["levels"] is None:
        fields["levels"], frame_bytes = best_levels(source, skeleton, fields, weights, step_cm)
    fields["borrowing"] = min(1, fields["levels"])
    fields["contacts"], tracker = _contacts(source, params, step, step / step_cm)
    return Choice(build_header(**fields), weights, tracker, frame_bytes)


def _contacts(
    source: SignalSource, params: Params, step: float, in_cm: float
) -> tuple[list[ContactsFields], ContactTracker | None]:
    """Choose the contacts and their tracker; ``in_cm``: length units per centimeter."""
    if not params.get("contacts") or not source.layout.n_frames:
        return [], None
    if params.get("lossless"):
        raise OptionError(f"{NAME}: contacts and lossless exclude each other")
    skeleton, rate = skeleton_of(NAME, source.layout), source.layout.frame_rate
    if skeleton.unit_cm is None:
        raise OptionError(
            f"contacts: the length unit of {named('skeleton', skeleton.name)} is unknown, but the "
            "tolerance is in cm",
            hint=Hint.UNIT,
        )
    asked, (least, most) = params["contact_tolerance"], CONTACT_TOLERANCES_CM
    tolerance = min(max(step, least * in_cm), most * in_cm) if asked is None else asked * in_cm
    runs = runs_of(source, params["contacts"])
    chosen = choose_contacts(skeleton, runs, tolerance, None if rate is None else float(rate))
    return ([chosen.fields], ContactTracker(tolerance, chosen.pieces)) if chosen else ([], None)


def live_choice(skeleton: Skeleton, step: float | None, bound_cm: float | None) -> Choice:
    """Choose settings for live frames; ``step`` in cm, derived from the bound if None.

    Raises OptionError for a bound in cm with an unknown unit.
    """
    unit = skeleton.unit_cm
    if step is None:
        if bound_cm is None or not unit or not has_kinematics(skeleton, whole=True):
            raise OptionError(f"{NAME}: lengths in cm are unknown, so a step must be given")
        step = STEP_OF_BOUND * bound_cm
    own = step / (unit or 1.0)
    step_cm = own * (unit or RADIUS_CM / PROPORTION / _extent(skeleton))
    fields = _header_fields(skeleton, own, step_cm)
    fields |= _plain_steps(skeleton, np.ones(skeleton.n_channels), step_cm)
    fields |= {"levels": 0, "borrowing": 0}
    fields["start"] |= 1
    if bound_cm is not None:
        fields["flags"] |= REFINING
    return Choice(build_header(**fields), weights_of(step_cm))


def guess_step(target: str, limit: float) -> float | None:
    """A step in cm near a mean error, or with which few frames miss a bound."""
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
    return _extent(skeleton) / 2000


def _extent(skeleton: Skeleton) -> float:
    """The reach of a skeleton; 1 without one, or beyond the range of floats."""
    extent = reach(skeleton)
    return extent if 0 < extent < math.inf else 1.0


def weights_of(step_cm: float) -> Weights:
    places = [math.log(step) for step in STEPS_CM]
    return Weights(COARSEST_WEIGHT, float(np.interp(math.log(step_cm), places, RATE_WEIGHTS)))


def _header_fields(skeleton: Skeleton, step: float, step_cm: float) -> Settings:
    in_cm = step / step_cm  # length units a centimeter
    degree = math.pi / 180 if skeleton.angle_unit == "rad" else 1.0
    first = 2 if step_cm <= FINE_CM else 1
    return {
        "start": (0 if step_cm < COARSE_CM else 1) + START_TABLES * number_of(skeleton),
        "flags": DEPENDENT + (WHOLE_TURNS if has_whole_turns(skeleton) else 0),
        "step": step * DEPENDENT_STEP,
        "radius": RADIUS_CM * in_cm,
        "shell": SHELL + SPREADS * (FINE_SPREAD if step_cm < 0.1 else COARSE_SPREAD),
        "rotation": code_of(greatest_degrees(step_cm) * degree),
        "position": code_of(greatest_cm(step_cm) * in_cm),
        "first": first,
        "constant": _halvings(skeleton, step, step_cm) - first,
        "plain": [],
        "weights": [],
        "orders": [],
        "exact": [],
    }


def greatest_degrees(step_cm: float) -> float:
    """The greatest step of an angle, which grows with coarse steps."""
    return GREATEST_DEGREES * math.pow(max(step_cm / GREATEST_FROM_CM, 1.0), 0.72)


def greatest_cm(step_cm: float) -> float:
    """The greatest step of a position in cm, which grows with coarse steps."""
    return greatest_degrees(step_cm) * (5.0 if step_cm < 0.1 else 0.5)


def _halvings(skeleton: Skeleton, step: float, step_cm: float) -> int:
    """From the greatest steps to those with which a constant channel moves no point by a step."""
    degrees = greatest_degrees(step_cm)
    moved = max(greatest_cm(step_cm) * step / step_cm, math.radians(degrees) * reach(skeleton))
    needed = min(max(moved / (SHARE_OF_CONSTANT * step), 1.0), 2.0**MAX_FINE)
    return max(math.ceil(math.log2(needed)), 6)


def _sampled_spreads(source: SignalSource, skeleton: Skeleton) -> Floats:
    """The deviation of each channel from its mean, (n_channels,); 0 if unknown or of no use."""
    spatial = _spatial_kinds(skeleton)
    plain = (channel.kind not in spatial for channel in skeleton.channels)
    if has_kinematics(skeleton, whole=True) and not any(plain):
        return np.zeros(skeleton.n_channels)
    rows = sample(source, SAMPLED_FRAMES)
    known = np.isfinite(rows)
    n = np.maximum(known.sum(axis=0), 1)
    means = np.where(known, rows, 0.0).sum(axis=0) / n
    with np.errstate(over="ignore"):  # values that are refused later
        spreads: Floats = np.sqrt((np.where(known, rows - means, 0.0) ** 2).sum(axis=0) / n)
    return spreads


def _spatial_kinds(skeleton: Skeleton) -> tuple[str, ...]:
    """Kinds of channels that are in the metric of a skeleton that moves points."""
    return (*ANGLE_KINDS, *POSITION_KINDS) if has_whole_turns(skeleton) else SPATIAL


def _plain_steps(
    skeleton: Skeleton, spreads: Floats, step_cm: float, *, turning: bool = True
) -> Settings:
    """Steps of channels that move no point: a share of their spread, (n_channels,).

    ``turning``: mask of quaternions that move points, whose steps are of angles instead.
    """
    share = step_cm / SPREAD_CM
    kinds = [channel.kind for channel in skeleton.channels]

    def code(some: tuple[str, ...]) -> int:
        own = [s for kind, s in zip(kinds, spreads, strict=True) if kind in some and s > 0]
        return code_of(float(np.median(own)) * share) if own else code_of(1.0)

    is_chained = has_kinematics(skeleton, whole=True)
    spatial = _spatial_kinds(skeleton)
    of_quaternions = code_of(math.radians(GREATEST_DEGREES) / 2)
    plain = [
        of_quaternions
        if is_chained and turning and kind in QUATERNION_KINDS
        else code_of(float(spread) * share)
        if spread > 0
        else code_of(1.0)
        for kind, spread in zip(kinds, spreads, strict=True)
        if kind not in spatial
    ]
    if is_chained:
        return {"plain": plain}
    return {
        "plain": plain,
        "rotation": code(ANGLE_KINDS),
        "position": code(POSITION_KINDS),
    }


def _greatest_steps(skeleton: Skeleton, fields: Params, limits: Floats, step_cm: float) -> Settings:
    """Steps of angles and positions with which each channel keeps a limit, (n_channels,)."""
    kinds = np.array([channel.kind for channel in skeleton.channels])
    steps = {}
    for name, some in (("rotation", ANGLE_KINDS), ("position", POSITION_KINDS)):
        own = limits[np.isin(kinds, some)]
        if len(own):
            steps[name] = min(fields[name], code_of(float(own.min()) * step_cm / SPREAD_CM))
    return steps


def best_levels(
    source: SignalSource, skeleton: Skeleton, fields: Params, weights: Weights, step_cm: float
) -> tuple[int, float]:
    """Number of levels with the best rate-distortion over the start of the clip.

    Also the bytes of a frame there, 0 if nothing was tried.
    """
    layout = source.layout
    counts, most_frames = next(row[1:] for row in LEVELS if step_cm < row[0])
    n_frames = min(most_frames, layout.n_frames, layout.most_frames)
    if len(fields["exact"]) == len(layout.groups) or n_frames < 1 << min(counts):
        return min(counts), 0.0
    values = FrameReader(NAME, source).next(n_frames)
    orders = Orders(joint_codes(fields["flags"], fields["orders"], skeleton), skeleton)
    coded = orders.to_coded_order(values)
    no_notes = np.zeros((-(-n_frames // SAMPLE_DISTANCE), len(orders.places), N_NOTES), np.int64)
    if step_cm < PLAIN_TRIALS_CM:  # plain quantization ranks levels alike, in half the time
        plain = {"flags": fields["flags"] & ~DEPENDENT, "step": fields["step"] / DEPENDENT_STEP}
        fields, price = {**fields, **plain}, DEPENDENT_PRICE
        weights = Weights(weights.approximations / price, weights.details / price)

    sizes: dict[int, int] = {}

    def score(levels: int) -> float:
        own = {"levels": levels, "borrowing": min(1, levels)}
        header = parse_posewave_header(build_header(**{**fields, **own}), layout)
        streams, decoded = encode_coded(header, skeleton, coded, weights)
        decoded = orders.values(decoded[::SAMPLE_DISTANCE], no_notes)
        decoded[:, header.exact] = values[::SAMPLE_DISTANCE, header.exact]
        error = distortion(header, skeleton, values[::SAMPLE_DISTANCE], decoded)
        sizes[levels] = sum(map(len, streams))
        return math.log(sizes[levels]) + EXCHANGE * math.log(max(error, 1e-300))

    levels = _minimize(counts, score)
    return levels, sizes[levels] / n_frames


def _minimize(counts: Sequence[int], score: Callable[[int], float]) -> int:
    """The item with the lowest score; scores fall, then rise."""
    scores = [score(counts[k]) for k in (1, 2)]
    at, way = (2, 1) if scores[1] < scores[0] else (1, -1)
    lowest = min(scores)
    while 0 <= at + way < len(counts):
        value = score(counts[at + way])
        if value >= lowest:
            break
        at, lowest = at + way, value
    return counts[at]


def distortion(header: Header, skeleton: Skeleton, values: Floats, decoded: Floats) -> float:
    """Mean error of joints and points on their axes, weighted by joint."""
    try:
        chain = chain_of(skeleton)
    except MotionError:  # without a known angle unit: by channel
        return float(np.mean(np.abs(values - decoded) / header.greatest)) * header.step
    away = []
    for (_, _, ours), (_, _, theirs) in zip(chain.poses(values), chain.poses(decoded), strict=True):
        for joint in range(skeleton.n_joints):
            moved = (ours.origins[joint] - theirs.origins[joint])[:, None]
            turned = header.radius * (ours.axes[joint] - theirs.axes[joint])
            points = moved + np.pad(turned, ((0, 0), (1, 0), (0, 0)))
            mean = float(np.sqrt(np.sum(points * points, axis=0)).mean())
            away.append(mean * math.sqrt(header.weights[joint]))
    return float(np.mean(away)) if away else 0.0
