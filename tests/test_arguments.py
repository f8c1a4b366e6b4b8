"""Public functions refuse arguments of a wrong type with an OptionError that names them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.errors import MczError, OptionError
from mcz.model.checks import USUAL_TYPES, check_arguments
from mcz.sources.sample import acclaim_walk as walk

WRONG = (None, 3.5, object(), [object()], b"\xff\x00", {"a": object()})
FUNCTIONS = [
    name
    for name in dir(mcz)
    if not name.startswith("_") and inspect.isfunction(inspect.unwrap(getattr(mcz, name)))
]


def required(function: Callable[..., Any]) -> Iterator[str]:
    for name, parameter in inspect.signature(function).parameters.items():
        variable = (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL)
        if parameter.default is parameter.empty and parameter.kind not in variable:
            yield name


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_required_argument_of_a_wrong_type(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    function = getattr(mcz, name)
    names = list(required(function))
    for value in WRONG:
        with pytest.raises(MczError):
            result = function(**dict.fromkeys(names, value))
            list(result)  # of a generator
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("function", [mcz.positions, mcz.rotations, mcz.times, mcz.contacts])
def test_the_message_names_argument_value_and_type(function: Callable[..., object]) -> None:
    with pytest.raises(OptionError, match=r"^\w+ is None; it must be a Motion"):
        function(None)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("frames", 7, "a pair of integers (a, b), or a slice"),
        ("frames", "all", "a pair of integers (a, b), or a slice"),
        ("joints", 2.5, "a joint or a list of joints, each a name or an index"),
        ("unit", 10, "a string"),
        ("dtype", "wide", "a type of numbers, such as float32"),
    ],
)
def test_an_optional_argument_of_a_wrong_type(name: str, value: object, words: str) -> None:
    options: dict[str, Any] = {name: value}
    with pytest.raises(OptionError) as caught:
        mcz.positions(walk(), **options)
    assert str(caught.value) == f"{name} is {value!r}; it must be {words}"


def test_numpy_scalars_and_arrays_are_numbers() -> None:
    motion = walk()
    first = mcz.positions(motion, np.int64(0), (np.int64(0), np.int64(2)), dtype=np.float32)
    assert first.shape == (2, 1, 3)
    with pytest.raises(OptionError, match="up is 'top'"):
        mcz.render(motion, "walk.png", up="top")


def test_a_single_foot_needs_no_list() -> None:
    motion = walk()
    joint = motion.skeleton.joint_names[-1]
    assert mcz.contacts(motion, joint).joints == (joint,)


def test_defaults_pass_and_missing_arguments_are_left_to_python() -> None:
    @check_arguments()
    def function(rate: float, unit: str | None = None, **params: object) -> object:
        return rate, unit, params

    assert function(3, unit=None, theme=4) == (3, None, {"theme": 4})
    with pytest.raises(TypeError, match="rate"):
        function()  # type: ignore[call-arg]
    with pytest.raises(OptionError, match="unit is 5"):
        function(3, 5)  # type: ignore[arg-type]
    assert "rate" not in USUAL_TYPES  # rates have checks of their own


def test_formats_rules_and_compared_motions(tmp_path: Path) -> None:
    motion = walk()
    with pytest.raises(OptionError, match="to is 'docx'; it must be one of csv, npz"):
        mcz.conversion_losses(motion, "docx")
    wrong: Any = "foot"
    with pytest.raises(OptionError, match="rule is 'foot'; it must be a ContactRule"):
        mcz.contacts(motion, rule=wrong)
    with pytest.raises(OptionError, match="other is 'foot'; it must be a Motion or a Clip"):
        mcz.plot(motion, tmp_path / "error.svg", other=wrong)
