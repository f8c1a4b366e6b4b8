"""``mcz decode --post-filter``."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import Motion
from tests.commands import Call


@pytest.fixture
def markers(samples: Path, tmp_path: Path) -> Path:
    """A C3D, coded coarsely."""
    motion = mcz.read(samples / "walk.c3d")
    mcz.write(motion, tmp_path / "walk.mcz", codec="lsdt-frame", step=40.0)
    return tmp_path / "walk.mcz"


@pytest.fixture
def places(samples: Path, tmp_path: Path) -> Path:
    """The places of an AMC, coded coarsely, at a frame rate that is not known."""
    motion = mcz.read(samples / "walk.amc")
    short = replace(motion, signals=(motion.signals[0].cut(0, 40),), source=None, frame_rate=None)
    mcz.write(short, tmp_path / "places.mcz", codec="lsdt-frame", step=0.5)
    return tmp_path / "places.mcz"


def read_motion(file: Path) -> Motion:
    with mcz.open(file) as reader:
        return next(iter(reader.clips.values())).motion()


def test_tables(markers: Path, tmp_path: Path, call: Call) -> None:
    whole = mcz.post_filter(read_motion(markers)).signals[0]
    out = tmp_path / "walk.npz"
    assert call("decode", markers, "--post-filter", "--to", "npz", "-o", out)[0] == 0
    with np.load(out, allow_pickle=False) as table:
        assert np.array_equal(table["values"], whole.values)
        assert np.array_equal(table["mask"], whole.mask)
    arguments = ("--frames", "5:9", "--joints", "1", "--to", "csv", "-o", tmp_path / "w.csv")
    assert call("decode", markers, "--post-filter", *arguments)[0] == 0
    rows = list(csv.reader(io.StringIO((tmp_path / "w.csv").read_text())))
    found = np.array([[float(cell) for cell in row[2:]] for row in rows[1:]])
    assert np.array_equal(found, whole.values[5:9, 3:6])


def test_c3d(markers: Path, tmp_path: Path, call: Call) -> None:
    """Its own file again, in the style of the source, and a plain one."""
    whole = mcz.post_filter(read_motion(markers))
    for name, arguments in {"own.c3d": (), "plain.c3d": ("--to", "c3d")}.items():
        out = tmp_path / name
        code, _, err = call("decode", markers, "--post-filter", *arguments, "-o", out)
        assert code == 0, err
        again = mcz.read(out).signals[0]
        valid = np.ones(again.values.shape, bool) if again.mask is None else again.mask
        assert np.abs(again.values - whole.values)[valid].max() < 0.1
        assert np.abs(again.values - read_motion(markers).values)[valid].max() > 1
    assert len(mcz.read(tmp_path / "own.c3d").signals) == len(read_motion(markers).signals)


def test_inverse_kinematics_after_the_filter(places: Path, tmp_path: Path, call: Call) -> None:
    out = tmp_path / "walk.amc"
    arguments = ("decode", places, "--post-filter", "--to", "amc", "--solve-ik", "-o", out)
    code, _, err = call(*arguments)
    assert code != 0
    assert "frame rate is unknown" in err
    code, _, err = call(*arguments, "--rate", "120", "--with-skeleton")
    assert code == 0, err
    assert "inverse kinematics: 31 points" in err
    seen = mcz.positions(mcz.post_filter(read_motion(places), rate=120))
    decoded = mcz.positions(mcz.read(out))
    assert (
        np.abs(decoded - seen).mean() < np.abs(decoded - mcz.positions(read_motion(places))).mean()
    )
    code, _, err = call("decode", places, "--post-filter", "--rate", "120")
    assert code != 0
    assert "choose a format with --to" in err


def test_what_is_refused(markers: Path, samples: Path, tmp_path: Path, call: Call) -> None:
    code, _, err = call("decode", markers, "--post-filter", "--preview", "--to", "csv")
    assert code == 2
    assert "--post-filter" in err
    angles = tmp_path / "angles.mcz"
    mcz.write(mcz.read(samples / "walk.bvh"), angles)
    for arguments in ((), ("--to", "bvh"), ("--to", "csv")):
        code, _, err = call("decode", angles, "--post-filter", *arguments)
        assert code not in (0, 2)
        assert "the post filter works on markers, and motion" in err
        assert len(err.splitlines()) == 1
    unknown = replace(mcz.post_filter(read_motion(markers)), frame_rate=None)
    mcz.write(unknown, tmp_path / "unknown.mcz")
    arguments = ("decode", tmp_path / "unknown.mcz", "--to", "csv", "-o", tmp_path / "u.csv")
    code, _, err = call(*arguments, "--post-filter")
    assert code == 2
    assert "set the frame rate (--rate)" in err
    assert call(*arguments, "--post-filter", "--rate", "120")[0] == 0
    assert call(*arguments, "--force", "--rate", "120")[0] == 2
    bare = tmp_path / "bare.mcz"
    assert call("encode", samples / "walk.asf", "-o", bare)[0] == 0
    code, _, err = call("decode", bare, "--post-filter")
    assert code == 2
    assert "no clips" in err
