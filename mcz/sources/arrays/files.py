"""An array of a file, as far as it is looked into."""

from __future__ import annotations

from dataclasses import dataclass

from mcz.errors import SourceError
from mcz.model.types import Items
from mcz.sources.arrays.archive import Archive, Member, read_archive
from mcz.sources.arrays.columns import unfit, words_of
from mcz.sources.arrays.header import Head, read_head, refuse_odd

LARGE = 1024  # bytes of an array: that a larger one is kept is said
MAX_TEXT = 2**16  # bytes of an array of text that are looked at
DEFLATED = "deflated, which differs between builds"
STAYS = "and stays so, since deflate differs between builds (numpy.savez stores)"


@dataclass(frozen=True, slots=True)
class Array:
    """An array; ``kept`` says why it stays its bytes, "" where its numbers are read.

    ``stop`` is where its bytes end, 0 of one whose bytes are not looked into. ``words`` are its
    numbers, (rows, columns), where it has some; ``text`` is that of one without. ``is_loud``: that
    it is kept is worth a note.
    """

    name: str
    head: Head
    stop: int = 0
    kept: str = ""
    words: Items | None = None
    text: bytes = b""
    is_loud: bool = False

    @property
    def numbers(self) -> Items:
        """The numbers of an array that is not kept."""
        assert self.words is not None
        return self.words

    @property
    def n_rows(self) -> int:
        return self.head.shape[0]

    @property
    def is_large(self) -> bool:
        return self.stop - self.head.start > LARGE


def npy_array(data: bytes) -> Array:
    """The array of an NPY file; raises SourceError where it has no numbers with rows."""
    head = read_head(data, 0, len(data))
    refuse_odd(head)
    array = _array("array", data, head, len(data))
    if array.kept:
        raise SourceError(f"the array is {array.kept}, which is no motion", offset=head.start)
    return array


def npz_arrays(data: bytes) -> tuple[list[Array], Archive]:
    """The arrays of an NPZ file in the order of their bytes, one for each member."""
    archive = read_archive(data)
    return [_member(data, member) for member in archive.members], archive


def _member(data: bytes, member: Member) -> Array:
    name = member.name.removesuffix(".npy")
    if not member.is_stored:
        how = "deflated" if member.method == 8 else f"packed by method {member.method}"
        how = "encrypted" if member.flags & 1 else f"{how}, {STAYS}"
        return Array(name, Head(), kept=how, is_loud=True)
    head = read_head(data, member.start, member.stop)
    if head.odd:
        return Array(name, Head(), kept=f"no array ({head.odd})", is_loud=name != member.name)
    return _array(name, data, head, member.stop)


def _array(name: str, data: bytes, head: Head, stop: int) -> Array:
    if head.code == "O":
        return Array(name, head, stop, "pickled, and not unpickled", is_loud=True)
    if not head.is_number:
        text = data[head.start : min(stop, head.start + MAX_TEXT)]
        return Array(name, head, stop, f"of type {head.code}", text=text)
    if not head.size:
        return Array(name, head, stop, f"of shape {head.shape}")
    if not head.shape:
        return Array(name, head, stop, "a single number", words_of(data, head))
    words = words_of(data, head)
    fault = unfit(words)
    return Array(name, head, stop, fault, words, is_loud=bool(fault))
