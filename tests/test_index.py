"""INDX by hand against its schema: the same bytes, the same fields, the same refusals."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import conformance
import mcz
from mcz.container import index_records
from mcz.container.chunks import Chunk
from mcz.container.directory import AttachmentRow, ClipRow, Directory, SegmentRow, SignalRow
from mcz.container.index import index_content, parse_content
from mcz.container.segments import SegmentHeader
from mcz.schema import parse
from tools.records import built

NUMBERS = st.integers(0, 2**53 - 1)
SMALL = st.integers(0, 2**20)
NAMES = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=12)


@st.composite
def rows(draw: st.DrawFn, name: str) -> ClipRow:
    numbers = st.tuples(*[SMALL] * 6)
    signals = tuple(
        SignalRow(*fields) for fields in draw(st.lists(numbers, min_size=1, max_size=2))
    )
    clip = Chunk(b"CLIP", 0, draw(SMALL), draw(SMALL))
    row = ClipRow(
        name,
        draw(st.binary(min_size=16, max_size=16)),
        *draw(st.tuples(*[NUMBERS] * 3)),
        signals,
        clip,
    )
    end, first = clip.offset + clip.size, [0] * len(signals)
    for _ in range(draw(st.integers(0, 3))):
        gap, size, n_frames = draw(SMALL), draw(SMALL), draw(SMALL)
        signal = draw(st.integers(0, len(signals) - 1))
        header = SegmentHeader(signal, first[signal], n_frames, draw(SMALL), draw(SMALL), 1)
        row.segments.append(SegmentRow(end + gap, size, header))
        first[signal] += n_frames
        end += gap + size
    row.cend = Chunk(b"CEND", 0, end + draw(SMALL), draw(SMALL))
    row.ancillary += [Chunk(b"QUAL", 1, draw(SMALL), draw(SMALL)) for _ in range(draw(SMALL) % 3)]
    return row


@st.composite
def directories(draw: st.DrawFn) -> Directory:
    held = Directory(head=draw(st.binary(max_size=9)))
    for id_ in draw(st.sets(st.binary(min_size=16, max_size=16), max_size=2)):
        held.shared[b"SKEL", id_] = Chunk(b"SKEL", 0, draw(NUMBERS), draw(SMALL))
    for name in draw(st.sets(NAMES, max_size=2)):
        parts = [Chunk(b"ATTA", 0, draw(SMALL), draw(SMALL)) for _ in range(draw(SMALL) % 2 + 1)]
        held.attachments[name] = AttachmentRow(name, draw(NUMBERS), parts)
    for name in draw(st.sets(NAMES, max_size=2)):
        held.aliases[name] = draw(st.integers(0, 2)), draw(st.binary(max_size=20))
    for name in draw(st.lists(NAMES, max_size=3, unique=True)):
        held.clips[name] = draw(rows(name))
    return held


@given(directories())
def test_what_is_built_is_read_by_hand_and_by_schema(held: Directory) -> None:
    content = index_content(held)
    again = parse_content(content)
    assert index_content(again) == content  # from what is packed still
    assert again == held
    assert index_content(again) == content  # and from what was unpacked
    fields = parse(index_records.Index, content, "INDX")
    assert built(index_records.Index, fields, "INDX") == content
    assert [row.name for row in fields.clips] == list(held.clips)


@given(directories(), st.data())
def test_a_changed_index_is_refused_by_both_or_by_neither(
    held: Directory, data: st.DataObject
) -> None:
    content = bytearray(index_content(held))
    at = data.draw(st.integers(0, len(content) - 1))
    content[at] ^= 1 << data.draw(st.integers(0, 7))
    del content[data.draw(st.integers(at, len(content))) :]
    try:
        parse(index_records.Index, bytes(content), "INDX")
    except mcz.MczError:
        with pytest.raises(mcz.MczError):
            parse_content(bytes(content))


def test_every_vector_with_an_index_lists_what_its_walk_finds() -> None:
    from mcz.container.scan import scan
    from mcz.container.source import open_source

    folder = Path(conformance.__file__).parent / "vectors" / "valid" / "container"
    seen = 0
    for path in sorted(folder.rglob("*.mcz")):
        with mcz.open(path) as file:
            if file.container.index is None:
                continue
            source = open_source(str(path))
            walked = scan(source).directory
            source.close()
            assert file.container.directory.clips == walked.clips, path.name
            seen += 1
    assert seen > 5
