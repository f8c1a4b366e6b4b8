"""Valid: codecs 4, 5, 6, 9 and 10 once more, where their kin have a vector that they had not.

A decoder may read these codecs by other code than their kin.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from mcz.codecs import by_name, raw
from mcz.codecs._lossy import SCALED
from mcz.codecs.base import Codec
from mcz.container import payloads
from mcz.motion import Motion, Signal
from mcz.numbers import Grid, GridKind
from mcz.transforms.wavelets import Wavelet
from tools.vectors import components, spatial, waved
from tools.vectors.components import part_of
from tools.vectors.craft import UNSUPPORTED, Crafter, Vector, Whole, file_of, finished
from tools.vectors.edits import put
from tools.vectors.motions import HUNDREDTHS, numbers
from tools.vectors.spatial import CLIP, MDTT, PCA_RDO, basis_of
from tools.vectors.valid_cut import HEADING as CUT_HEADING
from tools.vectors.valid_cut import cut

GRIDS = (Grid(GridKind.INTEGER), Grid(GridKind.FIXED, 1), HUNDREDTHS)
HALVES = Wavelet((0.5, 0.25, -0.75, 1.5), (1.25, -0.5, 0.5, -0.125))


def vectors() -> Iterable[Vector]:
    return [*_waves("dwt"), *_waves("awt"), *_pca(), *_windows(), *_bare(), *_newer()]


def _as(name: str, made: Codec) -> Codec:
    own = by_name(name)
    return replace(own, encode=made.encode, parameters=raw.CODEC.parameters, dial=None)


def _waves(name: str) -> Iterable[Vector]:
    """What codec 2 reads, under another id."""
    shelf = Whole(f"valid/{name}")
    spec = f"Codec {by_name(name).id}: {name}; Wavelets"

    def hold(case: str, purpose: str, plan: waved.Plan, n: int = 1, **edits: Any) -> None:
        made = waved.waves(plan, n)
        motion = waved.motion_of(plan, made)
        if "grids" in edits:
            signal = replace(motion.signals[0], grids=edits.pop("grids"))
            motion = replace(motion, signals=(signal,))
        requests = [(k, (1, plan.n_frames - 1), None) for k in range(min(2, plan.resolutions))]
        parts = tuple(waved.request(plan, made, motion, *request) for request in requests)
        codec = _as(name, waved.codec_of(plan, made))
        data = file_of(motion, codec=codec, grouping="channel", **edits)
        shelf.hold(case, spec, purpose, data, motion, parts=parts)

    for levels, wavelet in ((0, waved.DB3), (16, waved.HAAR)):
        plan = waved.Plan(9, wavelet, levels)
        hold(f"levels-{levels}", f"{levels} levels of a clip of 9 frames.", plan)
    hold("inline", "Filters in the header, of four taps.", waved.Plan(13, HALVES, 2))
    plan = waved.Plan(30, waved.BIOR, 3, SCALED, 2.0**-7, ends=(8, 24), n_resolutions=2)
    hold("resolutions-2", "2 resolutions of 3 levels: the finest details are not stored.", plan, 2)
    plan = waved.Plan(12, waved.DB2, 2)
    listed = put(payloads.CLIP, "signals.0.groups", b"\3\3\1\1\1")
    purpose = "Groups by another name (listed), still one a channel."
    hold("groups-listed", purpose, plan, 3, CLIP=listed)
    purpose = "Values are not rounded to the grids, one of which is INTEGER."
    hold("grids", purpose, replace(plan, decimals=3), 3, grids=GRIDS)
    plan = waved.Plan(20, waved.DB2, 2, least=5)
    made = waved.waves(plan, 2)
    motion = waved.motion_of(plan, made)
    codec = _as(name, waved.codec_of(plan, made))
    data = cut(file_of(motion, codec=codec, grouping="channel"), resolution=1)
    coarse = replace(motion, signals=(Signal(waved.values_of(plan, made, 1)),))
    purpose = "The finest details cut out."
    shelf.hold("cut-resolution", f"{spec}; {CUT_HEADING}", purpose, data, coarse)
    return shelf.vectors


def _pca() -> Iterable[Vector]:
    shelf = components.Parts("valid/pca")
    plan = components.Plan((part_of(7, 3, 2), part_of(4, 3, 1, 2)))
    listed = put(payloads.CLIP, "signals.0.groups", b"\3\1\3")
    purpose = "One group of all channels, that is listed."
    shelf.hold_plan("groups-listed", purpose, plan, [(2, 9)], CLIP=listed)
    joined = put(payloads.CLIP, "signals.0.groups", b"\1")
    purpose = "One group of all channels, of the only joint."
    shelf.hold_plan("groups-joint", purpose, plan, [(2, 9)], CLIP=joined)
    motion = components.motion_of(plan)
    motion = replace(motion, signals=(replace(motion.signals[0], grids=GRIDS),))
    purpose = "Values are not rounded to the grids, one of which is INTEGER."
    spec = f"{components.HEADING}; Codecs; CLIP"
    shelf.hold("grids", spec, purpose, components.file_with(plan, motion), motion)
    return shelf.vectors


def _windows() -> Iterable[Vector]:
    """Models of several clips, and both ends of windows and frequencies."""
    found: list[Vector] = []
    for name, other in ((MDTT, PCA_RDO), (PCA_RDO, CLIP)):
        shelf = spatial.Spaces(name)
        bases = (basis_of(4, 3),)
        first = spatial.Plan(name, 4, (9, 5), bases=bases)
        second = replace(first, codec=other, segments=(6,), step=0.25, prefix=True)
        crafter = Crafter()
        motions = [
            replace(spatial.motion_of(plan), name=f"clip {k}")
            for k, plan in enumerate((first, second))
        ]
        for motion, plan in zip(motions, (first, second), strict=True):
            codec = spatial.codec_of(plan)
            crafter.clip(motion, codec=codec, grouping="all", segment_frames=0)
        data = finished(crafter)
        purpose = f"Two clips with one model, the second of {other}."
        shelf.hold("model-shared", f"{shelf.spec}; Bases", purpose, data, *motions)
        plan = spatial.Plan(name, 1, (2050,), window=2048, frequencies=1, fill=_lone)
        shelf.plan("window-2048-1", "A window of 2048 frames, one frequency.", plan, [(2047, 2050)])
        plan = spatial.Plan(name, 3, (7,), step=2.0**-100)
        shelf.plan("step-least", "The least step.", plan)
        found += shelf.vectors
    return found


def _lone(number: int, n_rows: int, n: int) -> spatial.Ints:
    return spatial.listed([[70]], [[-9]])(number, n_rows, n)


def _bare() -> Iterable[Vector]:
    """Codecs of ordinals without a channel."""
    found: list[Vector] = []
    for name in ("raw", "lossless"):
        shelf = Whole(f"valid/{name}")
        still = Motion(spatial.markers(0), (Signal(numbers(7, 0)),), name="still")
        own = by_name(name)
        data = file_of(still, codec=own)
        heading = f"Codec {own.id}: {name}"
        shelf.hold("no-channels", heading, "A clip of 7 frames without a channel.", data, still)
        found += shelf.vectors
    return found


def _newer() -> Iterable[Vector]:
    found: list[Vector] = []
    plans: Sequence[tuple[str, Codec, Motion, str]] = (
        ("pca", *_content_of_pca(), "all"),
        ("dwt", *_content_of_waves("dwt"), "channel"),
        ("awt", *_content_of_waves("awt"), "channel"),
    )
    for name, codec, motion, grouping in plans:
        shelf = Whole(f"uncommon/{name}")
        crafter = Crafter()
        later = replace(codec, version=1)
        crafter.clip(motion, codec=later, grouping=grouping, segment_frames=0)
        purpose = f"Version 1 of {name}, which this format does not have."
        shelf.add("newer-version", "Codecs", purpose, finished(crafter), exit=(UNSUPPORTED,))
        found += shelf.vectors
    return found


def _content_of_pca() -> tuple[Codec, Motion]:
    plan = components.Plan((part_of(4, 3, 1),))
    return components.codec_of(plan), components.motion_of(plan)


def _content_of_waves(name: str) -> tuple[Codec, Motion]:
    plan = waved.Plan(8, waved.DB2)
    made = waved.waves(plan)
    return _as(name, waved.codec_of(plan, made)), waved.motion_of(plan, made)
