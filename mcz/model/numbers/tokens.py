"""Numbers in text: their place, their notation, their binary64.

SPEC.md, "Decimal and binary64", is normative for ``nearest_double``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.errors import SourceError
from mcz.model.numbers import decimal_kernels as kernels
from mcz.model.numbers import token_kernels
from mcz.model.numbers.rules import EXACT_POWER, NAN, TENS
from mcz.model.text_format import quote
from mcz.model.types import Bools, Floats, Ints

_NAN_TEXT = re.compile(rb"[-+]?(nan(\(\w*\))?|\d\.#(q?nan|snan|ind)\d*)", re.IGNORECASE)  # TEXT-04
_INF_TEXT = re.compile(rb"[-+]?(inf(inity)?|\d\.#inf\d*)", re.IGNORECASE)  # TEXT-04


@dataclass(frozen=True, slots=True, eq=False)
class Texts:
    """Texts one after the other: text i is ``buffer[offsets[i]:offsets[i + 1]]``."""

    buffer: NDArray[np.uint8]
    offsets: Ints

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __getitem__(self, index: int) -> bytes:
        return self.buffer[self.offsets[index] : self.offsets[index + 1]].tobytes()

    def __iter__(self) -> Iterator[bytes]:
        return iter(self.tolist())

    def equal(self, other: Texts) -> Bools:
        """Mask of the equal texts; both have the same number of texts."""
        same_length = np.array_equal(self.offsets, other.offsets)
        if same_length and np.array_equal(self.buffer, other.buffer):
            return np.ones(len(self), np.bool_)
        sizes = np.diff(self.offsets)
        is_equal: Bools = sizes == np.diff(other.offsets)
        chosen = np.flatnonzero(is_equal & (sizes > 0))
        if len(chosen):
            n = sizes[chosen]
            first = np.cumsum(n) - n
            within = np.arange(first[-1] + n[-1]) - np.repeat(first, n)
            mine = self.buffer[within + np.repeat(self.offsets[chosen], n)]
            theirs = other.buffer[within + np.repeat(other.offsets[chosen], n)]
            is_equal[chosen] = ~np.logical_or.reduceat(mine != theirs, first)
        return is_equal

    def tolist(self) -> list[bytes]:
        whole = self.buffer.tobytes()
        edges = self.offsets.tolist()
        return [whole[a:b] for a, b in pairwise(edges)]


@dataclass(frozen=True, slots=True, eq=False)
class Tokens:
    """Tokens ``text[start[i]:stop[i]]`` and, in ``fields`` (n, 3), the notation of each.

    Indexing with a slice, a mask or an array of indices gives the Tokens chosen.
    """

    text: NDArray[np.uint8]
    start: Ints
    stop: Ints
    fields: Ints  # columns as in mcz.model.numbers.decimal_kernels
    known: list[Floats] = field(default_factory=list, repr=False)  # the values, once computed

    def __len__(self) -> int:
        return len(self.start)

    def __getitem__(self, index: Any) -> Tokens:
        if isinstance(index, int | np.integer):
            raise TypeError("a single token is a slice of one, or token(i)")
        fields = np.ascontiguousarray(self.fields[index])  # start and stop are copied on use
        known = [values[index] for values in self.known]
        return Tokens(self.text, self.start[index], self.stop[index], fields, known)

    def token(self, index: int) -> bytes:
        """The text of one token."""
        return self.text[self.start[index] : self.stop[index]].tobytes()

    def texts(self) -> Texts:
        """The texts of all tokens, copied out of the buffer."""
        sizes = self.stop - self.start
        offsets = np.concatenate(([0], np.cumsum(sizes)))
        indices = np.arange(offsets[-1]) + np.repeat(self.start - offsets[:-1], sizes)
        return Texts(self.text[indices], offsets)

    def bad(self) -> Bools:
        """Mask of the tokens that are not numbers; nan and inf are numbers here."""
        result: Bools = (self.fields[:, 2] & kernels.BAD) != 0
        return result

    def styled(self) -> Bools:
        """Mask of the tokens with a plus sign, or without a digit before their point."""
        result: Bools = (self.fields[:, 2] & (kernels.PLUS | kernels.NO_INTEGER)) != 0
        return result

    def values(self) -> Floats:
        """The nearest binary64 of each token; SourceError names the first that is not a number."""
        if not self.known:
            self.known.append(self._values())
        return self.known[0].copy()

    def _values(self) -> Floats:
        out, slow = np.empty(len(self)), np.zeros(len(self), np.bool_)
        if not kernels.values(self.fields, TENS, out, slow):
            return out
        slow_tokens = np.flatnonzero(slow)
        hard = self[slow_tokens]
        bad = np.flatnonzero(hard.bad())
        if len(bad):
            first = int(bad[0])
            raise SourceError(
                f"{quote(hard.token(first))} is not a number", offset=hard.start[first]
            )
        special = hard.fields[:, 2] & kernels.SPECIAL != 0
        texts = hard.texts().tolist()
        if special.any():
            pairs = zip(texts, special.tolist(), strict=True)
            out[slow_tokens] = [_value(t) if is_special else float(t) for t, is_special in pairs]
        else:
            out[slow_tokens] = list(map(float, texts))
        return out


def scan(
    text: bytes | memoryview | NDArray[np.uint8],
    start: Sequence[int] | Ints,
    stop: Sequence[int] | Ints,
) -> Tokens:
    """Describe the tokens ``text[start[i]:stop[i]]`` of a buffer; a view of it is kept."""
    whole = text.view() if isinstance(text, np.ndarray) else np.frombuffer(text, np.uint8)
    whole.flags.writeable = False  # the view is read-only
    start = np.ascontiguousarray(start, np.int64)
    stop = np.ascontiguousarray(stop, np.int64)
    fields = np.empty((len(start), 3), np.int64)
    n_bad = token_kernels.OUTSIDE
    if len(start) == len(stop):
        n_bad = token_kernels.scan(whole, start, stop, fields)
    if n_bad == token_kernels.OUTSIDE:
        raise IndexError(f"tokens lie outside a text of {len(whole)} bytes")
    tokens = Tokens(whole, start, stop, fields)
    for index in np.flatnonzero(fields[:, 2] & kernels.BAD).tolist() if n_bad else ():
        if not np.isfinite(_value(tokens.token(index), fallback=0.0)):
            fields[index, 2] = kernels.SPECIAL
    return tokens


def scan_texts(texts: Sequence[str]) -> Tokens:
    """Tokens of separate texts."""
    stop = np.cumsum([len(text) + 1 for text in texts], dtype=np.int64)
    start = np.concatenate(([0], stop))[:-1]
    return scan(" ".join((*texts, "")).encode(), start, stop - 1)


def values_of_texts(texts: Sequence[bytes]) -> tuple[Floats, Bools]:
    """The values of separate texts, and a mask of texts that are not numbers (value 0)."""
    stop = np.cumsum([len(text) + 1 for text in texts], dtype=np.int64)
    start = np.concatenate(([0], stop))[:-1]
    tokens = scan(b" ".join((*texts, b"")), start, stop - 1)
    bad = tokens.bad()
    values = np.zeros(len(texts))
    values[~bad] = tokens[~bad].values()
    return values, bad


def _value(text: bytes, fallback: float | None = None) -> float:
    """The binary64 of one token, by exact conversion; ``fallback`` if it is not a number."""
    if _NAN_TEXT.fullmatch(text):
        return float(NAN)
    if _INF_TEXT.fullmatch(text):
        return float("-inf" if text[:1] == b"-" else "inf")  # TEXT-04
    return float(text) if fallback is None else fallback


def nearest_double(mantissa: Ints, power: Ints) -> Floats:
    """The binary64 nearest to ``mantissa * 10^power``, mantissa >= 0; ties to even."""
    out, slow = scaled_double(mantissa, power)
    if slow.any():
        pairs = zip(mantissa[slow].tolist(), power[slow].tolist(), strict=True)
        out[slow] = [float(f"{m}e{p}") for m, p in pairs]
    return out


def scaled_double(mantissa: Ints, power: Ints) -> tuple[Floats, Bools]:
    """``mantissa * 10^power`` in binary64, and a mask of results that may not be the nearest.

    One product or quotient of two exact factors is correctly rounded: they are exact if the
    mantissa is at most 2^53 and the power at most 22 either way.
    """
    out = mantissa.astype(np.float64)
    np.divide(out, TENS[np.clip(-power, 0, EXACT_POWER)], out=out)
    if power.max(initial=0) > 0:
        np.multiply(out, TENS[np.clip(power, 0, EXACT_POWER)], out=out)
    slow = (mantissa > 2**53) | (np.abs(power) > EXACT_POWER)
    return out, slow & (mantissa != 0)
