"""Frame rates in templates of sources, and templates with another rate.

A clip may have another rate than its source states, once corrected. The original file is restored
unchanged; other files in its style state the rate of the clip.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

from mcz.errors import SourceError
from mcz.model.clock import SAME_RATE
from mcz.model.schema import build, parse
from mcz.sources.c3d.c3d import rate_of
from mcz.sources.c3d.layout import C3dOutputsTemplate, C3dTemplate
from mcz.sources.c3d.parameters import FLOAT, INTEGER, find_parameters, parse_parameters
from mcz.sources.c3d.recording import event_times
from mcz.sources.tables.layout import (
    PHRASES,
    Clock,
    ClockFields,
    SectionFields,
    TableTemplate,
    mark_phrases,
    parse_clock,
)
from mcz.sources.tables.times import DECIMAL, frame_rate, frame_time, stated_rate
from mcz.sources.text.layout import MAX_RUNS, Template

HEADER_RATE = 20  # where the header of a C3D has a binary32 of the rate
WHERE = "source template"
MOST_DECIMALS = 16
DECIMALS = 6  # of times
NEAR = 1e-4  # relative: what a frame time may be off

_FRAME_TIME = re.compile(rb"(?i)Frame\s+Time\s*:\s*([^\s]+)")
_TRC_KEYS = re.compile(rb"(?i)(?m)^[ \t]*(DataRate\b[^\r\n]*)\r?\n([^\r\n]*)")
_TRC_RATES = (b"datarate", b"camerarate", b"origdatarate")
_MOTIVE = re.compile(rb'(?i),"?(?:Capture|Export) Frame Rate"?,"?([0-9.]+)')
_VICON = re.compile(  # two lines above that of the axes
    rb'(?im)^"?([0-9.]+)[^\r\n]*\r?\n[^\n]*\n[ \t]*"?Frame"?[,;\t][ \t]*"?Sub Frame'
)
_MVNX = re.compile(rb"<subject\s[^<>]*?\bframeRate\s*=\s*[\"']([0-9.]+)[\"']")
_PHRASE_MARKS = re.compile(b"[" + re.escape(bytes(PHRASES)) + b"]")
_WORDS = re.compile(rb"[^\t ]+")


NONE = Fraction(0)


class Restated(NamedTuple):
    """The rate that a template states, 0 if that is none, and one that states another rate."""

    rate: Fraction
    template: bytes


def restate_bvh(template: bytes, rate: Fraction) -> Restated | None:
    """A template of BVH at another rate; None if it states none."""
    fields = parse(Template, template, WHERE, {"runs": MAX_RUNS})
    parts = [bytes(part) for part in fields.header]
    match = _FRAME_TIME.search(parts[-1]) if parts else None
    if match is None or not DECIMAL.fullmatch(match[1].decode("latin-1")):
        return None
    stated, _ = frame_rate(match[1].decode("latin-1"))
    text = _decimal_like(match[1], 1 / rate, lambda text: _is_time_of(text, rate))
    parts[-1] = _replace_text(parts[-1], match.span(1), text or frame_time(rate).encode())
    return Restated(stated or NONE, build(replace(fields, header=parts), WHERE))


def restate_c3d(template: bytes, rate: Fraction) -> Restated | None:
    """A template of C3D at another rate; None if it states none."""
    fields = parse(C3dTemplate, template, WHERE)
    head = _restated_head(fields, rate)
    return head and Restated(head.rate, build(replace(fields, head=head.template), WHERE))


def restate_outputs(template: bytes, rate: Fraction) -> Restated | None:
    """A template of C3D with outputs of models at another rate; None if it states none."""
    fields = parse(C3dOutputsTemplate, template, WHERE)
    head = _restated_head(fields.file, rate)
    if head is None:
        return None
    file = replace(fields.file, head=head.template)
    return Restated(head.rate, build(replace(fields, file=file), WHERE))


def _restated_head(shared: C3dTemplate, rate: Fraction) -> Restated | None:
    """The header of a C3D at another rate; unchanged if it cannot state that rate."""
    head = bytearray(shared.head)
    try:
        order, start = find_parameters(bytes(head))
    except SourceError:
        return None  # the parameters follow the data
    parameters = parse_parameters(bytes(head), order, start)
    stated = rate_of(bytes(head), parameters)[0] or NONE
    head[HEADER_RATE : HEADER_RATE + 4] = order.build_real(float(rate))
    rates = (("POINT", rate), ("ANALOG", rate * shared.subframes))
    for group, value in rates:
        parameter = parameters.get(group, "RATE")
        if parameter is None or parameter.type not in (FLOAT, INTEGER):
            continue
        if parameter.type == INTEGER and (value.denominator > 1 or value > 0xFFFF):
            return Restated(stated, shared.head)
        text = order.build_real(float(value)) if parameter.type == FLOAT else b""
        text = text or order.build_integer(int(value))
        head[parameter.at : parameter.at + len(text)] = text
    for at in event_times(bytes(head), parameters) if stated else ():
        time = order.real(bytes(head[at : at + 4]), 0) * float(stated / rate)
        head[at : at + 4] = order.build_real(time)
    return Restated(stated, bytes(head))


def restate_table(template: bytes, rate: Fraction) -> Restated | None:
    """A template of a table at another rate; None if neither a clock nor a header states one."""
    fields = parse(TableTemplate, template, WHERE, {"runs": MAX_RUNS})
    first = next((section for section in fields.sections if 0 in section.signals), None)
    if first is None:
        return None
    clock = parse_clock(first)
    stated = _header_rate(first) if clock is None else clock.numbers_per_second(rate)
    if stated is None:
        return None
    factor = rate / stated
    sections = []
    for section in fields.sections:
        header = _in_header(_text(section), factor)
        header = mark_phrases(header) if section.marks else header
        own = parse_clock(section)
        scaled = None if own is None else _scale_clock(own, factor)
        if own is not None and scaled is None:
            return Restated(stated, template)
        sections.append(replace(section, header=header, clock=scaled))
    return Restated(stated, build(TableTemplate(sections=sections), WHERE))


def _text(section: SectionFields) -> bytes:
    """The header with its phrases, but for the other marks."""
    header = bytes(section.header)
    if not section.marks:
        return header
    return _PHRASE_MARKS.sub(lambda mark: PHRASES[mark[0][0]], header)


def _header_rate(section: SectionFields) -> Fraction | None:
    """The rate that the header of a Vicon or MVNX file states."""
    text = _text(section)
    match = _VICON.search(text) or _MVNX.search(text)
    return stated_rate(match[1].decode("latin-1")) if match else None


def _in_header(header: bytes, factor: Fraction) -> bytes:
    """``header`` with all rates of the recording that it states multiplied."""
    patterns = _MOTIVE, _VICON, _MVNX
    places = [match.span(1) for pattern in patterns for match in pattern.finditer(header)]
    keys = _TRC_KEYS.search(header)
    if keys is not None:
        values = [match.span() for match in _WORDS.finditer(header, *keys.span(2))]
        named = zip(keys[1].split(), values, strict=False)
        places += [value for key, value in named if key.lower() in _TRC_RATES]
    for start, stop in sorted(places, reverse=True):
        old = stated_rate(header[start:stop].decode("latin-1"))
        if old is not None:
            rate = old * factor
            text = _decimal_like(header[start:stop], rate, _is_near(rate))
            header = _replace_text(header, (start, stop), text)
    return header


def _scale_clock(clock: Clock, factor: Fraction) -> ClockFields | None:
    """A clock whose times are divided by ``factor``; None if its terms are too large.

    It prints more decimals, up to ``DECIMALS``, if the times need them.
    """
    step = Fraction(clock.numerator, clock.denominator) / factor
    half = Fraction(1, 2)  # that rounds to the nearest time; an exact clock needs none
    old = Fraction(clock.offset, clock.denominator) - half * (1 - Fraction(1, clock.denominator))
    first, grid = old / factor, clock.grid
    while (step.denominator > 1 or first.denominator > 1) and grid.digits < DECIMALS:
        grid = replace(grid, digits=grid.digits + 1)
        step, first = step * 10, first * 10
    numerator, denominator = step.numerator * 2, step.denominator * 2
    offset = round((first + half) * denominator)
    if max(numerator, denominator, abs(offset)) >= 2**52:
        return None
    return ClockFields(grid=grid, numerator=numerator, denominator=denominator, offset=offset)


def _decimal_like(old: bytes, number: Fraction, means_it: Callable[[str], bool]) -> bytes:
    """``number`` with the decimals of ``old``, or more if it takes more; b"": none will do."""
    places = len(old.partition(b".")[2]) if re.fullmatch(rb"[0-9]*\.?[0-9]*", old) else 0
    texts = (f"{float(number):.{digits}f}" for digits in range(places, MOST_DECIMALS))
    return next((text.encode() for text in texts if float(text) and means_it(text)), b"")


def _is_time_of(text: str, rate: Fraction) -> bool:
    """Return True if a frame time means ``rate``, also if a reader takes its reciprocal."""
    return frame_rate(text)[0] == rate and abs(Fraction(text) * rate - 1) <= NEAR


def _is_near(rate: Fraction) -> Callable[[str], bool]:
    return lambda text: abs(Fraction(text) / rate - 1) <= SAME_RATE


def _replace_text(data: bytes, place: tuple[int, int], text: bytes) -> bytes:
    return data[: place[0]] + text + data[place[1] :]
