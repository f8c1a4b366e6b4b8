"""Grid: ordinals to values, bits and text, and back. SPEC.md, "Number grids", is normative."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from construct import If, Int8ul, this

from mcz.errors import FormatError, OptionError
from mcz.model.numbers import rules
from mcz.model.numbers.rules import (
    CHECKED_KINDS,
    NAN,
    TENS,
    TEXT_KINDS,
    GridKind,
    binary32_magnitudes,
    binary32_values,
    binary64_values,
    general_magnitudes,
    general_split,
    scaled_magnitudes,
    vax_magnitudes,
    vax_swap,
    vax_values,
)
from mcz.model.numbers.text_grids import (
    grid_texts,
    match_tokens,
    printed_magnitudes,
    printed_shapes,
    printed_texts,
    printed_values,
    text32_values,
    token_ordinals32,
    uncertain_tokens,
)
from mcz.model.numbers.tokens import Texts, Tokens, nearest_double
from mcz.model.schema import FINITE, Adapted, Record
from mcz.model.schema import field as record_field
from mcz.model.types import Bools, Floats, Ints, Items, Values

MAX = np.finfo(np.float64).max
_IEEE = (GridKind.BINARY32, GridKind.BINARY64)


@dataclass(frozen=True, slots=True)
class Grid:
    """A number grid. SPEC.md, "Number grids", defines ``digits``, ``flags`` and ``style``.

    Arrays of ordinals and values may have any shape. Every int64 is an ordinal of a number or is
    refused with FormatError. Raises OptionError for digits, flags, a scale or a style out of range.
    """

    kind: GridKind
    digits: int = 0
    flags: int = 0
    scale: float = 1.0
    style: int = 0
    _hash: int = field(init=False, repr=False, compare=False)  # many grids are looked up in dicts

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "kind", GridKind(self.kind))
            object.__setattr__(self, "flags", int(self.flags))
            fault = rules.grid_fault(self.kind, self.digits, self.flags, self.scale, self.style)
        except (TypeError, ValueError) as error:
            raise OptionError(f"a grid of {self.kind!r}: {error}") from None
        if fault:
            raise OptionError(f"a {self.kind.name} grid cannot have {fault}")
        known = hash((int(self.kind), self.digits, self.flags, self.scale, self.style))
        object.__setattr__(self, "_hash", known)

    def __hash__(self) -> int:
        return self._hash

    @property
    def is_text(self) -> bool:
        return self.kind in TEXT_KINDS

    @property
    def signed_magnitude(self) -> bool:
        """True if ordinal -1 - m is minus the number of ordinal m."""
        return self.kind not in (GridKind.INTEGER, GridKind.SCALED)

    @property
    def limit(self) -> int:
        """The largest magnitude index, and the largest ordinal."""
        return rules.limit(self.kind, self.digits, self.style)

    @property
    def lowest(self) -> int:
        """The least ordinal: one below ``-limit`` if zero has a sign."""
        return -1 - self.limit if self.signed_magnitude else -self.limit

    def magnitudes(self, ordinals: Values) -> Ints:
        """Magnitude indices; raises FormatError for an ordinal without a number."""
        whole: Ints = np.ascontiguousarray(ordinals, np.int64)
        low, limit = self.lowest, self.limit
        if whole.size and not (low <= whole.min() and whole.max() <= limit):  # GRID-05
            wrong = whole.max() if whole.max() > limit else whole.min()
            raise FormatError(f"{wrong} is out of the range of {self}: {low} to {limit}")
        return whole ^ (whole >> 63) if self.signed_magnitude else np.abs(whole)

    def values(self, ordinals: Values) -> Floats:
        """The binary64 of each ordinal; every NaN is 0x7FF8000000000000."""
        ordinals = np.ascontiguousarray(ordinals, np.int64)
        magnitudes = self.magnitudes(ordinals)
        values: Floats
        match self.kind:
            case GridKind.FIXED | GridKind.TRIMMED:
                values = np.divide(magnitudes, TENS[self.digits])  # GRID-08
            case GridKind.GENERAL:
                values = nearest_double(*general_split(magnitudes, self.digits))
            case GridKind.TEXT64 | GridKind.BINARY64:
                values = binary64_values(magnitudes)
            case GridKind.TEXT32:
                values = text32_values(magnitudes)
            case GridKind.BINARY32:
                values = binary32_values(magnitudes)
            case GridKind.VAX_F:
                values = vax_values(magnitudes)
            case GridKind.PRINTED:
                values = printed_values(self.digits, self.style, magnitudes)
            case _:
                values = np.multiply(magnitudes, self.scale, dtype=np.float64)
        negative = ordinals < 0
        if self.kind == GridKind.VAX_F:
            values = np.where(negative & (values == 0), NAN, values)
        np.negative(values, where=negative & (values == values), out=values)  # GRID-09
        return values

    def ordinals(self, values: Values) -> tuple[Ints, Bools]:
        """The ordinal of each value, and whether ``values`` restores exactly these bits.

        A value outside of the grid has the ordinal of a nearest number, beyond the end the last
        one; NaN has 0. On IEEE grids infinities and the canonical NaN are numbers too.
        """
        values = np.ascontiguousarray(values, np.float64)
        negative = np.signbit(values)
        magnitudes = np.where(np.isnan(values), 0.0, np.abs(values))
        if self.kind not in (GridKind.BINARY32, GridKind.BINARY64):
            magnitudes = np.minimum(magnitudes, MAX)
        indices = np.minimum(self._indices(magnitudes), self.limit)
        ordinals = indices ^ -negative.astype(np.int64)
        if not self.signed_magnitude:
            ordinals = np.where(negative, -indices, indices)
        if self.kind == GridKind.VAX_F:  # its only zero has a plus sign
            ordinals = np.where(indices == 0, 0, ordinals)
        if self.kind in (GridKind.BINARY32, GridKind.BINARY64):
            nan = 0x7FC00000 if self.kind == GridKind.BINARY32 else 0x7FF8000000000000
            ordinals = np.where(np.isnan(values), nan, ordinals)
        exact = self.values(ordinals).view(np.int64) == values.view(np.int64)
        return ordinals, exact

    def _indices(self, values: Floats) -> Ints:
        match self.kind:
            case GridKind.FIXED | GridKind.TRIMMED:
                return scaled_magnitudes(values, TENS[self.digits], False, self.limit)
            case GridKind.GENERAL:
                return general_magnitudes(values.ravel(), self.digits).reshape(values.shape)
            case GridKind.TEXT64 | GridKind.BINARY64:
                return values.view(np.int64)
            case GridKind.TEXT32 | GridKind.BINARY32:
                return binary32_magnitudes(values)
            case GridKind.VAX_F:
                return vax_magnitudes(values)
            case GridKind.PRINTED:
                return printed_magnitudes(self.digits, values)
            case _:
                return scaled_magnitudes(values, self.scale, True, self.limit)

    def bits(self, ordinals: Values) -> Items:
        """The words of a BINARY32, BINARY64 or VAX_F grid as a file stores them, "<u4" or "<u8"."""
        wide = self._word_type() == "<u8"
        sign = np.int64(-(2**63)) if wide else np.int64(2**31)
        words = self.magnitudes(ordinals) | np.where(np.asarray(ordinals) < 0, sign, np.int64(0))
        if self.kind == GridKind.VAX_F:
            words = vax_swap(words)
        return words.view("<u8") if wide else words.astype("<u4")

    def ordinals_of_bits(self, words: Items) -> Ints:
        """The inverse of ``bits``: words as stored, read as little-endian u4 or u8."""
        kind = self._word_type()
        words = np.ascontiguousarray(words, kind)
        if kind == "<u8":
            signed = words.view("<i8").astype(np.int64)
            return np.where(signed < 0, ~(signed & np.int64(2**63 - 1)), signed)
        signed = words.astype(np.int64)
        if self.kind == GridKind.VAX_F:
            signed = vax_swap(signed)
        return np.where(signed >> 31, ~(signed & 0x7FFFFFFF), signed)

    def _word_type(self) -> str:
        if self.kind not in (*_IEEE, GridKind.VAX_F):
            raise OptionError(f"a {self.kind.name} grid has no bits")
        return "<u8" if self.kind == GridKind.BINARY64 else "<u4"

    def ordinals_of_tokens(self, tokens: Tokens) -> tuple[Ints, Bools]:
        """The ordinal of each token, and whether ``texts`` restores exactly its text.

        An exception, whose text is not restored, has the ordinal 0.
        """
        self._check_text()
        if self.kind == GridKind.PRINTED:
            return self._printed_ordinals(tokens)
        ordinals, known, _ = match_tokens(tokens, self.kind, self.digits, self.flags)
        if self.kind not in CHECKED_KINDS:
            return ordinals, known
        unsure = uncertain_tokens(tokens, self.kind, self.digits, known)
        known |= unsure
        chosen = tokens[known]
        if self.kind == GridKind.TEXT32:
            ordinals[known] = token_ordinals32(chosen)
        else:
            values = chosen.values()
            ordinals[known] = self.ordinals(values)[0]
            unsure &= ~_is_beyond(known, values)
            known &= ~_is_beyond(known, values)
        known[unsure] = self.texts(ordinals[unsure]).equal(tokens[unsure].texts())
        ordinals[~known] = 0
        return ordinals, known

    def _printed_ordinals(self, tokens: Tokens) -> tuple[Ints, Bools]:
        """``ordinals_of_tokens`` of a PRINTED grid: plausible tokens are printed, and compared."""
        known = printed_shapes(tokens, self.style)
        ordinals = np.zeros(len(tokens), np.int64)
        chosen = tokens[known]
        values = chosen.values()
        indices = np.minimum(self._indices(np.minimum(np.abs(values), MAX)), self.limit)
        ordinals[known] = indices ^ -np.signbit(values).astype(np.int64)
        is_equal = self.texts(ordinals[known]).equal(chosen.texts())
        known[known] = is_equal & np.isfinite(values)
        ordinals[~known] = 0
        return ordinals, known

    def exceptions(self, tokens: Tokens) -> int:
        """Count the tokens that this grid does not print."""
        return len(tokens) - int(np.count_nonzero(self.ordinals_of_tokens(tokens)[1]))

    def texts(self, ordinals: Ints) -> Texts:
        """The text of each ordinal; FormatError for one out of range."""
        self._check_text()
        ordinals = np.ascontiguousarray(ordinals, np.int64).ravel()
        if self.kind == GridKind.PRINTED:
            magnitudes = self.magnitudes(ordinals)
            return printed_texts(self.digits, self.style, self.flags, magnitudes, ordinals < 0)
        return grid_texts(
            self.kind, self.digits, self.flags, self.magnitudes(ordinals), ordinals < 0
        )

    def _check_text(self) -> None:
        if not self.is_text:
            raise OptionError(f"a {self.kind.name} grid has no text")


def printed_base(grid: Grid) -> Grid:
    """The grid that has the ordinals of a PRINTED one."""
    digits = grid.digits
    if digits in (rules.BASE_32, rules.BASE_64):
        return Grid(GridKind.TEXT32 if digits == rules.BASE_32 else GridKind.TEXT64)
    if digits > rules.BASE_GENERAL:
        return Grid(GridKind.GENERAL, digits - rules.BASE_GENERAL)
    return Grid(GridKind.FIXED, digits)


class GridFields(Record):
    """A number grid as bytes."""

    kind: int = record_field(Int8ul, "kind of grid")
    digits: int = record_field(Int8ul, "digits, by kind")
    flags: int = record_field(Int8ul, "print style, by kind")
    scale: float | None = record_field(
        If(this.kind == int(GridKind.SCALED), FINITE), "SCALED only: the unit"
    )
    style: int | None = record_field(
        If(this.kind == int(GridKind.PRINTED), Int8ul), "PRINTED only: print rule"
    )


def _grid_of(fields: GridFields) -> Grid:
    try:
        # GRID-01
        scale = 1.0 if fields.scale is None else fields.scale
        return Grid(GridKind(fields.kind), fields.digits, fields.flags, scale, fields.style or 0)
    except (OptionError, ValueError) as error:
        raise FormatError(f"{error}") from None


def _fields_of(grid: Grid) -> GridFields:
    return GridFields(
        kind=grid.kind, digits=grid.digits, flags=grid.flags, scale=grid.scale, style=grid.style
    )


GRID = Adapted(GridFields, _grid_of, _fields_of)


def _is_beyond(chosen: Bools, values: Floats) -> Bools:
    """Mask of all tokens beyond binary64; ``values`` are the values of ``chosen``.

    The greatest number, printed with fewer digits, reads as infinity: its text is an exception.
    """
    mask = np.zeros(len(chosen), np.bool_)
    mask[chosen] = ~np.isfinite(values)
    return mask


def grid_blocks(
    n_rows: int, grids: Sequence[Grid], changes: Sequence[tuple[int, int, Grid]]
) -> Iterator[tuple[slice, list[int], Grid]]:
    """Blocks (rows, columns, grid) that cover ``n_rows``; see ``Signal.grid_changes``."""
    cuts = sorted({0, n_rows, *(row for row, _, _ in changes)})
    current = list(grids)
    ordered = sorted(changes, key=lambda change: change[0])
    for start, stop in pairwise(cuts):
        for row, channel, grid in ordered:
            if row == start:
                current[channel] = grid
        for grid in dict.fromkeys(current):
            yield slice(start, stop), [c for c, g in enumerate(current) if g == grid], grid
