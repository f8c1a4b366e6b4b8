"""The relation of an output to the source file of its clip: one word, and notes on its times."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from mcz.errors import FormatError
from mcz.files.reading.clip import Clip
from mcz.files.reading.source_info import contradiction, is_one_of
from mcz.model.clock import usual_step
from mcz.sources import FORMATS, format_by_id

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip

RESTORED = "restored"  # the file whose SHA-256 is stored, byte for byte
CUT = "cut"  # some of its frames, with all numbers unchanged
LOSSY = "lossy"  # approximate numbers, printed like the source's
FILTERED = "filtered"  # numbers of a post filter
SALVAGED = "salvaged"  # its intact parts
CONVERTED = "converted"  # a file of another format, or numbers
GIVEN_BACK = (RESTORED, CUT, LOSSY)  # words for all of a clip


def fidelity_of(clip: Clip) -> str:
    """The word for the file that all of ``clip`` restores; the file of a sound clip is checked."""
    record: Mapping[str, str] = {}
    with suppress(FormatError):  # of a damaged file
        record = clip.quality or {}
    if "cut-resolution" in record or not all(info.codec.lossless for info in clip.signals):
        return LOSSY
    return CUT if "cut-frames" in record else RESTORED


UNTIMED = (
    "bvh",
    "npy",
    "npz",
    "pickle",
    "torch",
)  # with neither times, unless in an array, nor frame numbers


def _rate_note(clip: Clip, is_file: bool) -> str | None:
    """A note if the result of ``source_bytes`` states another rate than ``clip``.

    ``is_file``: it is the original file. Raises FormatError on bad bytes.
    """
    rate = clip.frame_rate
    if rate is None or clip.source is None:
        return None
    stated = _stated_rate(clip, rate, is_file=is_file)
    if stated is None:
        return None
    what = f"{float(stated):g} frames a second" if stated else "no frame rate"
    return f"its source states {what}, the clip has {float(rate):g}"


def _start_note(clip: Clip, start: int, is_file: bool) -> str | None:
    """A note if a part from frame ``start`` on is printed without the time of that frame.

    ``is_file``: the text is the original file, which never stated it.
    """
    source = clip.source
    if source is None or source.format not in UNTIMED or start >= clip.n_frames:
        return None
    if clip.timeline is None or clip.times_column() is not None or clip.times[start] == 0:
        return None
    if is_file and fidelity_of(clip) == RESTORED:
        return None
    name = source.format.upper()
    return f"left out: the time of the first frame, {clip.times[start]:.6g} s: {name} begins at 0 s"


def text_notes(clip: Clip, start: int = 0, *, is_file: bool | None = None) -> tuple[str, ...]:
    """All notes of the text of ``clip`` from frame ``start`` on; ``is_file``: None: of all."""
    is_file = clip.gives_file() if is_file is None else is_file
    notes = _rate_note(clip, is_file), _start_note(clip, start, is_file)
    return tuple(note for note in notes if note)


def states_rate(clip: Clip) -> bool:
    """Return whether the source of ``clip`` states a frame rate; raises FormatError."""
    rate, source = clip.frame_rate, clip.source
    if rate is None or source is None or not FORMATS[source.format].states_rate:
        return False
    stated_rate, _ = _read_contradiction(clip, rate)
    return stated_rate is None or bool(stated_rate.rate)


def _stated_rate(clip: Clip, rate: Fraction, *, is_file: bool) -> Fraction | None:
    """The rate that the text states, None if it is the clip's or absent."""
    try:
        stated_rate, template = _read_contradiction(clip, rate)
    except FormatError:
        if not clip.container.salvage:
            raise
        return None  # its loss is already reported
    if stated_rate is not None:
        stated: Fraction = stated_rate.rate
        return stated if is_file or stated_rate.template == template else None
    column = clip.times_column()
    if column is None:
        return None
    from mcz.sources.tables.times import rate_of_times

    own, _ = rate_of_times(column.times, [column.rounding])
    step = usual_step(clip.frame_numbers)
    return own if own is not None and not is_one_of(own / rate, step) else None


def _read_contradiction(clip: Clip, rate: Fraction) -> tuple[Any, bytes]:
    """The ``contradiction`` of the template of a clip, and the template."""
    source = clip._fields.source
    assert source is not None
    template = clip.container.template(source.template, source.format)
    name, step = format_by_id(source.format).name, usual_step(clip.frame_numbers)
    return contradiction(name, template, rate, step), template
