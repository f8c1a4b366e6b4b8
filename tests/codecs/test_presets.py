"""Presets: names of one bitstream, which reading ignores and edits keep."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.codecs import CODECS, codec_by_id
from mcz.errors import UnsupportedError
from tests.motions import smooth

SHARED = [name for name, codec in CODECS.items() if codec.preset]
UNKNOWN = {"raw": "raw", "mrdwt": "wavelet", "mdtt": "lsdt-clip", "online": "online"}


def motion(name: str = "one") -> mcz.Motion:
    found = replace(smooth(40), name=name)
    return replace(found, skeleton=replace(found.skeleton, unit_cm=1.0))


def encode_preset(codec: str, **params: Any) -> bytes:
    out = io.BytesIO()
    mcz.write(motion(), out, codec, **params)
    return out.getvalue()


def presets(data: bytes) -> list[tuple[str, int]]:
    with mcz.open(data) as file:
        return [(clip.codec, clip.signals[0].preset) for clip in file]


@pytest.mark.parametrize("name", SHARED)
def test_a_clip_is_called_by_its_preset(name: str) -> None:
    codec = CODECS[name]
    data = encode_preset(name)
    assert presets(data) == [(name, codec.preset)]
    with mcz.open(data) as file:
        assert [clip.name for clip in file.find(f"codec == '{name}'")] == ["one"]


@pytest.mark.parametrize(("preset", "id_"), [("default", 0), ("mod", 1), ("rc", 2), ("rca", 3)])
def test_presets_of_online(preset: str, id_: int) -> None:
    rate = {"bitrate": 64.0} if preset.startswith("rc") else {}
    assert presets(encode_preset("online", preset=preset, **rate)) == [("online", id_)]


@pytest.mark.parametrize("name", UNKNOWN)
def test_an_unknown_preset_is_ignored_and_kept(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with mcz.open(encode_preset(name)) as file:
        expected = file.clips["one"].read()
    monkeypatch.setitem(CODECS, name, replace(CODECS[name], preset=99))
    data = encode_preset(name)
    monkeypatch.undo()
    with mcz.open(data) as file:
        clip = file.clips["one"]
        assert (clip.codec, clip.signals[0].preset) == (UNKNOWN[name], 99)
        np.testing.assert_array_equal(clip.read(), expected)
    cut, merged = io.BytesIO(), io.BytesIO()
    mcz.extract(data, cut, frames=(4, 30))
    assert presets(cut.getvalue()) == [(UNKNOWN[name], 99)]
    mcz.merge([cut.getvalue()], merged)
    assert presets(merged.getvalue()) == [(UNKNOWN[name], 99)]


@pytest.mark.parametrize("id_", [4, 5, 15, 22, 127, 200, 255])
def test_other_ids_are_unknown(id_: int) -> None:
    with pytest.raises(UnsupportedError, match=f"codec {id_} is unknown"):
        codec_by_id(id_, 0, 1)
