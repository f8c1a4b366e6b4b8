"""Short files: texts and skeletons deflated after the words of an annex."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.container import payloads
from mcz.container.encodings import encode_smallest, words
from mcz.model.schema import deflate, inflate

TINY = """HIERARCHY
ROOT Hips
{
  OFFSET 0.00 0.00 0.00
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT LeftUpLeg
  {
    OFFSET 3.91 0.00 0.00
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0.00 -18.34 0.00
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.033333
8.03 35.01 88.36 -3.41 14.78 -164.35 13.09 40.30 -24.60
7.81 35.10 86.47 -3.78 12.94 -166.97 12.64 42.57 -22.34
"""


@given(st.binary(max_size=300) | st.text("HIERARCHY OFFSET CHANNELS\n 0.", max_size=300))
def test_what_follows_words_comes_back(text: bytes | str) -> None:
    data = text if isinstance(text, bytes) else text.encode()
    packed = deflate(data, words=words())
    assert inflate(packed, len(data), "here", words=words()) == data
    encoding, found = encode_smallest(data, short=True)
    assert len(found) <= min(len(data), len(deflate(data)), len(packed))
    assert encoding in (payloads.STORED, payloads.DEFLATED, payloads.AFTER_WORDS)
    assert encode_smallest(data, short=False)[0] != payloads.AFTER_WORDS


def test_a_file_of_a_few_hundred_bytes(tmp_path: Path) -> None:
    source, target = tmp_path / "tiny.bvh", tmp_path / "tiny.mcz"
    source.write_text(TINY)
    mcz.encode(source, target)
    usual = tmp_path / "usual.mcz"
    mcz.write(mcz.read(source), usual)
    assert target.stat().st_size < 0.7 * usual.stat().st_size
    with mcz.open(target) as file:
        assert file.only_clip().source_bytes() == source.read_bytes()
    assert mcz.verify(target) == []
    other = tmp_path / "other.bvh"
    other.write_text(TINY.replace("8.03", "9.03"))
    mcz.append([other], target)
    with mcz.open(target) as file:
        assert [clip.source_bytes() for clip in file.clips.values()] == [
            source.read_bytes(),
            other.read_bytes(),
        ]
    assert mcz.verify(target) == []
