"""Invalid, one fault each: what is said of clips behind them."""

from __future__ import annotations

from collections.abc import Iterable

from mcz.container.chunks import ANCILLARY as OTHER
from mcz.container.chunks import META, SAFE_TO_COPY
from mcz.container.metadata import Record, record_bytes
from mcz.container.metadata_keys import INTERPRETED
from mcz.schema import varint
from tools.vectors.build.files import Broken, Crafter, Vector, finished
from tools.vectors.build.metadata import content_of, meta_of, payload_of
from tools.vectors.build.motions import dance

KEPT = OTHER | SAFE_TO_COPY
GOOD = Record("dance", {"subject": "05", "place": "here"}, ("credit", "rights"))


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/metadata")
    _bytes(shelf)
    _keys(shelf)
    _places(shelf)
    return shelf.vectors


def _file(payload: bytes, flags: int = KEPT) -> bytes:
    """The file of a clip with this META behind it."""
    crafter = Crafter()
    crafter.clip(dance())
    crafter.plain_chunk(META, payload, flags)
    return finished(crafter, index=False)


def _bytes(shelf: Broken) -> None:
    """Payloads that end early, say another size, or have bytes behind their end."""
    content, good = content_of([GOOD]), meta_of([GOOD])
    stored = meta_of([GOOD], stored=True)
    name = record_bytes(Record("dance"))
    cases = (
        ("no-bytes", "META", "A META without any byte.", b""),
        ("cut", "META", "A META that ends within its size.", good[:1]),
        ("encoding", "META; Conventions", "An encoding of 3.", b"\3" + good[1:]),
        ("size-more", "META", "A stated size of a byte more.", payload_of(content, size=999)),
        ("size-less", "META", "A stated size of a byte less.", payload_of(content, size=5)),
        ("stored-more", "META", "A byte behind stored records.", stored + b"\0"),
        ("stored-less", "META", "Stored records without their last byte.", stored[:-1]),
        ("deflate-tail", "META; Conventions", "A byte behind the deflate stream.", good + b"\0"),
        ("record-cut", "META", "The last record ends within a value.", payload_of(content[:-1])),
        ("record-tail", "META", "A byte behind the last record.", payload_of(content + b"\1")),
        ("name-UTF-8", "META; Conventions", "A name that is not UTF-8.",
         payload_of(b"\2\xff\xfe\0\0")),
        ("key-UTF-8", "META; Conventions", "A key that is not UTF-8.",
         payload_of(name[:-2] + b"\1\1\xff\0")),
        ("value-UTF-8", "META; Conventions", "A value that is not UTF-8.",
         payload_of(name[:-1] + b"\1\1a\1\xff")),
        ("entries-many", "META", "A count of 2^50 entries.",
         payload_of(name[:-1] + varint(2**50))),
        ("removed-many", "META", "A count of 2^50 keys.",
         payload_of(name[:-2] + varint(2**50))),
        ("name-varint", "META; Conventions", "A length of a name not in its shortest form.",
         payload_of(b"\x80\0" + name[1:])),
        ("bomb", "META; Limits and profiles", "A size of 3 * 2^18 in a small file.",
         payload_of(bytes(3 * 2**18))),
    )  # fmt: skip
    for name_, spec, purpose, payload in cases:
        shelf.add(name_, spec, purpose, _file(payload))


def _keys(shelf: Broken) -> None:
    for key in INTERPRETED:
        purpose = f"{key} is set behind its clip."
        shelf.add(f"sets-{key}", "META", purpose, _file(meta_of([Record("dance", {key: "1"})])))
    removed = meta_of([Record("dance", {}, ("frame-numbers",))])
    shelf.add("removes-frame-numbers", "META", "frame-numbers is removed.", _file(removed))
    of_file = meta_of([Record("", {"source-note": "odd"})])
    shelf.add("file-source-note", "META", "source-note is said of the file.", _file(of_file))
    twice = record_bytes(Record("dance", {"a": "1", "b": "2"})).replace(b"\1b", b"\1a")
    shelf.add("key-twice", "META", "A key is set twice in one record.", _file(payload_of(twice)))
    gone = meta_of([Record("dance", {}, ("credit", "credit"))])
    shelf.add("removed-twice", "META", "A key is removed twice in one record.", _file(gone))


def _places(shelf: Broken) -> None:
    crafter = Crafter()
    crafter.plain_chunk(META, meta_of([GOOD]), KEPT)
    crafter.clip(dance())
    data = finished(crafter, index=False)
    shelf.add("before-clips", "META", "A META before the first clip.", data)
    crafter = Crafter()
    crafter.plain_chunk(META, meta_of([]), KEPT)
    data = finished(crafter, index=False)
    shelf.add("no-clips", "META", "A META in a file without clips.", data)
    crafter = Crafter()
    for motion in (dance(), dance(name="encore")):
        crafter.clip(motion)
    crafter.plain_chunk(META, meta_of([GOOD]), KEPT)
    whole = finished(crafter, index=False)
    at, cend = whole.index(META), whole.rindex(b"CEND")
    inside = whole[:cend] + whole[at:-32] + whole[cend:at] + whole[-32:]
    shelf.add("inside-clip", "META", "A META between CLIP and CEND of a second clip.", inside)
    for name, flags in (("critical", 0), ("not-safe-to-copy", OTHER)):
        purpose = f"A META with flags {flags}."
        shelf.add(name, "Chunks; META", purpose, _file(meta_of([GOOD]), flags))
