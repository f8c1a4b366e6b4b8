"""Clips made at random, one codec each: headers and streams that no encoder of ours would choose.

Everything is drawn from one ``random.Random``, so a seed gives the same bytes anywhere; what is
coded is integers.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs import codec_by_name, raw
from mcz.codecs.contract import Codec
from mcz.codecs.parameters import SCALED
from mcz.codecs.posewave.header import DEPENDENT
from mcz.codecs.transforms.wavelets import Wavelet
from mcz.model.motion import Motion, Signal
from mcz.model.numbers import Grid, GridKind
from tools.vectors.build import (
    curve_clips,
    online_clips,
    online_units,
    pca_clips,
    pose_clips,
    spatial_clips,
    wavelet_clips,
)
from tools.vectors.build.random_ordinals import any_grids, clip_of_ordinals, mask_of
from tools.vectors.build.random_parts import (
    MOST,
    SPELLED,
    Chance,
    Clip,
    Ints,
    ends,
    integer,
    integers,
    partition,
    skeleton,
    split_count,
)
from tools.vectors.build.spatial_clips import FRAME, PCA_RDO


def clip(chance: Chance, name: str, codec: str) -> Clip:
    """A clip of ``codec`` called ``name``."""
    if codec in ("raw", "best", "fast", SPELLED):
        made = clip_of_ordinals(chance, codec)
    elif codec in _MAKERS:
        made = _MAKERS[codec](chance, codec)
    else:
        made = _space(chance, codec)
    return replace(made, motion=replace(made.motion, name=name))


def _lossy(chance: Chance, codec: Codec, values: Any, grouping: str, sizes: Sequence[int]) -> Clip:
    n_rows, n = values.shape
    grids = any_grids(chance, n, whole=False)
    grids = tuple(Grid(GridKind.FIXED, 2) if g.kind == GridKind.INTEGER else g for g in grids)
    signal = Signal(values, grids, mask=mask_of(chance, (n_rows, n)))
    return Clip(codec, Motion(skeleton(chance, sizes), (signal,)), grouping)


def _as(name: str, made: Codec) -> Codec:
    """The content of another codec under the id of ``name``."""
    own = codec_by_name(name)
    return replace(own, encode=made.encode, parameters=raw.CODEC.parameters, dial=None)


def _waves(chance: Chance, name: str) -> Clip:
    n_frames = chance.choice((1, 2, 3, 9, 24, 45))
    levels = chance.choice((0, 1, 2, 3, 5))
    unit = 2.0 ** chance.randrange(-30, 31)
    wavelet: int | Wavelet = chance.randrange(1, 11)
    if chance.random() < 0.2:
        lo, hi = ([chance.randrange(-64, 65) / 37 for _ in range(6)] for _ in range(2))
        wavelet = Wavelet(tuple(lo), tuple(hi))
    plan = wavelet_clips.Plan(
        n_frames,
        wavelet,
        levels,
        chance.choice((0, 1, 6, 15, SCALED, SCALED)),
        unit,
        chance.choice((1, 1, 2, 700, 2**39)),
        ends(split_count(chance, n_frames, 2**levels)),
        n_resolutions=chance.randrange(1, levels + 2),
    )
    made = [_wave(chance, plan) for _ in range(chance.randrange(1, 4))]
    values = wavelet_clips.values_of(plan, made)
    codec = _as(name, wavelet_clips.codec_of(plan, made))
    return _lossy(chance, codec, values, "channel", partition(chance, len(made)))


def _wave(chance: Chance, plan: wavelet_clips.Plan) -> wavelet_clips.Wave:
    bands: list[list[int]] = [integers(chance, plan.lengths[-1])]
    for level in range(plan.levels, 0, -1):
        made = []
        for value in integers(chance, plan.lengths[level], MOST - plan.least):
            sign = (value > 0) - (value < 0)
            made.append(sign * (abs(value) - 1 + plan.least))
        bands.append(made if chance.random() < 0.7 else [0] * len(made))
    alike = len(set(bands[0])) == 1 and chance.random() < 0.5
    heads = tuple(
        wavelet_clips.Head(chance.randrange(256), 0, 63)
        if alike
        else wavelet_clips.Head(chance.randrange(256), chance.randrange(4), chance.randrange(63))
        for _ in range(3)
    )
    spoken = [band for band in range(1, plan.levels + 1) if chance.random() < 0.3]
    return wavelet_clips.Wave(bands, heads, (0, *spoken))


def _curves(chance: Chance, name: str) -> Clip:
    n_frames = chance.choice((1, 2, 9, 30))
    delta = chance.choice((1, 2, 5, 8, 40))
    plan = curve_clips.Plan(
        n_frames,
        delta,
        chance.choice((0, 2, 15, SCALED)),
        2.0 ** chance.randrange(-20, 21),
        ends=ends(split_count(chance, n_frames, delta)),
        n_resolutions=chance.randrange(1, 3),
    )
    sizes = [chance.randrange(1, 5) for _ in range(chance.randrange(1, 4))]
    made = [_path(chance, plan, size) for size in sizes]
    values = curve_clips.values_of(plan, made)
    return _lossy(chance, _as(name, curve_clips.codec_of(plan, made)), values, "joint", sizes)


def _path(chance: Chance, plan: curve_clips.Plan, size: int) -> curve_clips.Path:
    marks = list(zip(*[integers(chance, len(plan.marks)) for _ in range(size)], strict=True))
    pieces = {}
    for mark in range(len(plan.marks) - 1):
        if chance.random() < 0.7:
            pieces[mark] = [
                curve_clips.Piece(n, _point(chance, size), _point(chance, size))
                for n in split_count(chance, plan.between(mark))
            ]
    scales = chance.randrange(64), chance.randrange(64), chance.randrange(64)
    spoken = tuple(k for k in range(2) if chance.random() < 0.3)
    return curve_clips.Path(marks, pieces, scales, spoken, size)


def _point(chance: Chance, size: int) -> tuple[int, ...] | None:
    if chance.random() < 0.3:
        return None
    return tuple(integer(chance, 2**39) for _ in range(size))


def _parts(chance: Chance, name: str) -> Clip:
    n = chance.randrange(1, 6)
    parts, empty = [], []
    for number, n_frames in enumerate(split_count(chance, chance.choice((1, 3, 12, 20)))):
        count = chance.randrange(min(n, n_frames + 1) + 1)
        scale, forms = chance.randrange(63), [chance.randrange(4) for _ in range(count)]
        columns = [integers(chance, n_frames) for _ in range(count)]
        parts.append(
            pca_clips.Part(
                [integer(chance) for _ in range(n)],
                [integers(chance, n) for _ in range(count)],
                [tuple(column[f] for column in columns) for f in range(n_frames)],
                chance.randrange(256),
                scale,
                [chance.randrange(41) for _ in range(count)],
                [64 * form + chance.randrange(63) for form in forms],
                n_frames=n_frames,
            )
        )
        empty += [number] * (chance.random() < 0.1)
    plan = pca_clips.Plan(tuple(parts), chance.choice((0, 2, 15, SCALED)), tuple(empty))
    values = pca_clips.values_of(plan)
    codec = _as(name, pca_clips.codec_of(plan))
    return _lossy(chance, codec, values, "all", partition(chance, n))


def _basis(chance: Chance, n_points: int, most: int) -> Any:
    n = chance.randrange(1, most + 1)
    entries = [integers(chance, n_points) for _ in range(n)]
    shifts = [chance.choice((0, 7, 7, 12, 40)) for _ in range(n)]
    return spatial_clips.basis_of(n_points, n, entries=entries, shifts=shifts)


def _fill(chance: Chance) -> Callable[[int, int, int], Ints]:
    """Coefficients of a table by its number, the same whenever they are asked for."""
    seed = chance.getrandbits(32)

    def fill(number: int, n_rows: int, n: int) -> Ints:
        own = random.Random(1_000_003 * seed + number)
        table = [integers(own, n) for _ in range(n_rows)]
        return np.array(table, np.int64).reshape(n_rows, n)

    return fill


def _about(chance: Chance) -> dict[str, Any]:
    """The common part of lsdt-frame, lsdt-clip and online."""
    apart = chance.random() < 0.4
    n = 3 * chance.randrange(1, 4) if apart else chance.randrange(1, 8)
    bases = ()
    if chance.random() < 0.6:
        points = n // 3 if apart else n
        bases = tuple(_basis(chance, points, points) for _ in range(3 if apart else 1))
    weights = bytes(chance.randrange(256) for _ in range(n)) if chance.random() < 0.4 else None
    step = chance.choice((1.0, 1 / 3, 2.0**-100, 2.0 ** chance.randrange(-20, 21)))
    about = {"n_channels": n, "apart": apart, "bases": bases, "weights": weights, "step": step}
    return about | {"fill": _fill(chance)}


def _space(chance: Chance, name: str) -> Clip:
    about = _about(chance)
    segments = tuple(split_count(chance, chance.choice((1, 2, 13, 30))))
    window = chance.choice((1, 2, 4, 8, 20))
    frequencies = chance.randrange(1, window + 1)
    fresh: tuple[bool, ...] = ()
    more: dict[str, Any] = {}
    if name == FRAME:
        fresh = (True, *(chance.random() < 0.4 for _ in segments[1:]))
    if name == PCA_RDO and chance.random() < 0.5:
        more["mean"] = _basis(chance, about["n_channels"], 1)
    if name == PCA_RDO and chance.random() < 0.5:
        n_points = chance.randrange(1, window + 1)
        courses = _basis(chance, n_points, n_points)
        frequencies = len(courses.entries)
        more["courses"] = courses
    plan = spatial_clips.Plan(
        name,
        segments=segments,
        fresh=fresh,
        window=window,
        frequencies=frequencies,
        prefix=chance.random() < 0.4,
        **about,
        **more,
    )
    values = spatial_clips.values_of(plan)
    return _lossy(
        chance, spatial_clips.codec_of(plan), values, "all", partition(chance, plan.n_channels)
    )


def _online(chance: Chance, name: str) -> Clip:
    about = _about(chance)
    order = 0 if about["apart"] or about["n_channels"] % 3 else chance.randrange(2)
    parts = split_count(chance, chance.choice((1, 2, 13, 30)))
    units = []
    for number, n_frames in enumerate(parts):
        own = []
        for k, n in enumerate(split_count(chance, n_frames)):
            own.append("I" if number == k == 0 else chance.choice("ILSS"))
            own[-1] += str(n)
        units.append(" ".join(own))
    codes = [chance.randrange(512) if chance.random() < 0.5 else 256 for _ in range(sum(parts))]
    plan = online_units.Plan(
        tuple(units),
        coder=chance.randrange(2),
        order=order,
        steps=online_clips.steps_in_turn(codes),
        said=tuple(f for f in range(sum(parts)) if chance.random() < 0.2),
        **about,
    )
    values = online_clips.values_of(plan)
    codec = online_clips.codec_of(plan)
    return _lossy(chance, codec, values, "all", partition(chance, plan.n_channels))


def _poses(chance: Chance, name: str) -> Clip:
    """Any skeleton and header; what is coded is a walk at random."""
    sizes = partition(chance, chance.randrange(1, 30))
    bones = skeleton(chance, sizes)
    n_frames = chance.choice((1, 2, 3, 9, 24, 45))
    levels = chance.choice((0, 1, 2, 3, 5, 8))
    source = np.array([_walk(chance, n_frames) for _ in range(bones.n_channels)]).T
    fields = {
        "levels": levels,
        "borrowing": chance.randrange(levels + 1),
        "start": chance.randrange(2),
        "flags": chance.choice((0, DEPENDENT)),
        "step": 2.0 ** chance.randrange(-8, 3),
        "radius": chance.choice((0.0, 0.25, 3.0, 40.0)),
        "shell": chance.randrange(17),
        "rotation": chance.randrange(110, 150),
        "position": chance.randrange(110, 150),
        "first": chance.randrange(10),
        "constant": chance.randrange(10),
        "weights": [chance.randrange(110, 150) for _ in bones.joints] * chance.randrange(2),
    }
    plan = pose_clips.Plan(
        bones, source, fields, ends(split_count(chance, n_frames)), chance.randrange(levels + 1)
    )
    values = pose_clips.values_of(plan)
    made = _lossy(chance, pose_clips.codec_of(plan), values, "all", sizes)
    return replace(made, motion=replace(made.motion, skeleton=bones))


def _walk(chance: Chance, n_frames: int) -> list[float]:
    still = chance.random() < 0.2
    steps = [0 if still else chance.randrange(-20, 21) for _ in range(n_frames)]
    found: list[int] = np.cumsum(steps).tolist()
    return [value / 8 for value in found]


_MAKERS: dict[str, Callable[[Chance, str], Clip]] = {
    "mrdwt": _waves,
    "dwt": _waves,
    "awt": _waves,
    "qbc": _curves,
    "pca": _parts,
    "online": _online,
    "posewave": _poses,
}
