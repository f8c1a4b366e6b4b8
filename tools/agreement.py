"""Compare MCZ's poses with those of other libraries for the same files.

    python tools/agreement.py FOLDER

Every BVH below FOLDER against pybvh, the rotations of these and of every AMC against SciPy, every
C3D against ezc3d: greatest differences, the file of each, and how many values were compared. What
the other library cannot read is counted.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import mcz

LARGE = 1e-6
RATE = 47  # to which clips are resampled


@dataclass
class Worst:
    """The greatest difference of each kind."""

    found: dict[str, tuple[float, str, int, int]] = field(default_factory=dict)
    far: dict[str, list[str]] = field(default_factory=dict)  # the files beyond LARGE
    unread: dict[str, int] = field(default_factory=dict)

    def note(self, what: str, ours: Any, theirs: Any, path: Path, scale: float = 1.0) -> None:
        """Differences where both are known; where only one of them is, the difference is inf."""
        ours, theirs = np.asarray(ours, np.float64), np.asarray(theirs, np.float64)
        if ours.shape != theirs.shape:
            print(f"{path}: {what}: shape {ours.shape} against {theirs.shape}")
            return
        known = np.isfinite(ours)
        apart = np.abs(ours - theirs)[known & np.isfinite(theirs)].max(initial=0.0) / scale
        if (known != np.isfinite(theirs)).any():
            apart = np.inf
        if apart > LARGE:
            self.far.setdefault(what, []).append(f"{path.name} {apart:.2g}")
        before, name, files, values = self.found.get(what, (-1.0, "", 0, 0))
        if apart > before:
            before, name = float(apart), path.name
        self.found[what] = before, name, files + 1, values + int(known.sum())

    def pass_over(self, what: str) -> None:
        self.unread[what] = self.unread.get(what, 0) + 1

    def show(self) -> None:
        for what, (apart, name, files, values) in sorted(self.found.items()):
            print(f"{what:44} {apart:9.2g}  {files:4} files {values:11,} values  ({name})")
        for what, files_far in sorted(self.far.items()):
            print(f"{what}, beyond {LARGE}: {', '.join(files_far)}")
        for what, count in sorted(self.unread.items()):
            print(f"{what}: {count}")


def readable(folder: Path, ending: str, worst: Worst, **facts: Any) -> Iterator[tuple[Path, Any]]:
    """The files of an ending that MCZ reads, and their motions."""
    for path in sorted(folder.rglob(f"*{ending}")):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", mcz.SkeletonWarning)
                motion = mcz.read(path, **facts)
        except mcz.MczError:
            worst.pass_over(f"{ending} not read by MCZ")
            continue
        if motion.n_frames:
            yield path, motion


def rotations(path: Path, motion: mcz.Motion, worst: Worst) -> None:
    """All forms against SciPy, from the matrices."""
    from scipy.spatial.transform import Rotation

    matrices = mcz.rotations(motion, "matrix")
    flat = matrices.reshape(-1, 3, 3)
    known = np.isfinite(flat).all(axis=(1, 2))
    turns = Rotation.from_matrix(flat[known])
    for form in ("quat", "rotvec", "6d", "euler"):
        ours = mcz.rotations(motion, form, order="ZXY").reshape(len(flat), -1)[known]
        back: dict[str, Any] = {
            "quat": lambda v: Rotation.from_quat(v, scalar_first=True),
            "rotvec": Rotation.from_rotvec,
            "6d": lambda v: Rotation.from_matrix(
                np.stack([v[:, :3], v[:, 3:], np.cross(v[:, :3], v[:, 3:])], axis=2)
            ),
            "euler": lambda v: Rotation.from_euler("ZXY", v),
        }
        worst.note(
            f"rotations as {form}, SciPy", back[form](ours).as_matrix(), turns.as_matrix(), path
        )
    world = mcz.rotations(motion, "matrix", space="world")
    for joint, parent in enumerate(motion.skeleton.parents):
        above = world[:, parent] if parent >= 0 else np.eye(3)
        if joint in (0, 5, len(motion.skeleton.joints) - 1):
            product = above @ matrices[:, joint]
            worst.note("rotations: world = parent's times local", world[:, joint], product, path)


def against_pybvh(folder: Path, worst: Worst) -> None:
    import pybvh

    for path, motion in readable(folder, ".bvh", worst):
        try:
            rotations(path, motion, worst)
        except mcz.MczError:
            worst.pass_over(".bvh without kinematics")
            continue
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                theirs = pybvh.read_bvh_file(str(path))
        except Exception:  # whatever it raises: it is not ours to name
            worst.pass_over(".bvh not read by pybvh")
            continue
        places = mcz.positions(motion)
        if theirs.frame_count != motion.n_frames or theirs.node_positions().shape != places.shape:
            worst.pass_over(".bvh of which pybvh reads other frames or nodes")
            continue
        scale = float(np.nanmax(np.abs(places), initial=1.0))
        worst.note("positions / largest, pybvh", places, theirs.node_positions(), path, scale)
        worst.note(
            "rotations: matrix, pybvh", mcz.rotations(motion, "matrix"), theirs.to_rotmat()[1], path
        )
        worst.note("rotations: 6d, pybvh", mcz.rotations(motion, "6d"), theirs.to_6d()[1], path)
        root = mcz.root(motion)
        if all(j.adds_to_offset is False or not any(j.offset) for j in motion.skeleton.joints[:1]):
            worst.note("root / largest, pybvh", root.positions, theirs.root_pos, path, scale)
        if motion.n_frames > 2 and motion.frame_rate:
            speeds = mcz.velocities(motion) / float(motion.frame_rate)
            others = theirs.node_velocities(in_frames=True)
            worst.note("velocities / largest, pybvh", speeds[1:-1], others[1:-1], path, scale)
        if motion.n_frames > 2 and motion.frame_rate and motion.frame_rate > RATE:
            ours = mcz.rotations(mcz.resample(motion, RATE), "matrix")
            other = theirs.resample(RATE).to_rotmat()[1]
            n_frames = min(len(ours), len(other))
            if abs(len(ours) - len(other)) <= 1:
                worst.note(
                    f"rotations at {RATE} Hz, pybvh", ours[:n_frames], other[:n_frames], path
                )


def against_ezc3d(folder: Path, worst: Worst) -> None:
    import ezc3d

    for path, motion in readable(folder, ".c3d", worst):
        try:
            theirs = ezc3d.c3d(str(path))
        except Exception:  # whatever it raises
            worst.pass_over(".c3d not read by ezc3d")
            continue
        names = theirs["parameters"]["POINT"]["LABELS"]["value"]
        points = np.moveaxis(theirs["data"]["points"][:3], 0, 2).transpose(1, 0, 2)
        columns = [n for n, name in enumerate(names) if name in mcz.point_names(motion)]
        if points.shape[0] != motion.n_frames or len(set(names)) != len(names):
            worst.pass_over(".c3d of which ezc3d reads other frames, or with repeated names")
            continue
        ours = mcz.positions(motion, [names[n] for n in columns])
        worst.note(
            "positions of C3D, ezc3d",
            ours,
            points[:, columns],
            path,
            max(1.0, float(np.nanmax(np.abs(ours), initial=1.0))),
        )
        analog = [s for s in motion.signals if s.name == "analog"]
        if analog and theirs["data"]["analogs"].size == analog[0].values.size:
            samples = theirs["data"]["analogs"][0].T
            size = max(1.0, float(np.nanmax(np.abs(samples), initial=1.0)))
            worst.note("analog of C3D, ezc3d", analog[0].values, samples, path, size)
        found = mcz.recording(motion)
        parameters = theirs["parameters"].get("EVENT", {})
        if found is not None and found.events and "TIMES" in parameters:
            times = np.asarray(parameters["TIMES"]["value"])
            seconds = times[0] * 60 + times[1] if times.ndim == 2 else times
            ours_times = [event.time for event in found.events]
            if len(seconds) == len(ours_times):
                worst.note("events of C3D in seconds, ezc3d", ours_times, seconds, path)


def main() -> None:
    folder = Path(sys.argv[1])
    worst = Worst()
    against_pybvh(folder, worst)
    for path, motion in readable(folder, ".amc", worst):
        try:
            rotations(path, motion, worst)
        except mcz.MczError:
            worst.pass_over(".amc without a skeleton")
    against_ezc3d(folder, worst)
    worst.show()


if __name__ == "__main__":
    main()
