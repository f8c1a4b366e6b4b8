"""Every codec decodes bytes that no encoder wrote, or raises an error of ours."""

from __future__ import annotations

import io
from contextlib import suppress
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz.codecs import CODECS
from mcz.codecs.contract import Model, model_id
from tests.amounts import amount
from tests.codecs.cases import CASES, small, write_smooth
from tests.codecs.lossy import Direct
from tests.repair import flip_bit, flips, join_parts, memory_below, parts_of, replace_payload, use

NAMES = [name for name in CASES if name != "overlap"]
EVERY = pytest.mark.parametrize("name", NAMES)
LOSSY = pytest.mark.parametrize("name", [name for name in NAMES if CASES[name].error])
CODEC = pytest.mark.parametrize("name", CODECS)
REFUSED = ("FormatError", "TruncatedError", "LimitError")


def outcome(coded: Direct, changes: dict[str, Any]) -> str:
    """The values in hexadecimal, or the error: of the whole, then of a part of a resolution."""
    last, coarsest = (len(coded.layout.groups) - 1,), coded.layout.n_resolutions - 1
    try:
        decoded = coded.read(changes=changes).tobytes().hex()
        coded.read(3, 9, last, coarsest, changes=changes)
    except mcz.MczError as error:
        assert str(error)
        return type(error).__name__
    return decoded


@EVERY
def test_every_prefix_of_a_stream(name: str) -> None:
    """A cut stream may spell other values, of just that many bytes; added zeros do not."""
    coded = small(name)
    meant = outcome(coded, {})
    for place in coded.places():
        data = coded.stream(*place)
        for size in range(len(data)):
            assert outcome(coded, coded.with_stream(place, data[:size])) != meant
        for more in (b"\0", bytes(99)) if data else ():
            assert outcome(coded, coded.with_stream(place, data + more)) in REFUSED
        if data:
            assert outcome(coded, coded.with_stream(place, data + b"\xff")) != meant


@EVERY
def test_every_bit_of_a_stream(name: str) -> None:
    coded = small(name)
    for place in coded.places():
        data = coded.stream(*place)
        for byte, bit in flips(len(data), 10**9, seed=0):
            outcome(coded, coded.with_stream(place, flip_bit(data, byte, bit)))


@EVERY
@settings(max_examples=20)
@given(st.data())
def test_streams_of_any_bytes(name: str, data: st.DataObject) -> None:
    coded = small(name)
    place = data.draw(st.sampled_from(coded.places()))
    outcome(coded, coded.with_stream(place, data.draw(st.binary(max_size=60))))


@EVERY
def test_every_prefix_and_bit_of_a_header(name: str) -> None:
    coded = small(name)
    assert len(outcome(coded, {})) > 99  # what is loaded once takes no memory below
    for size in range(len(coded.header)):
        assert outcome(coded, {"header": coded.header[:size]}) in REFUSED
    assert outcome(coded, {"header": coded.header + b"\0"}) in REFUSED
    with memory_below(32 * 2**20):
        for byte, bit in flips(len(coded.header), 10**9, seed=0):
            outcome(coded, {"header": flip_bit(coded.header, byte, bit)})


@pytest.mark.parametrize("name", [name for name in NAMES if CASES[name].codec.uses])
def test_a_model_that_is_not_there_cut_or_changed(name: str) -> None:
    coded = small(name)
    (model,) = [*coded.models[0], *coded.models[1]] or [None]
    if model is None:
        assert coded.codec.uses(coded.header) == ()
        return
    assert coded.codec.uses(coded.header) == (model_id(model),)
    for find_model in (None, lambda _: None):
        with pytest.raises(mcz.UnsupportedError, match=model_id(model).hex()):
            coded.read(changes={"layout": replace(coded.layout, find_model=find_model)})
    with pytest.raises(mcz.FormatError):
        layout = replace(coded.layout, find_model=lambda _: Model(99, model.data))
        coded.read(changes={"layout": layout})
    bad = [model.data[:size] for size in range(len(model.data))]
    bad += [flip_bit(model.data, *at) for at in flips(len(model.data), 200, seed=0)]
    for data in bad:
        layout = replace(coded.layout, find_model=lambda _, data=data: Model(model.kind, data))
        outcome(coded, {"layout": layout})


@LOSSY
def test_layouts_and_segments_that_do_not_fit(name: str) -> None:
    coded = small(name)
    halves = {"all": ((0,), tuple(range(1, coded.layout.n_channels))), "channel": ((0, 1), (2,))}
    grouping = coded.codec.grouping
    changes = [{"samples_per_frame": 2}, {"n_resolutions": 12}]
    changes += [{"groups": halves[grouping]}] if grouping in halves else []
    for change in changes:
        with pytest.raises(mcz.FormatError):
            coded.read(groups=(0,), changes={"layout": replace(coded.layout, **change)})
    first, *others = coded.spans
    for change in ({"lead": 1}, {"tail": 1}, {"fresh": False}):
        with pytest.raises(mcz.FormatError):
            coded.read(changes={"spans": [replace(first, **change), *others]})


@CODEC
def test_files_with_repaired_checksums(name: str) -> None:
    """The public reader, extract and salvage, behind every checksum."""
    data = write_smooth(name, 20, 12)
    use(data)
    parts = parts_of(data)
    for number, (chunk, payload) in enumerate(parts):
        if chunk.type not in (b"DATA", b"CLIP", b"MODL"):
            continue  # no codec has a say in them
        bad = [flip_bit(payload, *at) for at in flips(len(payload), amount(60, 25), seed=number)]
        bad += [payload[:size] for size in range(0, len(payload), max(1, len(payload) // 5))]
        for changed in bad:
            file_data = join_parts(replace_payload(parts, number, changed))
            with suppress(mcz.MczError):
                use(file_data)
            with suppress(mcz.MczError):
                use(file_data, salvage=True)
            with suppress(mcz.MczError):
                mcz.extract(file_data, io.BytesIO(), frames=(4, 9))
