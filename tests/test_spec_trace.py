"""The traced stream of SPEC.md is decoded so, by the plain decoder that traces it and by ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import mcz
from mcz import Channel, Joint, Motion, Signal, Skeleton
from mcz.numbers import Grid, GridKind
from tests.test_spec import SPEC
from tools import spec_trace

LINES = SPEC.split("<!-- trace -->\n```\n")[1].split("```")[0].splitlines()


def test_ordinals_are_those_that_the_text_says() -> None:
    rows = list(spec_trace.rows())
    assert [row.ordinal for row in rows] == list(spec_trace.ORDINALS)
    said = SPEC.split("## A traced stream\n")[1].split("<!--")[0]
    words = " ".join(said.split())
    assert f"ordinals {', '.join(map(str, spec_trace.ORDINALS))}, as" in words
    assert f"stream is {spec_trace.STREAM.hex(' ').upper()}:" in words


def test_lines_of_the_text_are_those_of_the_decoder() -> None:
    assert "\n".join([*LINES, ""]) == spec_trace.traced()
    bits = [line.split() for line in LINES if line[:3].strip().isdigit()]
    assert len(bits) >= 10
    assert [int(bit[0]) for bit in bits] == list(range(1, len(bits) + 1))
    assert bits[0][10:13] == ["00000000", "FFFFFFFF", spec_trace.STREAM[2:6].hex().upper()]


def test_the_package_codes_and_decodes_the_same_stream(tmp_path: Path) -> None:
    skeleton = Skeleton((Joint("j", channels=(Channel("rx"),)),), name="s")
    values = np.array(spec_trace.ORDINALS)[:, None] / 10
    signal = Signal(values, grids=(Grid(GridKind.FIXED, 1),))
    path = tmp_path / "a.mcz"
    mcz.write(Motion(skeleton, (signal,), name="a"), path, codec="lossless")
    assert spec_trace.STREAM in path.read_bytes()
    with mcz.open(path) as file:
        assert file.clips["a"].read().tolist() == values.tolist()
