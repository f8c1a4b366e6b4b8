"""Valid: files made at random, which are legal and which no encoder of ours would write.

A seed gives a file and what is in it: clips of any codecs (build/random_clips.py) in closed DATA,
packets of all kinds and REPT, extensions, unknown chunks, what nobody refers to, attachments,
appends.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.container.chunks import END, FRAME, SEGMENT, ChunkFlag, ChunkType, Packet, build_packet
from mcz.container.limits import BASE, FORMAT, LARGE
from mcz.container.model_records import missing_runs, value_hash
from mcz.container.segments import FRESH, SegmentHeader
from mcz.files.writing.clip_writer import write_skeleton
from mcz.model.motion import Motion
from mcz.model.schema import build, deflate, parse, varint
from tools.records import build_record, extend
from tools.vectors.build.edits import both, plus, put
from tools.vectors.build.files import Crafter, Vector, arrays, partial
from tools.vectors.build.random_clips import clip
from tools.vectors.build.random_parts import (
    LETTERS,
    OLDER,
    Chance,
    Clip,
    skeleton,
    split_count,
    text,
)
from tools.vectors.build.source_files import ODD, PLAIN, take

OLD_COUNT = 80  # files that are older than posewave, and stay as they are
COUNT = OLD_COUNT + 3 * 8  # vectors: eight each begin with posewave, fast and best
SPEC = ("Grammar", "CLIP", "DATA")
TYPES = (b"xtra", b"zVOL", b"Qnot", b"NOTE")


@dataclass(slots=True)
class Made:
    """A file, its clips as they are decoded, the files that it gives back, and what is odd."""

    data: bytes
    motions: list[Motion]
    sources: list[tuple[str, bytes]]
    traits: list[str]


def vectors() -> Iterable[Vector]:
    for seed in range(COUNT):
        made = random_file(seed)
        traits = ", ".join(sorted(set(made.traits))) or "nothing odd"
        yield Vector(
            f"valid/random/{seed:03d}",
            SPEC,
            f"Made at random from seed {seed}: {traits}.",
            made.data,
            arrays=arrays(*made.motions),
            sources=tuple(made.sources),
            modes=("arrays", "sources") if made.sources else ("arrays",),
            parts=tuple(_parts(random.Random(f"parts {seed}"), made.motions)),
            seed=seed,
        )


def _parts(chance: Chance, motions: Sequence[Motion]) -> Iterator[Any]:
    """Requests for some frames, and for some joints, of a clip."""
    for motion in motions[:2]:
        a, b = sorted(chance.randrange(motion.n_frames + 1) for _ in range(2))
        yield partial(motion, (a, b))
        whole = motion.signals[0].values.dtype == np.int64  # what no columns are then is not said
        joints = [j for j, own in enumerate(motion.skeleton.joints) if own.channels or not whole]
        if joints and motion.signals[0].channels is None:
            chosen = chance.sample(joints, min(len(joints), chance.randrange(1, 4)))
            yield partial(motion, (a, b), chosen)


def random_file(seed: int) -> Made:
    """The file of this seed."""
    newer = {10: "posewave", 11: "fast", 12: "best"}  # of eight seeds each
    first = newer.get(seed // 8 if seed < COUNT else 0, OLDER[seed % len(OLDER)])
    return _Maker(random.Random(f"file {seed}"), first=first).file()


@dataclass
class _Maker:
    """The state of a file that is being made."""

    chance: Chance
    first: str  # the codec of the first clip
    motions: list[Motion] = field(default_factory=list)
    sources: list[tuple[str, bytes]] = field(default_factory=list)
    attached: dict[str, bytes] = field(default_factory=dict)
    aliases: list[tuple[str, bytes]] = field(default_factory=list)
    traits: list[str] = field(default_factory=list)

    def file(self) -> Made:
        chance = self.chance
        profile = LARGE if chance.random() < 0.2 else BASE
        self.crafter = _Odd(self, profile=profile, HEAD=self.head())
        for _ in range(chance.choice((1, 1, 1, 2, 3))):
            for item in self.items():
                item()
            index = chance.random() < 0.7
            self.traits += [] if index else ["a body without INDX"]
            self.crafter.finish(index=index)
        found = [*self.sources, *self.attached.items(), *self.aliases]
        return Made(self.crafter.data, self.motions, found, self.traits)

    def says(self, trait: str, probability: float) -> bool:
        """True if the file gets a trait."""
        found = self.chance.random() < probability
        self.traits += [trait] * found
        return found

    def bytes(self, most: int = 40) -> bytes:
        return bytes(self.chance.randrange(256) for _ in range(self.chance.randrange(most)))

    def head(self) -> Callable[[bytes], bytes]:
        """Versions that are read, and an extension."""
        least = self.chance.choice((2, 3, 4, 5, 8, 9))
        versions = bytes((0, self.chance.randrange(least, 256), *FORMAT))
        more = self.bytes() if self.says("an extension of HEAD", 0.2) else b""
        return lambda payload: versions + payload[4:] + more

    def items(self) -> list[Callable[[], None]]:
        """Chunks before a FOOT, in any order."""
        chance = self.chance
        found: list[Callable[[], None]] = []
        for item, probability in (
            (self.clip, 0.7),
            (self.clip, 0.3),
            (self.source, 0.15),
            (self.ancillary, 0.3),
            (self.write_unused, 0.3),
            (self.attachment, 0.25),
        ):
            found += [item] * (chance.random() < probability)
        if not self.motions and self.clip not in found:
            found.append(self.clip)
        chance.shuffle(found)
        return found

    def name(self, motion_names: bool = True) -> str:
        """A name that is new."""
        number = len(self.motions) if motion_names else len(self.attached) + len(self.aliases)
        return f"{self.chance.choice(LETTERS)}{number}"

    def ancillary(self) -> None:
        self.traits.append("unknown ancillary chunks")
        kind = self.chance.choice(TYPES)
        self.crafter.ancillary(kind, self.bytes(), safe_to_copy=self.chance.random() < 0.5)

    def write_unused(self) -> None:
        """A skeleton, a model or a template that no clip refers to, or one more time."""
        self.traits.append("what nobody refers to")
        which, crafter = self.chance.randrange(4), self.crafter
        if which == 0:
            write_skeleton(crafter, skeleton(self.chance, [2, 1]))
        elif which == 1:
            fields = {"kind": self.chance.choice((2, 77, 2**53 - 1)), "data": self.bytes()}
            crafter.shared(b"MODL", build_record(payloads.Modl, fields, "MODL"))
        elif which == 2:
            data = self.bytes()
            fields = {"format": 3, "flags": 1, "size": len(data), "data": deflate(data)}
            crafter.shared(b"SRCE", build_record(payloads.Srce, fields, "SRCE"))
        else:
            for (kind, _), place in list(crafter.directory.shared.items())[:1]:
                assert place.length is not None
                again = crafter.data[place.payload_offset :][: place.length]
                crafter.plain_chunk(kind, again)

    def attachment(self) -> None:
        """A file in parts, and perhaps further names of it."""
        self.traits.append("an attachment")
        path = f"a/{self.name(motion_names=False)}.bin"
        pieces = [self.bytes() * self.chance.choice((1, 9)) for _ in split_count(self.chance, 5)]
        self.crafter.parts(path, *pieces)
        self.attached[path] = b"".join(pieces)
        if self.says("an alias", 0.5):
            other = f"b/{self.name(motion_names=False)}"
            self.crafter.alias(other, payloads.OF_ATTACHMENT, path.encode())
            self.aliases.append((other, self.attached[path]))

    def source(self) -> None:
        """A clip with its source file."""
        self.traits.append("a source")
        path, data = self.chance.choice((("plain", PLAIN), ("odd", ODD)))
        name = self.name()
        motion = take(data, path)
        assert motion.source is not None
        motion = replace(motion, name=name, source=replace(motion.source, path=f"{name}/x.bvh"))
        self.crafter.edits |= {"CLIP": lambda payload: payload, "CEND": lambda payload: payload}
        self.crafter.edits.pop("row", None)
        self.crafter.clip(motion, segment_frames=self.chance.choice((1, 2, 0)))
        self.motions.append(motion)
        self.sources.append((f"{name}/x.bvh", data))
        if self.says("an alias of a clip", 0.3):
            self.crafter.alias(f"c/{name}", payloads.OF_CLIP, name.encode())
            self.aliases.append((f"c/{name}", data))

    def clip(self) -> None:
        codec = self.first or self.chance.choice(OLDER)
        self.first = ""
        made = clip(self.chance, self.name(), codec)
        self.traits.append(f"codec {made.codec.name}")
        motion = self.describe(made.motion)
        shown, edits = self.window(made, motion)
        self.crafter.edits |= edits
        if shown is motion and len(motion.signals) > 1:
            self.traits.append("several signals")
        given = {"codec": made.codec, "grouping": made.grouping}
        self.crafter.clip(motion, segment_frames=0, **given)
        self.motions.append(shown)
        if self.says("a quality record", 0.15):
            entries = [{"key": text(self.chance), "value": text(self.chance)} for _ in range(3)]
            fields = {"entries": entries, "extension": self.bytes()}
            self.crafter.ancillary(b"QUAL", build_record(payloads.Qual, fields, "QUAL"))

    def describe(self, motion: Motion) -> Motion:
        """Add random metadata to a clip."""
        chance = self.chance
        rate = chance.choice((None, Fraction(120), Fraction(30000, 1001), Fraction(1, 2**50)))
        metadata = {f"x-{k}": text(chance) for k in range(chance.choice((0, 0, 1, 3)))}
        numbers = None
        if motion.n_frames and self.says("frame numbers", 0.2):
            steps = [chance.choice((1, 1, 1, 5, -7, 0)) for _ in range(motion.n_frames)]
            numbers = np.cumsum(np.maximum(steps, 1)) + chance.randrange(-99, 99)
        return replace(
            motion,
            frame_rate=rate,
            frame_rate_exact=chance.random() < 0.7,
            metadata=metadata,
            frame_numbers=numbers,
        )

    def window(self, made: Clip, motion: Motion) -> tuple[Motion, dict[str, Any]]:
        """Visible part of the stored frames, and the edits of CLIP, CEND and INDX."""
        chance, n = self.chance, motion.n_frames
        skip = spare = 0
        if n and motion.frame_numbers is None and self.says("frames that are not shown", 0.2):
            skip = chance.randrange(n + 1)
            spare = chance.randrange(n + 1 - skip)
        opened = not (skip or spare) and self.says("an open clip", 0.25)
        shown = motion
        if skip or spare:
            signals = tuple(signal.cut(skip, n - spare) for signal in motion.signals)
            shown = replace(motion, signals=signals)
        size = n - skip - spare
        clip_edits: list[Any] = [
            put(payloads.Clip, "n_frames", varint(0 if opened else size)),
            *self.draw_extension(payloads.Clip, "CLIP"),
        ]
        for number in range(len(motion.signals)):
            place = f"signals.{number}"
            clip_edits += [
                put(payloads.Clip, f"{place}.skip", varint(skip)),
                put(payloads.Clip, f"{place}.spare", varint(spare)),
            ]
            if self.says("an extension of a signal", 0.15):
                more = self.bytes()
                clip_edits.append(lambda p, at=place, more=more: extend(payloads.Clip, p, at, more))
        gaps = b"\0"
        if opened:
            clip_edits.append(_open_clip)
            runs = [] if motion.frame_numbers is None else missing_runs(motion.frame_numbers)
            gaps = varint(len(runs)) + b"".join(varint(r.frames) + varint(r.length) for r in runs)
        if self.says("listed groups", 0.25):
            sizes = _sizes(made)
            listed = b"\3" + varint(len(sizes)) + b"".join(map(varint, sizes))
            clip_edits.append(put(payloads.Clip, "signals.0.groups", listed))
        hashes = [value_hash(s.values, s.mask) for s in shown.signals]
        cend_edits = [
            put(payloads.Cend, "n_frames", varint(size)),
            put(payloads.Cend, "missing", gaps),
            put(payloads.Cend, "value_sha256", varint(len(hashes)) + b"".join(hashes)),
            *self.draw_extension(payloads.Cend, "CEND"),
        ]

        def row(found: Any) -> Any:
            signals = tuple(replace(s, skip=skip, spare=spare) for s in found.signals)
            return replace(found, n_frames=size, signals=signals)

        return shown, {"CLIP": both(*clip_edits), "CEND": both(*cend_edits), "row": row}

    def draw_extension(self, schema: Any, name: str) -> list[Any]:
        return [plus(self.bytes())] if self.says(f"an extension of {name}", 0.15) else []


def _sizes(made: Clip) -> list[int]:
    """The channels of each group of the motion signal."""
    skeleton = made.motion.skeleton
    if made.grouping == "joint":
        return [len(joint.channels) for joint in skeleton.joints if joint.channels]
    n = skeleton.n_channels
    return [1] * n if made.grouping == "channel" else [n] * bool(n)


def _open_clip(payload: bytes) -> bytes:
    """CLIP with flag bit 0; the runs of missing frames go to CEND."""
    fields = parse(payloads.Clip, payload, "CLIP")
    if fields.time_base is not None:
        fields.time_base.missing = []
    fields.flags |= payloads.OPEN_CLIP
    return build(fields, "CLIP")


class _Odd(Crafter):
    """A Crafter whose clips lie in closed and open DATA in turn, with chunks between them."""

    def __init__(self, maker: _Maker, **more: Any) -> None:
        self.maker = maker
        self._closed = True  # there are neither open DATA nor a FOOT before
        super().__init__(**more)

    def end_clip(self, n_frames: int, source_sha256: bytes, value_sha256: Sequence[bytes]) -> None:
        made, self._made = self._made, []
        chance = self.maker.chance
        live = chance.random() < 0.5
        for header, streams in _interleave(chance, made):
            if self._next_packet is None and live and self.maker.says("open DATA", 0.5):
                self._begin()
            elif self._next_packet is not None and chance.random() < 0.3:
                self._end()
            if self._next_packet is None:
                self._between()
            self._put_segment(header, streams)
        if self._next_packet is not None:
            self._end()
        self._between()
        row = self._clip
        super().end_clip(n_frames, source_sha256, value_sha256)
        assert row is not None
        assert self.directory.clips[row.name] is not None

    def finish(self, *, index: bool = True) -> None:
        super().finish(index=index)
        self._closed = False

    def _between(self) -> None:
        """Chunks that say nothing to a reader that has the beginning."""
        maker = self.maker
        if maker.says("unknown chunks in a clip", 0.1):
            self.plain_chunk(maker.chance.choice(TYPES), maker.bytes(), ChunkFlag.ANCILLARY)
        if maker.says("REPT", 0.1):
            right = maker.chance.random() < 0.5 and self._closed
            payload = self._repeated_chunks() if right else maker.bytes()
            self.plain_chunk(ChunkType.REPT, payload, ChunkFlag.ANCILLARY)

    def _begin(self) -> None:
        self.open_data()
        self._closed = False

    def _end(self) -> None:
        """An end packet, bit 7 of whose kind has no meaning."""
        assert self._next_packet is not None
        fresh = self.maker.chance.random() < 0.5
        self._write(build_packet(Packet(END, self._next_packet, b"", fresh)))
        self._next_packet = None

    def _put_segment(self, header: SegmentHeader, streams: Sequence[bytes]) -> None:
        from mcz.container.segments import build_segment

        plain = (header.signal, header.n_frames, header.lead, header.tail) == (0, 1, 0, 0)
        short = plain and len(streams) == 1 and not header.flags & ~FRESH
        told = self._next_packet is not None and self._implying is not None
        kind = self.maker.chance.choice((1, 2, 3, 3)) if told and short else FRAME
        if told and kind != SEGMENT and self._implies_rest(header, streams):
            self.maker.traits.append("packets of kind 2")
            self._frame(header, streams[-1])
            return
        self._segment(header, build_segment(header, streams))


Segments = list[tuple[SegmentHeader, Sequence[bytes]]]


def _interleave(chance: Chance, made: Segments) -> Iterator[tuple[SegmentHeader, Sequence[bytes]]]:
    """The segments, those of each signal in order, the signals in any."""
    waiting: dict[int, Segments] = {}
    for part in made:
        waiting.setdefault(part[0].signal, []).append(part)
    while waiting:
        signal = chance.choice(sorted(waiting))
        yield waiting[signal].pop(0)
        if not waiting[signal]:
            del waiting[signal]
