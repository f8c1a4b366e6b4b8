"""The loops of ``deflate``: raw deflate (RFC 1951) against the matches that zlib's search finds.

SPEC.md, "Deflated contents", is normative.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.kernels import eight_bytes, kernel, put_eight_bytes
from mcz.kernels.types import Bytes, Ints, Ints2

STORED, FIXED, DYNAMIC = 0, 1, 2  # kinds of blocks
WINDOW = 1 << 15  # positions of the search, and values of its hash
MOST_DISTANCE = WINDOW - 262  # that the search looks back
SHORTEST, LONGEST = 3, 258  # bytes of a match
FAR = 4096  # a lazy search takes no match of three bytes beyond this distance
N_LITERALS, N_DISTANCES = 288, 32  # symbols of the two codes
BLOCK_END, FIRST_LENGTH = 256, 257  # symbols
MOST_BITS = 15  # of a code
SPARE = 16  # bytes that loops may read, or write as they are, beyond an end

# Items of the state of a search.
AT, INSERTED, LENGTH, DISTANCE = 0, 1, 2, 3

# Faults of ``join_stream``.
BAD_BLOCK, BAD_CODES, BAD_TOKEN, NO_CODE, LEFT_OVER = -1, -2, -3, -4, -5


class Effort(NamedTuple):
    """Parameters of a search, as zlib has them for each level."""

    good: int
    lazy: int
    nice: int
    chain: int
    is_greedy: int


class Search(NamedTuple):
    """A search in ``content``: ``latest`` (WINDOW,) is the last position of each hash, ``earlier``
    (WINDOW,) the one before each position, ``state`` (4,) where the search stands."""

    content: Bytes
    latest: Ints
    earlier: Ints
    state: Ints
    effort: Effort


class Codes(NamedTuple):
    """The codes of a block: ``lengths`` (320,) in bits, ``counts`` (2, 16) of each length,
    ``symbols`` (2, 320) in the order of their codes, ``bits`` (320,) the codes, first bit lowest;
    ``order`` (19,) is that of the code lengths in a DYNAMIC block."""

    lengths: Ints
    counts: Ints2
    symbols: Ints2
    bits: Ints
    order: Ints


def _bits(data: Bytes, at: int, n: int) -> int:
    """The ``n`` <= 16 bits from bit ``at`` on."""
    first = at >> 3
    word = int(data[first]) | int(data[first + 1]) << 8 | int(data[first + 2]) << 16
    return (word >> (at & 7)) & ((1 << n) - 1)


def _put_bits(out: Bytes, at: int, value: int, n: int) -> int:
    """Write ``n`` <= 32 bits at bit ``at``; return the bit after them."""
    put_eight_bytes(out, at >> 3, eight_bytes(out, at >> 3) | int(value) << int(at & 7))
    return at + n


def _insert(search: Search, stop: int) -> None:
    """Insert the positions before ``stop`` that are not yet."""
    content = search.content
    start = search.state[INSERTED]
    for at in range(start, min(stop, len(content) - 2)):
        key = _hash(content, at)
        search.earlier[at & (WINDOW - 1)] = search.latest[key]
        search.latest[key] = at
    search.state[INSERTED] = max(start, stop)


def _hash(content: Bytes, at: int) -> int:
    return ((int(content[at]) << 10) ^ (int(content[at + 1]) << 5) ^ int(content[at + 2])) & (
        WINDOW - 1
    )


def _longest(search: Search, at: int, best: int) -> tuple[int, int]:
    """Length and distance of the match at ``at`` that is longer than ``best``, else (best, 0)."""
    content = search.content
    effort = search.effort
    room = min(LONGEST, len(content) - at)
    distance = 0
    if room < SHORTEST or best >= room:
        return best, distance
    chain = effort.chain >> 2 if best >= effort.good else effort.chain
    nice = min(effort.nice, room)
    candidate = search.latest[_hash(content, at)]
    if candidate == 0 or at - candidate > MOST_DISTANCE:
        return best, distance
    while chain > 0:
        if content[candidate + best] == content[at + best]:
            length = 0
            while length < room and content[candidate + length] == content[at + length]:
                length += 1
            if length > best:
                best = length
                distance = at - candidate
                if length >= nice:
                    break
        candidate = search.earlier[candidate & (WINDOW - 1)]
        if candidate == 0 or at - candidate >= MOST_DISTANCE:
            break
        chain -= 1
    return best, distance


def _predict(search: Search) -> tuple[int, int]:
    """Length and distance of the token that the search makes next; a literal is (1, 0)."""
    state = search.state
    effort = search.effort
    at, length, distance = state[AT], state[LENGTH], state[DISTANCE]
    state[LENGTH] = 0
    if length == 0:
        _insert(search, at)
        length, distance = _longest(search, at, SHORTEST - 1)
        if length == SHORTEST and distance > FAR and not effort.is_greedy:
            length = 0
    if length < SHORTEST:
        return 1, 0
    if not effort.is_greedy and length < effort.lazy:
        _insert(search, at + 1)
        longer, its_distance = _longest(search, at + 1, length)
        if longer > length:
            state[LENGTH] = longer
            state[DISTANCE] = its_distance
            return 1, 0
    return length, distance


def _advance(search: Search, length: int) -> None:
    """Move on by a token of ``length`` bytes."""
    state = search.state
    if search.effort.is_greedy and length > search.effort.lazy:
        _insert(search, state[AT] + 1)
        state[INSERTED] = state[AT] + length
    state[AT] += length


def _skip(search: Search, n: int) -> None:
    """Move on by ``n`` stored bytes."""
    search.state[AT] += n
    search.state[LENGTH] = 0


def _fix_lengths(lengths: Ints) -> None:
    """Set the lengths of the codes of a FIXED block."""
    for symbol in range(N_LITERALS):
        lengths[symbol] = 8
    for symbol in range(144, 256):
        lengths[symbol] = 9
    for symbol in range(256, 280):
        lengths[symbol] = 7
    for symbol in range(N_DISTANCES):
        lengths[N_LITERALS + symbol] = 5


def _read_lengths(data: Bytes, at: int, end: int, codes: Codes) -> int:
    """Read the codes of a DYNAMIC block at bit ``at``; return the bit after them, -1 for a fault.

    ``end`` is the bit after the last; ``data`` has SPARE bytes beyond it.
    """
    if at + 14 > end:
        return -1
    n_literals = _bits(data, at, 5) + 257
    n_distances = _bits(data, at + 5, 5) + 1
    n_lengths = _bits(data, at + 10, 4) + 4
    at += 14
    if n_literals > 286 or n_distances > 30 or at + 3 * n_lengths > end:
        return -1
    lengths = codes.lengths
    for symbol in range(N_LITERALS + N_DISTANCES):
        lengths[symbol] = 0
    small = np.zeros(N_LITERALS + N_DISTANCES, np.int64)
    for k in range(n_lengths):
        small[codes.order[k]] = _bits(data, at, 3)
        at += 3
    if not _sort_symbols(small, 0, 19, 0, codes) or not _is_whole(codes, 0):
        return -1
    n = 0
    while n < n_literals + n_distances:
        symbol, at = _read_symbol(data, at, end, 0, codes)
        if symbol < 0 or at + 7 > end + 7:
            return -1
        repeats = 1
        value = symbol
        if symbol == 16:
            if n == 0:
                return -1
            value = small[n - 1]
            repeats = 3 + _bits(data, at, 2)
            at += 2
        elif symbol == 17:
            value = 0
            repeats = 3 + _bits(data, at, 3)
            at += 3
        elif symbol == 18:
            value = 0
            repeats = 11 + _bits(data, at, 7)
            at += 7
        if at > end or n + repeats > n_literals + n_distances:
            return -1
        for k in range(n, n + repeats):
            small[k] = value
        n += repeats
    for symbol in range(n_literals):
        lengths[symbol] = small[symbol]
    for symbol in range(n_distances):
        lengths[N_LITERALS + symbol] = small[n_literals + symbol]
    return at


def _sort_symbols(lengths: Ints, start: int, n: int, which: int, codes: Codes) -> bool:
    """Sort the ``n`` symbols from ``start`` on by their codes; False where they are no codes."""
    counts = codes.counts
    for length in range(MOST_BITS + 1):
        counts[which, length] = 0
    for symbol in range(n):
        counts[which, lengths[start + symbol]] += 1
    first = np.zeros(MOST_BITS + 2, np.int64)
    free = 1
    for length in range(1, MOST_BITS + 1):
        free = 2 * free - counts[which, length]
        if free < 0:
            return False
        first[length + 1] = first[length] + counts[which, length]
    for symbol in range(n):
        length = lengths[start + symbol]
        if length:
            codes.symbols[which, first[length]] = symbol
            first[length] += 1
    return True


def _read_symbol(data: Bytes, at: int, end: int, which: int, codes: Codes) -> tuple[int, int]:
    """A symbol at bit ``at`` and the bit after it; -1 where no code is."""
    word = _bits(data, at, MOST_BITS)
    code = 0
    first = 0
    index = 0
    for length in range(1, MOST_BITS + 1):
        code |= word & 1
        word >>= 1
        count = codes.counts[which, length]
        if code - count < first:
            if at + length > end:
                return -1, at
            return codes.symbols[which, index + code - first], at + length
        index += count
        first = 2 * (first + count)
        code <<= 1
    return -1, at


def _set_codes(codes: Codes, start: int, which: int) -> None:
    """Set the bits of the codes of sorted symbols."""
    code = 0
    index = 0
    for length in range(1, MOST_BITS + 1):
        code <<= 1
        for _ in range(codes.counts[which, length]):
            value = 0
            for bit in range(length):
                value |= ((code >> bit) & 1) << (length - 1 - bit)
            codes.bits[start + codes.symbols[which, index]] = value
            code += 1
            index += 1


def _is_whole(codes: Codes, which: int) -> bool:
    """Return True if every sequence of bits begins with a code."""
    free = 1
    for length in range(1, MOST_BITS + 1):
        free = 2 * free - codes.counts[which, length]
    return free == 0


def _sort_codes(codes: Codes) -> bool:
    """Sort the symbols of both codes of a block; False where they are not whole."""
    if not _sort_symbols(codes.lengths, 0, N_LITERALS, 0, codes):
        return False
    if not _sort_symbols(codes.lengths, N_LITERALS, N_DISTANCES, 1, codes):
        return False
    for which in range(2):
        n_used = 0
        for length in range(1, MOST_BITS + 1):
            n_used += codes.counts[which, length]
        is_short = n_used <= 1 and codes.counts[which, 1] == n_used
        if not is_short and not _is_whole(codes, which):
            return False
    return True


def _length_base(symbol: int) -> tuple[int, int]:
    """The least length of a symbol of lengths, and its extra bits."""
    k = symbol - FIRST_LENGTH
    if k < 8:
        return 3 + k, 0
    if k == 28:
        return LONGEST, 0
    extra = (k >> 2) - 1
    return 3 + ((4 + (k & 3)) << extra), extra


def _distance_base(symbol: int) -> tuple[int, int]:
    """The least distance of a symbol of distances, and its extra bits."""
    if symbol < 4:
        return 1 + symbol, 0
    extra = (symbol >> 1) - 1
    return 1 + ((2 + (symbol & 1)) << extra), extra


def _length_symbol(length: int) -> int:
    if length == LONGEST:
        return FIRST_LENGTH + 28
    k = length - SHORTEST
    extra = 0
    while k >> extra >= 8:
        extra += 1
    return FIRST_LENGTH + 4 * extra + (k >> extra)


def _distance_symbol(distance: int) -> int:
    k = distance - 1
    extra = 0
    while k >> extra >= 4:
        extra += 1
    return 2 * extra + (k >> extra)


@kernel
def split_stream(
    stream: Bytes, search: Search, codes: Codes, blocks: Ints2, corrections: Ints2
) -> tuple[int, int]:
    """Read the blocks of ``stream``, and where its tokens differ from those of the search.

    ``stream`` has SPARE bytes beyond its end. ``blocks`` (most, 4) become kind, tokens or bytes,
    and the bits where the codes begin and end; ``corrections`` (most, 3) the tokens since the last
    one, length and distance. Returns the number of each; -1 blocks where they or the corrections
    are too many, or the stream does not inflate to the content.
    """
    content = search.content
    end = 8 * (len(stream) - SPARE)
    at = 0
    n_blocks = 0
    n_corrections = 0
    since = 0
    state = search.state
    is_last = 0
    while not is_last:
        if n_blocks == len(blocks) or at + 3 > end:
            return -1, 0
        is_last = _bits(stream, at, 1)
        kind = _bits(stream, at + 1, 2)
        at += 3
        start = at
        n = 0
        if kind == STORED:
            at = (at + 7) >> 3 << 3
            if at + 32 > end:
                return -1, 0
            n = _bits(stream, at, 16)
            at += 32 + 8 * n
            if at > end or state[AT] + n > len(content):
                return -1, 0
            _skip(search, n)
        elif kind == FIXED:
            _fix_lengths(codes.lengths)
        elif kind == DYNAMIC:
            at = _read_lengths(stream, at, end, codes)
            if at < 0:
                return -1, 0
        else:
            return -1, 0
        blocks[n_blocks, 0] = kind
        blocks[n_blocks, 2] = start
        blocks[n_blocks, 3] = at
        if kind != STORED:
            if not _sort_codes(codes):
                return -1, 0
            while True:
                symbol, at = _read_symbol(stream, at, end, 0, codes)
                if symbol == BLOCK_END:
                    break
                if symbol < 0 or symbol > FIRST_LENGTH + 28 or state[AT] >= len(content):
                    return -1, 0
                length = 1
                distance = 0
                if symbol > BLOCK_END:
                    base, extra = _length_base(symbol)
                    length = base + _bits(stream, at, extra)
                    at += extra
                    symbol, at = _read_symbol(stream, at, end, 1, codes)
                    if symbol < 0 or symbol > 29:
                        return -1, 0
                    base, extra = _distance_base(symbol)
                    distance = base + _bits(stream, at, extra)
                    at += extra
                    if at > end or state[AT] + length > len(content):
                        return -1, 0
                likely_length, likely_distance = _predict(search)
                if length != likely_length or distance != likely_distance:
                    if n_corrections == len(corrections):
                        return -1, 0
                    corrections[n_corrections, 0] = since
                    corrections[n_corrections, 1] = length
                    corrections[n_corrections, 2] = distance
                    n_corrections += 1
                    since = 0
                    state[LENGTH] = 0
                else:
                    since += 1
                _advance(search, length)
                n += 1
        blocks[n_blocks, 1] = n
        n_blocks += 1
    if (at + 7) >> 3 != end >> 3 or state[AT] != len(content):
        return -1, 0
    return n_blocks, n_corrections


@kernel
def join_stream(
    search: Search, codes: Codes, blocks: Ints2, headers: Bytes, corrections: Ints2, out: Bytes
) -> int:
    """Write the stream of ``blocks`` (n, 4) to ``out``, which is 0; return its size, or a fault.

    ``blocks`` are kind, tokens or bytes, and the bytes of ``headers`` where the codes begin and
    end; ``headers`` and ``out`` have SPARE bytes beyond their ends.
    """
    content = search.content
    state = search.state
    at = 0
    correction = 0
    since = 0
    for block in range(len(blocks)):
        kind, n = blocks[block, 0], blocks[block, 1]
        at = _put_bits(out, at, 2 * kind + (block == len(blocks) - 1), 3)
        if kind == STORED:
            if n > 65535 or n > len(content) - state[AT]:
                return BAD_BLOCK
            at = (at + 7) >> 3 << 3
            at = _put_bits(out, at, n + ((n ^ 65535) << 16), 32)
            start = at >> 3
            for k in range(n):
                out[start + k] = content[state[AT] + k]
            at += 8 * n
            _skip(search, n)
            continue
        if kind == FIXED:
            _fix_lengths(codes.lengths)
        else:
            start, end = 8 * blocks[block, 2], 8 * blocks[block, 3]
            stop = _read_lengths(headers, start, end, codes)
            if stop < 0 or (stop + 7) >> 3 != end >> 3:
                return BAD_CODES
            while start < stop:
                size = min(16, stop - start)
                at = _put_bits(out, at, _bits(headers, start, size), size)
                start += size
        if not _sort_codes(codes):
            return BAD_CODES
        _set_codes(codes, 0, 0)
        _set_codes(codes, N_LITERALS, 1)
        for _ in range(n):
            if state[AT] >= len(content):
                return BAD_TOKEN
            length, distance = _predict(search)
            if correction < len(corrections) and since == corrections[correction, 0]:
                length, distance = corrections[correction, 1], corrections[correction, 2]
                if not _is_match(content, state[AT], length, distance):
                    return BAD_TOKEN
                state[LENGTH] = 0
                correction += 1
                since = 0
            else:
                since += 1
            at = _put_token(out, at, int(content[state[AT]]), length, distance, codes)
            if at < 0:
                return NO_CODE
            _advance(search, length)
        if codes.lengths[BLOCK_END] == 0:
            return NO_CODE
        at = _put_bits(out, at, codes.bits[BLOCK_END], codes.lengths[BLOCK_END])
    if state[AT] != len(content) or correction != len(corrections):
        return LEFT_OVER
    return (at + 7) >> 3


def _is_match(content: Bytes, at: int, length: int, distance: int) -> bool:
    """Return True if the token of that length and distance makes the content at ``at``."""
    if length == 1:
        return distance == 0
    if length < SHORTEST or length > min(LONGEST, len(content) - at):
        return False
    if distance < 1 or distance > min(WINDOW, at):
        return False
    for k in range(at, at + length):
        if content[k] != content[k - distance]:
            return False
    return True


def _put_token(out: Bytes, at: int, literal: int, length: int, distance: int, codes: Codes) -> int:
    """Write a token at bit ``at``; return the bit after it, -1 where a symbol has no code."""
    if length == 1:
        if codes.lengths[literal] == 0:
            return -1
        return _put_bits(out, at, codes.bits[literal], codes.lengths[literal])
    symbol = _length_symbol(length)
    if codes.lengths[symbol] == 0:
        return -1
    at = _put_bits(out, at, codes.bits[symbol], codes.lengths[symbol])
    base, extra = _length_base(symbol)
    at = _put_bits(out, at, length - base, extra)
    symbol = _distance_symbol(distance)
    if codes.lengths[N_LITERALS + symbol] == 0:
        return -1
    at = _put_bits(out, at, codes.bits[N_LITERALS + symbol], codes.lengths[N_LITERALS + symbol])
    base, extra = _distance_base(symbol)
    return _put_bits(out, at, distance - base, extra)
