"""The keys of metadata: what SPEC.md's registry has, and what a value of each looks like.

Values are checked when they are set, never when they are read.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import date, datetime

from mcz.errors import OptionError
from mcz.model.text_format import nearest

PRIVATE = "x-"
SPDX = re.compile(r"\(*[A-Za-z0-9.+:-]+\)*( (AND|OR|WITH) \(*[A-Za-z0-9.+:-]+\)*)*")
DOI = re.compile(r"10\.[0-9]{4,9}/\S+")
FRACTION = re.compile(r"(\.[0-9]{1,6})[0-9]{0,3}")  # of a second; datetime knows six digits


def _is_text(value: str) -> bool:
    return True


def _is_date(value: str) -> bool:
    """A year, a month or a day: 2014, 2014-05, 2014-05-21."""
    if not re.fullmatch(r"[0-9]{4}(-[0-9]{2}){0,2}", value):
        return False
    return _parses(date.fromisoformat, value + "-01" * (2 - value.count("-")))


def _is_time(value: str) -> bool:
    """A date and a time of day, perhaps with its difference from UTC, as ISO 8601 has them."""
    if not re.match(r"[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}", value):
        return False
    return _parses(datetime.fromisoformat, FRACTION.sub(r"\1", value))


def _parses(parse: Callable[[str], object], value: str) -> bool:
    try:
        parse(value)
    except ValueError:
        return False
    return True


TYPES: dict[str, Callable[[str], bool]] = {
    "text": _is_text,
    "date": _is_date,
    "time": _is_time,
    "SPDX": lambda value: SPDX.fullmatch(value) is not None,
    "DOI": lambda value: DOI.fullmatch(value) is not None,
}
EXAMPLES = {
    "date": "2014, 2014-05 or 2014-05-21",
    "time": "2014-05-21T14:30:00+02:00",
    "SPDX": "CC-BY-4.0",
    "DOI": "10.1000/182",
}

# The first three are about values and source of a clip, and not to be said behind it (META-03).
KEYS = {
    "name-encoding": "text",
    "skeleton-note": "text",
    "source-note": "text",
    "subject": "text",
    "scene": "text",
    "rights": "text",
    "credit": "text",
    "title": "text",
    "session": "text",
    "date": "date",
    "time": "time",
    "place": "text",
    "lab": "text",
    "system": "text",
    "marker-set": "text",
    "protocol": "text",
    "description": "text",
    "keywords": "text",
    "rights-holder": "text",
    "licence": "SPDX",
    "consent": "text",
    "contact": "text",
    "doi": "DOI",
    "mtime": "time",
}
SPELLINGS = {"license": "licence"}  # of keys as users may type them
INTERPRETED = tuple(KEYS)[:3]
SAID = tuple(KEYS)[3:]  # what users set


def check_said(key: str, value: str | None) -> None:
    """Raise OptionError for a key that is not to be set, or a value that it may not have.

    ``value`` None: it is to be removed.
    """
    if key in INTERPRETED:
        raise OptionError(f"{key!r} belongs to the values or the source of a clip, and stays")
    if key not in KEYS and not (key.startswith(PRIVATE) and len(key) > len(PRIVATE)):
        near = nearest(key, SAID)
        hint = f"did you mean {near}?" if near else f"registered are {', '.join(SAID)}"
        raise OptionError(
            f"metadata key {key!r} is not registered; {hint}; private keys begin with {PRIVATE!r}"
        )
    kind = KEYS.get(key, "text")
    if value is not None and not TYPES[kind](value):
        raise OptionError(f"{key} is {value!r}, not a {kind} such as {EXAMPLES[kind]}")
