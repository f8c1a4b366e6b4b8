"""Compiled: bits in bytes, the highest of each byte first. SPEC.md, "Bits", is normative.

One function serves encoder and decoder, as in ``mixing``: a coder is an array of two, the index in
bits and whether it encodes. Imported on first use only.
"""

from __future__ import annotations

from mcz.kernels.types import Bytes, Ints

AT, WRITING = 0, 1


def plain(coder: Ints, data: Bytes, value: int, n_bits: int) -> int:
    """Code the low ``n_bits`` of ``value``, the highest first.

    Bits behind the end of ``data`` are counted, and read as 0: the caller compares sizes.
    """
    at = coder[AT]
    coder[AT] = at + n_bits
    out = 0
    for shift in range(n_bits - 1, -1, -1):
        index = at >> 3
        mask = 128 >> (at & 7)  # BITS-01
        at += 1
        bit = 0
        if coder[WRITING]:
            bit = value >> shift & 1
            if bit and index < len(data):
                data[index] |= mask
        elif index < len(data) and data[index] & mask:
            bit = 1
        out = out << 1 | bit  # BITS-01
    return out
