"""Fit a and b of eq. 14 of Kwak and Bajic anew: how many bits an LTR has beside STR frames.

    python -m tools.fit_bit_allocation CLIP-OR-FOLDER...

Of what is given, the paper's training clips are fitted (Table II), C3D files as markers, BVH and
AMC files as the points of skeletons; of one name a C3D file and one skeleton, BVH before AMC. The
gain of ``rca`` over ``rc``, with the published numbers and the fitted ones, is measured on clips
that are not fitted: those of ``python -m tools.papers kwak``. Both are printed as they are found.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

from mcz.bench.cases import Case, find_cases
from mcz.bench.sweep import bd_rate, bd_sqnr
from mcz.errors import MczError
from tools.papers.kwak.clips import (
    BVH_POINTS,
    MADE,
    MARKED,
    POINTS,
    Clip,
    find_clips,
    motion_in_positions,
)
from tools.papers.kwak.fit import Fit, Point, curve_of, fit, points_of
from tools.papers.kwak.printed import PRINTED_FITS

TRAINING = (
    *("01_01", "05_02", "14_09", "16_02", "17_06", "47_01", "49_01", "64_03", "85_01", "94_15"),
    *("105_11", "105_17", "105_57", "118_17", "124_02", "125_01", "131_04", "132_02", "135_01"),
    "135_04",
)
GROUPS = {"c3d": "markers (C3D)", "bvh": "skeletons"}
FEWEST = 20  # points of a fit


def training_clips(cases: Sequence[Case], kind: str) -> Iterator[Clip]:
    """The training clips of one kind, one a name."""
    for name in TRAINING:
        if kind == "c3d":
            found = [Clip(c, MARKED) for c in cases if c.name == name and c.path.endswith(".c3d")]
            # Where there is no C3D file, markers that are made of the skeleton stand in for it.
            found += [Clip(c, MADE) for c in cases if c.name == name and c.path.endswith(".amc")]
        else:
            found = [Clip(c, POINTS) for c in cases if c.name == name and c.path.endswith(".bvh")]
            found = [clip for clip in found if _n_points(clip) == BVH_POINTS]
            found += [Clip(c, POINTS) for c in cases if c.name == name and c.path.endswith(".amc")]
        yield from found[:1]


def _n_points(clip: Clip) -> int:
    try:
        return motion_in_positions(clip).skeleton.n_joints
    except MczError:
        return 0


def fit_clips(clips: Sequence[Clip]) -> Fit | None:
    """Prints what each clip gives."""
    points: list[Point] = []
    for clip in clips:
        found = points_of(motion_in_positions(clip))
        points += found
        alphas = " ".join(f"{point.alpha:g}" for point in found)
        print(f"  {clip.name}: {len(found)} points, alpha {alphas}", flush=True)
    if len(points) < FEWEST:
        return None
    return fit(points)


def gains(clips: Sequence[Clip], kind: str, found: Fit) -> None:
    """Print what RCA gains over RC on clips that were not fitted."""
    for clip in clips:
        motion = motion_in_positions(clip)
        reference = curve_of(motion, {"preset": "rc"})
        for label, (a, b) in (("published", PRINTED_FITS[kind]), ("fitted", (found.a, found.b))):
            curve = curve_of(motion, {"preset": "rca", "a": a, "b": b})
            figures = bd_sqnr(reference, curve), bd_rate(reference, curve)
            quality, rate = ("-" if x is None else f"{x:+.2f}" for x in figures)
            pairs = zip(reference, curve, strict=True)
            each = ", ".join(f"{ours - theirs:+.2f}" for (_, theirs), (_, ours) in pairs)
            gain = f"BD {quality} dB, {rate} % of rate; dB at each rate: {each}"
            print(f"  {clip.name}, {label}: {gain}", flush=True)


def main(*paths: str) -> None:
    cases = find_cases(paths, None)
    others = [clip for clip in find_clips(paths, None) if clip.stem not in TRAINING]
    for kind, what in GROUPS.items():
        clips = list(training_clips(cases, kind))
        print(f"{what}: {len(clips)} clips")
        found = fit_clips(clips)
        if found is None:
            print("  too few points for a fit")
            continue
        print(
            f"  a = {found.a:.4f}, b = {found.b:.4f} ({found.n_points} points, "
            f"{found.n_outliers} left out, residual {found.residual:.3f} bits rms); "
            f"published {PRINTED_FITS[kind][0]:g}, {PRINTED_FITS[kind][1]:g}"
        )
        gains([clip for clip in others if clip.is_markers == (kind == "c3d")], kind, found)


if __name__ == "__main__":
    main(*sys.argv[1:])
