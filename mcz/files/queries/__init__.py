"""Queries that select clips, a line of text: ``subject == '05' and n_frames > 500``.

docs/reference/queries.md is normative: grammar, and comparisons of values. This folder does not
depend on clips or files; callers pass a function that looks a name up.
"""

from __future__ import annotations

from collections.abc import Collection

from mcz.errors import OptionError
from mcz.files.queries.evaluation import Lookup, Value, names_in, printed, truth_of
from mcz.files.queries.parser import fault, parse, tokens
from mcz.model.text_format import among, nearest, shown

__all__ = ["Lookup", "Query", "Value"]


class Query:
    """A query such as ``subject == '05' and n_frames > 500``; see docs/reference/queries.md.

    Raises OptionError, which shows the column, for a malformed text.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.tree = parse(text)
        self._test = truth_of(self.tree)

    def __reduce__(self) -> tuple[type[Query], tuple[str]]:
        return Query, (self.text,)

    def __repr__(self) -> str:
        return f"<Query {shown(self.text)}>"

    def __str__(self) -> str:
        """The same query with the fewest blanks and parentheses."""
        return printed(self.tree)

    @property
    def names(self) -> tuple[str, ...]:
        """The names that occur, each once, in their order."""
        return tuple(dict.fromkeys(names_in(self.tree)))

    def matches(self, lookup: Lookup) -> bool:
        """Return True if the query is true, not false or unknown, of the values in ``lookup``.

        ``lookup(name)`` returns a text, a number, a truth, or None for a missing value; a name is
        looked up only when its part of the query is reached.
        """
        return self._test(lookup) is True

    def unknown(self, name: str, known: Collection[str]) -> OptionError:
        """The error for an unknown ``name``, one of ``names``."""
        at = next(t.at for t in tokens(self.text) if (t.kind, t.raw) == ("name", name))
        near = nearest(name, known)
        hint = f"did you mean {near}?" if near else f"known are {among(sorted(known), None)}"
        return fault(self.text, at, f"{shown(name)} is neither a field nor a metadata key; {hint}")
