"""``rerun.RecordingStream``: motions as entities over time, logged chunk by chunk."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError
from mcz.files.reading.clip import Clip
from mcz.files.reading.source_files import recording as recording_of
from mcz.files.tables import channel_names, channel_units
from mcz.kinematics.chain import Floats
from mcz.kinematics.frames import MOTION_OR_CLIP, MotionLike, scale_to, values_of
from mcz.kinematics.points import listed_points, point_set
from mcz.kinematics.poses import point_names
from mcz.model.checks import check_arguments
from mcz.model.clock import numbers_or_rows
from mcz.model.extras import import_extra
from mcz.model.motion import Motion, Skeleton
from mcz.show.pictures.bodies import LEFT, MIDDLE, RIGHT, body_of

if TYPE_CHECKING:
    from rerun import ComponentColumnList, RecordingStream
    from rerun.blueprint import Horizontal

APPLICATION = "mcz"
BLOCK = 2**19  # numbers a block, which bounds the memory
SIDES = {
    MIDDLE: ("middle", (190, 190, 190)),
    LEFT: ("left", (86, 156, 214)),
    RIGHT: ("right", (214, 96, 77)),
}


@check_arguments(motion=MOTION_OR_CLIP)
def to_rerun(
    motion: MotionLike, recording: RecordingStream | None = None, *, entity: str | None = None
) -> RecordingStream:
    """Log a Motion or Clip to a ``rerun.RecordingStream``; needs rerun-sdk (``mcz[rerun]``).

    Below ``entity``, by default the clip's name: ``points/NAME`` for every point of
    ``mcz.point_names``, ``bones/left``, ``right`` and ``middle`` as lines, and every plain scalar
    and every channel of another signal as a time series ``SIGNAL/NAME``; events as texts. Lengths
    are in meters if the unit is known. The timeline ``frame`` has the source's frame numbers,
    ``time`` the times of ``mcz.times``, if they are known. Missing values are absent. Positions
    are binary32, scalars binary64.

    Without ``recording`` a new one is created, which keeps all data until it has a sink; with one
    that has (``save``, ``spawn``) memory is bounded. Returns the recording. Raises MotionError if
    there is nothing to log.
    """
    rerun = import_extra("rerun", "rerun")
    if recording is None:
        recording = rerun.RecordingStream(APPLICATION, recording_id=str(uuid.uuid4()))
    _Log(rerun, recording, motion, motion.name if entity is None else entity).all()
    return recording


def view_of(motion: MotionLike, entity: str) -> Horizontal:
    """Blueprint of the rerun viewer for ``to_rerun``: a figure, and curves next to it.

    Residuals are logged, but not shown: there are as many as points.
    """
    blueprint = import_extra("rerun.blueprint", "rerun")
    log = _Log(import_extra("rerun", "rerun"), None, motion, entity)
    origin = log.path()
    figure = [blueprint.Spatial3DView(origin=origin, name=entity)] if log.figure else []
    residuals = {each.name for each in motion.signals if each.role == "residuals"}
    curves = [
        blueprint.TimeSeriesView(origin=log.path(signal), name=f"{entity} {signal}")
        for signal, _, _, _ in log.series
        if signal not in residuals
    ]
    beside = [blueprint.Vertical(*curves)] if curves else []
    return blueprint.Horizontal(*figure, *beside, name=entity)


class _Log:
    def __init__(self, rerun: ModuleType, recording: Any, motion: MotionLike, entity: str) -> None:
        self.rerun, self.recording, self.motion = rerun, recording, motion
        self.parts = [part for part in entity.split("/") if part] or ["motion"]
        self.timeline = motion.timeline
        self.figure = _figure_of(motion)
        self.series = list(_series_of(motion))
        self.numbers = _numbers(motion)
        self.seconds: dict[int, Floats] = {}  # of samples, by how many a frame has
        if self.figure is None and not self.series:
            raise MotionError("there are neither positions nor scalars to log", clip=motion.name)

    def all(self) -> None:
        self._log_constants()
        per_frame = sum(len(columns) * rate for _, _, columns, rate in self.series)
        per_frame += 0 if self.figure is None else 3 * self.figure.n_nodes
        step = max(1, BLOCK // max(1, per_frame))
        for start in range(0, self.motion.n_frames, step):
            self._frames(start, min(start + step, self.motion.n_frames))

    def path(self, *parts: str) -> str:
        return str(self.rerun.new_entity_path([*self.parts, *parts]))

    def _send(
        self, path: str, start: int, stop: int, per_frame: int, columns: ComponentColumnList
    ) -> None:
        """Columns of ``per_frame`` rows each at frames start <= f < stop."""
        numbers = np.repeat(self.numbers[start:stop], per_frame)
        times = [self.rerun.TimeColumn("frame", sequence=numbers)]
        if self.timeline is not None:
            if per_frame not in self.seconds:
                self.seconds[per_frame] = self.timeline.samples(per_frame)
            seconds = self.seconds[per_frame][start * per_frame : stop * per_frame]
            times.append(self.rerun.TimeColumn("time", duration=seconds))
        self.rerun.send_columns(path, times, columns, recording=self.recording)

    def _log_constants(self) -> None:
        """Log constants: axes, names, colors, events."""
        rerun, log = self.rerun, self.recording.log
        skeleton = self.motion.skeleton
        if up := skeleton.up_axis:
            hand = (skeleton.handedness or "right").upper()
            end = "DOWN" if up.startswith("-") else "UP"
            axes = getattr(rerun.ViewCoordinates, f"{hand}_HAND_{up[-1].upper()}_{end}")
            log(self.path(), axes, static=True)
        if self.figure is not None:
            for name, side in zip(self.figure.names, self.figure.sides, strict=True):
                about = rerun.Points3D.from_fields(
                    labels=[name], show_labels=self.figure.is_markers, colors=[SIDES[side][1]]
                )
                log(self.path("points", name), about, static=True)
            for side in self.figure.bones:
                name, color = SIDES[side]
                about = rerun.LineStrips3D.from_fields(colors=[color])
                log(str(self.path("bones", name)), about, static=True)
        for signal, _, columns, _ in self.series:
            for name, unit, _ in columns:
                shown = f"{name} [{unit}]" if unit else name
                log(str(self.path(signal, name)), rerun.SeriesLines(names=[shown]), static=True)
        self._events()

    def _events(self) -> None:
        motion = self.motion
        recorded = motion.recording if isinstance(motion, Clip) else recording_of(_motion(motion))
        if recorded is None or not recorded.events:
            return
        texts = [" ".join(filter(None, (e.context, e.label))) for e in recorded.events]
        times = [self.rerun.TimeColumn("time", duration=[event.time for event in recorded.events])]
        columns = self.rerun.TextLog.columns(text=texts)
        self.rerun.send_columns(str(self.path("events")), times, columns, recording=self.recording)

    def _frames(self, start: int, stop: int) -> None:
        if self.figure is not None:
            self._places(start, stop, self.figure.places(self.motion, start, stop))
        for signal, index, columns, per_frame in self.series:
            values = _samples(self.motion, index, start, stop)
            for name, _, column in columns:
                known = np.isfinite(values[:, column])
                scalars = self.rerun.Scalars.columns(scalars=values[known, column])
                parts = scalars.partition(known.astype(np.int64))
                self._send(self.path(signal, name), start, stop, per_frame, parts)

    def _places(self, start: int, stop: int, nodes: Floats) -> None:
        """Log points and bones; ``nodes`` (n_frames, n_nodes, 3), NaN where unknown."""
        figure, rerun = self.figure, self.rerun
        assert figure is not None
        for name, node in zip(figure.names, figure.points, strict=True):
            known = np.isfinite(nodes[:, node]).all(axis=1)
            points = rerun.Points3D.columns(positions=nodes[known, node].astype(np.float32))
            parts = points.partition(known.astype(np.int64))
            self._send(self.path("points", name), start, stop, 1, parts)
        for side, bones in figure.bones.items():
            ends = nodes[:, bones]  # (n_frames, n_bones, 2, 3)
            known = np.isfinite(ends).all(axis=(2, 3))
            strips = rerun.LineStrips3D.columns(strips=ends[known].astype(np.float32))
            parts = strips.partition(known.sum(axis=1))
            self._send(self.path("bones", SIDES[side][0]), start, stop, 1, parts)


class _Figure:
    """Nodes of a skeleton, its points among them, and the bones of each side."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.body = body_of(skeleton)
        self.scale = scale_to(skeleton, None if skeleton.unit_cm is None else "m")
        self.n_nodes = len(self.body.joints)
        self.names = point_names(skeleton)
        self.is_markers = point_set(skeleton) == "markers"
        of_point = {point: node for node, point in enumerate(self.body.points, skeleton.n_joints)}
        self.points = [
            joint if tail < 0 else of_point[number]
            for number, (joint, tail) in enumerate(listed_points(skeleton))
        ]
        self.sides = self.body.sides[self.points].tolist()
        of_bones = self.body.sides[self.body.bones[:, 1]]
        self.bones = {s: self.body.bones[of_bones == s] for s in SIDES if (of_bones == s).any()}

    def places(self, motion: MotionLike, start: int, stop: int) -> Floats:
        """Positions of the nodes, (n_frames, n_nodes, 3), NaN where unknown."""
        values = values_of(motion, (start, stop), range(motion.skeleton.n_joints))
        return self.body.places(values) * self.scale


def _figure_of(motion: MotionLike) -> _Figure | None:
    if not motion.signals[0].has_poses or not motion.skeleton.joints:
        return None
    try:
        figure = _Figure(motion.skeleton)
        figure.places(motion, 0, min(1, motion.n_frames))
    except MotionError:
        return None
    return figure


Columns = list[tuple[str, str, int]]  # names, units, columns


def _series_of(motion: MotionLike) -> Iterator[tuple[str, int, Columns, int]]:
    """Yield name, index, scalar columns and samples per frame of every signal with scalars."""
    for index, signal in enumerate(motion.signals):
        channels = signal.channels
        kinds = motion.skeleton.channels if channels is None else channels
        names = channel_names(motion.skeleton, channels)
        units = channel_units(motion.skeleton, channels)
        plain = [k for k, channel in enumerate(kinds) if index or not channel.kind]
        per_frame = (
            signal.layout.samples_per_frame
            if isinstance(motion, Clip)
            else (signal.samples_per_frame)
        )
        if plain:
            name = signal.name if index else "channels"
            yield name, index, [(names[k], units[k], k) for k in plain], per_frame


def _samples(motion: MotionLike, index: int, start: int, stop: int) -> NDArray[np.float64]:
    """The samples of a signal in some frames, in units, NaN where invalid."""
    if isinstance(motion, Clip):
        return np.asarray(motion.read((start, stop), signal=index), np.float64)
    return np.asarray(_motion(motion).signals[index].cut(start, stop).masked(), np.float64)


def _numbers(motion: MotionLike) -> NDArray[np.int64]:
    numbers = motion.frame_numbers if isinstance(motion, Clip) else _motion(motion).frame_numbers
    return numbers_or_rows(numbers, motion.n_frames)


def _motion(motion: MotionLike) -> Motion:
    assert isinstance(motion, Motion)
    return motion
