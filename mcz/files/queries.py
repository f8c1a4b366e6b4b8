"""Queries that select clips, a line of text: ``subject == '05' and n_frames > 500``.

docs/reference/queries.md is normative: grammar, and comparisons of values. Nothing here depends on
clips or files; callers pass a function that looks a name up.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass

from mcz.errors import OptionError
from mcz.files.query_tree import (
    COMPARISONS,
    LONGEST_NUMBER,
    NUMBER,
    And,
    Compare,
    In,
    Like,
    Literal,
    Lookup,
    Missing,
    Name,
    Node,
    Not,
    Operand,
    Or,
    Value,
    as_number,
    is_equality,
    names_in,
    print_query,
    truth_of,
)
from mcz.model.text_format import nearest_names, quote_name, suggest_names

__all__ = ["Lookup", "Query", "Value"]


class Query:
    """A query such as ``subject == '05' and n_frames > 500``; see docs/reference/queries.md.

    Raises OptionError, which shows the column, for a malformed text.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.tree = parse(text)
        self._test = truth_of(self.tree)

    def __reduce__(self) -> tuple[type[Query], tuple[str]]:
        return Query, (self.text,)

    def __repr__(self) -> str:
        return f"<Query {quote_name(self.text)}>"

    def __str__(self) -> str:
        """The query as text, with as few blanks and parentheses as possible."""
        return print_query(self.tree)

    @property
    def names(self) -> tuple[str, ...]:
        """The names in the query, each once, in order."""
        return tuple(dict.fromkeys(names_in(self.tree)))

    def matches(self, lookup: Lookup) -> bool:
        """Return True if the query is true (not false or unknown) for the values of ``lookup``.

        ``lookup(name)`` returns a text, a number, a truth, or None for a missing value; a name is
        looked up only when its part of the query is reached.
        """
        return self._test(lookup) is True

    def unknown(self, name: str, known: Collection[str]) -> OptionError:
        """The error for an unknown ``name``, one of ``names``."""
        at = next(t.at for t in tokens(self.text) if (t.kind, t.raw) == ("name", name))
        near = nearest_names(name, known)
        hint = (
            f"did you mean {near}?" if near else f"known are {suggest_names(sorted(known), None)}"
        )
        return fault(
            self.text, at, f"{quote_name(name)} is neither a field nor a metadata key; {hint}"
        )


DEEPEST = 64  # nested parentheses and ``not``
CLOSING = {"(": ")", "[": "]"}


def parse(text: str) -> Node:
    """The tree of a query; raises OptionError, which shows the column."""
    return _Parser(text).query()


class _Parser:
    def __init__(self, text: str) -> None:
        self.text, self.tokens = text, list(tokens(text))
        self.at = self.depth = 0

    @property
    def token(self) -> Token:
        return self.tokens[self.at]

    def next(self) -> Token:
        """Return the token and advance; the end stays the end."""
        token = self.token
        self.at += token.kind != "end"
        return token

    def skip(self, raw: str) -> bool:
        """Advance past the word or sign ``raw`` if it is the next."""
        is_next = self.token.kind in ("word", "sign") and self.token.raw == raw
        self.at += is_next
        return is_next

    def expected_error(self, noun: str) -> OptionError:
        """The error for another token here."""
        word = self.token.raw.lower()
        hint = f"; write {word}" if self.token.kind == "name" and word in WORDS else ""
        return fault(self.text, self.token.at, f"expected {noun}, not {self.token}{hint}")

    def query(self) -> Node:
        if self.token.kind == "end":
            raise OptionError("where: the query is empty")
        node = self.disjunction()
        if self.token.kind != "end":
            raise self.expected_error("'and', 'or' or the end")
        return node

    def disjunction(self) -> Node:
        return self.operation("or", Or, self.conjunction)

    def conjunction(self) -> Node:
        return self.operation("and", And, self.part)

    def operation(self, word: str, kind: type[And | Or], part: Callable[[], Node]) -> Node:
        parts = [part()]
        while self.skip(word):
            parts.append(part())
        return parts[0] if len(parts) == 1 else kind(tuple(parts))

    def part(self) -> Node:
        if self.token.raw not in ("not", "("):
            return self.comparison()
        if self.depth == DEEPEST:
            raise fault(self.text, self.token.at, f"more than {DEEPEST} levels of ( and not")
        self.depth += 1
        node = Not(self.part()) if self.skip("not") else self.group()
        self.depth -= 1
        return node

    def group(self) -> Node:
        self.skip("(")
        node = self.disjunction()
        if not self.skip(")"):
            raise self.expected_error("'and', 'or' or )")
        return node

    def comparison(self) -> Node:
        left = self.operand()
        if self.token.raw in COMPARISONS:
            return self.parse_comparison(left)
        if self.token.raw == "is":
            return self.parse_missing(left)
        denied = self.skip("not")
        if self.skip("in"):
            node: Node = In(left, self.list())
        elif self.skip("like"):
            node = Like(left, self.pattern())
        else:
            raise self.expected_error("in or like" if denied else _what_follows(left))
        return Not(node) if denied else node

    def parse_comparison(self, left: Operand) -> Node:
        sign = self.next()
        right = self.operand()
        if not is_equality(sign.raw) and (_is_truth(left) or _is_truth(right)):
            raise fault(self.text, sign.at, f"true and false have no order {sign}")
        if self.token.raw in COMPARISONS:
            problem = f"a comparison has two sides: write {self.chain(sign)}"
            raise fault(self.text, self.token.at, problem)
        return Compare(left, sign.raw, right)

    def chain(self, sign: Token) -> str:
        """Suggest another form of a < b < c, after a < b was parsed."""
        left, right = (self.tokens[self.at - back].raw for back in (3, 1))
        last = self.tokens[self.at + 1].raw or "..."
        return f"{left} {sign.raw} {right} and {right} {self.token.raw} {last}"

    def parse_missing(self, left: Operand) -> Node:
        word = self.next()
        if not isinstance(left, Name):
            raise fault(self.text, word.at, "only a name can be missing")
        present = self.skip("not")
        if not self.skip("missing"):
            raise self.expected_error("missing" if present else "missing or not missing")
        return Not(Missing(left)) if present else Missing(left)

    def operand(self) -> Operand:
        if self.token.kind == "name":
            return Name(self.next().raw)
        return self.literal("a name, a number or a text in quotes")

    def literal(self, label: str) -> Literal:
        if self.token.kind in ("text", "number"):
            return Literal(self.next().value)
        if self.token.raw in ("true", "false"):
            return Literal(self.next().raw == "true")
        raise self.expected_error(label)

    def list(self) -> tuple[Literal, ...]:
        closing = CLOSING.get(self.token.raw)
        if closing is None:
            raise self.expected_error("a list such as ('05', '06')")
        self.next()
        literals = [self.literal("a number or a text in quotes")]
        while self.skip(","):
            literals.append(self.literal("a number or a text in quotes"))
        if not self.skip(closing):
            raise self.expected_error(f", or {closing}")
        return tuple(literals)

    def pattern(self) -> str:
        if self.token.kind != "text":
            raise self.expected_error("a pattern in quotes, such as '05_*'")
        return str(self.next().value)


def _is_truth(operand: Operand) -> bool:
    return isinstance(operand, Literal) and isinstance(operand.value, bool)


def _what_follows(left: Operand) -> str:
    return (
        f"a comparison such as {print_query(left)} == {'true' if isinstance(left, Name) else '...'}"
    )


LONGEST = 4096  # characters of a query
CONTEXT = 24  # characters that an error shows on each side
WORDS = frozenset("and or not in like is missing true false".split())
# Signs of other languages, and their equivalents here.
FOREIGN = {"=": "==", "<>": "!=", "=>": ">=", "=<": "<=", "&&": "and", "||": "or", "!": "not"}

_TOKEN = re.compile(
    rf"""(?P<blank>\s+)
    | (?P<text>'(?:[^'\\]|\\.)*' | "(?:[^"\\]|\\.)*")
    | (?P<number>{NUMBER})
    | (?P<name>[^\W\d]\w*(?:[.-]+\w+)*)
    | (?P<sign>==|!=|<=(?!>)|>=|<(?!>)|>|[()\[\],])
    | (?P<foreign>&&|\|\||<>|=>|=<|=|!)""",
    re.VERBOSE | re.DOTALL,
)
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Token:
    """``kind`` is "name", "word", "text", "number", "sign" or "end"; ``at`` counts from 0.

    ``raw`` is the text, ``value`` its value.
    """

    kind: str
    at: int
    raw: str
    value: str | int | float = ""

    def __str__(self) -> str:
        """The name of the token in errors."""
        return "the end" if self.kind == "end" else quote_name(self.raw)


def fault(text: str, at: int, problem: str) -> OptionError:
    """The error ``problem`` at an offset of a query; it shows the column and the text around it."""
    before, after = text[max(at - CONTEXT, 0) : at], text[at : at + CONTEXT]
    left = "..." if at > CONTEXT else ""
    right = "..." if at + CONTEXT < len(text) else ""
    place = f"{left}{before}".strip() + " --> " + f"{after}{right}"
    return OptionError(f"where: column {at + 1}: {problem} ({place.strip()})")


def tokens(text: str) -> Iterator[Token]:
    """The tokens of ``text``, the last one of kind "end"; raises OptionError."""
    if not isinstance(text, str):
        raise OptionError(f"where: {quote_name(repr(text))} is not a string")
    if len(text) > LONGEST:
        raise OptionError(f"where: {len(text)} characters exceed the limit of {LONGEST}")
    at = 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise fault(text, at, _unknown_letter(text[at]))
        kind, raw = str(match.lastgroup), match[0]
        if kind != "blank":
            yield _token(kind, at, raw, text)
        at = match.end()
    yield Token("end", at, "")


def _unknown_letter(letter: str) -> str:
    if letter in "'\"":
        return f"the text that begins with {letter} has no end"
    return f"{quote_name(letter)} means nothing here"


def _token(kind: str, at: int, raw: str, text: str) -> Token:
    match kind:
        case "text":
            return Token(kind, at, raw, _unescape(at, raw, text))
        case "number":
            number = as_number(raw)
            if number is None:
                limit = f"it has at most {LONGEST_NUMBER} characters and is finite"
                raise fault(text, at, f"{quote_name(raw)} is too great a number: {limit}")
            return Token(kind, at, raw, number)
        case "foreign":
            raise fault(text, at, f"{quote_name(raw)} means nothing here, write {FOREIGN[raw]}")
        case "name" if raw in WORDS:
            return Token("word", at, raw, raw)
        case _:
            return Token(kind, at, raw, raw)


def _unescape(at: int, raw: str, text: str) -> str:
    r"""Unescape a quoted text: \' \" and \\ are the only escapes."""
    for match in _ESCAPE.finditer(raw):
        if match[1] not in "'\"\\":
            problem = rf"{quote_name(match[0])} is not an escape; the escapes are \' \" \\"
            raise fault(text, at + match.start(), problem)
    return _ESCAPE.sub(r"\1", raw[1:-1])
