"""The traced stream of SPEC.md is decoded so, by the plain decoder that traces it and by ours."""

from __future__ import annotations

from mcz.codecs.contract import Layout, Request, Span
from mcz.codecs.lossless.best import CODEC
from mcz.model.numbers import Grid, GridKind
from tests.test_spec import SPEC
from tools import spec_trace

LINES = SPEC.split("<!-- trace -->\n```\n")[1].split("```")[0].splitlines()


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


def test_the_package_decodes_the_same_stream() -> None:
    grids = (Grid(GridKind.FIXED, 1),) * 2
    n_rows = len(spec_trace.ORDINALS)
    layout = Layout(n_rows, ((0, 1),), grids=grids)
    request = Request(0, n_rows, (0,))
    stream = spec_trace.STREAM
    found = CODEC.decode(b"", layout, [Span(0, n_rows)], request, lambda *_: stream)
    assert found.tolist() == [list(row) for row in spec_trace.ORDINALS]
