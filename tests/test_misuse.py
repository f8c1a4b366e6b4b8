"""Wrong arguments to public functions: an MczError, never an error out of the depths."""

from __future__ import annotations

import inspect
import pickle
import shutil
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from tests.motions import smooth

WRONG: list[Any] = [
    None, True, -1, 10**30, 1.5, float("nan"), float("inf"), "", "nobody", b"x", (), (1, 2, 3), [],
    ["nobody"], [None], {}, {"a": 1}, {1}, object(), np.zeros(3), np.zeros((2, 2)),
    slice(None, None, 2), slice("a", None), np.ma.masked, 1j,
]  # fmt: skip
MOTION = smooth(12)
MOVING = {
    "accelerations": (MOTION,),
    "compare": (MOTION, MOTION),
    "contacts": (MOTION, ["knee"]),
    "convert": (MOTION, "bvh"),
    "in_positions": (MOTION,),
    "joint_map": ("cmu-amc", "cmu-bvh"),
    "left_out": (MOTION, "bvh"),
    "mirror": (MOTION,),
    "point_names": (MOTION,),
    "positions": (MOTION,),
    "post_filter": (mcz.in_positions(MOTION), 60),
    "recording": (MOTION,),
    "rename": (MOTION, {"hips": "hip"}),
    "resample": (MOTION, 60),
    "rest_positions": (MOTION.skeleton,),
    "retarget": (MOTION, MOTION.skeleton),
    "root": (MOTION,),
    "rotations": (MOTION,),
    "select": (MOTION, "hips"),
    "times": (MOTION,),
    "to_glb": (MOTION,),
    "to_pandas": (MOTION,),
    "to_usda": (MOTION,),
    "to_xarray": (MOTION,),
    "velocities": (MOTION,),
}


def faults_of(name: str, arguments: tuple[Any, ...], wrong: list[Any] = WRONG) -> list[str]:
    """The wrong arguments of a function that raise no MczError."""
    function: Callable[..., Any] = getattr(mcz, name)
    given = inspect.signature(function).bind(*arguments).arguments
    found = []
    for parameter in inspect.signature(function).parameters:
        for thing in wrong:
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    function(**{**given, parameter: thing})
            except mcz.MczError:
                continue
            except Exception as error:
                found.append(f"{name}({parameter}={thing!r:.40}): {error!r}")
    return found


@pytest.mark.parametrize("name", MOVING)
def test_functions_of_motions(name: str) -> None:
    getattr(mcz, name)(*MOVING[name])
    assert faults_of(name, MOVING[name]) == []


def test_functions_of_files(tmp_path: Path) -> None:
    """Each on files that are there, with wrong arguments; what they write is in the folder."""
    few = [None, True, -1, float("nan"), "nobody", [None], {"a": 1}, object(), np.zeros(3)]
    source, target, out = tmp_path / "a.bvh", tmp_path / "a.mcz", tmp_path / "out"
    mcz.write(MOTION, target)
    mcz.export(target, tmp_path, to="bvh")
    source = next(tmp_path.glob("*.bvh"))
    arguments = {
        "bag": ([target], out),
        "check_bag": (out,),
        "dataset": (target,),
        "delete_clips": (target, "smooth"),
        "encode": (source, out),
        "extract": (target, out),
        "merge": ([target], out),
        "open": (target,),
        "read": (source,),
        "rename_clips": (target, {"smooth": "x"}),
        "reorder_clips": (target, ()),
        "repair": (target, out),
        "set_metadata": (target, {"smooth": {"subject": "7"}}),
        "set_rate": (target, 60),
        "to_npz": (MOTION, out),
        "unpack": (target, out),
        "verify": (target,),
        "write": (MOTION, out),
    }
    found = []
    for name, given in arguments.items():
        found += faults_of(name, given, few)
        if out.is_dir():
            shutil.rmtree(out)
        out.unlink(missing_ok=True)
    assert found == []


def test_public_functions_are_themselves() -> None:
    """They can be pickled, and show their own signatures and texts."""
    assert pickle.loads(pickle.dumps(mcz.positions)) is mcz.positions
    assert "joints" in inspect.signature(mcz.positions).parameters
    assert mcz.positions.__doc__ and mcz.positions.__name__ == "positions"
    with pytest.raises(TypeError, match="argument"):
        mcz.positions()  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="nothing"):
        mcz.positions(MOTION, nothing=1)  # type: ignore[call-arg]
