"""Notes where a source states another frame rate than its clip has."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from mcz.clock import usual_step
from mcz.errors import FormatError
from mcz.formats import FORMATS, format_by_id
from mcz.formats.times import rate_of_times
from mcz.reading.clip import Clip
from mcz.reading.source_rates import contradiction, is_one_of


def rate_note(clip: Clip, *, is_file: bool) -> str | None:
    """A note where what ``source_bytes`` gives states another rate than ``clip`` has.

    ``is_file``: it gives the very file. Raises FormatError on bad bytes.
    """
    rate = clip.frame_rate
    if rate is None or clip.source is None:
        return None
    stated = _stated(clip, rate, is_file=is_file)
    if stated is None:
        return None
    what = f"{float(stated):g} frames a second" if stated else "no frame rate"
    return f"its source states {what}, the clip has {float(rate):g}"


def states_rate(clip: Clip) -> bool:
    """Whether the source of ``clip`` states a frame rate; raises FormatError on bad bytes."""
    rate, source = clip.frame_rate, clip.source
    if rate is None or source is None or not FORMATS[source.format].states_rate:
        return False
    found, _ = _contradicted(clip, rate)
    return found is None or bool(found.rate)


def _stated(clip: Clip, rate: Fraction, *, is_file: bool) -> Fraction | None:
    """The rate that the text states, None where it is that of the clip or none."""
    try:
        found, template = _contradicted(clip, rate)
    except FormatError:
        if not clip.container.salvage:
            raise
        return None  # it is lost, as is told
    if found is not None:
        stated: Fraction = found.rate
        return stated if is_file or found.template == template else None
    column = clip.times_column()
    if column is None:
        return None
    own, _ = rate_of_times(column.times, [column.rounding])
    step = usual_step(clip.frame_numbers)
    return own if own is not None and not is_one_of(own / rate, step) else None


def _contradicted(clip: Clip, rate: Fraction) -> tuple[Any, bytes]:
    """What ``contradiction`` says of the template of a clip, and the template."""
    source = clip._fields.source[0]
    template = clip.container.template(source.template, source.format)
    name, step = format_by_id(source.format).name, usual_step(clip.frame_numbers)
    return contradiction(name, template, rate, step), template
