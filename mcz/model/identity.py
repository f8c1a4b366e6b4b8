"""``IdentityCache``: results of a function of large immutable objects, looked up by identity."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

MOST = 64  # kept results; their files may be closed
Result = TypeVar("Result")


class IdentityCache(Generic[Result]):
    """``function`` of immutable objects; caches the last results, with the objects.

    A hash of a tuple of many grids, say, takes longer than much that is derived from it.
    """

    def __init__(self, function: Callable[..., Result]) -> None:
        self._function = function
        self._known: dict[tuple[int, ...], tuple[tuple[object, ...], Result]] = {}

    def __call__(self, *objects: object) -> Result:
        key = tuple(map(id, objects))
        entry = self._known.get(key)
        if entry is None:
            entry = objects, self._function(*objects)
            if len(self._known) >= MOST:
                self._known.clear()  # as other threads may do: nothing is iterated over
            self._known[key] = entry
        return entry[1]
