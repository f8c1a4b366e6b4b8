"""Which grids a run of tokens may be on. The choice is an encoder's, nothing here is normative."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mcz.numbers import printed, textgrids
from mcz.numbers.grid import Grid
from mcz.numbers.printed_choice import printed_bits, printed_candidates
from mcz.numbers.rules import CHECKED_KINDS, FIXED_TEXT, GridFlag, GridKind
from mcz.numbers.tokens import Bools, Ints, Tokens, kernels

_SAMPLE = 4096  # tokens that are looked at for candidates; all of them are counted
_EXCEPTION_BITS = 200  # row, channel and text, a guess
_DIGIT_BITS = 3.33
_SIGN_AND_RANGE_BITS = 8.0

Rule = tuple[GridKind, int, int, float, int]  # kind, digits, flags, scale, style
Candidate = tuple[float, Rule]  # bits of an ordinal, and what makes its grid


def cost(n_tokens: int, bits: float, n_exceptions: int) -> float:
    return bits * n_tokens + _EXCEPTION_BITS * n_exceptions


def candidates(tokens: Tokens) -> Iterator[Candidate]:
    """Grids worth a try."""
    if len(tokens) > _SAMPLE:  # a prime step, so that every column of a table is seen
        tokens = tokens[np.arange(_SAMPLE) * 2_654_435_761 % len(tokens)]
    for bits, rule in _plain_candidates(tokens.fields):
        yield bits, (*rule, 1.0, 0)
    yield from printed_candidates(tokens)


def _plain_candidates(fields: Ints) -> Iterator[tuple[float, tuple[GridKind, int, int]]]:
    """All grids but PRINTED."""
    loops = kernels()
    mantissa, power, shape = fields.T
    known = shape & (loops.BAD | loops.SPECIAL) == 0
    if not known.any():
        yield 0.0, (GridKind.FIXED, 0, 0)
        return
    shape, mantissa, power = shape[known], mantissa[known], power[known]
    plain = shape & loops.EXPONENT == 0
    decimals = np.minimum(shape >> loops.FRACTION_DIGITS, 63)
    significant = shape >> loops.SIGNIFICANT & 31
    sign, tail, exponent = _styles(mantissa, power, shape, decimals)

    if plain.any():
        fixed = int(np.bincount(decimals[plain]).argmax())
        point = GridFlag.POINT if fixed == 0 and tail == GridFlag.POINT else 0
        style = sign & ~GridFlag.NO_ZERO | point if fixed == 0 else sign
        if fixed <= 22:
            yield _bits(fixed), (GridKind.FIXED, fixed, style)
        for digits in _ends(decimals[plain]):
            if 1 <= digits <= 22:
                yield _bits(digits) + 1, (GridKind.TRIMMED, digits, sign | tail)
    flags = sign | tail | exponent
    for digits in sorted({*_ends(significant), 6}):
        if 1 <= digits <= 15:
            yield _bits(digits) + 2, (GridKind.GENERAL, digits, flags)
    if significant.max() > 6:
        yield 40.0, (GridKind.TEXT32, 0, flags)
    if significant.max() > 9:
        for digits in (0, 1, 16, 17):
            yield 64.0, (GridKind.TEXT64, digits, flags)
        if plain.any() and 10 <= fixed <= 40:
            yield 66.0, (GridKind.TEXT64, FIXED_TEXT + fixed, 0)


def _bits(digits: int) -> float:
    return _SIGN_AND_RANGE_BITS + _DIGIT_BITS * digits


def _ends(counts: Ints) -> list[int]:
    """The largest count, and the one that 99 % do not exceed: a stray long token costs little."""
    return sorted({int(counts.max()), int(np.sort(counts)[(len(counts) * 99 - 1) // 100])})


def _styles(mantissa: Ints, power: Ints, shape: Ints, decimals: Ints) -> tuple[int, int, int]:
    """Flags of the sign and the leading zero, of integral numbers, of the exponent: majorities."""
    loops = kernels()

    def many(chosen: np.ndarray, other: np.ndarray) -> bool:
        return int(np.count_nonzero(chosen)) > int(np.count_nonzero(other))

    plain = shape & loops.EXPONENT == 0
    sign = GridFlag.PLUS if many(shape & loops.PLUS, shape & (loops.PLUS | loops.MINUS) == 0) else 0
    if many(plain & (shape & loops.NO_INTEGER != 0), shape & loops.ZERO_INTEGER):
        sign |= GridFlag.NO_ZERO
    point = shape & loops.POINT != 0
    bare = plain & (decimals == 0)
    dot_zero = plain & (decimals == 1) & (mantissa % 10 == 0)
    tail = 0
    if many(bare & point, bare & ~point) and many(bare & point, dot_zero):
        tail = int(GridFlag.POINT)
    elif many(dot_zero, bare):
        tail = int(GridFlag.POINT_ZERO)
    written = shape >> loops.EXPONENT_DIGITS & 255
    short = ~plain & (np.abs(power) < 100)
    exponent = 0
    if many(short & (written == 3), short & (written == 2)):
        exponent = int(GridFlag.EXPONENT3)
    elif many(short & (written == 1), short & (written == 2) & (np.abs(power) < 10)):
        exponent = int(GridFlag.EXPONENT1)
    if many(shape & loops.UPPER, ~plain & (shape & loops.UPPER == 0)):
        exponent |= GridFlag.UPPER
    return int(sign), tail, int(exponent)


def choose_grid(tokens: Tokens, prefer: Sequence[Grid] = ()) -> Grid:
    """The grid of ``fit``, for who needs no ordinals yet."""
    return fit(tokens, prefer)[0]


def fit(tokens: Tokens, prefer: Sequence[Grid] = ()) -> tuple[Grid, Ints, Bools]:
    """The text grid that needs the fewest bytes for ``tokens``, exceptions counted.

    With it, what its ``ordinals_of_tokens`` gives. The first of ``prefer`` without exceptions is
    taken at once, and the first that has no more exceptions than the best of all others.
    """
    if not (tokens.known or tokens.bad().any()):
        tokens.values()  # several grids ask for them, and for those of some of the tokens
    wanted = []
    for grid in prefer:
        wanted.append((grid, *grid.ordinals_of_tokens(tokens)))
        if wanted[-1][2].all():
            return wanted[-1]
    least = float("inf")
    for bits, rule in sorted(candidates(tokens)):
        if cost(len(tokens), bits, 0) >= least:
            continue
        if cost(len(tokens), bits, _fewest_misses(tokens, rule)) >= least:
            continue
        grid = Grid(*rule)
        ordinals, known = grid.ordinals_of_tokens(tokens)
        misses = len(tokens) - int(np.count_nonzero(known))
        price = cost(len(tokens), bits, misses)
        if price < least:
            least, fewest, best = price, misses, (grid, ordinals, known)
    return next((fitted for fitted in wanted if np.count_nonzero(~fitted[2]) <= fewest), best)


def bits_of(grid: Grid) -> float:
    """About how many bits an ordinal has that nothing is known of, as ``candidates`` guesses."""
    match grid.kind:
        case GridKind.TEXT32:
            return 40.0
        case GridKind.TEXT64:
            return 64.0
        case GridKind.PRINTED:
            return printed_bits(grid.digits, grid.style)
    return _bits(grid.digits)


def _fewest_misses(tokens: Tokens, rule: Rule) -> int:
    """Tokens that the shape alone rules out, which spares grids that are costly to try."""
    kind, digits, flags, _, style = rule
    if kind == GridKind.PRINTED:
        return int(np.count_nonzero(~printed.plausible(tokens, style)))
    bound = textgrids.match(tokens, kind, digits, flags)[2]
    if kind in CHECKED_KINDS and bound:
        bound -= int(np.count_nonzero(textgrids.long(tokens)))
    return bound
