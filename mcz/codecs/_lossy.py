"""What the lossy codecs' encoders have in common: presets, shared parameters, segments' sizes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mcz.codecs.base import Layout, Parameter, choice, integer
from mcz.errors import MotionError
from mcz.motion import Skeleton

TARGET_BYTES = 62_000  # of a segment: under the 64 KiB that DATA should have, table included
SEGMENT_FRAMES = 4096  # where that leaves it open
MAX_DECIMALS = 15
SCALED = 255  # in place of decimals: there are steps

Presets = Mapping[str, Mapping[str, Any]]

SEGMENT_FRAMES_PARAMETER = Parameter(
    "segment_frames",
    None,
    f"frames a segment; default: as many as make 64 KiB, at most {SEGMENT_FRAMES}",
    integer("segment_frames", 1, 2**40),
)


def preset_parameter(presets: Presets) -> Parameter:
    """The parameter that names one of ``presets``: default, or the published method's."""
    (published,) = set(presets) - {"default"}
    help_ = f"default, or {published} for the published method"
    return Parameter("preset", "default", help_, choice("preset", tuple(presets)))


def decimals_parameter(help_: str) -> Parameter:
    return Parameter("Q", None, help_, integer("Q", 0, MAX_DECIMALS))


def chosen_of(presets: Presets, params: Mapping[str, Any]) -> dict[str, Any]:
    """What a preset has a say in, each value that was given in place of the preset's."""
    values = presets[params["preset"]].items()
    return {name: value if params[name] is None else params[name] for name, value in values}


def segment_frames_of(layout: Layout, given: int | None, *, as_published: bool = False) -> int:
    """Frames a segment, 0: the size decides; published methods take the whole clip at once."""
    if given is None:
        return layout.n_frames if as_published else 0
    return given


def skeleton_of(name: str, layout: Layout) -> Skeleton:
    """The skeleton of a signal that the codec ``name`` can code; raises MotionError."""
    if layout.samples_per_frame != 1 or layout.skeleton is None:
        raise MotionError(f"{name}: only signals of one sample a frame")
    return layout.skeleton
