"""Keys of a scene: the frames that are needed so that every node stays within a bound.

Interpolation is glTF's. Each channel, the turns or the shifts of a node, gets a limit in every
frame; its keys are chosen in one pass. Then all nodes are placed by these keys, rounded to float32
as in the file. If a node is too far off, the limits of the channels that move it are tightened
there, and the keys are chosen again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError
from mcz.exchange.conversion.scenes.key_kernels import choose, fill, hang
from mcz.exchange.conversion.scenes.nodes import Node, Scene
from mcz.hints import Hint
from mcz.kinematics.chain import Floats
from mcz.model.types import Ints

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
        off = np.sqrt(((self.exact - self.rounded[:1]) ** 2).sum(axis=1))
        if (off <= self.limits).all() or (self.exact == self.exact[:1]).all():
            kept = np.zeros(1, np.int64)
        else:
            marks = np.zeros(len(times), np.uint8)
            choose(times, self.exact, self.rounded, self.limits, marks)
            kept = np.flatnonzero(marks)
            width = self.exact.shape[1]
            if (width + 1) * len(kept) >= width * len(times):
                kept = np.arange(len(times))  # as short: all such channels share their times
        self.keys = Keys(kept, self.rounded[kept].astype(np.float32))

    def fill(self, times: Floats, first: int, stop: int) -> Floats:
        """Interpolate the frames ``first <= f < stop``; one row for a single key."""
        frames, values = self.keys.frames, self.keys.values.astype(np.float64)
        out = np.empty((stop - first if len(frames) > 1 else 1, values.shape[1]))
        fill(times, frames, values, first, int(np.searchsorted(frames, first, "right")) - 1, out)
        return out


class _KeySearch:
    def __init__(self, scene: Scene, bound: float) -> None:
        self.scene, self.bound, self.nodes = scene, bound, scene.nodes
        self.turns = list(map(self._turns, self.nodes, _levers(scene)))
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
            self._tighten(wrong, 0.0 if number == ROUNDS else TIGHTER)
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

    def _tighten(self, wrong: NDArray[np.bool_], by: float) -> None:
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
                off = placed[-1][1] - node.places[first:stop]
                errors[first:stop, number] = np.sqrt((off * off).sum(axis=1))
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
        hang(above[0], above[1], turns, shifts, out_turns, out_places)
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


def _levers(scene: Scene) -> list[float]:
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
