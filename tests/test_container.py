"""Chunks, index, packets, salvage: the container without any codec's help."""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest

import mcz
from conformance.run import VECTORS
from mcz.codecs import by_name
from mcz.container import chunks, note_records
from mcz.container.chunks import FOOT, HEADER, ChunkFlag, build_chunk, build_foot
from mcz.container.feeding import packets
from mcz.container.masks import build_mask
from mcz.container.packets import (
    CHECK_SIZE,
    END,
    FRAME,
    SEGMENT,
    Packet,
    build_packet,
    implied_by,
)
from mcz.container.reader import Container
from mcz.container.scan import scan
from mcz.container.segments import (
    FRESH,
    MASKS,
    SegmentHeader,
    StreamCounts,
    build_segment,
    parse_table,
)
from mcz.container.source import ByteSource, open_source
from mcz.container.versions import FORMAT
from mcz.container.writer import Writer
from mcz.errors import (
    ChecksumError,
    FormatError,
    LimitError,
    MotionError,
    TruncatedError,
    UnsupportedError,
)
from mcz.reading.report import layout
from mcz.schema import parse, read_varint, varint
from mcz.writing.clip_writer import write_clip
from tests.motions import smooth
from tests.repair import joined, parts_of, use


def written(*names: str, index: bool = True, n_frames: int = 30) -> bytes:
    out = io.BytesIO()
    writer = Writer(out)
    writer.attachment("notes/read me.txt", b"kept as it is\r\n" * 9)
    for name in names:
        write_clip(writer, smooth(n_frames, name=name), by_name("raw"), {})
    writer.finish(index=index)
    return out.getvalue()


@pytest.mark.parametrize("value", [0, 1, 127, 128, 300, 2**32, 2**53 - 1])
def test_varint_round_trip(value: int) -> None:
    data = varint(value)
    assert read_varint(data, 0) == (value, len(data))


@pytest.mark.parametrize("data", [b"\x80\x00", b"\xff\x00", b"\xff" * 8, b"\x80" * 7 + b"\x20"])
def test_varint_refuses_long_forms_and_large_values(data: bytes) -> None:
    with pytest.raises(FormatError):
        read_varint(data, 0)


def test_varint_truncated() -> None:
    with pytest.raises(TruncatedError):
        read_varint(b"\x80", 0)


@pytest.mark.parametrize("index", [True, False])
def test_index_equals_scan(index: bool) -> None:
    data = written("a", "b", index=index)
    container = Container(open_source(data))
    found = scan(open_source(data), whole=True)
    assert container.directory == found.directory
    assert (container.index is not None) is index


def test_every_prefix_is_truncated() -> None:
    data = written("a")
    for size in range(len(data)):
        with pytest.raises(TruncatedError):
            Container(open_source(data[:size]))


def test_every_bit_flip_is_found() -> None:
    data = written("a", n_frames=2)  # streams are more of the same
    for n in range(len(data) * 8):
        changed = bytearray(data)
        changed[n // 8] ^= 1 << n % 8
        with pytest.raises(FormatError):
            scan(open_source(bytes(changed)), whole=True)
            Container(open_source(bytes(changed)))


def test_clips_are_unique() -> None:
    writer = Writer(io.BytesIO())
    write_clip(writer, smooth(3), by_name("raw"), {})
    with pytest.raises(MotionError, match="already has 'smooth'"):
        write_clip(writer, smooth(3), by_name("raw"), {})


def test_deterministic() -> None:
    assert written("a", "b") == written("a", "b")


def with_chunk(data: bytes, chunk: bytes) -> bytes:
    """``data`` with a chunk before its first CLIP, index dropped."""
    parts = parts_of(data)
    clip = next(i for i, (c, _) in enumerate(parts) if c.type == b"CLIP")
    before, after = joined(parts[:clip])[: -FOOT.size], joined(parts[clip:])[8:]
    return before + chunk + after


def test_unknown_ancillary_chunk_is_skipped() -> None:
    for flags in (ChunkFlag.ANCILLARY, ChunkFlag.ANCILLARY | ChunkFlag.SAFE_TO_COPY):
        data = with_chunk(written("a"), build_chunk(b"abCD", b"whatever", flags))
        use(data)
        assert [c.type for c in scan(open_source(data)).chunks].count(b"abCD") == 1


@pytest.mark.parametrize(
    ("chunk", "error"),
    [
        (build_chunk(b"NEWS", b""), UnsupportedError),
        (build_chunk(b"NEWS", b"", 4), FormatError),
        (build_chunk(b"SK3L", b""), FormatError),
        (build_chunk(b"HEAD", b"\0\x63\0\x63\0"), FormatError),
        (build_chunk(b"CEND", b"\0\0\0"), FormatError),
        (build_chunk(b"DATA", b"\0" * 20), FormatError),
        (build_chunk(b"ALIA", b"\x01a\x00\x01b", ChunkFlag.ANCILLARY), FormatError),
    ],
)
def test_chunks_out_of_place(chunk: bytes, error: type[Exception]) -> None:
    with pytest.raises(error):
        use(with_chunk(written("a"), chunk))


@pytest.mark.parametrize("needed", [(0, 9), (FORMAT[0], FORMAT[1] + 1), (FORMAT[0] + 2, 0)])
def test_another_version_is_unsupported(needed: tuple[int, int]) -> None:
    parts = parts_of(written())
    parts[0] = (parts[0][0], bytes((*needed, *needed, 0)))
    with pytest.raises(UnsupportedError, match=rf"needs format {needed[0]}\.{needed[1]}"):
        use(joined(parts))


def test_extension_of_head_is_ignored() -> None:
    parts = parts_of(written("a"))
    parts[0] = (parts[0][0], parts[0][1] + b"from the future")
    use(joined(parts))


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


def test_foot_without_magic_is_none() -> None:
    assert chunks.parse_foot(bytes(32), 0) is None
    foot = build_foot(0, 0)
    assert chunks.parse_foot(foot, 0) == chunks.Foot(0, 0)
    with pytest.raises(ChecksumError):
        chunks.parse_foot(b"\0\0\0\0\1" + foot[5:], 0)


def test_segment_table_round_trip() -> None:
    header = SegmentHeader(2, 5, 7, 1, 3, 15)
    counts = StreamCounts(3, 2)
    streams = [b"n", b"", b"gg", b"", b"m", b"", b"", b"a" * 200, b"", b"", b"c", b"d", b"e"]
    payload = build_segment(header, streams)
    table = parse_table(payload, counts)
    assert table.header == header
    assert table.payload_size == len(payload)
    found = [payload[o : o + n] for o, n in zip(table.offsets, table.lengths, strict=True)]
    assert found == streams
    assert (table.frame_notes(), table.group_notes(1), table.mask(1)) == (0, 2, 5)
    assert (table.codec(0, 0), table.codec(1, 2)) == (7, 12)


def packets_in(data: bytes) -> list[Packet]:
    """The packets of an open DATA without its header."""
    chunk = chunks.Chunk(b"DATA", 0, 0, None)
    padded = open_source(bytes(chunk.payload_offset) + data)
    return [event.packet for event in packets(padded, chunk)]


def test_packets_round_trip_and_order() -> None:
    mask = build_mask(np.array([[True, False]]))
    segment = build_segment(SegmentHeader(0, 7, 1, flags=FRESH | MASKS), [mask, b"one"])
    plain = build_segment(SegmentHeader(0, 9, 1), [b"one"])
    made = [
        Packet(SEGMENT, 0, segment),
        Packet(FRAME, 1, b"", False, implied_by(8, mask)),
        Packet(SEGMENT, 2, plain),
        Packet(FRAME, 3, bytes(200), True, implied_by(10, b"")),
        Packet(END, 4, b""),
    ]
    data = [build_packet(packet) for packet in made]
    assert packets_in(b"".join(data)) == made
    assert data[3][-4:] == struct.pack(
        "<I", zlib.crc32(b"\x82\3\xc8\1" + struct.pack("<Q", 10) + bytes(200))
    )
    with pytest.raises(FormatError, match="packet 2 where 1 is due"):
        packets_in(b"".join(data[:1] + data[2:]))
    with pytest.raises(FormatError, match="none before it"):
        packets_in(b"".join([build_packet(replace(made[1], sequence=0)), *data[1:]]))
    for number, other in ((8, b""), (9, mask), (8 + 2**32, mask), (8, mask + mask)):
        wrong = build_packet(replace(made[1], implied=implied_by(number, other)))
        with pytest.raises(ChecksumError, match="crc of packet 1 is wrong, or it is not frame 8"):
            packets_in(b"".join([data[0], wrong, *data[2:]]))
    with pytest.raises(LimitError):
        packets_in(data[0] + build_packet(Packet(SEGMENT, 1, bytes(64 * 1024 + 1))))


def test_open_data_reads_like_closed() -> None:
    closed = io.BytesIO()
    write_clip(w := Writer(closed), motion := smooth(30), by_name("raw"), {})
    w.finish()
    data = reopened(closed.getvalue())
    with mcz.open(data) as file:
        np.testing.assert_array_equal(file.clips["smooth"].read(), motion.values)
        assert all(row.packet for row in file.clips["smooth"].signals[0].rows)
        assert sum(size for _, size, _ in layout(file)) == len(data)


def reopened(data: bytes) -> bytes:
    """The same clip with its segments as packets of one open DATA."""
    parts = parts_of(data)
    out = io.BytesIO()
    out.write(joined([p for p in parts if p[0].type != b"DATA"])[: -FOOT.size])
    cend = build_chunk(b"CEND", parts[-1][1])
    out.truncate(len(out.getvalue()) - len(cend))
    out.seek(0, io.SEEK_END)
    out.write(chunks.build_header(b"DATA", 0, chunks.OPEN_LENGTH))
    bodies = [payload for chunk, payload in parts if chunk.type == b"DATA"]
    for n, body in enumerate(bodies):
        out.write(build_packet(Packet(1, n, body)))
    out.write(build_packet(Packet(END, len(bodies), b"")) + cend + build_foot(0, 0))
    return out.getvalue()


def test_open_data_cut_anywhere_salvages_whole_packets() -> None:
    closed = io.BytesIO()
    write_clip(w := Writer(closed), motion := smooth(30), by_name("raw"), {"segment_frames": 5})
    w.finish()
    data = reopened(closed.getvalue())
    with mcz.open(data) as file:
        ends = [row.stop + CHECK_SIZE for row in file.clips["smooth"].signals[0].rows]
        start = file.clips["smooth"].signals[0].rows[0].offset
    for size in range(start, len(data) - 1, 7):
        with mcz.open(data[:size], salvage=True) as file:
            clip = file.clips["smooth"]
            whole = sum(end <= size for end in ends)
            assert clip.n_frames == 5 * whole
            np.testing.assert_array_equal(clip.read(), motion.values[: 5 * whole])


def test_one_bad_byte_costs_one_segment() -> None:
    out = io.BytesIO()
    write_clip(w := Writer(out), motion := smooth(30), by_name("raw"), {"segment_frames": 10})
    w.finish()
    data = bytearray(out.getvalue())
    with mcz.open(bytes(data)) as file:
        row = file.clips["smooth"].signals[0].rows[1]
    data[row.stop - 3] ^= 4
    with mcz.open(bytes(data)) as file, pytest.raises(ChecksumError):
        file.clips["smooth"].read()
    with mcz.open(bytes(data), salvage=True) as file:
        values = file.clips["smooth"].read()
        assert file.damage
    lost = np.isnan(values).all(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(lost), np.arange(10, 20))
    np.testing.assert_array_equal(values[~lost], motion.values[~lost])


def test_salvage_goes_on_behind_garbage() -> None:
    data = written("a", "b")
    parts = parts_of(data)
    second = [i for i, (c, _) in enumerate(parts) if c.type == b"CLIP"][1]
    head, rest = joined(parts[:second])[: -FOOT.size], joined(parts[second:])[8:]
    with mcz.open(head + b"rubbish, not a chunk" * 9 + rest, salvage=True) as file:
        assert list(file.clips) == ["a", "b"]
        for clip in file.clips.values():
            assert clip.read().shape == (30, 10)
        assert len(file.damage) == 1


def test_salvage_takes_nothing_of_another_version_for_its_own() -> None:
    """A file of 0.9 is refused where HEAD is whole; its clips where HEAD is not."""
    data = (VECTORS / "uncommon/container/format-0-9.mcz").read_bytes()
    for salvage in (False, True):
        with pytest.raises(UnsupportedError, match=r"needs format 0\.9, .* mcz reads it"):
            mcz.open(data, salvage=salvage)
    head = data.index(b"HEAD") + HEADER.size
    with mcz.open(data[:head] + b"\1" + data[head + 1 :], salvage=True) as file:
        assert not file.clips
        assert any("needs format 1.97" in text for text in file.damage)


def test_nothing_to_salvage() -> None:
    with pytest.raises(FormatError, match="nothing can be salvaged"):
        mcz.open(b"no chunk at all" * 20, salvage=True)


def test_source_counts_and_reads_exactly() -> None:
    source = ByteSource(io.BytesIO(bytes(100)))
    assert source.read(10, 20) == bytes(20)
    assert (source.n_requests, source.n_bytes) == (1, 20)
    with pytest.raises(TruncatedError):
        source.read(90, 11)


def test_schemas_refuse_trailing_bytes() -> None:
    with pytest.raises(FormatError):
        parse(note_records.GroupNotes, b"\0\0!", "group notes")
