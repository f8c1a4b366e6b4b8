"""Model outputs among the points of a C3D file: angles, forces, moments, powers, scalars.

Programs that compute them store them beside the markers, in the same words, and list their labels
in parameters of POINT. Here they are apart, as the signal ``outputs``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError
from mcz.model.motion import Channel, Signal
from mcz.sources.c3d.parameters import Parameters

NAME = "outputs"
UNITS_OF = {  # parameters of POINT that list outputs, and the one that holds their unit
    "ANGLES": "ANGLE_UNITS",
    "FORCES": "FORCE_UNITS",
    "MOMENTS": "MOMENT_UNITS",
    "POWERS": "POWER_UNITS",
    "SCALARS": "SCALAR_UNITS",
}
PARTS = ("x", "y", "z")
USUAL = (  # units, and the list in which they usually are
    (r"(?i)deg|rad|°", "ANGLES"),
    (r"N.?m", "MOMENTS"),
    (r"N\b", "FORCES"),
    (r"k?W\b", "POWERS"),
)


@dataclass(frozen=True, slots=True)
class Split:
    """The points of a file, by their numbers in it: those that are points, and the outputs."""

    points: NDArray[np.int64]
    outputs: NDArray[np.int64]

    @property
    def order(self) -> NDArray[np.int64]:
        """The points, then the outputs: the order of their residuals."""
        return np.concatenate([self.points, self.outputs])

    @property
    def runs(self) -> tuple[int, ...]:
        """Lengths of alternating runs of points and outputs, points first; () without outputs."""
        if not len(self.outputs):
            return ()
        is_output = np.zeros(len(self.order), np.bool_)
        is_output[self.outputs] = True
        edges = np.flatnonzero(np.diff(is_output)) + 1
        sizes = np.diff([0, *edges, len(is_output)]).tolist()
        return (0, *sizes) if is_output[0] else tuple(sizes)


def split_of(runs: Sequence[int], n_points: int) -> Split:
    """The inverse of ``Split.runs``, which have ``n_points`` in all, or are ()."""
    is_output = np.zeros(n_points, np.bool_)
    at = 0
    for number, size in enumerate(runs):
        is_output[at : at + size] = number % 2
        at += size
    return Split(np.flatnonzero(~is_output), np.flatnonzero(is_output))


def find_outputs(parameters: Parameters, n_points: int) -> Split:
    """Outputs are the points, all of them, whose label one of the lists has; see ``groups_of``."""
    labels = parameters.texts("POINT", "LABELS")[:n_points]
    groups = groups_of(parameters)
    is_output = np.zeros(n_points, np.bool_)
    is_output[: len(labels)] = [label in groups for label in labels]
    return Split(np.flatnonzero(~is_output), np.flatnonzero(is_output))


def groups_of(parameters: Parameters) -> dict[bytes, tuple[str, ...]]:
    """The lists that have each label, empty ones left out: ANGLES, FORCES, MOMENTS, ..."""
    groups: dict[bytes, tuple[str, ...]] = {}
    for group in UNITS_OF:
        for label in dict.fromkeys(parameters.texts("POINT", group)):
            if label:
                groups[label] = (*groups.get(label, ()), group)
    return groups


def unit_of(parameters: Parameters, groups: Sequence[str]) -> str:
    """The unit of an output that these lists have, "" where it is unknown or they disagree."""
    texts = [next(iter(parameters.texts("POINT", UNITS_OF[group])), b"") for group in groups]
    units = {text.decode("latin-1") for text in texts}
    return units.pop() if len(units) == 1 else ""


@dataclass(frozen=True, slots=True)
class Listed:
    """The labels of outputs, and under the name of each list its labels and their unit."""

    labels: tuple[str, ...]
    groups: dict[str, tuple[list[str], str]]


def describe_outputs(outputs: Signal | None) -> Listed:
    """Labels and lists that say what ``outputs``, channels ``NAME x``, ``NAME y``, ``NAME z``, are.

    The unit of an output tells its list. Where there are more units than lists, the last list says
    none. Raises MotionError for other channels.
    """
    channels = outputs.channels or () if outputs is not None else ()
    labels: list[str] = []
    groups: dict[str, tuple[list[str], str]] = {}
    for first in range(0, len(channels), len(PARTS)):
        three = channels[first : first + len(PARTS)]
        label, unit = three[0].name.removesuffix(f" {PARTS[0]}"), three[0].unit
        if [channel.name for channel in three] != [f"{label} {part}" for part in PARTS]:
            raise MotionError(
                f"C3D outputs need x, y and z, but {three[0].name!r} does not have them"
            )
        group = _list_of(unit, groups)
        listed, group_unit = groups.get(group, ([], unit))
        groups[group] = ([*listed, *({label} - {*listed})], unit if group_unit == unit else "")
        labels.append(label)
    return Listed(tuple(labels), groups)


def _list_of(unit: str, groups: dict[str, tuple[list[str], str]]) -> str:
    """The list for outputs of a unit: where it is usual, else one that has it or is free."""
    usual = [name for pattern, name in USUAL if re.match(pattern, unit)]
    for group in [*usual, *reversed(UNITS_OF)]:
        if groups.get(group, ([], unit))[1] == unit:
            return group
    return next(reversed(UNITS_OF))


def output_channels(parameters: Parameters, names: Sequence[str]) -> tuple[Channel, ...]:
    """The channels of the outputs of these names, which come in the order of the file."""
    n_points = len(parameters.texts("POINT", "LABELS"))
    split, groups = find_outputs(parameters, n_points), groups_of(parameters)
    labels = parameters.texts("POINT", "LABELS")
    units = [unit_of(parameters, groups[labels[number]]) for number in split.outputs]
    return tuple(
        Channel("", f"{name} {part}", unit)
        for name, unit in zip(names, units, strict=True)
        for part in PARTS
    )
