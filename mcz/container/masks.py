"""Masks <-> runs of valid and invalid values. SPEC.md, "Masks", is normative."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError
from mcz.model.schema import read_varint, varint

Mask = NDArray[np.bool_]


def build_mask(mask: Mask) -> bytes:
    """The runs of a mask of shape (n_rows, n_channels), column after column."""
    flat = np.concatenate([[True], mask.T.reshape(-1)])
    edges = [0, *np.flatnonzero(np.diff(flat)).tolist(), mask.size]
    runs = [b - a for a, b in zip(edges, edges[1:], strict=False)]
    return b"".join(map(varint, runs))


def parse_mask(data: bytes, n_rows: int, n_channels: int, name: str) -> Mask:
    """The mask of shape (n_rows, n_channels); raises FormatError."""
    size = n_rows * n_channels
    flat = np.ones(size, np.bool_)
    at = start = 0
    valid = True
    while at < len(data):
        run, after = read_varint(data, at)
        if run > size - start or (run == 0 and at > 0):  # MASK-02
            raise FormatError(f"a mask run of {run} at {start} of {size}", clip=name)
        flat[start : start + run] = valid
        start, at, valid = start + run, after, not valid
    if start != size:  # MASK-03
        raise FormatError(f"a mask of {start} values, not {size}", clip=name)
    return flat.reshape(n_channels, n_rows).T  # MASK-01
