"""Motion-BIDS: names, units and rates of side files; every byte of the table again."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

import mcz

NAME = "sub-01_ses-walk_task-walk_tracksys-omc_run-1"
HEADER = "name\tcomponent\ttype\ttracked_point\tunits\n"
AXES = "xyz"


def data_set(folder: Path, channels: str, n_columns: int, about: object = None) -> Path:
    """A table below ``folder``, which has the side file of channels beside it."""
    motion = folder / "sub-01" / "ses-walk" / "motion"
    motion.mkdir(parents=True)
    rows = np.round(np.cumsum(np.ones((20, n_columns)), axis=0) / 7 + np.arange(n_columns), 4)
    path = motion / f"{NAME}_motion.tsv"
    np.savetxt(path, rows, fmt="%.4f", delimiter="\t")
    (motion / "sub-01_ses-walk_task-walk_tracksys-omc_channels.tsv").write_text(channels)
    if about is not None:
        (motion / f"{NAME}_motion.json").write_text(json.dumps(about))
    return path


def positions(units: str = "mm") -> str:
    rows = [
        f"{point}_{axis}\t{axis}\tPOS\t{point}\t{units}\n"
        for point in ("toe", "heel")
        for axis in AXES
    ]
    return HEADER + "".join(rows)


def test_positions_are_markers(tmp_path: Path) -> None:
    path = data_set(tmp_path, positions(), 6, {"SamplingFrequency": 59.94})
    motion = mcz.read(path)
    assert motion.skeleton.joint_names == ("toe", "heel")
    assert motion.skeleton.unit_cm == 0.1
    assert float(motion.frame_rate or 0) == 59.94
    assert mcz.positions(motion, unit="mm").shape == (20, 2, 3)
    target = io.BytesIO()
    mcz.encode(path, target)
    with mcz.open(target.getvalue()) as file:
        clip = next(iter(file))
        assert clip.source_bytes() == path.read_bytes()
        assert clip.source is not None
        assert clip.source.path == path.name


def test_other_channels_are_scalars_with_their_units(tmp_path: Path) -> None:
    rows = HEADER + "acc_x\tx\tACCEL\tfoot\tm/s^2\n" + "flag\tn/a\tMISC\tn/a\tn/a\n"
    motion = mcz.read(data_set(tmp_path, rows, 2))
    assert motion.skeleton.joint_names == ("acc_x", "flag")
    assert [channel.unit for channel in motion.skeleton.channels] == ["m/s^2", ""]
    assert motion.frame_rate is None


def test_side_files_of_the_folders_above_are_inherited(tmp_path: Path) -> None:
    path = data_set(tmp_path, positions(), 6)
    (tmp_path / "task-walk_motion.json").write_text('{"SamplingFrequency": 100}')
    (tmp_path / "task-run_motion.json").write_text('{"SamplingFrequency": 50}')
    assert mcz.read(path).frame_rate == 100


def test_a_table_without_side_files_is_read_as_columns(tmp_path: Path) -> None:
    path = data_set(tmp_path, positions(), 6)
    plain = tmp_path / "plain.tsv"
    plain.write_bytes(path.read_bytes())
    assert mcz.read(plain).skeleton.joint_names[0] == "column 1"


@pytest.mark.parametrize(
    ("channels", "about", "fault"),
    [
        (positions() + "more\tx\tPOS\tmore\tmm\n", None, "7 channels are listed, but"),
        (HEADER + "\tx\tPOS\ttoe\tmm\n" * 6, None, "a channel has no name"),
        (positions(), [], "not an object with a SamplingFrequency in hertz"),
        (
            positions(),
            {"SamplingFrequency": "often"},
            "not an object with a SamplingFrequency in hertz",
        ),
        (positions(), {"SamplingFrequency": 0}, "SamplingFrequency is 0 Hz"),
        (positions(), {"SamplingFrequency": 1e300}, "SamplingFrequency is 1e"),
    ],
)
def test_side_files_that_do_not_fit_are_refused(
    tmp_path: Path, channels: str, about: object, fault: str
) -> None:
    path = data_set(tmp_path, channels, 6, about)
    with pytest.raises(mcz.SourceError, match=fault):
        mcz.read(path)


def test_units_that_differ_make_no_markers(tmp_path: Path) -> None:
    mixed = positions().replace("mm", "m", 1)
    motion = mcz.read(data_set(tmp_path, mixed, 6))
    assert motion.skeleton.joint_names[0] == "toe_x"


def test_two_side_files_that_apply_alike_are_refused(tmp_path: Path) -> None:
    path = data_set(tmp_path, positions(), 6)
    for entity in ("ses-walk", "run-1"):
        (path.parent / f"sub-01_{entity}_motion.json").write_text('{"SamplingFrequency": 100}')
    with pytest.raises(mcz.SourceError, match="sub-01_run-1_motion.json and sub-01_ses-walk_mot"):
        mcz.read(path)


def test_side_files_name_columns_that_look_like_a_robot(tmp_path: Path) -> None:
    rows = HEADER + "".join(f"angle {k}\tn/a\tMISC\tn/a\trad\n" for k in range(36))
    path = data_set(tmp_path, rows, 36)
    table = np.loadtxt(path, delimiter="\t")
    table[:, 3:7] = [0, 0, 0, 1]
    np.savetxt(path, table, fmt="%.4f", delimiter="\t")
    motion = mcz.read(path)
    assert motion.skeleton.joint_names[0] == "angle 0"
    assert not {"x-robot", "source-note"} & motion.metadata.keys()


def exported(motion: mcz.Motion, folder: Path) -> mcz.Motion:
    """``motion`` as BIDS, read again."""
    mcz.write(motion, folder / "one.mcz")
    report = mcz.export(folder / "one.mcz", folder / "out", "bids")
    assert not report.failures
    (table,) = (folder / "out").glob("sub-*/**/*_motion.tsv")
    return mcz.read(table)


def points_with_gaps() -> mcz.Motion:
    channels = tuple(map(mcz.Channel, ("tx", "ty", "tz")))
    joints = (mcz.Joint("toe", channels=channels), mcz.Joint("a\tb", channels=channels))
    values = np.arange(60.0).reshape(10, 6) / 7
    mask = np.ones((10, 6), np.bool_)
    mask[0, :3] = False
    signal = mcz.Signal(values, mask=mask)
    skeleton = mcz.Skeleton(joints, unit_cm=0.1)
    return mcz.Motion(skeleton, (signal,), 120, name="day/walk 2", metadata={"subject": "P-7"})


def test_export_and_back(tmp_path: Path) -> None:
    motion = points_with_gaps()
    again = exported(motion, tmp_path)
    assert again.name == "sub-P7_task-daywalk2_tracksys-omc_motion"
    assert again.skeleton.unit_cm == 0.1 and again.frame_rate == 120
    assert again.skeleton.joint_names[0] == "toe"
    np.testing.assert_array_equal(again.signals[0].masked(), motion.signals[0].masked())
    root = tmp_path / "out"
    assert (root / "participants.tsv").read_text() == "participant_id\nsub-P7\n"
    assert json.loads((root / "dataset_description.json").read_text())["Name"] == "out"
    about = json.loads(next(root.glob("sub-P7/motion/*_motion.json")).read_text())
    assert about["SamplingFrequency"] == 120 and about["POSChannelCount"] == 6
    mcz.pack(root, tmp_path / "kept.mcz", keep_all=True)
    report = mcz.unpack(tmp_path / "kept.mcz", tmp_path / "back")
    assert len(report.outcomes) == 6 and not report.failures


def test_export_of_joints_gaps_and_names(tmp_path: Path) -> None:
    """Names that BIDS gave are kept; missing frames make a column of times."""
    kinds = ("tx", "rx", "qw", "")
    joint = mcz.Joint("hip", channels=(*map(mcz.Channel, kinds[:3]), mcz.Channel("", "f", "N")))
    name = "sub-01_ses-b_task-run_tracksys-imu_acq-x_run-2_motion"
    signal = mcz.Signal(np.array([[-0.0, 1e-7, 3, 2.5e17]] * 3))
    numbers = np.array([1, 2, 5])
    motion = mcz.Motion(mcz.Skeleton((joint,)), (signal,), 100, name=name, frame_numbers=numbers)
    again = exported(motion, tmp_path)
    assert again.name == name
    assert again.values[:, :4].tobytes() == motion.values.tobytes()
    np.testing.assert_allclose(again.values[:, 4], [0, 0.01, 0.04], atol=1e-12)
    (table,) = (tmp_path / "out").glob("sub-01/ses-b/motion/*_channels.tsv")
    types = [line.split("\t")[1:3] for line in table.read_text().splitlines()[1:]]
    assert types == [
        ["x", "POS"],
        ["x", "JNTANG"],
        ["quat_w", "ORNT"],
        ["n/a", "MISC"],
        ["n/a", "LATENCY"],
    ]


def test_what_bids_does_not_have(tmp_path: Path) -> None:
    """Clips without rate or channels fail; the others are written, two of one name as runs."""
    value = mcz.Joint("a", channels=(mcz.Channel("", "value"),))
    paths = []
    for name, rate, joints in (
        ("x-1", 50, (value,)),
        ("x_1", 50, (value,)),
        ("y", None, (value,)),
        ("z", 50, ()),
    ):
        signal = mcz.Signal(np.ones((3, len(joints))))
        motion = mcz.Motion(mcz.Skeleton(joints), (signal,), rate, name=name)
        paths.append(tmp_path / f"{name}.mcz")
        mcz.write(motion, paths[-1])
    mcz.merge(paths, tmp_path / "all.mcz")
    report = mcz.export(tmp_path / "all.mcz", tmp_path / "out", "bids")
    reasons = [outcome.message for outcome in report.failures]
    assert len(reasons) == 2
    assert "BIDS requires a frame rate" in reasons[0]
    assert "the motion has neither joints nor points" in reasons[1]
    assert (tmp_path / "out" / "README").exists()
    folder = tmp_path / "out" / "sub-unknown" / "motion"
    stems = {"sub-unknown_task-x1_tracksys-omc", "sub-unknown_task-x1_tracksys-omc_run-2"}
    suffixes = {"_motion.tsv", "_motion.json", "_channels.tsv"}
    assert {path.name for path in folder.iterdir()} == {s + e for s in stems for e in suffixes}
    notes = [note for outcome in report.outcomes for note in outcome.notes]
    assert notes == ["the clip 'x_1': another has the name without run"]


def test_long_names_of_clips(tmp_path: Path) -> None:
    joints = (mcz.Joint("a", channels=(mcz.Channel("", "value"),)),)
    motion = mcz.Motion(mcz.Skeleton(joints), (mcz.Signal(np.ones((3, 1))),), 50, name="n" * 250)
    mcz.write(motion, tmp_path / "one.mcz")
    mcz.set_metadata(tmp_path / "one.mcz", {"n" * 250: {"subject": "s" * 250}})
    report = mcz.export(tmp_path / "one.mcz", tmp_path / "out", "bids")
    assert not report.failures
    assert len(list(tmp_path.glob("out/sub-*/motion/*_task-nnn*_channels.tsv"))) == 1


def test_missing_values_of_bids(tmp_path: Path) -> None:
    """The first row is a row of the table, too, where a value is missing in it."""
    path = tmp_path / "sub-1_motion.tsv"
    path.write_text("1.5\tn/a\n0.25\t2\n3\tn/a\n")
    motion = mcz.read(path)
    np.testing.assert_array_equal(
        motion.signals[0].masked(), [[1.5, np.nan], [0.25, 2], [3, np.nan]]
    )
    target = io.BytesIO()
    mcz.encode(path, target)
    with mcz.open(target.getvalue()) as file:
        assert file.only_clip().source_bytes() == path.read_bytes()
