"""A file that has every structure that may grow, each with an extension."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.metadata import Record
from mcz.model.motion import Motion
from mcz.model.schema import EXTENDED
from tools.records import build_record, extend
from tools.vectors.build import copies, metadata
from tools.vectors.build.edits import Made, both, plus
from tools.vectors.build.files import Crafter, finish_file

LATER = b"more, from a later version"


def more(kind: type, *paths: str) -> Callable[[bytes], bytes]:
    """An edit of a payload: an extension in each of these structures, the last one first."""
    return both(*(partial(extend, kind, path=path, more=LATER) for path in paths))


def write_extended(*motions: Motion) -> bytes:
    """Clips, the first with a source, the second with channels of its own, and all else."""
    crafter = Crafter(
        HEAD=plus(LATER),
        SKEL=both(more(payloads.Skel, "joints.0.channels.1", "joints.0"), plus(LATER)),
        SRCE=more(payloads.Srce, ""),
        MODL=more(payloads.Modl, ""),
        ATTA=more(payloads.Atta, ""),
        ALIA=plus(LATER),
        CEND=plus(LATER),
        segments=_flag_extended,
    )
    crafter.extension = LATER
    crafter.shared(b"MODL", build_record(payloads.Modl, {"kind": 77, "data": b"learned"}, "MODL"))
    crafter.parts("b.txt", b"attached " * 9)
    crafter.alias("c.txt", payloads.OF_ATTACHMENT, b"b.txt")
    for motion, paths in zip(motions, (("signals.0", "source.0"), ("signals.0",)), strict=True):
        own = ["signals.0.channels.2"] if motion.signals[0].channels else []
        crafter.edits["CLIP"] = both(more(payloads.Clip, *own, *paths), plus(LATER))
        crafter.clip(motion)
    crafter.ancillary(
        b"QUAL", build_record(payloads.Qual, {"entries": [], "extension": LATER}, "QUAL")
    )
    records = metadata.meta_of([Record(motions[0].name, {"place": "here"})])
    crafter.ancillary(ChunkType.META, more(payloads.Meta, "")(records))
    content = copies.content_of(copies.copies_of(crafter), crafter.offset)
    copied = more(payloads.Copy, "")(copies.payload_of(content))
    crafter.ancillary(ChunkType.COPY, copied, safe_to_copy=False)
    return finish_file(crafter)


def _flag_extended(made: Made) -> Made:
    return [(replace(header, flags=header.flags | EXTENDED), streams) for header, streams in made]
