"""Learned bases: Algorithm 1, training sets, mcz train, the studies of Hou 2016 without a codec."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import mcz
from mcz import Motion, MotionError, OptionError
from mcz.codecs.basis_models import parse_bases
from mcz.codecs.training import (
    Recipe,
    TrainingSet,
    train,
    training_set,
    window_coefficients,
    with_headings,
    with_mirror_images,
)
from mcz.codecs.transforms.bases import (
    PATIENCE,
    dct_matrix,
    haar_basis,
    has_converged,
    learn_bases,
    learn_basis,
    procrustes,
    start_basis,
)
from tests.commands import run
from tools.papers.hou2016 import training as study

Floats = NDArray[np.float64]


def orthogonal(rng: np.random.Generator, n: int) -> Floats:
    return np.linalg.qr(rng.normal(size=(n, n)))[0]


def sparse(rng: np.random.Generator, n_frames: int, n_points: int, n_kept: int) -> Floats:
    """Coefficients with ``n_kept`` entries a frame, all well away from 0."""
    coefficients = np.zeros((n_frames, n_points))
    for frame in coefficients:
        at = rng.choice(n_points, n_kept, replace=False)
        frame[at] = rng.choice((-1, 1), n_kept) * rng.uniform(1, 3, n_kept)
    return coefficients


def best_left_out(frames: Floats, basis: Floats, sparsity: int) -> float:
    """Equation 6 with the best sparse vectors for ``basis``."""
    squares = np.sort((frames @ basis.T) ** 2, axis=1)
    return float(squares[:, : frames.shape[1] - sparsity].sum())


def identity_error(basis: Floats) -> float:
    return float(np.abs(basis @ basis.T - np.eye(len(basis))).max())


# Algorithm 1


@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_no_orthogonal_matrix_is_better_than_procrustes(seed: int, n_points: int) -> None:
    rng = np.random.default_rng(seed)
    frames, wanted = rng.normal(size=(2, 40, n_points))
    basis = procrustes(wanted.T @ frames)
    assert identity_error(basis) < 1e-12

    def error(matrix: Floats) -> float:
        return float(((frames @ matrix.T - wanted) ** 2).sum())

    for size in (1e-3, 0.1, 10.0):
        near = np.linalg.qr(basis + size * rng.normal(size=basis.shape))
        other = near[0] * np.sign(np.diag(near[1]))  # the factor that is near, not its negative
        assert error(basis) <= error(other) + 1e-9
    assert error(basis) <= error(orthogonal(rng, n_points)) + 1e-9


@given(
    st.integers(0, 2**32 - 1), st.integers(2, 20), st.integers(1, 300), st.sampled_from((0, 1, 7))
)
def test_the_objective_never_rises(seed: int, n_points: int, n_frames: int, growth: int) -> None:
    rng = np.random.default_rng(seed)
    frames = rng.normal(size=(n_frames, n_points)) @ rng.normal(size=(n_points, n_points))
    sparsity = int(rng.integers(1, n_points + 1))
    found = learn_basis(frames, sparsity=sparsity, iterations=20, growth=growth)
    total = float((frames**2).sum())
    assert (np.diff(found.objective[found.n_growth :]) <= 1e-9 * total).all()
    assert found.n_growth == growth * (sparsity - 1)
    assert identity_error(found.basis) < 1e-12
    left = best_left_out(frames, found.basis, sparsity)
    assert found.objective[-1] == pytest.approx(left, rel=1e-9, abs=1e-9 * total)
    start = best_left_out(frames, dct_matrix(n_points), sparsity)
    assert found.objective[0] == pytest.approx(start, rel=1e-9, abs=1e-9 * total)


@pytest.mark.parametrize("start", ["dct", "haar"])
@pytest.mark.parametrize("growth", [0, 5])
def test_the_same_frames_give_the_same_bytes(start: str, growth: int) -> None:
    frames = np.random.default_rng(1).normal(size=(500, 31)).cumsum(axis=1)
    a, b = (learn_basis(frames, iterations=15, growth=growth, start=start) for _ in range(2))
    assert a.basis.tobytes() == b.basis.tobytes()
    assert a.objective.tobytes() == b.objective.tobytes()
    c = learn_basis(np.asfortranarray(frames), iterations=15, growth=growth, start=start)
    assert a.basis.tobytes() == c.basis.tobytes()


@pytest.mark.parametrize("start", ["dct", "haar"])
def test_a_dictionary_of_sparse_frames_is_found(start: str) -> None:
    rng = np.random.default_rng(3)
    dictionary = orthogonal(rng, 12)
    frames = sparse(rng, 4000, 12, 2) @ dictionary
    found = learn_basis(frames, sparsity=2, start=start)
    assert found.objective[-1] < 1e-9 * (frames**2).sum()
    # Each row of the one is a row of the other, up to sign.
    matches = np.abs(found.basis @ dictionary.T)
    assert np.allclose(np.sort(matches, axis=1)[:, -1], 1)
    assert sorted(matches.argmax(axis=1)) == list(range(12))


def test_of_equal_magnitudes_the_first_is_kept() -> None:
    from mcz.codecs.transforms.bases import truncate

    rows = np.array([[1.0, -2.0, 2.0, -1.0], [3.0, 3.0, 3.0, 3.0]])
    products = np.empty((4, 4))
    dropped = truncate(np.ascontiguousarray(rows.T), rows, np.eye(4), 3, 2, products)
    kept = np.array([[1.0, -2.0, 2.0, 0.0], [3.0, 3.0, 3.0, 0.0]])
    assert (products == kept.T @ rows).all()
    assert dropped == (1 + 1) + (9 + 9)


def test_rows_are_in_order_with_fixed_signs() -> None:
    rng = np.random.default_rng(2)
    frames = rng.normal(size=(400, 9)) * np.linspace(1, 9, 9) @ orthogonal(rng, 9)
    basis = learn_basis(frames, sparsity=3, iterations=10).basis
    energy = ((frames @ basis.T) ** 2).sum(axis=0)
    assert (np.diff(energy) <= 1e-9 * energy[0]).all()
    assert (np.take_along_axis(basis, np.abs(basis).argmax(axis=1)[:, None], 1) > 0).all()


def test_it_stops_where_nothing_is_gained() -> None:
    frames = np.random.default_rng(4).normal(size=(100, 6))
    found = learn_basis(frames, sparsity=6, iterations=300)  # nothing is ever dropped
    assert found.n_iterations - found.n_growth == PATIENCE
    assert has_converged([2.0] * (PATIENCE + 1))
    assert not has_converged([2.0] * PATIENCE)
    assert not has_converged([3.0] + [2.0] * PATIENCE)
    assert has_converged([0.0] * (PATIENCE + 1))


@pytest.mark.parametrize("n_points", [1, 2, 3, 7, 8, 31, 38])
def test_starts_are_orthogonal(n_points: int) -> None:
    for basis in (dct_matrix(n_points), haar_basis(n_points)):
        assert identity_error(basis) < 1e-14 * n_points
    if n_points == 8:
        assert haar_basis(8)[0] == pytest.approx(np.full(8, 8**-0.5))
        assert haar_basis(8)[1] == pytest.approx(np.repeat([8**-0.5, -(8**-0.5)], 4))
    if n_points == 3:  # the odd one is carried to the second level
        assert haar_basis(3)[2] == pytest.approx([2**-0.5, -(2**-0.5), 0])


def test_one_basis_a_coordinate() -> None:
    positions = np.random.default_rng(6).normal(size=(60, 5, 3))
    told: list[tuple[int, int]] = []
    found = learn_bases(
        positions, sparsity=2, iterations=4, growth=3, progress=lambda *at: told.append(at)
    )
    for axis, learned in enumerate(found):
        alone = learn_basis(positions[:, :, axis], sparsity=2, iterations=4, growth=3)
        assert learned.basis.tobytes() == alone.basis.tobytes()
    assert told[0] == (0, 21) and told[-1] == (21, 21)
    assert [done for done, _ in told] == sorted(done for done, _ in told)


def test_refused_arguments() -> None:
    frames = np.ones((4, 3))
    for kwargs, words in (
        ({"sparsity": 0}, "sparsity is 0; it must be 1 to 3"),
        ({"sparsity": 4}, "sparsity is 4; it must be 1 to 3"),
        ({"iterations": -1}, "may be negative"),
        ({"growth": -1}, "may be negative"),
        ({"start": "fft"}, "start is 'fft'; it must be one of dct, haar"),
        ({"start": np.eye(2)}, r"start has shape \(2, 2\)"),
        ({"start": np.ones((3, 3))}, "not an orthogonal matrix"),
    ):
        with pytest.raises(OptionError, match=words):
            learn_basis(frames, **({"sparsity": 1} | kwargs))  # type: ignore[arg-type]
    for bad in (np.ones((0, 3)), np.ones((3, 0)), np.ones(3)):
        with pytest.raises(OptionError, match="frames have shape"):
            learn_basis(bad, sparsity=1)
    with pytest.raises(OptionError, match="not finite"):
        learn_basis(np.full((2, 2), np.nan), sparsity=1)
    with pytest.raises(OptionError, match="positions have shape"):
        learn_bases(frames)
    assert start_basis(np.eye(2), 2).tolist() == [[1, 0], [0, 1]]


# Training sets


@pytest.fixture(scope="module")
def walk(samples: Path) -> Motion:
    return mcz.read(samples / "walk.amc")


def test_positions_in_centimeters(walk: Motion) -> None:
    found = training_set([walk, walk])
    assert (found.unit, found.up, len(found.names)) == ("cm", "y", 31)
    assert found.n_frames == 2 * walk.n_frames
    assert walk.skeleton.unit_cm is not None
    assert found.clips[0] == pytest.approx(mcz.positions(walk) * walk.skeleton.unit_cm)


def test_missing_points_lie_on_straight_lines(samples: Path) -> None:
    markers = mcz.read(samples / "walk.c3d")
    places = mcz.positions(markers) * markers.skeleton.unit_cm
    known = np.isfinite(places)
    found = training_set([markers])
    assert 0 < found.n_filled == int((~known.all(axis=(1, 2))).sum())
    np.testing.assert_array_equal(found.clips[0][known], places[known])
    frames = np.arange(len(places))
    for point, axis in np.argwhere(~known.all(axis=0)).tolist():
        seen = known[:, point, axis]
        line = np.interp(frames, frames[seen], places[seen, point, axis])
        np.testing.assert_allclose(found.clips[0][:, point, axis], line)


def test_clips_must_be_alike(walk: Motion, samples: Path) -> None:
    other = mcz.read(samples / "walk.bvh", unit="cm")
    with pytest.raises(MotionError, match="have 31 and 38 points"):
        training_set([walk, other])
    joints = list(walk.skeleton.joints)
    joints[3] = replace(joints[3], name="wing")
    named = replace(walk, skeleton=replace(walk.skeleton, joints=tuple(joints)))
    with pytest.raises(MotionError, match=r"differ in point 3: '.*' and 'wing'"):
        training_set([walk, named])
    unknown = replace(walk, skeleton=replace(walk.skeleton, unit_cm=None))
    with pytest.raises(MotionError, match="one has a length unit"):
        training_set([walk, unknown])
    lying = replace(walk, skeleton=replace(walk.skeleton, up_axis="z"))
    with pytest.raises(MotionError, match="up axes"):
        training_set([walk, lying])
    with pytest.raises(MotionError, match="at least one clip"):
        training_set([])
    with pytest.raises(MotionError, match="at least one frame"):
        training_set([walk.with_values(walk.values[:0])])


def small(up: str = "y") -> TrainingSet:
    clip = np.random.default_rng(8).normal(size=(5, 3, 3))
    return TrainingSet(("root", "lfoot", "rfoot"), (clip,), up, "cm")


def test_mirrored_copies() -> None:
    found = with_mirror_images(small())
    (clip, image) = found.clips
    assert image[:, 0] == pytest.approx(clip[:, 0] * [-1, 1, 1])
    assert image[:, 1] == pytest.approx(clip[:, 2] * [-1, 1, 1])
    assert with_mirror_images(replace(found, clips=(image,))).clips[1] == pytest.approx(clip)
    with pytest.raises(OptionError, match="left and right"):
        with_mirror_images(replace(small(), names=("a", "b", "c")))


@pytest.mark.parametrize("up", ["x", "y", "z", "-y"])
def test_headings_turn_about_the_up_axis(up: str) -> None:
    found = with_headings(small(up), 3)
    axis = "xyz".index(up[-1])
    assert len(found.clips) == 3
    assert found.clips[0] == pytest.approx(small(up).clips[0])
    for clip in found.clips:
        assert clip[:, :, axis] == pytest.approx(small(up).clips[0][:, :, axis])
        assert np.linalg.norm(clip, axis=2) == pytest.approx(
            np.linalg.norm(small(up).clips[0], axis=2)
        )
    assert not np.allclose(found.clips[0], found.clips[1])


def test_kinds_of_vectors() -> None:
    clip = np.random.default_rng(9).normal(size=(250, 4, 3))
    found = TrainingSet(("a", "b", "c", "d"), (clip,), "y", "cm")
    assert Recipe(kind="frames", every=2).vectors(found) == pytest.approx(clip[::2])
    assert Recipe(kind="steps").vectors(found) == pytest.approx(clip[8:] - clip[:-8])
    windows = Recipe(kind="windows").vectors(found)
    assert windows.shape == (12 + 12 + 10, 4, 3)
    assert windows[0] == pytest.approx(clip[:120].sum(axis=0) / 120**0.5)
    # A transform of whole windows keeps every sum of squares.
    every = window_coefficients(found, 120, 120)
    assert (every**2).sum() == pytest.approx((clip**2).sum())
    with pytest.raises(OptionError, match="must be one of frames, steps, windows"):
        Recipe(kind="poses").vectors(found)
    with pytest.raises(OptionError, match="long enough"):
        Recipe(kind="steps").vectors(replace(found, clips=(clip[:8],)))


# mcz train


def test_the_better_of_several_bases(walk: Motion) -> None:
    found = training_set([walk])
    recipes = [Recipe(start=start, iterations=3, growth=1) for start in ("dct", "haar")]
    one, other = (recipe.learn(found) for recipe in recipes)
    best = one.better(other)
    for kept, *both in zip(best.learned, one.learned, other.learned, strict=True):
        assert kept in both
        assert kept.objective[-1] == min(learned.objective[-1] for learned in both)
    with pytest.raises(
        OptionError, match="bases learned from different vectors cannot be compared"
    ):
        one.better(replace(recipes[0], every=2).learn(found))


def test_train(samples: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "walk.bases"
    options = ["--iterations", "5", "--growth", "1", "--P", "4", "--mirror", "--headings", "2"]
    clip = str(samples / "walk.bvh")
    call = ["train", clip, clip, "-o", str(out), "--unit", "cm", *options]
    assert run(*call, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["output"] == str(out)
    assert document["bytes"] == out.stat().st_size
    assert (document["n_points"], document["n_clips"], document["n_frames"]) == (38, 2, 480)
    assert document["n_vectors"] == 4 * (480 - 2 * 8)
    assert [c["iterations"] for c in document["coordinates"]] == [8] * 3
    assert all(c["end"] < c["start"] for c in document["coordinates"])

    recipe = Recipe(sparsity=4, iterations=5, growth=1, mirror=True, headings=2)
    trained = train([mcz.read(clip, unit="cm")] * 2, recipe)
    for basis, learned in zip(parse_bases(out.read_bytes()), trained.learned, strict=True):
        assert np.abs(basis.vectors - learned.basis).max() <= 2.0**-16

    assert run(*call) == 2  # exists
    assert run(*call, "--force") == 0
    assert "38 points" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["walk.bvh", "walk.amc"], 1, ["walk.bvh", "walk.amc", "38 and 31 points"]),
        (["walk.bvh", "--P", "39"], 2, ["walk.bvh", "sparsity is 39; it must be 1 to 38"]),
        (["walk.asf"], 2, ["walk.asf"]),
        (["absent.bvh"], 1, ["absent.bvh: no such file"]),
        (["walk.c3d", "--mirror", "--start", "fft"], 2, ["fft"]),
        ([], 2, ["CLIPS"]),
    ],
)
def test_train_refuses(
    samples: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    code: int,
    words: list[str],
) -> None:
    monkeypatch.chdir(samples)
    assert run("train", *arguments, "-o", tmp_path / "out") == code
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert all(word in errors for word in words), errors
    assert not (tmp_path / "out").exists()


# Studies


def test_distortion_of_kept_coefficients() -> None:
    rng = np.random.default_rng(11)
    positions = rng.normal(size=(20, 5, 3))
    matrices = [orthogonal(rng, 5) for _ in range(3)]
    (nothing, half, all_of_them) = study.distortions(positions, matrices, (0.0, 0.5, 1.0))
    assert nothing == pytest.approx(np.linalg.norm(positions, axis=2).mean())
    assert all_of_them == pytest.approx(0, abs=1e-12)
    coefficients = np.stack([positions[:, :, a] @ matrices[a].T for a in range(3)], axis=1)
    limit = np.sort(np.abs(coefficients).ravel())[150]
    kept = np.where(np.abs(coefficients) >= limit, coefficients, 0)
    back = np.stack([kept[:, a] @ matrices[a] for a in range(3)], axis=2)
    assert half == pytest.approx(np.linalg.norm(back - positions, axis=2).mean())


@pytest.mark.real
def test_growth_finds_better_bases_of_captured_motion(data: Path) -> None:
    clips = [mcz.read(data / "cmu" / "amc" / f"{name}.amc") for name in ("05_18", "86_01")]
    frames = np.concatenate([clip[::8] for clip in training_set(clips).clips])[:, :, 1]

    def ends(growth: int) -> list[float]:
        starts = ("dct", "haar")
        found = (learn_basis(frames, start=start, growth=growth) for start in starts)
        return [float(learned.objective[-1]) for learned in found]

    assert max(ends(40)) < min(ends(0))
