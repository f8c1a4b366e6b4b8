"""C3D files of a part of the frames, of lossy clips, of words beyond their ends."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs import raw
from mcz.codecs.contract import Codec
from mcz.formats import c3d
from mcz.formats.c3d_layout import C3dDetail, C3dTemplate
from mcz.motion import Motion, Signal
from mcz.numbers import Grid, GridKind
from mcz.schema import build, parse
from tests.formats.c3d_files import SGI, Made
from tools.vectors.build import wavelet_clips
from tools.vectors.build.c3d_files import C3D_SPEC, ORDERS, c3d_file, c3d_rotations, take_c3d
from tools.vectors.build.cuts import CUT_HEADING, cut, shown
from tools.vectors.build.files import Whole, file_of
from tools.vectors.build.lossless_clips import codec_of
from tools.vectors.build.motions import numbers
from tools.vectors.build.source_files import BOTH, path_of, restored, unhashed
from tools.vectors.build.wavelet_clips import HAAR, Plan, Wave

RANGE = f"{CUT_HEADING}; {C3D_SPEC}"
BEHIND = b"behind the data"


def add(shelf: Whole) -> None:
    _fields(shelf)
    _behind(shelf)
    _renumbered(shelf)
    _gaps(shelf)
    _limited(shelf)
    _lossy(shelf)
    _signals(shelf)
    _range(shelf)


def _range(shelf: Whole) -> None:
    """Files of a part of the frames, made of what is kept of the whole."""
    first = take_c3d(c3d_file(8, first=40, tail=b"behind" + bytes(506)).build(), "prop")
    data = cut(file_of(first, segment_frames=3), frames=(2, 6))
    purpose = "Frames 2 to 5 of a C3D file: its fields follow, what is behind its data is padded."
    motion = replace(shown(first, 2, 6), frame_numbers=np.arange(42, 46))
    text = c3d.write(motion)
    assert struct.unpack_from("<HH", text, 6) == (42, 45)
    shelf.hold(
        "c3d-range", f"Cutting without re-encoding; {C3D_SPEC}", purpose, data, motion,
        sources=(("prop.c3d", text),), modes=BOTH,
    )  # fmt: skip


def _hold(
    shelf: Whole,
    name: str,
    purpose: str,
    motion: Motion,
    spec: str = C3D_SPEC,
    codec: Codec = raw.CODEC,
) -> None:
    """The clip as it is, with size and hash of what it makes."""
    motion = unhashed(motion)
    data = file_of(motion, codec=codec)
    sources = ((path_of(motion), restored(motion)),)
    shelf.hold(f"c3d-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def _hold_cut(
    shelf: Whole, name: str, purpose: str, file: Made, frames: tuple[int, int], first: int = 1
) -> bytes:
    """Frames start <= f < stop of a file, the first of which has the number ``first``."""
    whole = take_c3d(file.build(), name)
    data = cut(file_of(whole, segment_frames=2), frames=frames)
    motion = replace(shown(whole, *frames), frame_numbers=np.arange(*frames) + first)
    if frames[0] == frames[1]:
        motion = replace(motion, frame_numbers=None)
    text = restored(motion)
    sources = ((path_of(whole), text),)
    shelf.hold(f"c3d-{name}", RANGE, purpose, data, motion, sources=sources, modes=BOTH)
    return text


def counted(n_frames: int, first: int, **more: Any) -> Made:
    """A file that states its frames in every way."""
    stated: dict[str, dict[str, Any]] = {"TRIAL": {}, "POINT": {}}
    file = c3d_file(n_frames, first=first, parameters=stated, **more)
    stated["TRIAL"]["ACTUAL_START_FIELD"] = file.long(first)
    stated["TRIAL"]["ACTUAL_END_FIELD"] = file.long(first + n_frames - 1)
    stated["POINT"]["LONG_FRAMES"] = file.real(float(n_frames))
    return file


def _fields(shelf: Whole) -> None:
    for order, processor in ORDERS.items():
        file = counted(5, 40, processor=processor, tail=BEHIND)
        purpose = f"Frames 1 to 3 of 5, in fields of every kind of number; {order}."
        text = _hold_cut(shelf, f"fields-range-{order}", purpose, file, (1, 4), 40)
        kind = ">HH" if processor == SGI else "<HH"
        assert struct.unpack_from(kind, text, 6) == (41, 43)
        assert len(text) % 512 == 0
    purpose = "No frame of 5: the number of the first frame is that of the source file."
    text = _hold_cut(shelf, "fields-range-none", purpose, counted(5, 40, tail=BEHIND), (2, 2))
    assert struct.unpack_from("<HH", text, 6) == (40, 39)
    file = counted(3, 1, size=2, processor=SGI)
    purpose = "The last frame of 3, of integers."
    _hold_cut(shelf, "fields-range-integers", purpose, file, (2, 3))


def _behind(shelf: Whole) -> None:
    """What is kept behind the data: without the zeros at its end, and padded again."""
    tails = {
        "shared": (bytes(3) + BEHIND * 50 + bytes(700), "600 bytes of it in the template"),
        "exact": (bytes(512 - len(BEHIND)) + BEHIND + bytes(9), "one block of it, and zeros"),
        "zeros": (bytes(1500), "zeros alone, of which nothing is left"),
    }
    for name, (tail, what) in tails.items():
        purpose = f"Frames 0 to 2 of 4 of a C3D file with bytes behind the data: {what}."
        _hold_cut(shelf, f"tail-range-{name}", purpose, c3d_file(4, tail=tail), (0, 3))
    file = c3d_file(16, 4, channels=0)
    file.tail = bytes(-len(file.build()) % 512)
    purpose = "As many frames as fill a block: nothing is padded."
    text = _hold_cut(shelf, "range-block", purpose, file, (4, 12))
    assert len(text) % 512 == 0
    purpose = "The first of two frames of a C3D file with rotations, and bytes behind these."
    file = c3d_rotations()
    file.tail += BEHIND
    text = _hold_cut(shelf, "rotations-tail-range", purpose, file, (0, 1))
    assert BEHIND in text and len(text) % 512 == 0


def _renumbered(shelf: Whole) -> None:
    """All frames, with other numbers: fields follow, but for that of the rotations."""
    cases = (
        ("", 7, "from 7 on"),
        ("-negative", -5, "from -5 on, which fields limit to 0"),
        ("-long", 70_000, "from 70,000 on, beyond a word"),
        ("-great", 2**52 - 4, "from 2^52 - 4 on, beyond two words"),
    )
    for name, first, what in cases:
        file = counted(4, 40, tail=BEHIND)
        motion = replace(take_c3d(file.build(), f"renumbered{name}"), frame_numbers=None)
        motion = replace(motion, frame_numbers=np.arange(first, first + 4))
        purpose = f"As many frames as the source file has, numbered {what}."
        _hold(shelf, f"renumbered{name}", purpose, motion, f"{C3D_SPEC}; Time")
    whole = take_c3d(c3d_rotations().build(), "renumbered-rotations")
    assert whole.source is not None
    fields = parse(C3dDetail, whole.source.detail, "detail")
    template = parse(C3dTemplate, whole.source.template, "template")
    kinds = [field.kind for field in template.fields]
    sizes = [4 if kind in (1, 4, 5) else 2 for kind in kinds]
    at = sum(sizes[: kinds.index(6)])
    values = bytearray(fields.values)
    values[at : at + 2] = b"\x63\0"
    fields.values = bytes(values)
    source = replace(whole.source, detail=build(fields, "detail"))
    motion = replace(whole, source=source, frame_numbers=np.array([9, 10]))
    purpose = (
        "Other numbers of all frames: the block of the rotations stays as stated, a wrong one."
    )
    _hold(shelf, "renumbered-rotations", purpose, motion)


def _gaps(shelf: Whole) -> None:
    """Invalid points of lossless clips, whose residuals say so or do not."""
    minus, nan, odd_nan = 0xBF800000, 0x7FC00000, 0xFFC12345
    residuals = [0, 0x3F000000, 0x80000000, 0x7F800000, minus, 0xFF800000, nan, odd_nan]
    for order in ("intel", "sgi", "dec"):
        dec = order == "dec"
        file = c3d_file(len(residuals), 3, channels=0, processor=ORDERS[order])
        file.points[:, 0, 3] = file.points[:, 1, 3] = (
            [0, 0x4080, 0x8000, 0xC080] * 2 if dec else residuals
        )
        file.points[:, 2, 3] = 0
        if not dec:
            file.points[1::2, 1, 2] = odd_nan
            file.points[0::2, 2, 1] = odd_nan
        whole = take_c3d(file.build(), f"gaps-{order}")
        mask = np.ones(whole.signals[0].values.shape, np.bool_)
        mask[:, 0], mask[:, 4:6] = False, False
        first = replace(whole.signals[0], mask=mask)
        motion = replace(whole, signals=(first, *whole.signals[1:]))
        purpose = (
            f"Points that the mask calls invalid, in one or two coordinates, under residuals of "
            f"every sort, and NaN that it calls valid; {order}."
        )
        _hold(shelf, f"gaps-{order}", purpose, motion, f"Masks; {C3D_SPEC}")
        if order == "sgi":
            purpose = f"{purpose.removesuffix('.')}, in lossless."
            _hold(shelf, "gaps-lossless", purpose, motion, f"Masks; {C3D_SPEC}", codec_of())
    file = c3d_file(4, size=2)
    file.points[:, :, 3] = [[0, 5], [0xFFFF, 7], [0x8000, 0], [1, 0xFFFF]]
    whole = take_c3d(file.build(), "gaps-integers")
    mask = np.ones(whole.signals[0].values.shape, np.bool_)
    mask[1:, 2] = False
    first = replace(whole.signals[0], mask=mask)
    motion = replace(whole, signals=(first, *whole.signals[1:]))
    purpose = "Invalid points of integers, which have no NaN: their words stay."
    _hold(shelf, "gaps-integers", purpose, motion, f"Masks; {C3D_SPEC}")


def _limited(shelf: Whole) -> None:
    """Ordinals beyond a word."""
    far = [
        0,
        32_767,
        32_768,
        -32_768,
        -32_769,
        65_535,
        65_536,
        2**31,
        -(2**31),
        2**50,
        -(2**50),
        -1,
    ]
    for name, unsigned in (("", False), ("-unsigned", True)):
        more = {"ANALOG": {"FORMAT": (-1, (8,), b"UNSIGNED")}} if unsigned else {}
        file = c3d_file(12, 1, 2, 1, size=2, scale=0.5, parameters=more)
        whole = take_c3d(file.build(), f"limited{name}")
        by_name = {signal.name: signal for signal in whole.signals}
        points = np.array([far, far[::-1], far], np.float64).T / 2
        words = np.array(far).reshape(-1, 1)
        signals = (
            replace(by_name["motion"], values=points, ordinals=None, mask=None),
            replace(by_name["residuals"], values=words),
            replace(by_name["analog"], values=np.hstack([words, words[::-1]])),
        )
        purpose = f"Integers beyond a word of 16 bits{', analog ones unsigned' * unsigned}."
        _hold(shelf, f"limited{name}", purpose, replace(whole, signals=signals))


def _lossy(shelf: Whole) -> None:
    """Values of mrdwt halfway between words."""
    halves = [5, -5, 15, -15, 25, -25, 35, 125, 3_276_705, 3_276_715, -3_276_805, -3_276_815, 1]
    for scale in (0.1, 0.5, 1.0):
        file = c3d_file(len(halves), 1, 0, 1, size=2, scale=scale)
        whole = take_c3d(file.build(), f"lossy-scale-{scale}")
        plan = Plan(len(halves), HAAR, 0, 2 if scale == 0.1 else 1)
        by_channel = [halves, halves[::-1], [round(k * scale * 2) for k in halves]]
        channels = [Wave([column]) for column in by_channel]
        values = wavelet_clips.values_of(plan, channels)
        first = replace(whole.signals[0], values=values, mask=None, ordinals=None)
        motion = replace(whole, signals=(first, *whole.signals[1:]))
        data = file_of(motion, codec=wavelet_clips.codec_of(plan, channels), grouping="channel")
        sources = ((path_of(motion), restored(motion)),)
        name = f"c3d-lossy-ties-{scale}".replace(".", "-")
        purpose = f"Values of a lossy clip halfway between two words, of a scale of {scale}."
        spec = f"Value to ordinal; {C3D_SPEC}"
        shelf.hold(name, spec, purpose, data, motion, sources=sources, modes=BOTH)


def _signals(shelf: Whole) -> None:
    """Signals that are found by name: the first behind the motion."""
    whole = take_c3d(c3d_file(3, 2, 2, 1, size=2).build(), "names")
    motion, residuals, analog = whole.signals
    other = replace(analog, values=analog.values[::-1].copy())
    gauge = Signal(numbers(3, 1), (Grid(GridKind.FIXED, 2),), "gauge", channels=analog.channels[:1])
    named = (replace(motion, name="analog"), gauge, analog, other, residuals)
    purpose = "A motion called analog, two signals of that name, and one that the file has not."
    _hold(shelf, "names", purpose, replace(whole, signals=named))
