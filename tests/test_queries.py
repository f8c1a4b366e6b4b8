"""The language of queries: what parses, what is refused and where, what is true of a clip."""

from __future__ import annotations

import pickle
import re
from fnmatch import fnmatchcase
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcz import OptionError
from mcz.files.queries import WORDS, Query, Value, parse
from mcz.files.query_tree import (
    And,
    Compare,
    In,
    Like,
    Literal,
    Missing,
    Name,
    Node,
    Not,
    Or,
    print_query,
)

CLIP: dict[str, Value] = {
    "name": "05_01",
    "n_frames": 598,
    "frame_rate": 29.97,
    "lossless": True,
    "subject": "05",
    "id": "12345678901234567890",
    "session": "day 1",
    "it": 'it\'s \\ "so"',
    "rights-holder": "CMU",
    "metadata.name": "walk",
    "source": None,
}


def ask(text: str) -> bool | None:
    """Answer of a query about CLIP, None for unknown."""
    taken, denied = (Query(each).matches(CLIP.__getitem__) for each in (text, f"not ({text})"))
    assert not (taken and denied)
    return taken if taken or denied else None


TABLE = [
    ("n_frames == 598", True),
    ("n_frames == 598.0", True),
    ("598 == n_frames", True),
    ("n_frames != 598", False),
    ("n_frames > 500", True),
    ("n_frames >= 598 and n_frames <= 598", True),
    ("n_frames < 5.98e2", False),
    ("n_frames > -1", True),
    ("frame_rate == 29.97", True),
    ("frame_rate < n_frames", True),
    # a text against a number: as a number where it reads as one
    ("subject == 5", True),
    ("subject == 05", True),
    ("subject < 6", True),
    ("subject == '5'", False),
    ("subject == '05'", True),
    ("id == 12345678901234567890", True),
    ("id == 12345678901234567891", False),
    ("session == 1", False),
    ("session != 1", True),
    ("session < 1", None),
    ("session >= 1", None),
    # texts: exact, in the order of their code points
    ("subject < '1'", True),
    ("name > '05'", True),
    ("name == '05_01'", True),
    ('name == "05_01"', True),
    ("session == 'Day 1'", False),
    (r"""it == 'it\'s \\ "so"'""", True),
    (r'''it == "it's \\ \"so\""''', True),
    ("'Z' < 'a' and 'a' < '\xe4'", True),
    # truths: only with each other, and without an order
    ("lossless == true", True),
    ("lossless != true", False),
    ("false == lossless", False),
    ("lossless == 1", None),
    ("lossless != 'true'", None),
    ("lossless < 1", None),
    # missing
    ("source is missing", True),
    ("source is not missing", False),
    ("subject is missing", False),
    ("source == 'a.bvh'", None),
    ("source != 'a.bvh'", None),
    ("source == source", None),
    ("source in ('a', 'b')", None),
    ("source like '*'", None),
    ("not source == 'a.bvh'", None),
    # three-valued logic
    ("source == 'a' and n_frames > 500", None),
    ("source == 'a' and n_frames < 500", False),
    ("source == 'a' or n_frames > 500", True),
    ("source == 'a' or n_frames < 500", None),
    # precedence: not, and, or
    ("n_frames > 500 or n_frames > 900 and n_frames > 900", True),
    ("(n_frames > 500 or n_frames > 900) and n_frames > 900", False),
    ("not n_frames > 900 and n_frames > 900", False),
    ("not (n_frames > 900 and n_frames > 900)", True),
    ("not not n_frames > 500", True),
    # lists and patterns
    ("subject in ('02', '05')", True),
    ("subject in [2, 5]", True),
    ("subject not in (2, '5')", True),
    ("lossless in (true)", True),
    ("lossless in (1, 2)", None),
    ("lossless in (1, true)", True),
    ("name like '05_*'", True),
    ("name like '0?_01'", True),
    ("name like '[!1-9]*'", True),
    ("name like '05'", False),
    ("session like 'DAY*'", False),
    ("session not like 'd*'", False),
    ("n_frames like '5*'", None),
    ("rights-holder == 'CMU'", True),
    ("metadata.name == 'walk'", True),
    ("\n\tn_frames==598and(name=='05_01')", True),
]


@pytest.mark.parametrize(("text", "answer"), TABLE)
def test_what_is_true(text: str, answer: bool | None) -> None:
    assert ask(text) is answer
    assert ask(str(Query(text))) is answer


REFUSED = [
    ("", "where: the query is empty"),
    (" \n", "where: the query is empty"),
    ("lossless", "column 9: expected a comparison such as lossless == true, not the end"),
    ("'a'", "column 4: expected a comparison such as 'a' == ..., not the end"),
    ("n_frames -5", "column 10: expected a comparison such as n_frames == true, not '-5'"),
    ("n_frames = 5", "column 10: '=' means nothing here, write == (n_frames --> = 5)"),
    ("n_frames <> 5", "'<>' means nothing here, write !="),
    ("a == 1 && b == 2", "'&&' means nothing here, write and"),
    ("a == 1 AND b == 2", "column 8: expected 'and', 'or' or the end, not 'AND'; write and"),
    ("100 < a <= b", "column 9: a comparison has two sides: write 100 < a and a <= b"),
    ("a == 1 == ", "write a == 1 and 1 == ... "),
    ("(a == 1", "column 8: expected 'and', 'or' or ), not the end"),
    ("a == 1)", "column 7: expected 'and', 'or' or the end, not ')'"),
    ("a in ()", "column 7: expected a number or a text in quotes, not ')'"),
    ("a in (b)", "column 7: expected a number or a text in quotes, not 'b'"),
    ("a in (1, 2]", "column 11: expected , or ), not ']'"),
    ("a in 5", "column 6: expected a list such as ('05', '06'), not '5'"),
    ("a like b", "column 8: expected a pattern in quotes"),
    ("a not 5", "column 7: expected in or like, not '5'"),
    ("a is 5", "column 6: expected missing or not missing, not '5'"),
    ("a is not not", "column 10: expected missing, not 'not'"),
    ("5 is missing", "column 3: only a name can be missing"),
    ("a < true", "column 3: true and false have no order '<'"),
    ("false >= a", "column 7: true and false have no order '>='"),
    ("a == 'b", "column 6: the text that begins with ' has no end"),
    (r"a == 'C:\new'", r"column 9: '\\n' is not an escape"),
    ("a == 1e999", "column 6: '1e999' is too great a number"),
    ("a == " + "1" * 101, "is too great a number"),
    ("a ~ 'b'", "column 3: '~' means nothing here"),
    ("a == 1 -- comment", "column 8: '-' means nothing here"),
    ("(" * 65 + "a == 1" + ")" * 65, "column 65: more than 64 levels"),
    ("not " * 2000 + "a", "OptionError: where: 8001 characters exceed the limit of 4096"),
    ("not " * 1000 + "a", "column 257: more than 64 levels of ( and not"),
]


@pytest.mark.parametrize(("text", "said"), REFUSED)
def test_what_is_refused(text: str, said: str) -> None:
    with pytest.raises(OptionError) as caught:
        Query(text)
    assert said in f"OptionError: {caught.value}"
    assert str(caught.value).startswith("where: ")
    assert len(str(caught.value)) < 300


def test_an_error_shows_where() -> None:
    text = "subject == '05' and n_frames => 500 or name like '*walk*'"
    with pytest.raises(OptionError) as caught:
        Query(text)
    assert str(caught.value) == (
        "where: column 30: '=>' means nothing here, write >= "
        "(...ct == '05' and n_frames --> => 500 or name like '*wa...)"
    )


def test_the_deepest_and_the_longest() -> None:
    assert Query("(" * 64 + "n_frames == 598" + ")" * 64).matches(CLIP.__getitem__)
    assert Query("not " * 64 + "n_frames == 598").matches(CLIP.__getitem__)
    many = " or ".join(["n_frames<1"] * 291 + ["n_frames>1"])
    assert 4000 < len(many) <= 4096
    assert Query(many).matches(CLIP.__getitem__)


def test_names_are_looked_up_as_they_are_reached() -> None:
    query = Query("n_frames > 500 or subject == 5 or n_frames == session")
    assert query.names == ("n_frames", "subject", "session")
    asked: list[str] = []

    def lookup(name: str) -> Value:
        asked.append(name)
        return CLIP[name]

    assert query.matches(lookup)
    assert asked == ["n_frames"]


def test_a_query_can_be_pickled() -> None:
    query = pickle.loads(pickle.dumps(Query("(n_frames > 500)")))
    assert (query.text, str(query)) == ("(n_frames > 500)", "n_frames > 500")
    assert repr(query) == "<Query '(n_frames > 500)'>"
    assert query.matches(CLIP.__getitem__)


def test_what_is_no_text() -> None:
    with pytest.raises(OptionError, match="where: '5' is not a string"):
        Query(5)  # type: ignore[arg-type]


# Values against a reference: what each text reads as, written down.
NUMBERS = {"05": 5, "5": 5, "5.0": 5, "-2.50": -2.5, "+.5e1": 5, "1e3": 1000, "7.": 7}
WORDY = ["", "x", "5 cm", " 5", "0x5", "nan", "inf", "1e999", "\u0665", "1_0", "true", "x\ny"]
texts = st.sampled_from([*NUMBERS, *WORDY]) | st.text(max_size=4)
numbers = (
    st.sampled_from([5, -2.5, 1000, 0, -0.0])
    | st.integers(-(10**99) + 1, 10**99)
    | st.floats(allow_nan=False, allow_infinity=False)
)
scalars = texts | numbers | st.booleans()
NAMES = ["a", "b-c", "metadata.name", "\xe4_1", "x.y-z", "nota"]
names = st.builds(Name, st.sampled_from(NAMES))
literals = st.builds(Literal, scalars)
operands = names | literals
equalities = st.builds(Compare, operands, st.sampled_from(["==", "!="]), operands)
ordered = st.builds(Literal, texts | numbers) | names
orders = st.builds(Compare, ordered, st.sampled_from(["<", "<=", ">", ">="]), ordered)
lists = st.builds(In, operands, st.lists(literals, min_size=1, max_size=4).map(tuple))
patterns = st.text("ab05[]!-?*^&|~\\'x", max_size=6)
likes = st.builds(Like, operands, patterns)
leaves = equalities | orders | lists | likes | st.builds(Missing, names)


def join_nodes(nodes: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    several = st.lists(nodes, min_size=2, max_size=3).map(tuple)
    return st.builds(Not, nodes) | st.builds(And, several) | st.builds(Or, several)


trees = st.recursive(leaves, join_nodes, max_leaves=8)


@given(trees)
def test_a_tree_is_printed_and_parsed_again(tree: Node) -> None:
    assert repr(parse(print_query(tree))) == repr(tree)  # of reprs, for 5 == 5.0 == True


tokenish = st.sampled_from(
    [*sorted(WORDS), *"()[],'\"\\=<>!-._ 5a\xe4", "==", "<=", "'05'", " n_frames ", "1e5", " == "]
)


@given(st.text(max_size=30) | st.lists(tokenish, max_size=12).map("".join))
def test_any_text_parses_or_is_refused(text: str) -> None:
    try:
        query = Query(text)
    except OptionError as error:
        assert re.match(r"where: (column \d+: |the query is empty)", str(error))
        return
    assert repr(Query(str(query)).tree) == repr(query.tree)


@given(trees, st.fixed_dictionaries({name: st.none() | scalars for name in NAMES}))
def test_evaluation_against_a_reference(tree: Node, clip: dict[str, Value]) -> None:
    assert Query(print_query(tree)).matches(clip.__getitem__) is (reference(tree, clip) == 1)


def reference(node: Any, clip: dict[str, Value]) -> float:
    """0 for false, 1 for true, 0.5 for unknown: ``and`` then is min, ``or`` max, ``not`` 1 - x."""
    match node:
        case And(parts):
            return min(reference(part, clip) for part in parts)
        case Or(parts):
            return max(reference(part, clip) for part in parts)
        case Not(part):
            return 1 - reference(part, clip)
        case Missing(Name(name)):
            return float(clip[name] is None)
        case Like(operand, pattern):
            value = value_of(operand, clip)
            return float(fnmatchcase(value, pattern)) if isinstance(value, str) else 0.5
        case In(operand, choices):
            return max(reference(Compare(operand, "==", each), clip) for each in choices)
        case Compare(left, sign, right):
            return compare_in_sql(value_of(left, clip), sign, value_of(right, clip))
    raise AssertionError(node)


def value_of(operand: Any, clip: dict[str, Value]) -> Value:
    return clip[operand.name] if isinstance(operand, Name) else operand.value


def compare_in_sql(a: Any, sign: str, b: Any) -> float:
    kinds = {"bool" if isinstance(x, bool) else type(x).__name__ for x in (a, b)}
    if "NoneType" in kinds:
        return 0.5
    if "bool" in kinds:
        return float((a == b) is (sign == "==")) if len(kinds) == 1 and sign in "==!=" else 0.5
    if isinstance(a, str) != isinstance(b, str):
        a, b = (read(x) if isinstance(x, str) else x for x in (a, b))
        if None in (a, b):
            return {"==": 0.0, "!=": 1.0}.get(sign, 0.5)
    less, same = a < b, a == b
    answers = {"<": less, ">": not (less or same), "==": same}
    answers |= {"<=": less or same, ">=": not less, "!=": not same}
    return float(answers[sign])


def read(text: str) -> Any:
    """The number that a short text reads as, None where it is none."""
    if text in NUMBERS:
        return NUMBERS[text]
    if text in WORDY or not text.isascii() or re.search(r"[^0-9.eE+-]", text):
        return None
    for kind in (int, float):  # of what is left, Python reads what we read
        try:
            return kind(text)
        except ValueError:
            continue
    return None
