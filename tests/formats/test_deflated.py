"""NPZ files whose members are deflated: the numbers are read, and the streams come back."""

from __future__ import annotations

import contextlib
import io
import re
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import mcz
from mcz import FormatError, MczError, SourceError
from mcz.sources import FORMATS
from mcz.sources.arrays.deflate import LEVELS, describe_stream, is_kept, restore_stream
from tests.commands import run
from tools.vectors.build.array_files import Member, floats, npy, npz

STRATEGIES = (
    zlib.Z_DEFAULT_STRATEGY,
    zlib.Z_FILTERED,
    zlib.Z_HUFFMAN_ONLY,
    zlib.Z_RLE,
    zlib.Z_FIXED,
)
POSES = np.cumsum(floats(90, 72), axis=0).astype(np.float32) / 64


def save_compressed(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def deflate(contents: bytes, level: int = 6, memory: int = 8, strategy: int = 0) -> bytes:
    deflater = zlib.compressobj(level, zlib.DEFLATED, -15, memory, strategy)
    return deflater.compress(contents) + deflater.flush()


def with_member(stream: bytes, size: int, checksum: int = 0) -> bytes:
    """An NPZ of a motion and of a member of this deflate stream."""
    member = Member("other.npy", stream, method=8, size=size, checksum=checksum)
    return npz([Member("motion.npy", npy(floats(3, 2))), member])


contents = st.one_of(
    st.binary(max_size=400),
    st.tuples(st.lists(st.binary(min_size=1, max_size=30), min_size=1, max_size=6), st.data()).map(
        lambda given: b"".join(given[1].draw(st.lists(st.sampled_from(given[0]), max_size=400)))
    ),
)


@given(contents, st.sampled_from(range(10)), st.integers(1, 9), st.sampled_from(STRATEGIES))
@example(bytes(100_000), 6, 8, 0)
def test_streams_come_back(data: bytes, level: int, memory: int, strategy: int) -> None:
    stream = deflate(data, level, memory, strategy)
    part = describe_stream(stream, data)
    assert restore_stream(part, data) == stream
    assert len(part) <= len(stream) + 16


@pytest.mark.parametrize("level", sorted(LEVELS))
def test_streams_of_zlib_need_no_corrections(level: int) -> None:
    """Codes are all that is kept of a stream: one or two percent of it."""
    rng = np.random.default_rng(level)
    words = [rng.bytes(n) for n in range(3, 60)]
    text = b"".join(words[k] for k in rng.integers(0, len(words), 3000))
    for data in (text, POSES.tobytes(), rng.integers(0, 3, 50_000).astype(np.uint8).tobytes()):
        stream = deflate(data, level)
        assert len(describe_stream(stream, data)) < 20 + len(stream) // 50


@given(contents, st.data())
def test_any_part_makes_a_stream_or_is_refused(data: bytes, draw: st.DataObject) -> None:
    part = bytearray(describe_stream(deflate(data), data))
    for _ in range(draw.draw(st.integers(1, 3))):
        part[draw.draw(st.integers(0, len(part) - 1))] = draw.draw(st.integers(0, 255))
    part = part[: draw.draw(st.integers(0, len(part)))]
    with contextlib.suppress(FormatError):
        restore_stream(bytes(part), data)


def test_other_contents_are_stored() -> None:
    part = describe_stream(deflate(b"abc"), b"abc")
    for data in (b"", b"abd", bytes(65535), bytes(200_000)):
        stream = restore_stream(part, data)
        assert zlib.decompress(stream, -15) == data
        assert len(stream) == len(data) + 5 * max(1, -(-len(data) // 65535))


def test_numbers_of_a_compressed_file_are_read(tmp_path: Path) -> None:
    given = {
        "poses": POSES,
        "trans": floats(90, 3),
        "gender": np.array("female"),
        "betas": floats(10),
        "mocap_framerate": np.array(60.0),
    }
    (tmp_path / "a.npz").write_bytes(save_compressed(**given))
    assert run("encode", str(tmp_path / "a.npz")) == 0
    with mcz.open(tmp_path / "a.mcz") as file:
        clip = file.only_clip()
        assert clip.source_bytes() == (tmp_path / "a.npz").read_bytes()
        assert (clip.frame_rate, clip.metadata["x-gender"]) == (60, "female")
        np.testing.assert_array_equal(clip.read()[:, 3:], POSES)
        part = clip.source_bytes((10, 30))
    with np.load(io.BytesIO(part)) as arrays:  # zipfile checks sizes and CRC-32
        np.testing.assert_array_equal(arrays["poses"], POSES[10:30])
        np.testing.assert_array_equal(arrays["trans"], given["trans"][10:30])
        assert arrays["gender"] == "female"
    assert (tmp_path / "a.mcz").stat().st_size < (tmp_path / "a.npz").stat().st_size


def test_a_lossy_clip_is_a_file_that_numpy_loads(tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(save_compressed(joint_pos=POSES, fps=np.array(50)))
    assert (
        run("encode", str(tmp_path / "a.npz"), "--codec", "lossy", "--param", "max_error=0.01") == 0
    )
    with mcz.open(tmp_path / "a.mcz") as file:
        data = file.only_clip().source_bytes()
    with np.load(io.BytesIO(data)) as arrays:
        assert 0 < np.abs(arrays["joint_pos"] - POSES).max() <= 0.01


def test_changed_values_are_written() -> None:
    motion = FORMATS["npz"].read(save_compressed(joint_pos=POSES), "take")
    signal = replace(motion.signals[0], values=motion.values + 1)
    data = FORMATS["npz"].write(replace(motion, signals=(signal,)))
    with np.load(io.BytesIO(data)) as arrays:
        np.testing.assert_array_equal(arrays["joint_pos"], (motion.values + 1).astype(np.float32))


def test_a_member_of_another_compressor_is_kept_and_noted() -> None:
    data = npy(np.array(["a" * 40, "b" * 50]))
    stream = deflate(data, strategy=zlib.Z_HUFFMAN_ONLY)
    assert is_kept(describe_stream(stream, data))
    file = with_member(stream, len(data), zlib.crc32(data))
    motion = FORMATS["npz"].read(file, "take")
    assert "bytes of deflate, not zlib's, are kept as they are" in motion.metadata["source-note"]
    assert FORMATS["npz"].write(motion) == file


@pytest.mark.parametrize(
    ("stream", "size", "reason"),
    [
        (b"\6", 4, "damaged"),
        (deflate(b"abc") + b"x", 3, "damaged"),
        (deflate(b"abc"), 4, "damaged"),
        (deflate(bytes(100)), 99, "damaged"),
        (deflate(bytes(2**20)), 2**40, "too many"),
    ],
)
def test_a_member_that_does_not_inflate_is_kept(stream: bytes, size: int, reason: str) -> None:
    file = with_member(stream, min(size, 2**32 - 2))
    motion = FORMATS["npz"].read(file, "take")
    assert re.search(f"other is deflated, .*{reason}", motion.metadata["source-note"])
    assert FORMATS["npz"].write(motion) == file


def test_a_bomb_earns_no_memory() -> None:
    """Contents have at most 64 MiB, or 16 bytes for each of the file."""
    stream = deflate(bytes(2**27), 9)
    with pytest.raises(SourceError, match="deflated, of 134217728 bytes when inflated: too many"):
        FORMATS["npz"].read(npz([Member("a.npy", stream, method=8, size=2**27)]))


@given(st.integers(0, 10**9), st.integers(0, 255))
def test_a_changed_byte_is_restored_or_refused(at: int, value: int) -> None:
    data = bytearray(save_compressed(a=floats(5, 3), b=np.arange(5), c=np.array("text")))
    data[at % len(data)] = value
    try:
        motion = FORMATS["npz"].read(bytes(data), "take")
    except MczError:
        return
    assert FORMATS["npz"].write(motion) == data


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_other_methods_are_kept(method: int) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("motion.npy", npy(floats(4, 2)))
        archive.writestr("b.npy", npy(floats(4, 2)), method)
    motion = FORMATS["npz"].read(buffer.getvalue(), "take")
    assert f"b is packed by method {method}" in motion.metadata["source-note"]
    assert FORMATS["npz"].write(motion) == buffer.getvalue()
