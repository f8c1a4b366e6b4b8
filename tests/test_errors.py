"""Errors: their fields, their texts, and what the package does with them."""

from __future__ import annotations

import ast
import pickle
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.cli.common import OPTION_HINTS
from mcz.errors import Fields, FormatError, MczError, SourceError, error_context
from mcz.hints import PYTHON_HINTS, Hint, Remark, with_worded_hint


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


def test_every_hint_has_words_for_python_and_for_the_command_line() -> None:
    assert set(PYTHON_HINTS) == set(OPTION_HINTS) == set(Hint)
    assert not [words for words in PYTHON_HINTS.values() if "--" in words]


def test_a_remark_keeps_its_hint() -> None:
    remark = pickle.loads(pickle.dumps(Remark("it exists", Hint.FORCE)))
    assert remark == f"it exists; {PYTHON_HINTS[Hint.FORCE]}"
    assert with_worded_hint(remark, OPTION_HINTS) == f"it exists; {OPTION_HINTS[Hint.FORCE]}"
    assert with_worded_hint("it exists", OPTION_HINTS) == "it exists"


# What the package does with them --------------------------------------------------

PACKAGE = Path(mcz.__file__).parent
TREES = {
    path.relative_to(PACKAGE).as_posix(): ast.parse(path.read_text("utf-8"))
    for path in sorted(PACKAGE.rglob("*.py"))
}
FORMS = {"startswith", "endswith", "replace", "removeprefix", "removesuffix", "partition", "find"}


def rewrites(tree: ast.AST) -> Iterator[int]:
    """Lines that assign to the arguments of something that is caught."""
    for node in ast.walk(tree):
        targets = getattr(node, "targets", None) or [getattr(node, "target", None)]
        if isinstance(node, ast.Assign | ast.AugAssign | ast.AnnAssign):
            for target in targets:
                if isinstance(target, ast.Attribute) and target.attr == "args":
                    yield node.lineno


def texts_of_errors(tree: ast.AST) -> Iterator[ast.expr]:
    """``str(error)``, ``error.message`` and ``error.args`` of our errors that are caught."""
    for handler in ast.walk(tree):
        if isinstance(handler, ast.ExceptHandler) and handler.name and _is_ours(handler.type):
            for node in ast.walk(handler):
                match node:
                    case ast.Call(func=ast.Name(id="str"), args=[ast.Name(id=name)]):
                        pass
                    case ast.Attribute(value=ast.Name(id=name), attr="args" | "message"):
                        pass
                    case ast.Call(func=ast.Attribute(value=ast.Name(id=name), attr="describe")):
                        pass
                    case _:
                        continue
                if name == handler.name:
                    yield node


def _is_ours(caught: ast.expr | None) -> bool:
    names = (
        {node.id for node in ast.walk(caught) if isinstance(node, ast.Name)} if caught else set()
    )
    return bool(names & OURS)


OURS = {kind.__name__ for kind in classes()} | {"Failure", "AmbiguousError"}


def decisions(tree: ast.AST) -> Iterator[ast.AST]:
    """Expressions of decisions, and of calls that take texts apart."""
    for node in ast.walk(tree):
        match node:
            case ast.If(test=test) | ast.IfExp(test=test) | ast.While(test=test):
                yield test
            case ast.Compare() | ast.Assert() | ast.Subscript():
                yield node
            case ast.comprehension(ifs=ifs):
                yield from ifs
            case ast.Match(subject=subject):
                yield subject
            case ast.Call(func=ast.Attribute(value=value, attr=form)) if form in FORMS:
                yield value
            case ast.Call(func=ast.Attribute(value=ast.Name(id="re"))):
                yield node


def branches(tree: ast.AST) -> list[int]:
    texts = {id(node): node.lineno for node in texts_of_errors(tree)}
    within = (id(node) for test in (decisions(tree) if texts else ()) for node in ast.walk(test))
    return sorted({texts[each] for each in within if each in texts})


def test_nobody_rewrites_an_error() -> None:
    assert not {path: lines for path, tree in TREES.items() if (lines := [*rewrites(tree)])}


def test_nobody_takes_a_message_apart() -> None:
    assert not {path: lines for path, tree in TREES.items() if (lines := branches(tree))}


@pytest.mark.parametrize(
    "line",
    [
        "if 'x' in str(e): pass",
        "a = 1 if str(e).startswith('x') else 2",
        "a = str(e).replace('force', '--force')",
        "a = re.search('line', e.message)",
        "a = e.args[0]",
        "a = [b for b in c if b in e.describe()]",
    ],
)
def test_the_search_finds_what_it_is_for(line: str) -> None:
    tree = ast.parse(f"try:\n    f()\nexcept (OSError, FormatError) as e:\n    {line}")
    assert branches(tree) == [4]


def test_the_library_names_no_option_of_the_command_line() -> None:
    def options(tree: ast.AST) -> Iterator[str]:
        documents = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and id(node) not in documents:
                yield from re.findall(r"(?<![\w\-`])--[a-z][a-z-]+", str(node.value))

    library = {path: tree for path, tree in TREES.items() if not path.startswith("cli/")}
    found = {path: texts for path, tree in library.items() if (texts := [*options(tree)])}
    assert set(found) <= NO_LIBRARY, found


NO_LIBRARY = {
    "show/pictures/charts.py",  # variables of CSS
    "show/viewing/page.py",  # options of npm
}
