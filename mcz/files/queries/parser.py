"""The parser: text to tree, by recursive descent, a method a rule of docs/reference/queries.md."""

from __future__ import annotations

from collections.abc import Callable

from mcz.errors import OptionError
from mcz.files.queries.tokens import WORDS, Token, fault, tokens
from mcz.files.queries.tree import (
    And,
    Compare,
    In,
    Like,
    Literal,
    Missing,
    Name,
    Node,
    Not,
    Operand,
    Or,
    printed,
)
from mcz.files.queries.values import COMPARISONS, is_equality

DEEPEST = 64  # parentheses and ``not`` inside each other
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
        """The token, and go on; the end stays the end."""
        token = self.token
        self.at += token.kind != "end"
        return token

    def skip(self, raw: str) -> bool:
        """Go on behind the word or sign ``raw`` if it is the next."""
        found = self.token.kind in ("word", "sign") and self.token.raw == raw
        self.at += found
        return found

    def expected(self, what: str) -> OptionError:
        """The error that something else stands here."""
        word = self.token.raw.lower()
        hint = f"; write {word}" if self.token.kind == "name" and word in WORDS else ""
        return fault(self.text, self.token.at, f"expected {what}, not {self.token}{hint}")

    def query(self) -> Node:
        if self.token.kind == "end":
            raise OptionError("where: the text is empty")
        found = self.disjunction()
        if self.token.kind != "end":
            raise self.expected("'and', 'or' or the end")
        return found

    def disjunction(self) -> Node:
        parts = self.parts("or", self.conjunction)
        return parts[0] if len(parts) == 1 else Or(parts)

    def conjunction(self) -> Node:
        parts = self.parts("and", self.part)
        return parts[0] if len(parts) == 1 else And(parts)

    def parts(self, word: str, part: Callable[[], Node]) -> tuple[Node, ...]:
        found = [part()]
        while self.skip(word):
            found.append(part())
        return tuple(found)

    def part(self) -> Node:
        if self.token.raw not in ("not", "("):
            return self.comparison()
        if self.depth == DEEPEST:
            raise fault(self.text, self.token.at, f"more than {DEEPEST} levels of ( and not")
        self.depth += 1
        found = Not(self.part()) if self.skip("not") else self.group()
        self.depth -= 1
        return found

    def group(self) -> Node:
        self.skip("(")
        found = self.disjunction()
        if not self.skip(")"):
            raise self.expected("'and', 'or' or )")
        return found

    def comparison(self) -> Node:
        left = self.operand()
        if self.token.raw in COMPARISONS:
            return self.compared(left)
        if self.token.raw == "is":
            return self.missing(left)
        denied = self.skip("not")
        if self.skip("in"):
            found: Node = In(left, self.list())
        elif self.skip("like"):
            found = Like(left, self.pattern())
        else:
            raise self.expected("in or like" if denied else _what_follows(left))
        return Not(found) if denied else found

    def compared(self, left: Operand) -> Node:
        sign = self.next()
        right = self.operand()
        if not is_equality(sign.raw) and (_is_truth(left) or _is_truth(right)):
            raise fault(self.text, sign.at, f"true and false have no order {sign}")
        if self.token.raw in COMPARISONS:
            what = f"a comparison has two sides: write {self.chain(sign)}"
            raise fault(self.text, self.token.at, what)
        return Compare(left, sign.raw, right)

    def chain(self, sign: Token) -> str:
        """Suggest how to write a < b < c, of which a < b is already parsed."""
        left, right = (self.tokens[self.at - back].raw for back in (3, 1))
        last = self.tokens[self.at + 1].raw or "..."
        return f"{left} {sign.raw} {right} and {right} {self.token.raw} {last}"

    def missing(self, left: Operand) -> Node:
        word = self.next()
        if not isinstance(left, Name):
            raise fault(self.text, word.at, "only what has a name can be missing")
        present = self.skip("not")
        if not self.skip("missing"):
            raise self.expected("missing" if present else "missing or not missing")
        return Not(Missing(left)) if present else Missing(left)

    def operand(self) -> Operand:
        if self.token.kind == "name":
            return Name(self.next().raw)
        return self.literal("a name, a number or a text in quotes")

    def literal(self, what: str) -> Literal:
        if self.token.kind in ("text", "number"):
            return Literal(self.next().value)
        if self.token.raw in ("true", "false"):
            return Literal(self.next().raw == "true")
        raise self.expected(what)

    def list(self) -> tuple[Literal, ...]:
        closing = CLOSING.get(self.token.raw)
        if closing is None:
            raise self.expected("a list such as ('05', '06')")
        self.next()
        found = [self.literal("a number or a text in quotes")]
        while self.skip(","):
            found.append(self.literal("a number or a text in quotes"))
        if not self.skip(closing):
            raise self.expected(f", or {closing}")
        return tuple(found)

    def pattern(self) -> str:
        if self.token.kind != "text":
            raise self.expected("a pattern in quotes, such as '05_*'")
        return str(self.next().value)


def _is_truth(operand: Operand) -> bool:
    return isinstance(operand, Literal) and isinstance(operand.value, bool)


def _what_follows(left: Operand) -> str:
    """Words of an error about a value that stands alone."""
    return f"a comparison such as {printed(left)} == {'true' if isinstance(left, Name) else '...'}"
