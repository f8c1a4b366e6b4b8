"""The figures of Khan 2014 and 2016 for mrdwt, dwt, awt, qbc and pca, met with fewer bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz.kinematics.angles import unwrap
from mcz.kinematics.metrics import compare
from tests.codecs.lossy import amc, bytes_of, encode_file

pytestmark = pytest.mark.real

SIZES = {"10_03": 288_143, "05_01": 479_866, "17_10": 2_214_137}  # of the .amc with its line ends
TABLE_4_OF_2014 = [  # codec, clip, setting, MSE, the most by which ours is off, CR, times theirs
    ("pca", "10_03", {"q": 22}, 0.258, 0.001, 7.919, 3.0),
    ("pca", "05_01", {"q": 13}, 1.042, 0.001, 14.37, 3.0),
    ("dwt", "10_03", {"t_w": 3}, 0.266, 0.001, 24.88, 2.3),
    ("dwt", "05_01", {"t_w": 15}, 1.085, 0.001, 47.84, 2.3),
    ("awt", "10_03", {"a_w": 53, "iterations": 0}, 0.259, 0.013, 18.46, 0),
    ("awt", "05_01", {"a_w": 41, "iterations": 0}, 1.046, 0.053, 41.71, 0),
    ("qbc", "10_03", {"d2_lmt": 5}, 0.2552, 5e-4, 26.60, 2.3),
    ("qbc", "05_01", {"d2_lmt": 24}, 1.0875, 5e-4, 67.07, 2.3),
    ("qbc", "10_03", {"d2_lmt": 5, "middle": "least-squares"}, 0.2497, 5e-4, 26.60, 0),
    ("qbc", "05_01", {"d2_lmt": 24, "middle": "least-squares"}, 1.029, 5e-4, 67.07, 0),
]


def error_of(motion: mcz.Motion, stored: bytes) -> float:
    with mcz.open(stored) as file:
        return compare(motion, file.only_clip().motion(), virtual_markers=False).mse


@pytest.mark.parametrize(
    ("codec", "name", "params", "mse", "within", "ratio", "times"), TABLE_4_OF_2014
)
def test_table_4_of_khan2014(
    data: Path, codec: str, name: str, params: dict, mse: float, within: float, ratio: float,
    times: float,
) -> None:  # fmt: skip
    motion = amc(data, name)
    stored = encode_file(codec, motion, preset="khan2014", **params)
    assert error_of(motion, stored) == pytest.approx(mse, abs=within)
    assert SIZES[name] / bytes_of(stored) >= times * ratio


@pytest.mark.parametrize(
    ("name", "a_w", "mse", "ratio"), [("10_03", 53, 0.259, 18.46), ("05_01", 41, 1.046, 41.71)]
)
def test_annealing_halves_the_error(
    data: Path, name: str, a_w: int, mse: float, ratio: float
) -> None:
    motion = amc(data, name)
    stored = encode_file("awt", motion, preset="khan2014", a_w=a_w)
    assert error_of(motion, stored) < 0.5 * mse
    assert SIZES[name] / bytes_of(stored) >= 2.3 * ratio


def test_errors_of_dwt_along_its_threshold(data: Path) -> None:
    motion = amc(data, "10_03")
    published = (0.265, 0.595, 0.966, 1.278, 1.68, 1.974, 2.283, 2.588, 2.76)
    for t_w, mse in zip(range(3, 28, 3), published, strict=True):
        stored = encode_file("dwt", motion, preset="khan2014", t_w=t_w)
        assert error_of(motion, stored) == pytest.approx(mse, abs=0.002), t_w


PUBLISHED = {  # T_g: rms_coordinate_error of the published implementation, CR of the paper
    10: (0.1948, 61.6),
    11: (0.1992, 63.3),
    12: (0.2041, 64.5),
    15: (0.2086, 67.7),
    20: (0.2216, 71.0),
    30: (0.2338, 74.6),
    45: (0.2424, 76.5),
    50: (0.2567, 76.9),
}


def test_table_4_of_khan2016(data: Path) -> None:
    motion = amc(data, "17_10")
    for T_g, (error, ratio) in PUBLISHED.items():
        stored = encode_file("mrdwt", motion, preset="khan2016", T_g=T_g)
        with mcz.open(stored) as file:
            decoded = compare(motion, file.only_clip().motion(), virtual_markers=False)
        assert decoded.rms_coordinate_error == pytest.approx(error, abs=0.0005), T_g
        assert SIZES["17_10"] / bytes_of(stored) >= (2.1 if T_g <= 30 else 2.0) * ratio, T_g


def test_figure_8_of_khan2016(data: Path) -> None:
    motion = amc(data, "09_01")
    column = motion.skeleton.columns(motion.skeleton.find("rfoot"))[0]
    meant = unwrap(motion.values, motion.skeleton)[:, column]
    stored = encode_file("mrdwt", motion, preset="khan2016", threshold_rule="flat", T_g=1)
    with mcz.open(stored) as file:
        for resolution, mse in ((0, 0.103), (2, 0.658), (3, 4.699)):
            decoded = file.only_clip().read(resolution=resolution)[:, column]
            assert np.mean((decoded - meant) ** 2) == pytest.approx(mse, abs=0.01)


def test_defaults_of_mrdwt_need_fewer_bytes_than_the_preset(data: Path) -> None:
    motion = amc(data, "05_01")
    published = encode_file("mrdwt", motion, preset="khan2016")
    with mcz.open(published) as file:
        limit = float(file.only_clip().quality["mean_position_error_cm"])
    own = encode_file("mrdwt", motion, mean_error_cm=limit)
    with mcz.open(own) as file:
        assert float(file.only_clip().quality["mean_position_error_cm"]) <= limit
    assert bytes_of(own) < 0.75 * bytes_of(published)
