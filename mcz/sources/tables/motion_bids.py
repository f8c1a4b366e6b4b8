"""Motion-BIDS: the side files that name the columns of a ``_motion.tsv`` and give its rate.

The table has no header: ``_channels.tsv`` has a row for each of its columns, ``_motion.json`` the
sampling frequency. Both are searched beside the table, then, by the inheritance principle of
BIDS, in the folders above it. Source: BIDS 1.10, "Motion".
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path

from mcz.errors import SourceError
from mcz.model.motion import POSITION_KINDS, Channel, Joint, Motion, Skeleton
from mcz.sources.robots import without_robot
from mcz.sources.tables.layout import UNIT_CM

MOTION_SUFFIX = "_motion.tsv"
CHANNELS, ABOUT = "_channels.tsv", "_motion.json"
LEVELS = 4  # folders above a table: motion, session, subject, data set
MOST_BYTES = 2**24  # of a side file
LEAST_RATE, MOST_RATE = 1e-3, 1e6  # hertz
POSITION = "POS"
AXES = ("x", "y", "z")


def with_side_files(motion: Motion, path: Path) -> Motion:
    """``motion``, the table ``path``, with names, units and rate of its side files, if any.

    Markers become of channels that all are positions, x, y and z of one point after the other;
    plain scalars of all others. Raises SourceError for a side file that does not fit the table.
    """
    channels = _find(path, CHANNELS)
    if channels is not None:
        rows = _rows(channels)
        if len(rows) != motion.skeleton.n_channels:
            raise SourceError(
                f"{len(rows)} channels are listed, but {path.name} has "
                f"{motion.skeleton.n_channels} columns",
                path=channels,
            )
        motion = replace(
            motion,
            skeleton=_markers(rows) or _scalars(rows, motion.skeleton),
            metadata=without_robot(motion.metadata),
        )
    about = _find(path, ABOUT)
    rate = None if about is None or motion.frame_rate is not None else _rate(about)
    return motion if rate is None else motion.at_rate(rate)


def _find(path: Path, suffix: str) -> Path | None:
    """The nearest side file with no entity that ``path`` lacks; of several, that with most."""
    stem = path.name.removesuffix(MOTION_SUFFIX)
    own_side = path.with_name(stem + suffix)
    if own_side.is_file():  # the usual case, of all entities
        return own_side
    entities = frozenset(stem.split("_"))
    for folder in path.absolute().parents[: 1 + LEVELS]:
        fit = [
            side
            for own, side in _side_files(folder, suffix, _modification_time(folder))
            if own <= entities
        ]
        most = [side for side in fit if side.name.count("_") == fit[0].name.count("_")]
        if len(most) > 1:
            raise SourceError(f"{most[0].name} and {most[1].name} both apply", path=path)
        if most:
            return most[0]
    return None


def _modification_time(folder: Path) -> int:
    try:
        return folder.stat().st_mtime_ns
    except OSError:
        return 0


@lru_cache(maxsize=64)  # a folder is listed once for all of its tables
def _side_files(
    folder: Path, suffix: str, modified: int
) -> tuple[tuple[frozenset[str], Path], ...]:
    """The side files in a folder with their entities, those of most entities first."""
    names = sorted(folder.glob(f"*{suffix}"), key=lambda side: (-side.name.count("_"), side.name))
    return tuple((frozenset(side.name.removesuffix(suffix).split("_")), side) for side in names)


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise SourceError(f"the side file exceeds {MOST_BYTES} bytes", path=path)
        return data.decode("utf-8-sig")
    except OSError as error:
        raise SourceError(error.strerror or "cannot be read", path=path) from None
    except UnicodeDecodeError:
        raise SourceError("the side file is not UTF-8", path=path) from None


def _rows(path: Path) -> list[Mapping[str, str]]:
    """The rows of a ``_channels.tsv``, each with a name."""
    try:
        lines = _text(path).splitlines()
        rows: list[Mapping[str, str]] = [*csv.DictReader(lines, delimiter="\t", restval="")]
    except csv.Error as error:
        raise SourceError(f"not a table of channels: {error}", path=path) from None
    if not all(row.get("name") for row in rows):
        raise SourceError("a channel has no name", path=path)
    return rows


def _markers(rows: Sequence[Mapping[str, str]]) -> Skeleton | None:
    """Markers, if all channels are positions in one known unit."""
    units = {row.get("units", "") for row in rows}
    unit_cm = UNIT_CM.get(next(iter(units))) if len(units) == 1 else None
    points = [row.get("tracked_point", "") for row in rows[::3]]
    expected = [(point, axis) for point in points for axis in AXES]
    stated = [(row.get("tracked_point", ""), row.get("component", "").lower()) for row in rows]
    is_position = all(row.get("type", "").upper() == POSITION for row in rows)
    if unit_cm is None or not is_position or stated != expected or len(set(points)) < len(points):
        return None
    channels = tuple(map(Channel, POSITION_KINDS))
    return Skeleton(
        tuple(Joint(point, channels=channels) for point in points), unit_cm=unit_cm, angle_unit=""
    )


def _scalars(rows: Sequence[Mapping[str, str]], skeleton: Skeleton) -> Skeleton:
    """Plain scalars with the names and units of ``rows``."""
    units = [row.get("units", "") for row in rows]
    channels = [(Channel("", "value", "" if unit == "n/a" else unit),) for unit in units]
    joints = (Joint(row["name"], channels=own) for row, own in zip(rows, channels, strict=True))
    return replace(skeleton, joints=tuple(joints), unit_cm=None)


def _rate(path: Path) -> Fraction | None:
    """The sampling frequency; None if it is not stated."""
    try:
        frequency = json.loads(_text(path)).get("SamplingFrequency")
        value = None if frequency is None else float(frequency)
    except (ValueError, TypeError, AttributeError, RecursionError):
        raise SourceError("not an object with a SamplingFrequency in hertz", path=path) from None
    if value is None:
        return None
    if not LEAST_RATE <= value <= MOST_RATE:
        raise SourceError(f"SamplingFrequency is {value:g} Hz", path=path)
    return Fraction(str(value)).limit_denominator(10**6)
