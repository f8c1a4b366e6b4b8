"""Ways out of what an error or a remark is about: codes, which callers word."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum


class Hint(StrEnum):
    """The way out, as a code; ``PYTHON_HINTS`` words it for callers of this package."""

    BLENDER = "blender"
    CONVERT = "convert"
    ENCODE = "encode"
    FEET = "feet"
    FILM = "film"
    FORCE = "force"
    FORCE_RATE = "force-rate"
    FRAMES = "frames"
    JOBS = "jobs"
    KEEP_ALL = "keep-all"
    KEY_ERROR = "key-error"
    LARGE = "large"
    MAX_DECODED = "max-decoded"
    NAME_CODEC = "name-codec"
    OLD_FORMAT = "old-format"
    PAGE = "page"
    PORTABLE_NAMES = "portable-names"
    RATE = "rate"
    RECODE = "recode"
    RECODE_LOSSY = "recode-lossy"
    REPLACE = "replace"
    SALVAGE = "salvage"
    SERIES = "series"
    SKELETON = "skeleton"
    UNIT = "unit"
    UP = "up"
    VERBATIM = "verbatim"


Words = Mapping[Hint, str]

PYTHON_HINTS: Words = {
    Hint.BLENDER: "import it in Blender, then export it with the add-on of MCZ",
    Hint.CONVERT: "use mcz.convert for another format",
    Hint.ENCODE: "encode a source file with mcz.encode",
    Hint.FEET: "name the joints of feet (joints=)",
    Hint.FILM: "make it shorter (speed=, fps=, frames=)",
    Hint.FORCE: "use force to replace it",
    Hint.FORCE_RATE: "force_rate=True overrides it",
    Hint.FRAMES: "write only some of the frames (frames=)",
    Hint.JOBS: "jobs=1 needs less memory",
    Hint.KEEP_ALL: "keep_all=True keeps it",
    Hint.KEY_ERROR: "allow a larger error (key_error_mm=)",
    Hint.LARGE: "profile='large' allows more",
    Hint.MAX_DECODED: "raise it with max_decoded",
    Hint.NAME_CODEC: "name a codec to re-encode it",
    Hint.OLD_FORMAT: (
        "read it with the version of mcz that wrote it; tools/migrate_0_9 converts files of 0.9"
    ),
    Hint.PAGE: "select clips, choose a lossy codec, or allow more bytes",
    Hint.PORTABLE_NAMES: "names='portable' writes both",
    Hint.RATE: "set the frame rate (rate=)",
    Hint.RECODE: "recode=True re-encodes them",
    Hint.RECODE_LOSSY: "recode=True re-encodes them, which adds a small error",
    Hint.REPLACE: "replace it with mcz.append(replace=True)",
    Hint.SALVAGE: "salvage=True reads the intact parts, mcz.repair writes them to a valid file",
    Hint.SERIES: "choose channels by name (channels=)",
    Hint.SKELETON: "choose one with skeleton=, or 'none'",
    Hint.UNIT: "set the unit (unit=)",
    Hint.UP: "set the up axis (up=)",
    Hint.VERBATIM: "verbatim=True keeps the file as an attachment",
}


class Remark(str):
    """Words about a file or a clip, with a hint that callers may word in their own way."""

    words: str
    hint: Hint | None

    def __new__(cls, words: str, hint: Hint | None = None) -> Remark:
        remark = super().__new__(cls, with_hint(words, hint, PYTHON_HINTS))
        remark.words, remark.hint = words, hint
        return remark


def with_hint(words: str, hint: Hint | None, hints: Words) -> str:
    return words if hint is None else f"{words}; {hints[hint]}"


def split_hint(text: str) -> tuple[str, Hint | None]:
    """The words of ``text`` and the hint that it may have."""
    return (text.words, text.hint) if isinstance(text, Remark) else (text, None)


def with_worded_hint(text: str, hints: Words) -> str:
    """``text`` with the hint that it may have in the words of ``hints``."""
    return with_hint(*split_hint(text), hints)
