"""The search of zlib for the matches of a deflate stream, for kernels.

SPEC.md, "Deflated contents", is normative.
"""

from __future__ import annotations

from typing import NamedTuple

from mcz.kernels.types import Bytes, Ints
from mcz.sources.arrays.deflate_codes import LONGEST, SHORTEST

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
    """A search in ``content``: ``latest`` (WINDOW,) is the last position of each hash, ``earlier``
    (WINDOW,) the one before each position, ``state`` (4,) where the search stands."""

    content: Bytes
    latest: Ints
    earlier: Ints
    state: Ints
    effort: Effort


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
