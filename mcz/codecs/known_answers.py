"""Self-test: a known answer of each codec, decoded once per process before anything else.

It detects miscompiled kernels and fused products before real data are decoded.
``known_answers.json`` has the answers; ``tools/known_answers.py`` writes it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import accumulate, pairwise
from pathlib import Path
from threading import Lock

from mcz.codecs import CODECS
from mcz.codecs.contract import Codec, Layout, Model, Request, Span, model_finder
from mcz.errors import UnsupportedError
from mcz.model.motion import Channel, Joint, Skeleton
from mcz.model.numbers import Grid, GridKind

N_FRAMES = 16
_proved: set[str] = set()
_LOCK = Lock()
TABLE = Path(__file__).with_suffix(".json")


@dataclass(frozen=True, slots=True)
class KnownAnswer:
    """16 frames as stored by a version of a codec, in hex, and the SHA-256 of their values."""

    version: int
    grouping: str
    header: str
    streams: Sequence[str]
    sha256: str
    models: Sequence[tuple[int, str]] = ()  # kind and data


@cache
def known_answers() -> dict[str, KnownAnswer]:
    """Read the answers of ``TABLE``, by codec."""
    table = json.loads(TABLE.read_text("utf-8"))
    return {name: KnownAnswer(**answer) for name, answer in table.items()}


def answer_skeleton() -> Skeleton:
    """A skeleton of four joints and 15 channels."""
    turns = tuple(Channel(kind) for kind in ("rz", "rx", "ry"))
    moves = tuple(Channel(kind) for kind in ("tx", "ty", "tz"))
    return Skeleton(
        (
            Joint("hips", channels=moves + turns),
            Joint("spine", 0, (0.0, 20.0, 1.0), channels=turns),
            Joint("head", 1, (0.0, 30.0, -2.0), ((0.0, 9.0, 0.0),), channels=turns),
            Joint("hand", 1, (35.0, 10.0, 0.0), channels=turns),
        ),
        unit_cm=1.0,
    )


def answer_layout(grouping: str) -> Layout:
    """Layout of the known answer."""
    sizes = {"all": [15], "joint": [6, 3, 3, 3]}.get(grouping, [1] * 15)
    ends = list(accumulate(sizes, initial=0))
    groups = tuple(tuple(range(*pair)) for pair in pairwise(ends))
    grids = (Grid(GridKind.FIXED, 4),) * ends[-1]
    return Layout(N_FRAMES, groups, 1, answer_skeleton(), Fraction(30), grids)


def digest(codec: Codec, answer: KnownAnswer) -> str:
    """Return the SHA-256 of the ordinals or values that the codec decodes."""
    models = [Model(kind, bytes.fromhex(data)) for kind, data in answer.models]
    layout = answer_layout(answer.grouping)
    n_groups = len(layout.groups)
    layout = replace(
        layout, n_resolutions=len(answer.streams) // n_groups, find_model=model_finder(models)
    )
    streams = [bytes.fromhex(stream) for stream in answer.streams]
    is_earlier = answer.version < codec.version
    decode = codec.earlier.get(answer.version, codec.decode) if is_earlier else codec.decode
    decoded = decode(
        bytes.fromhex(answer.header),
        layout,
        [Span(0, N_FRAMES)],
        Request(0, N_FRAMES, tuple(range(n_groups))),
        lambda segment, resolution, group: streams[resolution * n_groups + group],
    )
    return hashlib.sha256(decoded.astype(decoded.dtype.newbyteorder("<")).tobytes()).hexdigest()


def check_known_answer(codec: Codec) -> None:
    """Decode the known answer of a codec of the table, once a process; raises UnsupportedError."""
    name = CODECS.find(codec.id, codec.preset) or codec.name
    if name in _proved:
        return
    answer = known_answers().get(name)
    if answer is None:
        return
    registered = CODECS.get(name)
    if registered is None or codec.decode not in (registered.decode, *registered.earlier.values()):
        return
    with _LOCK:
        if name in _proved:
            return
        if digest(codec, answer) != answer.sha256:
            raise UnsupportedError(
                f"codec {codec.name} fails its self-test in this installation; "
                "MCZ_LOOPS=interpreted decodes without compiled code"
            )
        _proved.add(name)
