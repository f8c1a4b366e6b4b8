"""Raw deflate, its size known beforehand. SPEC.md, "Conventions", is normative."""

from __future__ import annotations

import zlib

from mcz.errors import FormatError, LimitError

MAX_RATIO = 1032  # raw deflate never inflates to more than this times its size


def inflate(data: bytes, size: int, where: str, *, words: bytes = b"") -> bytes:
    """The ``size`` bytes whose raw deflate is ``data``; never more memory than ``size`` + 1.

    ``words``: bytes that distances may reach back to, as if they came before.
    """
    if size > MAX_RATIO * (len(data) + 1):  # LIMIT-14
        raise LimitError(f"{size} bytes cannot come of {len(data)}", where=where)
    inflater = zlib.decompressobj(-15, words)  # CONV-19
    try:
        out = inflater.decompress(data, size + 1)
    except zlib.error as error:
        raise FormatError(str(error), where=where) from None
    if len(out) != size or not inflater.eof or inflater.unused_data:  # CONV-08, CONV-09
        message = f"deflate of {len(data)} bytes does not give {size} bytes"
        raise FormatError(message, where=where)
    return out


def deflate(data: bytes, *, words: bytes = b"") -> bytes:
    """The raw deflate of ``data``, which may refer to ``words``."""
    deflater = zlib.compressobj(9, zlib.DEFLATED, -15, 9, zlib.Z_DEFAULT_STRATEGY, words)
    return deflater.compress(data) + deflater.flush()
