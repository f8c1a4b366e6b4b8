"""A clip decoded from its final bytes, before it ends. SPEC.md, "CEND", is normative."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Codec
from mcz.container import payloads
from mcz.container.directory import ClipRow
from mcz.container.limits import Profile
from mcz.container.reader import Container
from mcz.container.segments import SegmentHeader
from mcz.container.source import ByteSource, open_source
from mcz.container.value_hash import ValueDigest, canonical
from mcz.container.writer import Writer
from mcz.errors import ChecksumError
from mcz.motion import Motion, Signal
from mcz.reading.clip import Clip
from mcz.reading.signal_info import SignalInfo, read_signal
from mcz.reading.signal_reader import SignalReader
from mcz.types import Values
from mcz.writing.planning import SignalPlan

NO_HASH = bytes(32)


@dataclass(frozen=True, slots=True)
class Decoded:
    """A signal as a reader has it: of a lossless codec ``values`` are those that were given."""

    values: Values
    sha256: bytes


class ClipCopy:
    """CLIP and segments a second time, in memory, where they can be decoded.

    The file of the clip itself may be a pipe.
    """

    def __init__(self, profile: Profile) -> None:
        self._out = io.BytesIO()
        self.writer = Writer(self._out, profile=profile)

    def segment(self, header: SegmentHeader, streams: Sequence[bytes]) -> None:
        self.writer.segment(header, streams)

    def decoded(self, motion: Motion, coded: Sequence[SignalPlan]) -> list[Decoded]:
        """The signals; raises ChecksumError where a channel differs that may not."""
        self.writer.end_clip(motion.n_frames, NO_HASH, [NO_HASH] * len(motion.signals))
        directory, data = self.writer.directory, open_source(self._out.getvalue())
        container = Container(data, max_decoded=2**53, directory=directory)
        row = directory.clips[motion.name]
        record = container.clip(row)
        found = []
        for index, part in enumerate(coded):
            info = _info(container, row, record, motion, index, part.codec)
            found.append(_decoded(container, info, motion.signals[index], part.lossy_channels()))
        return found


@dataclass(frozen=True, slots=True)
class _CodedSignal(SignalInfo):
    """A signal whose codec need not be in the table."""

    own: Codec | None = None

    @property
    def codec(self) -> Codec:
        assert self.own is not None
        return self.own


def _info(
    container: Container,
    row: ClipRow,
    record: payloads.Clip,
    motion: Motion,
    index: int,
    codec: Codec,
) -> SignalInfo:
    info = read_signal(container, row, record, index, motion.skeleton, motion.frame_rate)
    held = {field.name: getattr(info, field.name) for field in fields(SignalInfo)}
    return _CodedSignal(**held, own=codec)


def _decoded(
    container: Container, info: SignalInfo, signal: Signal, free: NDArray[np.bool_]
) -> Decoded:
    groups = tuple(range(info.counts.n_groups))
    reader = SignalReader(container, info, groups, 0, signal.name)
    values = np.empty(signal.values.shape) if free.any() else signal.values
    digest, n_frames = ValueDigest(), info.layout.n_frames
    for block in reader.blocks(0, n_frames):
        rows = slice(*(edge * signal.samples_per_frame for edge in (block.start, block.stop)))
        kept = ~free if free.any() else slice(None)
        is_same = _is_same(signal.values[rows, kept], block.values[:, kept])
        mask = None if signal.mask is None else signal.mask[rows]
        if not is_same or not _is_same_mask(mask, block.mask):  # CEND-07
            raise ChecksumError(
                f"frames {block.start}:{block.stop}: codec {info.codec.name} decodes other values "
                "than it was given",
                where=f"signal {info.index}",
            )
        if free.any():
            values[rows] = block.values
        digest.update(block.values, block.mask)
    return Decoded(values, digest.digest())


def _is_same(given: Values, found: Values) -> bool:
    """Whether the bits are the same, those of NaN apart."""
    own, other = (np.ascontiguousarray(values).view(np.int64) for values in (given, found))
    if given.dtype == found.dtype and np.array_equal(own, other):
        return True
    return canonical(given) == canonical(found)


def _is_same_mask(given: NDArray[np.bool_] | None, found: NDArray[np.bool_] | None) -> bool:
    if given is None or found is None:
        return (given is None or bool(given.all())) and (found is None or bool(found.all()))
    return np.array_equal(given, found)


def check_values(stream: BinaryIO, names: Iterable[str]) -> None:
    """Decode clips of the file in ``stream`` and compare their hashes, before it gets its name."""
    stream.flush()
    container = Container(ByteSource(stream), max_decoded=2**53)
    for name in names:
        clip = Clip(container, container.directory.clips[name])
        for info in clip.signals:
            clip.check_values(info.index)
    stream.seek(0, os.SEEK_END)
