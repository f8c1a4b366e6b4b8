"""Source files of a motion that was made or changed in memory: which of them it still restores."""

from __future__ import annotations

import hashlib
from dataclasses import replace

from mcz.errors import MotionError
from mcz.formats import FORMATS
from mcz.motion import Motion, Signal, Skeleton
from mcz.reading.source_rates import stating_rate
from mcz.writing.signal_source import as_stored, settle


def with_true_sources(motion: Motion, *, lossless: bool) -> Motion:
    """``motion`` whose sources state the size and the hash of what it restores.

    Values may have been replaced since they were read: then the source is of no known file. A
    skeleton that is no longer that of its own file has none. Raises MotionError or FormatError
    where the source cannot hold the values.
    """
    motion = replace(motion, skeleton=_with_true_source(motion.skeleton)).counted_by_ones()
    source = motion.source
    if source is None:
        return motion
    if source.format not in FORMATS:
        raise MotionError(f"source format {source.format!r} is not one of {', '.join(FORMATS)}")
    if source.sha256 and _facts(_restored(motion, lossless)) == (source.size, source.sha256):
        return motion
    return with_source_hash(replace(motion, source=source.of_no_file()), lossless=lossless)


def _with_true_source(skeleton: Skeleton) -> Skeleton:
    source = skeleton.source
    if source is None:
        return skeleton
    try:
        data = FORMATS["asf"].write(skeleton) if source.format == "asf" else b""
    except MotionError:  # printed anew, and the format cannot say it
        data = b""
    known = (source.size, source.sha256) == _facts(data)
    return skeleton if data == source.template and known else replace(skeleton, source=None)


def with_source_hash(motion: Motion, *, lossless: bool) -> Motion:
    """``motion`` with size and hash of its source file, which was changed or cut since.

    Unless ``lossless``, its values may lie off their grids.
    """
    if motion.source is None or motion.source.sha256:
        return motion
    motion = stating_rate(motion)
    size, digest = _facts(_restored(motion, lossless))
    assert motion.source is not None
    return replace(motion, source=replace(motion.source, size=size, sha256=digest))


def _restored(motion: Motion, lossless: bool) -> bytes:
    """The source file of a motion, as a reader will restore it."""
    assert motion.source is not None
    stored = as_stored(motion)
    signals = tuple(_as_read(signal, lossless) for signal in stored.signals)
    data: bytes = FORMATS[motion.source.format].write(replace(stored, signals=signals))
    return data


def _as_read(signal: Signal, lossless: bool) -> Signal:
    """The signal as a reader will have it."""
    try:
        return settle(signal)[1]
    except MotionError:
        if lossless:
            raise
        return signal


def _facts(data: bytes) -> tuple[int, bytes]:
    return len(data), hashlib.sha256(data).digest()
