"""Frames, one by one, to a film: GIF by Pillow, MP4 and WebM by PyAV. No frame is kept."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import Any, BinaryIO, Protocol

import numpy as np

from mcz.errors import OptionError
from mcz.show.pictures.canvases import Pixels, import_library

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
    """One palette for all; of each frame only the part that changed, unchanged pixels transparent.

    Pillow would keep every frame until the end, so it gets them one at a time.
    """

    def __init__(self, stream: BinaryIO, fps: Fraction) -> None:
        self._image = import_library("PIL.Image")
        self._gif = import_library("PIL.GifImagePlugin")
        self._stream, self._fps = stream, fps
        self._palette: Any = None
        self._before: Any = None
        self._waiting: tuple[Any, tuple[int, int], int] | None = None  # its time is not yet known
        self._count = 0

    def add(self, pixels: Pixels) -> None:
        image = self._image.fromarray(pixels)
        if self._palette is None:
            self._palette = image.quantize(COLORS, method=self._image.Quantize.MEDIANCUT)
        indices = np.asarray(image.quantize(palette=self._palette, dither=self._image.Dither.NONE))
        at = self._count
        self._count += 1
        if self._before is None:
            self._write_header(indices)
            part, corner = indices, (0, 0)
        else:
            changed = indices != self._before
            if not changed.any():
                return  # the frame before is shown longer
            rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
            box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
            part = np.where(changed[box], indices[box], COLORS).astype(np.uint8)
            corner = int(columns[0]), int(rows[0])
        self._flush(at)
        self._before, self._waiting = indices, (self._as_image(part), corner, at)

    def _as_image(self, indices: Any) -> Any:
        image = self._image.fromarray(np.ascontiguousarray(indices, np.uint8))
        image.putpalette(bytes(768))
        return image

    def _write_header(self, indices: Any) -> None:
        height, width = indices.shape
        palette = bytes(self._palette.getpalette("RGB")[: 3 * COLORS]).ljust(3 * 256, b"\0")
        size = width.to_bytes(2, "little") + height.to_bytes(2, "little")
        self._stream.write(b"GIF89a" + size + b"\xf7\0\0" + palette)
        self._stream.write(b"\x21\xff\x0bNETSCAPE2.0\x03\x01\0\0\0")  # again and again

    def _flush(self, until: int) -> None:
        if self._waiting is None:
            return
        image, corner, first = self._waiting
        ticks = round(until * TICK / self._fps) - round(first * TICK / self._fps)
        options = {"duration": 10 * max(2, ticks), "transparency": COLORS, "disposal": 1}
        for block in self._gif.getdata(image, corner, **options):
            self._stream.write(block)

    def close(self) -> None:
        self._flush(self._count)
        self._stream.write(b";")
