"""Number grids: numbers of source files as integers.

A *grid* is a countable set of numbers together with one way of printing each of them. The *ordinal*
of a number is its rank in the grid, an integer that grows with the number. Codecs work on ordinals,
formats print them, and ``values`` converts them to binary64. SPEC.md, "Number grids", is normative.

In every text grid and every IEEE or VAX grid the ordinal of a number with a plus sign is its
magnitude index m >= 0, with a minus sign -1 - m. So -0 is the ordinal -1, and no number is an
exception only because of its sign.
"""

from mcz.model.numbers.choose import bits_of, choose_grid, fit_grid
from mcz.model.numbers.grid import GRID, Grid, GridFields, printed_base
from mcz.model.numbers.rules import GridFlag, GridKind
from mcz.model.numbers.tokens import Texts, Tokens, scan, values_of_texts
from mcz.model.numbers.values import ordinals_of, print_values, values_of

__all__ = [
    "GRID",
    "Grid",
    "GridFields",
    "GridFlag",
    "GridKind",
    "Texts",
    "Tokens",
    "bits_of",
    "choose_grid",
    "fit_grid",
    "ordinals_of",
    "print_values",
    "printed_base",
    "scan",
    "values_of",
    "values_of_texts",
]
