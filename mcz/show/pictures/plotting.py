"""``mcz.plot``: numbers of a motion as a chart, in a picture or on a page with its tables."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from mcz.errors import OptionError
from mcz.files.reading.clip import Clip
from mcz.files.reading.source_files import SourceOptions
from mcz.kinematics.poses.motion_like import Frames, MotionLike, frame_range
from mcz.model.motion import Motion
from mcz.show.pictures.byte_charts import bytes_chart, rate_chart
from mcz.show.pictures.channel_charts import Selection, channel_chart, spectrum_chart
from mcz.show.pictures.charts import Chart, save
from mcz.show.pictures.error_charts import error_chart
from mcz.show.pictures.rendering import Progress, check_size

KINDS = ("channels", "spectrum", "error", "bytes", "rate-distortion")
CODECS = ("posewave", "mrdwt")  # of a chart of rate and distortion, by default


@dataclass(frozen=True, slots=True)
class Plotted:
    """A written plot: ``tables`` are the numbers of the chart, headings first, as text."""

    path: str
    what: str
    title: str
    tables: tuple[tuple[tuple[str, ...], ...], ...]
    notes: tuple[str, ...] = ()


def plot(
    moving: MotionLike,
    path: str | os.PathLike[str],
    what: str | None = None,
    *,
    other: MotionLike | None = None,
    joint: int | str | None = None,
    signal: int | str | None = None,
    channels: str | Sequence[str] | None = None,
    frames: Frames = None,
    codecs: Sequence[str] = CODECS,
    theme: str = "light",
    size: tuple[int, int] | None = None,
    rate: float | Fraction | None = None,
    unit: str | None = None,
    up: str | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Plotted:
    """Draw numbers of a Motion or a Clip into ``path``: a .png, a .svg, or a .html with its tables.

    ``what``: "channels" of ``joint`` over time (None: of the first that has any), or of another
    ``signal``, such as "analog", by their names in ``channels``; their "spectrum", the "error" of
    ``other`` against ``moving`` (the default if it is given), the "bytes" of a clip by joint and
    resolution, or "rate-distortion" at a few settings of lossy ``codecs``. Only ``frames`` (a, b)
    are drawn; ``rate``, ``unit`` and ``up`` are for motions that state none. A page has both
    themes. Raises OptionError, MotionError, ExistsError.
    """
    what = what or ("channels" if other is None else "error")
    if what not in KINDS:
        raise OptionError(f"unknown plot {what!r}; it must be one of {', '.join(KINDS)}")
    if (other is None) == (what == "error"):
        text = "takes the two that are compared" if what == "error" else "is of one motion"
        raise OptionError(f"a plot of {what} {text}")
    names = (channels,) if isinstance(channels, str) else channels
    selection = Selection(joint, signal, None if names is None else tuple(names))
    if selection != Selection() and what not in ("channels", "spectrum"):
        one = next(each for each in (joint, signal, names) if each is not None)
        raise OptionError(f"a plot of {what} shows all joints, so {one!r} cannot be chosen")
    size = check_size(size)
    cut = frame_range(moving, frames)
    facts = SourceOptions(rate=rate, unit=unit, up=up)
    chart = _chart(
        moving, what, other, selection, cut, codecs, facts, progress or (lambda *_: None)
    )
    save(chart, path, theme=theme, size=size, force=force)
    tables = tuple(tuple(map(tuple, table.rows)) for table in chart.tables)
    return Plotted(str(path), what, chart.title, tables, chart.notes)


def _chart(
    moving: MotionLike,
    what: str,
    other: MotionLike | None,
    selection: Selection,
    cut: tuple[int, int],
    codecs: Sequence[str],
    facts: SourceOptions,
    progress: Progress,
) -> Chart:
    if what == "bytes":
        if not isinstance(moving, Clip):
            raise OptionError("a plot of bytes needs an .mcz", clip=moving.name)
        return bytes_chart(moving)
    motion = _motion(moving, cut, facts)
    if other is not None:
        theirs = _motion(other, cut if other.n_frames == moving.n_frames else None, facts)
        return error_chart(motion, theirs, facts.up, cut[0])
    if what == "rate-distortion":
        return rate_chart(motion, codecs, progress)
    if what == "spectrum":
        return spectrum_chart(motion, selection)
    return channel_chart(motion, selection, cut[0])


def _motion(moving: MotionLike, cut: tuple[int, int] | None, facts: SourceOptions) -> Motion:
    if isinstance(moving, Motion):
        motion = moving
        if cut is not None and cut != (0, moving.n_frames):
            motion = moving.cut(*cut)
    else:
        clip: Any = moving
        motion = clip.motion(cut)
    return facts.completing(motion)
