"""Odd ways to call the commands: closed streams, signals, pipes, long names, hostile numbers."""

from __future__ import annotations

import csv
import os
import signal
import stat
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import AccessError, ExistsError, Signal
from mcz.cli.common import Exit, code_of
from mcz.codecs import codec_by_name
from mcz.container.writer import Writer
from mcz.files.writing.clip_writer import write_clip
from tests.commands import ENV, Call, run
from tests.motions import smooth

BVH = (
    "HIERARCHY\nROOT hips\n{\n  OFFSET 0 0 0\n  CHANNELS 1 Xrotation\n}\nMOTION\nFrames: 3\n"
    "Frame Time: 0.01\n1.25\n1.5\n2.50\n"
)
PYTHON = (sys.executable, "-m", "mcz")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """a.bvh and a.mcz."""
    (tmp_path / "a.bvh").write_text(BVH)
    mcz.encode(tmp_path / "a.bvh", tmp_path / "a.mcz", codec="raw")
    return tmp_path


def shell(folder: Path, arguments: str, streams: str) -> subprocess.CompletedProcess[str]:
    words = " ".join(PYTHON)
    return subprocess.run(
        ["sh", "-c", f"{words} {arguments} {streams}"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env=ENV,
    )


@pytest.mark.parametrize(
    ("arguments", "streams", "code", "said"),
    [
        ("info a.mcz", ">&-", 0, ""),
        ("info a.mcz", "2>&-", 0, ""),
        ("info none.mcz", "2>&-", 1, ""),
        ("encode a.bvh -o b.mcz --codec raw", ">&- 2>&- <&-", 0, ""),
        ("decode a.mcz -o -", ">&-", 1, "mcz: standard output is closed\n"),
        ("encode a.bvh -o - --codec raw", ">&-", 1, "mcz: standard output is closed\n"),
        ("info -", "<&-", 1, "mcz: standard input is closed\n"),
        ("decode a.mcz -o -", ">/dev/full", 1, "mcz: No space left on device\n"),
    ],
)
def test_closed_streams(folder: Path, arguments: str, streams: str, code: int, said: str) -> None:
    done = shell(folder, arguments, streams)
    assert (done.returncode, done.stderr) == (code, said)
    assert mcz.verify(folder / "a.mcz") == []


@pytest.mark.parametrize("source", ["", ".", "/", "..", "a.mcz/"])
def test_sources_without_a_name(folder: Path, call: Call, source: str) -> None:
    code, out, err = call("encode", source)
    assert (code, out) == (1, "")
    assert err.startswith("mcz: ")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    "arguments",
    [
        ("decode", "--frames", "0:" + 6000 * "9"),
        ("decode", "--frames", 6000 * "9" + ":"),
        ("decode", "--resolution", 6000 * "9"),
        ("decode", "--max-decoded", 6000 * "9"),
        ("decode", "--max-decoded", "much"),
        ("encode", "--rate", "1e9999999"),
        ("encode", "--rate", "1/0"),
        ("encode", "--rate", 6000 * "9"),
        ("encode", "--param", "segment_frames=" + 6000 * "9"),
        ("encode", "--param", "segment_frames=nan"),
    ],
)
def test_hostile_numbers(folder: Path, call: Call, arguments: Sequence[str]) -> None:
    path = folder / ("a.bvh" if arguments[0] == "encode" else "a.mcz")
    code, out, err = call(arguments[0], path, *arguments[1:], "--force")
    assert (code, out) == (2, "")
    assert err.count("\n") == 1


def test_sigterm_leaves_nothing_behind(tmp_path: Path) -> None:
    program = (
        "import sys, time, click\n"
        "from mcz.cli.common import run\n"
        "from mcz.files.writing.atomic import replacing\n"
        "@click.command()\n"
        "def command():\n"
        "    with replacing('out.mcz', force=False) as stream:\n"
        "        stream.write(b'half')\n"
        "        print('ready', flush=True)\n"
        "        time.sleep(60)\n"
        "sys.exit(run(command, 'mcz', []))\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=ENV,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        assert [p.suffix for p in tmp_path.iterdir()] == [".part"]
        process.send_signal(signal.SIGTERM)
        assert process.stderr.read() == b"mcz: terminated\n"
    assert process.returncode == Exit.TERMINATED
    assert list(tmp_path.iterdir()) == []


def test_pipes_and_devices_are_written_in_place(folder: Path) -> None:
    pipe = folder / "pipe"
    os.mkfifo(pipe)
    got: list[bytes] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    arguments = ["decode", str(folder / "a.mcz"), "-o", str(pipe), "--force"]
    assert run(*arguments) == 0
    reader.join(30)
    assert got == [BVH.encode()]
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    encode = ["encode", str(folder / "a.bvh"), "-o", str(pipe), "--force", "--codec", "raw"]
    assert run(*encode, "--json") == 2
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    assert run(*encode) == 0
    reader.join(30)
    assert got[1] == (folder / "a.mcz").read_bytes()


def test_long_names(folder: Path, call: Call) -> None:
    for name in (f"{244 * 'n'}.bvh", f"{60 * '€'}.bvh"):
        assert call("decode", folder / "a.mcz", "-o", folder / name)[0] == 0
        assert (folder / name).read_text() == BVH
    code, _, err = call("decode", folder / "a.mcz", "-o", folder / (300 * "n"))
    assert code == 1
    assert "too long" in err
    assert not list(folder.glob(".*"))


def test_a_link_to_nowhere_is_in_the_way(folder: Path, call: Call) -> None:
    (folder / "link.bvh").symlink_to(folder / "nowhere")
    code, _, err = call("decode", folder / "a.mcz", "-o", folder / "link.bvh")
    assert (code, "--force" in err) == (2, True)


@pytest.mark.parametrize("name", ["a\0b", "..", "x/.."])
def test_names_in_files_never_leave_the_folder(folder: Path, call: Call, name: str) -> None:
    with (folder / "odd.mcz").open("wb") as stream:
        writer = Writer(stream)
        write_clip(writer, replace(smooth(3), name=name), codec_by_name("raw"), {})
        writer.finish()
    (folder / "out").mkdir()
    code, _, err = call(
        "decode", folder / "odd.mcz", "--to", "csv", "-o", folder / "out", "--force"
    )
    assert code == 0, err
    assert len(list((folder / "out").iterdir())) == 1


def test_attachment_with_a_zero_in_its_name(folder: Path, call: Call) -> None:
    with (folder / "odd.mcz").open("wb") as stream:
        writer = Writer(stream)
        writer.attachment("a\0b", b"kept")
        writer.finish()
    assert call("decode", folder / "odd.mcz")[0] == 0
    assert (folder / "a_b").read_bytes() == b"kept"


def test_unreadable_is_bad_input_and_existing_is_usage(folder: Path) -> None:
    with pytest.raises(AccessError) as missing:
        mcz.open(folder / "none.mcz")
    with pytest.raises(ExistsError) as there:
        mcz.encode(folder / "a.bvh", folder / "a.mcz")
    with pytest.raises(AccessError) as unwritable:
        mcz.encode(folder / "a.bvh", folder / "none" / "a.mcz")
    errors = (missing.value, there.value, unwritable.value)
    assert [code_of(error) for error in errors] == [1, 2, 1]


@pytest.mark.parametrize("place", [3, -3])
def test_validate_and_verify_agree(folder: Path, call: Call, place: int) -> None:
    """A fault in the signature or in FOOT is a file that is not sound."""
    data = bytearray((folder / "a.mcz").read_bytes())
    data[place] ^= 1
    (folder / "a.mcz").write_bytes(data)
    for arguments in (("verify",), ("info", "--validate")):
        code, out, err = call(*arguments, folder / "a.mcz")
        assert (code, out) == (3, "")
        assert err.startswith(f"mcz: {folder / 'a.mcz'}: ")
        code, out, _ = call(*arguments, folder / "a.mcz", "--json")
        assert (code, "problems" in out) == (3, True)
        assert call(*arguments, folder / "none.mcz")[0] == 1


def still(n_frames: int) -> mcz.Motion:
    joints = tuple(mcz.Joint(f"j{n}", channels=(mcz.Channel("rx"),)) for n in range(200))
    return mcz.Motion(mcz.Skeleton(joints), (Signal(np.zeros((n_frames, 200))),))


@pytest.fixture
def small_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """A default limit of 1 MB, so that little needs to be decoded to pass it."""
    for module in ("limits", "reader"):
        monkeypatch.setattr(f"mcz.container.{module}.output_limit", lambda size: 10**6)


@pytest.mark.usefixtures("small_limit")
def test_more_decoded_bytes(folder: Path, call: Call) -> None:
    path = folder / "still.mcz"
    mcz.write(still(1000), path)
    with pytest.raises(mcz.LimitError, match="raise it with max_decoded"):
        mcz.read(path)
    assert mcz.read(path, max_decoded=2**21).n_frames == 1000
    assert mcz.verify(path, max_decoded=2**21) == []
    for arguments in (("verify",), ("info", "--validate"), ("decode", "--to", "npz")):
        code, _, err = call(*arguments, path)
        assert code in (1, 3)
        assert "--max-decoded" in err
        assert call(*arguments, path, "--max-decoded", "2M")[0] == 0


@pytest.mark.usefixtures("small_limit")
def test_encode_says_what_reading_takes(folder: Path, call: Call) -> None:
    path = folder / "still.bvh"
    path.write_text(BVH.split("1.25")[0] + "0\n" * 150_000)
    code, _, err = call("encode", path)
    assert (code, "--max-decoded 1200000" in err) == (0, True)
    assert call("verify", path.with_suffix(".mcz"))[0] == 3
    assert call("verify", path.with_suffix(".mcz"), "--max-decoded", "1200000")[0] == 0


def test_csv_of_a_motion_with_channels_of_its_own(folder: Path, call: Call) -> None:
    channels = (mcz.Channel("", "knee", "deg"), mcz.Channel("", ""))
    signal_ = Signal(np.array([[1.5, 2.5]]), channels=channels)
    skeleton = mcz.Skeleton((mcz.Joint("a", channels=tuple(map(mcz.Channel, ("rx", "ry", "rz")))),))
    mcz.write(mcz.Motion(skeleton, (signal_,)), folder / "own.mcz")
    code, _, errors = call("decode", folder / "own.mcz", "--to", "csv", "--joints", "a")
    assert code == 2 and "is not made of joints" in errors
    assert call("decode", folder / "own.mcz", "--to", "csv")[0] == 0
    rows = list(csv.reader((folder / "motion.csv").read_text().splitlines()))
    assert rows == [["frame", "knee", "channel-1"], ["1", "1.5", "2.5"]]


def test_csv_of_no_clip(folder: Path, call: Call) -> None:
    from mcz.sources.sample import write_samples

    write_samples(folder)
    mcz.encode(folder / "walk.asf", folder / "walk.mcz")
    code, out, err = call("decode", folder / "walk.mcz", "--to", "csv")
    assert (code, out) == (2, "")
    assert "no clips" in err


def test_append_of_a_cut_file(folder: Path, call: Call) -> None:
    for name in ("b", "c"):
        (folder / f"{name}.bvh").write_text(BVH.replace("1.25", f"1.{len(name)}"))
    path = folder / "a.mcz"
    mcz.append([folder / "b.bvh"], path)
    cut = path.read_bytes()[:-20]
    path.write_bytes(cut)
    code, out, err = call("append", folder / "c.bvh", path)
    assert (code, out, " b;" in err) == (1, "", True)
    assert call("append", folder / "c.bvh", path, "--salvage", "--force")[0] == 2
    code, out, err = call("append", folder / "c.bvh", path, "--salvage")
    assert (code, "1 salvaged" in out, "b: salvaged" in err) == (4, True, True)
    path.write_bytes(cut)
    code, out, err = call("append", folder / "c.bvh", path, "--force")
    assert (code, "1 dropped" in out, "b: dropped" in err) == (0, True, True)


def test_only_opening_tells_what_can_be_read(
    folder: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert call("info", folder / "a.mcz")[0] == 0
    assert call("encode", folder / "a.bvh", "--force", "--codec", "raw")[0] == 0
