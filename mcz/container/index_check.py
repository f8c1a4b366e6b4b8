"""INDX compared with the chunks before it. SPEC.md, "INDX" and "Strict reading", are normative."""

from __future__ import annotations

from mcz.container import index_records
from mcz.container.chunks import CRC, Chunk, build_chunk
from mcz.container.directory import Directory, IndexPlace
from mcz.container.index import index_record
from mcz.container.index_reader import MOST_INDEXES, check_order, inflated, place_of
from mcz.container.index_records import Index
from mcz.errors import FormatError
from mcz.schema import Table, build, parse


class IndexCheck:
    """Compares each INDX of a file with what lies before it."""

    def __init__(self) -> None:
        self._depths: dict[IndexPlace, int] = {}

    def check(self, payload: bytes, chunk: Chunk, directory: Directory, limit: int) -> None:
        """Compare the next INDX with what was found; raises FormatError.

        ``limit`` bounds its inflated size.
        """
        where = f"chunk {chunk.label}"
        outer = parse(index_records.Indx, payload, where)
        since = None if outer.previous is None else self._found(outer.previous, chunk, where)
        depth = 1 if since is None else self._depths[since] + 1
        if depth > MOST_INDEXES:  # INDX-07
            raise FormatError(f"it continues {depth - 1} others", where=where)
        content = inflated(outer, limit)
        due = index_record(directory, since)
        expected = build(due, where)
        if content[: len(expected)] != expected:  # INDX-04, INDX-05, INDX-08
            listed = parse(Index, content, where)
            raise FormatError(difference(listed, due), where=where)
        (crc,) = CRC.unpack(build_chunk(chunk.type, payload, chunk.flags)[-CRC.size :])
        self._depths[place_of(chunk, crc, outer.size, directory)] = depth

    def _found(self, previous: index_records.PreviousIndex, chunk: Chunk, where: str) -> IndexPlace:
        """The INDX that another one continues."""
        check_order(previous, chunk.offset)
        named = previous.offset, previous.length, previous.crc
        for place in self._depths:
            if (place.offset, place.length, place.crc) == named:
                return place
        raise FormatError(
            f"no INDX at {previous.offset} is the one that it continues", where=where
        )  # INDX-06


def difference(listed: Index, due: Index) -> str:
    """The first field of an index that is not as it has to be, in words."""
    for name, given in vars(listed).items():
        wanted = getattr(due, name)
        if name == "head" and given != wanted:
            return "its copy of HEAD differs from HEAD"
        if isinstance(given, Table) and len(given) != len(wanted):
            return f"it lists {len(given)} {name}, there are {len(wanted)}"
        if isinstance(given, Table):
            for row, (one, other) in enumerate(zip(given, wanted, strict=True)):
                for field, value in vars(one).items():
                    if value != getattr(other, field):
                        return (
                            f"{name}.{row}.{field} is {value!r}, "
                            f"the file has {getattr(other, field)!r}"
                        )
        elif name != "extension" and given != wanted:
            return f"{name} is {given!r}, the file has {wanted!r}"
    return "it is not in file order"
