"""Valid: ``lsdt-clip``."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from tools.vectors.build.edits import stream
from tools.vectors.build.files import Vector
from tools.vectors.build.spatial_clips import CLIP, Plan, Spaces, listed, still
from tools.vectors.build.spatial_streams import longer_row, sized
from tools.vectors.valid.common import every_codec, lsdt, spatial


def vectors() -> Iterable[Vector]:
    shelf = Spaces(CLIP)
    lsdt.add(shelf)
    spatial.add(shelf)
    spatial.add_cuts(shelf)
    spatial.add_longer(shelf)
    _windows(shelf)
    _segments_of_windows(shelf)
    every_codec.add(shelf, CLIP)
    return shelf.vectors


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
