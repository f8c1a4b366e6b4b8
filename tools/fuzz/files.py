"""Properties of an .mcz file: however it is read, the same comes out, or an MczError."""

from __future__ import annotations

import io
import random
import zlib
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mcz
from mcz.container.scan import scan
from mcz.errors import FormatError, LimitError, MczError, OptionError, UnsupportedError
from mcz.files.reading.clip import Clip
from mcz.files.reading.faults import validate
from mcz.files.reading.file import File
from mcz.files.reading.post_filtering import FilteredClip
from mcz.files.reading.report import info
from mcz.files.reading.signal_reader import SignalReader
from mcz.model.clock import TIMES, times_fault
from tools.fuzz.guard import hold
from tools.fuzz.repair import without_hash_checks

DECODED = 2**19  # bytes that most inputs may decode to, so that there are many of them a second
MOST_FRAMES = 20_000  # of a live stream that are looked at
Arrays = tuple[NDArray[Any], NDArray[np.bool_] | None]


def check_file(data: bytes) -> bool:
    """All ways of reading: whole, in parts, salvaged, live, verified; some of them each time."""
    rng = random.Random(zlib.crc32(data))
    most = None if rng.random() < 0.03 else DECODED
    if rng.random() < 0.4:
        _tolerant(data, rng)
    try:
        found = _strict(data, most, rng)
    except MczError:
        if rng.random() < 0.5:
            _check_salvage(data, most, None)
        raise
    if rng.random() < 0.6:
        _check_salvage(data, most, found)
    if rng.random() < 0.6:
        _live(data, found)
    if rng.random() < 0.3:
        with mcz.open(data, max_decoded=most, verify=True) as file:
            info(file)
            faults = [found for found in validate(file) if found.heading != "RECV"]  # none needs it
            hold(not faults, f"what decodes has faults: {faults[:1]}")
    return True


def check_decoder(data: bytes) -> bool:
    """Whole and in parts, hashes not compared: streams that no encoder made decode, too."""
    rng = random.Random(zlib.crc32(data))
    most = None if rng.random() < 0.03 else DECODED
    with without_hash_checks():
        found = _strict(data, most, rng)
    if rng.random() < 0.1:
        _check_salvage(data, most, found)
    if rng.random() < 0.1:
        _tolerant(data, rng)
    return True


def _strict(data: bytes, most: int | None, rng: random.Random) -> dict[tuple[str, int], Arrays]:
    """The arrays of every signal of every clip; all else is read, too."""
    found: dict[tuple[str, int], Arrays] = {}
    with mcz.open(data, max_decoded=most, verify=True) as file:
        _ = file.header, file.skeletons
        for clip in file.clips.values():
            found |= _clip(clip, rng)
        for attachment in file.attachments.values():
            attachment.read()
        for id_, _skeleton in file.skeletons:
            if file.skeleton(id_, with_source=True).source is not None:
                file.skeleton_bytes(id_)
        scan(file.container.source, whole=True)
    return found


def _clip(clip: Clip, rng: random.Random) -> dict[tuple[str, int], Arrays]:
    found: dict[tuple[str, int], Arrays] = {}
    for signal in clip.signals:
        whole = _whole(clip, signal.index, 0)
        found[clip.name, signal.index] = whole
        _parts(clip, signal.index, 0, whole, rng)
        if signal.counts.n_resolutions > 1:
            resolution = rng.randrange(1, signal.counts.n_resolutions)
            coarse = _whole(clip, signal.index, resolution)
            _parts(clip, signal.index, resolution, coarse, rng)
        clip.check_hash(signal, *whole)
    _ = clip.frame_numbers, clip.quality, clip.frame_rate, clip.metadata, clip.base_skeleton
    if clip.source is not None:
        clip.source_bytes()
    if rng.random() < 0.2:
        _others(clip, rng)
    return found


def _whole(clip: Clip, signal: int, resolution: int) -> Arrays:
    """Values as from ``clip.read_masked``, without the comparison of hashes."""
    info = clip.signals[signal]
    groups = tuple(range(len(info.layout.groups)))
    reader = SignalReader(clip.container, info, groups, resolution, clip.name)
    values, mask = reader.read(info.skip, info.skip + clip.n_frames)
    if info.role == TIMES:
        fault = times_fault(np.where(True if mask is None else mask, values, np.nan)[:, 0])
        if fault:
            raise FormatError(f"no times: {fault}", clip=clip.name)
    return values, mask


def _parts(clip: Clip, signal: int, resolution: int, whole: Arrays, rng: random.Random) -> None:
    """A part is that part of the whole."""
    a, b = sorted((rng.randint(0, clip.n_frames), rng.randint(0, clip.n_frames)))
    info = clip.signals[signal]
    joints, columns = None, list(range(info.layout.n_channels))
    if info.channels is None and rng.random() < 0.7:
        n = len(clip.skeleton.joints)
        joints = rng.sample(range(n), rng.randint(0, min(n, 4)))
        columns = [c for joint in joints for c in clip.skeleton.columns(joint)]
    if (a, b) == (0, clip.n_frames) and joints is None:
        return
    try:
        part = clip.read_masked((a, b), joints, resolution, signal=signal)
    except MczError as error:
        hold(False, f"a part of what decodes is refused: {type(error).__name__} {error}")
        raise
    rows = slice(a * info.layout.samples_per_frame, b * info.layout.samples_per_frame)
    hold(_bits(part, rows, columns) == _bits(whole, rows, columns, cut=True), "a part differs")


def _bits(
    arrays: Arrays, rows: slice, columns: list[int], *, cut: bool = False
) -> tuple[tuple[int, ...], bytes, bytes]:
    values, mask = arrays
    valid = np.ones(values.shape, np.bool_) if mask is None else mask
    if cut:
        values, valid = values[rows][:, columns], valid[rows][:, columns]
    return values.shape, values.tobytes(), valid.tobytes()


def _others(clip: Clip, rng: random.Random) -> None:
    """Ask for things that a clip may refuse."""
    with suppress(OptionError, LimitError):
        clip.preview()
    with suppress(MczError):
        filtered = FilteredClip(clip)
        whole = filtered.read_masked()
        a, b = sorted((rng.randint(0, clip.n_frames), rng.randint(0, clip.n_frames)))
        part = filtered.read_masked((a, b))
        per_frame = clip.signals[0].layout.samples_per_frame
        rows, columns = slice(a * per_frame, b * per_frame), list(range(clip.n_channels))
        hold(_bits(part, rows, columns) == _bits(whole, rows, columns, cut=True), "filtered part")


def _check_salvage(
    data: bytes, most: int | None, strict: dict[tuple[str, int], Arrays] | None
) -> None:
    """Salvage gives what a strict reader gives, where that gives something."""
    try:
        found = _salvage(data, most)
    except MczError:
        hold(strict is None, "what decodes cannot be salvaged")
        return
    if strict is None:
        return
    for key, arrays in strict.items():
        every = slice(None), list(range(arrays[0].shape[1]))
        hold(key in found, "salvage does not find a clip")
        hold(_bits(found[key], *every) == _bits(arrays, *every), "salvaged, values differ")


def _salvage(data: bytes, most: int | None) -> dict[tuple[str, int], Arrays]:
    found: dict[tuple[str, int], Arrays] = {}
    with mcz.open(data, salvage=True, max_decoded=most) as file:
        for clip in file.clips.values():
            try:
                for signal in clip.signals:
                    found[clip.name, signal.index] = clip.read_masked(signal=signal.index)
                if clip.source is not None:
                    clip.source_bytes()
            except MczError:
                continue
        _rest(file)
    return found


def _rest(file: File) -> None:
    for attachment in file.attachments.values():
        try:
            attachment.read()
        except MczError:
            continue
    for id_, _ in file.skeletons:
        try:
            file.skeleton_bytes(id_)
        except MczError:
            continue


def _live(data: bytes, strict: dict[tuple[str, int], Arrays]) -> None:
    """The frames of a stream are the rows of the clips, in order."""
    rows = _rows(strict)
    try:
        for _number, values, valid in mcz.live_frames(io.BytesIO(data)):
            for row, known in zip(np.atleast_2d(values), np.atleast_2d(valid), strict=True):
                expected, mask = next(rows, (None, None))
                hold(expected is not None, "a live frame too many")
                hold(np.array_equal(known, mask), "a live frame has another mask")
                same = np.array_equal(row[known], expected[known], equal_nan=True)
                hold(same, "a live frame differs")
    except (LimitError, UnsupportedError):  # a clip that can only be read as a whole
        return
    except MczError as error:
        hold(hides_frames(data), f"what decodes cannot be followed: {type(error).__name__} {error}")
        return
    hold(next(rows, None) is None, "a live frame too few")


def hides_frames(data: bytes) -> bool:
    """True if a clip has stored frames outside its window, whose streams need no decoding."""
    try:
        with mcz.open(data) as file:
            return any(s.skip or s.spare for clip in file.clips.values() for s in clip.signals)
    except MczError:
        return False


def _rows(strict: dict[tuple[str, int], Arrays]) -> Iterator[Any]:
    for (_, signal), (values, mask) in strict.items():
        if signal == 0:
            valid = np.ones(values.shape, np.bool_) if mask is None else mask
            yield from zip(values, valid, strict=True)


def _tolerant(data: bytes, rng: random.Random) -> None:
    """A reader that survives losses: what it gives, it gives in any pieces."""
    lost: Any = rng.choice(("missing", "hold", "linear", "refuse"))
    join = rng.random() < 0.5
    found = [
        _stream_frames(data, size, lost, join) for size in (len(data) + 1, len(data) // 32 + 7)
    ]
    hold(found[0] == found[1], "a stream in pieces differs")


def _stream_frames(data: bytes, size: int, lost: Any, join: bool) -> list[Any]:
    pieces = [data[at : at + size] for at in range(0, len(data), size)]
    found: list[Any] = []
    try:
        frames = mcz.stream_decode(pieces, lost=lost, join=join)
        some = islice(frames, MOST_FRAMES)
        found.extend((frame.number, frame.values.tobytes(), frame.state) for frame in some)
    except MczError as error:
        found.append(type(error))
    return found
