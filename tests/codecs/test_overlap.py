"""The codec contract, proved by a codec with overlapping support and two resolutions."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

import mcz
from mcz import codecs
from mcz.container.segments import parse_table
from tests import overlap_codec
from tests.motions import smooth


@pytest.fixture(autouse=True)
def overlap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(codecs.CODECS, overlap_codec.ID, overlap_codec.CODEC)


def encoded(motion: mcz.Motion, **params: object) -> bytes:
    out = io.BytesIO()
    mcz.write(motion, out, codec="overlap", **params)
    return out.getvalue()


def test_decodes_to_what_was_encoded() -> None:
    motion = smooth(47)
    with mcz.open(encoded(motion)) as file:
        clip = file.clips["smooth"]
        np.testing.assert_allclose(clip.read(), motion.values, rtol=0, atol=1e-12)
        assert clip.codec == "overlap"


@pytest.mark.parametrize("frames", [(0, 47), (9, 11), (19, 20), (10, 10), (46, 47), (0, 1)])
@pytest.mark.parametrize("joints", [None, ["knee"], ["spine", "hips"], []])
@pytest.mark.parametrize("resolution", [0, 1])
def test_part_equals_whole(frames, joints, resolution) -> None:
    with mcz.open(encoded(smooth(47))) as file:
        clip = file.clips["smooth"]
        whole = clip.read(resolution=resolution)
        columns = [c for j in joints or [] for c in clip.skeleton.columns(clip.skeleton.find(j))]
        if joints is None:
            columns = list(range(10))
        part = clip.read(frames, joints, resolution)
        np.testing.assert_array_equal(part, whole[frames[0] : frames[1]][:, columns])


def test_lower_resolution_leaves_streams_unread() -> None:
    data = encoded(smooth(400), length=100)
    with mcz.open(data, unverified=True) as file:
        clip = file.clips["smooth"]
        row, counts = clip.signals[0].rows[0], clip.signals[0].counts
        table = parse_table(data[row.offset : row.offset + row.size], counts)
        detail = sum(table.lengths[table.codec(1, g)] for g in range(counts.n_groups))
        costs = []
        for resolution in (0, 1):
            before = file.container.source.n_bytes
            clip.read((0, 99), ["hips", "spine", "knee"], resolution)
            costs.append(file.container.source.n_bytes - before)
        assert costs[0] - costs[1] >= detail - counts.n_groups * 256


def test_decimate_returns_every_second_frame() -> None:
    with mcz.open(encoded(smooth(47))) as file:
        clip = file.clips["smooth"]
        np.testing.assert_array_equal(
            clip.read(resolution=1, decimate=True), clip.read(resolution=1)[::2]
        )


def test_resolution_out_of_range() -> None:
    with mcz.open(encoded(smooth())) as file, pytest.raises(mcz.OptionError, match="resolutions 0"):
        file.clips["smooth"].read(resolution=2)


def test_lossy_hash_is_that_of_the_decoded_values() -> None:
    data = bytearray(encoded(smooth(47)))
    with mcz.open(bytes(data)) as file:
        row = file.clips["smooth"].signals[0].rows[1]
        assert file.clips["smooth"].read().shape == (47, 10)
    data[row.offset + row.size - 1] ^= 1
    with mcz.open(bytes(data)) as file, pytest.raises(mcz.ChecksumError):
        file.clips["smooth"].read()


@pytest.mark.parametrize("value", [1, "many", 2**40])
def test_bad_parameter(value) -> None:
    with pytest.raises(mcz.OptionError, match="length"):
        encoded(smooth(), length=value)


def test_unknown_parameter_names_the_known_ones() -> None:
    with pytest.raises(mcz.OptionError, match="no parameter 'size'; it has length"):
        encoded(smooth(), size=4)


def test_unknown_codec_makes_only_that_clip_unsupported(monkeypatch: pytest.MonkeyPatch) -> None:
    out = io.BytesIO()
    from mcz.container.writer import Writer
    from mcz.writing.clip_writer import write_clip

    writer = Writer(out)
    write_clip(writer, smooth(), codecs.by_name("raw"), {})
    write_clip(writer, smooth(name="other"), overlap_codec.CODEC, {})
    write_clip(writer, smooth(name="newer"), replace(codecs.by_name("raw"), version=9), {})
    writer.finish()
    monkeypatch.delitem(codecs.CODECS, overlap_codec.ID)
    with mcz.open(out.getvalue()) as file:
        assert list(file.clips) == ["smooth", "other", "newer"]
        assert file.clips["other"].codec == "codec 251"
        assert file.clips["smooth"].read().shape == (50, 10)
        for name in ("other", "newer"):
            with pytest.raises(mcz.UnsupportedError):
                file.clips[name].read()


def test_tiny_payloads_keep_the_overhead_bound() -> None:
    """DESIGN 3: 160 bytes, 1 byte a stream, 1 % of the payload."""
    from mcz.reading.sizes import clip_sizes

    motion = smooth(40)
    values = np.zeros_like(motion.values)
    with mcz.open(encoded(motion.with_values(values), length=40)) as file:
        clip = file.clips["smooth"]
        sizes = clip_sizes(file.container, clip)
        row, counts = clip.signals[0].rows[0], clip.signals[0].counts
        table = file.container.table(row, counts)
        n_streams = sum(length > 0 for length in table.lengths)
        assert sizes.overhead <= 160 + n_streams + 0.01 * sizes.payload
