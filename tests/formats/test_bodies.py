"""Trees of body models, and offsets from a user's model or from positions."""

from __future__ import annotations

import io
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import (
    AccessError,
    Motion,
    OptionError,
    Signal,
    SourceError,
    offsets_from_positions,
    offsets_of_model,
)
from mcz.sources.arrays.skeletons import TURNS, skeleton_of, tree

RANDOM = np.random.default_rng(3)


def model(path: Path, n_joints: int = 24, drop: tuple[str, ...] = (), **members: object) -> Path:
    """A model of a body made up, as its makers write one."""
    parents = np.array(tree(n_joints).parents, np.int64) % 2**32
    arrays = {
        "kintree_table": np.stack([parents, np.arange(n_joints)]).astype("<u4"),
        "J_regressor": RANDOM.random((n_joints, 50)),
        "v_template": np.asfortranarray(RANDOM.normal(size=(50, 3))),
        "shapedirs": RANDOM.normal(size=(50, 3, 10)),
    }
    arrays["J"] = arrays["J_regressor"] @ arrays["v_template"]
    kept = {k: v for k, v in (arrays | members).items() if k not in drop}
    np.savez(path, allow_pickle=True, **kept)  # type: ignore[arg-type]
    return path


@pytest.mark.parametrize(
    ("which", "n_joints", "name", "parent"),
    [
        ("smpl", 24, "left_hand", "left_wrist"),
        ("smplh", 52, "right_thumb3", "right_thumb2"),
        ("smplx", 55, "left_pinky1", "left_wrist"),
        ("humanml3d", 22, "right_wrist", "right_elbow"),
    ],
)
def test_trees(which: str, n_joints: int, name: str, parent: str) -> None:
    found = tree(which)
    assert found is tree(n_joints) and found.n_joints == n_joints == len(set(found.names))
    assert found.names[found.parents[found.names.index(name)]] == parent
    assert found.parents[0] == -1 and all(p < j for j, p in enumerate(found.parents))
    # Left and right are alike.
    for joint, above in zip(found.names, found.parents, strict=True):
        if joint.startswith("left_"):
            other = found.names.index(joint.replace("left_", "right_", 1))
            there = found.names[found.parents[other]]
            assert there == found.names[above].replace("left_", "right_", 1)


def test_what_is_no_tree() -> None:
    for which in ("star", 23):
        with pytest.raises(OptionError, match=r"the body trees are smpl \(24 joints\), smplh"):
            tree(which)


@pytest.mark.parametrize("turns", TURNS)
def test_a_skeleton(turns: str) -> None:
    body = tree("smpl")
    offsets = RANDOM.normal(size=(24, 3))
    made = skeleton_of(body, offsets, turns=turns)
    np.testing.assert_array_equal(made.offsets, offsets)
    assert [j.parent for j in made.joints] == list(body.parents) and made.unit_cm == 100
    assert [c.kind for c in made.channels] == ["tx", "ty", "tz", *24 * TURNS[turns]]
    if turns:
        values = np.zeros((1, made.n_channels))
        values[:, [c.kind == "qw" for c in made.channels]] = 1.0
        motion = Motion(made, (Signal(values),))
        np.testing.assert_allclose(mcz.positions(motion)[0], mcz.rest_positions(made), atol=1e-12)
    for wrong in (offsets[:9], np.full((24, 3), np.nan)):
        with pytest.raises(OptionError, match="24 joints of SMPL"):
            skeleton_of(body, wrong)
    with pytest.raises(OptionError, match="one of rotvec, quat, euler"):
        skeleton_of(body, turns="axis")


def test_offsets_of_a_model(tmp_path: Path) -> None:
    path = model(tmp_path / "model.npz")
    with np.load(path) as held:
        J, shapes = held["J"], held["shapedirs"]
        regressor, vertices = held["J_regressor"], held["v_template"]
    parents = list(tree("smpl").parents)
    found = offsets_of_model(path, 24)
    assert (found[0] == J[0]).all()
    np.testing.assert_allclose(found[1:], J[1:] - J[parents[1:]], atol=1e-15)
    np.testing.assert_array_equal(offsets_of_model(path, 22), found[:22])
    arrays = {"J_regressor": regressor, "v_template": vertices, "shapedirs": shapes}
    without = model(tmp_path / "without.npz", **arrays, drop=("J",))
    np.testing.assert_allclose(offsets_of_model(without, 24), found, atol=1e-12)
    betas = [0.5, -2.0, 1.0]
    shaped = regressor @ (vertices + shapes[:, :, :3] @ betas)
    there = offsets_of_model(path, 24, betas)
    np.testing.assert_allclose(there[1:], shaped[1:] - shaped[parents[1:]], atol=1e-12)
    longer = offsets_of_model(path, 24, [*betas, *[0] * 13])  # as of 16 betas in a clip
    np.testing.assert_allclose(longer, there, atol=1e-12)


def test_a_model_of_joints_alone_has_no_other_shapes(tmp_path: Path) -> None:
    rest = ("J_regressor", "v_template", "shapedirs")
    path = model(tmp_path / "model.npz", drop=rest)
    found = offsets_of_model(path, 24)
    np.testing.assert_array_equal(offsets_of_model(path, 24, np.zeros(10)), found)
    with pytest.raises(SourceError, match="to shape them, J_regressor, v_template and"):
        offsets_of_model(path, 24, [0.5])


class Unwanted:
    def __reduce__(self) -> tuple[object, ...]:
        return pytest.fail, ("it was unpickled",)


def test_what_is_pickled_is_never_opened(tmp_path: Path) -> None:
    pickled = np.array([Unwanted()], object)
    path = model(tmp_path / "sparse.npz", J_regressor=pickled, drop=("J",))
    with pytest.raises(SourceError, match=r"J_regressor: a pickled object.*toarray\(\)"):
        offsets_of_model(path, 24)
    assert offsets_of_model(model(tmp_path / "j.npz", J_regressor=pickled), 24).shape == (24, 3)
    other = tmp_path / "SMPL_NEUTRAL.pkl"
    other.write_bytes(b"\x80\x04.")
    with pytest.raises(SourceError, match="never opened here; if you trust it.*shapedirs="):
        offsets_of_model(other, 24)


def test_models_that_do_not_fit(tmp_path: Path) -> None:
    path = model(tmp_path / "model.npz")
    with pytest.raises(OptionError, match="24 joints; expected 52"):
        offsets_of_model(path, 52)
    with pytest.raises(OptionError, match="12 betas are given, but the model has 10"):
        offsets_of_model(path, 24, np.ones(12))
    with pytest.raises(OptionError, match="a row of finite numbers"):
        offsets_of_model(path, 24, np.ones((1, 10)))
    with pytest.raises(
        OptionError, match="joint 23 is a child of joint 22, but 'right_hand' of SMPL is a child of"
    ):
        offsets_of_model(model(tmp_path / "h.npz", 52), 24)
    with pytest.raises(AccessError, match="No such file"):
        offsets_of_model(tmp_path / "none.npz", 24)
    with pytest.raises(SourceError, match=r"kintree_table is missing among J, J_regressor"):
        offsets_of_model(model(tmp_path / "no.npz", drop=("kintree_table",)), 24)
    wrong: dict[str, object] = {
        "kintree_table": np.zeros((2, 24), "<u4"),
        "J": np.zeros((3, 3)),
        "v_template": np.zeros((4, 3)),
        "J_regressor": np.zeros(4),
        "shapedirs": np.zeros((4, 3, 1)),
    }
    for name, array in wrong.items():
        drop = () if name == "J" else ("J",)
        if name == "kintree_table":
            array[0, 3] = 7  # type: ignore[index]
        file = model(tmp_path / f"{name}.npz", **{name: array}, drop=drop)
        with pytest.raises(SourceError, match="shape|must precede it"):
            offsets_of_model(file, 24, None if name == "J" else [1.0])
    with pytest.raises(SourceError, match="the type is <U4, not a number"):
        offsets_of_model(model(tmp_path / "text.npz", J=np.array(["text"])), 24)


def test_hostile_models(tmp_path: Path) -> None:
    """Whatever the bytes: an error, no crash, and no memory that they have not earned."""
    data = model(tmp_path / "model.npz", 22).read_bytes()
    file = tmp_path / "hostile.npz"
    for stop in range(0, len(data), 997):
        file.write_bytes(data[:stop])
        with pytest.raises(SourceError):
            offsets_of_model(file, 22)
    for at in range(0, len(data), 61):
        file.write_bytes(data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :])
        with suppress(SourceError, OptionError):
            assert offsets_of_model(file, 22).shape == (22, 3)
    huge = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        huge, {"descr": "<f8", "fortran_order": False, "shape": (2**40, 2**40)}
    )
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("kintree_table.npy", huge.getvalue())
    with pytest.raises(SourceError, match="bytes of shape"):
        offsets_of_model(file, 22)


def test_offsets_from_positions() -> None:
    body = tree("humanml3d")
    offsets = RANDOM.normal(size=(22, 3))
    motion = Motion(
        skeleton_of(body, offsets), (Signal(RANDOM.normal(size=(40, 69))),), name="body"
    )
    places = mcz.positions(motion)
    turns = mcz.rotations(motion, "matrix")
    found = offsets_from_positions(places, turns, body.parents, motion.values[:, :3])
    np.testing.assert_allclose(found.offsets, offsets, atol=1e-12)
    assert found.greatest < 1e-12
    alone = offsets_from_positions(places, turns, body.parents)
    np.testing.assert_array_equal(
        alone.offsets, np.concatenate([np.zeros((1, 3)), found.offsets[1:]])
    )
    noisy = places + RANDOM.normal(scale=0.01, size=places.shape)
    noisy[7, 3] = np.nan
    off = offsets_from_positions(noisy, turns, body.parents, motion.values[:, :3])
    assert np.abs(off.offsets - offsets).max() < 0.02 and 0.01 < off.rms < off.greatest < 0.2
    with pytest.raises(OptionError, match="do not fit 22 joints"):
        offsets_from_positions(places[:, :9], turns, body.parents)
    with pytest.raises(OptionError, match="translations of shape"):
        offsets_from_positions(places, turns, body.parents, np.zeros(3))
    with pytest.raises(OptionError, match="joint 1: no frame shows"):
        offsets_from_positions(places * np.nan, turns, body.parents)
    with pytest.raises(OptionError, match="joint 1: its parent 4"):
        offsets_from_positions(places, turns, [-1, 4, *body.parents[2:]])
