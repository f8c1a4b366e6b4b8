"""Tables and arrays of robots: names and units of columns, and every byte again."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import mcz
from mcz.cli.shared_options import ARRAYS, ROBOTS
from mcz.sources.arrays.skeletons import KINDS
from mcz.sources.robots import robot_layouts

N_FRAMES = 40
TIMES = np.arange(N_FRAMES) / 50


def joint_angles(n_joints: int) -> NDArray[np.float64]:
    return 0.4 * np.sin(3 * TIMES[:, None] + np.arange(n_joints))


def quaternions(order: str) -> NDArray[np.float64]:
    """Headings of an upright robot."""
    parts = {"w": np.cos(TIMES / 2), "x": 0.01 * TIMES, "y": 0 * TIMES, "z": np.sin(TIMES / 2)}
    rows = np.stack([parts[part] for part in order], axis=1)
    return rows / np.linalg.norm(rows, axis=1)[:, None]


def table(path: Path, n_joints: int, order: str = "xyzw") -> Path:
    """A table without a header: root position, quaternion, joint angles."""
    root = np.stack([TIMES, 0 * TIMES, 0.8 + 0 * TIMES], axis=1)
    rows = np.hstack([root, quaternions(order), joint_angles(n_joints)])
    np.savetxt(path, rows, fmt="%.6f", delimiter=",")
    return path


def restored(path: Path, **options: str) -> bytes:
    target = io.BytesIO()
    mcz.encode(path, target, rate=30, **options)
    with mcz.open(target.getvalue()) as file:
        data: bytes = next(iter(file)).source_bytes()
    return data


def test_layouts_are_those_that_the_command_line_offers() -> None:
    assert tuple(robot_layouts()) == ROBOTS
    assert tuple(KINDS) == ARRAYS
    for layout in robot_layouts().values():
        assert len(set(layout.joints)) == len(layout.joints)
        assert layout.source


@pytest.mark.parametrize(
    ("n_joints", "name"), [(29, "unitree-g1-29"), (27, "unitree-h1-2"), (19, "unitree-h1")]
)
def test_a_table_without_names_is_recognized(tmp_path: Path, n_joints: int, name: str) -> None:
    path = table(tmp_path / "walk.csv", n_joints)
    motion = mcz.read(path)
    assert motion.metadata["x-robot"] == name
    assert name in motion.metadata["source-note"]
    joints = motion.skeleton.joints
    assert [joint.name for joint in joints[:7]] == [
        *("root x", "root y", "root z"),
        *("root qx", "root qy", "root qz", "root qw"),
    ]
    assert joints[7].name == robot_layouts()[name].joints[0]
    assert [joint.channels[0].unit for joint in joints[:8]] == ["m"] * 3 + [""] * 4 + ["rad"]
    assert restored(path) == path.read_bytes()


def test_two_robots_of_as_many_joints_are_named_by_the_caller(tmp_path: Path) -> None:
    path = table(tmp_path / "walk.csv", 23)
    motion = mcz.read(path)
    assert "unitree-g1-23 or booster-t1" in motion.metadata["source-note"]
    assert motion.skeleton.joint_names[0] == "column 1"
    named = mcz.read(path, arrays="booster-t1")
    assert named.skeleton.joint_names[7] == "AAHead_yaw"
    assert restored(path, arrays="booster-t1") == path.read_bytes()


def test_an_unlike_quaternion_is_not_recognized(tmp_path: Path) -> None:
    other = mcz.read(table(tmp_path / "other.csv", 29, "wxyz"))
    rows = np.loadtxt(tmp_path / "other.csv", delimiter=",")
    rows[7, 3:7] *= 1.01
    np.savetxt(tmp_path / "long.csv", rows, fmt="%.6f", delimiter=",")
    for motion in (other, mcz.read(tmp_path / "long.csv")):
        assert motion.skeleton.joint_names[0] == "column 1"
        assert "x-robot" not in motion.metadata


def test_a_layout_of_another_number_of_columns_is_refused(tmp_path: Path) -> None:
    path = table(tmp_path / "walk.csv", 29)
    with pytest.raises(mcz.MotionError, match="unitree-h1 has 19 columns, or 26 with the root"):
        mcz.read(path, arrays="unitree-h1")
    named = (tmp_path / "named.csv").write_text("a,b\n1.5,2.5\n1.5,2.5\n")
    assert named
    with pytest.raises(mcz.MotionError, match="the array has 2"):
        mcz.read(tmp_path / "named.csv", arrays="unitree-h1")


def test_a_layout_names_the_joints_of_a_plain_array(tmp_path: Path) -> None:
    np.save(tmp_path / "dof.npy", joint_angles(19).astype(np.float32))
    motion = mcz.read(tmp_path / "dof.npy", arrays="unitree-h1")
    assert motion.skeleton.joint_names == robot_layouts()["unitree-h1"].joints


def test_joint_angles_are_the_motion_of_an_npz(tmp_path: Path) -> None:
    """As mjlab and BeyondMimic write it: bodies have more axes than joints."""
    names = [f"joint {k}" for k in range(29)]
    bodies = [f"body {k}" for k in range(30)]
    path = tmp_path / "walk.npz"
    np.savez(
        path,
        fps=np.array([50]),
        body_pos_w=np.ones((N_FRAMES, 30, 3), np.float32),
        joint_pos=joint_angles(29).astype(np.float32),
        joint_vel=joint_angles(29).astype(np.float32),
        joint_names=np.array(names),
        body_names=np.array(bodies),
    )
    motion = mcz.read(path)
    assert motion.frame_rate == 50
    assert motion.skeleton.joint_names == tuple(names)
    assert {channel.unit for channel in motion.skeleton.channels} == {"rad"}
    signals = {signal.name: signal for signal in motion.signals}
    assert signals.keys() == {"motion", "body_pos_w", "joint_vel"}
    channels = signals["body_pos_w"].channels
    assert channels is not None
    assert channels[3].name == "body 1 0"
    velocities = signals["joint_vel"].channels
    assert velocities is not None
    assert (velocities[2].name, velocities[2].unit) == ("joint 2", "rad/s")
    assert restored(path) == path.read_bytes()


@pytest.mark.parametrize("names", [["a"] * 28, ["a", ""] * 14 + ["b"], ["\n"] * 29])
def test_names_that_do_not_fit_are_left_alone(tmp_path: Path, names: list[str]) -> None:
    path = tmp_path / "walk.npz"
    np.savez(path, joint_pos=joint_angles(29), joint_names=np.array(names))
    assert mcz.read(path).skeleton.joint_names == tuple(map(str, range(29)))
