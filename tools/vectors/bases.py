"""Base files of the tables, by name: motions that the encoders of mcz write, and whole files.

A row names one as ``dance(8)``, several clips as ``dance() + dance(3, name='encore')``, a vector
as ``valid/qbc/plain``.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from mcz.codecs import CODECS
from mcz.container import payloads
from mcz.container.chunks import ChunkFlag, ChunkType
from mcz.container.limits import LARGE
from mcz.container.segments import SegmentHeader
from mcz.model.motion import Channel, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind
from mcz.model.schema import varint
from mcz.sources import format_of
from tools.vectors import source_bases
from tools.vectors.build import by_hand as written
from tools.vectors.build import extensions, motions
from tools.vectors.build.copies import content_of, copies_of, payload_of
from tools.vectors.build.edits import Made, both, indexed, put, raw_stream
from tools.vectors.build.files import Crafter, file_of, finish_file, rehash
from tools.vectors.build.source_files import ODD, PLAIN, set_path, take
from tools.vectors.codec_bases import coded, noted

SOURCES = Path(__file__).parent / "sources"


@dataclass(frozen=True)
class Base:
    """A file: clips that ``file_of`` writes, or its bytes, and what it holds."""

    motions: tuple[Motion, ...] = ()
    data: bytes | None = None
    sources: tuple[tuple[str, bytes], ...] = ()
    attached: tuple[tuple[str, str], ...] = ()  # names of attachments, and aliases

    bodies: tuple[Base, ...] = ()  # each with its own FOOT, one behind the other

    def __or__(self, other: Base) -> Base:
        bodies = (*(self.bodies or (self,)), other)
        return Base(self.motions + other.motions, None, self.sources + other.sources, (), bodies)

    def __add__(self, other: Base) -> Base:
        sources = self.sources + other.sources
        return Base(self.motions + other.motions, None, sources, self.attached + other.attached)


BASES: dict[str, Callable[..., Base]] = {}
MADE: dict[str, bytes] = {}  # valid vectors of this run, that rows name as bases
VECTORS = Path(__file__).resolve().parents[2] / "conformance/vectors"


def base(make: Callable[..., Any]) -> Callable[..., Any]:
    """Register ``make`` for rows to name; it returns a Base, a Motion or the bytes of a file."""

    def call(*given: Any, **named: Any) -> Base:
        made = make(*given, **named)
        if isinstance(made, Motion):
            return Base((made,))
        return Base((), made) if isinstance(made, bytes) else made

    BASES[make.__name__] = call
    return make


for _make in (
    motions.dance,
    motions.with_exceptions,
    motions.with_grid_changes,
    motions.with_mask,
    coded,
    noted,
    source_bases.table,
    source_bases.many_sections,
    source_bases.c3d,
    source_bases.outputs,
    source_bases.array,
    source_bases.long_array,
    source_bases.two_arrays,
    source_bases.one,
    source_bases.mannequin,
    source_bases.acclaim_take,
    source_bases.acclaim_example,
):
    base(_make)


@base
def by_hand(name: str) -> Base:
    """A file that was written as hex, see ``build/by_hand.py``."""
    motions, sources = written.HELD[name]
    return Base(motions, written.bytes_of(name), sources)


@base
def plain() -> Base:
    return Base((take(PLAIN, "plain"),), None, (("plain.bvh", PLAIN),))


@base
def numbered(*numbers: int) -> Motion:
    """The dance with these frame numbers."""
    return motions.dance(len(numbers), frame_numbers=np.array(numbers))


@base
def zeros(n_frames: int, name: str = "wave", *beside: str, rate: int | None = None) -> Motion:
    """So many frames, of the channels of the skeleton that a row of coded clips has.

    ``beside``: further signals, as ``analog:3:2``, of 3 channels and 2 rows a frame.
    """
    signals = [Signal(np.zeros((n_frames, 0)))]
    for label, size, rows in (word.rsplit(":", 2) for word in beside):
        values = np.zeros((n_frames * int(rows), int(size)))
        channels = (Channel(""),) * int(size)
        signals.append(Signal(values, name=label, channels=channels, samples_per_frame=int(rows)))
    frame_rate = Fraction(rate) if rate else None
    return Motion(Skeleton(()), tuple(signals), name=name, frame_rate=frame_rate)


@base
def read(file: str, path: str = "") -> Base:
    """The clip of a file below ``sources``, which it restores as ``path``."""
    data = (SOURCES / file).read_bytes()
    stem = PurePosixPath(path or file).stem
    motion = set_path(format_of(path or file).read(data, stem), path or file)
    return Base((motion,), None, ((path or file, data),))


@base
def odd() -> Base:
    return Base((take(ODD, "odd"),), None, (("odd.bvh", ODD),))


@base
def analog() -> Motion:
    """The dance beside a second signal of two rows a frame."""
    signal = Signal(np.arange(8.0).reshape(8, 1), name="analog", role="analog", samples_per_frame=2)
    signal = replace(signal, channels=(Channel("", "force"),))
    return replace(motions.dance(), signals=(*motions.dance().signals, signal))


@base
def timed(
    times: str = "0 10 20 20",
    unit: str = "ms",
    role: str = "times",
    *,
    twice: bool = False,
    first: int = 1,
) -> Motion:
    """The dance beside a signal of a channel; of a frame with "?" the value is invalid.

    ``twice``: and beside another, equal but for its role, which it has not. ``first``: the number
    of the first frame.
    """
    words = times.split()
    values = np.array([[float(word) if word != "?" else 15.0] for word in words])
    mask = np.array([[word != "?"] for word in words])
    signal = Signal(values, name="clock", channels=(Channel("", "t", unit),), role=role)
    signal = replace(signal, mask=None if mask.all() else mask)
    dance = motions.dance(len(words), frame_numbers=first + np.arange(len(words)))
    more = (signal, replace(signal, role="")) if twice else (signal,)
    return replace(dance, signals=(*dance.signals, *more))


@base
def many_roles() -> Motion:
    """The dance beside signals of other roles, the residuals those of the second of two."""
    dance, values = motions.dance(), np.arange(8.0).reshape(4, 2)
    roles = ("analog", "outputs", "rotations", "confidence", "residuals")
    channels = (Channel("", "a"), Channel("", "b"))
    more = (Signal(values, name="words", channels=channels, role=role) for role in roles[:-1])
    last = Signal(values, name="words", channels=channels, role=roles[-1], of=2)
    return replace(dance, signals=(*dance.signals, *more, last))


@base
def no_motion() -> Motion:
    """Analog samples alone."""
    signal = replace(motions.dance().signals[0], role="analog", name="emg")
    return motions.dance(signals=(replace(signal, channels=motions.dance().skeleton.channels),))


@base
def own_channels() -> Motion:
    """The dance whose channels are its own, not those of the joints."""
    dance = motions.dance()
    return motions.dance(signals=(replace(dance.signals[0], channels=dance.skeleton.channels),))


@base
def wide(n_channels: int) -> Motion:
    """No frames of so many channels of one joint, in an archive."""
    hips = replace(motions.puppet().joints[0], channels=motions.channels("tx") * n_channels)
    skeleton = replace(motions.puppet(), joints=(hips,))
    return Motion(skeleton, (Signal(np.zeros((0, n_channels))),), name="wide")


@base
def chain(n_joints: int) -> Motion:
    """No frames of so many joints, each the child of the one before, the first with a channel."""
    first = replace(motions.puppet().joints[0], channels=motions.channels("tx"))
    others = [replace(first, name=f"j{i}", parent=i - 1, channels=()) for i in range(1, n_joints)]
    skeleton = replace(motions.puppet(), joints=(first, *others))
    return Motion(skeleton, (Signal(np.zeros((0, 1))),), name="chain")


@base
def signals(n_signals: int) -> Motion:
    """The dance with so many signals, those beside the motion of one channel each."""
    signal = Signal(np.zeros((4, 1)), channels=(Channel("", "force"),))
    others = tuple(replace(signal, name=f"s{i}") for i in range(1, n_signals))
    return replace(motions.dance(), signals=(*motions.dance().signals, *others))


@base
def broad(n_channels: int) -> Motion:
    """One frame of so many channels of one joint."""
    signal = Signal(np.zeros((1, n_channels)), (motions.HUNDREDTHS,) * n_channels)
    return replace(wide(n_channels), signals=(signal,), name="broad")


@base
def gapped(n_frames: int) -> Motion:
    """Frames whose third channel is invalid but in the first."""
    mask = np.ones((n_frames, 6), np.bool_)
    mask[1:, 2] = False
    signal = replace(motions.dance(n_frames).signals[0], mask=mask)
    return motions.dance(n_frames, signals=(signal,))


@base
def masked() -> Motion:
    """Three frames, the middle one invalid."""
    mask = np.ones((3, 6), np.bool_)
    mask[1] = False
    signal = Signal(motions.numbers(3, 6), (motions.HUNDREDTHS,) * 6, mask=mask)
    return motions.dance(signals=(signal,))


@base
def twin() -> Motion:
    """A second dance, of another skeleton."""
    skeleton = replace(motions.puppet(), name="twin")
    return motions.dance(3, name="encore", skeleton=skeleton)


@base
def column(values: list[float], kind: str, digits: int = 0, **more: Any) -> Motion:
    """One channel on a grid of this kind."""
    return motions.column(values, Grid(GridKind[kind], digits, **more))


@base
def many_forces(n_channels: int) -> Motion:
    """No frames, and a second signal of so many channels of its own."""
    channels = (Channel("", "c"),) * n_channels
    own = Signal(np.zeros((0, n_channels)), name="many", channels=channels)
    return motions.dance(0, signals=(*motions.dance(0).signals, own))


@base
def nothing() -> Base:
    """A file without clips."""
    return Base()


@base
def copies(stored: bool = False, few: int | None = None) -> bytes:
    """Two clips, one with a source, and copies of their chunks, or of so few; no INDX."""
    crafter = Crafter()
    for motion in (take(PLAIN, "plain"), motions.dance()):
        crafter.clip(motion)
    content = content_of(copies_of(crafter)[:few], crafter.offset)
    crafter.plain_chunk(ChunkType.COPY, payload_of(content, stored=stored), ChunkFlag.ANCILLARY)
    return finish_file(crafter, index=False)


@base
def everything() -> Base:
    """A clip with a source, one with channels of its own, an attachment and its alias."""
    texts = tuple((name, b"attached " * 9) for name in ("b.txt", "c.txt"))
    return Base((take(PLAIN, "plain"), own_channels()), None, (("plain.bvh", PLAIN), *texts))


@base
def extended() -> bytes:
    """Everything, and an extension in each structure."""
    return extensions.write_extended(*everything().motions)


@base
def segments_of_zeros(n_rows: int, n_segments: int, padding: int = 0, n_channels: int = 1) -> bytes:
    """Zeros in segments of one byte of data, and an ancillary chunk of so many bytes."""
    stream = raw_stream([[0]] * n_channels, [0] * n_channels)
    edges = [n_rows * i // n_segments for i in range(n_segments + 1)]
    most = 2**24
    hashed = [rehash(np.zeros((n_rows, n_channels)))] if n_rows <= most else []

    def many(_: Made) -> Made:
        pairs = zip(edges, edges[1:], strict=False)
        return [(SegmentHeader(0, a, b - a), [stream]) for a, b in pairs]

    crafter = Crafter(
        segments=many,
        CLIP=put(payloads.Clip, "n_frames", varint(n_rows)),
        CEND=both(put(payloads.Cend, "n_frames", varint(n_rows)), *hashed),
        row=indexed(n_frames=n_rows),
    )
    zeros = motions.column([0.0], Grid(GridKind.FIXED, 0))
    if n_channels > 1:
        zeros = motions.panel([[0.0]] * n_channels, [Grid(GridKind.FIXED, 0)] * n_channels)
    crafter.clip(zeros)
    if padding:
        crafter.ancillary(b"xtra", bytes(padding))
    return finish_file(crafter)


def _limited_file(base: Base, options: dict[str, Any]) -> bytes:
    """The file of clips beyond the base profile, which its HEAD has all the same."""
    crafter = Crafter()
    crafter.profile = LARGE
    for motion in base.motions:
        crafter.clip(motion, **options)
    return finish_file(crafter)


@base
def parted(name: str, *pieces: str) -> bytes:
    """An attachment in these parts, and no INDX."""
    crafter = Crafter()
    crafter.parts(name, *(piece.encode() for piece in pieces))
    return finish_file(crafter, index=False)


@base
def attached(name: str, content: str, alias: str = "") -> Base:
    """An attachment, and an alias of it, before the clips."""
    return Base((), None, ((name, content.encode()),), ((name, alias),))


def _with_attachments(base: Base, index: bool = True) -> bytes:
    return _body(Crafter(), base, index)


def _body(crafter: Crafter, base: Base, index: bool) -> bytes:
    for (name, content), (_, alias) in zip(base.sources, base.attached, strict=True):
        crafter.parts(name, content)
        if alias:
            crafter.alias(alias, payloads.OF_ATTACHMENT, name.encode())
    return finish_file(crafter, *base.motions, index=index)


def _append_clips(base: Base, index: bool = True, continued: bool = False) -> bytes:
    crafter = Crafter()
    crafter.continued = continued
    for body in base.bodies:
        _body(crafter, body, index)
    return crafter.data


def _evaluate(node: ast.expr) -> Any:
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _evaluate(node.left) + _evaluate(node.right)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr):
        return _evaluate(node.left) | _evaluate(node.right)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        given = [ast.literal_eval(argument) for argument in node.args]
        named = {k.arg: ast.literal_eval(k.value) for k in node.keywords if k.arg}
        return BASES[node.func.id](*given, **named)
    raise ValueError(f"{ast.unparse(node)!r} is no base file")


@cache
def base_of(text: str) -> Base:
    """The base that a row names."""
    if text.startswith("valid/"):
        return Base((), MADE.get(text) or (VECTORS / f"{text}.mcz").read_bytes())
    result: Base = _evaluate(ast.parse(text, mode="eval").body)
    return result


def base_bytes(text: str, options: Mapping[str, Any]) -> bytes:
    """The file of a base; ``options`` are those of ``file_of``."""
    listed = {k: tuple(v) if isinstance(v, list) else v for k, v in options.items()}
    return _write_base(text, tuple(sorted(listed.items())))


@cache
def _write_base(text: str, options: tuple[tuple[str, Any], ...]) -> bytes:
    content = base_of(text)
    if content.data is not None:
        return content.data
    named = dict(options)
    if content.bodies:
        return _append_clips(content, **named)
    if content.attached:
        return _with_attachments(content, **named)
    if "codec" in named:
        (named["codec"],) = (c for c in CODECS.values() if c.name == named["codec"])
    if named.pop("beyond", False):
        return _limited_file(content, named)
    return file_of(*content.motions, **named)
