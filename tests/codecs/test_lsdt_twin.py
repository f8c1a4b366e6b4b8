"""Hou's family of codecs against the plain decoder that was written from SPEC.md alone.

Values are compared bit for bit, and what one decoder refuses the other has to refuse. Beside what
the encoders write stand invented signals: any legal header, and streams of random decisions.
"""

from __future__ import annotations

import io
import random
import struct
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.codecs import by_name
from mcz.codecs.base import Layout, Model, Segment, id_of, model_finder
from mcz.files.memory import MemorySource
from mcz.motion import Motion
from tests import plain_lsdt, plain_wavelets
from tests.codecs.lossy import gapped, wandering
from tests.codecs.point_case import Case, stored
from tests.codecs.twins import VECTORS, clips_of, rough
from tests.inventor import Bounded, Inventor, Written, invented_code, invented_model, number
from tests.motions import smooth

NAMES = ("lsdt-frame", "lsdt-clip")
OWN_BASES = ("mdtt", "pca-rdo")  # their vectors are always learned from the clip
FAMILY = NAMES + OWN_BASES
SETTINGS: tuple[dict[str, Any], ...] = (
    {},
    {"step": 0.01, "segment_frames": 17},
    {"step": 0.01, "basis": "cosines", "coder": "prefix", "segment_frames": 30},
    {"step": 1, "basis": "learned"},
    {"step": 5, "basis": "learned", "coder": "prefix"},
    {"preset": "hou2016"},
    {"preset": "hou2016", "step": 1e-4},
)
WINDOWS: tuple[dict[str, Any], ...] = ({"window": 1}, {"window": 16, "segment_frames": 40})
OWN: tuple[dict[str, Any], ...] = (
    {},
    {"step": 0.01, "window": 20, "coder": "prefix"},
    {"step": 0.1, "window": 16, "frequencies": 3, "segment_frames": 40},
    {"rank": 2, "window": 1},
    {"preset": "hou2016"},
)
REAL_CLIPS = ("cmu/amc/05_01.amc", "cmu/bvh-daz/09_01.bvh", "other/ezc3d-testfiles/FP_Type1.c3d")


def encoded(name: str, motion: Motion, **params: object) -> Case:
    """A clip as the codec alone has it."""
    codec = by_name(name)
    source = MemorySource(motion, 0, codec, 2**26)
    coded = codec.encode(source, codec.options(params))
    finder = model_finder((*coded.models, *coded.known))
    layout = replace(source.layout, n_resolutions=coded.n_resolutions, find_model=finder)
    return Case(name, coded.header, layout, tuple(coded.segments))


def check_file(data: bytes) -> None:
    with mcz.open(io.BytesIO(data)) as file:
        for clip in clips_of(file, *FAMILY):
            stored(file, clip).check()


# What the encoders write


def all_settings(name: str) -> tuple[dict[str, Any], ...]:
    if name in OWN_BASES:
        return OWN
    return SETTINGS if name == "lsdt-frame" else SETTINGS + WINDOWS


ALL = [(name, settings) for name in FAMILY for settings in all_settings(name)]


@pytest.mark.parametrize(("name", "settings"), ALL, ids=str)
def test_clips(name: str, settings: dict[str, Any]) -> None:
    motions = [smooth(n) for n in (1, 2, 3, 40)]
    motions += [rough(70, 1), gapped(), wandering(50, ["rx", "ty"])]
    for motion in motions:
        encoded(name, motion, **settings).check()


@pytest.mark.parametrize("name", FAMILY)
@pytest.mark.parametrize("settings", [{}, {"domain": "channels"}, {"virtual_markers": True}])
def test_files(name: str, settings: dict[str, Any]) -> None:
    """Places of points and channels, through a container."""
    for motion in (smooth(0), smooth(60)):
        target = io.BytesIO()
        mcz.write(motion, target, codec=name, **settings)
        check_file(target.getvalue())


@pytest.mark.parametrize("frames", [(40, 90), (0, 5), (149, 150), (40, 41), (9, 9)], ids=str)
@pytest.mark.parametrize("name", FAMILY)
def test_extracted_clips(name: str, frames: tuple[int, int], tmp_path: Path) -> None:
    source, target = tmp_path / "all.mcz", tmp_path / "cut.mcz"
    mcz.write(smooth(150), source, codec=name, segment_frames=20)
    mcz.extract(source, target, frames=frames)
    check_file(target.read_bytes())


@pytest.mark.parametrize("name", FAMILY)
@pytest.mark.parametrize("coder", ["adaptive", "prefix"])
@pytest.mark.parametrize("seed", range(2))
def test_changes(name: str, coder: str, seed: int) -> None:
    case = encoded(name, gapped(), step=0.2 + seed, coder=coder, segment_frames=30)
    assert 20 < case.check_changes(120, seed) < 120


@pytest.mark.parametrize(
    "settings", [{"step": 1}, {"step": 0.01}, {"step": 0.3, "basis": "cosines"}], ids=str
)
def test_live(settings: dict[str, Any]) -> None:
    """Segments of one frame, of which only some start fresh."""
    codec = by_name("lsdt-frame")
    motion = gapped()
    signal = motion.signals[0]
    layout = replace(MemorySource(motion, 0, codec, 2**26).layout, n_frames=0)
    assert codec.live is not None
    live = codec.live(layout, codec.options(settings))
    segments = []
    for f in range(motion.n_frames):
        stream, fresh = live.push(signal.values[f], signal.mask[f])
        segments.append(Segment(f, 1, (stream,), fresh=fresh))
    full = replace(layout, n_frames=len(segments), find_model=model_finder(live.models))
    case = Case(codec.name, live.header, full, tuple(segments))
    case.check()
    assert 20 < case.check_changes(60, 0) < 60
    assert codec.follow is not None
    follower = codec.follow(live.header, full)
    rows = [follower.push(s.streams[0], s.fresh) for s in segments]
    assert np.array(rows, "<f8").tobytes() == case.plain()


def vectors(group: str) -> list[Path]:
    return sorted(path for name in FAMILY for path in VECTORS.glob(f"{group}/{name}/*"))


def vector_name(path: Path) -> str:
    return f"{path.parent.name}-{path.stem}"


@pytest.mark.parametrize("path", vectors("valid"), ids=vector_name)
def test_valid_vectors(path: Path) -> None:
    check_file(path.read_bytes())


# What a decoder without a container cannot know: the container's own rules, and hashes.
BESIDE = {"byte-missing", "hash-near", "hash-order", "integers", "model-byte-missing"}
BESIDE |= {"frames-0-resolutions", "model-changed", "samples", "segment-first"}


REFUSED = [path for path in vectors("invalid") if path.stem not in BESIDE]
REFUSED += [path for path in vectors("uncommon") if path.stem == "model-missing"]


@pytest.mark.parametrize("path", REFUSED, ids=vector_name)
def test_invalid_vectors(path: Path) -> None:
    """Both decoders refuse them, and those without their model."""
    with mcz.open(path) as file:
        case = stored(file, file.only_clip())
        assert case.plain() is None
        assert case.fast() is None


@pytest.mark.real
@pytest.mark.parametrize("settings", [{}, {"preset": "hou2016"}], ids=str)
@pytest.mark.parametrize("codec", FAMILY)
@pytest.mark.parametrize("name", REAL_CLIPS)
def test_real_clip(name: str, codec: str, settings: dict[str, Any], data: Path) -> None:
    target = io.BytesIO()
    mcz.write(mcz.read(data / name), target, codec=codec, **settings)
    check_file(target.getvalue())


@pytest.mark.parametrize("name", FAMILY)
def test_other_layouts(name: str) -> None:
    """Two groups, two resolutions, two rows a frame."""
    case = encoded(name, smooth(20))
    doubled = tuple(replace(s, streams=s.streams * 2) for s in case.segments)
    groups = tuple(range(5)), tuple(range(5, 10))
    for change in ({"groups": groups}, {"n_resolutions": 2}):
        other = replace(case, layout=replace(case.layout, **change), segments=doubled)
        assert other.plain() is None
        assert other.fast() is None
    halved = replace(case.layout, groups=(tuple(range(5)),))
    assert replace(case, layout=halved).plain() is None
    assert replace(case, layout=halved).fast() is None
    assert replace(case, layout=replace(case.layout, samples_per_frame=2)).fast() is None


# What they never would


class InventedKinds(plain_lsdt.Kinds):
    """Those of random decisions, with lengths of at most ``longest``."""

    def __init__(self, longest: int, model: plain_wavelets.Model) -> None:
        super().__init__(model)
        self.lengths = Bounded(self.lengths, 0, longest)
        self.firsts = Bounded(self.firsts, -(2**40), 2**40)
        self.others = Bounded(self.others, -(2**40), 2**40)


class Invention:
    """A signal with any legal header, and streams of random decisions."""

    def __init__(self, name: str, seed: int, *, prefix: bool) -> None:
        self.name, self.chance, self.prefix = name, random.Random(seed), prefix
        self.models: list[Model] = []
        chance = self.chance
        self.n_matrices = chance.choice((1, 3))
        self.n_points = chance.randrange(1, 7)
        self.n_channels = self.n_matrices * self.n_points
        self.window = chance.randrange(1, 10)
        self.n_frequencies = chance.randrange(1, self.window + 1)
        self.gaps = invented_code(chance, list(range(16)))
        self.values = invented_code(chance, [0, 1, 5, 16, 17, 87])

    def space(self) -> bytes:
        chance = self.chance
        legal = 12 if self.name == "pca-rdo" else 0
        flags = chance.randrange(16) & (legal | 2) | (self.n_matrices == 3)
        basis = chance.randrange(2)
        sizes = []
        if basis:
            sizes += [
                (self.n_points, chance.randrange(1, self.n_points + 1))
                for _ in range(self.n_matrices)
            ]
        if flags & 8:
            sizes.append(
                (chance.randrange(self.n_frequencies, self.window + 1), self.n_frequencies)
            )
        if flags & 4:
            sizes.append((self.n_channels, 1))
        data = bytes([flags, basis])
        if sizes:
            self.models.append(invented_model(chance, sizes))
            data += id_of(self.models[0])
        data += struct.pack("<d", 2.0 ** chance.randrange(-20, 3) * chance.uniform(1, 2))
        if flags & 2:
            data += number(self.n_channels) + chance.randbytes(self.n_channels)
        return data

    def code(self) -> bytes:
        lists = (self.gaps, self.values) if self.prefix else ()
        return bytes([self.prefix]) + b"".join(bytes([len(own), *own]) for own in lists)

    def case(self, monkeypatch: pytest.MonkeyPatch) -> Case:
        header = self.space() + self.code()
        codec = by_name(self.name)
        is_frame = self.name == "lsdt-frame"
        if not is_frame:
            header = number(self.window) + number(self.n_frequencies) + header
        sizes = [self.chance.randrange(1, 12) for _ in range(3)]
        fresh = [True, *(self.chance.random() < 0.3 for _ in range(2))]
        layout = Layout(
            sum(sizes), (tuple(range(self.n_channels)),), find_model=model_finder(self.models)
        )
        case = Case(self.name, header, layout, ())
        arguments = header, self.n_channels, case.find
        with monkeypatch.context() as self.patch:
            if is_frame:
                streams = self.frames(plain_lsdt.parse_frames(*arguments), sizes, fresh)
            else:
                fields = plain_lsdt.parse_windows(codec.id, *arguments)
                streams, fresh = [self.windows(fields, n) for n in sizes], [True] * 3
        firsts = [sum(sizes[:i]) for i in range(3)]
        rows = zip(firsts, sizes, streams, fresh, strict=True)
        segments = tuple(Segment(first, n, (s,), fresh=fresh) for first, n, s, fresh in rows)
        return replace(case, segments=segments)

    def bound(self, longest: int) -> None:
        self.patch.setattr(plain_lsdt, "Kinds", partial(InventedKinds, longest))

    def frames(self, fields: Any, sizes: list[int], fresh: list[bool]) -> list[bytes]:
        streams = []
        self.bound(min(len(matrix.vectors) for matrix in fields.space.matrices))
        state = plain_lsdt.State(fields)
        for n, starts in zip(sizes, fresh, strict=True):
            state = plain_lsdt.State(fields) if starts else state
            coder, written = Inventor(self.chance), Written()
            state.model.coder = coder
            for f in range(n):
                if self.prefix:
                    for matrix in fields.space.matrices:
                        written.sparse(self.chance, len(matrix.vectors), self.gaps, self.values)
                else:
                    state.adaptive_frame(starts and f == 0)
            streams.append(written.data() if self.prefix else coder.data())
        return streams

    def windows(self, fields: Any, n_frames: int) -> bytes:
        data = b""
        counts = [len(matrix.vectors) for matrix in fields.space.matrices]
        for first in range(0, n_frames, self.window):
            n = min(self.n_frequencies, n_frames - first)
            coder, written = Inventor(self.chance), Written()
            if self.prefix:
                for _ in range(sum(counts)):
                    written.sparse(self.chance, n, self.gaps, self.values)
                own = written.data()
            else:
                self.bound(n)
                plain_lsdt.adaptive_window(counts, n, coder)
                own = coder.data()
            data += number(len(own)) + own
        return data


@pytest.mark.parametrize("name", FAMILY)
@pytest.mark.parametrize("prefix", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_invented(name: str, prefix: bool, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    case = Invention(name, seed, prefix=prefix).case(monkeypatch)
    case.check()
    case.check_changes(30, seed)


def one_channel(name: str, code: list[list[int]], data: bytes) -> Case:
    """One frame of one channel, in prefix codes of these lengths."""
    header = bytes([0, 0]) + struct.pack("<d", 1.0) + b"\1"
    header += b"".join(number(len(lengths)) + bytes(lengths) for lengths in code)
    if name != "lsdt-frame":
        header, data = b"\1\1" + header, number(len(data)) + data
    layout = Layout(1, ((0,),), find_model=model_finder(()))
    return Case(name, header, layout, (Segment(0, 1, (data,)),))


CODES: tuple[tuple[list[int], bool], ...] = (
    ([], True),
    ([0, 0, 0], True),
    ([1], True),
    ([0, 0, 1, 0, 0], True),
    ([1, 1], True),
    ([1, 0, 2, 2, 0], True),
    ([*range(1, 16), 15], True),
    ([0] * 88 + [1, 1], True),
    ([0] * 90, True),
    ([0] * 91, False),
    ([1] + [0] * 90, False),
    ([2], False),
    ([1, 2], False),
    ([1, 1, 1], False),
    ([16, 1], False),
    ([*range(1, 17), 16], False),
    ([255], False),
)


@pytest.mark.parametrize("name", FAMILY)
@pytest.mark.parametrize(("lengths", "legal"), CODES, ids=str)
def test_codes(name: str, lengths: list[int], legal: bool) -> None:
    """A legal code decodes a zero; what else it decodes both decode alike."""
    for code in ([lengths, [1, 1]], [[1, 1], lengths], [lengths, lengths]):
        assert (one_channel(name, code, b"\0").plain() is not None) == legal
        for data in [b"", b"\0\0", b"\x80\0\0", *(bytes([byte]) for byte in range(0, 256, 8))]:
            case = one_channel(name, code, data)
            assert case.plain() == case.fast()


def of_model(name: str, model: bytes, sizes: tuple[int, int], *, flags: int = 0) -> Case:
    """One frame of 0 of so many channels, in a model's basis of so many vectors in all."""
    n_channels, n_rows = sizes
    models = [Model(1, model)]
    header = bytes([flags, 1]) + id_of(models[0]) + struct.pack("<d", 1.0) + b"\1\0\0"
    n_bits = n_rows
    if name == "lsdt-frame":
        n_matrices = 3 if flags else 1
        n_bits = n_matrices * (n_rows // n_matrices).bit_length()
    data = bytes((n_bits + 7) // 8)
    if name != "lsdt-frame":
        header, data = b"\1\1" + header, number(len(data)) + data
    layout = Layout(1, (tuple(range(n_channels)),), find_model=model_finder(models))
    return Case(name, header, layout, (Segment(0, 1, (data,)),))


@pytest.mark.parametrize("name", FAMILY)
def test_models(name: str) -> None:
    """The limits of bases and of matrices."""
    chance = random.Random(1)
    widest = invented_model(chance, [(2048, 1)] * 3).data
    assert of_model(name, widest, (6144, 3), flags=1).plain() is not None
    of_model(name, widest, (6144, 3), flags=1).check()
    full = invented_model(chance, [(4, 4)]).data
    of_model(name, full, (4, 4)).check()
    bad = [
        b"",
        b"\0",
        full + b"\0",
        full[:12],
        number(2) + full[1:],
        number(17) + b"\1\1\0" * 17,
        b"\1\0\0",
        b"\1\4\0",
        b"\1\4\5" + bytes(5),
        b"\1\4\1" + bytes([41]),
        b"\1" + number(2049) + b"\1\0",
        b"\2" + 2 * (number(2048) + number(1025) + bytes(1025)),
    ]
    for model in bad:
        case = of_model(name, model, (4, 4))
        assert case.plain() is None
        assert case.fast() is None
    for n_channels in (3, 5):
        assert of_model(name, full, (n_channels, 4)).plain() is None
        assert of_model(name, full, (n_channels, 4)).fast() is None


@pytest.mark.parametrize("name", FAMILY)
def test_no_channels(name: str) -> None:
    """There is no group then, but there is a header; no basis has vectors of no entries."""
    model = invented_model(random.Random(1), [(1, 1)])
    step = struct.pack("<d", 1.0)
    layout = Layout(5, (), find_model=model_finder([model]))
    windows = b"" if name == "lsdt-frame" else b"\1\1"
    for head in (b"\0\0" + step, b"\1\0" + step, b"\2\0" + step + b"\0"):
        Case(name, windows + head + b"\0", layout, (Segment(0, 5, ()),)).check()
    for head in (b"\0\1" + id_of(model) + step, b"\0\0" + bytes(8), b""):
        case = Case(name, windows + head + b"\0", layout, (Segment(0, 5, ()),))
        assert case.plain() is None
        assert case.fast() is None


def with_courses(sizes: list[tuple[int, int]], flags: int = 12) -> Case:
    """One frame of pca-rdo of 4 channels, windows of 5 frames, 2 frequencies."""
    model = invented_model(random.Random(3), sizes)
    header = bytes([5, 2, flags, 1]) + id_of(model) + struct.pack("<d", 1.0) + b"\1\0\0"
    layout = Layout(5, (tuple(range(4)),), find_model=model_finder([model]))
    n_rows = sizes[0][1]
    data = bytes((2 * n_rows + 7) // 8)
    return Case("pca-rdo", header, layout, (Segment(0, 5, (number(len(data)) + data,)),))


def test_courses_and_mean() -> None:
    for sizes in ([(4, 3), (5, 2), (4, 1)], [(4, 1), (2, 2), (4, 1)]):
        with_courses(sizes).check()
    with_courses([(4, 3), (5, 2)], 8).check()
    with_courses([(4, 3), (4, 1)], 4).check()
    for sizes in (
        [(4, 3), (6, 2), (4, 1)],
        [(4, 3), (5, 1), (4, 1)],
        [(4, 3), (5, 3), (4, 1)],
        [(4, 3), (5, 2), (5, 1)],
        [(4, 3), (5, 2), (4, 2)],
        [(4, 3), (5, 2)],
        [(4, 3), (5, 2), (4, 1), (4, 1)],
        [(3, 3), (5, 2), (4, 1)],
    ):
        assert with_courses(sizes).plain() is None
        assert with_courses(sizes).fast() is None
