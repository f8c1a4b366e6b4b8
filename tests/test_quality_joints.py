"""Joints of quality records: by index in a file, by name in Python and on the command line."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Motion, Skeleton
from mcz.files.reading.stored_clip import with_indices, with_names
from mcz.kinematics.points import point_names
from mcz.sources import sample
from tests.commands import run
from tests.motions import smooth

PLAIN = sample.bvh_walk()
WALK = replace(PLAIN, skeleton=replace(PLAIN.skeleton, unit_cm=1.0))


def twins() -> Motion:
    """A motion whose joints are all called the same."""
    plain = replace(smooth(60), name="twins")
    joints = tuple(replace(joint, name="bone") for joint in plain.skeleton.joints)
    return replace(plain, skeleton=replace(plain.skeleton, joints=joints, unit_cm=1.0))


def encode_clip(motion: Motion, codec: str, **params: object) -> mcz.Clip:
    out = io.BytesIO()
    mcz.write(motion, out, codec, **params)  # type: ignore[arg-type]
    return mcz.open(out.getvalue()).only_clip()


def stored_quality(clip: mcz.Clip) -> dict[str, str]:
    return clip.stored_quality or {}


def test_figures_name_points_and_joints_by_index() -> None:
    clip = encode_clip(twins(), "mrdwt")
    point, shown = stored_quality(clip)["max_position_error_point"], clip.quality or {}
    assert shown["max_position_error_point"] == point_names(clip.skeleton)[int(point)]
    assert all(
        value.isdigit()
        for key, value in stored_quality(clip).items()
        if key.endswith(("_joint", "_point"))
    )


def test_joints_stay_themselves_in_a_cut(tmp_path: Path) -> None:
    whole, part, edited = (tmp_path / f"{name}.mcz" for name in ("whole", "part", "edited"))
    mcz.write(twins(), whole, "mrdwt")
    mcz.extract(whole, part, joints=["bone#3", "bone"], frames=(10, 50))
    with mcz.open(part) as file:
        clip = file.only_clip()
        assert stored_quality(clip)["cut-joints"] == "0,3"
        assert (clip.quality or {})["cut-joints"] == "bone,bone#3"
    values = np.zeros((40, len(twins().skeleton.columns(3))))
    mcz.replace(part, None, "bone#3", values, edited)
    with mcz.open(edited) as file:
        clip = file.only_clip()
        assert stored_quality(clip)["edit-joints"] == "3"
        assert (clip.quality or {})["edit-joints"] == "bone#3"
        assert stored_quality(clip)["cut-joints"] == "0,3"


def test_settings_name_joints_by_index_and_groups_by_word() -> None:
    foot = WALK.skeleton.find("LeftFoot")
    clip = encode_clip(WALK, "posewave", quality="feet=3cm,Head=3cm", lossless="LeftFoot")
    head = WALK.skeleton.find("Head")
    assert stored_quality(clip)["param.lossless"] == str(foot)
    assert stored_quality(clip)["param.quality"] == f"feet=3.0cm,{head}=3.0cm"
    assert {f"quality_reached.{head}", "quality_reached.feet"} <= set(stored_quality(clip))
    shown = clip.quality or {}
    assert shown["param.quality"] == "feet=3.0cm,Head=3.0cm"
    assert "quality_reached.Head" in shown and shown["param.lossless"] == "LeftFoot"


def test_contacts_are_settings_of_joints() -> None:
    skeleton = WALK.skeleton
    given = {"param.contacts": "LeftFoot:3+20,RightFoot", "uncut_slide_max_joint": "RightFoot"}
    left, right = skeleton.find("LeftFoot"), skeleton.find("RightFoot")
    found = with_indices(given, skeleton)
    assert found == {
        "param.contacts": f"{left}:3+20,{right}",
        "uncut_slide_max_joint": str(right),
    }
    assert with_names(found, skeleton) == given
    assert with_indices({"param.contacts": "auto"}, skeleton) == {"param.contacts": "auto"}


def test_what_a_skeleton_has_not_is_left_out_and_shown_as_it_is() -> None:
    skeleton = WALK.skeleton
    odd = {"edit-joints": "0,9999", "max_position_error_point": "9999", "shell_max_joint": "x y"}
    shown = with_names(odd, skeleton)
    assert shown == odd | {"edit-joints": f"{skeleton.joint_names[0]},9999"}
    assert with_indices(shown, skeleton) == {"edit-joints": "0", "shell_max_joint": "x y"}


@given(st.lists(st.sampled_from(["a", "feet", "1", "0", "é"]), min_size=1, max_size=8))
def test_any_names_come_back(names: list[str]) -> None:
    skeleton = Skeleton(tuple(mcz.Joint(name) for name in names))
    every = skeleton.joint_names
    shown = {"shell_max_joint": every[-1], "edit-joints": ",".join(every)}
    found = with_indices(shown, skeleton)
    assert found["edit-joints"] == ",".join(map(str, range(len(names))))
    assert found["shell_max_joint"] == str(len(names) - 1)
    assert with_names(found, skeleton) == shown


def test_info_shows_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "twins.mcz"
    mcz.write(twins(), path, "mrdwt")
    assert run("info", "--json", str(path)) == 0
    record = json.loads(capsys.readouterr().out)["clips"][0]["quality"]
    assert record["max_position_error_point"].startswith("bone")
