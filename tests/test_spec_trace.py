"""Traced streams of SPEC.md are decoded so, by the plain decoders that trace them and by ours."""

from __future__ import annotations

from types import ModuleType

import pytest

from mcz.codecs.contract import Codec, Layout, Request, Span
from mcz.codecs.lossless import best, fast
from mcz.model.numbers import Grid, GridKind
from tests.test_spec import SPEC
from tools import spec_trace, spec_trace_fast

LINES = SPEC.split("<!-- trace best -->\n```\n")[1].split("```")[0].splitlines()


def test_ordinals_are_those_that_the_text_says() -> None:
    leads = [tuple(step.lead for step in steps) for steps in spec_trace.rows()]
    assert leads == list(spec_trace.ORDINALS[1:])
    said = " ".join(SPEC.split("## A traced stream\n")[1].split("<!--")[0].split())
    assert ", ".join(f"{one} {two}" for one, two in spec_trace.ORDINALS) + ". The" in said
    assert f"The stream is ``` {spec_trace.STREAM.hex(' ').upper()} ```" in said


def test_lines_of_the_text_are_those_of_the_decoder() -> None:
    assert "\n".join([*LINES, ""]) == spec_trace.trace_bits()
    bits = [line.split() for line in LINES if line[:3].strip().isdigit()]
    assert len(bits) >= 10
    assert [int(bit[0]) for bit in bits] == list(range(1, len(bits) + 1))


def test_traced_stream_of_fast() -> None:
    ordinals = [tuple(row) for row, _ in spec_trace_fast.rows()]
    assert ordinals == list(spec_trace_fast.ORDINALS)
    section = SPEC.split("### A traced stream of fast\n")[1]
    assert f"```\n{spec_trace_fast.STREAM.hex(' ').upper()}\n```" in section
    assert f"<!-- trace fast -->\n```\n{spec_trace_fast.trace()}```" in section


@pytest.mark.parametrize(
    ("codec", "trace"),
    [(best.CODEC, spec_trace), (fast.CODEC, spec_trace_fast)],
    ids=lambda one: one.name if isinstance(one, Codec) else "",
)
def test_the_package_decodes_the_same_stream(codec: Codec, trace: ModuleType) -> None:
    grids = (Grid(GridKind.FIXED, 1),) * 2
    n_rows = len(trace.ORDINALS)
    layout = Layout(n_rows, ((0, 1),), grids=grids)
    decoded = codec.decode(
        b"", layout, [Span(0, n_rows)], Request(0, n_rows, (0,)), lambda *_: trace.STREAM
    )
    assert decoded.tolist() == [list(row) for row in trace.ORDINALS]
