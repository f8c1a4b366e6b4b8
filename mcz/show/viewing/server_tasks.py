"""Tasks of the page's server (convert, re-encode, compare, export), its site and open pages."""

from __future__ import annotations

import os
import re
import shutil
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from itertools import islice
from pathlib import Path
from threading import BoundedSemaphore, Condition, Lock
from typing import Any, BinaryIO

from mcz.codecs.parameters import Dial
from mcz.errors import MczError, OptionError
from mcz.files.reading.clip import Clip
from mcz.files.reading.file import File
from mcz.files.reading.file import open as mcz_open
from mcz.files.reading.source_files import SourceOptions
from mcz.model.motion import Motion
from mcz.model.types import JsonObject, Params
from mcz.show.viewing.file_registry import FileRegistry, RegisteredFile, encode, kind_of, pack
from mcz.show.viewing.page import Page
from mcz.show.viewing.requests import (
    Readable,
    Refused,
    boundary_of,
    object_of,
    params_of,
    save_files,
    text_of,
)
from mcz.sources import FORMATS

MOST_POSTED = 2**30  # bytes of the files of an upload
MOST_WAITING = 8  # requests that wait for their turn
MOST_CACHED, CACHED_BYTES = 2, 2**28  # cached motions, and most bytes of one
RATIOS = ("cr_source", "cr_float32", "cr_40B")
BASIS = "basis"  # the only parameter that may name a file


class ServerTasks:
    """The tasks of a server, one at a time: each of them uses all processors."""

    most_posted = MOST_POSTED

    def __init__(self, registry: FileRegistry) -> None:
        self._registry = registry
        self._turn, self._waiting = Lock(), BoundedSemaphore(MOST_WAITING)
        self._cached: deque[tuple[object, Motion]] = deque(maxlen=MOST_CACHED)

    @contextmanager
    def turn(self, is_gone: Callable[[], bool] = lambda: False) -> Iterator[None]:
        """Wait for a turn; Refused if too many wait, or the client has left."""
        if not self._waiting.acquire(blocking=False):
            raise Refused(503, "too many requests are waiting")
        try:
            with self._turn:
                if is_gone():
                    raise Refused(499, "the client has left")
                yield
        finally:
            self._waiting.release()

    def document(self) -> JsonObject:
        """First document of the page: ``api.json``."""
        return {
            "version": import_module("mcz").__version__,
            "files": self.files(),
            "diff": len(self._registry.initial_files()) == 2,
            "salvage": self._registry.salvage,
            "codecs": lossy_codecs(),
            "canEncode": True,
            "canConvert": True,
            "canGlb": glb_writer() is not None,
            "suffixes": sorted({suffix for f in FORMATS.values() for suffix in f.suffixes}),
        }

    def files(self) -> list[JsonObject]:
        """The initial files; the size of one that is not converted yet is None."""
        return [
            {"name": file.name, "size": file.size, "url": url_of(number), "kind": file.kind}
            for number, file in self._registry.initial_files()
        ]

    def convert(self, stream: Readable, size: int, content_type: str) -> JsonObject:
        """Make an ``.mcz`` from uploaded files; several motions make one archive."""
        boundary = boundary_of(content_type)
        folder = self._registry.new_folder()
        try:
            paths = save_files(stream, size, boundary, folder)
            with self.turn():
                return self._convert_files(folder, paths)
        except OSError as error:
            raise Refused(507, f"cannot store the files: {error.strerror}") from None
        except MczError as error:
            if error.path is not None:
                error.path = error.path.removeprefix(f"{folder}{os.sep}")  # a private path
            raise
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _convert_files(self, folder: Path, paths: list[Path]) -> JsonObject:
        motions = [path for path in paths if path.suffix.lower() != ".asf"]
        if not motions:
            raise Refused(400, "no motion file was given")
        kinds = [kind_of(path) for path in motions]
        if "mcz" in kinds:
            raise OptionError("an .mcz needs no conversion; the page reads it directly")
        if len(motions) == 1:
            name, kind = motions[0].name, kinds[0]
            make = partial(encode, motions[0], facts=self._registry.facts)
        else:
            name, kind = f"{len(motions)} files", "folder"
            make = partial(pack, folder, registry=self._registry)
        number, stored = self._registry.upload(name, kind, make)
        return {"url": url_of(number), "name": name, "size": stored.size}

    def encode(self, request: Params) -> JsonObject:
        """Encode a clip again with a codec and its parameters; report the result."""
        from mcz.codecs import codec_by_name
        from mcz.files.reading.sizes import clip_sizes
        from mcz.files.writing.file import write

        codec, params = text_of(request, "codec"), params_of(request)
        codec_by_name(codec).options(params)
        refuse_files(params)
        unit = None if request.get("unit") is None else text_of(request, "unit")
        motion = SourceOptions(unit=unit).applied_to(self._motion(request))
        quality: dict[str, str] = {}

        def make(out: BinaryIO) -> None:
            written = write(motion, out, codec, **params)
            quality.update(written.clips[0].quality or {})

        began = time.monotonic()
        number, stored = self._registry.result(f"{motion.name} ({codec})", make)
        seconds = time.monotonic() - began
        with mcz_open(stored.target()) as file:
            payload = clip_sizes(file.container, file.only_clip()).payload
        return {
            "url": url_of(number),
            "name": stored.name,
            "size": stored.size,
            "payload": payload,
            "quality": quality,
            "seconds": round(seconds, 3),
        }

    def diff(self, request: Params) -> JsonObject:
        """Compare two clips, as ``mcz diff --by-joint --json`` does."""
        from mcz.files.reading.differences import document_of
        from mcz.files.reading.sizes import clip_ratios
        from mcz.kinematics.metrics.diff_document import diff_document

        sides = [object_of(request, key) for key in "ab"]
        ratios = []
        for side in sides:
            with self._open_clip(side) as (file, clip):
                ratios_of_clip = clip_ratios(file, clip)
                ratios.append({key: ratios_of_clip[key] for key in RATIOS})
        one, other = map(self._motion, sides)
        document = diff_document(one, other, by_joint=True)
        document |= {"differences": document_of(one, other)}
        document |= {"ratios_a": ratios[0], "ratios_b": ratios[1]}
        names = [self._file(side).name for side in sides]
        return {"a": names[0], "b": names[1], "clips": [document]}

    def glb(self, request: Params) -> bytes:
        """A clip as the bytes of a GLB."""
        writer = glb_writer()
        if writer is None:
            raise Refused(501, "this version writes no GLB")
        rate = request.get("rate")
        data: bytes = writer(self._motion(request), rate=rate).data
        return data

    def _file(self, request: Params) -> RegisteredFile:
        match = re.fullmatch(r"files/([0-9]{1,9})", text_of(request, "url"))
        try:
            return self._registry[int(match[1]) if match else -1]
        except KeyError:
            raise Refused(404, "no such file") from None

    @contextmanager
    def _open_clip(self, request: Params) -> Iterator[tuple[File, Clip]]:
        clip_key = request.get("clip")
        with mcz_open(self._file(request).target(), salvage=self._registry.salvage) as file:
            if isinstance(clip_key, int) and not isinstance(clip_key, bool):
                if not 0 <= clip_key < len(file):
                    raise Refused(
                        404, f"the file has {len(file)} clips, so there is no clip {clip_key}"
                    )
                yield file, next(islice(file, clip_key, None))
            elif clip_key is None or isinstance(clip_key, str):
                yield file, file.only_clip(clip_key or None)
            else:
                raise Refused(400, "clip must be a name or a number")

    def _motion(self, request: Params) -> Motion:
        """The motion of a clip; the last decoded ones are cached."""
        file = self._file(request)
        with closing(file.open()) as contents:
            key = (request["url"], contents.tag, request.get("clip"))
        for cached_key, motion in self._cached:
            if cached_key == key:
                return motion
        with self._open_clip(request) as (_, clip):
            motion = clip.motion()
        motion = self._registry.with_facts(motion)
        if sum(signal.values.nbytes for signal in motion.signals) <= CACHED_BYTES:
            self._cached.append((key, motion))
        return motion


def url_of(number: int) -> str:
    """URL of the file of a number, relative to the page."""
    return f"files/{number}"


@cache
def lossy_codecs() -> list[JsonObject]:
    """Lossy codecs for a slider: their parameters, and the range of the dial.

    Keys as in ``mcz codecs --json``, and ``dial``. The default, "lossy", comes first.
    """
    from mcz.codecs import CODECS, codec_by_name

    lossy = sorted(
        (codec for codec in CODECS.values() if not codec.lossless),
        key=lambda codec: codec is not codec_by_name("lossy"),
    )
    return [codec.document() | {"dial": dial_of(codec.dial)} for codec in lossy]


def dial_of(dial: Dial | None) -> JsonObject | None:
    """The parameter that trades quality for size, and its range."""
    if dial is None:
        return None
    return {
        "parameter": dial.parameter,
        "low": dial.low,
        "high": dial.high,
        "rises": dial.rises,
        "whole": dial.is_integer,
    }


def refuse_files(params: Params) -> None:
    """Raise OptionError for a basis in a file of this machine."""
    name = params.get(BASIS)
    if isinstance(name, str) and not re.fullmatch(r"[a-z0-9_]{1,40}", name):
        raise OptionError(f"{BASIS}: the page cannot choose files of this machine")


def glb_writer() -> Callable[..., Any] | None:
    """Writer of GLB; None if this version has none."""
    try:
        writer: Callable[..., Any] = import_module("mcz.exchange.conversion.scenes").to_glb
    except ModuleNotFoundError:
        return None
    return writer


@dataclass(slots=True)
class Site:
    """The page, files and tasks below ``token``; ``port`` is that of the server."""

    page: Page
    registry: FileRegistry
    tasks: ServerTasks
    open_pages: OpenPages
    token: str
    port: int = 0


PULSE = 0.5  # seconds between two checks, so that Ctrl-C works on every system


class OpenPages:
    """Counts open pages, each a context; ``grace``: seconds for a page to come back."""

    def __init__(self, grace: float) -> None:
        self._grace = grace
        self._n_open = self._n_seen = 0
        self.is_closing = False
        self._changed = Condition()

    def __enter__(self) -> OpenPages:
        with self._changed:
            self._n_open += 1
            self._n_seen += 1
            self._changed.notify_all()
        return self

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._n_open -= 1
            self._changed.notify_all()

    def close(self) -> None:
        """Release all waiting threads."""
        with self._changed:
            self.is_closing = True
            self._changed.notify_all()

    def stay(self, seconds: float) -> bool:
        """Wait for ``seconds``; return True if the page may stay open."""
        with self._changed:
            self._changed.wait_for(lambda: self.is_closing, seconds)
            return not self.is_closing

    def wait(self, *, for_ever: bool = False) -> None:
        """Wait until a page was open and all have been closed for ``grace`` seconds.

        ``for_ever``: until ``close``.
        """
        with self._changed:
            while not self.is_closing:
                seen = self._n_seen
                if for_ever or not seen or self._n_open:
                    self._changed.wait(PULSE)
                elif not self._changed.wait_for(partial(self._is_back, seen), self._grace):
                    return

    def _is_back(self, seen: int) -> bool:
        return self.is_closing or self._n_seen > seen
