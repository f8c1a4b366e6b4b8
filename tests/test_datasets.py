"""Data sets: windows equal what the clips give, in any order, kept, split, pickled, as tensors."""

from __future__ import annotations

import multiprocessing
import pickle
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.spatial.transform import Rotation

import mcz
from mcz.exchange.datasets.feature_blocks import FolderCache, MemoryCache, to_size
from mcz.exchange.datasets.field_table import FIELDS
from mcz.exchange.datasets.samplers import split_members
from mcz.kinematics.poses.conversions import from_matrices
from tests.motions import smooth

LENGTHS = (300, 90, 40, 513)


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four clips of three subjects, of 300, 90, 40 and 513 frames."""
    folder = tmp_path_factory.mktemp("clips")
    for number, n_frames in enumerate(LENGTHS):
        subject = {"subject": f"{number % 3:02}"}
        motion = smooth(n_frames, name=f"{number % 3:02}_{number}", metadata=subject)
        mcz.write(motion, folder / f"{number}.mcz")
    return folder


def motions(folder: Path) -> list[mcz.Motion]:
    return [mcz.read(path) for path in sorted(folder.glob("*.mcz"))]


OF_FEET = ("foot_speed", "contacts", "humanml3d")  # the skeleton of these clips has none
ALL = ",".join(name for name in FIELDS if name not in OF_FEET)


def expected_field(motion: mcz.Motion, name: str, unit: str | None = None) -> np.ndarray:
    """Expected values of a field, from the functions for whole motions."""
    if name == "channels":
        return motion.values
    if name == "root":
        return mcz.root(motion, unit=unit).positions
    if name in ("positions", "velocities", "accelerations"):
        return getattr(mcz, name)(motion, unit=unit)
    space = "world" if name.startswith("world_") else "local"
    form = name.removeprefix("world_").replace("rot6d", "6d")
    if name.startswith("heading"):
        return expected_heading(motion, name, unit)
    return mcz.rotations(motion, form, space=space)


def expected_heading(motion: mcz.Motion, name: str, unit: str | None) -> np.ndarray:
    """Values in the frame of the root's heading; these skeletons have y up."""
    root = mcz.root(motion, unit=unit)
    if name == "heading":
        return np.stack([np.cos(root.headings), np.sin(root.headings)], axis=1)
    if name == "heading_rate":
        return np.gradient(root.headings)[:, None] * float(motion.frame_rate)
    back = [Rotation.from_rotvec([0, -heading, 0]) for heading in root.headings]
    if name == "heading_positions":
        apart = mcz.positions(motion, unit=unit) - root.positions[:, None] * (1, 0, 1)
        return np.stack([turn.apply(frame) for turn, frame in zip(back, apart, strict=True)])
    if name == "heading_velocities":
        moving = mcz.velocities(motion, unit=unit)
        return np.stack([turn.apply(frame) for turn, frame in zip(back, moving, strict=True)])
    world = mcz.rotations(motion, "matrix", space="world")
    turned = np.stack([turn.as_matrix() for turn in back])[:, None] @ world
    form = name.removeprefix("heading_").replace("rot6d", "6d")
    return from_matrices(turned, form)


@pytest.mark.parametrize("rate", [None, 120, 60, 50, Fraction(240)])
def test_windows_are_parts_of_the_clips(archive: Path, rate: int | None) -> None:
    data = mcz.dataset(archive, ALL, rate=rate, window=32, stride=20, dtype="float64", unit="cm")
    assert data.fields == tuple(ALL.split(",")) and data.rate == (rate or 120)
    whole = [m if rate is None else mcz.resample(m, rate) for m in motions(archive)]
    names = {motion.name: motion for motion in whole}
    counts = [max(0, (m.n_frames - 32) // 20 + 1) for m in whole]
    assert len(data) == sum(counts)
    for index in {0, 1, len(data) // 2, len(data) - 1}:
        window, arrays = data.window(index), data[index]
        assert window.stop - window.start == 32
        motion = names[window.clip]
        for name in data.fields:
            part = expected_field(motion, name, "cm")[window.start : window.stop]
            assert arrays[name].shape[1:] == data.shapes[name]
            if name.endswith("quat"):  # a window begins with w >= 0
                part = part * np.where(part[:1, :, :1] < 0, -1, 1)
            np.testing.assert_allclose(arrays[name], part, atol=1e-9, err_msg=name)


def test_whole_clips(archive: Path) -> None:
    data = mcz.dataset(archive, "channels,root")
    assert [len(item["root"]) for item in data] == list(LENGTHS)
    assert data[-1]["channels"].dtype == np.float32
    np.testing.assert_allclose(data[3]["channels"], motions(archive)[3].values, rtol=1e-6)
    with pytest.raises(
        mcz.OptionError, match="whole clips differ in length, so they cannot be batched"
    ):
        data[0:2]
    assert "4 whole clips of 4 clips: channels, root" in repr(data)


def test_batches_are_windows_side_by_side(archive: Path) -> None:
    data = mcz.dataset(archive, window=64, stride=16)
    batch = data[[5, 0, -1]]
    for row, index in enumerate((5, 0, -1)):
        for name, array in data[index].items():
            np.testing.assert_array_equal(batch[name][row], array)
    assert data[3:3]["root"].shape == (0, 64, 3)
    sizes = [len(batch["root"]) for batch in data.batches(7, seed=1)]
    assert sum(sizes) == len(data) and set(sizes[:-1]) == {7}
    assert len(list(data.batches(7, drop_last=True))) == len(data) // 7
    assert data.names["positions"] == mcz.point_names(motions(archive)[0])
    data[0]["root"][:] = 7  # the caller's own
    assert not (data[0]["root"] == 7).all()
    with pytest.raises(IndexError, match="window 99 is out of range"):
        data[99]


INDICES = st.one_of(
    st.integers(-20, 20),
    st.integers(-20, 20).map(np.int16),
    st.slices(16),
    st.lists(st.integers(-17, 16), max_size=4),
    st.lists(st.integers(-16, 15), max_size=4).map(tuple),
    st.lists(st.integers(0, 15), max_size=4).map(lambda each: np.array(each, np.uint8)),
    arrays(np.int64, array_shapes(min_dims=0, max_side=3), elements=st.integers(-16, 15)),
    arrays(np.bool_, 16),
    arrays(np.bool_, st.integers(1, 18)),  # NumPy takes an empty mask for any length
    st.sampled_from([..., None, True, 1.0, "root", [1.5], [[]], {1}, 10**30, (1, 2)]),
    st.just([[1], [2, 3]]),
)


@given(INDICES)
def test_windows_are_chosen_as_numpy_does(archive: Path, index: object) -> None:
    """Indices work as along a NumPy axis; all others raise an IndexError."""
    data = mcz.dataset(archive, "root", window=64, stride=48)
    assert len(data) == 16
    numbers = np.arange(16)
    expected = None
    if index is not None and index is not True:  # they would add an axis
        with suppress(IndexError, ValueError):
            expected = numbers[index]
    if expected is None:
        with pytest.raises(mcz.OptionError) as raised:
            data[index]
        assert isinstance(raised.value, IndexError)
        return
    found = data[index]["root"]
    assert found.shape == (*np.shape(expected), 64, 3)
    for number, window in zip(np.ravel(expected), found.reshape(-1, 64, 3), strict=True):
        np.testing.assert_array_equal(window, data[int(number)]["root"])


@given(st.integers(1, 9), st.integers(1, 4), st.integers(0, 2**32))
def test_each_epoch_has_an_order_of_its_own(
    archive: Path, size: int, workers: int, seed: int
) -> None:
    data = mcz.dataset(archive, "root", window=16, stride=8, cache="40 kB")
    sampler = data.batch_sampler(size, seed, workers)
    epochs = [list(sampler) for _ in range(3)]
    for epoch in epochs:
        assert len(epoch) == len(sampler)
        assert sorted(number for batch in epoch for number in batch) == list(range(len(data)))
    assert epochs[0] != epochs[1] != epochs[2] != epochs[0]
    sampler.set_epoch(1)
    iter(sampler)  # as a DataLoader with workers does, without a use of it
    assert list(sampler) == epochs[1] and list(sampler) == epochs[2]
    assert list(data.batch_sampler(size, seed, workers)) == epochs[0]
    singles = data.sampler(seed)
    assert list(singles) == data.order(seed).tolist() != list(singles)
    for wrong in (-1, 1.5, None, "x"):
        with pytest.raises(mcz.OptionError, match="seed|epoch"):
            data.order(wrong)
        with pytest.raises(mcz.OptionError, match="epoch"):
            sampler.set_epoch(wrong)


@given(st.integers(0, 2**32), st.sampled_from(["1 kB", "200 kB", "64 MB"]))
def test_orders_have_every_window_once(archive: Path, seed: int, cache: str) -> None:
    data = mcz.dataset(archive, "root", window=16, stride=4, cache=cache)
    order = data.order(seed)
    assert sorted(order.tolist()) == list(range(len(data)))
    np.testing.assert_array_equal(order, data.order(seed))
    assert (order != data.order(seed + 1)).any()


def test_joints_are_chosen(archive: Path) -> None:
    data = mcz.dataset(archive, "rot6d,positions,channels", joints=["knee", "spine"], window=8)
    assert data.shapes == {"rot6d": (2, 6), "positions": (2, 3), "channels": (4,)}
    assert data.names["rot6d"] == ("knee", "spine")
    assert data.names["channels"] == ("knee.rx", "spine.rz", "spine.ry", "spine.rx")
    motion = motions(archive)[0]
    np.testing.assert_allclose(
        data[0]["positions"], mcz.positions(motion, ["knee", "spine"])[:8], rtol=1e-5
    )
    clip_values = motion.values[:8, [9, 6, 7, 8]]
    np.testing.assert_allclose(data[0]["channels"], clip_values, rtol=1e-6)


def test_clips_are_chosen(archive: Path) -> None:
    data = mcz.dataset(archive, "root", where="subject == '00'")
    assert [member.clip for member in data.members] == ["00_0", "00_3"]
    data = mcz.dataset(archive, "root", where=lambda clip: clip.n_frames < 100, window=50)
    assert [member.clip for member in data.members] == ["01_1"]
    assert [member.clip for member in data.skipped] == ["02_2"]
    assert "1 too short" in repr(data)


def test_the_same_from_files_paths_and_lists(archive: Path) -> None:
    paths = sorted(archive.glob("*.mcz"))
    data = mcz.dataset(archive, "root", window=32)
    with mcz.open(paths[0]) as first, mcz.open(paths[1].read_bytes()) as second:
        other = mcz.dataset([first, second, *paths[2:]], "root", window=32)
        for index in range(len(data)):
            np.testing.assert_array_equal(other[index]["root"], data[index]["root"])
        one = mcz.dataset(first, "root", window=32)
        assert len(one) == 9 and pickle.loads(pickle.dumps(one))[3]["root"].shape == (32, 3)


@pytest.fixture
def odd(archive: Path, tmp_path: Path) -> Iterator[Path]:
    (tmp_path / "a.mcz").write_bytes((archive / "0.mcz").read_bytes())
    yield tmp_path


def test_clips_that_do_not_go_together(odd: Path) -> None:
    motion = smooth(50, name="other")
    for changes, words in {
        "rate": (replace(motion, frame_rate=Fraction(60)), "frame rates differ; .*rate="),
        "unit": (
            replace(motion, skeleton=replace(motion.skeleton, unit_cm=1.0)),
            "length units differ; .*unit=",
        ),
        "joints": (
            mcz.rename(motion, {"knee": "elbow"}),
            r"names \(elbow, elbow .*\), .* names \(knee, knee .*\): joints differ; .*joints=",
        ),
    }.values():
        mcz.write(changes, odd / "b.mcz", force=True)
        with pytest.raises(mcz.OptionError, match=words):
            mcz.dataset(odd)
    mcz.write(replace(motion, frame_rate=None), odd / "b.mcz", force=True)
    with pytest.raises(mcz.OptionError, match="b.mcz: clip 'other': its frame rate is unknown"):
        mcz.dataset(odd, rate=30)
    assert mcz.dataset(odd, rate=30, source_rate=60).members[1].n_frames == 25


def test_what_is_asked_for_wrongly(archive: Path, samples: Path) -> None:
    for words, arguments in {
        "no field or signal 'rot6' among .*did you mean 'rot6d'": {"fields": "rot6"},
        "none twice": {"fields": "root,root"},
        "window is 0 frames; it must be at least 1": {"window": 0},
        "stride is 5 frames, which does not fit windows of None": {"stride": 5},
        "dtype is int8": {"dtype": "int8"},
        "it must be a number of bytes, or a string such as '64 MB'": {"cache": "much"},
        "no clip of at least 9999 frames at this rate .*; the longest chosen has": {"window": 9999},
        "no clip in the given files matches where$": {"where": "n_frames < 0"},
    }.items():
        with pytest.raises(mcz.OptionError, match=words):
            mcz.dataset(archive, **arguments)
    with pytest.raises(
        mcz.OptionError, match="a data set reads only .mcz files; make one with mcz pack"
    ):
        mcz.dataset(samples / "walk.bvh")
    with pytest.raises(
        mcz.OptionError, match=r"the folder contains no .mcz file; make one with mcz pack"
    ):
        mcz.dataset(samples)
    with pytest.raises(mcz.OptionError, match="size is 0"):
        mcz.dataset(archive).batches(0)


def test_parts_share_no_subject(archive: Path) -> None:
    data = mcz.dataset(archive, "root", window=10)
    parts = data.split({"train": 0.7, "test": 0.3}, seed=4)
    subjects = [{m.clip[:2] for m in parts[name].members} for name in ("train", "test")]
    assert subjects[0] | subjects[1] == {"00", "01", "02"} and not subjects[0] & subjects[1]
    assert sum(map(len, parts.values())) == len(data)
    assert {id(part._blocks) for part in parts.values()} == {id(data._blocks)}
    again = data.split({"train": 0.7, "test": 0.3}, pattern=r"^(\d\d)_", seed=4)
    assert [p.members for p in again.values()] == [p.members for p in parts.values()]
    by_clip = data.split({"a": 0.25, "b": 0.25, "c": 0.25, "d": 0.25}, by="clip")
    assert [len(part.members) for part in by_clip.values()] == [1] * 4
    for words, arguments in {
        "have no 'session'": {"by": "session"},
        "captures no group in its name": {"pattern": "^x(.)"},
        "pattern '\\('": {"pattern": "("},
    }.items():
        with pytest.raises(mcz.OptionError, match=words):
            data.split({"train": 0.7, "test": 0.3}, **arguments)
    for wrong in ({}, {"a": 0.5}, {"a": 1.5, "b": -0.5}):
        with pytest.raises(mcz.OptionError, match="add up to 1"):
            data.split(wrong)
    with pytest.raises(mcz.OptionError, match="cannot fill 4 parts"):
        data.split(dict.fromkeys("abcd", 0.25))


@given(
    st.lists(st.tuples(st.sampled_from("abcdefgh"), st.integers(0, 99)), min_size=1, max_size=40),
    st.integers(0, 99),
)
def test_splits_are_whole_and_apart(items: list[tuple[str, int]], seed: int) -> None:
    labels, weights = [label for label, _ in items], [weight for _, weight in items]
    if len(set(labels)) < 2:
        return
    parts = split_members(labels, weights, {"train": 0.75, "test": 0.25}, seed)
    assert sorted(parts["train"] + parts["test"]) == list(range(len(items)))
    homes = [{labels[number] for number in numbers} for numbers in parts.values()]
    assert all(homes) and not homes[0] & homes[1]


def test_a_cache_changes_nothing(archive: Path, tmp_path: Path) -> None:
    plain = mcz.dataset(archive, window=64, stride=32, cache=0)
    kept = mcz.dataset(archive, window=64, stride=32, cache="5 MB")
    on_disk = [
        mcz.dataset(archive, window=64, stride=32, cache="5 MB", folder=tmp_path) for _ in "ab"
    ]
    for _ in "ab":
        for index in plain.order(0).tolist():
            for other in (kept, *on_disk):
                for name, array in plain[index].items():
                    np.testing.assert_array_equal(other[index][name], array)
    files = list(tmp_path.glob("*.features"))
    assert files
    files[0].write_bytes(files[0].read_bytes()[:-1] + b"\0")  # damaged: made anew
    for index in range(len(plain)):
        np.testing.assert_array_equal(on_disk[1][index]["root"], plain[index]["root"])


def test_caches_keep_their_size(tmp_path: Path) -> None:
    arrays = {"a": np.arange(100, dtype=np.float32).reshape(50, 2)}
    memory, folder = MemoryCache(1000), FolderCache(tmp_path, 1000)
    for number in range(5):
        memory.put(str(number), arrays)
        folder.put(str(number), arrays)
    assert [memory.get(str(n)) is None for n in range(5)] == [True] * 3 + [False] * 2
    assert [folder.get(str(n)) is None for n in range(5)] == [False] * 2 + [True] * 3
    np.testing.assert_array_equal(folder.get("0")["a"], arrays["a"])
    memory.put("much", {"a": np.zeros(2000)})
    assert memory.get("4") is not None
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) <= 1000
    assert FolderCache(tmp_path, 1000).get("1") is not None
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(mcz.AccessError):
        FolderCache(tmp_path / "file", 10)


@given(st.integers(0, 2**40), st.sampled_from([" MB", "kB", " GiB", "", " b"]))
def test_sizes(number: int, unit: str) -> None:
    factor = {"": 1, "B": 1, "KB": 1000, "MB": 10**6, "GIB": 2**30}[unit.strip().upper()]
    if number * factor < 2**62:
        assert to_size(f"{number}{unit}") == number * factor


def _sum(data: mcz.Dataset, index: int) -> float:
    return float(data[index]["root"].sum())


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_other_processes(archive: Path, method: str) -> None:
    data = mcz.dataset(archive, "root", window=64, stride=64)
    here = [_sum(data, index) for index in range(3)]
    with multiprocessing.get_context(method).Pool(1) as pool:
        assert pool.starmap(_sum, [(data, index) for index in range(3)]) == here


def test_threads_share_it(archive: Path) -> None:
    data = mcz.dataset(archive, "root", window=16, stride=3, cache="40 kB")
    here = [_sum(data, index) for index in range(len(data))]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda index: _sum(data, index), range(len(data)))) == here


def test_tensors(archive: Path) -> None:
    data = mcz.dataset(archive, window=32, stride=32)
    try:
        import torch
        from torch.utils.data import DataLoader
    except ImportError:
        with pytest.raises(mcz.OptionError, match="PyTorch is not installed"):
            data.torch()
        return
    tensors = data.torch()
    loader = DataLoader(tensors, batch_size=4, sampler=tensors.sampler(3), num_workers=1)
    order = data.order(3)
    for number, batch in enumerate(loader):
        numbers = order[4 * number : 4 * number + 4]
        for name, array in data[numbers].items():
            assert torch.equal(batch[name], torch.from_numpy(array))
    batches = tensors.batch_sampler(4, 3, workers=2)
    numbers_of_batches = list(batches)
    loader = DataLoader(tensors, batch_sampler=batches, num_workers=2)
    batches.set_epoch(0)
    for numbers, batch in zip(numbers_of_batches, loader, strict=True):
        assert torch.equal(batch["root"], torch.from_numpy(data[numbers]["root"]))
    assert torch.equal(tensors[0]["root"], torch.from_numpy(data[0]["root"]))
    clips = mcz.dataset(archive, "root").torch()
    assert len(clips) == 4 and clips[3]["root"].shape == (513, 3)


@pytest.mark.real
def test_real_clips(data: Path, tmp_path: Path) -> None:
    """AMCs of several subjects, of other bone lengths and with no rate, at 30 frames a second."""
    names = ["cmu/amc/01_01.amc", "cmu/amc/02_01.amc", "cmu/amc/05_01.amc"]
    for name in names:
        mcz.encode(data / name, tmp_path / f"{Path(name).stem}.mcz")
    windows = mcz.dataset(tmp_path, rate=30, source_rate=120, window=64, unit="m")
    assert windows.shapes == {"rot6d": (31, 6), "positions": (31, 3), "root": (3,)}
    parts = windows.split({"train": 0.7, "test": 0.3}, pattern=r"(\d+)_\d+$")
    assert sum(map(len, parts.values())) == len(windows) > 10
    window = windows.window(5)
    motion = mcz.resample(mcz.read(data / "cmu/amc" / f"{window.clip[-5:]}.amc", rate=120), 30)
    whole = mcz.positions(motion, unit="m")[window.start : window.stop]
    np.testing.assert_allclose(windows[5]["positions"], whole, atol=1e-6)
