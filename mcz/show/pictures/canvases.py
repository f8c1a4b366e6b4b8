"""Pictures of lines, polygons and words, drawn by matplotlib as pixels or as SVG, and films.

A film is a GIF by Pillow, or MP4 and WebM by PyAV, written frame by frame; no frame is kept.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from types import ModuleType
from typing import TYPE_CHECKING, Any, BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError
from mcz.kinematics.chain import Floats
from mcz.model.extras import import_extra
from mcz.model.text_format import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


Pixels = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Word:
    """A line of text; ``x`` and ``y`` in pixels from the lower left corner."""

    x: float
    y: float
    text: str
    color: str
    size: float
    side: str = "left"  # of the text that is at x
    bold: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """Contents of one picture, from the back: lines, shadows, figures, words."""

    lines: tuple[Floats, Floats]
    shadows: tuple[Floats, Floats]
    figures: tuple[Floats, Floats]
    words: list[Word] = field(default_factory=list)


class Canvas:
    """Draws pictures of one size, one after the other; its artists are kept."""

    def __init__(self, width: int, height: int, theme: Theme) -> None:
        collections = import_library("matplotlib.collections")
        self.width, self.height = width, height
        self._figure = new_figure(width, height, facecolor=theme.ground)
        axes = self._figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.set_xlim(0, width)
        axes.set_ylim(0, height)
        self._axes = axes
        self._lines = collections.LineCollection([], linewidths=0.9)
        self._shadows = collections.PolyCollection([], linewidths=0)
        self._figures = collections.PolyCollection([], linewidths=0)
        for level, collection in enumerate((self._lines, self._shadows, self._figures)):
            axes.add_collection(collection, autolim=False)
            collection.set_zorder(level)
        self._words: dict[int, Any] = {}

    def draw(self, drawing: Drawing) -> None:
        self._lines.set_segments(drawing.lines[0])
        self._lines.set_color(drawing.lines[1])
        pairs = ((self._shadows, drawing.shadows), (self._figures, drawing.figures))
        for collection, (corners, colors) in pairs:
            collection.set_verts(corners)
            collection.set_facecolor(colors)
        for number, word in enumerate(drawing.words):
            self._place(number, word)
        for number in range(len(drawing.words), len(self._words)):
            self._words[number].set_text("")

    def _place(self, number: int, word: Word) -> None:
        if number not in self._words:
            self._words[number] = self._axes.text(0, 0, "", parse_math=False, zorder=3)
        text = self._words[number]
        text.set_position((word.x, word.y))
        text.set_text(printable(word.text))
        text.set_color(word.color)
        text.set_fontsize(word.size * 0.72)  # pixels as points of 100 dots an inch
        text.set_ha(word.side)
        text.set_va("baseline")
        text.set_fontweight("bold" if word.bold else "normal")

    def pixels(self) -> Pixels:
        """The picture as red, green, blue, uint8 (height, width, 3)."""
        with plot_context():
            canvas = self._figure.canvas
            canvas.draw()
            image = np.asarray(getattr(canvas, "buffer_rgba")())[:, :, :3]  # noqa: B009 - of Agg's
        return np.ascontiguousarray(image)

    def svg(self, stream: BinaryIO, title: str) -> None:
        """The picture as SVG."""
        with plot_context():
            about = {"Date": None, "Title": printable(title)}
            self._figure.savefig(stream, format="svg", metadata=about)


EXTRAS = {"matplotlib": "plot", "PIL": "plot", "av": "render"}
PACKAGES = {"PIL": "pillow", "av": "av (PyAV)"}


def import_library(name: str) -> ModuleType:
    """Import the module ``name``; OptionError names the extra of mcz if it is missing."""
    top = name.partition(".")[0]
    return import_extra(name, EXTRAS[top], package=PACKAGES.get(top, top), purpose="this picture")


def new_figure(width: int, height: int, **options: object) -> Figure:
    """A matplotlib figure of a size in pixels, without the global state of pyplot."""
    import_library("matplotlib")
    canvas = import_library("matplotlib.backends.backend_agg")
    figure: Figure = import_library("matplotlib.figure").Figure(
        figsize=(width / DPI, height / DPI), dpi=DPI, **options
    )
    canvas.FigureCanvasAgg(figure)
    return figure


DPI = 100
SVG = {"svg.fonttype": "path", "svg.hashsalt": "mcz", "axes.unicode_minus": False}


@contextmanager
def plot_context() -> Iterator[None]:
    """Draw letters that the font lacks as boxes, without a warning, and reproducible SVG."""
    matplotlib = import_library("matplotlib")
    with warnings.catch_warnings(), matplotlib.rc_context(SVG):
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        warnings.filterwarnings("ignore", message="Matplotlib currently does not support")
        yield


Color = tuple[float, float, float]  # red, green, blue, each 0 to 1


def rgb(text: str) -> Color:
    """
    >>> rgb("#ff0000")
    (1.0, 0.0, 0.0)
    """
    red, green, blue = (int(text[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


@dataclass(frozen=True, slots=True)
class Theme:
    """The colors of a picture; ``series`` are those of lines in plots."""

    ground: str
    ink: str
    quiet: str
    grid: str
    shadow: str
    left: str
    right: str
    middle: str
    series: tuple[str, ...]

    def sides(self) -> NDArray[np.float64]:
        """The colors of the middle, the left and the right, float64 (3, 3)."""
        return np.array([rgb(self.middle), rgb(self.left), rgb(self.right)])


THEMES = {
    "light": Theme(
        ground="#fbfbf9",
        ink="#1f2328",
        quiet="#6a7178",
        grid="#d9dcdf",
        shadow="#e4e5e4",
        left="#0072b2",
        right="#e08214",
        middle="#8d959e",
        series=("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#a07800", "#3aa0d8"),
    ),
    "dark": Theme(
        ground="#16191d",
        ink="#eceff1",
        quiet="#98a1a9",
        grid="#353b42",
        shadow="#0c0e10",
        left="#4ba9e4",
        right="#f0a13a",
        middle="#a7afb8",
        series=("#56b4e9", "#f0862f", "#1fc296", "#e394c0", "#e6c14a", "#9fd4f5"),
    ),
}


def theme_of(name: str) -> Theme:
    """The theme called ``name``; raises OptionError for an unknown one."""
    if name not in THEMES:
        raise OptionError(f"theme is {name!r}; it must be one of {', '.join(THEMES)}")
    return THEMES[name]


VIDEO = {
    "mp4": ("libx264", {"crf": "18", "preset": "medium"}),
    "webm": ("libvpx-vp9", {"crf": "28", "b": "0", "deadline": "good", "cpu-used": "4"}),
}
COLORS = 255  # of a GIF; one more means unchanged
TICK = 100  # a second in units of a GIF


class Film(Protocol):
    def add(self, pixels: Pixels) -> None: ...


@contextmanager
def film(stream: BinaryIO, kind: str, width: int, height: int, fps: Fraction) -> Iterator[Film]:
    """A film that takes frames, uint8 (height, width, 3), and is complete when the block ends."""
    if kind == "gif":
        gif = _Gif(stream, fps)
        yield gif
        gif.close()
        return
    av = import_library("av")
    codec, options = VIDEO[kind]
    with av.open(stream, "w", format=kind) as container:
        try:
            video = container.add_stream(codec, rate=fps)
        except (ValueError, OSError) as error:
            raise OptionError(f".{kind}: this build of PyAV has no {codec}: {error}") from None
        video.width, video.height, video.pix_fmt = width, height, "yuv420p"
        video.options = options
        yield _Video(container, video, av.VideoFrame)
        for packet in video.encode():
            container.mux(packet)


class _Video:
    def __init__(self, container: Any, video: Any, frame: Any) -> None:
        self._container, self._video, self._frame = container, video, frame

    def add(self, pixels: Pixels) -> None:
        frame = self._frame.from_ndarray(pixels, format="rgb24")
        for packet in self._video.encode(frame):
            self._container.mux(packet)


class _Gif:
    """A GIF with one palette; a frame has the changed part, its unchanged pixels transparent.

    Pillow would keep all frames in memory, so it gets them one by one.
    """

    def __init__(self, stream: BinaryIO, fps: Fraction) -> None:
        self._image = import_library("PIL.Image")
        self._gif = import_library("PIL.GifImagePlugin")
        self._stream, self._fps = stream, fps
        self._palette: Any = None
        self._last_indices: Any = None
        # The last image, its corner and number; its duration is unknown until the next one.
        self._pending: tuple[Any, tuple[int, int], int] | None = None
        self._count = 0

    def add(self, pixels: Pixels) -> None:
        image = self._image.fromarray(pixels)
        if self._palette is None:
            self._palette = image.quantize(COLORS, method=self._image.Quantize.MEDIANCUT)
        indices = np.asarray(image.quantize(palette=self._palette, dither=self._image.Dither.NONE))
        at = self._count
        self._count += 1
        if self._last_indices is None:
            self._write_header(indices)
            part, corner = indices, (0, 0)
        else:
            changed = indices != self._last_indices
            if not changed.any():
                return  # the previous frame lasts longer
            rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
            box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
            part = np.where(changed[box], indices[box], COLORS).astype(np.uint8)
            corner = int(columns[0]), int(rows[0])
        self._flush(at)
        self._last_indices, self._pending = indices, (self._as_image(part), corner, at)

    def _as_image(self, indices: Any) -> Any:
        image = self._image.fromarray(np.ascontiguousarray(indices, np.uint8))
        image.putpalette(bytes(768))
        return image

    def _write_header(self, indices: Any) -> None:
        height, width = indices.shape
        palette = bytes(self._palette.getpalette("RGB")[: 3 * COLORS]).ljust(3 * 256, b"\0")
        size = width.to_bytes(2, "little") + height.to_bytes(2, "little")
        self._stream.write(b"GIF89a" + size + b"\xf7\0\0" + palette)
        self._stream.write(b"\x21\xff\x0bNETSCAPE2.0\x03\x01\0\0\0")  # loop forever

    def _flush(self, until: int) -> None:
        if self._pending is None:
            return
        image, corner, first = self._pending
        ticks = round(until * TICK / self._fps) - round(first * TICK / self._fps)
        options = {"duration": 10 * max(2, ticks), "transparency": COLORS, "disposal": 1}
        for block in self._gif.getdata(image, corner, **options):
            self._stream.write(block)

    def close(self) -> None:
        self._flush(self._count)
        self._stream.write(b";")
