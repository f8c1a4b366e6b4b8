"""Rebuild the lost skeletons of a damaged file from stored source files.

The id of a skeleton is a hash of its bytes, which proves the result.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from itertools import islice, product
from pathlib import PurePosixPath

import numpy as np

from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.directory import ClipRow
from mcz.container.encodings import chunk_id, pack_skeleton
from mcz.container.limits import check, check_decoded
from mcz.container.model_records import build_skeleton
from mcz.container.reader import Container
from mcz.errors import MczError
from mcz.files.reading.clip import Clip
from mcz.files.reading.signal_info import role_name
from mcz.files.reading.signal_reader import SignalReader
from mcz.model.motion import POSITION_KINDS, Channel, Joint, Motion, Signal, Skeleton, Source
from mcz.model.numbers import GridKind
from mcz.model.skeleton import AXES
from mcz.model.types import Values
from mcz.model.units import UNIT_CM
from mcz.sources import FORMATS, format_by_id

ASF = FORMATS["asf"]
LOST = "its skeleton is lost; its channels have no names"
NAMELESS = "skeleton"  # the name of a skeleton without one in its file or path


def restore_skeletons(container: Container) -> None:
    """Restore lost skeletons of clips in a salvaged file from their ASF in it."""
    lost = _lost_ids(container)
    if not lost:
        return
    for origin, candidates in _origins(container, lost):
        with suppress(MczError):  # it is of another format, or damaged too
            _restore(container, lost, candidates, origin)
    for row in container.directory.clips.values() if lost else ():
        if row.skeleton in lost:
            with suppress(MczError):
                _without_joints(container, row)


def _origins(container: Container, lost: set[bytes]) -> Iterator[tuple[str, Iterator[bytes]]]:
    """Possible origins of lost skeletons, and the payloads of SKEL that each gives."""
    directory = container.directory
    for id_ in directory.ids(ChunkType.SRCE):
        label = directory.shared[ChunkType.SRCE, id_].label
        yield f"its ASF, {label}", _asf_skels(container, id_, lost)
    for id_ in directory.ids(ChunkType.SKEL) if lost else ():
        yield f"SKEL {id_.hex()}", _base_skels(container, id_)
    for row in directory.clips.values() if lost else ():
        if row.skeleton in lost:
            yield f"the source of {row.name!r}", _clip_skels(container, row)


def _without_joints(container: Container, row: ClipRow) -> None:
    """Give a clip of a lost skeleton plain channels, if its hashes are right with them.

    Codecs of channels need only the groups of a skeleton's channels.
    """
    fields = container.clip(row)
    motion = _zero_motion(container, fields, row, None)
    for sizes in _joint_sizes(motion.skeleton.n_channels, fields.signals[0].groups.kind):
        names = iter(motion.skeleton.joints[0].channels)
        joints = [Joint("", channels=tuple(islice(names, size))) for size in sizes]
        payload = build_skeleton(Skeleton(tuple(joints), unit_cm=None), None)
        container.add_shared(ChunkType.SKEL, payload)
        other = replace(row, skeleton=chunk_id(ChunkType.SKEL, payload), damage=[LOST])
        if _has_its_hashes(Clip(container, other), container.strictly()):
            row.skeleton = other.skeleton
            row.damage.append(LOST)
            container.damage.append(f"clip {row.name!r}: {LOST}")
            return


def _joint_sizes(n_channels: int, kind: int) -> Iterator[list[int]]:
    """The numbers of channels that joints may have had: one way unless groups depend on it."""
    yield [n_channels]
    if kind == payloads.GROUP_JOINT:
        yield from ([size] * (n_channels // size) for size in (1, 3) if n_channels % size == 0)
        if n_channels % 3 == 0:
            yield [6, *[3] * (n_channels // 3 - 2)]


def _has_its_hashes(clip: Clip, container: Container) -> bool:
    """Return whether the values of a clip, read strictly, have the stated hashes."""
    try:
        for info in clip.signals:
            stops = [0, *(row.header.stop for row in info.rows)]
            if stops != [*(row.header.first for row in info.rows), info.layout.n_frames]:
                return False
            reader = SignalReader(container, info, None, 0, clip.name)
            clip.check_hash(info, *reader.read(info.skip, info.skip + clip.n_frames))
    except MczError:
        return False
    return True


def _restore(
    container: Container, lost: set[bytes], candidates: Iterable[bytes], origin: str
) -> None:
    for payload in candidates:
        id_ = chunk_id(ChunkType.SKEL, payload)
        if id_ in lost:  # SALV-09
            container.add_shared(ChunkType.SKEL, payload)
            container.damage.append(f"SKEL {id_.hex()} is lost; it is rebuilt from {origin}")
            lost.remove(id_)


def _lost_ids(container: Container) -> set[bytes]:
    """The ids of the skeletons that clips, skeletons and aliases name and the file has not."""
    directory = container.directory
    referenced = {row.skeleton for row in directory.clips.values()}
    referenced |= {
        target for of, target in directory.aliases.values() if of == payloads.OF_SKELETON
    }
    for id_ in directory.ids(ChunkType.SKEL):
        with suppress(MczError):
            base = container.skeleton_fields(id_).base
            referenced |= {base} if base else set()
    return {id_ for id_ in referenced if (ChunkType.SKEL, id_) not in directory.shared}


def _asf_skels(container: Container, template: bytes, lost: set[bytes]) -> Iterator[bytes]:
    """The payloads of SKEL that writers make of an ASF: under each name and length unit."""
    text = container.template(template, ASF.id)
    source = payloads.SkeletonSource(
        template=template, format=ASF.id, size=len(text), sha256=hashlib.sha256(text).digest()
    )
    for name in _asf_names(container, lost):
        yield from _unit_skels(ASF.read(text, name), source)


def _unit_skels(skeleton: Skeleton, source: payloads.SkeletonSource | None) -> Iterator[bytes]:
    """The payloads of SKEL of a skeleton, under each length unit that it may have."""
    for unit_cm in dict.fromkeys((skeleton.unit_cm, None, *UNIT_CM.values())):
        payload = build_skeleton(replace(skeleton, unit_cm=unit_cm), source)
        yield from (payload, pack_skeleton(payload))


def _clip_skels(container: Container, row: ClipRow) -> Iterator[bytes]:
    """The payloads of SKEL that writers make of a clip's own file, from its header.

    The frames, which may be lost, decide whether position channels replace the offset: both are
    tried.
    """
    fields = container.clip(row)
    for source in [fields.source] if fields.source else []:
        form = format_by_id(source.format)
        template = container.template(bytes(source.template), source.format)
        stored = Source(form.name, template, bytes(source.detail))
        text = form.write(_zero_motion(container, fields, row, stored))
        for base in _bases(container) if form.wants_skeleton else (None,):
            arguments = () if not form.wants_skeleton else (base,)
            skeleton: Skeleton = form.read(text, row.name, *arguments).skeleton
            for up_axis in dict.fromkeys((skeleton.up_axis, *AXES)):
                for joints in dict.fromkeys(_offset_ways(skeleton.joints)):
                    other = replace(skeleton, up_axis=up_axis, joints=joints)
                    yield from _unit_skels(other, None)


def _zero_motion(
    container: Container, fields: payloads.Clip, row: ClipRow, source: Source | None
) -> Motion:
    """A motion like that of a clip, with all values zero, on a joint of plain channels.

    Raises LimitError for one too large for the file.
    """
    signals = []
    for index, own in enumerate(fields.signals):
        where = f"clip {row.name!r}: signal {index}"
        n_rows = row.n_frames * own.samples_per_frame
        n_channels = sum(run.n_channels for run in own.grids)
        check(f"{where}: channels", n_channels, container.profile.channels)
        check_decoded(f"{where}: values", 8 * n_rows * max(1, n_channels), container.max_decoded)
        grids = tuple(run.grid for run in own.grids for _ in range(run.n_channels))
        is_integer = bool(grids) and all(grid.kind == GridKind.INTEGER for grid in grids)
        shape = n_rows, n_channels
        values: Values = np.zeros(shape, np.int64 if is_integer else np.float64)
        plain = tuple(Channel("", f"{column}") for column in range(len(grids)))
        signal = Signal(values, grids, own.name, own.samples_per_frame)
        role = "" if own.role == payloads.TIMES else role_name(own.role)
        channels = plain if index else None
        signals.append(replace(signal, channels=channels, role=role, of=own.of))
    joint = Joint("", channels=tuple(Channel("", f"{n}") for n in range(signals[0].n_channels)))
    return Motion(Skeleton((joint,)), tuple(signals), Fraction(1), name=row.name, source=source)


def _bases(container: Container) -> Iterator[Skeleton | None]:
    yield None
    for id_ in container.directory.ids(ChunkType.SKEL):
        with suppress(MczError):
            yield replace(container.skeleton(id_), base=id_)


def _offset_ways(joints: tuple[Joint, ...]) -> Iterator[tuple[Joint, ...]]:
    """Yield the joints with each choice of whether positions add to offsets or replace them."""
    has_position = [any(c.kind in POSITION_KINDS for c in joint.channels) for joint in joints]
    yield joints
    for of_roots, of_others in product((True, False), repeat=2):
        yield tuple(
            replace(joint, adds_to_offset=of_roots if joint.parent < 0 else of_others)
            if moves
            else joint
            for joint, moves in zip(joints, has_position, strict=True)
        )


def _base_skels(container: Container, base: bytes) -> Iterator[bytes]:
    """The payloads of SKEL that writers derive from a skeleton for another up axis."""
    skeleton = container.skeleton(base)
    for up_axis in AXES:
        payload = build_skeleton(replace(skeleton, up_axis=up_axis, base=base), None)
        yield from (payload, pack_skeleton(payload))


def _asf_names(container: Container, lost: set[bytes]) -> list[str]:
    aliases = container.directory.aliases.items()
    paths = [name for name, (_, target) in aliases if target in lost]
    return list(dict.fromkeys([*(PurePosixPath(path).stem for path in paths), NAMELESS]))
