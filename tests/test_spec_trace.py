"""Traced streams of SPEC.md are decoded so, by the plain decoders that trace them and by ours."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import mcz
from mcz.codecs.contract import Codec, Layout, Request, Span
from mcz.codecs.lossless import best, fast
from mcz.codecs.posewave.model import start_coder, start_tables
from mcz.codecs.posewave.model_state import USUAL
from mcz.codecs.posewave.row_coder import RowCoder, Stream, code_head
from mcz.model.numbers import Grid, GridKind
from tests.test_spec import SPEC
from tools.spec_traces import best as trace_of_best
from tools.spec_traces import fast as trace_of_fast
from tools.spec_traces import posewave, posewave_state

VECTORS = Path(__file__).parents[1] / "conformance" / "vectors"
LINES = SPEC.split("<!-- trace best -->\n```\n")[1].split("```")[0].splitlines()


def test_ordinals_are_those_that_the_text_says() -> None:
    leads = [tuple(step.lead for step in steps) for steps in trace_of_best.rows()]
    assert leads == list(trace_of_best.ORDINALS[1:])
    said = " ".join(SPEC.split("## A traced stream\n")[1].split("<!--")[0].split())
    assert ", ".join(f"{one} {two}" for one, two in trace_of_best.ORDINALS) + ". The" in said
    assert f"The stream is ``` {trace_of_best.STREAM.hex(' ').upper()} ```" in said


def test_lines_of_the_text_are_those_of_the_decoder() -> None:
    assert "\n".join([*LINES, ""]) == trace_of_best.trace_bits()
    bits = [line.split() for line in LINES if line[:3].strip().isdigit()]
    assert len(bits) >= 10
    assert [int(bit[0]) for bit in bits] == list(range(1, len(bits) + 1))


def test_traced_stream_of_fast() -> None:
    ordinals = [tuple(row) for row, _ in trace_of_fast.rows()]
    assert ordinals == list(trace_of_fast.ORDINALS)
    section = SPEC.split("### A traced stream of fast\n")[1]
    assert f"```\n{trace_of_fast.STREAM.hex(' ').upper()}\n```" in section
    assert f"<!-- trace fast -->\n```\n{trace_of_fast.trace()}```" in section


def test_traced_row_of_posewave() -> None:
    decoded = [tuple(tuple(row) for row in doubles) for doubles, _ in posewave.levels()]
    assert tuple(decoded) == posewave.DOUBLES
    section = SPEC.split("### A traced row\n")[1]
    streams = "".join(f"{stream.hex(' ').upper()}\n" for stream in posewave.STREAMS)
    assert f"```\n{streams}```" in section
    assert f"<!-- trace posewave -->\n```\n{posewave.trace()}```" in section


def test_posewave_decodes_the_same_rows() -> None:
    start = start_tables()[0]
    header = SimpleNamespace(prior=None, refining=False, dependent=True, start=start)
    n = len(posewave.CLASSES)
    coder = start_coder(start)
    rows = RowCoder(header, np.array(posewave.CLASSES), np.ones(n, bool), coder, "rows")
    for level, (kind, n_rows) in enumerate(posewave.LEVELS):
        rows.begin(level, kind, n_rows, Stream(coder, 0, posewave.STREAMS[level]))
        assert (rows.decode() * 2).tolist() == [list(row) for row in posewave.DOUBLES[level]]


@pytest.mark.parametrize("vector", posewave_state.VECTORS)
def test_digest_of_the_state_of_posewave(vector: str) -> None:
    """The plain decoder and ours end in the same state, to the last bit."""
    with mcz.open(VECTORS / f"valid/posewave/{vector}.mcz") as file:
        info = file.only_clip().signals[0]
        _, streams = file.container.streams(info.rows[0], info.counts, None)
    levels = list(streams.values())
    frames, n_levels, dependent = posewave_state.VECTORS[vector]
    classes = np.array(posewave_state.CLASSES)
    n = len(classes)
    start = start_tables()[0]
    header = SimpleNamespace(prior=None, refining=False, dependent=dependent, start=start)
    coder = start_coder(start)
    rows = RowCoder(header, classes, np.ones(n, bool), coder, "rows")
    for level, (kind, n_rows) in enumerate(posewave_state.levels_of(frames, n_levels)):
        stream = Stream(coder, 0, levels[level])
        if level == 0:
            kept = np.zeros(n, np.int64)
            code_head(stream, np.where(classes, 0, 1), kept, kept.copy(), "head")
        rows.begin(level, kind, n_rows, stream)
        rows.decode()
    ours, columns = rows.model, rows.model.columns[0]
    numbers = [
        *ours.variances[0, :n],
        *(columns[a, b] for b in range(1, n) for a in range(b)),
        *(ours.seen[0], *ours.taps.ravel(), *ours.tap_energy.ravel()),
        *(*ours.level_weights.ravel(), *ours.own_weights[:, :n].T.ravel()),
        *ours.features[USUAL, :n],
    ]
    assert numbers == posewave_state.numbers_of(posewave_state.decode_state(vector, levels))
    digest = posewave_state.digest(numbers)
    assert f"| {vector} | `{digest}` |" in SPEC


@pytest.mark.parametrize(
    ("codec", "trace"),
    [(best.CODEC, trace_of_best), (fast.CODEC, trace_of_fast)],
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
