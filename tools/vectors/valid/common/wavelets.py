"""What dwt and awt have: streams of mrdwt under another preset."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from mcz.codecs import by_name, raw
from mcz.codecs.parameters import SCALED
from mcz.container import payloads
from mcz.motion import Signal
from mcz.transforms.wavelets import Wavelet
from tools.vectors.build import wavelet_clips
from tools.vectors.build.cuts import CUT_HEADING, cut
from tools.vectors.build.edits import put
from tools.vectors.build.files import Whole, file_of
from tools.vectors.build.motions import UNROUNDED
from tools.vectors.build.wavelet_clips import HEADING, as_codec

HALVES = Wavelet((0.5, 0.25, -0.75, 1.5), (1.25, -0.5, 0.5, -0.125))


def add(shelf: Whole, name: str) -> None:
    _plans(shelf, name)
    _waves(shelf, name)


def _plans(shelf: Whole, name: str) -> None:
    """Coefficients and resolutions."""
    codec = by_name(name)
    cases = (
        (
            "scaled",
            "Scaled coefficients in three segments.",
            wavelet_clips.Plan(
                45, wavelet_clips.BIOR, levels=2, decimals=SCALED, unit=0.01, ends=(16, 32)
            ),
        ),
        (
            "decimals",
            "Coefficients of 2 decimals.",
            wavelet_clips.Plan(45, wavelet_clips.DB2, levels=4, decimals=2),
        ),
    )
    for case, purpose, plan in cases:
        made = wavelet_clips.waves(plan)
        motion = wavelet_clips.motion_of(plan, made)
        encode = wavelet_clips.codec_of(plan, made).encode
        own = replace(codec, encode=encode, parameters=raw.CODEC.parameters, dial=None)
        data = file_of(motion, codec=own, grouping="channel")
        requests = [(0, (7, 30), None), (1, (0, 45), None)]
        parts = tuple(wavelet_clips.request(plan, made, motion, *request) for request in requests)
        shelf.hold(case, HEADING, purpose, data, motion, parts=parts)


def _waves(shelf: Whole, name: str) -> None:
    """Headers, streams and groups."""
    spec = f"{HEADING}; Wavelets"

    def hold(case: str, purpose: str, plan: wavelet_clips.Plan, n: int = 1, **edits: Any) -> None:
        made = wavelet_clips.waves(plan, n)
        motion = wavelet_clips.motion_of(plan, made)
        if "grids" in edits:
            signal = replace(motion.signals[0], grids=edits.pop("grids"))
            motion = replace(motion, signals=(signal,))
        requests = [(k, (1, plan.n_frames - 1), None) for k in range(min(2, plan.resolutions))]
        parts = tuple(wavelet_clips.request(plan, made, motion, *request) for request in requests)
        codec = as_codec(name, wavelet_clips.codec_of(plan, made))
        data = file_of(motion, codec=codec, grouping="channel", **edits)
        shelf.hold(case, spec, purpose, data, motion, parts=parts)

    for levels, wavelet in ((0, wavelet_clips.DB3), (16, wavelet_clips.HAAR)):
        plan = wavelet_clips.Plan(9, wavelet, levels)
        hold(f"levels-{levels}", f"{levels} levels of a clip of 9 frames.", plan)
    hold("inline", "Filters in the header, of four taps.", wavelet_clips.Plan(13, HALVES, 2))
    plan = wavelet_clips.Plan(
        30, wavelet_clips.BIOR, 3, SCALED, 2.0**-7, ends=(8, 24), n_resolutions=2
    )
    hold("resolutions-2", "2 resolutions of 3 levels: the finest details are not stored.", plan, 2)
    plan = wavelet_clips.Plan(12, wavelet_clips.DB2, 2)
    listed = put(payloads.Clip, "signals.0.groups", b"\3\3\1\1\1")
    purpose = "Groups by another name (listed), still one a channel."
    hold("groups-listed", purpose, plan, 3, CLIP=listed)
    purpose = "Values are not rounded to the grids, one of which is INTEGER."
    hold("grids", purpose, replace(plan, decimals=3), 3, grids=UNROUNDED)
    plan = wavelet_clips.Plan(20, wavelet_clips.DB2, 2, least=5)
    made = wavelet_clips.waves(plan, 2)
    motion = wavelet_clips.motion_of(plan, made)
    codec = as_codec(name, wavelet_clips.codec_of(plan, made))
    data = cut(file_of(motion, codec=codec, grouping="channel"), resolution=1)
    coarse = replace(motion, signals=(Signal(wavelet_clips.values_of(plan, made, 1)),))
    purpose = "The finest details cut out."
    shelf.hold("cut-resolution", f"{spec}; {CUT_HEADING}", purpose, data, coarse)
