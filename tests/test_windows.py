"""Windows of a clip, and what a file keeps of those before."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz import ChecksumError, Signal
from mcz.container.caches import MOST_BYTES, DecodedCache, Run
from mcz.container.segments import FRESH
from tests.motions import smooth, write_bytes

LENGTH = 90
VECTORS = Path(__file__).parent.parent / "conformance" / "vectors"


def file_of(codec: str, **options: object) -> bytes:
    return write_bytes(smooth(LENGTH), codec=codec, **options)


FILES = {codec: file_of(codec, segment_frames=16) for codec in ("fast", "best", "mrdwt")}


@pytest.mark.parametrize("codec", sorted(FILES))
@settings(max_examples=30)
@given(data=st.data())
def test_windows_are_those_of_the_whole(codec: str, data: st.DataObject) -> None:
    with mcz.open(FILES[codec]) as file:
        clip = file.only_clip()
        joints = [joint.name for joint in clip.skeleton.joints if joint.channels]
        whole = {None: clip.read(), **{name: clip.read(joints=[name]) for name in joints}}
    with mcz.open(FILES[codec]) as file:
        clip = file.only_clip()
        for _ in range(data.draw(st.integers(1, 8))):
            a = data.draw(st.integers(0, LENGTH))
            b = data.draw(st.integers(a, LENGTH))
            name = data.draw(st.sampled_from([None, *joints]))
            decoded = clip.read((a, b), None if name is None else [name])
            np.testing.assert_array_equal(decoded, whole[name][a:b])
            decoded[:] = np.nan  # a caller's own


def test_a_file_keeps_no_more_than_it_says() -> None:
    runs = DecodedCache()
    for number in range(40):
        runs.put(number, Run(0, np.zeros(MOST_BYTES // 16), None))
        held = sum(run.n_bytes for run in map(runs.get, range(number + 1)) if run)
        assert held <= MOST_BYTES
    assert runs.get(39) is not None
    assert runs.get(0) is None


def test_damage_is_told_each_time() -> None:
    data = bytearray(FILES["fast"])
    with mcz.open(bytes(data)) as file:
        row = file.only_clip().signals[0].rows[2]
        data[row.offset + row.size - 3] ^= 1
    with mcz.open(bytes(data)) as file:
        clip = file.only_clip()
        clip.read((0, 20))
        for _ in range(2):
            with pytest.raises(ChecksumError):
                clip.read((30, 40))
        clip.read((60, 70))


@pytest.mark.parametrize("name", ["appended", "clips"])
def test_damage_later_in_a_run_leaves_what_is_before(name: str) -> None:
    data = bytearray((VECTORS / f"valid/lsdt-frame/{name}.mcz").read_bytes())
    with mcz.open(bytes(data)) as file:
        whole, rows = file.clips["common"].read(), file.clips["common"].signals[0].rows
    first, last = rows[-2].header, rows[-1]
    assert not last.header.flags & FRESH
    data[last.offset + last.size - 1] ^= 1
    with mcz.open(bytes(data)) as file:
        clip = file.clips["common"]
        for _ in range(2):
            decoded = clip.read((first.first, first.stop))
            np.testing.assert_array_equal(decoded, whole[first.first : first.stop])
            with pytest.raises(ChecksumError):
                clip.read((last.header.first, last.header.stop))


def test_segments_that_no_channel_needs_are_checked() -> None:
    still = mcz.Motion(mcz.Skeleton((mcz.Joint("rock"),)), (Signal(np.zeros((7, 0))),), name="rock")
    data = bytearray(write_bytes(still))
    with mcz.open(bytes(data)) as file:
        row = file.only_clip().signals[0].rows[0]
    data[row.offset + 1] ^= 4
    with mcz.open(bytes(data)) as file, pytest.raises(mcz.MczError):
        file.only_clip().read()
