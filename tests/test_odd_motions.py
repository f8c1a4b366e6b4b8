"""Motions of strange arrays and things: a file that opens and gives them back, or an MczError."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import mcz
from mcz.model.numbers import Grid, GridKind
from tests.motions import POSITIONS, skeleton, smooth

N_FRAMES, N_CHANNELS = 6, 10
CODECS = ("fast", "best", "raw")


def write_and_read(motion: mcz.Motion, codec: str = "fast", **params: Any) -> mcz.Motion:
    """The motion that a file of ``motion`` holds, which is sound by every check."""
    target = io.BytesIO()
    mcz.write(motion, target, codec, **params)
    assert mcz.verify(target.getvalue()) == []
    assert mcz.verify(target.getvalue(), quick=True) == []
    with mcz.open(target.getvalue()) as file:
        return file.only_clip().motion()


def unaligned_copy(array: np.ndarray) -> np.ndarray:
    memory = np.zeros(array.nbytes + 1, np.uint8)
    odd = memory[1:].view(array.dtype).reshape(array.shape)
    odd[...] = array
    return odd


def of_a_packed_record(array: np.ndarray) -> np.ndarray:
    record = np.zeros(array.shape[:-1], [("flag", "u1"), ("values", array.dtype, array.shape[-1:])])
    record["values"] = array
    return record["values"]


def repeat_first(array: np.ndarray) -> np.ndarray:
    return np.broadcast_to(array[:1], array.shape)


class Metres(np.ndarray):
    """A subclass whose results are of the class, too."""


def read_only_copy(array: np.ndarray) -> np.ndarray:
    array = np.ascontiguousarray(array)
    return np.frombuffer(array.tobytes(), array.dtype).reshape(array.shape)  # read-only


SHAPES: list[Callable[[np.ndarray], Any]] = [
    unaligned_copy,
    of_a_packed_record,
    repeat_first,
    read_only_copy,
    np.asfortranarray,
    lambda a: a[::-1, ::-1],
    lambda a: np.repeat(np.repeat(a, 2, 0), 3, 1)[::2, ::3],
    lambda a: a.view(Metres),
    lambda a: np.ma.masked_array(a, np.arange(a.size).reshape(a.shape) % 3 == 0),
    np.ma.masked_array,
    lambda a: a.astype(a.dtype.newbyteorder(">")),
    lambda a: a.astype(a.dtype.newbyteorder("<")),
    lambda a: a.tolist(),
    lambda a: tuple(map(tuple, a.tolist())),
    lambda a: a.astype(object),
    lambda a: a.astype(np.float32),
    lambda a: a.astype(np.float16),
    lambda a: a.astype(np.longdouble),
    lambda a: a.astype(complex),
    lambda a: a > 0,
    lambda a: a.astype(str),
    lambda a: a.ravel(),
    lambda a: a[None],
    lambda a: a[0, 0],
    lambda a: a[:, :0],
    lambda a: a[:0],
    lambda a: a[:, :3],
    lambda a: np.zeros(a.shape, "datetime64[s]"),
    lambda a: np.zeros(a.shape, [("x", "f8")]),
    lambda a: None,
    lambda a: "values",
    lambda a: [[1.0], [2.0, 3.0]],
    lambda a: memoryview(np.ascontiguousarray(a)),
]
NUMBERS = st.one_of(
    hnp.arrays(np.float64, (N_FRAMES, N_CHANNELS)),
    hnp.arrays(np.int64, (N_FRAMES, N_CHANNELS)),
    st.sampled_from([np.int8, np.int32, np.uint8, np.uint64]).flatmap(
        lambda kind: hnp.arrays(kind, (N_FRAMES, N_CHANNELS))
    ),
    st.just(smooth(N_FRAMES).values),
)


@given(NUMBERS, st.sampled_from(SHAPES), st.sampled_from(SHAPES), st.sampled_from(CODECS))
@pytest.mark.filterwarnings("ignore:overflow encountered|invalid value|.*casting complex")
def test_values_of_any_array(
    numbers: np.ndarray, shape: Callable[..., Any], again: Callable[..., Any], codec: str
) -> None:
    try:
        given_values = again(shape(numbers))
    except Exception:  # not an array any more
        given_values = shape(numbers)
    try:
        signal = mcz.Signal(given_values)
        motion = mcz.Motion(skeleton(), (signal,), frame_rate=100, name="odd")
        decoded = write_and_read(motion, codec)
    except mcz.MczError:
        return
    expected = np.ma.asarray(given_values)
    values, mask = decoded.signals[0].values, decoded.signals[0].mask
    np.testing.assert_array_equal(values, expected.data)
    valid = ~np.ma.getmaskarray(expected)
    np.testing.assert_array_equal(np.ones(values.shape, bool) if mask is None else mask, valid)


THINGS = [
    None, 0, 1, -1, 2.5, 10**300, 1e300, 5e-324, float("nan"), float("inf"), True, "", "x", "120",
    "\0", "\ud800", "a" * 100_000, b"", b"x", (), (1,), (None,), [], [[]], {}, {"x": 1}, {1, 2},
    np.float64(120), np.float32(0.1), np.int64(3), np.bool_(True), np.array(3), np.array([1.5]),
    np.arange(N_FRAMES), np.arange(N_FRAMES, dtype=float), np.zeros((N_FRAMES, N_CHANNELS)),
    np.zeros((N_FRAMES, N_CHANNELS), bool), np.ones((N_FRAMES, N_CHANNELS), np.int64),
    np.arange(N_FRAMES).reshape(-1, 1), np.arange(N_FRAMES)[::-1].astype(">i8"),
    np.ma.masked_array(np.arange(N_FRAMES), True), np.full(N_FRAMES, 2**63 - 1),
    np.zeros((N_FRAMES, N_CHANNELS), np.int32), (0, 0, 0), (0.0, 0.0, float("nan")),
    ("a", "b", "c"), np.zeros(3), object(), Fraction(1, 3), Fraction(2**70, 3), Fraction(-1),
    complex(1, 1), Grid(GridKind.FIXED, 4), (Grid(GridKind.FIXED, 4),) * N_CHANNELS,
    (Grid(GridKind.INTEGER),) * N_CHANNELS, [Grid(GridKind.BINARY32)] * N_CHANNELS,
    (Grid(GridKind.SCALED, scale=0.5),) * N_CHANNELS, ((0, 0, Grid(GridKind.FIXED, 2)),),
    ((3, 9, Grid(GridKind.FIXED, 2)), (3, 9, Grid(GridKind.FIXED, 3))),
    ((99, 0, Grid(GridKind.FIXED, 2)),), ((2, 1, Grid(GridKind.INTEGER)),), ((2, 1.0, "grid"),),
    POSITIONS, (mcz.Channel("", "a"),) * N_CHANNELS, [mcz.Channel("", "a", "V")] * N_CHANNELS,
    ("rx",) * N_CHANNELS, mcz.Exceptions(), mcz.Exceptions(np.array([1]), np.array([2]), (b"1e1",)),
    mcz.Exceptions(np.array([1]), np.array([2]), (b"\0",)), mcz.Joint("x"), (mcz.Joint("x"),),
    (mcz.Joint("a", channels=POSITIONS), mcz.Joint("a", 0)), skeleton(), mcz.Channel("", "x"),
    smooth(N_FRAMES).signals, list(smooth(N_FRAMES).signals), smooth(N_FRAMES).signals[0],
    smooth(N_FRAMES).signals * 2, mcz.Source("bvh", b""), mcz.Source("nothing", b"x"),
    mcz.Source("bvh", b"HIERARCHY", path="../x"), {"subject": "\ud800"}, {"x-a": 3}, {3: "x"},
    {"x-\0": "\0"}, {"subject": "7", "x-note": "a" * 70_000}, {"frame-numbers": "3"}, b"0" * 32,
    [("subject", "7")],
]  # fmt: skip
WHOLE = smooth(N_FRAMES, metadata={"subject": "7"}, frame_numbers=np.arange(3, 3 + N_FRAMES))
PARTS = {
    mcz.Motion: lambda thing: thing,
    mcz.Signal: lambda thing: replace(WHOLE, signals=(thing,)),
    mcz.Skeleton: lambda thing: replace(WHOLE, skeleton=thing),
    mcz.Joint: lambda thing: replace(
        WHOLE, skeleton=replace(WHOLE.skeleton, joints=(thing, *WHOLE.skeleton.joints[1:]))
    ),
    mcz.Channel: lambda thing: replace(
        WHOLE, signals=(replace(WHOLE.signals[0], channels=(thing,) * N_CHANNELS),)
    ),
    mcz.Source: lambda thing: replace(WHOLE, source=thing),
    mcz.Exceptions: lambda thing: replace(
        WHOLE, signals=(replace(WHOLE.signals[0], exceptions=thing),)
    ),
}
SAMPLES = {
    mcz.Motion: WHOLE,
    mcz.Signal: WHOLE.signals[0],
    mcz.Skeleton: WHOLE.skeleton,
    mcz.Joint: WHOLE.skeleton.joints[0],
    mcz.Channel: mcz.Channel("", "emg", "V"),
    mcz.Source: mcz.Source("bvh", b"HIERARCHY"),
    mcz.Exceptions: mcz.Exceptions(np.array([1]), np.array([2]), (b"1e1",)),
}
PLACES = [(kind, f.name) for kind in PARTS for f in fields(kind) if f.init]


@pytest.mark.parametrize(("kind", "name"), PLACES, ids=lambda v: getattr(v, "__name__", v))
def test_things_in_wrong_places(kind: type, name: str) -> None:
    """Each field of each part of a motion is given everything."""
    for thing in THINGS:
        try:
            part = replace(SAMPLES[kind], **{name: thing})
            motion = PARTS[kind](part)
            decoded = write_and_read(motion)
        except mcz.MczError:
            continue
        except Exception as error:
            raise AssertionError(f"{kind.__name__}.{name} = {thing!r:.200}: {error!r}") from error
        same(decoded, motion.with_consecutive_numbers())


def same(found: mcz.Motion, motion: mcz.Motion) -> None:
    """Every value and name of a motion comes back."""
    assert (found.frame_rate, found.name, dict(found.metadata)) == (
        motion.frame_rate,
        motion.name,
        dict(motion.metadata),
    )
    assert replace(found.skeleton, base=None) == replace(motion.skeleton, base=None)
    np.testing.assert_array_equal(numbers_of(found), numbers_of(motion))
    assert len(found.signals) == len(motion.signals)
    for one, two in zip(found.signals, motion.signals, strict=True):
        np.testing.assert_array_equal(one.values, two.values)
        np.testing.assert_array_equal(one.masked(), two.masked())
        assert (one.name, one.samples_per_frame) == (two.name, two.samples_per_frame)
        assert one.channels == two.channels


def numbers_of(motion: mcz.Motion) -> np.ndarray:
    return np.arange(1, len(motion) + 1) if motion.frame_numbers is None else motion.frame_numbers


GRIDS = st.sampled_from(
    [
        Grid(GridKind.FIXED, 4),
        Grid(GridKind.FIXED, 0),
        Grid(GridKind.TRIMMED, 3),
        Grid(GridKind.GENERAL, 6),
        Grid(GridKind.TEXT64),
        Grid(GridKind.TEXT32),
        Grid(GridKind.BINARY64),
        Grid(GridKind.BINARY32),
        Grid(GridKind.VAX_F),
        Grid(GridKind.SCALED, scale=0.25),
    ]
)
CELLS = st.one_of(
    st.sampled_from(
        [0.0, -0.0, 0.5, -1.25, 120.0, 1e300, 5e-324, np.inf, -np.inf, np.nan, 2.0**60]
    ),
    st.floats(width=32),
    st.integers(-1000, 1000).map(lambda n: n / 4),
)
TOKENS = [
    b"1e1",
    b"+0.5",
    b"0.50000",
    b"nan",
    b"-1.#IND",
    b"x",
    b"",
    b"1 2",
    b"\0",
    b"1.25\n",
    b"\xff",
]


@st.composite
def signals(draw: st.DrawFn, n_frames: int, first: bool) -> mcz.Signal:
    """A signal of any grids, changes of grids, exceptions, marks and channels."""
    rate = draw(st.integers(1, 3))
    n_channels = draw(st.integers(0, 3)) if draw(st.booleans()) or not first else N_CHANNELS
    shape = n_frames * rate, n_channels
    integers = bool(n_channels) and not first and draw(st.booleans())
    kind = np.int64 if integers else np.float64
    cells = st.integers(-(2**53), 2**53) if integers else CELLS
    values = draw(hnp.arrays(kind, shape, elements=cells))
    grid = st.just(Grid(GridKind.INTEGER)) if integers else GRIDS
    rows = st.integers(0, max(0, n_frames - 1)).map(lambda frame: frame * rate)
    changes = st.tuples(rows, st.integers(0, max(0, n_channels - 1)), grid)
    cells_of = st.tuples(*(st.integers(0, max(0, n - 1)) for n in shape))
    odd = sorted(draw(st.sets(cells_of, max_size=4 * draw(st.integers(0, 1)) * bool(values.size))))
    own = (mcz.Channel("", "emg"),) * n_channels
    return mcz.Signal(
        values,
        tuple(draw(grid) for _ in range(n_channels)) if draw(st.booleans()) else (),
        name=draw(st.sampled_from(["motion", "analog", "", "é" * 40])),
        samples_per_frame=rate,
        mask=draw(st.none() | hnp.arrays(np.bool_, shape)),
        exceptions=mcz.Exceptions(
            np.array([row for row, _ in odd], np.int64),
            np.array([channel for _, channel in odd], np.int64),
            tuple(draw(st.sampled_from(TOKENS)) for _ in odd),
        ),
        grid_changes=tuple(draw(st.lists(changes, max_size=3 if n_channels else 0))),
        channels=None if n_channels == N_CHANNELS and draw(st.booleans()) else own,
    )


@st.composite
def odd_motions(draw: st.DrawFn) -> mcz.Motion:
    n_frames = draw(st.integers(0, 5))
    rest = draw(st.lists(signals(n_frames, first=False), max_size=2))
    rates = st.sampled_from([None, 120, 29.97, np.float32(0.1), 1e-9, Fraction(1, 3), "60", 2**53])
    numbers = st.none() | hnp.arrays(
        np.int64, n_frames, elements=st.integers(-9, 2**52 - 1), unique=True
    ).map(np.sort)
    return mcz.Motion(
        skeleton(),
        (draw(signals(n_frames, first=True)), *rest),
        frame_rate=draw(rates),
        name=draw(st.sampled_from(["odd", "", "a/b", "a\0b", "\x1b[2J", "x" * 5000])),
        metadata=draw(st.sampled_from([{}, {"subject": "7"}, {"x-a": "\0"}, {"x-": "é"}])),
        frame_numbers=draw(numbers),
    )


@given(st.data(), st.sampled_from(CODECS))
def test_motions_come_back_or_are_refused(data: st.DataObject, codec: str) -> None:
    try:
        motion = data.draw(odd_motions())
        decoded = write_and_read(motion, codec)
    except mcz.MczError:
        return
    same(decoded, motion)
    again = write_and_read(decoded, codec)
    same(again, motion)


@pytest.mark.parametrize(
    ("name", "codec"),
    [
        *((f"walk.{suffix}", "fast") for suffix in ("bvh", "amc", "c3d", "trc", "csv")),
        *(("walk.bvh", "dwt"), ("walk.c3d", "dwt"), ("walk.csv", "dwt")),
    ],
)
def test_a_replaced_signal_has_a_source_of_its_own(
    samples: Path, tmp_path: Path, name: str, codec: str
) -> None:
    """The hash of the file that was read is not stated of one that is restored otherwise."""
    read = samples / name
    if not read.exists():
        mcz.write(mcz.read(samples / "walk.c3d"), tmp_path / "a.mcz")
        mcz.export(tmp_path / "a.mcz", tmp_path / "out", to=read.suffix[1:])
        read = next((tmp_path / "out").glob(f"*{read.suffix}"))
    motion = mcz.read(read)
    assert motion.source is not None and motion.source.sha256
    signal = motion.signals[0]
    values = signal.values.copy()
    values[3:7] = values[2]
    for changed in (
        replace(motion, signals=(replace(signal, values=values), *motion.signals[1:])),
        motion[2:20],
        motion,
    ):
        target = io.BytesIO()
        mcz.write(changed, target, codec)
        assert mcz.verify(target.getvalue()) == []
        with mcz.open(target.getvalue()) as file:
            clip = file.only_clip()
            assert clip.source is not None
            same_file = changed is motion
            assert (clip.source.sha256 == motion.source.sha256) == same_file
            if codec != "dwt":
                assert (clip.source_bytes() == read.read_bytes()) == same_file
            lossy = clip.motion()
        if name != "walk.c3d" or codec != "dwt":  # a grid of binary32 does not hold these
            assert len(write_and_read(lossy, "fast")) == len(lossy)


def test_a_replaced_skeleton_has_no_file_of_its_own(samples: Path) -> None:
    bones = mcz.read_skeleton(samples / "walk.asf")
    zeros = mcz.Signal(np.zeros((3, bones.n_channels)))
    motion = mcz.Motion(bones, (zeros,), frame_rate=120)
    assert write_and_read(motion).skeleton.source is not None
    longer = replace(bones.joints[1], tails=((0.0, 9.0, 0.0),))
    other = replace(bones, joints=(bones.joints[0], longer, *bones.joints[2:]))
    assert write_and_read(replace(motion, skeleton=other)).skeleton.source is None


@pytest.mark.parametrize("arguments", [
    {"channels": (mcz.Channel("", "a"),)},
    {"channels": ()},
    {"ordinals": np.zeros((20, 10))},
    {"mask": np.zeros((20, 10))},
    {"samples_per_frame": 2.0},
], ids=str)  # fmt: skip
def test_parts_that_do_not_fit_are_refused(arguments: dict[str, Any]) -> None:
    with pytest.raises(mcz.MotionError, match=f"^signal.*{next(iter(arguments))}"):
        mcz.Signal(smooth(20).values, **arguments)
