"""``mcz.render``: a motion as a film, a still or a sheet of poses."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import BinaryIO

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.files.writing.atomic import replacing
from mcz.hints import Hint, Remark
from mcz.kinematics.chain import Floats
from mcz.kinematics.frames import MOTION_OR_CLIP, Frames, MotionLike, frame_range
from mcz.kinematics.rest_pose import NO_LENGTHS, has_no_lengths
from mcz.model.checks import AXIS, FRAMES, PATH, check_arguments
from mcz.model.clock import Timeline
from mcz.model.types import Ints
from mcz.show.pictures.bodies import LEFT, RIGHT, Flags, track_of
from mcz.show.pictures.canvases import Canvas, Drawing, Theme, Word, film, import_library, theme_of
from mcz.show.pictures.capsules import Shapes, Viewport
from mcz.show.pictures.stages import MARGIN, Stage, drawing_of, label_texts, shorten, stage_of

FILMS = {".gif": Fraction(25), ".mp4": Fraction(30), ".webm": Fraction(30)}
STILLS = (".png", ".svg")
NEEDED = {
    ".gif": ("matplotlib", "PIL"),
    ".mp4": ("av", "matplotlib"),  # the extra that has av has both
    ".webm": ("av", "matplotlib"),
}
USUAL_RATE = Fraction(120)  # assumed frames a second: the rate of CMU's AMC files
SIZE, SIZE_OF_GIF = (640, 640), (480, 480)
SMALLEST, GREATEST = 64, 4096
FASTEST = 120  # frames a second of a film
MOST_POSES = 400
MOST_PICTURES = 10**6  # of a film

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, slots=True)
class Rendered:
    """A written rendering: ``n_pictures`` of ``width`` x ``height``, in ``n_bytes``.

    ``fps`` is None of a still. ``notes`` list assumptions.
    """

    path: str
    n_bytes: int
    n_pictures: int
    width: int
    height: int
    fps: float | None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Look:
    """Options of drawing; ``size`` None: the usual one, ``follow`` None: if needed."""

    view: str = "three-quarter"
    theme: Theme = field(default_factory=lambda: theme_of("light"))
    size: tuple[int, int] | None = None
    follow: bool | None = None


@check_arguments(motion=MOTION_OR_CLIP, path=PATH, frames=FRAMES, up=AXIS)
def render(
    motion: MotionLike,
    path: str | os.PathLike[str],
    *,
    frames: Frames = None,
    sheet: int | None = None,
    view: str = "three-quarter",
    theme: str = "light",
    size: tuple[int, int] | None = None,
    fps: float | Fraction | None = None,
    speed: float = 1.0,
    follow: bool | None = None,
    rate: float | Fraction | None = None,
    unit: str | None = None,
    up: str | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Rendered:
    """Draw a Motion or a Clip into ``path``: a film (.gif, .mp4, .webm) or a still (.png, .svg).

    A still is the middle one of ``frames`` (a, b), or with ``sheet`` that many poses, evenly over
    them. ``view`` "front", "side", "top" or "three-quarter" is relative to the first facing of the
    figure; ``theme`` "light" or "dark"; ``size`` (width, height) in pixels. A film has ``fps``
    pictures a second and plays ``speed`` times as fast as the motion was. ``follow``: the camera
    follows; None: only if the figure would be small otherwise. ``rate`` in frames a second,
    ``unit`` and ``up`` are for motions that state none; the result lists assumptions.

    Raises OptionError, also if a library is not installed, MotionError for a motion without points,
    ExistsError if ``path`` exists and ``force`` is not set.
    """
    suffix = _checked_suffix(path, sheet)
    look = Look(view, theme_of(theme), check_size(size), follow)
    notes: list[str] = []
    if has_no_lengths(motion.skeleton):
        notes.append(f"{NO_LENGTHS}: all joints lie at the root until rest offsets are set")
    timeline = _timeline(motion, rate)
    first, stop = frame_range(motion, frames)
    if first == stop:
        raise MotionError(f"{motion.name!r} has none of these frames: nothing to draw")
    report = progress or (lambda *_: None)
    job = _Job(motion, path, look, timeline, (unit, up), force, report, notes)
    if suffix in FILMS:
        film_rate = _fps(fps, FILMS[suffix])
        if timeline is None:
            text = f"its frame rate is unknown: {USUAL_RATE} a second assumed"
            notes.append(Remark(text, Hint.RATE))
            frames_shown = film_frames(first, stop, USUAL_RATE, film_rate, speed)
        else:
            frames_shown = first + _frames_by_time(
                timeline.cut(slice(first, stop)), film_rate, speed
            )
        return job.film(frames_shown, film_rate, suffix)
    if sheet is not None:
        return job.sheet(np.linspace(first, stop - 1, sheet).round().astype(np.int64))
    return job.still(np.array([(first + stop - 1) // 2], np.int64))


def _checked_suffix(path: str | os.PathLike[str], sheet: int | None) -> str:
    """The suffix of the picture, whose libraries are installed; raises OptionError."""
    suffix = Path(path).suffix.lower()
    if suffix not in (*FILMS, *STILLS):
        known = ", ".join((*FILMS, *STILLS))
        raise OptionError(f"a picture must be one of {known}, by its suffix", path=path)
    if sheet is not None and suffix in FILMS:
        raise OptionError("a sheet must be a .png or .svg, not a film", path=path)
    if sheet is not None and not 1 <= sheet <= MOST_POSES:
        raise OptionError(f"a sheet of {sheet} poses is not possible; draw 1 to {MOST_POSES}")
    for name in NEEDED.get(suffix, ("matplotlib", "PIL")):
        import_library(name)  # before any work
    return suffix


def check_size(size: tuple[int, int] | None) -> tuple[int, int] | None:
    """Return ``size``; OptionError if a picture cannot have it."""
    if size is not None and not all(SMALLEST <= each <= GREATEST for each in size):
        raise OptionError(
            f"the size is {size[0]} x {size[1]} pixels; each must be {SMALLEST} to {GREATEST}"
        )
    return size


def film_frames(first: int, stop: int, rate: Fraction, fps: Fraction, speed: float) -> Ints:
    """The frame that each picture of a film shows, the nearest in time; at least one.

    Raises OptionError for a speed that is not a positive number.
    """
    if not 0 < speed < np.inf:
        raise OptionError(f"speed is {speed:g}; it must be above 0")
    step = float(rate) * speed / float(fps)
    n_steps = (stop - 1 - first) / step + 1e-9 if step else np.inf
    if n_steps >= MOST_PICTURES:
        raise OptionError(
            f"the film would have {n_steps:.3g} pictures; the limit is {MOST_PICTURES:,}",
            hint=Hint.FILM,
        )
    count = max(1, int(n_steps) + 1)
    frames: Ints = (first + np.floor(np.arange(count) * step + 0.5)).astype(np.int64)
    return np.minimum(frames, stop - 1)


def _frames_by_time(timeline: Timeline, fps: Fraction, speed: float) -> Ints:
    """``film_frames`` by times: across a break in time the previous frame stays."""
    period = timeline.period or 1.0 / USUAL_RATE
    places = np.rint((timeline.regular_times - timeline.regular_times[0]) / period)
    rate, known = Fraction(1 / period).limit_denominator(2**20), timeline.rate
    rate = known if known and abs(float(known) * period - 1) < 1e-6 else rate or Fraction(1, 2**20)
    frames = film_frames(0, int(places[-1]) + 1, rate, fps, speed)
    return np.asarray(np.searchsorted(places, frames, side="right") - 1, np.int64)


def _timeline(motion: MotionLike, rate: float | Fraction | None) -> Timeline | None:
    """The times of frames, at the motion's or else the caller's rate; None while unknown."""
    if motion.timeline is not None or rate is None:
        return motion.timeline
    if not 0 < rate < np.inf:
        raise OptionError(f"frame rate {rate} must be positive")
    known = Fraction(rate).limit_denominator(2**20) or Fraction(1, 2**20)
    return Timeline(np.arange(motion.n_frames) / float(known), known)


def _fps(fps: float | Fraction | None, usual: Fraction) -> Fraction:
    if fps is None:
        return usual
    if not 0 < fps <= FASTEST:
        raise OptionError(f"fps is {float(fps):g}; it must be above 0 and at most {FASTEST}")
    return Fraction(fps).limit_denominator(1001)


@dataclass(frozen=True, slots=True)
class _Job:
    moving: MotionLike
    path: str | os.PathLike[str]
    look: Look
    timeline: Timeline | None  # None while unknown: no time is shown
    facts: tuple[str | None, str | None]  # unit and up axis of a motion without
    force: bool
    progress: Progress
    notes: list[str]

    def film(self, frames: Ints, fps: Fraction, suffix: str) -> Rendered:
        width, height = self.look.size or (SIZE if suffix != ".gif" else SIZE_OF_GIF)
        if suffix != ".gif":
            width, height = width // 2 * 2, height // 2 * 2  # required by these codecs
        stage = self._stage(frames, width, height, float(fps))
        canvas = Canvas(width, height, self.look.theme)
        with replacing(self.path, force=self.force) as stream:
            with film(stream, suffix[1:], width, height, fps) as add_frame:
                for number, (frame, nodes) in enumerate(stage.track):
                    self.progress(number, len(frames), f"frame {frame}")
                    words = label_texts(
                        stage, width, height, self.moving.name, self._time_text(frame)
                    )
                    canvas.draw(drawing_of(stage, number, nodes, words))
                    add_frame.add(canvas.pixels())
            size = stream.tell()
        return self._result(size, len(frames), width, height, float(fps))

    def still(self, frames: Ints) -> Rendered:
        width, height = self.look.size or SIZE
        stage = self._stage(frames, width, height, 1.0)
        canvas = Canvas(width, height, self.look.theme)
        ((frame, nodes),) = stage.track
        words = label_texts(stage, width, height, self.moving.name, self._time_text(frame))
        canvas.draw(drawing_of(stage, 0, nodes, words))
        return self._result(self._write_still(canvas), 1, width, height, None)

    def sheet(self, frames: Ints) -> Rendered:
        layout = sheet_size(len(frames), self.look.size)
        port = Viewport(0, 0, *layout.cell)
        # The camera has the same angle and distance for each pose.
        stage = self._stage(frames, *layout.cell, rate=0.0, follow=True, port=port, around=0.6)
        canvas = Canvas(layout.width, layout.height, self.look.theme)
        title = f"{self.moving.name}"
        canvas.draw(sheet_drawing(stage, layout, title, self._time_text))
        size = self._write_still(canvas)
        return self._result(size, len(frames), layout.width, layout.height, None)

    def _stage(
        self,
        frames: Ints,
        width: int,
        height: int,
        rate: float,
        follow: bool | None = None,
        port: Viewport | None = None,
        around: float = MARGIN,
    ) -> Stage:
        track = track_of(self.moving, frames, *self.facts)
        if track.up_assumed:
            self.notes.append(Remark(f"its up axis is unknown; {track.up} is assumed", Hint.UP))
        if port is None:
            port = Viewport(0, 0.06 * height, width, 0.87 * height)
        follow = self.look.follow if follow is None else follow
        return stage_of(track, self.look.theme, self.look.view, port, follow, rate, around)

    def _time_text(self, frame: int) -> str:
        if self.timeline is None:
            return f"frame {frame}"
        return f"frame {frame}  {self.timeline.regular_times[frame]:.2f} s"

    def _write_still(self, canvas: Canvas) -> int:
        with replacing(self.path, force=self.force) as stream:
            write_still(canvas, stream, Path(self.path).suffix.lower(), self.moving.name)
            return stream.tell()

    def _result(
        self, size: int, count: int, width: int, height: int, fps: float | None
    ) -> Rendered:
        return Rendered(str(self.path), size, count, width, height, fps, tuple(self.notes))


def write_still(canvas: Canvas, stream: BinaryIO, suffix: str, title: str) -> None:
    if suffix == ".svg":
        canvas.svg(stream, title)
        return
    image = import_library("PIL.Image").fromarray(canvas.pixels())
    image.save(stream, format="PNG", optimize=True)


CELL = (220, 300)  # pixels of a pose
WIDE = 1.9  # of a whole sheet, its approximate ratio of width to height
HEAD, FOOT, LABEL = 44, 10, 26  # pixels above all, below all, below each pose
LEAST_CELL = 60  # pixels of a cell


@dataclass(frozen=True, slots=True)
class Layout:
    """A sheet of ``columns`` x ``rows`` cells, ``cell`` (width, height) each, in pixels."""

    width: int
    height: int
    columns: int
    rows: int
    cell: tuple[int, int]


def sheet_size(count: int, size: tuple[int, int] | None) -> Layout:
    """The layout for ``count`` poses, on a sheet of that ``size`` if it is given; OptionError."""
    wide = WIDE if size is None else size[0] / size[1]
    per_cell = CELL[0] / (CELL[1] + LABEL)
    columns = min(count, max(1, round(math.sqrt(count * wide / per_cell))))
    rows = -(-count // columns)
    columns = -(-count // rows)
    if size is None:
        cell = CELL
        size = columns * CELL[0], rows * (CELL[1] + LABEL) + HEAD + FOOT
    else:
        cell = size[0] // columns, (size[1] - HEAD - FOOT) // rows - LABEL
    if min(cell) < LEAST_CELL:
        raise OptionError(f"a sheet of {size[0]} x {size[1]} pixels is too small for {count} poses")
    return Layout(*size, columns, rows, cell)


def sheet_drawing(stage: Stage, layout: Layout, title: str, when: Callable[[int], str]) -> Drawing:
    """The sheet as a drawing; ``when`` returns the text below a frame."""
    shadows, figures, lines, colors, words = Shapes(), Shapes(), [], [], []
    letter, theme = 12.0, stage.theme
    small = min(letter, layout.cell[0] / 12)
    for number, (frame, nodes) in enumerate(stage.track):
        row, column = divmod(number, layout.columns)
        left = column * layout.cell[0]
        bottom = layout.height - HEAD - row * (layout.cell[1] + LABEL) - layout.cell[1]
        camera = replace(stage.camera_of(number), view=Viewport(left, bottom, *layout.cell))
        pixels, shades = stage.floor(camera)
        inside = _within_cell(pixels, left, bottom, layout.cell)
        lines.append(pixels[inside])
        colors.append(shades[inside])
        stage.add(shadows, figures, camera, nodes)
        middle = left + layout.cell[0] / 2
        words.append(Word(middle, bottom - 0.62 * LABEL, when(frame), theme.quiet, small, "center"))
    top = layout.height - 0.64 * HEAD
    words += _heading(stage, layout, title, top, letter + 2)
    return Drawing(
        (np.concatenate(lines), np.concatenate(colors)), shadows.arrays(), figures.arrays(), words
    )


def _heading(stage: Stage, layout: Layout, title: str, top: float, letter: float) -> list[Word]:
    theme, edge = stage.theme, 14.0
    fits = max(4, int((layout.width - 260) / (0.66 * letter)))
    words = [Word(edge, top, shorten(title, fits), theme.ink, letter, bold=True)]
    x = layout.width - edge
    notes = [stage.grid_text]
    notes += [f"{stage.track.up} up assumed"] if stage.track.up_assumed else []
    for note in notes:
        words.append(Word(x, top, note, theme.quiet, letter - 2, "right"))
        x -= (len(note) + 2) * 0.62 * (letter - 2)
    sides = stage.track.body.sides[stage.track.body.drawn_nodes]
    if (sides == LEFT).any() and (sides == RIGHT).any():
        for text, color in (("right", theme.right), ("left", theme.left)):
            words.append(Word(x, top, f"\u25cf {text}", color, letter - 2, "right"))
            x -= (len(text) + 3) * 0.62 * (letter - 2)
    return words


def _within_cell(pixels: Floats, left: float, bottom: float, cell: tuple[int, int]) -> Flags:
    low, high = np.array([left, bottom]), np.array([left + cell[0], bottom + cell[1]])
    return np.asarray(((pixels >= low) & (pixels <= high)).all(axis=(1, 2)))
