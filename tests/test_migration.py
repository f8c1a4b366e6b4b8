"""The way from format 0.9: what is read from the old file is in the new one, and proved.

Package 0.9 is not here: today's takes its place, of a file of today. The reader uses names alone
that both have.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from fractions import Fraction
from hashlib import sha256 as digest
from pathlib import Path

import numpy as np
import pytest

import mcz
from tests.motions import smooth
from tools.migrate_0_9 import __main__ as migration


def sha256(data: bytes) -> str:
    return digest(data).hexdigest()


ROOT = Path(mcz.__file__).parent.parent


def migrate_file(old: Path, *options: str) -> Path:
    new = old.with_name(f"new-{old.name}")
    words = ["--python-0-9", sys.executable, "--path-0-9", str(ROOT), str(old), str(new)]
    migration.main([*options, *words])
    assert mcz.verify(new) == []
    return new


def unpack_hashes(path: Path) -> dict[str, str]:
    """Name and SHA-256 of every file that comes out."""
    folder = path.with_suffix("")
    mcz.unpack(path, folder)
    files = (each for each in folder.rglob("*") if each.is_file())
    return {str(each.relative_to(folder)): sha256(each.read_bytes()) for each in files}


def test_times_of_a_table_are_a_signal_of_their_own(tmp_path: Path) -> None:
    """The old file has them before the channels of the motion."""
    text = "walk\nnRows=3\nnColumns=3\ninDegrees=yes\nendheader\ntime\ta\tb\n"
    text += "".join(f"{0.5 + i / 60:.4f}\t{i}.5\t-{i}\n" for i in range(3))
    (tmp_path / "walk.mot").write_text(text)
    mcz.encode(tmp_path / "walk.mot", tmp_path / "old.mcz")
    folder = tmp_path / "read"
    folder.mkdir()
    migration.read(sys.executable, str(ROOT), str(tmp_path / "old.mcz"), str(folder))
    content = json.loads((folder / "content.json").read_text())
    clip, skeleton = content["clips"][0], content["skeletons"][0]
    motion = mcz.read(tmp_path / "walk.mot")
    joined = np.concatenate([motion.signals[1].values, motion.values], axis=1)
    (folder / "joined.bin").write_bytes(joined.tobytes())
    one = clip["signals"][0]
    one |= {"values": "joined.bin", "shape": joined.shape, "sha256": sha256(joined.tobytes())}
    one["grids"] = [*clip["signals"].pop()["grids"], *one["grids"]]
    skeleton["joints"].insert(0, {**skeleton["joints"][0], "name": "time"})
    (folder / "content.json").write_text(json.dumps(content))
    assert migration.migrate(folder, str(tmp_path / "new.mcz")) == []
    with mcz.open(tmp_path / "new.mcz") as file:
        clip = file.only_clip()
        assert [signal.role for signal in clip.signals] == ["motion", "times"]
        assert clip.source_bytes() == text.encode() and not file.attachments


def test_times_of_a_table_without_a_signal_are_kept(tmp_path: Path) -> None:
    """A file of 0.9 has those that its source made of frame numbers; a decoder needs none now."""
    rows = "".join(f"{n},{n / 50:.2f},{n}.5\n" for n in (4, 5, 6, 9))
    (tmp_path / "a.csv").write_text(f"frame,time,x\n{rows}")
    for codec in ("raw", "dwt"):
        old = tmp_path / f"{codec}.mcz"
        mcz.encode(tmp_path / "a.csv", old, codec=codec)
        with mcz.open(migrate_file(old)) as file:
            clip = file.only_clip()
            assert clip.frame_numbers.tolist() == [4, 5, 6, 9]
            assert np.abs(clip.times - [0.08, 0.1, 0.12, 0.18]).max() < 1e-9


def facts(path: Path) -> dict[str, tuple[object, ...]]:
    with mcz.open(path) as file:
        return {
            clip.name: (
                clip.value_hashes,
                replace(clip.skeleton, base=None),
                clip.base_skeleton,
                clip.frame_rate,
                clip.frame_rate_exact,
                clip.frame_numbers.tolist(),
                dict(clip.metadata),
                clip.quality,
            )
            for clip in file
        }


def test_an_archive(tmp_path: Path, samples: Path) -> None:
    """Sources of three formats, a skeleton, attachments, aliases, metadata, recovery data."""
    folder, old = tmp_path / "in", tmp_path / "old.mcz"
    (folder / "sub").mkdir(parents=True)
    for name in ("walk.asf", "walk.amc", "walk.bvh", "walk.c3d"):
        (folder / name).write_bytes((samples / name).read_bytes())
    (folder / "sub" / "again.bvh").write_bytes((samples / "walk.bvh").read_bytes())
    (folder / "notes.txt").write_text("left foot first\n")
    mcz.pack(folder, old, rate=120, keep_all=True, codec="fast")
    mcz.rename_clips(old, {"walk.c3d": "markers/one"})
    mcz.set_metadata(old, {"": {"licence": "CC0-1.0"}, "walk": {"subject": "05"}})
    mcz.protect(old, 0.1)
    new = migrate_file(old)
    assert facts(new) == facts(old)
    assert unpack_hashes(new) == unpack_hashes(old) and len(unpack_hashes(old)) == 6
    with mcz.open(new) as file:
        assert dict(file.metadata) == {"licence": "CC0-1.0"}
        assert {clip.codec for clip in file} == {"fast"}
        assert sorted(file.aliases) == ["walk.asf", "walk.bvh"]
    (tmp_path / "bad.mcz").write_bytes(bytes(64) + new.read_bytes()[64:])
    assert mcz.repair(tmp_path / "bad.mcz", tmp_path / "good.mcz").restored


def test_lossy_clips_keep_their_decoded_values(
    tmp_path: Path, samples: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old = tmp_path / "old.mcz"
    mcz.encode(samples / "walk.bvh", old, codec="lossy", unit="cm")
    new = migrate_file(old)
    assert "walk.bvh is an attachment: decoded values are kept exactly" in capsys.readouterr().err
    assert facts(new) == facts(old) and unpack_hashes(new) == unpack_hashes(old)
    with mcz.open(new) as file:
        assert file.only_clip().codec == "fast" and list(file.attachments) == ["walk.bvh"]


def test_motions_without_a_source(tmp_path: Path) -> None:
    """A mask, numbers of frames, a rate with a rest, several signals, a live clip."""
    motion = smooth(40)
    values = motion.values.copy()
    values[3, 1], values[4, 2] = np.nan, -0.0
    mask = np.arange(values.size).reshape(values.shape) % 7 != 0
    words = np.arange(160, dtype=np.int64).reshape(160, 1) - 80
    force = mcz.Signal(
        words, name="force", samples_per_frame=4, channels=(mcz.Channel("", "z", "N"),)
    )
    motion = replace(
        motion,
        signals=(mcz.Signal(values, mask=mask), force),
        frame_rate=Fraction(30000, 1001),
        frame_numbers=np.r_[5:25, 40:60],
        metadata={"subject": "x"},
        source=None,
    )
    mcz.write(motion, tmp_path / "one.mcz", "best", profile="large", copies=True)
    live = mcz.stream_encode(
        values[:, :6], ["a", "b"], params={"step": 0.5}, frame_rate=Fraction(60)
    )
    (tmp_path / "live.mcz").write_bytes(b"".join(live))
    mcz.merge([tmp_path / "one.mcz", tmp_path / "live.mcz"], tmp_path / "old.mcz")
    assert facts(migrate_file(tmp_path / "old.mcz")) == facts(tmp_path / "old.mcz")
    new = migrate_file(tmp_path / "one.mcz", "--codec", "raw")
    assert facts(new) == facts(tmp_path / "one.mcz")
    with mcz.open(new) as file:
        assert file.only_clip().codec == "raw" and file.header["profile"] != "base"


@pytest.mark.parametrize(
    ("was", "now"),
    [([2, 5, 3], [2, 3, 4]), ([2**52, 2**52 + 1, 2**53], [1, 2, 3]), ([-1, 0, 4], [-1, 0, 4])],
)
def test_frame_numbers_that_a_clip_cannot_have_are_kept_as_text(
    was: list[int], now: list[int], tmp_path: Path
) -> None:
    old, folder = tmp_path / "old.mcz", tmp_path / "read"
    mcz.write(replace(smooth(3), metadata={"subject": "x"}), old)
    folder.mkdir()
    migration.read(sys.executable, str(ROOT), str(old), str(folder))
    content = json.loads((folder / "content.json").read_text())
    clip, text = content["clips"][0], " ".join(map(str, was))
    (folder / clip["frame_numbers"]).write_bytes(np.array(was, "<i8").tobytes())
    clip |= {"times": None, "numbers_text": text}
    (folder / "content.json").write_text(json.dumps(content))
    notes = migration.migrate(folder, str(tmp_path / "new.mcz"))
    kept = {} if was == now else {"x-frame-numbers-0-9": text}
    assert [note.endswith("are its x-frame-numbers-0-9") for note in notes] == [True] * len(kept)
    with mcz.open(tmp_path / "new.mcz") as file:
        clip = file.only_clip()
        assert clip.frame_numbers.tolist() == now
        assert dict(clip.metadata) == {"subject": "x"} | kept


@pytest.mark.parametrize("what", ["values", "mask", "file", "rate"])
def test_what_differs_is_not_written(what: str, tmp_path: Path, samples: Path) -> None:
    old, folder = tmp_path / "old.mcz", tmp_path / "read"
    values = smooth(30).values
    mask = np.ones(values.shape, np.bool_)
    mask[2] = False
    mcz.write(replace(smooth(30), signals=(mcz.Signal(values, mask=mask),)), old)
    if what == "file":
        mcz.encode(samples / "walk.bvh", old, force=True)
    folder.mkdir()
    migration.read(sys.executable, str(ROOT), str(old), str(folder))
    content = json.loads((folder / "content.json").read_text())
    clip = content["clips"][0]
    if what in ("values", "mask"):
        path = folder / clip["signals"][0][what]
        path.write_bytes(path.read_bytes()[:-1] + b"\0")
    elif what == "file":
        clip["file"]["sha256"] = "0" * 64
    else:
        clip["rate"] = [0, 1]
    (folder / "content.json").write_text(json.dumps(content))
    with pytest.raises((SystemExit, mcz.MczError)):
        migration.migrate(folder, str(tmp_path / "new.mcz"))
    assert not (tmp_path / "new.mcz").exists()


def test_a_damaged_file_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    old = tmp_path / "old.mcz"
    mcz.write(smooth(30), old)
    data = bytearray(old.read_bytes())
    data[len(data) // 2] ^= 1
    old.write_bytes(data)
    with pytest.raises(SystemExit, match="package 0.9 does not read it"):
        migrate_file(old)
    assert "old.mcz" in capfd.readouterr().err and not (tmp_path / "new-old.mcz").exists()
