"""Compiled: a table of integers coded as residuals, row by row: bases, and the means of pca.

SPEC.md, "Numbers in a row" and "Bases", are normative. Imported on first use only.
"""

from __future__ import annotations

from mcz.codecs.coding import residuals
from mcz.codecs.coding.residuals import FAULT, bits, clamp, code_residual, side_of
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Ints, Ints2

MAX_INDEX = 1 << 40
MEANS = 0, 0  # residuals of a stream
BASIS = residuals.N_CONTEXTS, residuals.N_MIXERS


@kernel
def code_table(state: Ints, data: Bytes, table: Ints2, scales: Ints, is_basis: int) -> int:
    """Code a table (rows, channels) in place, each row from its scale on; 1 where impossible."""
    for row in range(len(table)):
        fast = slow = scales[row] << 4
        near = side_1 = side_2 = 0
        for c in range(table.shape[1]):
            error = code_residual(
                state,
                data,
                table[row, c],
                0,
                (fast, slow),
                clamp(near + 3, 0, 7),
                (side_1, side_2, 3),
                BASIS if is_basis else MEANS,  # PCA-09
            )
            if error == FAULT or abs(error) > MAX_INDEX:  # PCA-12
                return 1
            table[row, c] = error
            size = abs(error) << 4
            near = (near + bits(size) - bits(slow)) >> 1
            fast += (size - fast) >> 2  # PCA-10
            slow += (size - slow) >> 4
            side_2, side_1 = side_1, side_of(error)
    return 0
