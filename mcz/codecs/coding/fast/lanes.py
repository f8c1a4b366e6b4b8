"""The coded channels of a segment, decoded by compiled kernels.

SPEC.md, "Codec 1: fast", is normative.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError

if TYPE_CHECKING:
    from mcz.codecs.coding.fast.residual_kernels import Predictors

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Lanes:
    """The coded channels of a segment, ready to be decoded.

    ``starts``: the first lane of each group whose residuals are read, and the number of all;
    ``columns``: the channels of lanes. The tails are those of groups that are read whole.
    """

    data: NDArray[np.uint8]
    residuals: Ints  # (groups, 2): the first bit, and the one behind the last
    tails: Ints
    starts: Ints
    columns: Ints
    predictors: Predictors
    lattices: Ints
    leads: NDArray[np.int32]  # (BEHIND + rows, lanes), filled by the decoder
    out: Ints  # (rows, channels), so are the columns of lanes


def read_lanes(lanes: Lanes) -> None:
    """Fill the columns of the lanes of one segment; raises FormatError."""
    from mcz.codecs.coding.fast import residual_kernels as residual  # compiled, on first use
    from mcz.codecs.coding.fast import tail_kernels as tail

    bits, ends = np.ascontiguousarray(lanes.residuals.T)
    fault = residual.read_leads(lanes.data, bits, ends, lanes.starts, lanes.predictors, lanes.leads)
    if fault != -1:
        raise fault_of("residuals", "row", fault)
    bits, ends = np.ascontiguousarray(lanes.tails.T)
    tails = tail.Tails(lanes.data, bits, ends, lanes.starts, lanes.columns)
    fault = tail.read_ordinals(tails, lanes.lattices, lanes.leads[residual.BEHIND :], lanes.out)
    if fault != -1:
        raise fault_of("tails", "lane", fault)


def fault_of(part: str, unit: str, fault: int) -> FormatError:
    """The error of ``read_leads`` or ``read_ordinals``."""
    if fault < -1:
        return FormatError(f"fast: bits are left in the {part}, group {-2 - fault} of those read")
    return FormatError(f"fast: {unit} {fault} of the {part} has no code")
