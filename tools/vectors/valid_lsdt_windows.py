"""Valid: codecs 7 to 10, Hou's family: windows, frames and their segments, vectors of the clip."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.motion import Channel, Joint, Skeleton
from tools.vectors.craft import Vector
from tools.vectors.edits import stream
from tools.vectors.spatial import (
    CLIP,
    FRAME,
    MDTT,
    PCA_RDO,
    Plan,
    Spaces,
    basis_of,
    listed,
    motion_of,
    noise,
    still,
)
from tools.vectors.spatial_faults import longer_frame, longer_row, sized

MOST = 2**40
WEIGHTS = bytes((0, 1, 2, 3, 4, 127, 128, 130, 136, 139, 254, 255))
UNLIKE = (basis_of(3, 1), basis_of(3, 3, 1), basis_of(3, 2, 2))


def vectors() -> Iterable[Vector]:
    frame, clip, mdtt, pca_rdo = shelves = [Spaces(n) for n in (FRAME, CLIP, MDTT, PCA_RDO)]
    _windows(clip)
    _segments_of_windows(clip)
    _segments_of_frames(frame)
    _own_vectors(mdtt)
    _own_vectors(pca_rdo)
    _courses(pca_rdo)
    return [vector for shelf in shelves for vector in shelf.vectors]


def _windows(shelf: Spaces) -> None:
    plan = Plan(segments=(5,), window=1)
    shelf.plan("window-1", "Windows of one frame.", plan, [(2, 3)])
    ends = listed([[5, *[0] * 2046, -7]], [[1, 2]])
    plan = Plan(n_channels=1, segments=(2050,), window=2048, fill=ends)
    purpose = "A window of 2048 frames and as many frequencies, and one of two."
    shelf.plan("window-2048", purpose, plan, [(2040, 2050)])
    rows = [_gaps(*range(16), 16, 24, 32, 48, 64, 96, 128, 192, 256, 384), _gaps(512, 1024)]
    rows += [_gaps(768), _gaps(1536), _gaps(2047)]
    plan = Plan(n_channels=5, segments=(2048,), window=2048, prefix=True, fill=listed(rows))
    purpose = "Gaps of every class to 2047, the greatest that there may be."
    shelf.plan("gaps", purpose, plan, [(3, 4)], spec="Sparse lists; Prefix codes")
    for frequencies in (1, 3):
        plan = Plan(n_channels=4, segments=(18,), frequencies=frequencies)
        for prefix in (False, True):
            end, how = ("-prefix", ", prefix codes") if prefix else ("", "")
            purpose = f"{frequencies} of 8 frequencies, the last window has two frames{how}."
            made = replace(plan, prefix=prefix)
            shelf.plan(f"frequencies-{frequencies}{end}", purpose, made, [(15, 18)])
    plan = Plan(n_channels=2, segments=(100,), window=100)
    shelf.plan("window-100", "Windows of 100 frames, and as many frequencies.", plan)
    plan = Plan(n_channels=2, segments=(20,), window=2048, frequencies=20)
    shelf.plan("window-only-short", "One window, shorter than said, all of its frequencies.", plan)
    plan = Plan(segments=(17,), fill=still)
    shelf.plan("zeros", "Nothing but zeros, adaptive.", plan)
    purpose = "Rows whose length counts zeros behind their last coefficient."
    plan = Plan(n_channels=1, segments=(4,), window=4, fill=listed([[-9, 5]]))
    loud = sized(longer_row(np.array([-9, 5, 0]), 4))
    shelf.plan("length-more", purpose, plan, segments=stream(0, lambda _: loud))


def _gaps(*gaps: int) -> list[int]:
    """A row with a coefficient behind each of these gaps."""
    row: list[int] = []
    for gap in gaps:
        row += [0] * gap + [(-1) ** len(row) * (1 + gap % 5)]
    return row


def _segments_of_windows(shelf: Spaces) -> None:
    plan = Plan(n_channels=4, segments=(19, 8, 3, 16, 1))
    requests = [(0, 19), (18, 20), (16, 17), (27, 31), (29, 30), (46, 47), (30, 30)]
    for prefix in (False, True):
        end, how = ("-prefix", ", prefix codes") if prefix else ("", "")
        purpose = f"Five segments, whose last windows have 3, 8, 3, 8 and 1 frames{how}."
        made = replace(plan, prefix=prefix)
        shelf.plan(f"segments{end}", purpose, made, requests, spec="DATA")
    purpose = "Segments of windows as packets of an open DATA."
    requests = [(17, 29)]
    shelf.plan("packets", purpose, plan, requests, spec="Open DATA and packets", packets=True)


def _segments_of_frames(shelf: Spaces) -> None:
    for prefix in (False, True):
        end, how = ("-prefix", ", prefix codes") if prefix else ("", "")
        plan = Plan(n_channels=9, segments=(6, 4, 1, 5), apart=True, bases=UNLIKE, prefix=prefix)
        one = replace(plan, fresh=(True, True, False, True))
        purpose = f"A segment that goes on where the one before ended{how}."
        requests = [(10, 11), (7, 9), (9, 13), (12, 16), (6, 6)]
        shelf.plan(f"segments-one-on{end}", purpose, one, requests, spec="DATA")
        many = replace(plan, fresh=(True, False, False, False))
        purpose = f"Four segments, of which the first alone starts fresh{how}."
        shelf.plan(f"segments-all-on{end}", purpose, many, requests, spec="DATA")
        purpose = f"Four segments that start fresh{how}."
        shelf.plan(f"segments-fresh{end}", purpose, plan, requests, spec="DATA")
    plan = Plan(n_channels=70, segments=(4,), fill=noise)
    shelf.plan("rows-70", "A matrix of 70 rows.", plan)
    entries = np.eye(1, 2048, 5, dtype=np.int64) + 3 * np.eye(1, 2048, 2047, dtype=np.int64)
    wide = Plan(n_channels=2048, segments=(2,), bases=(basis_of(2048, 1, entries=entries),))
    skeleton = Skeleton((Joint("", channels=(Channel(""),) * 2048),))
    motion = motion_of(replace(wide, codec=FRAME), skeleton=skeleton)
    shelf.plan("points-2048", "A matrix of 2048 points.", wide, motion=motion, spec="Space")
    loud = longer_frame(np.array([7, 0, -1, 0]))
    plan = Plan(n_channels=5, segments=(1,), fill=listed([[7, 0, -1]]))
    purpose = "A length that counts zeros behind the last coefficient."
    shelf.plan("length-more", purpose, plan, segments=stream(0, lambda _: loud))


def _own_vectors(shelf: Spaces) -> None:
    cases: dict[str, tuple[str, Plan]] = {
        "cosines": ("Cosines", Plan(segments=(10,))),
        "learned": ("One basis", Plan(n_channels=4, bases=(basis_of(4, 3),), weights=WEIGHTS[5:9])),
        "learned-unlike": (
            "Three bases, three of 8 frequencies",
            Plan(n_channels=9, segments=(19, 5), apart=True, bases=UNLIKE, frequencies=3),
        ),
        "frames-1": ("One frame", Plan(segments=(1,), bases=(basis_of(3, 2),))),
        "frames-2": ("Two frames", Plan(segments=(2,), bases=(basis_of(3, 2),), prefix=True)),
        "window-1": ("Windows of one frame", Plan(segments=(4,), window=1)),
        "step-greatest": ("The greatest step", Plan(segments=(4,), step=2.0**100)),
        "prefix": ("Prefix codes", Plan(n_channels=4, bases=(basis_of(4, 3),), prefix=True)),
    }
    for name, (purpose, plan) in cases.items():
        n = plan.n_frames
        shelf.plan(name, f"{purpose}.", plan, [(n // 3, n - n // 4)])


def _courses(shelf: Spaces) -> None:
    mean, courses = basis_of(4, 1, 5, shifts=[3]), basis_of(8, 5, 3)
    own, plan = basis_of(4, 3), Plan(n_channels=4, segments=(19, 6, 8), frequencies=5)
    cases: dict[str, tuple[str, Plan]] = {
        "mean": ("A mean, cosines", replace(plan, mean=mean)),
        "courses": (
            "Courses, cosines in space; short windows have cosines",
            replace(plan, courses=courses),
        ),
        "mean-learned": ("A mean and a basis", replace(plan, mean=mean, bases=(own,))),
        "courses-learned": ("Courses and a basis", replace(plan, courses=courses, bases=(own,))),
        "both": ("Courses and a mean", replace(plan, courses=courses, mean=mean)),
        "both-learned": (
            "A basis, courses and a mean, in prefix codes",
            replace(plan, courses=courses, mean=mean, bases=(own,), prefix=True),
        ),
        "courses-of-few": (
            "Courses of 5 of the 8 cosines",
            replace(plan, courses=basis_of(5, 5, 2), bases=(own,)),
        ),
        "courses-all": (
            "As many courses as frames",
            replace(plan, courses=basis_of(8, 8, 2), frequencies=8),
        ),
        "courses-unused": (
            "One short window, so no courses",
            replace(plan, segments=(7,), courses=courses),
        ),
        "courses-window-1": (
            "A course of one frame",
            replace(plan, segments=(5,), window=1, frequencies=1, courses=basis_of(1, 1, 4)),
        ),
        "all-flags": (
            "Three matrices, weights, courses and a mean",
            Plan(
                n_channels=9,
                segments=(19,),
                frequencies=5,
                apart=True,
                weights=WEIGHTS[3:],
                bases=UNLIKE,
                courses=courses,
                mean=basis_of(
                    9, 1, 2, entries=[[MOST, -MOST, 0, 1, -1, 5, 99, -7, 8]], shifts=[40]
                ),
            ),
        ),
        "mean-apart": (
            "A mean of the channels in their order, three matrices",
            Plan(n_channels=6, segments=(9,), apart=True, mean=basis_of(6, 1, 3), step=0.1),
        ),
        "mean-great": (
            "A mean of up to 2^40 under coefficients of 0",
            Plan(
                segments=(5,),
                mean=basis_of(3, 1, entries=[[MOST, -MOST, 1]], shifts=[0]),
                fill=still,
            ),
        ),
    }
    for name, (purpose, made) in cases.items():
        n = made.n_frames
        shelf.plan(name, f"{purpose}.", made, [(n // 3, n - n // 4), (n - 1, n)])
    entries = np.zeros((3, 2048), np.int64)
    entries[0, 0], entries[1, 2047], entries[2, 7] = 64, -5, 9
    plan = Plan(
        n_channels=1,
        segments=(2048,),
        window=2048,
        frequencies=3,
        courses=basis_of(2048, 3, entries=entries, shifts=[6] * 3),
    )
    shelf.plan("window-2048", "Courses of 2048 cosines.", plan, [(2047, 2048)])
