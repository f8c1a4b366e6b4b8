"""Pickles as sources: restored byte for byte, cut to frames, and never run."""

from __future__ import annotations

import io
import os
import pickle
import struct
import subprocess
import tracemalloc
import zipfile
from collections import OrderedDict
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.errors import SourceError
from mcz.model.motion import Motion
from mcz.sources import FORMATS, arrays_of, format_of, likely_formats
from tests.amounts import some
from tools.vectors.build.array_files import floats
from tools.vectors.build.pickle_files import joblib_file, tensor_file

PLAIN = (3, 4, 5)  # protocols that write bytes as they are
BODIES = ["pelvis", "left_hip_link", "right_hip_link"]
LIMIT = 2**26  # bytes that reading a small file may take


def robot(n_frames: int = 60, n_joints: int = 5) -> dict[str, Any]:
    """A clip as programs of retargeting save it."""
    return {
        "fps": 30,
        "root_pos": floats(n_frames, 3),
        "root_rot": np.tile([0.0, 0.0, 0.0, 1.0], (n_frames, 1)),
        "dof_pos": floats(n_frames, n_joints, seed=2),
        "local_body_pos": floats(n_frames, 3, 3, seed=3).astype(np.float32),
        "link_body_list": BODIES,
    }


def read(data: bytes) -> Motion:
    motion: Motion = FORMATS["pickle"].read(data, "walk")
    assert FORMATS["pickle"].write(motion) == data
    return motion


def back_or_refused(data: bytes) -> Motion | None:
    try:
        return read(data)
    except (mcz.SourceError, mcz.LimitError) as error:
        assert "\n" not in str(error)
        return None


def part_of(motion: Motion, first: int, stop: int) -> Any:
    """The object in the file that a range of frames makes."""
    out = io.BytesIO()
    mcz.write(motion, out)
    with mcz.open(out.getvalue()) as file:
        return pickle.loads(file.only_clip().source_bytes((first, stop)))


@pytest.mark.parametrize("protocol", PLAIN)
def test_a_clip_of_a_robot(protocol: int) -> None:
    motion = read(pickle.dumps(robot(), protocol))
    assert motion.frame_rate == 30
    names = [signal.name for signal in motion.signals]
    assert names == ["motion", "root_pos", "root_rot", "local_body_pos"]
    np.testing.assert_array_equal(motion.values, robot()["dof_pos"])
    assert motion.skeleton.channels[0].unit == "rad"
    labels = [[channel.name for channel in signal.channels or ()] for signal in motion.signals]
    assert labels[1:3] == [["x", "y", "z"], ["qx", "qy", "qz", "qw"]]
    assert labels[3][:4] == ["pelvis 0", "pelvis 1", "pelvis 2", "left_hip_link 0"]


@pytest.mark.parametrize(
    ("protocol", "n_frames"), [(3, 40), (4, 40), (5, 40), (3, 300), (4, 300), (5, 300), (4, 70_000)]
)
def test_frames_of_a_pickle_are_a_pickle(protocol: int, n_frames: int) -> None:
    clip = robot(n_frames) | {"contact": floats(n_frames, 1) > 0, "who": np.array("A")}
    clip["dof_pos"] = np.asfortranarray(clip["dof_pos"])
    clip["root_pos"] = clip["root_pos"].astype(">f8")
    part = part_of(read(pickle.dumps(clip, protocol)), 3, 33)
    assert part["fps"] == 30 and part["link_body_list"] == BODIES and part["who"] == "A"
    for name in ("root_pos", "root_rot", "dof_pos", "local_body_pos", "contact"):
        assert part[name].dtype.kind == clip[name].dtype.kind
        np.testing.assert_array_equal(part[name], clip[name][3:33])


def test_names_of_a_known_robot() -> None:
    from mcz.sources.robots import robot_layouts

    joints = robot_layouts()["unitree-g1-29"].joints
    bodies = [joint.replace("_joint", "_link") for joint in joints]
    clip = robot(n_joints=29) | {"link_body_list": ["pelvis", *bodies, "head"]}
    motion = read(pickle.dumps(clip))
    assert motion.skeleton.joint_names == joints
    assert motion.metadata["x-robot"] == "unitree-g1-29"
    note = read(pickle.dumps(robot(n_joints=29))).metadata["source-note"]
    assert note == "the columns may be those of unitree-g1-29 (the option arrays states it)"
    clip["link_body_list"] = ["pelvis", *bodies[::-1]]  # the order of another robot
    assert "x-robot" not in read(pickle.dumps(clip)).metadata


def test_order_of_the_quaternion() -> None:
    """x y z w, as programs of retargeting write it, unless the numbers show another order."""
    for quaternion, is_named in (
        ([0, 0, 0.6, 0.8], True),
        ([0, 0.7, 0, 0.7], True),
        ([1, 0, 0, 0], False),
    ):
        clip = robot() | {"root_rot": np.tile(np.array(quaternion, np.float64), (60, 1))}
        channels = read(pickle.dumps(clip)).signals[2].channels or ()
        assert (channels[0].name == "qx") == is_named


def test_a_single_clip() -> None:
    clip = robot()
    motion = read(pickle.dumps({"day/walk": clip}))
    assert motion.metadata["x-clip"] == "day/walk" and motion.n_frames == 60
    assert read(pickle.dumps([[clip]])).n_frames == 60
    with pytest.raises(mcz.OptionError, match="motion 'walk' is not a library of clips"):
        mcz.split_clips(motion)


@pytest.mark.parametrize("protocol", [*PLAIN, "joblib"])
def test_a_library_of_clips(protocol: Any, tmp_path: Path) -> None:
    """The clips follow each other, and a number is missing between two."""
    clips = {"walk": robot(60), "run": robot(1), "a/jump": robot(20)}
    if protocol == "joblib":
        joblib = pytest.importorskip("joblib")
        buffer = io.BytesIO()
        joblib.dump(clips, buffer)
        data = buffer.getvalue()
    else:
        data = pickle.dumps(clips, protocol)
    motion = read(data)
    assert motion.n_frames == 81 and motion.frame_rate == 30
    assert motion.frame_numbers is not None
    assert motion.frame_numbers[[0, 59, 60, 61, 80]].tolist() == [1, 60, 62, 64, 83]
    assert motion.metadata["x-clips"] == '{"walk": [1, 60], "run": [62, 62], "a/jump": [64, 83]}'
    for name, part in mcz.split_clips(motion).items():
        np.testing.assert_array_equal(part.values, clips[name]["dof_pos"])
        assert part.source is None and part.metadata["x-clip"] == name
        assert part.frame_numbers is None and part.frame_rate == 30
    mcz.write(motion, tmp_path / "library.mcz")
    windows = mcz.dataset(tmp_path / "library.mcz", "channels", window=20, stride=1)
    assert len(windows) == 41 + 1  # none of two clips


@pytest.mark.parametrize("codec", ["fast", "lossy"])
def test_frames_and_errors_of_a_library(codec: str) -> None:
    motion = read(pickle.dumps({"walk": robot(60), "run": robot(30)}))
    bounds = {} if codec == "fast" else {"max_error": 0.001}
    out = io.BytesIO()
    mcz.write(motion, out, codec, **bounds)
    with mcz.open(out.getvalue()) as file:
        whole = pickle.loads(file.only_clip().source_bytes())
        part = pickle.loads(file.only_clip().source_bytes((50, 64)))
        early = pickle.loads(file.only_clip().source_bytes((3, 9)))
    np.testing.assert_allclose(whole["run"]["dof_pos"], robot(30)["dof_pos"], atol=0.001)
    np.testing.assert_array_equal(part["walk"]["root_rot"], whole["walk"]["root_rot"][50:])
    np.testing.assert_array_equal(part["run"]["dof_pos"], whole["run"]["dof_pos"][:4])
    assert early["walk"]["dof_pos"].shape == (6, 5) and early["run"]["dof_pos"].shape == (0, 5)
    again = read(pickle.dumps(early))
    assert again.n_frames == 6 and [*mcz.split_clips(again)] == ["walk", "run"]
    assert FORMATS["pickle"].write(again) == pickle.dumps(early)


def test_clips_that_differ() -> None:
    """Arrays that some clips lack or have otherwise stay bytes, and so do facts that differ."""
    walk, run = robot(60), robot(20)
    run |= {"fps": 50, "root_pos": run["root_pos"].astype(np.float32)}
    walk["force"] = np.repeat(walk["root_pos"], 2, axis=0)
    run["force"] = np.repeat(run["root_rot"], 3, axis=0)
    motion = read(pickle.dumps([{"walk": walk, "empty": {"a": np.zeros((0, 3))}}, [run]]))
    assert [signal.name for signal in motion.signals] == ["motion", "root_rot", "local_body_pos"]
    assert motion.frame_rate is None and motion.n_frames == 80
    assert [*mcz.split_clips(motion)] == ["0/walk", "1/0"]
    with pytest.raises(SourceError, match="2 clips in one file, such as '0' and '1', have no"):
        read(pickle.dumps([{"a": np.zeros((4, 2))}, {"a": np.zeros((4, 3))}]))


def test_array_of_objects() -> None:
    buffer = io.BytesIO()
    np.save(buffer, np.array(robot(), object), allow_pickle=True)
    motion = FORMATS["npy"].read(buffer.getvalue(), "walk")
    assert FORMATS["npy"].write(motion) == buffer.getvalue()
    assert [signal.name for signal in motion.signals][1] == "root_pos"
    out = io.BytesIO()
    mcz.write(motion, out)
    with mcz.open(out.getvalue()) as file:
        part = file.only_clip().source_bytes((5, 9))
    again = np.load(io.BytesIO(part), allow_pickle=True).item()
    np.testing.assert_array_equal(again["dof_pos"], robot()["dof_pos"][5:9])
    is_motion = FORMATS["npy"].is_motion
    assert is_motion is not None and is_motion(buffer.getvalue()) and is_motion(part[:300])
    listed = arrays_of(motion.source, [signal.name for signal in motion.signals]) or []
    assert [row["name"] for row in listed][:2] == ["root_pos", "root_rot"]


def test_a_motion_of_poselib(tmp_path: Path) -> None:
    """As AMP and ASE save it: each array in a dictionary of its own, names in the tree."""

    def tensor(array: Any) -> Any:
        return OrderedDict(arr=array, context={"dtype": array.dtype.name})

    names = ["pelvis", "torso", "head"]
    saved = OrderedDict(
        rotation=tensor(floats(8, 3, 4)),
        root_translation=tensor(floats(8, 3)),
        global_velocity=tensor(floats(8, 3, 3)),
        skeleton_tree=OrderedDict(node_names=names, parent_indices=tensor(np.array([-1, 0, 1]))),
        is_local=True,
        fps=60,
    )
    buffer = io.BytesIO()
    np.save(buffer, np.array(saved, object), allow_pickle=True)
    motion = FORMATS["npy"].read(buffer.getvalue(), "walk")
    assert FORMATS["npy"].write(motion) == buffer.getvalue()
    assert [signal.name for signal in motion.signals][1:] == ["root_translation", "global_velocity"]
    assert motion.frame_rate == 60 and motion.skeleton.joint_names == tuple(names)
    (tmp_path / "walk.npy").write_bytes(buffer.getvalue())
    motion = mcz.read(tmp_path / "walk.npy", arrays="quaternions-xyzw")
    assert [channel.kind for channel in motion.skeleton.channels][:4] == ["qx", "qy", "qz", "qw"]


def test_listed_arrays() -> None:
    motion = read(pickle.dumps({"walk": robot() | {"table": np.arange(3), "k": np.float64(2)}}))
    listed = arrays_of(motion.source, [signal.name for signal in motion.signals])
    assert listed is not None
    by_name = {str(row["name"]): row for row in listed}
    assert by_name["dof_pos"]["signal"] == "motion" and by_name["dof_pos"]["columns"] == 5
    assert by_name["local_body_pos"]["type"] == "<f4"
    assert by_name["table"]["signal"] is None and by_name["k"]["signal"] is None


def test_joblib_by_hand_and_by_joblib(tmp_path: Any) -> None:
    clip = {name: value for name, value in robot().items() if isinstance(value, np.ndarray)}
    data = joblib_file({"walk": clip})
    motion = read(data)
    assert motion.n_frames == 60 and motion.metadata["x-clip"] == "walk"
    joblib = pytest.importorskip("joblib")
    np.testing.assert_array_equal(joblib.load(io.BytesIO(data))["walk"]["dof_pos"], motion.values)
    path = tmp_path / "walk.pkl"
    joblib.dump({"walk": robot()}, path)
    motion = read(path.read_bytes())
    out = io.BytesIO()
    mcz.write(motion, out)
    with mcz.open(out.getvalue()) as file:
        path.write_bytes(file.only_clip().source_bytes((5, 9)))
    again = joblib.load(path)["walk"]
    np.testing.assert_array_equal(again["local_body_pos"], robot()["local_body_pos"][5:9])
    for method in ("zlib", "gzip", "bz2", "xz", "lzma"):
        joblib.dump(robot(), path, compress=(method, 3))
        with pytest.raises(SourceError, match=f"compressed by {method}; .* write it plain"):
            read(path.read_bytes())
        assert FORMATS["pickle"].is_motion is not None
        assert FORMATS["pickle"].is_motion(path.read_bytes())


def test_bytes_as_text_are_refused_by_name() -> None:
    for protocol in (0, 1, 2):
        with pytest.raises(SourceError, match="written as text, as protocols 0 to 2"):
            read(pickle.dumps(robot(), protocol))


def test_formats_of_pickles() -> None:
    data = pickle.dumps(robot())
    assert likely_formats(data) == ("pickle",)
    assert format_of("a.PKL").name == format_of("a.joblib").name == "pickle"
    is_motion = FORMATS["pickle"].is_motion
    assert is_motion is not None
    assert is_motion(data) and is_motion(data[:300])
    assert not is_motion(pickle.dumps({"a": 1}))
    assert not is_motion(pickle.dumps((np.zeros((3, 3)), subprocess.Popen)))


def test_bytes_of_two_arrays_and_other_oddities() -> None:
    """Arrays that share bytes, other orders of axes, structures and texts stay as they are."""
    a = floats(9, 4)
    odd = {
        "dof_pos": a,
        "same": a,
        "turned": floats(3, 4, 9).transpose(1, 2, 0),
        "words": np.array(["a", "bc"]),
        "pairs": np.zeros(9, [("a", "f4"), ("b", "i2")]),
        "complex": np.zeros(9, complex),
        "empty": np.zeros((0, 4)),
        "none": None,
        "deep": [[[{"x": OrderedDict(y=(1, 2))}]]],
        "large": 10**400,
        "set": {1, 2},
        "frozen": frozenset("ab"),
        "bytes": b"abc",
        "nan": float("nan"),
        "times": np.arange(9) / 10,
    }
    motion = read(pickle.dumps(odd))
    assert [signal.name for signal in motion.signals] == ["motion", "times"]
    assert motion.frame_rate == 10
    assert read(pickle.dumps(odd, 5)).n_frames == 9
    loop: list[Any] = [{"dof_pos": a}]
    loop.append(loop)
    assert read(pickle.dumps(loop)).n_frames == 9
    assert (
        read(pickle.dumps(odd) + b"more")
        .metadata["source-note"]
        .endswith("bytes follow the pickle")
    )


class Call:
    """An object that a pickle makes by a call."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self.call = function, arguments

    def __reduce__(self) -> Any:
        return self.call


FUNCTIONS = [os.system, eval, exec, compile, open, getattr, __import__, print, subprocess.call]
FUNCTIONS += [np.load, np.frombuffer, np.asarray, pickle.loads, bytearray, complex, range]
MODULES = "os posix subprocess builtins __builtin__ sys importlib shutil socket ctypes pty "
MODULES += (
    "torch._utils torch.storage numpy.testing numpy.lib.npyio numpy scipy.sparse chumpy pathlib"
)
WORDS = "system popen Popen eval exec load loads _rebuild_tensor_v2 matrix core.multiarray x"
TEXTS = [f"c{module}\n{word}\n" for module in MODULES.split() for word in WORDS.split()]
HEAD = pickle.dumps({"dof_pos": floats(4, 2)}, 4)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
def test_calls_are_refused_by_name(function: Any) -> None:
    for protocol in range(6):
        for value in (
            Call(function, "echo pwned > pwned"),
            {"a": floats(4, 2), "b": Call(function)},
        ):
            with pytest.raises(SourceError, match="is never called|written as text") as error:
                read(pickle.dumps(value, protocol))
            assert function.__name__ in str(error.value) or protocol < 3
    assert not Path("pwned").exists()


def test_names_are_refused() -> None:
    for text in TEXTS:
        for tail in (b".", b"(S'echo'\ntR.", b")R.", b")\x81.", b")}\x92.", b"(o.", b"N."):
            with pytest.raises(SourceError):
                read(text.encode() + tail)
        with pytest.raises(SourceError):
            read(b"\x80\x04(" + text.encode() + b"l.")
    for opcode in (b"ios\nsystem\n", b"\x82\1", b"\x83\1\0", b"\x84\1\0\0\0", b"Pid\n", b"NQ"):
        with pytest.raises(
            SourceError, match="would create an object of a program, which is never done"
        ):
            read(b"(" + opcode + b".")
    for opcode in (b"\x97", b"N\x98"):
        with pytest.raises(
            SourceError, match="would create an object of a program, which is never done"
        ):
            read(b"\x80\5" + opcode + b".")


NEST = 20_000
BOMBS = {
    "deep lists": b"]" * NEST + b"a" * (NEST - 1) + b".",
    "deep tuples": b")" + b"\x85" * NEST + b".",
    "deep dictionaries": b"}" + b"X\1\0\0\0a}" * NEST + b"s" * NEST + b".",
    "tuple as a key": b"}" + b")" + b"\x85" * NEST + b"Ns.",
    "doubled lists": b"]q\0" + b"]h\0ah\0aq\0" * NEST + b".",
    "doubled memos": b")q\0" + b"h\0h\0\x86q\0" * NEST + b".",
    "doubled tuples": b")" + b"2\x86" * NEST + b".",
    "list in itself": b"]q\0h\0ah\0ah\0a.",
    "a large length": b"\x80\4\x8e\xff\xff\xff\xff\xff\xff\xff\x7f.",
    "a large frame": b"\x80\4\x95\xff\xff\xff\xff\xff\xff\xff\x7f.",
    "a negative length": b"T\xff\xff\xff\xff.",
    "a long integer": b"\x8b" + struct.pack("<i", 2**20) + b"\x7f" * 2**20 + b".",
    "a printed integer": b"L" + b"9" * 2**20 + b"L\n.",
    "a printed float": b"F" + b"9" * 2**20 + b"\n.",
    "a place of the memo": b"Np" + b"9" * 2**20 + b"\n.",
    "marks": b"(" * 2**16 + b".",
    "numbers": b"K\1" * 2**15 + b".",
    "many names": b"}(" + b"X\2\0\0\0ab]" * 50_000 + b"u.",
    "shared names": b"](" + b"X\xc8\0\0\0" + b"a" * 200 + b"q\0" + b"h\0" * 50_000 + b"e.",
    "shared shapes": (b"(" + b"K\1" * 50_000 + b"tq\0(" + b"h\0" * 50_000 + b"l."),
    "no text": b"X\2\0\0\0\xff\xff.",
    "an escape": b"V\\u00\n.",
    "no quotes": b"Sabc\n.",
}


@pytest.mark.parametrize("name", BOMBS)
def test_bombs_take_what_their_bytes_earn(name: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(SourceError):
            read(BOMBS[name])
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < LIMIT + 150 * len(BOMBS[name])


def test_damaged_files_are_restored_or_refused() -> None:
    """Prefixes, bytes changed in turn, and bytes left out, of every protocol."""
    clip = {"fps": 30, "dof_pos": floats(4, 2), "root_pos": floats(4, 3), "dof_names": ["a", "b"]}
    files = [pickle.dumps(clip, protocol) for protocol in (0, 2, 4, 5)]
    files.append(joblib_file({"a": clip}))
    files.append(pickle.dumps({"a": clip, "b": clip | {"dof_pos": floats(3, 2)}}, 4))
    n_tried = 0
    for data in files:
        for at in some(range(len(data)), 3):
            back_or_refused(data[:at])
            back_or_refused(data[:at] + data[at + 1 :])
            for bit in (0, 7):
                back_or_refused(data[:at] + bytes((data[at] ^ 1 << bit,)) + data[at + 1 :])
            n_tried += 4
    assert n_tried > 700


def test_opcodes_are_bounded() -> None:
    with pytest.raises(SourceError, match="more than 1048576 opcodes"):
        read(b"N" * 2**21 + b".")


def read_tensors(data: bytes) -> Motion:
    motion: Motion = FORMATS["torch"].read(data, "walk")
    assert FORMATS["torch"].write(motion) == data
    return motion


def test_a_file_of_torch() -> None:
    array = floats(40, 2, 3).astype("<f4")
    data = tensor_file(array)
    motion = read_tensors(data)
    np.testing.assert_array_equal(motion.values, array.reshape(40, 6))
    assert motion.frame_rate == 30 and likely_formats(data) == ("torch",)
    assert format_of("a.pth").name == "torch" and FORMATS["torch"].is_motion is not None
    assert FORMATS["torch"].is_motion(data)
    out = io.BytesIO()
    mcz.write(motion, out)
    with mcz.open(out.getvalue()) as file:
        part = file.only_clip().source_bytes((3, 8))
    np.testing.assert_array_equal(read_tensors(part).values, array.reshape(40, 6)[3:8])
    assert part.count(b"K\x1eM") == 0 and b"cpuK\x1e" in part  # 5 x 2 x 3 numbers
    listed = arrays_of(motion.source, ["motion"]) or []
    assert [row["name"] for row in listed] == ["dof_pos"]
    with zipfile.ZipFile(io.BytesIO(part)) as archive:
        assert archive.testzip() is None


def test_files_of_torch_by_torch() -> None:
    torch = pytest.importorskip("torch")
    x = torch.arange(60.0).reshape(20, 3)
    tensors = {"dof_pos": torch.rand(20, 7), "x": x, "view": x[2:9], "half": x.half(), "fps": 50}
    buffer = io.BytesIO()
    torch.save(tensors, buffer)
    motion = read_tensors(buffer.getvalue())
    assert [signal.name for signal in motion.signals] == ["motion", "half"]
    assert "x is a view of a storage" in motion.metadata["source-note"]
    out = io.BytesIO()
    mcz.write(motion, out)
    with mcz.open(out.getvalue()) as file:
        part = torch.load(io.BytesIO(file.only_clip().source_bytes((3, 8))))
    assert torch.equal(part["dof_pos"], tensors["dof_pos"][3:8]) and torch.equal(part["x"], x)


def test_files_of_torch_that_are_refused() -> None:
    with pytest.raises(SourceError, match="torch before 1.6"):
        read_tensors(b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19.")
    with pytest.raises(SourceError, match="a ZIP with data.pkl"):
        read_tensors(b"none")
    data = tensor_file(floats(4, 2).astype("<f4"))
    with pytest.raises(
        SourceError, match="'posix.FloatStorage' does not belong to arrays, and is never called"
    ):
        read_tensors(data.replace(b"ctorch\nFloat", b"cposix\nFloat"))
    with pytest.raises(SourceError, match="'torch._utils._rebuild_tensor_v2' does not belong to"):
        read(b"\x80\2ctorch._utils\n_rebuild_tensor_v2\n.")
    for at in range(len(data)):
        for changed in (data[:at] + bytes((data[at] ^ 0x81,)) + data[at + 1 :], data[:at]):
            with suppress(mcz.SourceError, mcz.LimitError):
                read_tensors(changed)
