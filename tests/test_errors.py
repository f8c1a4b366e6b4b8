"""Errors: their fields, their texts, and what the package does with them."""

from __future__ import annotations

import pickle
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcz.errors import PYTHON_HINTS, Fields, FormatError, Hint, MczError, SourceError, error_context


def classes(base: type[MczError] = MczError) -> Iterator[type[MczError]]:
    yield base
    for child in base.__subclasses__():
        if child.__module__ == MczError.__module__:
            yield from classes(child)


WORDS = st.none() | st.text()
NUMBERS = st.none() | st.integers()
FIELDS = st.fixed_dictionaries(
    {},
    optional={
        "path": WORDS,
        "clip": WORDS,
        "line": NUMBERS,
        "offset": NUMBERS,
        "where": WORDS,
        "value": st.none() | st.text() | st.integers() | st.floats(allow_nan=False),
        "hint": st.none() | st.sampled_from(Hint),
    },
)


@given(st.sampled_from([*classes()]), st.text(), FIELDS)
def test_each_class_keeps_its_fields_in_a_pickle(
    kind: type[MczError], message: str, fields: Fields
) -> None:
    error = kind(message, **fields)
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert again.message == message
    assert again.fields == error.fields == {k: v for k, v in fields.items() if v is not None}
    assert str(again) == str(error)


def test_text_is_made_of_the_fields() -> None:
    error = SourceError("'x' is not a number", line=12, value="x")
    assert str(error) == "line 12: 'x' is not a number"
    error.add(path="walk.bvh", clip="walk", line=13)
    assert str(error) == "walk.bvh: clip 'walk': line 12: 'x' is not a number"
    assert error.describe(with_path=False) == "clip 'walk': line 12: 'x' is not a number"
    assert str(SourceError("no header", offset=512)) == "offset 512: no header"
    assert str(MczError("its unit is unknown", hint=Hint.UNIT)).endswith(
        f"unknown; {PYTHON_HINTS[Hint.UNIT]}"
    )


def test_context_goes_in_front() -> None:
    with (
        pytest.raises(FormatError) as caught,
        error_context(path="a.mcz", where="chunk SKEL at 120"),
        error_context(path="inner.mcz", where="joints.3"),
    ):
        raise FormatError("a parent of 7", offset=120)
    assert str(caught.value) == "inner.mcz: chunk SKEL at 120: joints.3: a parent of 7"
    assert caught.value.fields == {
        "path": "inner.mcz",
        "offset": 120,
        "where": "chunk SKEL at 120: joints.3",
    }


def test_every_hint_has_words() -> None:
    assert set(PYTHON_HINTS) == set(Hint)
