"""The pose metric and axis orders in JavaScript, written from SPEC.md, give the same bits."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcz.angles import unwrap
from mcz.codecs.posewave.apply_kernels import out_of_metric
from mcz.codecs.posewave.metric_kernels import factor
from mcz.codecs.posewave.orders import SEQUENCES, Orders, own_sequence
from mcz.codecs.posewave.skeleton_plan import make_plan
from mcz.motion import CHANNEL_KINDS, Channel, Joint, Skeleton
from tests.codecs.test_posewave_metric import chain
from tests.codecs.test_posewave_orders import single, wandering
from tests.skeletons import skeletons, values_for

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="there is no node")

FOLDER = Path(__file__).parents[2] / "tools" / "js"
METRIC = """
import { readFileSync } from "node:fs";
import { PoseMetric } from "./pose-metric.js";

const hex = (numbers) => Buffer.from(numbers.buffer).toString("hex");
for (const line of readFileSync(0, "utf8").trim().split("\\n")) {
  const { skeleton, kept, reg, shell, values, rows } = JSON.parse(line);
  const metric = new PoseMetric(skeleton, kept, reg, shell);
  const factors = values.map((pose) => metric.factor(pose));
  const back = factors.map((entries, i) => metric.fromMetric(entries, rows[i]));
  console.log(JSON.stringify([factors.map(hex), back.map(hex)]));
}
"""
AXIS_ORDERS = """
import { readFileSync } from "node:fs";
import { AxisOrders } from "./axis-orders.js";
import { ByteReader } from "./bytes.js";

for (const line of readFileSync(0, "utf8").trim().split("\\n")) {
  const { skeleton, codes, stream, values } = JSON.parse(line);
  const orders = new AxisOrders(skeleton, codes);
  const reader = new ByteReader(Buffer.from(stream, "hex"), "stream");
  const notes = orders.takeNotes(reader, values.length);
  const all = Float64Array.from(values.flat());
  orders.restore(all, values[0].length, notes);
  console.log(JSON.stringify([Buffer.from(all.buffer).toString("hex"), reader.left]));
}
"""
ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
Case = tuple[list[Any], dict[str, Any]]


def as_javascript(skeleton: Skeleton) -> dict[str, Any]:
    joints = [
        {
            "parent": joint.parent,
            "offset": joint.offset,
            "axis": joint.axis,
            "axisOrder": ORDERS.index(joint.axis_order),
            "tails": joint.tails,
            "positionsAdd": joint.adds_to_offset,
            "firstColumn": skeleton.columns(index).start,
            "channels": [
                {"kind": CHANNEL_KINDS.index(c.kind) + 1 if c.kind else 0} for c in joint.channels
            ],
        }
        for index, joint in enumerate(skeleton.joints)
    ]
    return {
        "joints": joints,
        "channels": [channel for joint in joints for channel in joint["channels"]],
        "intrinsic": skeleton.intrinsic,
        "angleUnit": ("", "deg", "rad").index(skeleton.angle_unit),
    }


def case(skeleton: Skeleton, values: np.ndarray, seed: int) -> Case:
    """What Python gives of some poses, and what JavaScript is asked."""
    random = np.random.default_rng(seed)
    kept = random.random(skeleton.n_channels) < 0.9
    reg = random.choice([0.0, 1e-6, 1e-2], int(kept.sum()))
    weights = random.uniform(0, 3, skeleton.n_joints)
    rows = random.normal(size=(len(values), len(reg)))
    orders = [
        int(random.integers(0, 7)) if own_sequence(joint, skeleton) else 0
        for joint in skeleton.joints
    ]
    whole = bool(seed % 2)
    more = {"joint_weights": weights, "orders": orders, "whole": whole}
    plan = make_plan(skeleton, kept, reg, radius=0.7, kappa=0.3, **more)  # type: ignore[arg-type]
    factors = factor(plan, values)
    back = out_of_metric(plan, factors, rows, np.arange(len(rows)))
    return [[row.tobytes().hex() for row in array] for array in (factors, back)], {
        "skeleton": as_javascript(skeleton),
        "kept": np.flatnonzero(kept).tolist(),
        "reg": reg.tolist(),
        "shell": {
            "radius": 0.7,
            "kappa": 0.3,
            "whole": whole,
            "weights": weights.tolist(),
            "orders": orders,
        },
        "values": values.tolist(),
        "rows": rows.tolist(),
    }


def check(program: str, cases: list[Case]) -> None:
    done = subprocess.run(
        ["node", "--input-type=module", "-e", program],
        cwd=FOLDER,
        input="\n".join(json.dumps(asked) for _, asked in cases),
        capture_output=True,
        text=True,
        check=True,
    )
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert answers == [expected for expected, _ in cases]


def test_generated_skeletons() -> None:
    cases: list[Case] = []

    @settings(max_examples=100, database=None)
    @given(skeletons(), st.integers(0, 1000), st.sampled_from([1.0, 1.0, 1e4, 1e11]))
    def add(skeleton: Skeleton, seed: int, scale: float) -> None:
        cases.append(case(skeleton, values_for(skeleton, 2, seed) * scale, seed))

    add()
    for size in (0, 1, 40):  # 120 channels on a path of at most 96
        skeleton = chain(size) if size else Skeleton(())
        cases.append(case(skeleton, values_for(skeleton, 2), size))
    check(METRIC, cases)


def orders_case(skeleton: Skeleton, codes: list[int], source: np.ndarray, noise: float) -> Case:
    """Angles that Python decodes, coded ``noise`` turns off; the request for them."""
    orders = Orders(codes, skeleton)
    coded = orders.coded(source)
    coded += np.random.default_rng(len(source)).normal(0, noise, coded.shape) * orders.full
    notes, decoded = orders.notes_and_values(source, coded)
    return [decoded.tobytes().hex(), 2], {
        "skeleton": as_javascript(skeleton),
        "codes": codes,
        "stream": notes.hex() + "abcd",
        "values": coded.tolist(),
    }


def test_every_order() -> None:
    cases = []
    for unit in ("deg", "rad"):
        for number, own in enumerate(SEQUENCES):
            for code in range(1, 7):
                skeleton = single(own, unit, intrinsic=bool(code % 2))
                source = unwrap(wandering(unit, 60, 10 * number + code, 0.5), skeleton)
                source[:9, 2] = np.arange(9) * Orders([], skeleton).full / 4
                cases.append(orders_case(skeleton, [code], source, (0, 1e-3, 0.1)[code % 3]))
    check(AXIS_ORDERS, cases)


def test_several_joints() -> None:
    kinds = ("rz", "tx", "ry", "rx")
    channels = tuple(Channel(kind) for kind in kinds)
    joints = tuple(Joint(f"{n}", n - 1, (0.0, 1.0, 0.0), channels=channels) for n in range(3))
    skeleton = Skeleton(joints, angle_unit="deg", intrinsic=False)
    source = unwrap(np.concatenate([wandering("deg", 200, n) for n in range(3)], 1), skeleton)
    check(
        AXIS_ORDERS,
        [orders_case(skeleton, [3, 0, 5], source, 1e-3), orders_case(skeleton, [], source, 0.0)],
    )


def test_huge_angles() -> None:
    skeleton = single((2, 1, 0), "deg")
    source = unwrap(wandering("deg", 50, 5), skeleton) * 1e7
    source[3:9] = 2.0**39 * np.array([1, 0.3, -1, 0.7])
    check(AXIS_ORDERS, [orders_case(skeleton, [4], source, 1e12)])
