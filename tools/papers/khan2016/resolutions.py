"""Distortion and bytes read of a clip without its finest details."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import mcz
from mcz.bench.cases import Case, Variant, load
from mcz.bench.measure import Record, write_file
from mcz.kinematics.angles import unwrap


def resolutions(case: Case, variant: Variant, params: Mapping[str, Any], joint: str) -> Record:
    """MSE of a joint's first channel, and bytes read, with the finest details left out."""
    motion = load(case).motion
    skeleton = motion.skeleton
    column = skeleton.columns(skeleton.find(joint))[0]
    wanted = unwrap(np.asarray(motion.values, np.float64), skeleton)[:, column]
    data = write_file(motion, variant.codec, variant.options(params))
    rows = []
    with mcz.open(data) as file:
        n_resolutions = file.only_clip().signals[0].counts.n_resolutions
    for resolution in range(n_resolutions):
        values, of_joint = _read_counted(data, resolution, [joint])
        _, of_all = _read_counted(data, resolution, None)
        error = float(np.mean((values[:, 0] - wanted) ** 2))
        row = {"resolution": resolution, "mse": error}
        rows.append(row | {"bytes_read_joint": of_joint, "bytes_read_all": of_all})
    return {"file_bytes": len(data), "rows": rows}


def _read_counted(data: bytes, resolution: int, joints: list[str] | None) -> tuple[Any, int]:
    """Values, and the bytes that were read for them."""
    with mcz.open(data) as file:
        before = file.container.source.n_bytes
        values = file.only_clip().read(joints=joints, resolution=resolution)
        return values, file.container.source.n_bytes - before
