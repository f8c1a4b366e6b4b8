"""Queries that select clips, a line of text: ``subject == '05' and n_frames > 500``.

docs/reference/queries.md is normative: grammar, and what a comparison of two values is. Nothing
here knows clips or files; callers give a function that looks a name up.
"""

from mcz.files.queries.query import Query
from mcz.files.queries.values import Lookup, Value

__all__ = ["Lookup", "Query", "Value"]
