"""What the tests of plain decoders share: a codec beside one that was written from SPEC.md alone.

Values are compared bit for bit, and what one decoder refuses the other has to refuse.
"""

from __future__ import annotations

import io
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import mcz
from mcz.codecs.base import Layout, Request, Span
from mcz.errors import FormatError
from mcz.files.signal_info import SignalInfo
from mcz.motion import Motion, Signal
from mcz.numbers import Grid, GridKind
from tests.motions import smooth

VECTORS = Path(__file__).parents[2] / "conformance" / "vectors"

Segments = list[tuple[int, int, list[bytes]]]  # first frame, frames, streams
# (header, layout, segments, resolution, stop) -> rows 0 to stop - 1
Plain = Callable[[bytes, Layout, Segments, int, int], list[list[float]]]


def clips_of(file: mcz.File, *codecs: str) -> list[mcz.Clip]:
    """The clips whose motion one of these codecs holds: a file may have others beside them."""
    own = [clip for clip in file.clips.values() if clip.signals[0].codec.name in codecs]
    assert own
    return own


@dataclass(frozen=True)
class Stored:
    """A signal as a file holds it, and the plain decoder for it."""

    info: SignalInfo
    segments: Segments
    decoder: Plain

    def plain(self, resolution: int = 0) -> np.ndarray:
        """What the plain decoder makes of the frames that the clip shows."""
        layout = self.info.layout
        stop = layout.n_frames - self.info.spare
        rows = self.decoder(self.info.header, layout, self.segments, resolution, stop)
        return np.array(rows, "<f8").reshape(stop, layout.n_channels)[self.info.skip :]

    def fast(self, resolution: int = 0) -> np.ndarray:
        """What the codec makes of these frames."""
        layout, info = self.info.layout, self.info
        n_groups = len(layout.groups)
        headers = [row.header for row in info.rows]
        return info.codec.decode(
            info.header,
            layout,
            [Span(h.first, h.n_frames, h.lead, h.tail, True) for h in headers],
            Request(0, layout.n_frames - info.spare, tuple(range(n_groups)), resolution),
            lambda segment, r, group: self.segments[segment][2][r * n_groups + group],
        )[info.skip :]

    def changed(self, chance: random.Random) -> Stored:
        """One change of the header or of a stream."""
        header = bytearray(self.info.header)
        segments = [(first, n, [bytearray(s) for s in own]) for first, n, own in self.segments]
        full = [s for _, _, own in segments for s in own if s]
        chosen = header if chance.random() < 0.15 else chance.choice(full)
        at = chance.randrange(len(chosen))
        match chance.randrange(6):
            case 0:
                del chosen[at:]
            case 1:
                chosen += bytes([chance.choice((0, 255))])
            case 2:
                chosen[:] = chance.choice(full)
            case 3:
                chosen[0] = chance.randrange(256)
            case _:
                chosen[at] ^= 1 << chance.randrange(8)
        info = replace(self.info, header=bytes(header))
        ended = [(first, n, [bytes(s) for s in own]) for first, n, own in segments]
        return Stored(info, ended, self.decoder)


class Twins:
    """A codec and the plain decoder beside it."""

    def __init__(self, codec: str, decoder: Plain) -> None:
        self.codec, self.decoder = codec, decoder

    def stored(self, file: Any, clip: Any) -> Stored:
        info = clip.signals[0]
        layout, segments = info.layout, []
        for row in info.rows:
            table, streams = file.container.streams(row, info.counts, None)
            places = [
                table.codec(r, g)
                for r in range(layout.n_resolutions)
                for g in range(len(layout.groups))
            ]
            own = [streams[i] for i in places]
            segments.append((row.header.first, row.header.n_frames, own))
        return Stored(info, segments, self.decoder)

    def written(self, motion: Motion, settings: dict[str, Any]) -> bytes:
        target = io.BytesIO()
        mcz.write(motion, target, codec=self.codec, **settings)
        return target.getvalue()

    def loaded(self, motion: Motion, settings: dict[str, Any]) -> Stored:
        with mcz.open(io.BytesIO(self.written(motion, settings))) as file:
            return self.stored(file, file.only_clip())

    def check(self, data: bytes) -> None:
        """Every resolution of each clip, bit for bit."""
        with mcz.open(io.BytesIO(data)) as file:
            for clip in clips_of(file, self.codec):
                signal = self.stored(file, clip)
                for resolution in range(signal.info.layout.n_resolutions):
                    values, _ = clip.read_masked(resolution=resolution)
                    assert signal.plain(resolution).tobytes() == values.astype("<f8").tobytes()

    def check_cut(self, settings: dict[str, Any], cut: dict[str, Any], folder: Path) -> None:
        """A cut of a clip of 150 frames."""
        source, target = folder / "all.mcz", folder / "cut.mcz"
        source.write_bytes(self.written(smooth(150), settings))
        mcz.extract(source, target, **cut)
        self.check(target.read_bytes())

    def check_refused(self, path: Path) -> None:
        """Both decoders refuse the streams of this file."""
        with mcz.open(path) as file:
            signal = self.stored(file, file.only_clip())
        assert outcome(signal.plain, 0) is None
        assert outcome(signal.fast, 0) is None

    def check_changes(self, signal: Stored, n_changes: int, seed: int) -> None:
        """Both decoders refuse what the other refuses, and otherwise give the same bits."""
        chance, refused = random.Random(seed), 0
        for _ in range(n_changes):
            other = signal.changed(chance)
            resolution = chance.randrange(signal.info.layout.n_resolutions)
            plain = outcome(other.plain, resolution)
            assert plain == outcome(other.fast, resolution)
            refused += plain is None
        assert 10 < refused < n_changes


def outcome(decode: Any, resolution: int) -> bytes | None:
    """The bytes of the values; None where they are refused."""
    try:
        values: np.ndarray = decode(resolution)
    except (ValueError, FormatError):
        return None
    return values.astype("<f8").tobytes()


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
