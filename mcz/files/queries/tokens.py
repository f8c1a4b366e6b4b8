"""The text of a query as tokens, and errors that show where in the text they are."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from mcz.errors import OptionError
from mcz.files.queries.values import LONGEST_NUMBER, NUMBER, as_number
from mcz.model.text_format import shown

LONGEST = 4096  # characters of a query
AROUND = 24  # characters that an error shows on each side
WORDS = frozenset("and or not in like is missing true false".split())
# What other languages write, and what is written here.
FOREIGN = {"=": "==", "<>": "!=", "=>": ">=", "=<": "<=", "&&": "and", "||": "or", "!": "not"}

_TOKEN = re.compile(
    rf"""(?P<blank>\s+)
    | (?P<text>'(?:[^'\\]|\\.)*' | "(?:[^"\\]|\\.)*")
    | (?P<number>{NUMBER})
    | (?P<name>[^\W\d]\w*(?:[.-]+\w+)*)
    | (?P<sign>==|!=|<=(?!>)|>=|<(?!>)|>|[()\[\],])
    | (?P<foreign>&&|\|\||<>|=>|=<|=|!)""",
    re.VERBOSE | re.DOTALL,
)
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Token:
    """``kind`` is "name", "word", "text", "number", "sign" or "end"; ``at`` counts from 0.

    ``raw`` is as it is written, ``value`` what it means.
    """

    kind: str
    at: int
    raw: str
    value: str | int | float = ""

    def __str__(self) -> str:
        """As an error names it."""
        return "the end" if self.kind == "end" else shown(self.raw)


def fault(text: str, at: int, what: str) -> OptionError:
    """The error ``what`` at an offset of a query; it shows the column and the text around it."""
    before, after = text[max(at - AROUND, 0) : at], text[at : at + AROUND]
    left = "..." if at > AROUND else ""
    right = "..." if at + AROUND < len(text) else ""
    place = f"{left}{before}".strip() + " --> " + f"{after}{right}"
    return OptionError(f"where: column {at + 1}: {what} ({place.strip()})")


def tokens(text: str) -> Iterator[Token]:
    """The tokens of ``text``, at last one of kind "end"; raises OptionError."""
    if not isinstance(text, str):
        raise OptionError(f"where: {shown(repr(text))} is no text")
    if len(text) > LONGEST:
        raise OptionError(f"where: {len(text)} characters, {LONGEST} at most")
    at = 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise fault(text, at, _nothing_known(text[at]))
        kind, raw = str(match.lastgroup), match[0]
        if kind != "blank":
            yield _token(kind, at, raw, text)
        at = match.end()
    yield Token("end", at, "")


def _nothing_known(letter: str) -> str:
    if letter in "'\"":
        return f"the text that begins with {letter} has no end"
    return f"{shown(letter)} means nothing here"


def _token(kind: str, at: int, raw: str, text: str) -> Token:
    match kind:
        case "text":
            return Token(kind, at, raw, _unescaped(at, raw, text))
        case "number":
            number = as_number(raw)
            if number is None:
                limit = f"it has at most {LONGEST_NUMBER} characters and is finite"
                raise fault(text, at, f"{shown(raw)} is too great a number: {limit}")
            return Token(kind, at, raw, number)
        case "foreign":
            raise fault(text, at, f"{shown(raw)} means nothing here, write {FOREIGN[raw]}")
        case "name" if raw in WORDS:
            return Token("word", at, raw, raw)
        case _:
            return Token(kind, at, raw, raw)


def _unescaped(at: int, raw: str, text: str) -> str:
    r"""Unescape a quoted text: \' \" and \\ are the only escapes."""
    for match in _ESCAPE.finditer(raw):
        if match[1] not in "'\"\\":
            what = rf"{shown(match[0])} is no escape; these are: \' \" \\"
            raise fault(text, at + match.start(), what)
    return _ESCAPE.sub(r"\1", raw[1:-1])
