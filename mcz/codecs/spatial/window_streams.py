"""The stream of one segment of windows: of each window its bytes, coded by themselves.

SPEC.md, "Codec 20: lsdt-clip", is normative.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.start_states import start_states
from mcz.codecs.coding.streams import code, uncode
from mcz.codecs.spatial.prefix_streams import Codes, build_vectors, parse_vectors
from mcz.errors import FormatError
from mcz.model.schema import read_varint, varint

Ints = NDArray[np.int64]

MAX_INDEX = 2**40


@dataclass(frozen=True, slots=True)
class Window:
    """Coefficients of a window, (n_rows, n_frequencies), and up to where each row has any."""

    rows: Ints
    lengths: Ints


@cache
def _kernels() -> ModuleType:
    from mcz.codecs.spatial import window_kernels

    return window_kernels


def build_window(rows: Ints, starts: Ints, codes: Codes | None) -> bytes:
    """The bytes of a window's coefficients, (n_rows, n_frequencies), none beyond MAX_INDEX."""
    coded = _adaptive(rows, starts) if codes is None else build_vectors(rows, _one(rows), codes)
    return varint(len(coded)) + coded


def _one(rows: Ints) -> Ints:
    """Every row is one vector."""
    return np.array([0, rows.shape[1]])


def _adaptive(rows: Ints, starts: Ints) -> bytes:
    lengths = np.zeros(len(rows), np.int64)
    return code(
        start_states("window")[0],
        rows.size + 256,
        lambda state, data: _kernels().code_window(state, data, rows, starts, lengths) < 0,
        "a coefficient",
    )


def parse_window(
    data: bytes, starts: Ints, n_frequencies: int, codes: Codes | None, where: str
) -> Window:
    """The coefficients of a window; raises FormatError on bad bytes."""
    rows = np.zeros((int(starts[-1]), n_frequencies), np.int64)
    lengths = np.zeros(len(rows), np.int64)
    if codes is not None:
        # WIND-09
        parse_vectors(data, rows, _one(rows), codes, f"{where}: a coefficient", whole=True)
        lengths = n_frequencies - np.argmax(rows[:, ::-1] != 0, axis=1)
        lengths[~rows.any(axis=1)] = 0
    else:
        uncode(
            data,
            start_states("window")[0],  # WIND-10
            # WIND-10
            lambda state, data: _kernels().code_window(state, data, rows, starts, lengths) < 0,
            f"{where}: a coefficient",
            whole=True,  # WIND-08
        )
    return Window(rows, lengths)


def windows_of(stream: bytes, n_windows: int, where: str) -> Iterator[bytes]:
    """The bytes of each window; raises FormatError on bad bytes."""
    at = 0
    for _ in range(n_windows):
        size, at = read_varint(stream, at)
        if size > len(stream) - at:  # WIND-07
            raise FormatError(f"a window of {size} bytes at {at} of {len(stream)}", where=where)
        yield stream[at : at + size]
        at += size
    if at != len(stream):  # WIND-07
        raise FormatError(f"{len(stream) - at} bytes after the last window", where=where)
