"""Axis orders in JavaScript, written from SPEC.md alone, give the same bits."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcz.angles import unwrap
from mcz.codecs.posewave.orders import SEQUENCES, Orders
from mcz.motion import Channel, Joint, Skeleton
from tests.codecs.test_posewave_orders import single, wandering
from tests.codecs.test_posewave_twin import as_javascript

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="there is no node")

FOLDER = Path(__file__).parents[2] / "tools" / "js"
PROGRAM = """
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
Case = tuple[list[Any], dict[str, Any]]


def case(skeleton: Skeleton, codes: list[int], source: np.ndarray, noise: float) -> Case:
    """What Python makes of coded angles that are off by ``noise`` turns; what is asked."""
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


def check(cases: list[Case]) -> None:
    done = subprocess.run(
        ["node", "--input-type=module", "-e", PROGRAM],
        cwd=FOLDER,
        input="\n".join(json.dumps(asked) for _, asked in cases),
        capture_output=True,
        text=True,
        check=True,
    )
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert answers == [expected for expected, _ in cases]


def test_every_order() -> None:
    cases = []
    for unit in ("deg", "rad"):
        for number, own in enumerate(SEQUENCES):
            for code in range(1, 7):
                skeleton = single(own, unit, intrinsic=bool(code % 2))
                source = unwrap(wandering(unit, 60, 10 * number + code, 0.5), skeleton)
                source[:9, 2] = np.arange(9) * Orders([], skeleton).full / 4
                cases.append(case(skeleton, [code], source, (0, 1e-3, 0.1)[code % 3]))
    check(cases)


def test_several_joints() -> None:
    kinds = ("rz", "tx", "ry", "rx")
    channels = tuple(Channel(kind) for kind in kinds)
    joints = tuple(Joint(f"{n}", n - 1, (0.0, 1.0, 0.0), channels=channels) for n in range(3))
    skeleton = Skeleton(joints, angle_unit="deg", intrinsic=False)
    source = unwrap(np.concatenate([wandering("deg", 200, n) for n in range(3)], 1), skeleton)
    check([case(skeleton, [3, 0, 5], source, 1e-3), case(skeleton, [], source, 0.0)])


def test_huge_angles() -> None:
    skeleton = single((2, 1, 0), "deg")
    source = unwrap(wandering("deg", 50, 5), skeleton) * 1e7
    source[3:9] = 2.0**39 * np.array([1, 0.3, -1, 0.7])
    check([case(skeleton, [4], source, 1e12)])
