"""Joints of clips whose codec codes all joints in one, decoded and coded anew."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.codecs import codec_by_name
from mcz.container.writer import Writer
from mcz.errors import OptionError
from mcz.files.editing.recoding import recorded_options
from mcz.files.writing.clip_writer import write_plan
from mcz.files.writing.planning import prepare
from mcz.files.writing.tuning import tuned_plan
from tests.commands import run
from tests.motions import smooth

CHANNELS = {"posewave": {"step": 0.01}, "pca": {}}
POSITIONS: dict[str, dict[str, Any]] = {
    "lsdt-clip": {"step": 0.01},
    "lsdt-frame": {"step": 0.01},
    "online": {"step": 0.01},
    "mdtt": {"step": 0.01},
}
CODECS = {**CHANNELS, **POSITIONS}


def write_bytes(motions: list[mcz.Motion], codec: str) -> bytes:
    out = io.BytesIO()
    writer = Writer(out)
    for one in motions:
        found, params = codec_by_name(codec), CODECS[codec]
        plan = tuned_plan(prepare(one, found, params), found, params, writer.profile)
        write_plan(writer, plan)
    writer.finish()
    return out.getvalue()


def motion(name: str = "one", n_frames: int = 40) -> mcz.Motion:
    found = replace(smooth(n_frames), name=name)
    return replace(found, skeleton=replace(found.skeleton, unit_cm=1.0))


def clip(data: bytes, name: str = "one") -> Any:
    return mcz.open(data).clips[name]


def columns(held: Any, *joints: str) -> list[int]:
    return [c for joint in joints for c in held.skeleton.columns(held.skeleton.find(joint))]


@pytest.mark.parametrize("codec", CODECS)
def test_joints_are_extracted(codec: str) -> None:
    whole, out = write_bytes([motion()], codec), io.BytesIO()
    with pytest.raises(OptionError, match="coded together .* recode"):
        mcz.extract(whole, io.BytesIO(), joints=["hips"])
    found = mcz.extract(whole, out, joints=["knee", "hips"], frames=(5, 30), recode=True)
    before, after = clip(whole), clip(out.getvalue())
    assert found.clips[0].recoded and found.clips[0].joints == ("hips", "knee")
    assert after.n_frames == 25 and after.codec == codec
    assert [len(joint.channels) > 0 for joint in after.skeleton.joints] == [
        joint.name in ("hips", "knee") for joint in after.skeleton.joints
    ]
    wanted = before.values[5:30][:, columns(before, "hips", "knee")]
    assert np.abs(after.values[:] - wanted).max() < 1.0
    record = after.quality
    assert record["cut-joints"] == "hips,knee" and record["cut-frames"] == "5:30"
    assert record["cut-recoded"] == "yes" and record["codec"] == codec
    assert record["uncut_mse"] == before.quality["mse"]
    assert float(record["mse"]) == pytest.approx(np.mean((after.values[:] - wanted) ** 2))
    assert mcz.verify(out.getvalue()) == []


@pytest.mark.parametrize("codec", CODECS)
def test_a_joint_is_replaced(codec: str) -> None:
    whole, out = write_bytes([motion("other"), motion()], codec), io.BytesIO()
    before = clip(whole)
    own = columns(before, "knee")
    given = before.values[:, own] + 0.5
    with pytest.raises(OptionError, match="together with .* recode"):
        mcz.replace(whole, "one", "knee", given, io.BytesIO())
    found = mcz.replace(whole, "one", "knee", given, out, recode=True)
    after = clip(out.getvalue())
    wanted = before.values[:]
    wanted[:, own] = given
    off = np.abs(after.values[:] - wanted)
    others = np.delete(off, own, axis=1)
    assert (found.max_error, found.others_error) == (off[:, own].max(), others.max())
    assert found.is_recoded and off.max() < 1.0
    record = after.quality
    assert record["edit-joints"] == "knee" and record["edit-recoded"] == "yes"
    assert record["unedited_mse"] == before.quality["mse"]
    assert float(record["edit_mse"]) == pytest.approx(np.mean(off**2))
    assert {k: v for k, v in record.items() if k.startswith("param.step")} == {
        k: v for k, v in before.quality.items() if k.startswith("param.step")
    }
    same, was = clip(out.getvalue(), "other"), clip(whole, "other")
    assert np.array_equal(same.values[:], was.values[:]) and same.quality == was.quality
    assert mcz.verify(out.getvalue()) == []


def test_a_lossless_clip_is_coded_anew_without_an_error() -> None:
    values = motion().values.copy()
    values[3, 2], values[7, 9] = 1 / 3, -0.0  # on no grid; with a sign
    given = motion().with_values(values)
    out = io.BytesIO()
    mcz.write(given, out, codec="best", segment_frames=15)
    data, part, edited = out.getvalue(), io.BytesIO(), io.BytesIO()
    with pytest.raises(OptionError, match=r"with those of spine; recode=True re-encodes them$"):
        mcz.extract(data, io.BytesIO(), joints=["hips"])
    found = mcz.extract(data, part, joints=["hips", "knee"], frames=(2, 20), recode=True)
    own = columns(clip(data), "hips", "knee")
    assert found.clips[0].recoded and clip(part.getvalue()).quality is None
    assert clip(part.getvalue()).values[:].tobytes() == values[2:20][:, own].tobytes()
    knee = columns(clip(data), "knee")
    done = mcz.replace(data, None, "knee", values[:, knee] + 0.5, edited, recode=True)
    assert done.is_recoded and (done.max_error, done.others_error) == (0, 0)
    values[:, knee] += 0.5
    after = clip(edited.getvalue())
    assert after.codec == "best" and after.values[:].tobytes() == values.tobytes()
    assert mcz.verify(part.getvalue()) == mcz.verify(edited.getvalue()) == []


def test_an_edit_of_an_edit_remembers_both() -> None:
    data = write_bytes([motion()], "posewave")
    for joint in ("knee", "spine"):
        out = io.BytesIO()
        given = clip(data).values[:, columns(clip(data), joint)]
        mcz.replace(data, None, joint, given, out, recode=True)
        data = out.getvalue()
    record = clip(data).quality
    assert record["edit-joints"] == "knee,spine"
    assert sum(key.startswith("unedited_unedited") for key in record) == 0


def test_the_source_of_a_replaced_joint_follows(samples: Path, tmp_path: Path) -> None:
    mcz.encode(samples / "walk.bvh", tmp_path / "a.mcz", codec="posewave", params={"step": 0.05})
    with mcz.open(tmp_path / "a.mcz") as file:
        held = file.clips["walk"]
        joint = held.skeleton.addresses()[3]
        given = held.values[:, columns(held, joint)]
    mcz.replace(tmp_path / "a.mcz", None, joint, given, recode=True)
    with mcz.open(tmp_path / "a.mcz") as file:
        held = file.clips["walk"]
        (tmp_path / "b.bvh").write_bytes(held.source_bytes())
        assert np.allclose(mcz.read(tmp_path / "b.bvh").values, held.values[:], atol=1e-3)
    assert mcz.verify(tmp_path / "a.mcz") == []


def test_what_cannot_be_coded_anew() -> None:
    out = io.BytesIO()
    mcz.write(motion(), out, codec="posewave", step=0.01, lossless="knee")
    with pytest.raises(OptionError, match="are exact, and re-encoding would not keep them exact"):
        mcz.extract(out.getvalue(), io.BytesIO(), joints=["spine"], recode=True)
    lossless = io.BytesIO()
    mcz.write(motion(), lossless)
    copied, plain = io.BytesIO(), io.BytesIO()
    mcz.extract(lossless.getvalue(), copied, joints=["spine"], recode=True)
    mcz.extract(lossless.getvalue(), plain, joints=["spine"])
    assert copied.getvalue() == plain.getvalue()  # nothing had to be coded anew


def stored_frames(data: bytes) -> list[int]:
    """The frames that each signal of a clip stores."""
    return [sum(row.header.n_frames for row in info.rows) for info in clip(data).signals]


def test_what_is_cut_off_is_not_in_the_bytes() -> None:
    """Two clips that differ in the frames alone that are cut off make the same file."""
    values = motion().values.copy()
    values[20:] += 7
    found = []
    for one in (motion(), motion().with_values(values)):
        whole, out = io.BytesIO(), io.BytesIO()
        mcz.write(one, whole, codec="raw")
        mcz.extract(whole.getvalue(), out, frames=(0, 20), recode=True)
        found.append(out.getvalue())
    assert found[0] == found[1]


@pytest.mark.parametrize("suffix", ["amc", "bvh", "c3d"])
@pytest.mark.parametrize("codec", ["fast", "lossy"])
def test_the_source_of_frames_that_are_coded_anew_follows(
    samples: Path, tmp_path: Path, suffix: str, codec: str
) -> None:
    whole, part = tmp_path / "a.mcz", tmp_path / "b.mcz"
    params = {"step": 0.05} if codec == "lossy" else {}
    mcz.encode(samples / f"walk.{suffix}", whole, codec=codec, params=params)
    mcz.extract(whole, part, frames=(37, 101), recode=True)
    with mcz.open(whole) as old, mcz.open(part) as new:
        held = new.clips["walk"]
        assert held.source is not None and held.n_frames == 64
        (tmp_path / f"b.{suffix}").write_bytes(held.source_bytes())
        if codec == "fast":
            assert held.source_bytes() == old.clips["walk"].source_bytes((37, 101))
    skeleton = {"skeleton": samples / "walk.asf"} if suffix == "amc" else {}
    assert mcz.read(tmp_path / f"b.{suffix}", **skeleton).n_frames == 64
    assert mcz.verify(part) == []


def test_exact_joints_stay_exact_where_frames_are_cut() -> None:
    out, part = io.BytesIO(), io.BytesIO()
    mcz.write(motion(), out, codec="posewave", step=0.01, lossless="knee")
    mcz.extract(out.getvalue(), part, frames=(5, 30), recode=True)
    knee = columns(clip(out.getvalue()), "knee")
    wanted = clip(out.getvalue()).values[5:30][:, knee]
    assert clip(part.getvalue()).values[:][:, knee].tobytes() == wanted.tobytes()
    assert stored_frames(part.getvalue()) == [25]


def test_settings_are_read_as_they_are_recorded() -> None:
    given = {"contacts": "knee:5+10,hips", "quality": "knee=0.5mm", "step": 0.01}
    out = io.BytesIO()
    mcz.write(motion(), out, codec="posewave", **given)
    codec = codec_by_name("posewave")
    found = recorded_options(codec, clip(out.getvalue()).quality)
    assert found == codec.options(given)


def test_contacts_are_left_out_where_joints_are() -> None:
    out, part = io.BytesIO(), io.BytesIO()
    mcz.write(motion(), out, codec="posewave", step=0.01, contacts="knee:5+10")
    found = mcz.extract(out.getvalue(), part, joints=["hips"], recode=True)
    assert any("its contacts" in text for text in found.left_out)
    assert "param.contacts" not in clip(part.getvalue()).quality
    again = io.BytesIO()
    given = clip(out.getvalue()).values[:, columns(clip(out.getvalue()), "hips")]
    mcz.replace(out.getvalue(), None, "hips", given, again, recode=True)
    assert clip(again.getvalue()).quality["param.contacts"] == "knee:5+10"


def test_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole, part, table = tmp_path / "a.mcz", tmp_path / "b.mcz", tmp_path / "knee.csv"
    whole.write_bytes(write_bytes([motion()], "posewave"))
    assert run("extract", whole, part, "--joints", "knee") == 2
    assert "--recode re-encodes them" in capsys.readouterr().err
    assert not part.exists()
    assert run("extract", whole, part, "--joints", "knee", "--recode") == 0
    assert "joints knee, re-encoded, data" in capsys.readouterr().out
    assert run("decode", part, "--to", "csv", "-o", table) == 0
    assert run("replace", whole, "--in-place", "--joint", "knee", "--values", table) == 2
    line = ("replace", whole, "--in-place", "--joint", "knee", "--values", table, "--recode")
    capsys.readouterr()
    assert run(*line) == 0
    shown = capsys.readouterr().out
    assert "knee of one, re-encoded:" in shown and ", others " in shown
