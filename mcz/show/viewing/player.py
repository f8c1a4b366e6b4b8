"""A motion as a small player for notebooks: self-contained HTML of at most 300 kB.

It runs in a frame of its own, which can reach neither the notebook nor a network.
"""

from __future__ import annotations

import base64
import html
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mcz.errors import AccessError, MczError, MotionError, reason_of
from mcz.files.reading.clip import Clip
from mcz.files.reading.file import open as mcz_open
from mcz.kinematics.joint_names import sides_of
from mcz.kinematics.points import first_points, listed_points, positions_of
from mcz.model.motion import Motion, Skeleton
from mcz.model.skeleton import column_of, signs_of
from mcz.model.text_format import count_text, quote_name
from mcz.show.viewing.file_registry import FileRegistry, RegisteredFile
from mcz.show.viewing.page import OTHER, Page, page

MOST_BYTES = 300_000
SPARE = 500  # bytes that numbers may have more than they had in the first try
TIME_BYTES = 12  # of the time of a frame, as text
HEIGHT = 420  # pixels
UNKNOWN_RATE = 30.0  # frames a second of a motion without a rate
PLACE = "/*data*/null"


def player(motion: Moving) -> str:
    """The HTML of a Motion or Clip; if it cannot be drawn, its summary and the reason."""
    try:
        return _player(motion)
    except MczError as error:
        why = reason_of(error)[:300]
        return f"<pre>{html.escape(repr(motion))}\n{html.escape(why)}</pre>"


def _player(motion: Moving) -> str:
    lines = figure(motion.skeleton)
    if not motion.n_frames:
        return f"<pre>{html.escape(repr(motion))}</pre>"
    rate = float(motion.frame_rate or UNKNOWN_RATE)
    n_points = len(lines.sides)
    nothing = np.empty((0, n_points, 3), "<i2")
    empty = PointSamples(nothing, 1.0, frames_read(motion), frames_read(motion), 0, 0.0, 0.0)
    room = MOST_BYTES - SPARE - len(_frame(motion, lines, empty, rate))
    most = room * 3 // 4 // (6 * n_points + TIME_BYTES)
    drawing = sample_points(motion, max(1, most), max(1, int(rate // RATE)))
    return _frame(motion, lines, drawing, rate)


def _frame(motion: Moving, lines: Figure, drawing: PointSamples, rate: float) -> str:
    document = {
        "caption": _caption(motion, drawing),
        "positions": base64.b64encode(drawing.words.tobytes()).decode(),
        "frames": len(drawing.words),
        "every": drawing.every,
        "total": motion.n_frames,
        "rate": rate / drawing.every,
        "times": _times(motion, drawing),
        "step": drawing.step,
        "bones": lines.bones,
        "sides": lines.sides,
        "up": drawing.up,
        "floor": drawing.floor,
        "radius": drawing.radius,
    }
    data = json.dumps(document, separators=(",", ":")).replace("<", "\\u003c")
    page = html.escape(_template().replace(PLACE, data))
    return (
        f'<iframe srcdoc="{page}" sandbox="allow-scripts" title="Motion" '
        f'style="border:0;width:100%;max-width:720px;height:{HEIGHT}px"></iframe>'
    )


def _times(motion: Moving, drawing: PointSamples) -> list[float] | None:
    """The times of the drawn frames to a millisecond, None if they are unknown."""
    if motion.timeline is None:
        return None
    times = motion.timeline.times[:: drawing.every][: len(drawing.words)]
    return [round(float(time), 3) for time in times]


def _caption(motion: Moving, drawing: PointSamples) -> str:
    rate = motion.frame_rate
    text = f"{quote_name(motion.name)}: {count_text(motion.n_frames, 'frame')}"
    text += " at an unknown rate" if rate is None else f" at {float(rate):g} Hz"
    if drawing.n_read < motion.n_frames:
        text += f"; frames 0 to {drawing.n_read - 1} are shown"
    if drawing.every > 1:
        text += f"; one frame in {drawing.every} is drawn"
    return text


@cache
def _template() -> str:
    return Path(__file__).with_name("player.html").read_text("utf-8")


MOST_POINTS = 4096
MOST_READ = 3000  # most frames of a clip that are decoded for a player
MOST_NUMBERS = 2**21  # most numbers that are decoded for a player
RATE = 30.0  # sufficient frames a second; the player interpolates
MISSING = -32768  # the word of an unknown coordinate
LARGEST = 32767
FARTHEST = 1e100  # farther coordinates count as missing: they would hide all others
Words = NDArray[np.int16]
Moving: TypeAlias = Motion | Clip


@dataclass(frozen=True, slots=True)
class Figure:
    """Constant parts: ``bones``, pairs of points; ``sides`` 0, 1 left, 2 right of points."""

    bones: list[tuple[int, int]]
    sides: list[int]


@dataclass(frozen=True, slots=True)
class PointSamples:
    """Words of (frames, points, 3), each ``step`` length units from the middle of the scene.

    Every ``every``-th of the first ``n_read`` frames. ``floor`` is the lowest coordinate along the
    axis ``up``, ``radius`` the greatest of all, both counted from the middle.
    """

    words: Words
    step: float
    every: int
    n_read: int
    up: int
    floor: float
    radius: float


def figure(skeleton: Skeleton) -> Figure:
    """The lines and sides; raises MotionError without points, or for too many."""
    points = list(listed_points(skeleton))
    if not 0 < len(points) <= MOST_POINTS:
        why = f"at most {MOST_POINTS:,} are drawn" if points else "there is nothing to draw"
        raise MotionError(f"{len(points):,} points: {why}")
    sides = [("", "left", "right").index(side) for side in sides_of(skeleton.addresses())]
    return Figure(lines_of(skeleton), [sides[joint] for joint, _ in points])


def sample_points(motion: Moving, most_frames: int, every: int = 1) -> PointSamples:
    """At most ``most_frames`` frames of a Motion or Clip; raises MczError for one without points.

    ``every`` is the least distance between two of them.
    """
    skeleton = motion.skeleton
    n_read = frames_read(motion)
    every = max(every, -(-n_read // max(1, most_frames)))
    places = positions_of(skeleton, _values(motion, n_read, every))
    places[~(np.abs(places) < FARTHEST).all(axis=2)] = np.nan
    axis = skeleton.up_axis or "y"
    places *= signs_of(axis)
    words, step, middle = _words(places)
    up = column_of(axis)
    known = places[np.isfinite(places).all(axis=2)] - middle
    floor = float(known[:, up].min(initial=0.0))
    return PointSamples(
        words, step, every, n_read, up, floor, float(np.abs(known).max(initial=0.0))
    )


def frames_read(motion: Moving) -> int:
    """Number of frames to show; a long clip, which must be decoded, is cut."""
    if isinstance(motion, Motion):
        return motion.n_frames
    return min(motion.n_frames, MOST_READ, MOST_NUMBERS // max(1, motion.n_channels) + 1)


def _values(motion: Moving, n_read: int, every: int) -> NDArray[np.float64]:
    """Every n-th frame, (n, n_channels), NaN where invalid."""
    if not motion.signals[0].has_poses:
        raise MotionError(
            "the channels of its motion signal differ from those of its skeleton", clip=motion.name
        )
    if isinstance(motion, Motion):
        signal = motion.signals[0]
        values = np.asarray(signal.values[:n_read:every], np.float64)
        valid = None if signal.mask is None else signal.mask[:n_read:every]
        return values if valid is None else np.where(valid, values, np.nan)
    return np.asarray(motion.read((0, n_read))[::every], np.float64)


def _words(places: NDArray[np.float64]) -> tuple[Words, float, NDArray[np.float64]]:
    """Coordinates as words, the size of a step, and the middle that they count from, (3,)."""
    known = places[np.isfinite(places).all(axis=2)]
    if not len(known):
        return np.full(places.shape, MISSING, "<i2"), 1.0, np.zeros(3)
    low, high = known.min(axis=0), known.max(axis=0)
    middle = (low + high) / 2
    step = float((high - low).max()) / 2 / LARGEST or 1.0
    with np.errstate(invalid="ignore"):
        scaled = np.rint((places - middle) / step)
    return np.where(np.isnan(scaled), MISSING, scaled).astype("<i2"), step, middle


def lines_of(skeleton: Skeleton) -> list[tuple[int, int]]:
    """The two points of each line: a joint and its parent, a joint and its end sites.

    Pictures have nodes (``mcz.show.pictures.bodies``), which include origins that are not points.
    """
    firsts = first_points(skeleton)
    pairs = []
    for point, (joint, _) in enumerate(listed_points(skeleton)):
        parent = skeleton.joints[joint].parent
        if point != firsts[joint] and skeleton.intrinsic:
            pairs.append((firsts[joint], point))
        elif parent >= 0:
            pairs.append((firsts[parent], point))
    return pairs


MOST_CLIPS = 12  # players on a page, of at most 300 kB each
TEMPLATE = """<!doctype html>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src \
'unsafe-inline'; style-src 'unsafe-inline'; connect-src 'self'">
<title>MCZ</title>
<style>:root{{color-scheme:light dark}}body{{font:14px system-ui,sans-serif;margin:1em}}</style>
<!-- mcz:embedded --><!-- mcz:end -->
<p>{notice}</p>
{players}
<script>new EventSource("alive");</script>
"""


def viewer_page(registry: FileRegistry) -> Page:
    """Return the viewer's page, or a small one if this installation has none.

    ``registry.report`` gets the reason. Raises AccessError if the environment names a missing page.
    """
    try:
        return page(registry.report)
    except AccessError as error:
        if os.environ.get(OTHER):
            raise
        reason = error.describe(registry.hints)
        registry.report(f"{reason}; the small player is shown instead")
        return small_page(registry, reason)


def small_page(registry: FileRegistry, reason: str) -> Page:
    """Return a page with a player of each clip, ``MOST_CLIPS`` of them at most."""
    notice = f"This is the small player: it only plays. {reason[:1].upper()}{reason[1:]}."
    players: list[str] = []
    for _, file in registry.initial_files():
        for text in _players(file, registry):
            if len(players) == MOST_CLIPS:
                notice += f" The first {MOST_CLIPS} clips are shown."
                return _page(notice, players)
            players.append(f"<h2>{html.escape(file.name)}</h2>\n{text}")
    return _page(notice, players)


def _page(notice: str, players: list[str]) -> Page:
    return Page(TEMPLATE.format(notice=html.escape(notice), players="\n".join(players)))


def _players(file: RegisteredFile, registry: FileRegistry) -> Iterator[str]:
    """Yield the player of each clip of a file, or the reason why it has none."""
    try:
        with mcz_open(file.target(), salvage=registry.salvage) as opened:
            yield from map(player, opened)
    except MczError as error:
        yield f"<pre>{html.escape(error.describe(registry.hints))}</pre>"
