"""The container beyond its vectors: parts of attachments, salvage of what is no chunk."""

from __future__ import annotations

import io
import zlib

import pytest

import mcz
from conformance.run import VECTORS
from mcz.codecs import codec_by_name
from mcz.container.chunks import CRC, FOOT, HEADER
from mcz.container.source import ByteSource
from mcz.container.writer import Writer
from mcz.errors import FormatError, MotionError, TruncatedError, UnsupportedError
from mcz.files.writing.clip_writer import write_clip
from tests.motions import smooth
from tests.repair import join_parts, parts_of


def test_clips_are_unique() -> None:
    writer = Writer(io.BytesIO())
    write_clip(writer, smooth(3), codec_by_name("raw"), {})
    with pytest.raises(MotionError, match="already has 'smooth'"):
        write_clip(writer, smooth(3), codec_by_name("raw"), {})


def test_attachment_of_several_parts() -> None:
    data = bytes(range(256)) * 8200
    out = io.BytesIO()
    writer = Writer(out)
    writer.attachment("big", data)
    writer.attachment("empty", b"")
    writer.finish()
    with mcz.open(out.getvalue()) as file:
        assert file.attachments["big"].read() == data
        assert file.attachments["empty"].read() == b""
        rows = file.container.directory.attachments
        assert [len(row.parts) for row in rows.values()] == [3, 1]


def test_salvage_goes_on_behind_garbage() -> None:
    out = io.BytesIO()
    writer = Writer(out)
    for name in "ab":
        write_clip(writer, smooth(30, name=name), codec_by_name("raw"), {})
    writer.finish()
    parts = parts_of(out.getvalue())
    second = [i for i, (c, _) in enumerate(parts) if c.type == b"CLIP"][1]
    head, rest = join_parts(parts[:second])[: -FOOT.size], join_parts(parts[second:])[8:]
    with mcz.open(head + b"rubbish, not a chunk" * 9 + rest, salvage=True) as file:
        assert list(file.clips) == ["a", "b"]
        for clip in file.clips.values():
            assert clip.read().shape == (30, 10)
        assert len(file.damage) == 1


def test_salvage_takes_nothing_of_another_version_for_its_own() -> None:
    """A file of 0.9 is refused where HEAD is whole; its clips where HEAD is not."""
    data = (VECTORS / "uncommon/container/format-0-9.mcz").read_bytes()
    for salvage in (False, True):
        with pytest.raises(
            UnsupportedError, match=r"needs format 0\.9, .* tools/migrate_0_9 converts"
        ):
            mcz.open(data, salvage=salvage)
    head = data.index(b"HEAD") + HEADER.size
    with mcz.open(data[:head] + b"\1" + data[head + 1 :], salvage=True) as file:
        assert not file.clips
        assert any("needs format 1.97" in text for text in file.damage)


@pytest.mark.parametrize("minor", [9, 10, 99])  # 0.10 to 0.99 were drafts of 1.0
def test_every_old_format_is_refused_with_the_way_out(minor: int) -> None:
    data = bytearray((VECTORS / "uncommon/container/format-0-9.mcz").read_bytes())
    head = data.index(b"HEAD")
    end = head + HEADER.size + 5  # of HEAD, before its checksum
    data[end - 4] = data[end - 2] = minor
    data[end : end + 4] = CRC.pack(zlib.crc32(data[head:end]))
    with pytest.raises(UnsupportedError, match=rf"format 0\.{minor}, .* the version of mcz that"):
        mcz.open(bytes(data))


def test_nothing_to_salvage() -> None:
    with pytest.raises(FormatError, match="nothing can be salvaged"):
        mcz.open(b"no chunk at all" * 20, salvage=True)


def test_source_counts_and_reads_exactly() -> None:
    source = ByteSource(io.BytesIO(bytes(100)))
    assert source.read(10, 20) == bytes(20)
    assert (source.n_requests, source.n_bytes) == (1, 20)
    with pytest.raises(TruncatedError):
        source.read(90, 11)
