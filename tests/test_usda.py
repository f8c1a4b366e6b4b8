"""USD as text: its samples, and where Pixar's own library puts joints and markers."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz import Channel, Joint, Motion, MotionError, OptionError, Signal, Skeleton
from mcz.kinematics.points import origins_of
from mcz.sources.sample import acclaim_walk, bvh_walk, marker_walk

BVH = replace(bvh_walk(), skeleton=replace(bvh_walk().skeleton, unit_cm=1.0, up_axis="z"))
AMC = replace(acclaim_walk(), frame_rate=Fraction(120))
C3D = marker_walk()


def gappy() -> Motion:
    mask = np.ones(C3D.values.shape, bool)
    mask[10:20, :3] = mask[0:5, 3:6] = mask[:, 6:9] = False
    return replace(C3D, signals=(replace(C3D.signals[0], mask=mask), *C3D.signals[1:]))


def odd_names_motion() -> Motion:
    """Names that USD does not take, a joint that slides, and x up."""
    joints = (
        Joint("a b", channels=(Channel("rz"), Channel("sx"))),
        Joint('3 "b"\\', 0, (1.0, 0, 0), ((0.0, 1, 0),)),
        Joint("a_b", 0, (0.0, 2, 0)),
    )
    values = np.array([[0.0, 1.0], [30.0, 2.0], [-90.0, 4.0]])
    skeleton = Skeleton(joints, unit_cm=100.0, up_axis="x")
    return Motion(skeleton, (Signal(values),), Fraction(24), name="an odd/name")


MOTIONS = {"amc": AMC, "bvh": BVH, "gappy": gappy(), "stretched": odd_names_motion()}


def test_a_sample_a_frame() -> None:
    made = mcz.to_usda(BVH)
    text = made.data.decode()
    assert text.startswith("#usda 1.0\n") and made.data == mcz.to_usda(BVH).data
    assert 'upAxis = "Z"' in text and "timeCodesPerSecond = 120\n" in text
    samples = re.findall(r"^            (\d+): \[", text, re.M)
    assert samples == [*map(str, range(BVH.n_frames))] * 2
    assert made.key_error == 0 and made.max_error < 1e-3
    still = replace(BVH, signals=(BVH.signals[0].cut(0, 1),))
    assert "timeSamples" not in mcz.to_usda(still).data.decode()


@pytest.mark.parametrize(
    ("up", "turn"),
    [("x", (0, 0, 90)), ("-x", (0, 0, -90)), ("-y", (180, 0, 0)), ("-z", (90, 0, 0))],
)
def test_other_axes_are_turned_to_y(up: str, turn: tuple[int, int, int]) -> None:
    text = mcz.to_usda(replace(BVH, skeleton=replace(BVH.skeleton, up_axis=up))).data.decode()
    assert f"float3 xformOp:rotateXYZ = {turn}\n" in text and 'upAxis = "Y"' in text


def test_what_cannot_be_said() -> None:
    with pytest.raises(OptionError, match="its frame rate is unknown, but USDA must state times"):
        mcz.to_usda(replace(AMC, frame_rate=None))
    values = BVH.values.copy()
    values[3, 7] = np.nan
    with pytest.raises(MotionError, match="joint .* has no value in frame 3, of 1 missing"):
        mcz.to_usda(BVH.with_values(values))


@pytest.mark.long
@pytest.mark.parametrize("kind", MOTIONS)
def test_pixar_puts_everything_there(tmp_path: Path, kind: str) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdValidation

    motion, path = MOTIONS[kind], tmp_path / "walk.usda"
    path.write_bytes(mcz.to_usda(motion).data)
    stage = Usd.Stage.Open(str(path))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert validators and not UsdValidation.ValidationContext(validators).Validate(stage)
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, motion.n_frames - 1)
    assert stage.GetTimeCodesPerSecond() == motion.frame_rate
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    up = motion.skeleton.up_axis
    assert UsdGeom.GetStageUpAxis(stage) == ("Z" if up == "z" else "Y")
    scale = (motion.skeleton.unit_cm or 0) / 100
    wanted = origins_of(motion.skeleton, np.asarray(motion.values, np.float64)) * scale
    if up == "x":
        wanted = wanted[..., [1, 0, 2]] * [-1, 1, 1]
    names = motion.skeleton.addresses()
    found = (markers if kind == "gappy" else joints)(stage, motion.n_frames)
    for number, name in enumerate(names):
        assert np.array_equal(np.isnan(found[name]), np.isnan(wanted[:, number]))
        assert np.nanmax(np.abs(found[name] - wanted[:, number]), initial=0) < 1e-5


def joints(stage: Any, n_frames: int) -> dict[str, np.ndarray]:
    """By their names, where the joints are in the world, (n_frames, 3)."""
    from pxr import Usd, UsdGeom, UsdSkel

    root = UsdSkel.Root(stage.GetDefaultPrim())
    cache = UsdSkel.Cache()
    assert cache.Populate(root, Usd.PrimDefaultPredicate)
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath(f"{root.GetPath()}/skeleton"))
    query = cache.GetSkelQuery(skeleton)
    assert query.HasBindPose() and query.HasRestPose()
    (binding,) = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
    assert len(binding.GetSkinningTargets()) == 1
    placed = []
    for frame in range(n_frames):
        world = np.array(UsdGeom.Xformable(skeleton).ComputeLocalToWorldTransform(frame))
        own = np.array(query.ComputeJointSkelTransforms(frame))
        placed.append(own @ world)
    names = skeleton.GetJointNamesAttr().Get()
    return {name: np.array(placed)[:, k, 3, :3] for k, name in enumerate(names)}


def markers(stage: Any, n_frames: int) -> dict[str, np.ndarray]:
    """By their names, where the markers are, NaN where they are invisible."""
    from pxr import UsdGeom

    found = {}
    for prim in stage.GetDefaultPrim().GetChildren():
        shape = UsdGeom.Imageable(prim)
        places = [
            shape.ComputeLocalToWorldTransform(frame).ExtractTranslation()
            if shape.ComputeVisibility(frame) == "inherited"
            else [np.nan] * 3
            for frame in range(n_frames)
        ]
        found[prim.GetDisplayName()] = np.array(places)
    return found
