"""Encoder choice of the grid of a run of tokens; not normative."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import accumulate

import numpy as np

from mcz.model.numbers import decimal_kernels as kernels
from mcz.model.numbers import token_kernels
from mcz.model.numbers.grid import Grid
from mcz.model.numbers.rules import (
    BASE_32,
    BASE_64,
    BASE_GENERAL,
    CHECKED_KINDS,
    DECIMAL_KINDS,
    DECIMAL_LIMIT,
    EXPONENT,
    FIXED_TEXT,
    MOST_DECIMALS,
    SHORT_FIXED,
    SIGNIFICANT,
    TENS,
    GridFlag,
    GridKind,
)
from mcz.model.numbers.text_grids import match_tokens, printed_shapes, too_long
from mcz.model.numbers.token_kernels import Survey
from mcz.model.numbers.tokens import Tokens
from mcz.model.types import Bools, Floats, Ints

EXHAUSTIVE_TOKENS = 2**14  # for at most so many tokens all candidates are tried in order
_SAMPLE = 4096  # tokens of the sample that suggests candidates; all tokens are counted
# from one sampled token to the next: a prime, so that all columns are sampled
_STEP = 2_654_435_761
_EXCEPTION_BITS = 200  # estimated bits of row, channel and text
_DIGIT_BITS = 3.33
_SIGN_AND_RANGE_BITS = 8.0

Rule = tuple[GridKind, int, int, float, int]  # kind, digits, flags, scale, style
Candidate = tuple[float, Rule]  # bits of an ordinal, and the parameters of its grid


def bits_with_exceptions(n_tokens: int, bits: float, n_exceptions: int) -> float:
    return bits * n_tokens + _EXCEPTION_BITS * n_exceptions


def _survey(tokens: Tokens, n_counted: int) -> Survey:
    sizes = token_kernels.MOST_DECIMALS + 1, token_kernels.MOST_DIGITS + 1, token_kernels.N_STYLES
    survey = Survey(*(np.zeros(size, np.int64) for size in sizes))
    token_kernels.count_notations(tokens.fields, _STEP, n_counted, survey)
    return survey


def _candidates(tokens: Tokens, n_sample: int) -> list[Candidate]:
    """Grids worth a try for a sample of the tokens, from the fewest bits on."""
    survey = _survey(tokens, n_sample)
    candidates = [(bits, (*rule, 1.0, 0)) for bits, rule in _plain_candidates(survey)]
    n_known, n_plain = int(survey.significant.sum()), int(survey.decimals.sum())
    if 2 * (n_known - n_plain) > n_known or survey.significant[10:].any():
        candidates += printed_candidates(_sample_tokens(tokens, n_sample))
    return sorted(candidates)


def _sample_tokens(tokens: Tokens, n_sample: int) -> Tokens:
    return tokens[np.arange(n_sample) * _STEP % len(tokens)] if n_sample < len(tokens) else tokens


def _plain_candidates(survey: Survey) -> Iterator[tuple[float, tuple[GridKind, int, int]]]:
    decimals, significant = survey.decimals.tolist(), survey.significant.tolist()
    if not any(significant):
        yield 0.0, (GridKind.FIXED, 0, 0)
        return
    sign, tail, exponent = _styles(survey.styles.tolist())
    fixed = decimals.index(max(decimals))
    is_plain = any(decimals)
    if is_plain:
        point = GridFlag.POINT if fixed == 0 and tail == GridFlag.POINT else 0
        style = sign & ~GridFlag.NO_ZERO | point if fixed == 0 else sign
        if fixed <= 22:
            yield _bits(fixed), (GridKind.FIXED, fixed, style)
        for digits in _ends(decimals):
            if 1 <= digits <= 22:
                yield _bits(digits) + 1, (GridKind.TRIMMED, digits, sign | tail)
    flags = sign | tail | exponent
    for digits in sorted({*_ends(significant), 6}):
        if 1 <= digits <= 15:
            yield _bits(digits) + 2, (GridKind.GENERAL, digits, flags)
    if any(significant[7:]):
        yield 40.0, (GridKind.TEXT32, 0, flags)
    if any(significant[10:]):
        for digits in (0, 1, 16, 17):
            yield 64.0, (GridKind.TEXT64, digits, flags)
        if is_plain and 10 <= fixed <= 40:
            yield 66.0, (GridKind.TEXT64, FIXED_TEXT + fixed, 0)


def _bits(digits: int) -> float:
    return _SIGN_AND_RANGE_BITS + _DIGIT_BITS * digits


def _ends(histogram: Sequence[int]) -> list[int]:
    """The count that 99 % do not exceed, and the largest count."""
    ranks = list(accumulate(histogram))
    n = ranks[-1]
    return sorted({bisect_right(ranks, rank) for rank in (n - 1, (n * 99 - 1) // 100)})


def _styles(counts: Sequence[int]) -> tuple[int, int, int]:
    """Flags of the most common sign, leading zero, integral form and exponent."""
    kinds = token_kernels
    sign = GridFlag.PLUS if counts[kinds.SIGNED] > counts[kinds.UNSIGNED] else 0
    if counts[kinds.NO_ZERO] > counts[kinds.BARE_INTEGER]:
        sign |= GridFlag.NO_ZERO
    points, bare, zeros = (
        counts[style] for style in (kinds.POINT_ONLY, kinds.NO_POINT, kinds.POINT_ZERO)
    )
    tail = 0
    if points > bare and points > zeros:
        tail = int(GridFlag.POINT)
    elif zeros > points + bare:
        tail = int(GridFlag.POINT_ZERO)
    exponent = 0
    if counts[token_kernels.THREE] > counts[token_kernels.TWO]:
        exponent = int(GridFlag.EXPONENT3)
    elif counts[token_kernels.ONE] > counts[token_kernels.TWO_OF_ONE]:
        exponent = int(GridFlag.EXPONENT1)
    if counts[token_kernels.CAPITAL] > counts[token_kernels.SMALL]:
        exponent |= GridFlag.UPPER
    return int(sign), tail, int(exponent)


def choose_grid(tokens: Tokens, prefer: Sequence[Grid] = ()) -> Grid:
    """The grid of ``fit_grid``, for callers that need no ordinals."""
    return fit_grid(tokens, prefer)[0]


def fit_grid(tokens: Tokens, prefer: Sequence[Grid] = ()) -> tuple[Grid, Ints, Bools]:
    """The text grid that needs the fewest bytes for ``tokens``, exceptions included.

    Returned with the result of its ``ordinals_of_tokens``. The first of ``prefer`` without
    exceptions is chosen at once, as is the first that has no more exceptions than the best of all
    others.
    """
    if not (tokens.known or tokens.bad().any()):
        tokens.values()  # cached, since several grids need them
    preferred = []
    for grid in prefer:
        preferred.append((grid, *grid.ordinals_of_tokens(tokens)))
        if preferred[-1][2].all():
            return preferred[-1]
    n_sample = min(len(tokens), _SAMPLE)
    ranked = _candidates(tokens, n_sample)
    order: Sequence[int] = range(len(ranked))
    if len(tokens) > EXHAUSTIVE_TOKENS:
        order = _likeliest_first(_sample_tokens(tokens, n_sample), ranked)
    least = float("inf"), len(ranked)  # the lowest price, and the first candidate with it
    for rank in order:
        bits, rule = ranked[rank]
        if (bits_with_exceptions(len(tokens), bits, 0), rank) >= least:
            continue
        fit = _try_rule(tokens, rule, least[0] - bits_with_exceptions(len(tokens), bits, 0))
        misses = len(tokens) if fit is None else len(tokens) - int(np.count_nonzero(fit[1]))
        price = bits_with_exceptions(len(tokens), bits, misses), rank
        if fit is not None and price < least:
            least, fewest, best = price, misses, (Grid(*rule), *fit)
    return next((fitted for fitted in preferred if np.count_nonzero(~fitted[2]) <= fewest), best)


def _likeliest_first(sample: Tokens, ranked: Sequence[Candidate]) -> list[int]:
    """Move the candidate to the front that probably beats all others.

    The others are then given up early. Only grids that are quick to try come first.
    """
    prices = [
        bits_with_exceptions(len(sample), bits, _fewest_misses(sample, rule))
        if rule[0] in DECIMAL_KINDS
        else float("inf")
        for bits, rule in ranked
    ]
    first = prices.index(min(prices))
    return [first, *(rank for rank in range(len(ranked)) if rank != first)]


def _try_rule(tokens: Tokens, rule: Rule, spare: float) -> tuple[Ints, Bools] | None:
    """Ordinals and mask of printed tokens; None if exceptions cost more than ``spare`` bits."""
    kind, digits, flags, _, _ = rule
    allowed = int(min(spare / _EXCEPTION_BITS, len(tokens))) + 1  # a loose bound: prices decide
    if kind in DECIMAL_KINDS:
        ordinals, known, misses = match_tokens(tokens, kind, digits, flags, allowed)
        return (ordinals, known) if misses <= allowed else None
    if _fewest_misses(tokens, rule) > allowed:
        return None
    return Grid(*rule).ordinals_of_tokens(tokens)


def bits_of(grid: Grid) -> float:
    """Estimate the bits of an ordinal without context, for ``candidates``."""
    match grid.kind:
        case GridKind.TEXT32:
            return 40.0
        case GridKind.TEXT64:
            return 64.0
        case GridKind.PRINTED:
            return printed_bits(grid.digits, grid.style)
    return _bits(grid.digits)


def _fewest_misses(tokens: Tokens, rule: Rule) -> int:
    """Count tokens that their shape alone excludes, to spare grids that are costly to try."""
    kind, digits, flags, _, style = rule
    if kind == GridKind.PRINTED:
        return int(np.count_nonzero(~printed_shapes(tokens, style)))
    bound = match_tokens(tokens, kind, digits, flags)[2]
    if kind in CHECKED_KINDS and bound:
        bound -= int(np.count_nonzero(too_long(tokens)))
    return bound


NEARLY_ALL = 0.99  # of the tokens: a stray one costs little
MANY_BITS = 2.0**26  # numbers of decimals above this are not binary32


def printed_candidates(tokens: Tokens) -> Iterator[Candidate]:
    """Grids worth a try for a sample of the tokens, with the estimated bits of an ordinal."""
    shape = tokens.fields[:, 2]
    known = shape & (kernels.BAD | kernels.SPECIAL) == 0
    tokens, shape = tokens[known], shape[known]
    if not len(tokens):
        return
    with_exponent = shape & kernels.EXPONENT != 0
    decimals = np.minimum(shape >> kernels.FRACTION_DIGITS, 63)
    if np.count_nonzero(with_exponent) * 2 > len(tokens):
        yield from _exponents(tokens[with_exponent], decimals[with_exponent])
    significant = shape >> kernels.SIGNIFICANT & 31
    if significant.max() < 10:
        return
    values = np.abs(tokens.values())
    values = values[np.isfinite(values)]
    if not len(values):
        return
    plain = decimals[~with_exponent]
    fixed = int(np.bincount(plain).argmax()) if len(plain) else 0
    if significant.max() >= 16:
        for base in (*_decimals(values), BASE_64):
            if 16 < fixed <= MOST_DECIMALS:
                yield _with_bits(base, 0, SHORT_FIXED + fixed)
            if base != BASE_64:  # TEXT64 covers it
                yield _with_bits(base, 0, SIGNIFICANT + 17)
    if _are_binary32(values, values * 2e-16 * 5):
        for digits in (16, 17):
            yield _with_bits(BASE_32, 0, SIGNIFICANT + digits)
    many = 4 <= fixed <= 15 and np.median(values) * TENS[fixed] > MANY_BITS
    if many and _are_binary32(values, np.full(len(values), 0.51 / TENS[fixed])):
        yield _with_bits(BASE_32, 0, fixed)


def printed_bits(base: int, style: int) -> float:
    """Estimate the bits of an ordinal without context."""
    if base == BASE_32:
        return 7.0 + 3.33 * style if style < SHORT_FIXED else 40.5  # the first is below FIXED
    if base == BASE_64:
        return 66.0
    return 10.0 + 3.33 * (base if base < BASE_32 else base - BASE_GENERAL)


def _with_bits(base: int, flags: int, style: int) -> Candidate:
    return printed_bits(base, style), (GridKind.PRINTED, base, flags, 1.0, style)


def _exponents(tokens: Tokens, decimals: Ints) -> Iterator[Candidate]:
    """Candidates for numbers that mostly have exponents and equal digits: %.ne."""
    n = int(np.bincount(decimals).argmax())
    if n > MOST_DECIMALS:
        return
    shape, power = tokens.fields[:, 2], tokens.fields[:, 1]
    written, short = shape >> kernels.EXPONENT_DIGITS & 255, np.abs(power) < 100
    flags = 0
    if np.count_nonzero(short & (written == 3)) > np.count_nonzero(short & (written == 2)):
        flags = int(GridFlag.EXPONENT3)
    elif np.count_nonzero(written == 1) > np.count_nonzero((written == 2) & (np.abs(power) < 10)):
        flags = int(GridFlag.EXPONENT1)
    if np.count_nonzero(shape & kernels.UPPER) * 2 > len(tokens):
        flags |= int(GridFlag.UPPER)
    if np.count_nonzero(shape & kernels.PLUS) > np.count_nonzero(
        shape & (kernels.PLUS | kernels.MINUS) == 0
    ):
        flags |= int(GridFlag.PLUS)
    if n < 15:
        yield _with_bits(BASE_GENERAL + n + 1, flags, EXPONENT + n)
        return
    values = np.abs(tokens.values())
    values = values[np.isfinite(values)]
    for base in (*_decimals(values), BASE_64):
        yield _with_bits(base, flags, EXPONENT + n)
    if _are_binary32(values, np.zeros(len(values))):
        yield _with_bits(BASE_32, flags, EXPONENT + n)


def _decimals(values: Floats) -> Iterator[int]:
    for digits in range(1, 16):
        with np.errstate(over="ignore"):
            scaled = np.rint(values * TENS[digits])
        is_equal = (scaled / TENS[digits] == values) & (scaled <= DECIMAL_LIMIT)
        if len(values) and np.mean(is_equal) >= NEARLY_ALL:
            yield digits
            return


def _are_binary32(values: Floats, tolerance: Floats) -> bool:
    """Return True if nearly all values lie within ``tolerance`` of a binary32."""
    with np.errstate(over="ignore"):
        near = values.astype(np.float32).astype(np.float64)
    misses = np.abs(np.where(np.isfinite(near), near, 0.0) - values)
    return bool(len(values)) and float(np.mean(misses <= tolerance)) >= NEARLY_ALL
