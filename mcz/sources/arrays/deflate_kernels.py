"""Kernels of `deflate`: the search of zlib for matches, and a stream against the tokens it finds.

SPEC.md, "Deflated contents", is normative.
"""

from __future__ import annotations

from typing import NamedTuple

from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Ints, Ints2
from mcz.sources.arrays.deflate_codes import (
    BLOCK_END,
    DYNAMIC,
    FIRST_LENGTH,
    FIXED,
    LONGEST,
    N_LITERALS,
    SHORTEST,
    SPARE,
    STORED,
    Codes,
    distance_base,
    length_base,
    put_bits,
    put_token,
    read_bits,
    read_lengths,
    read_symbol,
    set_codes,
    set_fixed_lengths,
    sort_codes,
)

WINDOW = 1 << 15  # positions of the search, and values of its hash
MOST_DISTANCE = WINDOW - 262  # that the search looks back
FAR = 4096  # a lazy search takes no match of three bytes beyond this distance

# Items of the state of a search.
AT, INSERTED, LENGTH, DISTANCE = 0, 1, 2, 3


class Effort(NamedTuple):
    """Parameters of a search, as zlib has them for each level."""

    good: int
    lazy: int
    nice: int
    chain: int
    is_greedy: int


class Search(NamedTuple):
    """A search in ``content``.

    ``latest`` (WINDOW,) is the last position of each hash, ``earlier`` (WINDOW,) the previous one
    of each position, ``state`` (4,) the progress.
    """

    content: Bytes
    latest: Ints
    earlier: Ints
    state: Ints
    effort: Effort


def _insert(search: Search, stop: int) -> None:
    """Insert all positions before ``stop``."""
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


def _find_longest(search: Search, at: int, best: int) -> tuple[int, int]:
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


def predict_token(search: Search) -> tuple[int, int]:
    """Length and distance of the token that the search makes next; a literal is (1, 0)."""
    state = search.state
    effort = search.effort
    at, length, distance = state[AT], state[LENGTH], state[DISTANCE]
    state[LENGTH] = 0
    if length == 0:
        _insert(search, at)
        length, distance = _find_longest(search, at, SHORTEST - 1)
        if length == SHORTEST and distance > FAR and not effort.is_greedy:
            length = 0
    if length < SHORTEST:
        return 1, 0
    if not effort.is_greedy and length < effort.lazy:
        _insert(search, at + 1)
        longer, its_distance = _find_longest(search, at + 1, length)
        if longer > length:
            state[LENGTH] = longer
            state[DISTANCE] = its_distance
            return 1, 0
    return length, distance


def advance(search: Search, length: int) -> None:
    """Move on by a token of ``length`` bytes."""
    state = search.state
    if search.effort.is_greedy and length > search.effort.lazy:
        _insert(search, state[AT] + 1)
        state[INSERTED] = state[AT] + length
    state[AT] += length


def skip_bytes(search: Search, n: int) -> None:
    """Move on by ``n`` stored bytes."""
    search.state[AT] += n
    search.state[LENGTH] = 0


def is_token(content: Bytes, at: int, length: int, distance: int) -> bool:
    """Return True if the token of that length and distance makes the content at ``at``."""
    if length == 1:
        return distance == 0
    if length < SHORTEST or length > min(LONGEST, len(content) - at):
        return False
    if distance < 1 or distance > min(WINDOW, at):
        return False
    n_equal = 0
    while n_equal < length and content[at + n_equal] == content[at + n_equal - distance]:
        n_equal += 1
    return n_equal == length


# Faults of ``join_stream``.
BAD_BLOCK, BAD_CODES, BAD_TOKEN, NO_CODE, LEFT_OVER = -1, -2, -3, -4, -5


@kernel
def split_stream(
    stream: Bytes, search: Search, codes: Codes, blocks: Ints2, corrections: Ints2
) -> tuple[int, int]:
    """Read the blocks of ``stream``, and where its tokens differ from those of the search.

    ``stream`` has SPARE bytes beyond its end. ``blocks`` (most, 4) become kind, tokens or bytes,
    and the bits where the codes begin and end; ``corrections`` (most, 3) the tokens since the last
    one, length and distance. Returns the number of each; -1 blocks if they or the corrections
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
        is_last = read_bits(stream, at, 1)
        kind = read_bits(stream, at + 1, 2)
        at += 3
        start = at
        n = 0
        if kind == STORED:
            at = (at + 7) >> 3 << 3
            if at + 32 > end:
                return -1, 0
            n = read_bits(stream, at, 16)
            at += 32 + 8 * n
            if at > end or state[AT] + n > len(content):
                return -1, 0
            skip_bytes(search, n)
        elif kind == FIXED:
            set_fixed_lengths(codes.lengths)
        elif kind == DYNAMIC:
            at = read_lengths(stream, at, end, codes)
            if at < 0:
                return -1, 0
        else:
            return -1, 0
        blocks[n_blocks, 0] = kind
        blocks[n_blocks, 2] = start
        blocks[n_blocks, 3] = at
        if kind != STORED:
            if not sort_codes(codes):
                return -1, 0
            while True:
                symbol, at = read_symbol(stream, at, end, 0, codes)
                if symbol == BLOCK_END:
                    break
                if symbol < 0 or symbol > FIRST_LENGTH + 28 or state[AT] >= len(content):
                    return -1, 0
                length = 1
                distance = 0
                if symbol > BLOCK_END:
                    base, extra = length_base(symbol)
                    length = base + read_bits(stream, at, extra)
                    at += extra
                    symbol, at = read_symbol(stream, at, end, 1, codes)
                    if symbol < 0 or symbol > 29:
                        return -1, 0
                    base, extra = distance_base(symbol)
                    distance = base + read_bits(stream, at, extra)
                    at += extra
                    if at > end or state[AT] + length > len(content):
                        return -1, 0
                likely_length, likely_distance = predict_token(search)
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
                advance(search, length)
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
        at = put_bits(out, at, 2 * kind + (block == len(blocks) - 1), 3)
        if kind == STORED:
            if n > 65535 or n > len(content) - state[AT]:
                return BAD_BLOCK
            at = (at + 7) >> 3 << 3
            at = put_bits(out, at, n + ((n ^ 65535) << 16), 32)
            start = at >> 3
            for k in range(n):
                out[start + k] = content[state[AT] + k]
            at += 8 * n
            skip_bytes(search, n)
            continue
        if kind == FIXED:
            set_fixed_lengths(codes.lengths)
        else:
            start, end = 8 * blocks[block, 2], 8 * blocks[block, 3]
            stop = read_lengths(headers, start, end, codes)
            if stop < 0 or (stop + 7) >> 3 != end >> 3:
                return BAD_CODES
            while start < stop:
                size = min(16, stop - start)
                at = put_bits(out, at, read_bits(headers, start, size), size)
                start += size
        if not sort_codes(codes):
            return BAD_CODES
        set_codes(codes, 0, 0)
        set_codes(codes, N_LITERALS, 1)
        for _ in range(n):
            if state[AT] >= len(content):
                return BAD_TOKEN
            length, distance = predict_token(search)
            if correction < len(corrections) and since == corrections[correction, 0]:
                length, distance = corrections[correction, 1], corrections[correction, 2]
                if not is_token(content, state[AT], length, distance):
                    return BAD_TOKEN
                state[LENGTH] = 0
                correction += 1
                since = 0
            else:
                since += 1
            at = put_token(out, at, int(content[state[AT]]), length, distance, codes)
            if at < 0:
                return NO_CODE
            advance(search, length)
        if codes.lengths[BLOCK_END] == 0:
            return NO_CODE
        at = put_bits(out, at, codes.bits[BLOCK_END], codes.lengths[BLOCK_END])
    if state[AT] != len(content) or correction != len(corrections):
        return LEFT_OVER
    return (at + 7) >> 3
