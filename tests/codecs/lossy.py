"""Clips, and a codec without a container, for the tests of lossy codecs."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

import mcz
from mcz.codecs import codec_by_name
from mcz.codecs.contract import Encoded, Layout, Request, Segment, Span, model_finder
from mcz.files.reading.sizes import clip_sizes
from mcz.files.writing.signal_source import MemorySource
from mcz.model.motion import POSITION_KINDS, Channel, Joint, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind
from tests.motions import smooth

Array = np.ndarray


def bones(kinds: list[str], angle_unit: str = "deg") -> Skeleton:
    """A chain of joints of one channel each."""
    joints = tuple(
        Joint(f"j{i}", i - 1, (0.0, 2.0, 0.5) if i else (0.0, 0.0, 0.0), channels=(Channel(kind),))
        for i, kind in enumerate(kinds)
    )
    return Skeleton(joints, unit_cm=2.0, angle_unit=angle_unit)


def clip_of(values: Array, kinds: list[str] | None = None, angle_unit: str = "deg") -> Motion:
    values = np.asarray(values, np.float64)
    skeleton = bones(kinds or ["rx"] * values.shape[1], angle_unit)
    return Motion(skeleton, (Signal(values),), frame_rate=Fraction(60), name="clip")


def random_walks(n_frames: int, kinds: list[str], seed: int = 0) -> Motion:
    """Random walks, the rotations wrapped to -180 to 180 as files have them."""
    random = np.random.default_rng(seed)
    steps = random.normal(0, 4, (n_frames, len(kinds)))
    values = np.cumsum(steps, axis=0) + random.normal(0, 100, len(kinds))
    turns = np.array([kind[0] == "r" for kind in kinds])
    return clip_of(np.where(turns, (values + 180) % 360 - 180, values), kinds)


def markers_with_gaps(n_frames: int = 100) -> Motion:
    """Two markers of which the second is away at both ends and twice between."""
    joints = tuple(
        Joint(name, channels=tuple(map(Channel, POSITION_KINDS))) for name in ("LASI", "RASI")
    )
    values = 100 + np.cumsum(np.random.default_rng(1).normal(0, 2, (n_frames, 6)), axis=0)
    mask = np.ones(values.shape, bool)
    for start, stop in ((0, 5), (30, 31), (44, 61), (97, n_frames)):
        mask[start:stop, 3:] = False
    values = np.where(mask, values, np.nan)
    values[50, 4] = 1e300  # what lies beneath a mask is not coded
    return Motion(Skeleton(joints, unit_cm=0.1), (Signal(values, mask=mask),), name="markers")


def markers(n_frames: int, n_markers: int = 4, seed: int = 0, unit_cm: float = 0.1) -> Motion:
    """Markers that walk about together, each with a walk of its own."""
    random = np.random.default_rng(seed)
    shared = np.cumsum(random.normal(0, 3, (n_frames, 1, 3)), axis=0)
    own = np.cumsum(random.normal(0, 0.5, (n_frames, n_markers, 3)), axis=0)
    places = shared + own + random.normal(0, 200, (n_markers, 3))
    joints = tuple(
        Joint(f"M{i}", channels=tuple(map(Channel, POSITION_KINDS))) for i in range(n_markers)
    )
    signal = Signal(places.reshape(n_frames, 3 * n_markers))
    skeleton = Skeleton(joints, unit_cm=unit_cm)
    return Motion(skeleton, (signal,), frame_rate=Fraction(120), name="markers")


def rough(n_frames: int, seed: int) -> Motion:
    """Noise, spikes, steps, turns, constants and gaps beside the sines."""
    generator = np.random.default_rng(seed)
    motion = smooth(n_frames)
    values = np.array(motion.signals[0].values)
    values[:, 0] = generator.normal(size=n_frames) * 1e4
    values[:, 1] += (generator.random(n_frames) < 0.05) * 1e6
    values[:, 2] = np.cumsum(generator.integers(-9, 10, n_frames))
    values[:, 3] = (np.arange(n_frames) * 17.0 + 180) % 360 - 180
    values[:, 4] = 12.5
    values[:, 5] = -0.0
    mask = generator.random(values.shape) < np.linspace(0, 2, 10)
    grids = (Grid(GridKind.BINARY64),) * 10
    return replace(motion, signals=(Signal(np.where(mask, values, np.nan), grids, mask=mask),))


def encode_file(codec: str, motion: Motion, **params: object) -> bytes:
    out = io.BytesIO()
    mcz.write(motion, out, codec=codec, **params)
    return out.getvalue()


def encode_and_decode(codec: str, motion: Motion, **params: object) -> Array:
    with mcz.open(encode_file(codec, motion, **params), max_decoded=2**40) as file:
        return file.only_clip().read()


def bytes_of(data: bytes) -> int:
    """Payload and overhead."""
    with mcz.open(data) as file:
        sizes = clip_sizes(file.container, file.only_clip())
    return sizes.payload + sizes.overhead


def amc(data: Path, name: str) -> Motion:
    subject = name.split("_", maxsplit=1)[0]
    return mcz.read(data / f"cmu/amc/{name}.amc", skeleton=data / f"cmu/asf/{subject}.asf")


class Direct:
    """A clip coded and decoded by the codec alone."""

    def __init__(
        self, codec: str, motion: Motion, *, segment_bytes: int = 2**26, **params: object
    ) -> None:
        self.codec, self.motion, self.params = codec_by_name(codec), motion, params
        source = MemorySource(motion, 0, self.codec, segment_bytes)
        coded: Encoded = self.codec.encode(source, self.codec.options(params))
        self.header = coded.header
        self.segments: list[Segment] = list(coded.segments)
        self.models = coded.models, coded.known_models
        self.layout: Layout = replace(
            source.layout,
            n_resolutions=coded.n_resolutions,
            find_model=model_finder((*coded.models, *coded.known_models)),
        )
        self.spans = [Span(s.first, s.n_frames, s.lead, s.tail, s.fresh) for s in self.segments]

    def again(self, motion: Motion | None = None, **changes: Any) -> Direct:
        """The same by other parameters, of another clip, or with less memory for a segment."""
        return Direct(self.codec.name, motion or self.motion, **{**self.params, **changes})

    @property
    def n_bytes(self) -> int:
        return sum(len(stream) for segment in self.segments for stream in segment.streams)

    def stream(self, segment: int, resolution: int, group: int) -> bytes:
        return self.segments[segment].streams[resolution * len(self.layout.groups) + group]

    def places(self) -> list[tuple[int, int, int]]:
        """(segment, resolution, group) of every stream."""
        counts = len(self.segments), self.layout.n_resolutions, len(self.layout.groups)
        return [tuple(map(int, place)) for place in np.ndindex(counts)]  # type: ignore[misc]

    def read(
        self,
        start: int = 0,
        stop: int | None = None,
        groups: tuple[int, ...] | None = None,
        resolution: int = 0,
        changes: Mapping[str, Any] | None = None,
    ) -> Array:
        if groups is None:
            groups = tuple(range(len(self.layout.groups)))
        request = Request(start, self.layout.n_frames if stop is None else stop, groups, resolution)
        given = {
            "header": self.header,
            "layout": self.layout,
            "spans": self.spans,
            "fetch": self.stream,
        } | dict(changes or {})
        found = self.codec.decode(
            given["header"], given["layout"], given["spans"], request, given["fetch"]
        )
        n_columns = sum(len(self.layout.groups[group]) for group in groups)
        assert found.shape == (request.stop - request.start, n_columns)
        assert np.isfinite(found).all()
        return found

    def with_stream(self, place: tuple[int, int, int], data: bytes) -> dict[str, Any]:
        """The change of one stream."""
        return {"fetch": lambda *at: data if at == place else self.stream(*at)}
