"""Representations of bounded length."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Iterable, Sequence
from dataclasses import fields
from itertools import islice
from typing import Any

WIDEST = 60  # characters of a name
MOST_LISTED = 40  # names in a message
ODD = re.compile(r"[^ -~]")  # characters that need a closer look; all others are plain
_FORMULA = re.compile(r"'*\s*[=+\-@\uff1d\uff0b\uff0d\uff20]|'*[\t\r\n]")
_SURROGATE = re.compile(r"[\ud800-\udfff]")
_NUMBER = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?", re.ASCII)
NEAR = 0.6  # of 1: similarity of a suggested name
_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxstring, _SHORT.maxother = 2, WIDEST, 160
_SHORT.maxtuple = _SHORT.maxlist = _SHORT.maxdict = 3


def quote_name(name: str) -> str:
    """A name in quotes, cut in the middle if it is long.

    >>> quote_name("walk"), len(quote_name("x" * 1000))
    ("'walk'", 60)
    """
    return _SHORT.repr_str(str(name), 1)


def named(word: str, name: str) -> str:
    """A thing in a message; many skeletons, such as those of BVH files, have no name.

    >>> named("skeleton", "05"), named("skeleton", "")
    ("skeleton '05'", 'the skeleton')
    """
    return f"{word} {name!r}" if name else f"the {word}"


def quote(word: str | bytes) -> str:
    """The start of a word of a source in quotes; bytes are Latin-1.

    >>> quote(b"OFF")
    "'OFF'"
    """
    return repr(word[:40] if isinstance(word, str) else word[:40].decode("latin-1"))


def is_utf8(name: str) -> bool:
    r"""Return whether a name of a file system is UTF-8, not bytes of another encoding.

    >>> is_utf8("größe"), is_utf8("gr\udcf6\udcdfe")
    (True, False)
    """
    return _SURROGATE.search(name) is None


COMPRESSIONS = {
    b"\x1f\x8b": "gzip",
    b"BZh": "bzip2",
    b"\xfd7zXZ\0": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"7z\xbc\xaf\x27\x1c": "7z",
}


def compression_remark(data: bytes) -> str | None:
    """A remark on a file that begins with ``data`` if another program compressed it.

    >>> compression_remark(b"\\x1f\\x8b\\x08")
    'it is compressed by gzip: decompress it first'
    """
    names = [name for start, name in COMPRESSIONS.items() if data.startswith(start)]
    return f"it is compressed by {names[0]}: decompress it first" if names else None


def shorten(text: str, most: int) -> str:
    """``text``, of which at most ``most`` characters are left, with invisible ones escaped.

    >>> shorten("LeftFoot", 20), shorten("LeftFoot", 5)
    ('LeftFoot', 'Left…')
    """
    return printable(text if len(text) <= most else f"{text[: most - 1]}…")


def printable(text: str, kept: str = "") -> str:
    r"""``text`` with invisible characters escaped, except those in ``kept``.

    They are control characters (C0, C1), characters that turn the direction of text, line ends of
    all sorts and unusual blanks. Bytes of file names that are not UTF-8 are shown as bytes.

    >>> print(printable("a\x1b[2Jb"), printable("a\u202eb"), printable("V\xe4sa"))
    a\x1b[2Jb a\u202eb Väsa
    >>> print(printable("V\udce4sa"))
    V\xe4sa
    """

    def escaped(match: re.Match[str]) -> str:
        letter = match[0]
        if letter.isprintable() or letter in kept:
            return letter
        if "\udc80" <= letter <= "\udcff":  # surrogateescape
            return f"\\x{ord(letter) - 0xDC00:02x}"
        return ascii(letter)[1:-1]

    return ODD.sub(escaped, text)


def spreadsheet_cell(text: str) -> str:
    """``text`` as a cell of CSV that spreadsheets do not run as a formula; see ``cell_text``.

    >>> [spreadsheet_cell(text) for text in ("=1+2", "'@a", "-5", "a=b")]
    ["'=1+2", "''@a", '-5', 'a=b']
    """
    return f"'{text}" if _FORMULA.match(text) and not _NUMBER.fullmatch(text) else text


def cell_text(cell: str) -> str:
    """The inverse of ``spreadsheet_cell``."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


def count_text(number: int, word: str) -> str:
    """
    >>> count_text(1, "joint"), count_text(31, "joint")
    ('1 joint', '31 joints')
    """
    return f"{number} {word}" if number == 1 else f"{number} {word}s"


def first_names(names: Sequence[str], most: int) -> str:
    """
    >>> first_names(["hips", "spine", "head"], 2)
    'hips, spine and 1 more'
    """
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more:,} more" if more > 0 else "")


def suggest_names(names: Sequence[str], missed: object) -> str:
    """Names for a message, and those that resemble ``missed``.

    >>> suggest_names(["hips", "head"], "haed")
    "hips, head; did you mean 'head'?"
    """
    more = f" ... ({len(names)} in all)" if len(names) > MOST_LISTED else ""
    near = nearest_names(missed, names) if isinstance(missed, str) else ""
    hint = f"; did you mean {near}?" if near else ""
    return f"{', '.join(names[:MOST_LISTED]) or 'no joints'}{more}{hint}"


def nearest_names(name: str, known: Iterable[str]) -> str:
    """The names most like ``name``, for a message; "" if there are none."""
    from difflib import get_close_matches

    by_lower: dict[str, str] = {}
    for one in known:
        by_lower.setdefault(one.lower(), one)
    matches = get_close_matches(name.lower(), list(by_lower), 3, NEAR)
    return " or ".join(repr(by_lower[one]) for one in matches)


def fields_text(instance: Any) -> str:
    """A dataclass as its fields; long ones as their first items and their number."""
    parts = (f"{f.name}={_value(getattr(instance, f.name))}" for f in fields(instance) if f.repr)
    return f"{type(instance).__name__}({', '.join(parts)})"


def _value(value: Any) -> str:
    shape = getattr(value, "shape", None)
    if shape is not None:
        return f"<{' x '.join(map(str, shape)) or 'scalar'} {value.dtype}>"
    if isinstance(value, (bytes, bytearray)) and len(value) > 32:
        return f"<{len(value)} bytes>"
    text = _SHORT.repr(value)
    n_items = len(value) if isinstance(value, (tuple, list, dict)) else 0
    return f"<{n_items}: {text}>" if n_items > 3 else text


def skeleton_text(skeleton: Any) -> str:
    known = skeleton.unit_cm is not None
    unit = f"1 unit = {skeleton.unit_cm:.6g} cm" if known else "unit unknown"
    counts = (
        f"{count_text(skeleton.n_joints, 'joint')}, {count_text(skeleton.n_channels, 'channel')}"
    )
    up_axis = f", {skeleton.up_axis} up" if skeleton.up_axis else ""
    return f"<Skeleton {quote_name(skeleton.name)}: {counts}, {unit}{up_axis}>"


def source_text(source: Any) -> str:
    return f"<Source {quote_name(source.path)}: {source.format}, {source.size} bytes>"


def clips_text(clips: Any) -> str:
    names = ", ".join(quote_name(name) for name in islice(clips, 3))
    more = f", ... ({len(clips)} in all)" if len(clips) > 3 else ""
    return f"<Clips of {quote_name(clips.file_name)}: {names}{more}>"


def exceptions_text(exceptions: Any) -> str:
    return f"<Exceptions: {count_text(len(exceptions), 'token')}>"


def signal_text(signal: Any) -> str:
    parts = [count_text(signal.n_frames, "frame"), count_text(signal.n_channels, "channel")]
    if signal.samples_per_frame > 1:
        parts.append(f"{signal.samples_per_frame} rows a frame")
    if signal.mask is not None and not signal.mask.all():
        parts.append(f"{count_text(int((~signal.mask).sum()), 'value')} invalid")
    return f"<Signal {quote_name(signal.name)}: {', '.join(parts)}>"


def motion_text(motion: Any) -> str:
    known = motion.frame_rate is not None
    rate = f"{float(motion.frame_rate):g} Hz" if known else "an unknown rate"
    parts = [count_text(motion.skeleton.n_joints, "joint")]
    parts.append(count_text(motion.signals[0].n_channels, "channel"))
    if len(motion.signals) > 1:
        parts.append(count_text(len(motion.signals), "signal"))
    frames = count_text(motion.n_frames, "frame")
    return f"<Motion {quote_name(motion.name)}: {frames} at {rate}, {', '.join(parts)}>"
