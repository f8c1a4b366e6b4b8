"""Packing, appending, unpacking; files that were cut off while they grew."""

from __future__ import annotations

import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import conformance
import mcz
from mcz.container import payloads
from mcz.container.writer import Writer
from mcz.files.editing.unpacking import safe_path, stored_files
from mcz.model.motion import joint_columns
from tests.amounts import amount
from tests.clocked_files import bvh
from tests.web_server import Server, serve

VECTORS = Path(conformance.__file__).parent / "vectors" / "valid"


@pytest.fixture
def folder(samples: Path, tmp_path: Path) -> Path:
    """asf/ and amc/ side by side, a BVH twice, a text, a BVH that is none."""
    root = tmp_path / "root"
    for name in ("asf", "amc", "bvh/copy"):
        (root / name).mkdir(parents=True)
    (root / "asf/07.asf").write_bytes((samples / "walk.asf").read_bytes())
    amc = (samples / "walk.amc").read_bytes()
    (root / "amc/07_01.amc").write_bytes(amc)
    (root / "amc/07_02.amc").write_bytes(amc)
    bvh = (samples / "walk.bvh").read_bytes()
    (root / "bvh/walk.bvh").write_bytes(bvh)
    (root / "bvh/copy/walk.bvh").write_bytes(bvh)
    (root / "bvh/broken.bvh").write_bytes(b"HIERARCHY\nROOT")
    (root / "read me.txt").write_bytes(b"hello\n")
    return root


def tree(root: Path) -> dict[str, bytes]:
    return {p.relative_to(root).as_posix(): p.read_bytes() for p in root.rglob("*") if p.is_file()}


def test_pack_keeps_every_file(folder: Path, tmp_path: Path) -> None:
    report = mcz.pack(folder, tmp_path / "all.mcz", keep_all=True)
    results = {outcome.path: outcome.result for outcome in report.outcomes}
    assert results == {
        "amc/07_01.amc": "parsed",
        "amc/07_02.amc": "parsed",
        "asf/07.asf": "skeleton",
        "bvh/broken.bvh": "verbatim",
        "bvh/copy/walk.bvh": "parsed",
        "bvh/walk.bvh": "alias",
        "read me.txt": "verbatim",
    }
    report = mcz.unpack(tmp_path / "all.mcz", tmp_path / "back")
    assert not report.failures
    assert tree(tmp_path / "back") == tree(folder)


def test_pack_shares_skeletons_and_templates(folder: Path, tmp_path: Path) -> None:
    mcz.pack(folder, tmp_path / "all.mcz")
    with mcz.open(tmp_path / "all.mcz") as file:
        assert len(file.skeletons) == 2
        assert list(file.clips) == ["amc/07_01", "amc/07_02", "bvh/copy/walk"]
        templates = [k for k in file.container.directory.shared if k[0] == b"SRCE"]
        assert len(templates) == 3


def test_a_file_that_fails_leaves_no_trace(folder: Path, tmp_path: Path) -> None:
    report = mcz.pack(folder, tmp_path / "all.mcz")
    assert [o.path for o in report.failures] == ["bvh/broken.bvh"]
    assert "line" in report.failures[0].message
    with mcz.open(tmp_path / "all.mcz") as file:
        assert not file.attachments
        assert "bvh/walk.bvh" in file.aliases


def small(tmp_path: Path) -> tuple[Path, Path]:
    """Two BVH files of a few frames."""
    paths = tmp_path / "one.bvh", tmp_path / "two.bvh"
    for n, path in enumerate(paths, 3):
        path.write_text(bvh(*(f"{v}.25" for v in range(n))))
    return paths


def test_append_cut_at_every_byte(tmp_path: Path) -> None:
    one, two = small(tmp_path)
    path = tmp_path / "a.mcz"
    mcz.encode(one, path)
    old = path.read_bytes()
    mcz.append([two], path)
    new = path.read_bytes()
    assert new.startswith(old)
    for size in range(len(old) + 1, len(new)):
        with pytest.raises(mcz.TruncatedError) as error:
            mcz.open(new[:size])
        assert error.value.last_foot == len(old)
        with mcz.open(new[:size], salvage=True) as file:
            assert file.clips["one"].source_bytes() == one.read_bytes()
    path.write_bytes(new[: len(new) - 40])
    mcz.append([two], path, force=True)
    assert path.read_bytes() == new


@pytest.mark.parametrize("rounds", [3, pytest.param(50, marks=pytest.mark.long)])
def test_append_killed(samples: Path, tmp_path: Path, rounds: int) -> None:
    path = tmp_path / "a.mcz"
    mcz.encode(samples / "walk.bvh", path)
    old = path.read_bytes()
    program = "import sys, mcz\nprint('ready', flush=True)\nmcz.append(sys.argv[2:], sys.argv[1])\n"
    sources = [str(tmp_path / f"walk{n}.bvh") for n in range(8)]
    for source in sources:
        Path(source).write_bytes((samples / "walk.bvh").read_bytes() + b"\n" * len(source))
    draw = random.Random(rounds)
    for _ in range(rounds):
        path.write_bytes(old)
        command = [sys.executable, "-c", program, str(path), *sources]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            process.stdout.readline()
            time.sleep(draw.random() * 0.6)
            process.send_signal(signal.SIGKILL)
        assert path.read_bytes().startswith(old)
        with mcz.open(path, salvage=True) as file:
            assert file.clips["walk"].source_bytes() == (samples / "walk.bvh").read_bytes()
        try:
            mcz.open(path).close()
        except mcz.TruncatedError as error:
            assert error.last_foot == len(old)


@pytest.mark.parametrize(
    "name", ["", "/etc/passwd", "../up", "a/../b", "a//b", "./a", "a\\b", "C:/x", "a\0b"]
)
def test_unsafe_paths(name: str) -> None:
    with pytest.raises(mcz.FormatError):
        safe_path(name)


def test_no_file_overwrites_another(tmp_path: Path) -> None:
    """An attachment and an alias may have one name; who writes both would lose the first."""
    archive = tmp_path / "all.mcz"
    with archive.open("wb") as stream:
        writer = Writer(stream)
        writer.attachment("a.txt", b"first")
        writer.attachment("b.txt", b"second")
        writer.alias("a.txt", payloads.OF_ATTACHMENT, b"b.txt")
        writer.finish()
    report = mcz.unpack(archive, tmp_path / "out")
    assert tree(tmp_path / "out") == {"a.txt": b"first", "b.txt": b"second"}
    assert [outcome.path for outcome in report.failures] == ["a.txt"]


N_CLIPS = amount(2500, 600)
MOST_BYTES = 135_000 + 66 * N_CLIPS  # 300 kB for 2,500 clips


def test_remote_archive_costs_few_requests(samples: Path) -> None:
    """DESIGN 3: 2,500 clips, 100 frames of two joints: 4 requests, 300 kB beyond the payload."""
    import io
    from dataclasses import replace

    import fsspec

    from mcz.codecs import codec_by_name
    from mcz.container.writer import Writer
    from mcz.files.writing.clip_writer import write_clip

    out = io.BytesIO()
    writer = Writer(out)
    motion = mcz.read(samples / "walk.amc")
    draw = np.random.default_rng(1)
    for n in range(N_CLIPS):
        frames = int(draw.integers(100, 140))
        signal_ = replace(motion.signals[0], values=motion.signals[0].values[:frames])
        clip = replace(motion, signals=(signal_,), source=None, name=f"{n % 144:03d}/take {n}")
        write_clip(writer, clip, codec_by_name("raw"), {})
    writer.finish()
    with fsspec.open("memory://archive.mcz", "wb") as stream:
        stream.write(out.getvalue())
    server = Server(out.getvalue())
    with serve(server):
        for address in ("memory://archive.mcz", server.address):
            a_part_costs_little(address, motion)
    assert len(server.asked) <= 4
    assert server.n_sent <= MOST_BYTES
    assert server.n_connections == 1


def a_part_costs_little(address: str, motion: mcz.Motion) -> None:
    """Requests and bytes for 100 frames of two joints of one clip of many."""
    with mcz.open(address) as file:
        source = file.container.source
        assert len(file.clips) == N_CLIPS
        clip = file.clips["071/take 503"]
        values = clip.read((0, 100), ["lfoot", "rfoot"])
        np.testing.assert_array_equal(
            values, motion.values[:100, joint_columns(clip.skeleton, ["lfoot", "rfoot"])]
        )
        assert source.n_requests <= 4
        assert source.n_bytes <= MOST_BYTES


@pytest.mark.skipif(shutil.which("node") is None, reason="there is no node")
def test_sources_come_back_without_python(folder: Path, tmp_path: Path) -> None:
    program = Path(__file__).parents[1] / "tools" / "js" / "unpack.js"
    mcz.pack(folder, tmp_path / "a.mcz", keep_all=True)
    words = ["node", str(program), "a.mcz", "restored"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    for path in (path for path in folder.rglob("*") if path.is_file()):
        again = tmp_path / "restored" / path.relative_to(folder)
        assert again.read_bytes() == path.read_bytes()
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 1
    assert b"exists" in done.stderr


def test_a_rate_that_is_not_the_files_is_told(samples: Path, tmp_path: Path) -> None:
    report = mcz.pack(samples, tmp_path / "a.mcz", rate=100, force_rate=True)
    said = {outcome.path: " ".join(outcome.notes) for outcome in report.outcomes}
    for name in ("walk.c3d", "walk.bvh"):
        assert "120 frames a second are replaced by 100" in said[name]
    assert said["walk.amc"] == ""  # it says none
    report = mcz.pack(samples, tmp_path / "b.mcz", rate=120.0001)  # near enough
    assert not any("kept as" in " ".join(outcome.notes) for outcome in report.outcomes)


@pytest.mark.parametrize("vectors", ["container", "cut", "roles", "sources"])
def test_stored_files_are_those_of_the_clips(vectors: str) -> None:
    """They are read by hand."""
    for path in (VECTORS / vectors).rglob("*.mcz"):
        with mcz.open(path) as file:
            container, found, wanted = file.container, {}, {}
            for name, row in container.directory.clips.items():
                source, cend = container.clip_head(row).source, container.cend(row)
                if source is not None and cend is not None and cend.source_sha256:
                    wanted.setdefault(source.path, cend.source_sha256)
                    found[cend.source_sha256] = name
            wanted.pop("", None)
            paths, contents = stored_files(container)
            assert {name: paths[name] for name in wanted} == wanted
            assert contents.keys() >= found.keys()
