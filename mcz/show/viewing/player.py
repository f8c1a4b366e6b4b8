"""A motion as a small player for notebooks: HTML of at most 300 kB that needs nothing else.

It runs in a frame of its own, which can reach neither the notebook nor a network.
"""

from __future__ import annotations

import base64
import html
import json
from functools import cache
from pathlib import Path

import numpy as np

from mcz.errors import MczError, reason_of
from mcz.model.text_format import counted, shown
from mcz.show.viewing.player_data import RATE, Drawn, Figure, Moving, drawn, figure, frames_read

MOST_BYTES = 300_000
SPARE = 500  # bytes that numbers may have more than they had in the first try
TIME_BYTES = 12  # of the time of a frame, as text
HEIGHT = 420  # pixels
UNKNOWN_RATE = 30.0  # frames a second of a motion that does not say
PLACE = "/*data*/null"


def player(moving: Moving) -> str:
    """The HTML of a Motion or Clip; where nothing can be drawn, what it is and why not."""
    try:
        return _player(moving)
    except MczError as error:
        why = reason_of(error)[:300]
        return f"<pre>{html.escape(repr(moving))}\n{html.escape(why)}</pre>"


def _player(moving: Moving) -> str:
    lines = figure(moving.skeleton)
    if not moving.n_frames:
        return f"<pre>{html.escape(repr(moving))}</pre>"
    rate = float(moving.frame_rate or UNKNOWN_RATE)
    n_points = len(lines.sides)
    nothing = np.empty((0, n_points, 3), "<i2")
    empty = Drawn(nothing, 1.0, frames_read(moving), frames_read(moving), 0, 0.0, 0.0)
    room = MOST_BYTES - SPARE - len(_frame(moving, lines, empty, rate))
    most = room * 3 // 4 // (6 * n_points + TIME_BYTES)
    found = drawn(moving, max(1, most), max(1, int(rate // RATE)))
    return _frame(moving, lines, found, rate)


def _frame(moving: Moving, lines: Figure, found: Drawn, rate: float) -> str:
    document = {
        "caption": _caption(moving, found),
        "positions": base64.b64encode(found.words.tobytes()).decode(),
        "frames": len(found.words),
        "every": found.every,
        "total": moving.n_frames,
        "rate": rate / found.every,
        "times": _times(moving, found),
        "step": found.step,
        "bones": lines.bones,
        "sides": lines.sides,
        "up": found.up,
        "floor": found.floor,
        "radius": found.radius,
    }
    data = json.dumps(document, separators=(",", ":")).replace("<", "\\u003c")
    page = html.escape(_template().replace(PLACE, data))
    return (
        f'<iframe srcdoc="{page}" sandbox="allow-scripts" title="Motion" '
        f'style="border:0;width:100%;max-width:720px;height:{HEIGHT}px"></iframe>'
    )


def _times(moving: Moving, found: Drawn) -> list[float] | None:
    """The times of the drawn frames to a millisecond, None where they are unknown."""
    if moving.timeline is None:
        return None
    times = moving.timeline.times[:: found.every][: len(found.words)]
    return [round(float(time), 3) for time in times]


def _caption(moving: Moving, found: Drawn) -> str:
    rate = moving.frame_rate
    text = f"{shown(moving.name)}: {counted(moving.n_frames, 'frame')}"
    text += " at an unknown rate" if rate is None else f" at {float(rate):g} Hz"
    if found.n_read < moving.n_frames:
        text += f"; frames 0 to {found.n_read - 1} are shown"
    if found.every > 1:
        text += f"; one frame in {found.every} is drawn"
    return text


@cache
def _template() -> str:
    return Path(__file__).with_name("player.html").read_text("utf-8")
