"""NPY and NPZ: whatever NumPy and zipfile write is given back, and nothing else is believed."""

from __future__ import annotations

import io
import json
import os
import pickle
import struct
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import MczError, MotionError, OptionError, SourceError
from mcz.files.editing.folders import motion_files
from mcz.model.numbers import GridKind
from mcz.sources import FORMATS, likely_formats
from mcz.sources.arrays.skeletons import KINDS
from tests.commands import run
from tests.formats.saved_arrays import arrays, save_npz
from tools.vectors.build.array_files import Member, floats, npy, npz


def back(data: bytes, suffix: str = "npz") -> mcz.Motion:
    """The motion in a file that is given back, also by way of an MCZ file."""
    motion: mcz.Motion = FORMATS[suffix].read(data, "take")
    assert FORMATS[suffix].write(motion) == data
    out = io.BytesIO()
    mcz.write(motion, out)
    with mcz.open(out.getvalue()) as file:
        assert file.only_clip().source_bytes() == data
    return motion


class Forward(io.BytesIO):
    """A stream that cannot seek: zipfile writes sizes behind the members."""

    def seek(self, *args: Any) -> int:
        raise OSError("no")

    def tell(self) -> int:
        raise OSError("no")


@given(arrays())
def test_any_array_comes_back_or_is_refused(array: Any) -> None:
    buffer = io.BytesIO()
    np.save(buffer, array)
    try:
        motion = back(buffer.getvalue(), "npy")
    except SourceError:
        plain = array.ndim > 1 and array.size
        odd = array.dtype.kind in "iu" and array.dtype.itemsize == 8
        assert not plain or odd or array.dtype in (np.float16, np.bool_)
        return
    with np.errstate(invalid="ignore"):  # of NaNs that signal
        shown = array.reshape(len(array), -1).astype(np.float64)
    np.testing.assert_array_equal(motion.values, shown)


def test_blanks_of_a_head_end_where_the_numbers_begin() -> None:
    head = b"\x93NUMPY\1\0\x40\0{'descr': '|u1', 'fortran_order': False, 'shape': (2, 2)}"
    back(head.ljust(74) + b"    ", "npy")
    for shape in (b"02, 2)}", b"2" * 19 + b", 2)}", b"1," * 65 + b")}"):
        odd = (head[: head.index(b"2, 2)")] + shape).ljust(74 + len(shape))
        size = (len(odd) - 10).to_bytes(2, "little")
        with pytest.raises(SourceError, match="the shape .* is no plain one"):
            FORMATS["npy"].read(odd[:8] + size + odd[10:] + b"    ")


def with_head(text: bytes, version: bytes = b"\1\0", n_bytes: int = 48) -> bytes:
    """An NPY file whose head has this text, and so many bytes of numbers."""
    size = len(text).to_bytes(2 if version[0] == 1 else 4, "little")
    return b"\x93NUMPY" + version + size + text + np.arange(n_bytes / 8).tobytes()


ORDER = b"'fortran_order': False"


@pytest.mark.parametrize(
    "text",
    [
        b"{'descr': '<f8', %b, 'shape': (3, 2), 'shape': (2, 3)}" % ORDER,
        b"{'descr': '<i8', 'descr': '<f8', %b, 'shape': (3, 2)}" % ORDER,
        b"{'descr': '<f8', 'fortran_order': True, %b, 'shape': (3, 2)}" % ORDER,
        b"{'descr': '<f8', %b, 'shape': (3, 2), # 'shape': (2, 3)\n}" % ORDER,
        b"{# 'shape': (2, 3)\n'descr': '<f8', %b, 'shape': (3, 2)}" % ORDER,
        b"{'descr': '<f8', %b, 'shape': (3, 2), 'zz': \"'shape': (2, 3)\"}" % ORDER,
        b"{'descr': '<f8', %b, 'shape': (3, 2), 'sh\\x61pe': (2, 3)}" % ORDER,
        b"{'descr': '<f8', %b, 'shape': (6)}" % ORDER,
        b"{'descr': '<f8', %b, 'shape': (3, 2)} + {}" % ORDER,
        b"{'descr': '<f8' 'x', %b, 'shape': (3, 2)}" % ORDER,
        b"{'descr': '<f8', %b, 'shape': (3, 2),, }" % ORDER,
        b"{'descr\": '<f8', %b, 'shape': (3, 2)}" % ORDER,
        b"\n{'descr': '<f8', %b, 'shape': (3, 2)}" % ORDER,
        b"{'descr': '<f8', %b}" % ORDER,
        b"{'descr': '<f8', %b, 'shape': (3, 2)}%b" % (ORDER, b" " * 10_000),
    ],
)
def test_heads_that_might_mean_something_else_to_numpy_are_refused(text: bytes) -> None:
    with pytest.raises(SourceError, match="offset"):
        FORMATS["npy"].read(with_head(text))


def test_versions_of_heads() -> None:
    text = b"{'descr': '<f8', %b, 'shape': (3, 2)}\n" % ORDER
    for version in (b"\1\0", b"\2\0", b"\3\0"):
        np.testing.assert_array_equal(
            FORMATS["npy"].read(with_head(text, version)).values, [[0, 1], [2, 3], [4, 5]]
        )
    for version in (b"\0\0", b"\1\1", b"\2\1", b"\4\0"):
        with pytest.raises(SourceError, match="version"):
            FORMATS["npy"].read(with_head(text, version))


PARTS = [
    *(bytes((byte,)) for byte in b"{},:()'\"\n #ubL"),
    b"\\x61",
    *(b"'shape': (2, 3)", b"'descr': '>f8'", b"'fortran_order': True", b"'zz': 1", b"\v", b"\f"),
    *(b"(6,)", b"(1, 6,)", b"0", b"_", b"1", b"-", b"+0", b"()", b"True", b"\0", b"\r", b"[", b"]"),
]
ITEMS = [b"'descr': '<f8'", ORDER, b"'shape': (3, 2)"]


@pytest.mark.filterwarnings("ignore:Reading `.npy`:UserWarning")  # NumPy, of a header of Python 2
@given(
    st.lists(st.tuples(st.integers(0, 80), st.integers(0, 24), st.sampled_from(PARTS))), st.data()
)
def test_heads_mean_what_they_mean_to_numpy_or_are_refused(
    edits: list[tuple[int, int, bytes]], data: st.DataObject
) -> None:
    items = data.draw(st.permutations(ITEMS))
    text = b"{" + b", ".join(items) + data.draw(st.sampled_from([b", }", b"}", b",}  \n"]))
    for at, length, part in edits[:4]:
        text = text[:at] + part + text[at + length :]
    raw = with_head(text)
    try:
        motion = FORMATS["npy"].read(raw)
    except MczError:
        return
    found = np.load(io.BytesIO(raw))
    assert len(found.tobytes()) == 48
    np.testing.assert_array_equal(motion.values, found.reshape(len(found), -1))


@pytest.mark.parametrize("other", ["a.npy", "a", "a.npy\0x"])
def test_a_member_that_is_there_twice_is_refused(other: str) -> None:
    """NumPy reads the last, others the first."""
    members = [
        Member(name, npy(np.full((3, 2), value)))
        for value, name in enumerate(("a.npy", "b.npy", other))
    ]
    with pytest.raises(SourceError, match="two members have the name 'a'"):
        FORMATS["npz"].read(npz(members))
    FORMATS["npz"].read(npz(members[:2]))


def test_a_zip_that_was_written_forward() -> None:
    stream = Forward()
    with zipfile.ZipFile(stream, "w") as archive:
        for name in "ab":
            archive.writestr(f"{name}.npy", npy(floats(4, 3)))
    data = stream.getvalue()
    assert b"PK\7\x08" in data
    motion = back(data)
    cut = replace(motion, signals=tuple(signal.cut(1, 3) for signal in motion.signals))
    part = FORMATS["npz"].write(cut)
    with np.load(io.BytesIO(part)) as arrays:  # which checks sizes and CRC-32
        np.testing.assert_array_equal(arrays["b"], floats(4, 3)[1:3])


@pytest.mark.parametrize("order", ["C", "F"])
def test_frames_of_a_file_are_a_file_that_numpy_loads(order: Any) -> None:
    poses = np.array(floats(50, 4, 3), order=order)
    given = {"poses": poses, "force": floats(100, 2).astype(">f4"), "who": np.array("A")}
    out = io.BytesIO()
    mcz.write(back(save_npz(**given)), out)
    with mcz.open(out.getvalue()) as file:
        part = file.only_clip().source_bytes((3, 12))
    with np.load(io.BytesIO(part)) as arrays:
        np.testing.assert_array_equal(arrays["poses"], given["poses"][3:12])
        np.testing.assert_array_equal(arrays["force"], given["force"][6:24])
        assert arrays["who"] == "A"


def test_nothing_is_unpickled() -> None:
    class Bomb:
        def __reduce__(self) -> Any:
            return pytest.fail, ("unpickled",)

    pickled = np.array([None], object)
    buffer = io.BytesIO()
    np.save(buffer, pickled, allow_pickle=True)
    evil = buffer.getvalue()[:128] + pickle.dumps(Bomb())
    members = (Member("evil.npy", evil), Member("a.npy", npy(floats(3, 2))))
    motion = back(npz(members))
    assert motion.metadata["source-note"] == "evil is pickled, and not unpickled"
    with pytest.raises(SourceError, match="_Fail.*is never called"):
        FORMATS["npy"].read(evil)


def _replace_number(data: bytes, at: int, format_: str, number: int) -> bytes:
    return data[:at] + struct.pack(format_, number) + data[at + struct.calcsize(format_) :]


def test_archives_that_lie_are_refused_by_place() -> None:
    plain = Member("a.npy", npy(floats(3, 2)), wide=False)
    data = npz([plain, replace(plain, name="b.npy")])
    entry, end = data.index(b"PK\1\2"), data.index(b"PK\5\6")
    second = data.index(b"PK\1\2", entry + 1)
    cases = (
        (
            _replace_number(data, entry + 24, "<I", 999),
            rf"offset {entry}: .*stored uncompressed.* and 999 bytes",
        ),
        (
            _replace_number(data, entry + 42, "<I", 7),
            rf"offset {entry}: member 'a.npy' has no local",
        ),
        (_replace_number(data, second + 42, "<I", 0), r"offset 0: member 'b.npy' has another name"),
        (
            _replace_number(data, 18, "<I", 5),
            "offset 18: member 'a.npy' has .* its local header states 5",
        ),
        (
            _replace_number(data, 8, "<H", 8),
            "offset 8: member 'a.npy' has different compression methods",
        ),
        (_replace_number(data, end + 10, "<H", 999), f"offset {end}: 999 members do not fit"),
        (_replace_number(data, end + 16, "<I", 1), f"offset {end}: a directory of .* from 1 on"),
        (
            data[:entry] + b"XX" + data[entry + 2 :],
            f"offset {entry}: the directory has an invalid entry",
        ),
        (b"PK", "no end of a ZIP directory"),
    )
    for changed, message in cases:
        with pytest.raises(SourceError, match=message):
            FORMATS["npz"].read(changed)
    size = len(plain.data)
    big = _replace_number(
        _replace_number(data, entry + 20, "<I", size + 9), entry + 24, "<I", size + 9
    )
    big = _replace_number(_replace_number(big, 18, "<I", size + 9), 22, "<I", size + 9)
    with pytest.raises(SourceError, match="overlap"):
        FORMATS["npz"].read(big)


def test_a_wrong_checksum_is_kept_and_said() -> None:
    members = (Member("a.npy", npy(floats(3, 2)), checksum=5),)
    motion = back(npz(members))
    assert motion.metadata["source-note"] == "the CRC-32 of a.npy is not that of its bytes"


def test_which_arrays_are_signals() -> None:
    times = np.arange(40) / 120
    motion = back(
        save_npz(
            times=times,
            joints=floats(40, 3, 3),
            angles=floats(40, 2).astype(np.float32),
            forces=floats(400, 6),
            mesh=floats(900, 3),
            steps=np.arange(40),
            model=np.array(["a", "b"]),
            bones=floats(16),
        )
    )
    found = {s.name: (s.n_channels, s.samples_per_frame) for s in motion.signals}
    wanted = {"times": (1, 1), "angles": (2, 1), "forces": (6, 10), "steps": (1, 1)}
    assert found == {"motion": (9, 1), **wanted}
    assert motion.frame_rate == 120
    assert motion.skeleton.joint_names == ("0", "1", "2")
    assert motion.metadata == {"source-note": "mesh has 900x3 numbers, and is kept as its bytes"}
    assert motion.signals[1].channels == (mcz.Channel("", "times", "s"),)
    uneven = back(save_npz(times=times**2, joints=floats(40, 3), fps=np.array(30)))
    assert uneven.frame_rate is None
    assert uneven.metadata["source-note"] == "the times are not uniform"
    rates = {np.float32(59.94): 59.94, 29.97: 29.97, 30000 / 1001: 30000 / 1001, 100: 100.0}
    for stated, rate in rates.items():
        found_rate = back(save_npz(a=floats(3, 2), framerate=stated)).frame_rate
        assert found_rate is not None and float(found_rate) == rate


def test_columns_get_the_grid_that_is_shortest() -> None:
    columns = [
        np.round(floats(30), 2),
        floats(30).astype(np.float32).astype(np.float64),
        floats(30),
        np.where(np.arange(30) == 7, 0.123456, 1.0),
        np.where(np.arange(30) == 8, -0.0, 0.0),
    ]
    kinds = [grid.kind for grid in back(npy(np.array(columns).T), "npy").signals[0].grids]
    fixed = GridKind.FIXED
    assert kinds == [fixed, GridKind.BINARY32, GridKind.BINARY64, fixed, fixed]


BODY = floats(5, 165)


@pytest.mark.parametrize(("n_joints", "name"), [(24, "SMPL"), (52, "SMPL-H"), (55, "SMPL-X")])
def test_a_body_is_a_tree_of_joints(n_joints: int, name: str) -> None:
    poses = BODY[:, : 3 * n_joints].copy()
    given = {
        "poses": poses,
        "trans": floats(5, 3, seed=2),
        "gender": np.array("male"),
        "mocap_framerate": np.array(120.0),
        "betas": floats(10),
        "dmpls": floats(5, 8, seed=3),
    }
    motion = back(save_npz(**given))
    assert motion.skeleton.name == name and motion.skeleton.n_joints == n_joints
    assert motion.skeleton.joints[0].name == "pelvis"
    assert [s.name for s in motion.signals] == ["motion", "dmpls"]
    np.testing.assert_array_equal(motion.values, np.hstack([given["trans"], poses]))
    assert motion.metadata == {"x-gender": "male", "x-num-betas": "10"}
    assert (motion.frame_rate, motion.skeleton.unit_cm, motion.skeleton.angle_unit) == (
        120,
        100.0,
        "rad",
    )


def model_file(path: Path, n_shapes: int) -> np.ndarray:
    """A made-up model of SMPL; returns how a beta moves joints, (n_joints, 3, n_shapes)."""
    body, rng = mcz.body_skeleton("smpl"), np.random.default_rng(5)
    vertices, regressor = rng.normal(size=(60, 3)), rng.normal(size=(24, 60))
    shapes = rng.normal(size=(60, 3, n_shapes))
    parents = [joint.parent % 2**32 for joint in body.joints]
    table = np.array([parents, range(24)])
    arrays = {"J_regressor": regressor, "v_template": vertices, "shapedirs": shapes}
    np.savez(path, kintree_table=table, **arrays)
    return np.einsum("jv,vks->jks", regressor, np.dstack([shapes, vertices]))


def test_joints_that_all_lie_at_the_root_are_not_shown_without_a_word(tmp_path: Path) -> None:
    """Pictures and files of other formats would look fine and mean nothing."""
    said = "no bone has a length: all joints lie at the root until rest offsets are set"
    body = back(save_npz(poses=floats(5, 72), trans=floats(5, 3)))
    for to in ("bvh", "c3d", "glb", "trc"):
        assert mcz.conversion_losses(body, to)[0] == said
    assert said not in mcz.conversion_losses(body, "csv")
    assert mcz.render(body, tmp_path / "still.svg").notes[0] == said
    offsets = np.vstack([np.zeros((1, 3)), np.full((23, 3), 0.1)])
    shaped = mcz.with_offsets(body, offsets)
    comparison = mcz.compare(body, shaped)
    assert comparison.mse == 0 and comparison.max_position_error is None
    assert "no bone has a length, unlike on the other side: no positions" in comparison.notes[-1]
    assert said not in (
        *mcz.conversion_losses(shaped, "bvh"),
        *mcz.render(shaped, tmp_path / "b.svg").notes,
    )


def test_a_model_file_says_how_long_bones_are(tmp_path: Path) -> None:
    moves = model_file(tmp_path / "smpl_female.npz", 4)
    betas, poses, take = np.array([0.5, -1, 2, 0, 0]), floats(9, 72), tmp_path / "take.npz"
    np.savez(take, poses=poses, trans=floats(9, 3), betas=betas, gender="female")
    target = tmp_path / "take.mcz"
    mcz.encode(take, target, model=tmp_path / "{body}_{gender}.npz")
    with mcz.open(target) as file:
        skeleton = file["take"].skeleton
        assert file["take"].source_bytes() == take.read_bytes()
    joints = moves @ [0.5, -1, 2, 0, 1]
    for joint, own in zip(skeleton.joints, joints, strict=True):
        above = joints[joint.parent] if joint.parent >= 0 else 0.0
        np.testing.assert_allclose(joint.offset, own - above, atol=1e-12)
    np.testing.assert_array_equal(mcz.read(take).skeleton.joints[1].offset, (0, 0, 0))
    plain = tmp_path / "plain.npy"
    np.save(plain, poses)
    assert mcz.read(plain, model="there is none").n_frames == 9  # no body, no model


@pytest.mark.parametrize(
    ("arrays", "model", "message"),
    [
        ({}, "model_{gender}.npz", "needs the gender of the take"),
        ({"gender": "../x"}, "model_{gender}.npz", "gender of the take, which is '../x'"),
        ({"betas": np.arange(6.0)}, "model_female.npz", "6 betas are given, but the model has 4"),
        ({"betas": np.eye(3)}, "model_female.npz", "holds more than one body shape"),
        ({}, "missing.npz", "No such file"),
    ],
)
def test_models_that_do_not_fit(
    arrays: dict[str, Any], model: str, message: str, tmp_path: Path
) -> None:
    model_file(tmp_path / "model_female.npz", 4)
    np.savez(tmp_path / "take.npz", poses=floats(9, 72), **arrays)
    with pytest.raises(MczError, match=message):
        mcz.read(tmp_path / "take.npz", model=tmp_path / model)


def test_bones_without_a_length_have_no_errors_in_cm() -> None:
    motion = FORMATS["npz"].read(save_npz(poses=BODY[:, :72], trans=BODY[:, :3]), "body")
    for codec, params in (("mrdwt", {"mean_error_cm": 1.0}), ("lsdt-clip", {}), ("posewave", {})):
        with pytest.raises(OptionError, match="no bone has a length"):
            mcz.write(motion, io.BytesIO(), codec, **params)
    mcz.write(motion, io.BytesIO(), "mrdwt")


def test_parts_of_a_body() -> None:
    trans = floats(5, 3, seed=2)
    parts = {"root_orient": BODY[:, :3], "pose_body": BODY[:, 3:66]}
    assert back(save_npz(**parts)).skeleton.n_joints == 22
    hands = {"left_hand_pose": BODY[:, 75:120], "right_hand_pose": BODY[:, 120:]}
    assert back(save_npz(**parts, **hands, transl=trans)).skeleton.n_joints == 52
    face = {"pose_jaw": BODY[:, 66:69], "pose_eye": BODY[:, 69:75]}
    motion = back(save_npz(**face, **hands, **parts, trans=trans))
    assert motion.skeleton.n_joints == 55
    np.testing.assert_array_equal(motion.values[:, 3:], BODY)
    twice = back(save_npz(**face, **hands, poses=BODY, **parts))
    assert len(twice.signals) == 1
    parts["pose_body"] = parts["pose_body"] + 1e-9
    other = back(save_npz(poses=BODY, **parts))
    assert [s.name for s in other.signals] == ["motion", "pose_body"]


def test_somebody_says_what_plain_arrays_are(tmp_path: Path) -> None:
    path = tmp_path / "joints.npy"
    for name, kinds in KINDS.items():
        for shape in ((6, 5, len(kinds)), (6, 5 * len(kinds))):
            path.write_bytes(npy(floats(*shape)))
            motion = mcz.read(path, arrays=name, unit="m", up="y", rate=20)
            assert [c.kind for c in motion.skeleton.channels] == [*kinds] * 5
            mcz.encode(path, tmp_path / "a.mcz", arrays=name, rate=20, force=True)
            with mcz.open(tmp_path / "a.mcz") as file:
                clip = file.only_clip()
                assert clip.source_bytes() == path.read_bytes()
                assert clip.skeleton.channels == motion.skeleton.channels
    with pytest.raises(MotionError, match="have 3 numbers a joint, but the array has 4"):
        path.write_bytes(npy(floats(6, 5, 4)))
        mcz.read(path, arrays="positions")
    with pytest.raises(OptionError, match="one of positions"):
        mcz.read(path, arrays="markers")
    points = tmp_path / "points.npy"
    points.write_bytes(npy(floats(6, 5, 3)))
    positions = mcz.positions(mcz.read(points, arrays="positions", unit="m"))
    np.testing.assert_allclose(positions, floats(6, 5, 3))


def test_gaps_are_invalid_and_lossy_codecs_leave_them_open(tmp_path: Path) -> None:
    values = np.cumsum(floats(64, 2, 3), axis=0).astype(np.float32)
    values[5:9, 1] = np.nan
    path = tmp_path / "gaps.npy"
    path.write_bytes(npy(values))
    target = tmp_path / "gaps.mcz"
    mcz.encode(path, target, codec="mrdwt", arrays="positions", unit="cm", rate=30)
    with mcz.open(target) as file:
        found = np.load(io.BytesIO(file.only_clip().source_bytes()))
    assert found.dtype == np.float32
    np.testing.assert_array_equal(np.isnan(found), np.isnan(values))


def test_files_without_a_motion_are_refused_with_the_reason() -> None:
    cases = {
        npy(np.array(3.0)): "a single number",
        npy(floats(16)): "no array has a row for each frame; 'array' is of shape",
        npy(floats(3, 0)): r"is of shape",
        npy(np.zeros((3, 2), complex)): "of type c16",
        npy(floats(3, 2))[:-1]: "offset 128: 47 bytes of numbers",
        npy(np.full((2, 2), 2**60)): "an integer beyond 2\\^53",
        b"\x93NUMPY\4\0\0\0": "no NPY file|version 4",
    }
    for data, message in cases.items():
        with pytest.raises(SourceError, match=message):
            FORMATS["npy"].read(data)
    with pytest.raises(SourceError, match="no array has a row for each frame; 'betas' is of shape"):
        FORMATS["npz"].read(save_npz(betas=floats(16)))
    with pytest.raises(SourceError, match="no array"):
        FORMATS["npz"].read(npz(()))
    assert likely_formats(npy(floats(2, 2))) == ("npy",)
    assert likely_formats(save_npz(a=floats(2, 2))) == ("npz",)


def test_what_a_folder_has_of_motions(tmp_path: Path) -> None:
    """Means and names beside a data set are no motions, and pack leaves them out."""
    np.save(tmp_path / "mean.npy", np.zeros(22))
    np.save(tmp_path / "motion.npy", np.zeros((9, 22)))
    np.savez(tmp_path / "names.npz", names=np.array([["a", "b"]]), count=3)
    np.savez(tmp_path / "poses.npz", gender="neutral", poses=np.zeros((9, 72)))
    np.savez_compressed(tmp_path / "deflated.npz", poses=np.zeros((9, 72)))
    (tmp_path / "no.npy").write_bytes(b"no array")  # its reader says so
    motions, others = motion_files(sorted(tmp_path.iterdir()))
    assert [path.name for path in others] == ["mean.npy", "names.npz"]
    assert len(motions) == 4


def test_a_motion_of_another_source_is_no_array_file() -> None:
    motion = mcz.Motion(mcz.Skeleton(()), (mcz.Signal(np.zeros((2, 0))),))
    with pytest.raises(MotionError, match="to_npz"):
        FORMATS["npz"].write(motion)


@pytest.mark.real
def test_real_arrays() -> None:
    for path in sorted((Path(os.environ["MCZ_DATA"]) / "other" / "humanml3d").glob("*.npy")):
        back(path.read_bytes(), "npy")


def test_commands_say_what_is_read_and_what_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, held, again = (str(tmp_path / name) for name in ("a.npz", "a.mcz", "b.npz"))
    points = np.asfortranarray(floats(9, 4, 3))
    deflated = Member("old.npy", zlib.compress(b"anything")[2:-4], method=8, size=8)
    members = [
        Member("points.npy", npy(points, is_fortran=True)),
        Member("betas.npy", npy(floats(10))),
        Member("steps.npy", npy(np.arange(9).astype(">i4"))),
    ]
    Path(path).write_bytes(npz([*members, deflated]))
    assert run("encode", path, "--arrays", "positions", "--unit", "cm") == 0
    assert "old is no array (inflated, offset 0: no NPY file" in capsys.readouterr().err
    assert run("decode", held, "-o", again) == 0
    assert Path(again).read_bytes() == Path(path).read_bytes()
    capsys.readouterr()
    for file in (held, path):
        assert run("info", file) == 0
        output = capsys.readouterr().out
        assert "  array      points: 12 columns of <f8, by columns, in motion\n" in output
        assert "  array      steps: 1 column of >i4, in steps\n" in output
        assert "  kept       as bytes: betas, old\n" in output
    assert run("info", "--json", held) == 0
    (clip,) = json.loads(capsys.readouterr().out)["clips"]
    assert clip["arrays"][3] == {
        "name": "old", "type": None, "order": None, "columns": None, "signal": None
    }  # fmt: skip
    assert [array["name"] for array in clip["arrays"]] == ["points", "betas", "steps", "old"]
    assert run("encode", path, "--arrays", "quaternions-wxyz", "--force") == 1
    assert "have 4 numbers a joint, but the array has 3" in capsys.readouterr().err
