"""Skeletons that a damaged file has lost, made again from the ASF that they came of.

The id of a skeleton is a hash of its bytes: what has the id is what was lost.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import PurePosixPath

from mcz.container import payloads
from mcz.container.packed import pack_skeleton
from mcz.container.reader import Container
from mcz.container.skeletons import UP_AXES, build_skeleton
from mcz.container.writer import payload_id
from mcz.errors import MczError
from mcz.formats import FORMATS
from mcz.motion import Skeleton
from mcz.units import UNIT_CM

ASF = FORMATS["asf"]
NAMELESS = "skeleton"  # what a skeleton is called where neither its file nor a path says it


def restore_skeletons(container: Container) -> None:
    """Give a salvaged file the skeletons that clips name, that it lost, and whose ASF it has."""
    lost = _lost(container)
    for template in list(container.directory.shared) if lost else ():
        if template[0] == b"SRCE":
            with suppress(MczError):  # of another format, damaged as well, or no ASF
                origin = f"its ASF, {container.directory.shared[template].label}"
                _restore(container, lost, _of_asf(container, template[1], lost), origin)
    for base in list(container.directory.shared) if lost else ():
        if base[0] == b"SKEL":
            with suppress(MczError):
                _restore(container, lost, _of_base(container, base[1]), f"SKEL {base[1].hex()}")


def _restore(
    container: Container, lost: set[bytes], candidates: Iterable[bytes], origin: str
) -> None:
    """Let the file have those of the candidates that are what it lost."""
    for payload in candidates:
        id_ = payload_id(payload)
        if id_ in lost:  # SALV-09
            container.add_shared(b"SKEL", payload)
            container.damage.append(f"SKEL {id_.hex()} is lost; it is made again from {origin}")
            lost.remove(id_)


def _lost(container: Container) -> set[bytes]:
    """The ids of the skeletons that clips, skeletons and aliases name and the file has not."""
    directory = container.directory
    named = {row.skeleton for row in directory.clips.values()}
    named |= {target for of, target in directory.aliases.values() if of == payloads.OF_SKELETON}
    for kind, id_ in directory.shared:
        if kind == b"SKEL":
            with suppress(MczError):
                named |= set(map(bytes, container.skeleton_fields(id_).base))
    return {id_ for id_ in named if (b"SKEL", id_) not in directory.shared}


def _of_asf(container: Container, template: bytes, lost: set[bytes]) -> Iterator[bytes]:
    """The payloads of SKEL that writers make of an ASF: under each name and length unit."""
    text = container.template(template, ASF.id)
    source = {
        "template": template,
        "format": ASF.id,
        "size": len(text),
        "sha256": hashlib.sha256(text).digest(),
    }
    for name in _names(container, lost):
        skeleton: Skeleton = ASF.read(text, name)
        for unit_cm in dict.fromkeys((skeleton.unit_cm, None, *UNIT_CM.values())):
            payload = build_skeleton(replace(skeleton, unit_cm=unit_cm), source)
            yield from (payload, pack_skeleton(payload))


def _of_base(container: Container, base: bytes) -> Iterator[bytes]:
    """The payloads of SKEL that writers derive from a skeleton where another axis points up."""
    skeleton = container.skeleton(base)
    for up_axis in UP_AXES:
        payload = build_skeleton(replace(skeleton, up_axis=up_axis, base=base), None)
        yield from (payload, pack_skeleton(payload))


def _names(container: Container, lost: set[bytes]) -> list[str]:
    """What an ASF that does not say it may be called."""
    aliases = container.directory.aliases.items()
    paths = [name for name, (_, target) in aliases if target in lost]
    return list(dict.fromkeys([*(PurePosixPath(path).stem for path in paths), NAMELESS]))
