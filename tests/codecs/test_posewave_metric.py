"""The pose metric of posewave: against numeric Jacobians, its factor, and its odd cases."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mcz.codecs.posewave.apply_kernels import into_metric, out_of_metric
from mcz.codecs.posewave.metric_kernels import factor
from mcz.codecs.posewave.skeleton_plan import MAX_PATH, Plan, make_plan
from mcz.codecs.posewave.turns import RULES, sine_cosine
from mcz.kinematics.chain import chain_of
from mcz.kinematics.points import points_of, positions_of
from mcz.motion import POSITION_KINDS, ROTATION_KINDS, TURNING_KINDS, Channel, Joint, Skeleton
from tests.skeletons import skeletons, values_for

TURNING = tuple(Channel(kind) for kind in ROTATION_KINDS)
MOVING = tuple(Channel(kind) for kind in POSITION_KINDS)
METRIC_KINDS = (*POSITION_KINDS, *ROTATION_KINDS)
KAPPA, RADIUS = 0.4, 1.5


def plan_of(skeleton: Skeleton, added: float = 1e-3, **options: object) -> Plan:
    """All channels kept."""
    n = skeleton.n_channels
    given = {"radius": RADIUS, "kappa": KAPPA, **options}
    return make_plan(skeleton, np.ones(n, np.bool_), np.full(n, added), **given)  # type: ignore[arg-type]


def into(plan: Plan, factors: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Each row by the factor of its own number."""
    return into_metric(plan, factors, rows, np.arange(len(rows)))


def out_of(plan: Plan, factors: np.ndarray, rows: np.ndarray) -> np.ndarray:
    return out_of_metric(plan, factors, rows, np.arange(len(rows)))


def dense(plan: Plan, factors: np.ndarray, pose: int = 0) -> np.ndarray:
    """R of a pose, (n_kept, n_kept)."""
    entries = factors[pose]
    result = np.zeros((plan.n_kept, plan.n_kept))
    for number, (start, stop) in enumerate(zip(plan.starts, plan.starts[1:], strict=False)):
        root = 1.0 / entries[stop - 1]
        result[number, plan.path[start : stop - 1]] = root * entries[start : stop - 1]
        result[number, number] = root
    return result


def metric_of(plan: Plan, values: np.ndarray) -> np.ndarray:
    """G of a single pose, (n_kept, n_kept), its regularization taken off."""
    root = dense(plan, factor(plan, values[None]))
    product: np.ndarray = root.T @ root
    return product - np.diag(plan.regularization)


def plain_pose(skeleton: Skeleton, values: np.ndarray, whole: bool) -> np.ndarray:
    """``values`` (n, n_channels) with scales of 1, lengths of 0; whole turns as asked for."""
    neutral = {"q": 0.0, "qw": 1.0, "v": 0.0, "s": 1.0, "l": 0.0}
    result = values.copy()
    for column, kind in enumerate(channel.kind for channel in skeleton.channels):
        if kind and kind not in METRIC_KINDS and not (whole and kind in TURNING_KINDS):
            result[:, column] = neutral.get(kind, neutral.get(kind[0], 0.0))
    return result


def weighted_points(
    skeleton: Skeleton, values: np.ndarray, weights: np.ndarray, whole: bool
) -> tuple[np.ndarray, np.ndarray]:
    """All points and shell points, (n, n_points + 3 n_joints, 3), and the weight of each."""
    values = plain_pose(skeleton, values, whole)
    points = positions_of(skeleton, values)
    chain = chain_of(skeleton)
    shells = []
    pose = chain.pose(np.ascontiguousarray(values.T))
    for joint, (origin, axes) in enumerate(zip(pose.origins, pose.axes, strict=True)):
        frame = chain.turned[joint]
        back = np.eye(3) if frame is None else frame.T
        world = np.einsum("ikf,kl->fil", np.broadcast_to(axes, (3, 3, len(values))), back)
        shells += [origin.T + RADIUS * world[:, :, k] for k in range(3)]
    owners = [j for j, own in enumerate(points_of(skeleton)) for _ in own]
    heavy = (1 - KAPPA) / len(owners) * weights[owners]
    light = np.repeat(KAPPA / (3 * skeleton.n_joints) * weights, 3)
    return np.concatenate([points, np.stack(shells, 1)], 1), np.concatenate([heavy, light])


def numeric(
    skeleton: Skeleton,
    values: np.ndarray,
    weights: np.ndarray | None = None,
    *,
    whole: bool = False,
) -> np.ndarray:
    """G of a pose by central differences, (n_channels, n_channels); 0 where it is plain."""
    weights = np.ones(skeleton.n_joints) if weights is None else weights
    n = skeleton.n_channels
    degrees = [c.kind[:1] != "q" and skeleton.angle_unit == "deg" for c in skeleton.channels]
    step = np.where(degrees, 2e-3, 3e-5)
    steps = np.diag(step)
    ends, heavy = weighted_points(
        skeleton, np.concatenate([values + steps, values - steps]), weights, whole
    )
    slopes = (ends[:n] - ends[n:]) / (2 * step[:, None, None])
    own = (*METRIC_KINDS, *TURNING_KINDS) if whole else METRIC_KINDS
    kinds = np.array([channel.kind in own for channel in skeleton.channels], np.bool_)
    slopes[~kinds] = 0.0
    result: np.ndarray = np.einsum("cpi,dpi,p->cd", slopes, slopes, heavy)
    return result


def assert_near(found: np.ndarray, expected: np.ndarray, share: float = 3e-7) -> None:
    assert np.abs(found - expected).max(initial=0.0) <= share * (
        1 + np.abs(expected).max(initial=0.0)
    )


@given(skeletons(), st.integers(0, 1000), st.booleans())
def test_metric_is_that_of_numeric_jacobians(skeleton: Skeleton, seed: int, whole: bool) -> None:
    values = values_for(skeleton, 1, seed)[0]
    weights = np.random.default_rng(seed).uniform(0.1, 5, skeleton.n_joints)
    plan = plan_of(skeleton, joint_weights=weights, whole=whole)
    expected = numeric(skeleton, values, weights, whole=whole)
    assert_near(metric_of(plan, values), expected, 3e-6 if whole else 3e-7)


@given(skeletons(), st.integers(1, 20), st.integers(0, 1000))
def test_rows_come_back(skeleton: Skeleton, n_poses: int, seed: int) -> None:
    plan = plan_of(skeleton, 1e-4)
    factors = factor(plan, values_for(skeleton, n_poses, seed))
    rows = np.random.default_rng(seed).normal(size=(n_poses, plan.n_kept))
    inside = into(plan, factors, rows)
    expected = [dense(plan, factors, pose) @ row for pose, row in enumerate(rows)]
    assert_near(inside, np.array(expected), 1e-12)
    assert_near(out_of(plan, factors, inside), rows, 1e-9)


def test_worked_example() -> None:
    """As SPEC.md has it."""
    hip = Joint("hip", channels=tuple(Channel(kind) for kind in "tx ty tz rz rx".split()))
    knee = Joint("knee", 0, (0.0, -4.0, 0.5), ((0.0, -3.0, 0.0),), (10.0, 20.0, 30.0), "XYZ")
    knee = replace(knee, channels=tuple(Channel(kind) for kind in "ry rx".split()))
    kept = np.array([1, 1, 0, 1, 1, 1, 1], np.bool_)
    plan = make_plan(Skeleton((hip, knee)), kept, np.full(6, 0.001), radius=3.0, kappa=0.5)
    factors = factor(plan, np.array([[1.0, 90.0, 2.0, 30.0, -40.0, 10.0, 100.0]]))
    assert factors[0].tolist() == EXAMPLE
    row = out_of(plan, factors, np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]]))
    assert row[0].tolist() == EXAMPLE_ROW


def chain(n_joints: int, own: tuple[Channel, ...] = TURNING, **more: object) -> Skeleton:
    """One joint below the other."""
    joints = [Joint(f"{n}", n - 1, (0.3, 1.0, -0.2), (), channels=own) for n in range(n_joints)]
    joints[-1] = replace(joints[-1], tails=((0.0, 1.0, 0.0),))
    return Skeleton(tuple(joints), **more)  # type: ignore[arg-type]


def test_long_paths_are_cut_at_joints() -> None:
    skeleton = chain(50)
    plan = plan_of(skeleton)
    lengths = np.diff(plan.starts)
    assert lengths.max() == MAX_PATH
    assert lengths[: MAX_PATH + 1].tolist() == [*range(1, MAX_PATH + 1), 1]
    values = values_for(skeleton, 1)[0] * 0.3
    expected = numeric(skeleton, values)
    block = np.arange(150) // MAX_PATH
    expected[block[:, None] != block] = 0.0
    assert_near(metric_of(plan, values), expected)


LARGE = st.sampled_from([0.0, 1.0, -3e11, 1e12, -1.1e12, 5e15, 1e300, -1e308, 1e-300])
WILD = st.tuples(LARGE, LARGE, LARGE)


@settings(max_examples=60)
@given(st.data())
def test_huge_numbers_give_numbers(data: st.DataObject) -> None:
    kinds = st.lists(st.sampled_from([*MOVING, *TURNING]), max_size=7).map(tuple)
    joints = [
        Joint(
            f"{n}",
            n - 1,
            data.draw(WILD),
            (data.draw(WILD),),
            data.draw(WILD),
            channels=data.draw(kinds),
            adds_to_offset=data.draw(st.booleans()),
        )
        for n in range(data.draw(st.integers(1, 12)))
    ]
    skeleton = Skeleton(tuple(joints), angle_unit=data.draw(st.sampled_from(["deg", "rad"])))
    added = data.draw(st.sampled_from([0.0, 1e-9, 1.0, 1e300]))
    weights = np.full(len(joints), data.draw(st.sampled_from([0.0, 1.0, 1e300])))
    plan = plan_of(skeleton, added, radius=data.draw(LARGE), joint_weights=weights)
    wild = st.sampled_from([0.0, 7.0, 1e5, 1e11, -2e11, 1e300, np.inf, -np.inf, np.nan])
    n = skeleton.n_channels
    values = np.array(data.draw(st.lists(wild, min_size=n, max_size=n)), np.float64)
    factors = factor(plan, values[None])
    assert np.isfinite(factors).all()
    assert (factors[0, plan.starts[1:] - 1] > 0).all()
    rows = np.array([[1e150, -1e150][k % 2] for k in range(n)], np.float64)[None]
    assert np.isfinite(out_of(plan, factors, rows)).all()
    assert np.isfinite(into(plan, factors, 1e-140 * rows)).all()


@given(
    st.floats(-(2**40), 2**40, exclude_min=True, exclude_max=True), st.sampled_from(["deg", "rad"])
)
def test_sine_and_cosine(angle: float, unit: str) -> None:
    if unit == "rad" and abs(angle) > 1.6e6:
        angle = angle % 1e6
    sine, cosine = sine_cosine(angle, RULES[unit])
    exact = np.radians(np.fmod(angle, 360.0)) if unit == "deg" else angle
    assert abs(sine - np.sin(exact)) < 1e-12
    assert abs(cosine - np.cos(exact)) < 1e-12


EXAMPLE = [
    1.0973520013442857,
    -0.021810194362063346,
    1.1226982177077387,
    5.206724587509656,
    4.503222518161679,
    16.354191908995503,
    3.0391725169259223,
    -5.024822825980067,
    0.02265737589732067,
    14.02408529556312,
    -1.893320796389913,
    -1.2347879109604658,
    -0.3025983176057028,
    -0.2795767522456736,
    22.943105458050226,
    -2.88102751904688,
    -0.5444596060704099,
    -0.5051817387899982,
    0.3601410426354744,
    0.020250218127484444,
    23.48567792514303,
]
EXAMPLE_ROW = [
    1.0973520013442857,
    2.2693298958483954,
    33.1296685923123,
    63.41364844406157,
    147.34927163563896,
    136.22591855143898,
]
