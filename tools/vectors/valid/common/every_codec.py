"""What every codec has: several clips, unknown chunks, packets, long clips, gaps, cuts.

One sample of each codec stands for it: joints without channels before and behind the only one that
has some, one group and one resolution, so that its segments of a frame can be packets of any kind.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mcz.codecs import by_name, raw
from mcz.codecs.contract import Codec, Encoded, Segment
from mcz.container import payloads
from mcz.container.chunks import ChunkFlag
from mcz.motion import Channel, Joint, Motion, Signal, Skeleton
from tools.vectors.build import (
    best_clips,
    curve_clips,
    fast_clips,
    online_clips,
    online_units,
    pca_clips,
    pose_clips,
    spatial_clips,
    wavelet_clips,
)
from tools.vectors.build.cuts import CUT_HEADING, cut, shown
from tools.vectors.build.edits import Made, both, put
from tools.vectors.build.files import Crafter, Whole, file_of, finished, heading_of, partial
from tools.vectors.build.lossless_clips import codec_of
from tools.vectors.build.motions import HUNDREDTHS, dance, numbers
from tools.vectors.build.pca_clips import Part, part_of
from tools.vectors.build.spatial_clips import CLIP, FRAME, MDTT, PCA_RDO

NAMES = tuple(
    "raw lossless mrdwt qbc pca dwt awt lsdt-frame lsdt-clip mdtt pca-rdo online "
    "best posewave fast".split()
)
WAVES = ("mrdwt", "dwt", "awt")
WINDOWS = (CLIP, MDTT, PCA_RDO)
LONG = 66_000  # frames, more than 65,535
FRAMES = 7  # of a sample
OPENED = both(put(payloads.Clip, "flags", b"\1"), put(payloads.Clip, "n_frames", b"\0"))


def add(shelf: Whole, name: str) -> None:
    """Add what the codec ``name`` has."""
    spec = heading_of(name)
    _clips(shelf, spec, name)
    _ancillary(shelf, spec, name)
    _packets(shelf, spec, name)
    _gaps(shelf, spec, name)
    _cuts(shelf, spec, name)
    _lengths(shelf, spec, name)


@dataclass(frozen=True, slots=True)
class Sample:
    """A clip and the codec that has its content; ``segment_frames`` where the codec asks."""

    codec: Codec
    motion: Motion
    grouping: str
    segment_frames: int = 0

    def file(self, **edits: Any) -> bytes:
        given = {"codec": self.codec, "grouping": self.grouping}
        return file_of(self.motion, segment_frames=self.segment_frames, **given, **edits)

    def write(self, crafter: Crafter) -> None:
        crafter.clip(
            self.motion,
            codec=self.codec,
            grouping=self.grouping,
            segment_frames=self.segment_frames,
        )


# Samples


_OF_ORDINALS: dict[str, Callable[[], Codec]] = {
    "raw": lambda: raw.CODEC,
    "lossless": codec_of,
    "fast": fast_clips.codec_of,
    "best": best_clips.codec_of,
}


def sample(name: str, segments: Sequence[int], seed: int = 0) -> Sample:
    """A clip of ``name`` in segments of so many frames, all alike but the last."""
    n_frames = sum(segments)
    if name in _OF_ORDINALS:
        values = numbers(n_frames + seed, 3)[seed:]
        motion = Motion(_bones(3), (Signal(values, (HUNDREDTHS,) * 3),), name="common")
        return Sample(_OF_ORDINALS[name](), motion, "all", max(segments, default=0))
    return _boned(
        _WITH[name](segments, seed) if name in _WITH else _with_space(name, segments, seed)
    )


def _bones(n_channels: int) -> Skeleton:
    names = tuple(Channel("", f"needle {c}") for c in range(n_channels))
    joints = (Joint("rock"), Joint("dial", 0, channels=names), Joint("stone", 1))
    return Skeleton(joints, name=f"bones of {n_channels}")


def _ends(segments: Sequence[int]) -> tuple[int, ...]:
    return tuple(np.cumsum(segments).tolist()[:-1])


def _waves(name: str) -> Callable[[Sequence[int], int], Sample]:
    def make(segments: Sequence[int], seed: int) -> Sample:
        levels = 0 if max(segments, default=0) < 4 else 2
        plan = wavelet_clips.Plan(
            sum(segments), wavelet_clips.DB2, levels, ends=_ends(segments), n_resolutions=1, least=2
        )
        return _waved(name, plan, wavelet_clips.waves(plan, 1 + seed)[seed:])

    return make


def _waved(name: str, plan: wavelet_clips.Plan, made: Sequence[wavelet_clips.Wave]) -> Sample:
    encode = wavelet_clips.codec_of(plan, made).encode
    changes: dict[str, Any] = {"encode": encode, "parameters": raw.CODEC.parameters}
    codec = replace(by_name(name), **changes, dial=None)
    return Sample(codec, wavelet_clips.motion_of(plan, made), "channel")


def _curved(segments: Sequence[int], seed: int) -> Sample:
    delta = max(segments, default=1)
    plan = curve_clips.Plan(sum(segments), delta, ends=_ends(segments), n_resolutions=1)
    made = curve_clips.paths(plan, (3,) * (1 + seed))[seed:]
    return Sample(curve_clips.codec_of(plan, made), curve_clips.motion_of(plan, made), "all")


def _components(segments: Sequence[int], seed: int) -> Sample:
    parts = tuple(part_of(n, 3, min(2, n), 5 * seed + i) for i, n in enumerate(segments))
    plan = pca_clips.Plan(parts)
    return Sample(pca_clips.codec_of(plan), pca_clips.motion_of(plan), "all")


def _with_space(name: str, segments: Sequence[int], seed: int) -> Sample:
    bases = (spatial_clips.basis_of(3, 2, seed),)
    fresh = tuple(i % 3 == 0 for i in range(len(segments))) if name == FRAME else ()
    plan = spatial_clips.Plan(
        name, 3, tuple(segments), fresh, window=4, bases=bases, step=0.5 + seed
    )
    if name == PCA_RDO:
        courses, mean = spatial_clips.basis_of(4, 4, 2), spatial_clips.basis_of(3, 1, 4)
        plan = replace(plan, courses=courses, mean=mean)
    return Sample(spatial_clips.codec_of(plan), spatial_clips.motion_of(plan), "all")


def _online(segments: Sequence[int], seed: int) -> Sample:
    units = tuple(f"{'ISSLS'[i % 5]}{n}" for i, n in enumerate(segments))
    plan = online_units.Plan(units, 3, bases=(spatial_clips.basis_of(3, 2, seed),), coder=seed % 2)
    return Sample(online_clips.codec_of(plan), online_clips.motion_of(plan), "all")


def _posed(segments: Sequence[int], seed: int) -> Sample:
    skeleton = _bones(3)
    source = pose_clips.waves(sum(segments), skeleton, 4.0, seed)
    fields = {"levels": 0, "step": 0.25 + seed}
    plan = pose_clips.Plan(skeleton, source, fields, ends=_ends(segments))
    return Sample(pose_clips.codec_of(plan), pose_clips.motion_of(plan), "all")


_WITH: dict[str, Callable[[Sequence[int], int], Sample]] = {
    **{name: _waves(name) for name in WAVES},
    "qbc": _curved,
    "pca": _components,
    "online": _online,
    "posewave": _posed,
}


# What holds of all


def _clips(shelf: Whole, spec: str, name: str) -> None:
    """Two clips of the codec and one of raw, under three skeletons."""
    first, second = sample(name, (4, 4, 3)), sample(name, (4, 1), 1)
    other = replace(second.motion.skeleton, name="the other one")
    second = replace(second, motion=replace(second.motion, name="second", skeleton=other))
    crafter = Crafter()
    first.write(crafter)
    crafter.clip(dance(3))
    second.write(crafter)
    motions = first.motion, dance(3), second.motion
    parts = (partial(second.motion, (1, 4)), partial(first.motion, (3, 5), (1,)))
    purpose = "Two clips of the codec and one of raw, each with a skeleton of its own."
    shelf.hold("clips", f"{spec}; Grammar", purpose, finished(crafter), *motions, parts=parts)
    first, second = sample(name, (4, 4, 3)), sample(name, (4, 1), 1)
    second = replace(second, motion=replace(second.motion, name="second"))
    crafter = Crafter()
    first.write(crafter)
    data = finished(crafter)
    second.write(crafter)
    data = finished(crafter)
    motions = first.motion, second.motion
    purpose = "A clip of the codec, and behind FOOT a second one of the same skeleton."
    shelf.hold("appended", f"{spec}; Grammar; FOOT", purpose, data, *motions)


def _ancillary(shelf: Whole, spec: str, name: str) -> None:
    made = sample(name, (4, 3))

    def within(segments: Made) -> Made:
        crafter.plain_chunk(b"note", b"between CLIP and DATA", ChunkFlag.ANCILLARY)
        return segments

    crafter = Crafter(segments=within, CEND_frame=_behind_note)
    crafter.ancillary(b"xtra", b"before any clip")
    made.write(crafter)
    crafter.ancillary(b"zvol", b"", safe_to_copy=False)
    data = finished(crafter, index=False)
    purpose = "Unknown ancillary chunks before, in and behind a clip; no INDX."
    shelf.hold("ancillary", f"{spec}; Chunks; Grammar", purpose, data, made.motion)


def _behind_note(chunk: bytes) -> bytes:
    crafter = Crafter()
    start = len(crafter.data)
    crafter.plain_chunk(b"note", b"between DATA and CEND", ChunkFlag.ANCILLARY)
    return crafter.data[start:] + chunk


def _packets(shelf: Whole, spec: str, name: str) -> None:
    spec = f"{spec}; Open DATA and packets"
    made = sample(name, (4, 4, 3))
    parts = (partial(made.motion, (3, 6)),)
    purpose = "Segments as packets of kind 1 of one open DATA."
    data = made.file(packets=True)
    shelf.hold("packets-segments", f"{spec}; INDX", purpose, data, made.motion, parts=parts)
    made = sample(name, (1,) * FRAMES)
    parts = (partial(made.motion, (2, 5)),)
    live: dict[str, Any] = {"packets": True, "frames": 1}
    purpose = "Segments of one frame as packets of kind 2, but for the first."
    data = made.file(**live)
    shelf.hold("packets-frames", f"{spec}; INDX", purpose, data, made.motion, parts=parts)
    repeat = {"anew": name in (FRAME, "online"), "repeat": range(9)}
    data = made.file(**live, **repeat, CLIP=OPENED, index=False)
    purpose = "Packets of kind 2 behind a REPT, of a clip that did not know its frames; no INDX."
    shelf.hold("packets-numbered", f"{spec}; REPT; CEND", purpose, data, made.motion, parts=parts)


def _gaps(shelf: Whole, spec: str, name: str) -> None:
    """Markers with gaps, across segments, as packets and not."""
    made = sample(name, (4, 4, 3))
    n_channels = made.motion.signals[0].values.shape[1]
    mask = np.ones((11, n_channels), np.bool_)
    mask[0, 0] = mask[3:6] = mask[10:] = False
    masked = replace(made.motion.signals[0], mask=mask)
    motion = replace(made.motion, signals=(masked,))
    parts = (partial(motion, (2, 7)), partial(motion, (6, 9), (1,)))
    purpose = "Gaps at the start, across segments and at the end."
    data = replace(made, motion=motion).file()
    shelf.hold("masked", f"{spec}; Masks", purpose, data, motion, parts=parts)


def _cuts(shelf: Whole, spec: str, name: str) -> None:
    made = sample(name, (4, 4, 3))
    data = cut(made.file(), frames=(5, 10))
    motion = shown(made.motion, 5, 10)
    purpose = "Frames 5 to 9 of 11, cut out with the segments that bear upon them."
    parts = (partial(motion, (1, 3)),)
    shelf.hold("cut-common", f"{spec}; {CUT_HEADING}", purpose, data, motion, parts=parts)


def _lengths(shelf: Whole, spec: str, name: str) -> None:
    """Clips of 1 and 2 frames and no channel, where the codec has none; long ones."""
    taken = {"lossless", "fast", "best", "mrdwt", "qbc", FRAME, CLIP, "online"}
    for n_frames in (1, 2) if name not in taken | {"pca", MDTT, PCA_RDO} else ():
        made = sample(name, (n_frames,))
        purpose = f"A clip of {n_frames} frames, of 0-channel joints and one that has some."
        shelf.hold(f"frames-{n_frames}", spec, purpose, made.file(), made.motion)
    if name not in taken | {"raw"}:
        codec = _nothing(name)
        still = Motion(Skeleton((Joint("rock"),)), (Signal(np.zeros((7, 0))),), name="still")
        grouping = "channel" if name in WAVES else "all"
        data = file_of(still, codec=codec, grouping=grouping)
        shelf.hold("no-channels", spec, "A clip of 7 frames without a channel.", data, still)
    long = _long(name)
    if long is not None:
        purpose = f"A clip of {LONG:,} frames, constant."
        parts = (partial(long.motion, (65_530, 65_541)),)
        shelf.hold("long", f"{spec}; DATA", purpose, long.file(), long.motion, parts=parts)


def _nothing(name: str) -> Codec:
    """A codec of seven frames without a channel."""
    if name in WAVES:
        return _waved(name, wavelet_clips.Plan(7, wavelet_clips.DB2), ()).codec
    if name == "posewave":
        still = Skeleton((Joint("rock"),))
        return pose_clips.codec_of(pose_clips.Plan(still, np.zeros((7, 0))))
    if name == "pca":
        encoded = Encoded(bytes((2,)), iter([Segment(0, 7, ())]))
        return replace(_components((7,), 0).codec, encode=lambda source, params: encoded)
    return spatial_clips.codec_of(spatial_clips.Plan(name, 0, (7,)))


def _long(name: str) -> Sample | None:
    """A constant clip of more frames than a u16 counts, where the codec has none elsewhere."""
    if name == "raw":
        values = np.full((LONG, 1), -2.5)
        motion = Motion(_bones(1), (Signal(values, (HUNDREDTHS,)),), name="common")
        return Sample(raw.CODEC, motion, "all", LONG)
    if name in ("dwt", "awt"):
        plan = wavelet_clips.Plan(LONG, wavelet_clips.HAAR, 4, n_resolutions=1)
        head = wavelet_clips.Head(halves=63, predictor=0)
        made = [wavelet_clips.zeros(plan, a=[-1000] * plan.lengths[-1], heads=(head,))]
        return _boned(_waved(name, plan, made))
    if name == "pca":
        parts = Part((70, -5), n_frames=LONG)
        plan_ = pca_clips.Plan((parts,))
        codec, motion = pca_clips.codec_of(plan_), pca_clips.motion_of(plan_)
        return _boned(Sample(codec, motion, "all"))
    if name == FRAME:
        frames = spatial_clips.Plan(name, 1, (LONG,), fill=_once)
        return _boned(
            Sample(spatial_clips.codec_of(frames), spatial_clips.motion_of(frames), "all")
        )
    if name in WINDOWS:
        windows = spatial_clips.Plan(name, 1, (LONG,), window=250, frequencies=1, fill=_level)
        return _boned(
            Sample(spatial_clips.codec_of(windows), spatial_clips.motion_of(windows), "all")
        )
    return None


def _boned(made: Sample) -> Sample:
    n_channels = made.motion.signals[0].values.shape[1]
    motion = replace(made.motion, skeleton=_bones(n_channels), name="common")
    return replace(made, motion=motion)


def _once(number: int, n_rows: int, n: int) -> spatial_clips.Ints:
    """A coefficient in the first frame alone."""
    table = np.zeros((n_rows, n), np.int64)
    table[0] = 9
    return table


def _level(number: int, n_rows: int, n: int) -> spatial_clips.Ints:
    """The same first coefficient in every window."""
    table = np.zeros((n_rows, n), np.int64)
    table[:, 0] = -40
    return table


def no_channels(shelf: Whole, name: str) -> None:
    """A codec of ordinals without a channel."""
    still = Motion(spatial_clips.markers(0), (Signal(numbers(7, 0)),), name="still")
    own = by_name(name)
    data = file_of(still, codec=own)
    heading = heading_of(name)
    shelf.hold("no-channels", heading, "A clip of 7 frames without a channel.", data, still)
