"""NPY and NPZ: files, and what their templates can say beside."""

from __future__ import annotations

import zlib
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.formats.arrays.layout import TYPES, Kind, Piece
from mcz.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.numbers import Grid, GridKind
from tools.vectors.build import wavelet_clips
from tools.vectors.build.array_files import (
    SPEC,
    Member,
    floats,
    npy,
    npz,
    number_piece,
    plain_npz,
    take_arrays,
    with_pieces,
)
from tools.vectors.build.files import Whole, file_of
from tools.vectors.build.source_files import BOTH, path_of, restored, unhashed
from tools.vectors.build.wavelet_clips import HAAR, Plan, Wave

NAN64, NAN32 = 0xFFF8000000000123, 0x7FA00001


def add(shelf: Whole) -> None:
    _npy(shelf)
    _npz(shelf)
    _bodies(shelf)
    _words(shelf)
    _rounded(shelf)
    _pieces(shelf)
    _lossy(shelf)


def _hold(shelf: Whole, name: str, purpose: str, motion: Motion, **made: Any) -> None:
    sources = ((path_of(motion), restored(motion)),)
    data = file_of(motion, **made)
    shelf.hold(f"arrays-{name}", SPEC, purpose, data, motion, sources=sources, modes=BOTH)


def _npy(shelf: Whole) -> None:
    rows = floats(6, 5)
    rows[1, 2], rows[2, 0], rows[3, 3] = np.nan, -0.0, np.inf
    rows.view(np.uint64)[4, 1] = NAN64
    motion = take_arrays(npy(rows), "rows.npy")
    purpose = "An NPY file of binary64: NaNs with and without other bits, -0, infinity."
    _hold(shelf, "npy", purpose, motion, segment_frames=2)
    columns = floats(5, 2, 3).astype(">f4")
    columns.view(">u4")[3, 1, 0] = NAN32
    motion = take_arrays(npy(columns, by_columns=True), "columns.npy")
    _hold(shelf, "npy-columns", "Big-endian binary32, column after column.", motion)
    decimals = np.round(floats(6, 3), 2)
    motion = take_arrays(npy(decimals, room=16), "decimals.npy")
    assert {grid.kind for grid in motion.signals[0].grids} == {GridKind.FIXED}
    _hold(shelf, "npy-decimals", "Binary64 that are short decimals.", motion)


def _npz(shelf: Whole) -> None:
    ends = {"i": (-1, 0), "u": (0, 0)}
    every = {}
    for code in TYPES:
        kind, size = code[0], int(code[1])
        if kind == "f":
            array = floats(3, 2).astype(code)
            array[1, 1] = np.nan
        elif kind == "b":
            array = np.array([[True, False], [False, True], [True, True]])
        else:
            most = min(2 ** (8 * size - (kind == "i")) - 1, 2**53)
            least = max(ends[kind][0] * (most + 1), -(2**53))
            array = np.array([[0, 1], [least, most], [2, 3]], code)
        every[code] = array.astype(f"<{code}" if size > 1 else code)
    motion = take_arrays(plain_npz(every), "types.npz")
    _hold(shelf, "npz-types", "An NPZ of all types of numbers.", motion)
    pose = {
        "positions": floats(7, 2, 3),
        "times": np.arange(7) / 8,
        "forces": floats(21, 2, seed=5).astype("<f4"),
        "fps": np.array(30.0),
        "who": np.array("Ada"),
        "bones": floats(9),
    }
    motion = take_arrays(plain_npz(pose, wide=True, comment=b"a take"), "take.npz")
    assert [signal.samples_per_frame for signal in motion.signals] == [1, 1, 3]
    purpose = "Signals, one of three samples a frame, arrays that are kept, a ZIP64 directory."
    _hold(shelf, "npz", purpose, motion, segment_frames=3)
    members = (
        Member("rows.npy", npy(floats(4, 3)), wide=False, described=True),
        Member("deflated.npy", zlib.compress(b"anything")[2:-4], wide=False, method=8, size=8),
        Member("wrong.npy", npy(floats(4, 2)), wide=False, checksum=0x12345678),
        Member("none.txt", b"", wide=False),
        Member("pickled.npy", npy(np.zeros(1), "<f8").replace(b"'<f8'", b"'|O' ")),
    )
    motion = take_arrays(npz(members), "odd.npz")
    purpose = "A data descriptor, a deflated and a pickled member, a CRC-32 that is wrong."
    _hold(shelf, "npz-odd", purpose, motion)


def _bodies(shelf: Whole) -> None:
    poses = np.zeros((4, 156))
    poses[:, :66] = floats(4, 66)
    body = {
        "trans": floats(4, 3, seed=9),
        "gender": np.array("female"),
        "mocap_framerate": np.array(120.0),
        "betas": floats(16, seed=3),
        "poses": poses,
        "root_orient": poses[:, :3],
        "pose_body": poses[:, 3:66],
    }
    motion = take_arrays(plain_npz(body), "body.npz")
    assert len(motion.signals) == 1 and motion.skeleton.n_joints == 52
    _hold(shelf, "body", "A body of 52 joints, whose columns are in two arrays each.", motion)


def _words(shelf: Whole) -> None:
    """Values that no array of that type has: of other grids, beyond its ends, invalid."""
    odd = [0.5, 1.5, 2.5, -0.5, -1.5, 1e300, -1e300, np.nan, np.inf, -np.inf, -0.0, 65519.9]
    odd += [65520.0, 2.0**-25, 2.0**-25 * 1.5, 6.1e-5, 3e-8, -3.0000001, 2.0**53 + 2, 255.5]
    odd += [2.0**31 - 0.5, 127.5, -128.5, 3.4028235677973366e38, 1e-46, 1.1, 2049.0, 2051.0]
    values = np.array([odd, [*range(len(odd))]]).T
    mask = np.ones(values.shape, bool)
    mask[3, 0], mask[5, 1] = False, False
    for kind in (GridKind.BINARY64, GridKind.TEXT64):
        grid = Grid(kind)
        joints = (Joint("odd", channels=(Channel("", "a"), Channel("", "b"))),)
        held = np.where(np.isfinite(values), values, 7.0) if kind == GridKind.TEXT64 else values
        signal = Signal(held, (grid, grid), mask=mask)
        pieces = [number_piece(0, type_, (0, 2)) for type_ in range(len(TYPES))]
        pieces += [number_piece(0, type_, (1, 1), (0, 2), flags=3) for type_ in range(len(TYPES))]
        model = take_arrays(npy(floats(2, 2)), "odd.npy")
        motion = replace(model, skeleton=Skeleton(joints), signals=(signal,), name="odd")
        name = f"words-{kind.name.lower()}"
        purpose = f"Numbers on the grid {kind.name} as numbers of every type."
        _hold(shelf, name, purpose, with_pieces(motion, pieces))


def _rounded(shelf: Whole) -> None:
    """Halves of steps of binary16, by less than a binary32 says; NaN with other bits."""
    model = take_arrays(npy(floats(4, 1)), "rounded.npy")
    values = np.array([[1 + 2.0**-11 + 2.0**-40], [2 + 2.0**-10 - 2.0**-40], [1 + 2.0**-24], [0.1]])
    pieces = [number_piece(0, type_, (0, 1)) for type_ in (9, 10)]
    signal = Signal(values, (Grid(GridKind.BINARY64),))
    purpose = "A number is rounded once, from binary64 to its type."
    _hold(shelf, "rounded", purpose, with_pieces(replace(model, signals=(signal,)), pieces))
    single = np.array([NAN32, 0xFFC00000, 0x3FC00000, 0xFF800001], np.uint32).view(np.float32)
    motion = take_arrays(npy(single[:, None]), "nan.npy")
    pieces = [number_piece(0, type_, (0, 1)) for type_ in (9, 10, 11)]
    purpose = "NaN of a binary32 as numbers of other types: their bits and sign are not kept."
    _hold(shelf, "nan", purpose, with_pieces(motion, pieces))


def _pieces(shelf: Whole) -> None:
    """A template that is no file that anybody knows."""
    motion = take_arrays(npy(floats(3, 2)), "pieces.npy")
    count = Piece(Kind.COUNT, after=b"|", size=5)
    pieces = [
        Piece(Kind.SIZE8, start=0, stop=9),
        Piece(Kind.TEXT, b"text"),
        Piece(Kind.OWN, b""),
        count,
        Piece(Kind.CRC, start=1, stop=4),
        Piece(Kind.OWN, b"own"),
        Piece(Kind.SIZE4, start=9, stop=9),
        number_piece(0, 11, (1, 1), (0, 1)),
        Piece(Kind.CRC, start=1, stop=4),
    ]
    _hold(shelf, "pieces", "Pieces of every kind.", with_pieces(motion, pieces))
    sizes = [
        Piece(Kind.COUNT, after=b"|", size=2),
        Piece(Kind.SIZE4, start=0, stop=3),
        Piece(Kind.SIZE8, start=1, stop=1),
        Piece(Kind.CRC, start=0, stop=3),
        Piece(Kind.CRC, start=2, stop=2),
    ]
    purpose = "A count without blanks, a CRC-32 of sizes, another of nothing."
    _hold(shelf, "sizes", purpose, with_pieces(motion, sizes))
    other = take_arrays(npy(np.round(floats(4, 3), 1)), "other.npy")
    changed = np.round(other.signals[0].values + 1, 1)
    signal = replace(other.signals[0], values=changed)
    purpose = "Other values than the array had."
    _hold(shelf, "changed", purpose, unhashed(replace(other, signals=(signal,))))


def _lossy(shelf: Whole) -> None:
    """Values of mrdwt, which are no binary32; what is invalid becomes NaN."""
    thirds = [33, -33, 66, -67, 100, 101, -1, 0, 1, 12345, -99, 7]
    plan = Plan(len(thirds), HAAR, 0, 3)
    channels = [Wave([column]) for column in (thirds, thirds[::-1], [3 * k for k in thirds])]
    values = wavelet_clips.values_of(plan, channels)
    mask = np.ones(values.shape, bool)
    mask[4:6, 1], mask[0, 2] = False, False
    for code in ("<f4", ">f2", "<f8"):
        whole = take_arrays(npy(floats(len(thirds), 3).astype(code)), f"lossy-{code[1:]}.npy")
        signal = replace(whole.signals[0], values=values, mask=mask, ordinals=None)
        motion = replace(whole, signals=(signal,))
        made = {"codec": wavelet_clips.codec_of(plan, channels), "grouping": "channel"}
        purpose = f"A lossy clip of {code[1:]}, with gaps."
        _hold(shelf, f"lossy-{code[1:]}", purpose, motion, **made)
