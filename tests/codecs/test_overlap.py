"""The codec contract, proved by a codec with overlapping support and two resolutions."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

import mcz
from mcz import codecs
from tests import overlap_codec
from tests.motions import smooth


@pytest.fixture(autouse=True)
def overlap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(codecs.CODECS, overlap_codec.CODEC.name, overlap_codec.CODEC)


def encode_file(motion: mcz.Motion, **params: object) -> bytes:
    out = io.BytesIO()
    mcz.write(motion, out, codec="overlap", **params)
    return out.getvalue()


def test_unknown_codec_makes_only_that_clip_unsupported(monkeypatch: pytest.MonkeyPatch) -> None:
    out = io.BytesIO()
    from mcz.container.writer import Writer
    from mcz.files.writing.clip_writer import write_clip

    writer = Writer(out)
    write_clip(writer, smooth(), codecs.codec_by_name("raw"), {})
    write_clip(writer, smooth(name="other"), overlap_codec.CODEC, {})
    write_clip(writer, smooth(name="newer"), replace(codecs.codec_by_name("raw"), version=9), {})
    writer.finish()
    monkeypatch.delitem(codecs.CODECS, overlap_codec.CODEC.name)
    with mcz.open(out.getvalue()) as file:
        assert list(file.clips) == ["smooth", "other", "newer"]
        assert file.clips["other"].codec == "codec 251"
        assert file.clips["smooth"].read().shape == (50, 10)
        for name in ("other", "newer"):
            with pytest.raises(mcz.UnsupportedError):
                file.clips[name].read()


def test_tiny_payloads_keep_the_overhead_bound() -> None:
    """DESIGN 3: 160 bytes, 1 byte a stream, 1 % of the payload."""
    from mcz.files.reading.sizes import clip_sizes

    motion = smooth(40)
    values = np.zeros_like(motion.values)
    with mcz.open(encode_file(motion.with_values(values), length=40)) as file:
        clip = file.clips["smooth"]
        sizes = clip_sizes(file.container, clip)
        row, counts = clip.signals[0].rows[0], clip.signals[0].counts
        table = file.container.table(row, counts)
        n_streams = sum(length > 0 for length in table.lengths)
        assert sizes.overhead <= 160 + n_streams + 0.01 * sizes.payload
