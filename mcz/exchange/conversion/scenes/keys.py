"""Keys of a scene: the frames that are needed so that every node stays within a bound.

Interpolation is glTF's: linear for vectors of 3, spherical for quaternions of 4, x y z w. Each
channel, the turns or the shifts of a node, gets a limit in every frame; its keys are chosen in one
pass. Then all nodes are placed by these keys, rounded to float32 as in the file. If a node is too
far off, the limits of the channels that move it are tightened there, and the keys are chosen again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError
from mcz.exchange.conversion.scenes.nodes import Node, Scene
from mcz.hints import Hint
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2, Ints

STRAIGHT = 1e-12  # square of the distance of two quaternions between which all is linear


@kernel
def choose_keys(
    times: Floats, exact: Floats2, rounded: Floats2, limits: Floats, kept: Bytes
) -> None:
    """Mark in ``kept`` (n_frames,) the frames that become keys: from each the farthest possible.

    ``exact`` (n_frames, 3 or 4) are the targets, ``rounded`` the values of keys; ``limits``
    (n_frames,) are the greatest distances of interpolated values from their targets.
    """
    n = len(exact)
    interpolated = np.empty(4)
    kept[:] = 0
    kept[0] = 1
    first = 0
    while first < n - 1:
        low, step = first + 1, 2
        while first + step < n and _fits(
            times, exact, rounded, limits, first, first + step, interpolated
        ):
            low = first + step
            step *= 2
        high = min(first + step, n)
        while high - low > 1:
            middle = (low + high) // 2
            if _fits(times, exact, rounded, limits, first, middle, interpolated):
                low = middle
            else:
                high = middle
        first = low
        kept[first] = 1


def _fits(
    times: Floats,
    exact: Floats2,
    rounded: Floats2,
    limits: Floats,
    first: int,
    last: int,
    interpolated: Floats,
) -> bool:
    """Return True if all frames between two keys of one hemisphere are near enough."""
    width = exact.shape[1]
    angle = _angle(rounded[first], rounded[last], width)
    if angle < 0.0:
        return False
    span = times[last] - times[first]
    for frame in range(first + 1, last):
        share = (times[frame] - times[first]) / span
        _interpolate(rounded[first], rounded[last], width, angle, share, interpolated)
        square = 0.0
        for k in range(width):
            square += (interpolated[k] - exact[frame, k]) ** 2
        if not square <= limits[frame] * limits[frame]:
            return False
    return True


def _angle(one: Floats, other: Floats, width: int) -> float:
    """Angle between quaternions, 0 if linear interpolation suffices; -1 beyond 90 degrees."""
    if width == 3:
        return 0.0
    dot, square = 0.0, 0.0
    for k in range(4):
        dot += one[k] * other[k]
        square += (one[k] - other[k]) ** 2
    if dot < 0.0:
        return -1.0
    if square < STRAIGHT:
        return 0.0
    half = 0.5 * math.exp(0.5 * math.log(square))  # the sine of half the angle
    angle = half
    for _ in range(4):
        angle -= (math.sin(angle) - half) / math.cos(angle)
    return 2.0 * angle


def _interpolate(
    one: Floats, other: Floats, width: int, angle: float, share: float, out: Floats
) -> None:
    """Write the interpolation at ``share`` to ``out``; quaternions get the length 1."""
    start, end = 1.0 - share, share
    if angle > 0.0:
        sine = math.sin(angle)
        start, end = math.sin(start * angle) / sine, math.sin(end * angle) / sine
    square = 0.0
    for k in range(width):
        out[k] = start * one[k] + end * other[k]
        square += out[k] * out[k]
    if width == 4:
        for k in range(4):
            out[k] *= 1.5 - 0.5 * square  # as good as 1 / sqrt(square), so near to 1


@kernel
def interpolate_keys(
    times: Floats, frames: Ints, keys: Floats2, first: int, key: int, out: Floats2
) -> None:
    """Write the interpolation of keys from frame ``first`` on to ``out`` (n, 3 or 4).

    ``frames`` (n_keys,) and ``keys`` (n_keys, 3 or 4); key number ``key`` is the last one at or
    before frame ``first``. After the last key its value stays.
    """
    width = keys.shape[1]
    interpolated = np.empty(4)
    angle = -2.0
    for number in range(len(out)):
        frame = first + number
        while key + 1 < len(frames) and frames[key + 1] <= frame:
            key += 1
            angle = -2.0
        last = min(key + 1, len(frames) - 1)
        if angle < -1.5:
            angle = _angle(keys[key], keys[last], width)
        share = 0.0
        if last > key:
            start = times[frames[key]]
            share = (times[frame] - start) / (times[frames[last]] - start)
        _interpolate(keys[key], keys[last], width, angle, share, interpolated)
        for k in range(width):
            out[number, k] = interpolated[k]


@kernel
def place_nodes(
    above_turns: Floats2,
    above_places: Floats2,
    turns: Floats2,
    shifts: Floats2,
    out_turns: Floats2,
    out_places: Floats2,
) -> None:
    """Compute a node's turns and places in the world from its parent's.

    ``out_turns`` (n, 4) and ``out_places`` (n, 3); the others have n rows, or one for all frames.
    """
    for frame in range(len(out_places)):
        a = min(frame, len(above_turns) - 1)
        t = min(frame, len(turns) - 1)
        s = min(frame, len(shifts) - 1)
        p = min(frame, len(above_places) - 1)
        x, y, z, w = above_turns[a, 0], above_turns[a, 1], above_turns[a, 2], above_turns[a, 3]
        i, j, k, r = turns[t, 0], turns[t, 1], turns[t, 2], turns[t, 3]
        out_turns[frame, 0] = w * i + x * r + y * k - z * j
        out_turns[frame, 1] = w * j - x * k + y * r + z * i
        out_turns[frame, 2] = w * k + x * j - y * i + z * r
        out_turns[frame, 3] = w * r - x * i - y * j - z * k
        u, v, q = shifts[s, 0], shifts[s, 1], shifts[s, 2]
        # 2 (axis x shift), for shift + w c + axis x c
        c, d, e = 2.0 * (y * q - z * v), 2.0 * (z * u - x * q), 2.0 * (x * v - y * u)
        out_places[frame, 0] = above_places[p, 0] + u + w * c + y * e - z * d
        out_places[frame, 1] = above_places[p, 1] + v + w * d + z * c - x * e
        out_places[frame, 2] = above_places[p, 2] + q + w * e + x * d - y * c


SHARE = 1.2  # share of the bound that a single channel may use at first
TIGHTER = 0.75
ROUNDS = 40  # after so many, nodes that are too far off get a key in each frame
BLOCK_FRAMES = 4096
SAMPLED_FRAMES = 200  # for estimates of levers
NO_TURN = np.array([[0.0, 0.0, 0.0, 1.0]])
FREE = 1e-3  # limit of a channel that turns only its own node


@dataclass(slots=True, eq=False)
class Keys:
    """The keys of a channel: ``frames`` (n_keys,) and ``values`` (n_keys, 3 or 4), float32."""

    frames: Ints
    values: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class KeyErrors:
    """The errors of a scene with its keys.

    ``error`` is the greatest distance of a node from its exact place, over all frames, in meters,
    or in units if these are unknown; it is met in ``frame`` by ``point``. ``n_keys`` of the
    ``n_values`` that keys in every frame would have.
    """

    error: float
    frame: int | None
    point: str | None
    n_keys: int
    n_values: int


@dataclass(frozen=True, slots=True, eq=False)
class SceneKeys:
    """Keys of every node's turns and shifts; None for one that stays at rest."""

    turns: list[Keys | None]
    shifts: list[Keys | None]
    errors: KeyErrors


def find_keys(scene: Scene, bound: float) -> SceneKeys:
    """The keys of ``scene`` that keep every node within ``bound``; 0: a key in every frame.

    Raises OptionError if float32 numbers alone exceed it.
    """
    return _KeySearch(scene, bound).run()


@dataclass(slots=True, eq=False)
class _Channel:
    """``exact`` and ``rounded`` (n_frames, 3 or 4); ``limits`` (n_frames,), in its own terms."""

    exact: Floats
    rounded: Floats
    limits: Floats
    keys: Keys = field(init=False)

    def choose(self, times: Floats) -> None:
        """Choose all keys again."""
        errors = np.sqrt(((self.exact - self.rounded[:1]) ** 2).sum(axis=1))
        if (errors <= self.limits).all() or (self.exact == self.exact[:1]).all():
            kept = np.zeros(1, np.int64)
        else:
            marks = np.zeros(len(times), np.uint8)
            choose_keys(times, self.exact, self.rounded, self.limits, marks)
            kept = np.flatnonzero(marks)
            width = self.exact.shape[1]
            if (width + 1) * len(kept) >= width * len(times):
                kept = np.arange(len(times))  # as short: all such channels share their times
        self.keys = Keys(kept, self.rounded[kept].astype(np.float32))

    def fill(self, times: Floats, first: int, stop: int) -> Floats:
        """Interpolate the frames ``first <= f < stop``; one row for a single key."""
        frames, values = self.keys.frames, self.keys.values.astype(np.float64)
        out = np.empty((stop - first if len(frames) > 1 else 1, values.shape[1]))
        interpolate_keys(
            times, frames, values, first, int(np.searchsorted(frames, first, "right")) - 1, out
        )
        return out


class _KeySearch:
    def __init__(self, scene: Scene, bound: float) -> None:
        self.scene, self.bound, self.nodes = scene, bound, scene.nodes
        self.turns = list(map(self._turns, self.nodes, _descendant_distances(scene)))
        self.shifts = [self._shifts(node) for node in self.nodes]

    def _turns(self, node: Node, lever: float) -> _Channel | None:
        if node.turns is None or not len(node.turns):
            return None
        # The distance of quaternions is half the distance at the end of a lever of 1.
        limit = SHARE * self.bound / (2.0 * lever) if lever else FREE
        return _channel(node.turns, limit, node)

    def _shifts(self, node: Node) -> _Channel | None:
        if node.shifts is None or not len(node.shifts):
            return None
        return _channel(node.shifts, SHARE * self.bound, node)

    def run(self) -> SceneKeys:
        """Choose keys until all nodes are within the bound."""
        times = self.scene.times
        for channel in self._channels():
            channel.choose(times)
        errors = self.errors()
        for number in range(ROUNDS + 2) if self.bound else ():
            wrong = errors > self.bound
            if not wrong.any():
                break
            if number > ROUNDS:
                raise OptionError(
                    f"rounding to float32 alone causes an error of {errors.max():.2g} m, but "
                    f"at most {self.bound:.2g} m is allowed",
                    clip=self.scene.name,
                    hint=Hint.KEY_ERROR,
                )
            self._tighten_bounds(wrong, 0.0 if number == ROUNDS else TIGHTER)
            errors = self.errors()
        return SceneKeys(
            [self._keys(channel, NO_TURN) for channel in self.turns],
            [self._keys(c, n.rest) for c, n in zip(self.shifts, self.nodes, strict=True)],
            self._measure_errors(errors),
        )

    def _channels(self) -> Iterator[_Channel]:
        return (channel for channel in (*self.turns, *self.shifts) if channel is not None)

    @staticmethod
    def _keys(channel: _Channel | None, rest: Floats) -> Keys | None:
        if channel is None:
            return None
        at_rest = (
            len(channel.keys.frames) == 1 and (channel.keys.values == rest.astype(np.float32)).all()
        )
        return None if at_rest else channel.keys

    def _tighten_bounds(self, wrong: NDArray[np.bool_], by: float) -> None:
        """Tighten the channels that move the nodes that are ``wrong``, (n_frames, n_nodes)."""
        moved = wrong.copy()  # of each node, whether a node below it or it itself is wrong
        below = np.zeros_like(wrong)
        for number in range(len(self.nodes) - 1, -1, -1):
            parent = self.nodes[number].parent
            if parent >= 0:
                moved[:, parent] |= moved[:, number]
                below[:, parent] |= moved[:, number]
        for channels, where in ((self.turns, below), (self.shifts, moved)):
            for number, channel in enumerate(channels):
                if channel is not None and where[:, number].any():
                    channel.limits[where[:, number]] *= by
                    channel.choose(self.scene.times)

    def errors(self) -> Floats:
        """Position errors of each node, (n_frames, n_nodes); 0 where unknown."""
        n_frames = len(self.scene.times)
        errors = np.empty((n_frames, len(self.nodes)))
        for first in range(0, n_frames, BLOCK_FRAMES):
            stop = min(first + BLOCK_FRAMES, n_frames)
            placed: list[tuple[Floats, Floats]] = []
            for number, node in enumerate(self.nodes):
                placed.append(self._place(number, node, placed, first, stop))
                deviations = placed[-1][1] - node.places[first:stop]
                errors[first:stop, number] = np.sqrt((deviations * deviations).sum(axis=1))
        return np.nan_to_num(errors, copy=False, nan=0.0)

    def _place(
        self, number: int, node: Node, placed: list[tuple[Floats, Floats]], first: int, stop: int
    ) -> tuple[Floats, Floats]:
        """Turns of a node in the world, (n, 4), and its places, (n, 3)."""
        turn, shift, times = self.turns[number], self.shifts[number], self.scene.times
        turns = NO_TURN if turn is None else turn.fill(times, first, stop)
        rest = node.rest.astype(np.float32).astype(np.float64)[None]
        shifts = rest if shift is None else shift.fill(times, first, stop)
        above = placed[node.parent] if node.parent >= 0 else (NO_TURN, np.zeros((1, 3)))
        out_turns, out_places = np.empty((stop - first, 4)), np.empty((stop - first, 3))
        place_nodes(above[0], above[1], turns, shifts, out_turns, out_places)
        return out_turns, out_places

    def _measure_errors(self, errors: Floats) -> KeyErrors:
        channels = list(self._channels())
        n_keys = sum(len(channel.keys.frames) for channel in channels)
        n_values = len(self.scene.times) * len(channels)
        if not errors.size:
            return KeyErrors(0.0, None, None, n_keys, n_values)
        frame, number = divmod(int(errors.argmax()), errors.shape[1])
        worst = float(errors[frame, number])
        return KeyErrors(worst, frame, self.nodes[number].name, n_keys, n_values)


def _channel(exact: Floats, limit: float, node: Node) -> _Channel:
    rounded = exact.astype(np.float32).astype(np.float64)
    limits = np.full(len(exact), limit)
    limits[~node.is_visible] = np.inf
    return _Channel(np.ascontiguousarray(exact), rounded, limits)


def _descendant_distances(scene: Scene) -> list[float]:
    """Greatest distance from each node to a descendant, with the longest bones of some frames."""
    step = max(1, len(scene.times) // SAMPLED_FRAMES)
    levers = [0.0] * len(scene.nodes)
    for number in range(len(levers) - 1, -1, -1):
        above = scene.nodes[number].parent
        if above >= 0:
            bone = scene.nodes[number].places[::step] - scene.nodes[above].places[::step]
            length = float(np.sqrt((bone * bone).sum(axis=1)).max(initial=0.0))
            levers[above] = max(levers[above], length + levers[number])
    return levers
