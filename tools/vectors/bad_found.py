"""Invalid or unsupported: what decoders took that were fuzzed, and no vector had."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.codecs import by_name, raw
from mcz.codecs._bases import build_bases, model_of
from mcz.codecs.base import id_of
from mcz.container import payloads
from mcz.files.digest import value_hash
from mcz.motion import Channel, Signal
from mcz.schema import varint
from tools.vectors.bad_data import crc_of_all
from tools.vectors.bad_lsdt_models import with_model
from tools.vectors.bad_sources import Unrestorable
from tools.vectors.craft import (
    UNSUPPORTED,
    Broken,
    Crafter,
    Vector,
    Whole,
    file_of,
    finished,
)
from tools.vectors.edits import Edit, at, put, span, swap
from tools.vectors.faults import CODECS
from tools.vectors.motions import dance
from tools.vectors.sources import PLAIN, take
from tools.vectors.spatial import CLIP, Plan, basis_of, file_with
from tools.vectors.spatial_faults import spec_of


def vectors() -> Iterable[Vector]:
    shelves: list[Broken | Whole] = []
    for codec in CODECS:
        shelf = Broken(f"invalid/{codec}")
        _without_frames(shelf, codec)
        shelves.append(shelf)
    clips, data = Broken("invalid/clip"), Broken("invalid/data")
    sources = Unrestorable("invalid/sources")
    _unsupported(clips, data)
    _unsupported_source(sources)
    shelves += [clips, data, sources]
    later = Whole("uncommon/container", exit=(UNSUPPORTED,))
    _models(shelves[CODECS.index(CLIP)], later)
    _other_index(later)
    return [vector for shelf in [*shelves, later] for vector in shelf.vectors]


def _without_frames(shelf: Broken, name: str) -> None:
    """Headers of clips in which there is nothing to decode."""
    codec = by_name(name)
    spec = f"Codec {codec.id}: {name}; CLIP"

    def edited(edit: Edit) -> bytes:
        crafter = Crafter(CLIP=edit)
        segments = {"segment_frames": 8} if codec.id > 1 else {}
        crafter.clip(dance(0), codec=codec, grouping=codec.grouping, **segments)
        return finished(crafter)

    purpose = "A byte behind the header, of a clip of no frames."
    shelf.add("frames-0-header", spec, purpose, edited(_longer_header))
    purpose = "99 resolutions of a clip of no frames."
    edit = put(payloads.CLIP, "signals.0.n_resolutions", b"\x63")
    shelf.add("frames-0-resolutions", spec, purpose, edited(edit))


def _longer_header(payload: bytes) -> bytes:
    start, stop = span(payloads.CLIP, payload, "signals.0.header")
    header = payload[start + 1 : stop] + b"\0"
    return payload[:start] + varint(len(header)) + header + payload[stop:]


def _models(shelf: Broken, later: Whole) -> None:
    """Models of clips in which there is nothing to decode."""
    plan = Plan(CLIP, 4, (), bases=(basis_of(4, 3),))
    data = with_model(plan, 1, build_bases(plan.bases) + b"\0")
    purpose = "Bases with a byte behind their last, of a clip of no frames."
    shelf.add("frames-0-model", spec_of(CLIP, "Bases"), purpose, data)
    other = swap(id_of(model_of(plan.bases)), bytes(range(16)))
    purpose = "A clip of no frames whose model is not there."
    later.add(
        "frames-0-model-missing",
        "Bases; MODL",
        purpose,
        file_with(plan, CLIP=other),
        exit=later.exit,
    )


def _unsupported(clips: Broken, data: Broken) -> None:
    """Faults in a clip whose motion is of an unknown codec, which is legal."""
    crafter = Crafter(DATA=crc_of_all)
    crafter.clip(dance(), codec=replace(raw.CODEC, id=2**20))
    purpose = "A table_crc of table and streams, of a codec that nobody knows."
    data.add("table-crc-unknown-codec", "DATA; Strict reading", purpose, finished(crafter))
    analog = Signal(np.arange(8.0).reshape(8, 1), name="analog", samples_per_frame=2)
    analog = replace(analog, channels=(Channel("", "force"),))
    both_signals = replace(dance(), signals=(*dance().signals, analog))
    hashes = varint(2) + value_hash(dance().signals[0].values, None) + b"v" * 32
    wrong = put(payloads.CEND, "value_sha256", hashes)
    unknown = put(payloads.CLIP, "signals.0.codec", varint(2**20))
    made = file_of(both_signals, CEND=wrong, CLIP=unknown, index=False)
    purpose = "A wrong value hash of the second signal, where the codec of the first is unknown."
    clips.add("value-hash-beside-unknown-codec", "CEND; Strict reading", purpose, made)


def _unsupported_source(shelf: Broken) -> None:
    first, second = (replace(take(PLAIN, name), name=name) for name in ("first", "second"))
    crafter = Crafter()
    crafter.clip(first, codec=replace(raw.CODEC, id=2**20))
    crafter.edits["CEND"] = put(payloads.CEND, "source_sha256", b"\1" + b"s" * 32)
    crafter.clip(second)
    purpose = "A source with another hash, behind one of a clip whose codec is unknown."
    shelf.add("hash-behind-unknown-codec", "CEND; Strict reading", purpose, finished(crafter))


def _other_index(shelf: Whole) -> None:
    """An index that this version cannot read, in a file that says that it needs a later one."""
    edit = at(0, b"\xff" * 9)
    crafter = Crafter(INDX=edit)
    crafter.plain_chunk(b"ROOM", b"what the room looked like")
    crafter.clip(dance())
    purpose = "A critical chunk of unknown type, and an INDX that this version cannot read."
    shelf.add("unknown-critical-index", "Chunks; INDX", purpose, finished(crafter), exit=shelf.exit)
    data = file_of(dance(), HEAD=at(2, b"\1\0"), INDX=edit)
    purpose = "Another major version, and an INDX that this one cannot read."
    shelf.add("newer-major-index", "HEAD; INDX", purpose, data, exit=shelf.exit)
