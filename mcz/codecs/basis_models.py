"""Bases in integers: the models of kind 1, and the well-known ones.

SPEC.md, "Bases", is normative; the names below are its field names.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.residuals import code_table
from mcz.codecs.coding.streams import decode_stream, encode_stream, start_states
from mcz.codecs.contract import Layout, Model, model_id
from mcz.errors import FormatError, MotionError, UnsupportedError
from mcz.model.extras import annex_bytes, annex_names
from mcz.model.schema import read_varint, varint
from mcz.model.types import Floats, Ints

BASES = 1  # the kind of model
MAX_BASES = 16
MAX_POINTS = 2048  # entries of a vector
MAX_ENTRIES = 2**22  # of all bases of a model
MAX_KEPT = 2**17  # entries of a model that is kept for the next clip
MAX_SHIFT = 40
MAX_ENTRY = 2**40
FINE = 15  # binary digits of an entry by default


@dataclass(frozen=True, slots=True)
class Basis:
    """Vectors as rows of integers, ``entries`` (n_vectors, n_points), times 2^-``shifts``."""

    shifts: Ints
    entries: Ints

    @property
    def vectors(self) -> Floats:
        """(n_vectors, n_points), exact."""
        return np.ldexp(self.entries.astype(np.float64), -self.shifts[:, None])


def round_vectors(vectors: Floats, shift: int | Sequence[int] | Ints = FINE) -> Basis:
    """Round row ``vectors`` to integers with ``shift`` binary digits, the same or one per row."""
    shifts = np.broadcast_to(np.asarray(shift, np.int64), len(vectors)).copy()
    return Basis(shifts, np.rint(np.ldexp(vectors, shifts[:, None])).astype(np.int64))


def falling_digits(n_vectors: int, most: int, least: int) -> Ints:
    """Binary digits of each vector, fewer for later ones, whose coefficients are mostly 0."""
    fall = (most - least + 2) * np.arange(n_vectors) / max(1, n_vectors - 1)
    return np.clip(np.rint(most - fall), least, None).astype(np.int64)


def build_bases(bases: Sequence[Basis | Floats], shift: int = FINE) -> bytes:
    """The data of a model of ``bases``; vectors that are not integers yet get ``shift`` digits.

    Raises MotionError for too many vectors, or too large an entry.
    """
    parts = [basis if isinstance(basis, Basis) else round_vectors(basis, shift) for basis in bases]
    size = sum(part.entries.size for part in parts)
    widest = max((part.entries.shape[1] for part in parts), default=0)
    if not 1 <= len(parts) <= MAX_BASES or size > MAX_ENTRIES or widest > MAX_POINTS:
        raise MotionError(
            f"{len(parts)} bases with up to {widest} points and {size} entries in all exceed "
            "the limits of a model"
        )
    if any(np.abs(part.entries).max(initial=0) > MAX_ENTRY for part in parts):
        raise MotionError("an entry of a basis exceeds 2^40")
    head = varint(len(parts))
    for part in parts:
        n_vectors, n_points = part.entries.shape
        head += varint(n_points) + varint(n_vectors) + bytes(part.shifts.tolist())
    tables = [part.entries.copy() for part in parts]
    shifts = [part.shifts for part in parts]
    return head + encode_stream(
        start_states("pca")[0],
        2 * size + 256,
        lambda state, data: _loop(state, data, tables, shifts),
        "an entry of a basis",
    )


@dataclass(frozen=True, slots=True)
class Head:
    """Header of one basis in a model."""

    shifts: Ints
    n_points: int


def parse_heads(data: bytes, where: str = "model") -> tuple[tuple[Head, ...], int]:
    """Parse the headers of a model of kind 1; also return the offset of the entries."""
    n_bases, at = read_varint(data, 0)
    if not 1 <= n_bases <= MAX_BASES:  # BASES-02
        raise FormatError(f"a model must have 1 to {MAX_BASES} bases, not {n_bases}", where=where)
    heads: list[Head] = []
    size = 0
    for _ in range(n_bases):
        n_points, at = read_varint(data, at)
        n_vectors, at = read_varint(data, at)
        size += n_points * n_vectors
        # BASES-03, BASES-04, BASES-06
        if not 1 <= n_vectors <= n_points <= MAX_POINTS or size > MAX_ENTRIES:
            raise FormatError(
                f"a basis cannot have {n_vectors} vectors of {n_points} entries", where=where
            )
        digits = np.frombuffer(data[at : at + n_vectors], "u1").astype(np.int64)
        at += n_vectors
        if len(digits) < n_vectors or digits.max() > MAX_SHIFT:  # BASES-04, BASES-05
            raise FormatError(
                f"the shifts of a basis are truncated, or one exceeds {MAX_SHIFT}", where=where
            )
        heads.append(Head(digits, n_points))
    return tuple(heads), at


def parse_bases(data: bytes, where: str = "model") -> tuple[Basis, ...]:
    """The bases of a model of kind 1; raises FormatError on bad bytes."""
    heads, at = parse_heads(data, where)
    shifts = [head.shifts for head in heads]
    tables = [np.zeros((len(head.shifts), head.n_points), np.int64) for head in heads]
    decode_stream(
        data[at:],
        start_states("pca")[0],
        lambda state, stream: _loop(state, stream, tables, shifts),
        f"{where}: an entry of a basis",
        whole=True,  # BASES-01
    )
    return tuple(Basis(digits, table) for digits, table in zip(shifts, tables, strict=True))


def _loop(
    state: Ints, data: NDArray[np.uint8], tables: Sequence[Ints], shifts: Sequence[Ints]
) -> bool:
    for table, digits in zip(tables, shifts, strict=True):  # BASES-07
        scales = (1 << digits) >> (table.shape[1].bit_length() // 2)  # BASES-07
        if code_table(state, data, table, scales, 1):
            return False
    return True


def build_model(bases: Sequence[Basis | Floats]) -> Model:
    """``bases`` as a model; raises MotionError as ``build_bases``."""
    return Model(BASES, build_bases(bases))


@cache
def known_models() -> dict[str, Model]:
    """The models of SPEC.md's annexes by name, which a file need not have."""
    return {
        name.removeprefix("bases_").removesuffix(".bin"): Model(BASES, annex_bytes(name))
        for name in annex_names("bases_*.bin")
    }


@cache
def _known_by_id() -> dict[bytes, Model]:
    return {model_id(model): model for model in known_models().values()}


def known_model_name(id_: bytes) -> str | None:
    """Name of a well-known model, None for any other."""
    return next((name for name, model in known_models().items() if model_id(model) == id_), None)


def find_bases(
    codec: str, layout: Layout, id_: bytes, check: Callable[[Sequence[Head]], None]
) -> tuple[Basis, ...]:
    """The bases of the model with this id, which is well known or in the file.

    ``check`` refuses wrong heads before their entries take memory. Raises UnsupportedError for an
    unknown model, FormatError for one without bases.
    """
    model = _known_by_id().get(id_)
    if model is None and layout.find_model is not None:
        model = layout.find_model(id_)
    if model is None:
        # BASES-09
        raise UnsupportedError(f"{codec}: model {id_.hex()} is neither in the file nor well known")
    where = f"{codec}: model {id_.hex()}"
    if model.kind != BASES:  # SPACE-08
        raise FormatError(f"{where} is of kind {model.kind}, but a model of bases is needed")
    heads, _ = parse_heads(model.data, where)
    check(heads)
    if sum(len(head.shifts) * head.n_points for head in heads) > MAX_KEPT:
        return parse_bases(model.data, where)
    return _parse_cached(model.data)


@lru_cache(maxsize=8)
def _parse_cached(data: bytes) -> tuple[Basis, ...]:
    bases = parse_bases(data)
    for basis in bases:
        basis.entries.setflags(write=False)
    return bases


def read_bases(path: Path) -> Model:
    """The model in a file that ``mcz train`` has written; raises FormatError."""
    data = path.read_bytes()
    try:
        parse_bases(data)
    except FormatError as error:
        raise FormatError(f"cannot read bases: {error}", path=path) from None
    return Model(BASES, data)
