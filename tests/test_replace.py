"""One joint of a clip with other values, and nothing else touched."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import codecs
from mcz.codecs import raw
from mcz.codecs.wavelet.threshold_codecs import MRDWT
from mcz.errors import AccessError, MotionError, OptionError
from mcz.files.editing.recoding import recorded_options
from mcz.model.motion import Channel, Motion, Signal
from mcz.model.numbers import Grid, GridKind
from tests import overlap_codec
from tests.commands import run
from tests.motions import motions, smooth

CASES = {
    "raw": ("raw", {"segment_frames": 100}),
    "fast": ("fast", {"segment_frames": 100}),
    "mrdwt": ("mrdwt", {"segment_frames": 128}),
    "mrdwt-khan2016": ("mrdwt", {"preset": "khan2016"}),
    "mrdwt-decimals": ("mrdwt", {"Q": 2, "T_g": 0.5, "segment_frames": 128}),
    "qbc": ("qbc", {"segment_frames": 160}),
    "qbc-khan2014": ("qbc", {"preset": "khan2014"}),
    "dwt": ("dwt", {"segment_frames": 128}),
    "dwt-khan2014": ("dwt", {"preset": "khan2014"}),
    "awt": ("awt", {"a_w": 150}),
    "qbc-fewest": ("qbc", {"breaks": "fewest", "d2_lmt": 0.5}),
}
LOSSLESS = ("raw", "fast")


@pytest.fixture(autouse=True)
def known_codecs(monkeypatch: pytest.MonkeyPatch) -> None:
    for codec in (
        overlap_codec.CODEC,
        replace(raw.CODEC, id=254, name="one", grouping="all"),
    ):
        monkeypatch.setitem(codecs.CODECS, codec.name, codec)


def write_bytes(motion: Motion, codec: str = "fast", **params: Any) -> bytes:
    out = io.BytesIO()
    mcz.write(motion, out, codec, **params)
    return out.getvalue()


def replace_values(data: bytes, joint: int | str, values: Any, **options: Any) -> tuple[bytes, Any]:
    """The file with other values, checked as a whole."""
    out = io.BytesIO()
    with mcz.open(data) as file:
        found = mcz.replace(file, None, joint, values, out, **options)
    assert found.size == len(out.getvalue())
    assert mcz.verify(out.getvalue()) == []
    return out.getvalue(), found


def values_of(data: bytes, joint: str | None = None) -> np.ndarray:
    with mcz.open(data) as file:
        return file.only_clip().read(joints=None if joint is None else [joint])


def check_others(before: bytes, after: bytes, *joints: str) -> None:
    """All joints but these have the bits that they had, segments and headers are the same."""
    with mcz.open(before) as a, mcz.open(after) as b:
        old, new = a.only_clip(), b.only_clip()
        others = [n for n in old.skeleton.addresses() if n not in joints]
        assert new.read(joints=others).tobytes() == old.read(joints=others).tobytes()
        for one, other in zip(old.signals, new.signals, strict=True):
            assert one.header == other.header
            assert [row.header for row in one.rows] == [row.header for row in other.rows]


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("joint", ["spine", "knee"])
def test_the_joint_changes_and_nothing_else(case: str, joint: str) -> None:
    codec, params = CASES[case]
    data = write_bytes(smooth(500), codec, **params)
    wave = np.round(10 * np.cos(np.arange(500) * 0.11), 4)
    new = np.round(values_of(data, joint) + wave[:, None], 4)
    after, found = replace_values(data, joint, new)
    assert (found.clip, found.joint, found.codec) == ("smooth", joint, codec)
    check_others(data, after, joint)
    error = np.abs(values_of(after, joint) - new)
    assert found.max_error == error.max()
    if codec in LOSSLESS:
        assert not error.any()
        whole = smooth(500).with_values(values_of(after))
        assert len(write_bytes(whole, codec, **params)) == len(after)
    else:
        assert 0 < error.max() < 9


def test_the_bound_of_qbc_holds_for_the_new_values() -> None:
    data = write_bytes(smooth(500), "qbc", d2_lmt=0.25, segment_frames=160)
    new = 40 * np.sin(np.arange(500)[:, None] * np.array([0.3, 0.2, 0.1]))
    after, found = replace_values(data, "spine", new)
    distances = ((values_of(after, "spine") - new) ** 2).sum(axis=1)
    assert distances.max() <= 0.25 + 1e-9
    assert found.max_error <= 0.5


@pytest.mark.parametrize("case", ["mrdwt", "mrdwt-decimals", "mrdwt-khan2016", "dwt", "awt"])
def test_wavelets_lose_no_more_than_before(case: str) -> None:
    codec, params = CASES[case]
    motion = smooth(500)
    data = write_bytes(motion, codec, **params)
    new = motion.values[:, 6:9][::-1].copy()
    _, found = replace_values(data, "spine", new)
    before = np.abs(values_of(data, "spine") - motion.values[:, 6:9]).max()
    assert found.max_error <= 2 * before + 1e-6


def test_a_wavelet_channel_that_was_zero_gets_a_step() -> None:
    motion = smooth(300)
    values = motion.values.copy()
    values[:, 9] = 0
    data = write_bytes(motion.with_values(values), "mrdwt")
    new = 20 * np.sin(np.arange(300) * 0.1)
    _, found = replace_values(data, "knee", new)  # one channel: one dimension will do
    assert found.max_error < 2
    assert found.joint_bytes > found.joint_bytes_before == 0


def test_the_same_values_give_the_same_streams() -> None:
    for codec in LOSSLESS:
        data = write_bytes(smooth(300), codec, segment_frames=70)
        after, found = replace_values(data, "hips", values_of(data, "hips"))
        assert found.joint_bytes == found.joint_bytes_before
        assert after == data


def _with_copies(n_frames: int = 300) -> Motion:
    """The knee repeats the last channel of the spine, but for the first 100 frames."""
    motion = smooth(n_frames)
    values = motion.values.copy()
    values[100:, 9] = values[100:, 8]
    return motion.with_values(values)


def test_joints_that_repeat_the_joint_keep_their_values() -> None:
    data = write_bytes(_with_copies(), segment_frames=100)
    new = np.round(values_of(data, "spine") + 1, 4)
    after, _ = replace_values(data, "spine", new)
    assert np.array_equal(values_of(after, "knee"), values_of(data, "knee"))
    assert np.array_equal(values_of(after, "spine"), new)
    check_others(data, after, "spine")


def test_a_joint_that_repeats_another_leaves_it_alone() -> None:
    data = write_bytes(_with_copies(), segment_frames=100)
    new = np.round(values_of(data, "knee") + 1, 4)
    after, _ = replace_values(data, "knee", new)
    check_others(data, after, "knee")
    assert np.array_equal(values_of(after, "knee"), new)


def test_the_source_file_is_the_edited_one(samples: Path, tmp_path: Path) -> None:
    for suffix in ("bvh", "amc"):
        source, target = samples / f"walk.{suffix}", tmp_path / f"{suffix}.mcz"
        motion = mcz.read(source)
        mcz.write(motion, target)
        joint = motion.skeleton.addresses()[0]
        values = motion.values.copy()
        values[10:20, :3] += [0.25, 0.5, 1e-7]  # the last has more digits than the grid
        mcz.replace(target, None, joint, values[:, : len(motion.skeleton.joints[0].channels)])
        with mcz.open(target) as file:
            clip = file.only_clip()
            text = clip.source_bytes()
            assert clip.source and clip.source.size == len(text)
            assert clip.read().tolist() == values.tolist()
        expected = io.BytesIO()
        mcz.write(motion.with_values(values), expected)
        with mcz.open(expected.getvalue()) as file:
            assert file.only_clip().source_bytes() == text
        assert mcz.verify(target) == []
        assert text != source.read_bytes()


def test_on_grid_rounds_to_what_the_source_prints(samples: Path) -> None:
    motion = mcz.read(samples / "walk.bvh")
    data = write_bytes(motion)
    new = values_of(data, motion.skeleton.addresses()[1]) + 1 / 3
    exact, found = replace_values(data, 1, new)
    assert found.max_error == 0
    rounded, found_rounded = replace_values(data, 1, new, on_grid=True)
    assert 0 < found_rounded.max_error < 1e-3
    assert found_rounded.joint_bytes <= found.joint_bytes + 8
    assert len(rounded) < len(exact)
    with mcz.open(rounded) as file:
        assert not len(file.only_clip().motion().signals[0].exceptions)
    assert np.abs(values_of(rounded) - values_of(exact)).max() < 1e-3


def test_markers_keep_their_source(samples: Path) -> None:
    motion = mcz.read(samples / "walk.c3d")
    data = write_bytes(motion)
    name = motion.skeleton.addresses()[3]
    values = values_of(data, name)
    moved = values + np.float32(8)
    after, _ = replace_values(data, name, moved, on_grid=True)
    with mcz.open(after) as file:
        clip = file.only_clip()
        assert np.allclose(clip.read(joints=[name]), moved, equal_nan=True, atol=1e-3)
        assert clip.source and len(clip.source_bytes()) == clip.source.size
    check_others(data, after, name)
    bad = moved.copy()
    bad[5, 1] = np.nan
    with pytest.raises(MotionError, match=r"frame 5 of .*ty is NaN"):
        replace_values(data, name, bad)


def test_binary_grids_say_what_they_hold() -> None:
    values = np.float32(smooth(20).values).astype(np.float64)
    motion = Motion(smooth().skeleton, (Signal(values, (Grid(GridKind.BINARY32),) * 10),))
    data = write_bytes(motion)
    with pytest.raises(MotionError, match=r"frame 0 of knee.rx: its grid BINARY32 .* on_grid"):
        replace_values(data, "knee", np.full(20, 0.1))
    after, found = replace_values(data, "knee", np.full(20, 0.1), on_grid=True)
    assert values_of(after, "knee")[0, 0] == np.float32(0.1)
    assert 0 < found.max_error < 1e-8
    with pytest.raises(MotionError, match="does not hold"):
        replace_values(data, "knee", np.full(20, 1e300), on_grid=True)


def test_integers_stay_integers() -> None:
    values = np.arange(200).reshape(20, 10)
    data = write_bytes(Motion(smooth().skeleton, (Signal(values),)))
    after, _ = replace_values(data, "knee", np.arange(20.0))
    assert values_of(after, "knee")[:, 0].tolist() == list(range(20))
    for number in (0.5, 2.0**54, np.inf):
        with pytest.raises(MotionError, match="integers"):
            replace_values(data, "knee", np.full(20, number))
    after, found = replace_values(data, "knee", np.full(20, 0.75), on_grid=True)
    assert found.max_error == 0.25
    assert values_of(after, "knee").tolist() == [[1]] * 20


@pytest.mark.parametrize("codec", ["raw", "fast", "mrdwt", "qbc"])
def test_nan_is_invalid_where_there_is_no_source(codec: str) -> None:
    motion = smooth(60)
    mask = np.ones(motion.values.shape, bool)
    mask[10:20, 6:9] = False
    motion = replace(motion, signals=(replace(motion.signals[0], mask=mask),))
    data = write_bytes(motion, codec)
    new = values_of(data, "spine")
    assert np.isnan(new[10:20]).all()
    new[10:20] = 5.0  # a gap is filled, another one made
    new[30:33, 1] = np.nan
    after, _ = replace_values(data, "spine", new)
    found = values_of(after, "spine")
    assert np.array_equal(np.isnan(found), np.isnan(new))
    check_others(data, after, "spine")
    assert np.array_equal(values_of(after, "hips"), values_of(data, "hips"))
    new[:] = 1.0
    after, _ = replace_values(after, "spine", new)
    assert not np.isnan(values_of(after)).any()


@pytest.mark.parametrize("case", CASES)
def test_a_clip_that_was_cut(case: str, tmp_path: Path) -> None:
    codec, params = CASES[case]
    whole, part = tmp_path / "whole.mcz", tmp_path / "part.mcz"
    mcz.write(smooth(700), whole, codec, **params)
    mcz.extract(whole, part, frames=(230, 415))
    data = part.read_bytes()
    new = np.round(values_of(data, "spine") * 0.5 + 3, 4)
    after, found = replace_values(data, "spine", new)
    check_others(data, after, "spine")
    assert np.abs(values_of(after, "spine") - new).max() == found.max_error < 8
    assert np.array_equal(values_of(after)[:, :6], values_of(data)[:, :6])
    with mcz.open(after) as file:
        quality = file.only_clip().quality
        assert quality and quality["cut-frames"] == "230:415"
        assert quality["edit-joints"] == "spine"


@pytest.mark.parametrize("codec", ["mrdwt", "qbc"])
def test_a_clip_without_its_finest_details(codec: str, tmp_path: Path) -> None:
    whole, part = tmp_path / "whole.mcz", tmp_path / "part.mcz"
    mcz.write(smooth(300), whole, codec)
    mcz.extract(whole, part, resolution=1)
    new = np.linspace(0, 50, 300)
    after, data = replace_values(part.read_bytes(), "knee", new)
    check_others(part.read_bytes(), after, "knee")
    assert data.max_error < 2


def test_the_quality_record_says_what_is_known() -> None:
    data = write_bytes(smooth(200), "qbc")
    with mcz.open(data) as file:
        before = file.only_clip().quality
    after, found = replace_values(data, "knee", np.zeros(200))
    with mcz.open(after) as file:
        record = file.only_clip().quality
    assert before and record
    assert record["edit-joints"] == "knee"
    assert record["codec"] == "qbc" and record["param.preset"] == "default"
    assert record["unedited_mse"] == before["mse"] and "mse" not in record
    assert float(record["edit_mse"]) <= found.max_error**2
    twice, _ = replace_values(after, "spine", np.ones((200, 3)))
    with mcz.open(twice) as file:
        again = file.only_clip().quality
    assert again and again["edit-joints"] == "knee,spine"
    assert again["unedited_mse"] == before["mse"] and "unedited_edit_mse" not in again
    assert "edit_mse" in again and "edit_edit_mse" not in again


def test_a_lossless_clip_has_no_record() -> None:
    after, _ = replace_values(write_bytes(smooth(20)), "knee", np.zeros(20))
    with mcz.open(after) as file:
        assert file.only_clip().quality is None


def test_recorded_options_forgive() -> None:
    said = {"param.T_g": "0.5", "param.Q": "many", "param.kbps": "3", "param.wavelet": "db2"}
    options = recorded_options(MRDWT, said)
    assert (options["T_g"], options["Q"], options["kbps"]) == (0.5, None, None)
    assert options["preset"] == "default" and options["wavelet"] == "db2"


def _archive(tmp_path: Path, samples: Path) -> Path:
    folder = tmp_path / "in"
    folder.mkdir()
    for name in ("walk.amc", "walk.asf", "walk.bvh", "walk.c3d"):
        (folder / name).write_bytes((samples / name).read_bytes())
    (folder / "copy.bvh").write_bytes((samples / "walk.bvh").read_bytes())
    (folder / "notes.txt").write_bytes(b"notes")
    target = tmp_path / "all.mcz"
    mcz.pack(folder, target)
    return target


def test_other_clips_and_files_stay(tmp_path: Path, samples: Path) -> None:
    packed = _archive(tmp_path, samples)
    out = tmp_path / "out.mcz"
    with mcz.open(packed) as file:
        aliases = {name for name, (of, _) in file.aliases.items() if of == 0}
        name = next(n for n, clip in file.clips.items() if clip.source.format == "bvh")
        clip = file.clips[name]
        joint = clip.skeleton.addresses()[0]
        new = clip.read(joints=[joint])
        new[:, 0] += 1
        found = mcz.replace(file, name, joint, new, out)
        rows = file.container.directory.clips
        before = {
            n: [file.container.payload(s.chunk()) for s in rows[n].segments] for n in file.clips
        }
        attachments = {n: a.read() for n, a in file.attachments.items()}
    assert mcz.verify(out) == []
    with mcz.open(out) as file:
        rows = file.container.directory.clips
        assert list(file.clips) == list(before)
        for other in before:
            now = [file.container.payload(s.chunk()) for s in rows[other].segments]
            assert (now == before[other]) == (other != name)
        assert {n: a.read() for n, a in file.attachments.items()} == attachments
        assert not aliases & set(file.aliases)
        assert np.array_equal(file.clips[name].read(joints=[joint]), new)
    assert any("identical" in text for text in found.left_out) == bool(aliases)
    with pytest.raises(OptionError, match="choose one"):
        mcz.replace(packed, None, joint, new, tmp_path / "no.mcz")


def test_in_place(tmp_path: Path) -> None:
    path, link = tmp_path / "a.mcz", tmp_path / "link.mcz"
    mcz.write(smooth(50), path)
    link.symlink_to(path)
    mcz.replace(link, "smooth", "knee", np.zeros(50))
    assert link.is_symlink() and not values_of(path.read_bytes(), "knee").any()
    before = path.read_bytes()
    with pytest.raises(MotionError):
        mcz.replace(path, "smooth", "knee", np.zeros(49))
    with pytest.raises(OptionError, match="the output is the input itself"):
        mcz.replace(path, "smooth", "knee", np.ones(50), path)
    assert path.read_bytes() == before
    for target in (path, link):
        with pytest.raises(OptionError, match="the output is the input itself"):
            mcz.replace(path, "smooth", "knee", np.ones(50), target, force=True)
    assert path.read_bytes() == before
    mcz.replace(path, "smooth", "knee", np.ones(50))
    assert values_of(path.read_bytes(), "knee").all()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.mcz", "link.mcz"]
    with pytest.raises(OptionError, match="in place"):
        mcz.replace(before, None, "knee", np.ones(50))
    with pytest.raises(AccessError):
        mcz.replace(tmp_path / "none.mcz", None, "knee", np.ones(50))


def test_in_place_waits_for_no_appender(tmp_path: Path) -> None:
    fcntl = pytest.importorskip("fcntl")
    path = tmp_path / "a.mcz"
    mcz.write(smooth(50), path)
    with path.open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(AccessError, match="another process"):
            mcz.replace(path, None, "knee", np.zeros(50))


REFUSED = {
    "no such joint": ("nose", np.zeros(20), MotionError, "no joint 'nose'"),
    "has no channels": (
        "fixed",
        np.zeros((20, 0)),
        OptionError,
        "has no channels",
    ),
    "frames": ("spine", np.zeros((19, 3)), MotionError, r"\(20, 3\), not \(19, 3\)"),
    "channels": ("spine", np.zeros(20), MotionError, r"\(20, 3\), not \(20,\)"),
    "text": ("knee", ["a"] * 20, MotionError, "not numbers"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_suit_is_refused(case: str) -> None:
    joint, values, error, message = REFUSED[case]
    with pytest.raises(error, match=message):
        replace_values(write_bytes(smooth(20)), joint, values)


def test_codecs_that_cannot_say_why() -> None:
    with pytest.raises(OptionError, match="codes its channels together with those of hips"):
        replace_values(write_bytes(smooth(20), "one"), "knee", np.zeros(20))
    with pytest.raises(OptionError, match="codec pca codes its channels together with"):
        replace_values(write_bytes(smooth(20), "pca"), "knee", np.zeros(20))
    with pytest.raises(OptionError, match="overlap cannot re-encode a single joint"):
        replace_values(write_bytes(smooth(20), "overlap"), "knee", np.zeros(20))
    for codec in ("mrdwt", "qbc"):
        with pytest.raises(MotionError, match="not finite"):
            replace_values(write_bytes(smooth(20), codec), "knee", np.full(20, np.inf))
    own = Signal(np.zeros((20, 1)), channels=(Channel("", "force"),))
    with pytest.raises(OptionError, match="not made of joints"):
        replace_values(write_bytes(Motion(smooth().skeleton, (own,))), 0, np.zeros(20))
    with mcz.open(write_bytes(smooth(20)), salvage=True) as file, pytest.raises(OptionError):
        mcz.replace(file, None, "knee", np.zeros(20), io.BytesIO())


def test_frames_of_none() -> None:
    for codec in ("raw", "fast", "mrdwt", "qbc"):
        replace_values(write_bytes(smooth(0), codec), "spine", np.zeros((0, 3)))
        after, _ = replace_values(write_bytes(smooth(1), codec), "spine", np.ones((1, 3)))
        assert np.abs(values_of(after, "spine") - 1).max() <= (0 if codec in LOSSLESS else 0.5)


@given(motions(), st.sampled_from(LOSSLESS), st.integers(0, 2**32))
def test_any_values_come_back(motion: Motion, codec: str, seed: int) -> None:
    data = write_bytes(motion, codec, segment_frames=5)
    words = np.random.default_rng(seed).integers(0, 2**64, (motion.n_frames, 3), np.uint64)
    new = words.view(np.float64)
    after, _ = replace_values(data, "spine", new)
    found = values_of(after, "spine")
    assert np.array_equal(found.view(np.int64), np.where(np.isnan(new), np.nan, new).view(np.int64))
    check_others(data, after, "spine")


def test_a_stranger_among_copies() -> None:
    """Another encoder may code a channel twice and have a third repeat the second."""
    motion = smooth(50)
    values = motion.values.copy()
    values[:, 7] = values[:, 9] = values[:, 0]
    data = write_bytes(motion.with_values(values))
    after, _ = replace_values(data, "hips", np.round(values[:, :6] + 1, 4))
    assert np.array_equal(values_of(after)[:, 6:], values[:, 6:])


@pytest.fixture
def walk(samples: Path, tmp_path: Path) -> Path:
    target = tmp_path / "walk.mcz"
    mcz.encode(samples / "walk.bvh", target)
    return target


@pytest.mark.parametrize("suffix", ["csv", "npz"])
def test_command(walk: Path, suffix: str, capsys: pytest.CaptureFixture[str]) -> None:
    table, out = walk.with_suffix(f".{suffix}"), walk.with_name("out.mcz")
    with mcz.open(walk) as file:
        joint = file.only_clip().skeleton.addresses()[2]
        before = file.only_clip().read()
    assert run("decode", walk, "--to", suffix, "-o", table) == 0
    assert run("replace", walk, out, "--joint", joint, "--values", table) == 0
    assert joint in capsys.readouterr().out
    assert np.array_equal(values_of(out.read_bytes()), before)
    arguments = ("replace", walk, out, "--joint", joint, "--values", table, "--json")
    assert run(*arguments) == 2  # it exists
    capsys.readouterr()
    assert run(*arguments, "--force", "--on-grid") == 0
    output = json.loads(capsys.readouterr().out)
    assert output["joint"] == joint and output["max_error"] == 0
    before = walk.read_bytes()
    edit = ("--joint", joint, "--values", table)
    assert run("replace", walk, walk, *edit, "--force") == 2
    assert "--in-place" in capsys.readouterr().err
    assert run("replace", walk, table, *edit, "--force") == 2
    assert run("replace", walk, *edit) == 2
    assert run("replace", walk, out, *edit, "--in-place", "--force") == 2
    assert walk.read_bytes() == before
    assert run("replace", walk, *edit, "--in-place") == 0


def test_command_takes_columns_alone(walk: Path, tmp_path: Path) -> None:
    with mcz.open(walk) as file:
        clip = file.only_clip()
        joint, n = clip.skeleton.addresses()[2], clip.n_frames
    table = tmp_path / "plain.csv"
    table.write_text("1,2,3\n" * n)
    out = walk.with_name("out.mcz")
    assert run("replace", walk, out, "--joint", joint, "--values", table) == 0
    assert values_of(out.read_bytes(), joint).tolist() == [[1, 2, 3]] * n
    np.savez(tmp_path / "plain.npz", values=np.full((n, 3), 4.0))
    args = ("--joint", joint, "--values", tmp_path / "plain.npz", "--force")
    assert run("replace", walk, out, *args) == 0
    assert values_of(out.read_bytes(), joint).tolist() == [[4, 4, 4]] * n


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.csv", b"1,2\n3,4\n"),
        ("a.csv", b"1,2\n3\n"),
        ("a.csv", b"frame,x\n1,z\n"),
        ("a.csv", b"\xff\xfe\x00"),
        ("a.csv", b""),
        ("a.npz", b"PK"),
        ("a.npz", b""),
    ],
)
def test_command_refuses_other_tables(
    walk: Path, tmp_path: Path, name: str, content: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    table, out = tmp_path / name, tmp_path / "out.mcz"
    table.write_bytes(content)
    assert run("replace", walk, out, "--joint", "1", "--values", table) == 1
    assert name in capsys.readouterr().err
    assert not out.exists()


def test_command_needs_files(walk: Path, tmp_path: Path) -> None:
    assert run("replace", walk, "-", "--joint", "1", "--values", walk) == 2
    assert run("replace", walk, tmp_path / "o.mcz", "--joint", "1", "--values", "none.csv") == 1
