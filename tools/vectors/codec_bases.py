"""Base files of faulty clips of codecs: zeros, whose streams and header the rows write."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from mcz.codecs import codec_by_name, raw
from mcz.codecs.contract import Encoded, Model, Segment
from mcz.model.motion import Channel, Exceptions, Joint, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind
from tools.vectors.build import motions, pose_clips
from tools.vectors.build.files import Crafter, file_of, finish_file

SKELETONS: dict[str, Callable[[], Skeleton]] = {
    "acclaim": pose_clips.acclaim,
    "biovision": pose_clips.biovision,
    "puppet": motions.puppet,
}
LEARNED = 1  # a kind of models: bases
RESOLUTIONS = {"qbc": 2}


def skeleton_of(shape: str) -> Skeleton:
    """A skeleton by name, by kinds, "tx ry; rz", or by so many plain channels of joints, "4; 2"."""
    if shape in SKELETONS:
        return SKELETONS[shape]()
    kinds = [joint.strip() for joint in shape.split(";")]
    if not kinds[0].isdigit():
        return pose_clips.chain(kinds)
    joints = (
        Joint(f"dial {j}", j - 1, channels=tuple(Channel("", f"n{c}") for c in range(int(size))))
        for j, size in enumerate(kinds)
    )
    return Skeleton(tuple(joints), name="dials")


def noted(codec: str, packets: bool = False) -> bytes:
    """96 frames of a group a channel, with masks, and with exceptions in two of the groups."""
    motion = motions.dance(96)
    signal = motion.signals[0]
    mask = np.ones(signal.values.shape, np.bool_)
    mask[3:5, 1] = mask[6:9, 5] = False
    values = signal.values.copy()
    values[12, [0, 4]] = 7.5
    exceptions = Exceptions(np.array([12, 12]), np.array([0, 4]), (b"7.500", b"7.5000"))
    noted = replace(signal, values=values, mask=mask, exceptions=exceptions)
    crafter = Crafter(packets=packets)
    levels = {"N": 2} if codec == "mrdwt" else {}
    motion = replace(motion, signals=(noted,))
    crafter.clip(motion, grouping="channel", codec=codec_by_name(codec), **levels)
    return finish_file(crafter)


def coded(
    codec: str,
    shape: str,
    n_frames: int,
    header: str = "",
    *,
    ends: tuple[int, ...] = (),
    grouping: str = "",
    resolutions: int = 0,
    grid: str = "BINARY64",
    digits: int = 0,
    model: str = "",
    **more: Any,
) -> bytes:
    """Zeros under a header in hex, in segments to these ends and the last, all streams empty.

    ``model``: the data of one that the header names. ``more`` are fields of ``Encoded``.
    """
    skeleton = skeleton_of(shape)
    n_channels, edges = skeleton.n_channels, (0, *ends, n_frames) if n_frames else ()
    resolutions = resolutions or RESOLUTIONS.get(codec, 1)
    models = (Model(LEARNED, bytes.fromhex(model)),) if model else ()
    dtype = np.int64 if grid == "INTEGER" else np.float64

    def encode(source: Any, _: Any) -> Encoded:
        streams = (b"",) * (len(source.layout.groups) * resolutions)
        made = (Segment(start, stop - start, streams) for start, stop in pairwise(edges))
        return Encoded(bytes.fromhex(header), made, resolutions, models, **more)

    plain = codec_by_name(codec)
    made = replace(
        plain,
        encode=encode,
        decode=lambda *_: np.zeros((n_frames, n_channels)),
        parameters=raw.CODEC.parameters,
        dial=None,
        promise=None,
    )
    grids = (Grid(GridKind[grid], digits),) * n_channels
    signal = Signal(np.zeros((n_frames, n_channels), dtype), grids)
    return file_of(
        Motion(skeleton, (signal,), name="wave"), codec=made, grouping=grouping or plain.grouping
    )
