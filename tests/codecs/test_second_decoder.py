"""The decoder in JavaScript reads files of this package's encoders, and random files.

That decoder was written from SPEC.md alone. Both have to give the same bits, of whole clips, of
parts and of every resolution. The stored vectors are conformance/run.py's, files that are changed
are tools/fuzz/differential.py's.
"""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from conformance import run
from conformance.child import Limits
from conformance.server import Server
from mcz.cli import conformance
from mcz.errors import MczError
from mcz.files.reading.lost_skeletons import LOST
from tests.amounts import amount
from tests.codecs import cases as contract
from tests.codecs.lossy import encode_file, markers, markers_with_gaps, random_walks, rough
from tests.motions import smooth
from tests.test_vector_tools import vector_of
from tools import make_vectors
from tools.fuzz.differential import equal
from tools.vectors.valid.random import COUNT

JS = Path(__file__).parents[2] / "tools" / "js" / "conformance.js"
MOST_OUTPUT = 2**27

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="there is no node")

CASES = [(c.name, dict(c.params)) for name, c in contract.CASES.items() if name != "overlap"]
POINTS = ("lsdt-frame", "lsdt-clip", "mdtt", "pca-rdo", "online")


@pytest.fixture(scope="module")
def other() -> Iterator[Server]:
    server = Server(["node", str(JS)], Limits())
    yield server
    server.close()


def check(data: bytes, other: Server, what: object) -> None:
    """Both give the same for all of each clip, some of its frames, and at every resolution."""
    with mcz.open(data) as file:
        requests: list[list[str]] = [[]]
        for clip in file.clips.values():
            own, n = ["--clip", clip.name], clip.n_frames
            ranges = (n // 3, n // 2), (n - n // 5, n)
            requests += [[*own, "--frames", f"{a}:{b}"] for a, b in ranges]
            coarser = range(1, clip.signals[0].counts.n_resolutions)
            requests += [[*own, "--resolution", str(resolution)] for resolution in coarser]
    for request in requests:
        code, output = conformance.answer(data, request)
        answer = other.ask(request, data, MOST_OUTPUT)
        assert code == 0, (what, request)
        assert (answer.code, answer.fault) == (0, ""), (what, request, answer.errors)
        assert equal(output, answer.output), (what, request)


@pytest.mark.parametrize(("codec", "params"), CASES, ids=str)
def test_clips(codec: str, params: dict[str, Any], other: Server) -> None:
    motions = [(f"smooth({n})", smooth(n)) for n in (0, 1, 2, 33, 100)]
    motions += [("rough", rough(70, 1)), ("rougher", rough(73, 3))]
    motions += [
        ("wandering", random_walks(50, ["rx", "ty", "tz"])),
        ("gapped", markers_with_gaps()),
    ]
    if codec in POINTS:
        motions += [("markers", markers(90)), ("31 markers", markers(40, 31))]
    for name, motion in motions:
        timed = replace(motion, frame_rate=motion.frame_rate or Fraction(60))  # a rate needs one
        check(encode_file(codec, timed, **params), other, name)


Arrays = list[tuple[str, str, np.ndarray, np.ndarray]]  # clip, signal, values, mask


def salvage_arrays(data: bytes) -> tuple[Arrays, set[str]]:
    """Arrays that this package salvages, and the names of clips without their skeleton.

    These a reader may give as channels without names (SPEC.md, "Salvage"); only this package does.
    """
    try:
        with mcz.open(data, salvage=True) as file:
            found: Arrays = []
            for clip in file.clips.values():
                for signal in clip.signals:
                    values, mask = clip.read_masked(signal=signal.index)
                    there = np.ones(values.shape, np.bool_) if mask is None else mask
                    found.append((clip.name, signal.name, values, there))
            nameless = {clip.name for clip in file.clips.values() if LOST in clip.damage}
            return found, nameless
    except MczError:
        return [], set()


def salvage_in_javascript(data: bytes, other: Server) -> Arrays:
    """Arrays that the decoder in JavaScript salvages; it must not crash or hang."""
    answer = other.ask(["--salvage"], data, MOST_OUTPUT)
    assert (answer.code in (0, 1), answer.fault) == (True, ""), answer.errors
    if answer.code:
        return []
    line, _, content = answer.output.partition(b"\n")
    found: Arrays = []
    for row in json.loads(line)["arrays"]:
        size = row["bytes"]
        array = np.frombuffer(content[:size], row["dtype"]).reshape(row["shape"])
        content = content[size:]
        if row["array"] == "values":
            found.append((row["clip"], row["signal"], array, np.ones(array.shape, np.bool_)))
        else:
            found[-1] = (*found[-1][:3], array.astype(np.bool_))
    return found


def damage(data: bytes, seed: int) -> bytes:
    """``data`` with a bit turned, a stretch of zeros or of rubbish, a stretch or the end gone."""
    rng = np.random.default_rng(seed)
    at = int(rng.integers(8, len(data)))
    size = int(rng.integers(1, 200))
    here, behind = data[:at], data[at + size :]
    flipped = here + bytes([data[at] ^ 1 << int(rng.integers(8))]) + data[at + 1 :]
    kinds = flipped, here + bytes(size) + behind, here + rng.bytes(size) + data[at:], here + behind
    return (*kinds, here)[seed % 5]


def live_clip(segment_frames: int) -> bytes:
    out = io.BytesIO()
    motion = smooth(60)
    params = {"step": 0.3, "segment_frames": segment_frames}
    rate = Fraction(60)
    writer = mcz.LiveWriter(out, motion.skeleton, "online", params, frame_rate=rate, name="a")
    for row in motion.signals[0].values:
        writer.push(row)
    writer.close()
    return out.getvalue()


DAMAGED = ("raw", "best", "fast", "pca", "posewave", "lsdt-clip", "live")


@pytest.mark.parametrize("codec", DAMAGED)
def test_salvage(codec: str, other: Server) -> None:
    """Both find the same in a damaged file."""
    params = {"segment_frames": 16}
    data = (
        live_clip(7) if codec == "live" else encode_file(codec, smooth(90), copies=True, **params)
    )
    found = 0
    for seed in range(20):
        bad = damage(data, seed)
        mine, nameless = salvage_arrays(bad)
        theirs = salvage_in_javascript(bad, other)
        mine = [one for one in mine if one[0] not in nameless]
        for one, another in zip(mine, theirs, strict=True):
            assert one[:2] == another[:2], seed
            np.testing.assert_array_equal(one[2], another[2], f"{codec} {seed}")
            np.testing.assert_array_equal(one[3], another[3], f"{codec} {seed}")
            found += 1
    assert found > 10


@pytest.mark.parametrize("part", range(4))
def test_files_made_at_random(part: int, other: Server) -> None:
    """Headers and streams that no encoder of ours would choose, beyond the stored ones."""
    for seed in range(COUNT + part, COUNT + amount(60, 28), 4):
        vector = vector_of(seed)
        for request in run.requests(make_vectors.row(vector), conformance.OPTIONS):
            answer = other.ask(request.arguments, vector.data, MOST_OUTPUT)
            fault = run.judge(request, answer.code, answer.output)
            assert fault is None, (seed, request.arguments, fault, answer.errors)
