"""Vectors of each rule of SPEC.md: rules have ids, rows of the manifest name them.

    python tools/requirements.py [--json] [--section WORD] [--uncovered]

Ends with 1 where a rule with MUST or MUST NOT has neither a vector nor an argument why no vector
can show it (``ARGUED`` of tools/vectors/requirements.py), or where one is named that there is not.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))  # so that this file can be run as a script

from tools.vectors.requirements import ARGUED  # noqa: E402 - needs the path

ID = re.compile(r"(?<!`)\[([A-Z][A-Z0-9]+)-(\d\d)\]")
KEYWORD = re.compile(r"\b(MUST|SHOULD)(\s+NOT)?\b")
MARK = re.compile(f"{ID.pattern}|{KEYWORD.pattern}")
SENTENCE_END = re.compile(r"(?<=[.:])\s+(?=[A-Z`*])|\s*\n\s*\n|\n(?=\s*- |\|)")
BINDING = ("MUST", "MUST NOT")


@dataclass(frozen=True)
class Rule:
    """One rule: its id, MUST ... SHOULD NOT, the heading it stands under, and its own words."""

    id: str
    level: str
    heading: str
    words: str

    @property
    def section(self) -> str:
        return self.id.partition("-")[0]

    @property
    def binds(self) -> bool:
        return self.level in BINDING


def sections(text: str) -> Iterator[tuple[str, str]]:
    """(heading, text under it) of all but the head of the document, which explains the words."""
    parts = re.split(r"^#{2,} (.+)\n", text, flags=re.MULTILINE)
    yield from zip(parts[1::2], parts[2::2], strict=True)


def sentences(body: str) -> Iterator[tuple[str, bool]]:
    """(text, whether it is pseudo-code) of each sentence, bullet and row, or line of code."""
    for number, part in enumerate(body.split("```")):
        code = number % 2 == 1
        for text in part.splitlines() if code else SENTENCE_END.split(part):
            yield text, code


def rules(text: str) -> list[Rule]:
    """All rules of SPEC.md in order.

    The level is that of the last keyword before the id, and MUST in pseudo-code.
    """
    found = []
    for heading, body in sections(text):
        level = "MUST"
        for sentence, code in sentences(body):
            begin = 0  # of the words of the next id
            for mark in MARK.finditer(sentence):
                section, number, word, negation = mark.groups()
                if word:
                    level = f"{word} NOT" if negation else word
                    continue
                words = _words(sentence, begin, mark)
                id_ = f"{section}-{number}"
                found.append(Rule(id_, "MUST" if code else level, heading, words))
                begin = mark.end()
    return found


def _words(sentence: str, begin: int, mark: re.Match[str]) -> str:
    """Sentence of an id: up to it from the previous id, or up to the end after the last."""
    last = not ID.search(sentence, mark.end())
    words = " ".join(ID.sub("", sentence[begin : None if last else mark.start()]).split())
    words = re.sub(r" ([.,:;])", r"\1", words).strip(" |-#,;")
    return f"... {words}" if begin else words


def faults(text: str) -> list[str]:
    """Faults of the ids in SPEC.md, in words."""
    found = []
    ids = [rule.id for rule in rules(text)]
    found += [f"{name} stands twice" for name, count in Counter(ids).items() if count > 1]
    for section in dict.fromkeys(name.partition("-")[0] for name in ids):
        if f"{section}-01" not in ids:
            found.append(f"{section}: no first id")
    for heading, _ in sections(text):  # a primitive that codecs share keeps the ids that it had
        here = [rule.id for rule in rules(text) if rule.heading == heading]
        for section in dict.fromkeys(name.partition("-")[0] for name in here):
            numbers = [int(name[-2:]) for name in here if name.startswith(f"{section}-")]
            if numbers != sorted(numbers):
                found.append(f"{heading}: {section} has ids in the order {numbers}")
    for heading, body in sections(text):
        marks = [*MARK.finditer(body), None]
        for mark, following in zip(marks, marks[1:], strict=False):
            if mark and mark[3] and (following is None or following[3]):
                line = body[: mark.start()].count("\n") + 1
                found.append(f"{heading}, line {line}: {mark[0]} without an id")
        for odd in re.findall(r"\[[A-Za-z0-9]{2,}-\d+\]", ID.sub("", body)):
            found.append(f"{heading}: {odd} is no id")
    return found


def vectors_of(manifest: Mapping[str, Any]) -> dict[str, list[str]]:
    """The files that the manifest names for each id."""
    named: dict[str, list[str]] = {}
    for row in manifest["vectors"]:
        for name in row.get("requirements", ()):
            named.setdefault(name, []).append(row["file"])
    return named


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="one JSON document")
    parser.add_argument("--section", metavar="WORD", help="of one section, such as CHUNK")
    parser.add_argument("--uncovered", action="store_true", help="those without vectors alone")
    options = parser.parse_args(arguments)

    known = rules((ROOT / "SPEC.md").read_text("utf-8"))
    named = vectors_of(json.loads((ROOT / "conformance/manifest.json").read_text("utf-8")))
    unknown = sorted({*named, *ARGUED} - {rule.id for rule in known})
    lacking = [r.id for r in known if r.binds and r.id not in named and r.id not in ARGUED]
    shown = [rule for rule in known if options.section in (None, rule.section)]
    if options.uncovered:
        shown = [rule for rule in shown if rule.id not in named]
    print(as_json(shown, named) if options.json else as_text(shown, named))
    binding = [rule.id for rule in known if rule.binds]
    print(
        f"{len(known)} rules, {len(binding)} of them MUST or MUST NOT: "
        f"{sum(name in named for name in binding)} with vectors, "
        f"{sum(name in ARGUED and name not in named for name in binding)} argued, "
        f"{len(lacking)} with neither",
        file=sys.stderr,
    )
    for name in unknown:
        print(f"{name}: no such rule", file=sys.stderr)
    return int(bool(lacking or unknown))


def as_json(shown: Sequence[Rule], named: Mapping[str, list[str]]) -> str:
    """A list of objects, one a rule."""
    return json.dumps(
        [
            {
                "id": rule.id,
                "level": rule.level,
                "heading": rule.heading,
                "words": rule.words,
                "vectors": named.get(rule.id, []),
                "argued": ARGUED.get(rule.id),
            }
            for rule in shown
        ],
        indent=1,
    )


def as_text(shown: Sequence[Rule], named: Mapping[str, list[str]]) -> str:
    """A line or more a rule: id, level, number of vectors and the first of these."""
    lines = []
    for rule in shown:
        files = named.get(rule.id, [])
        what = f"{len(files)} vectors: {', '.join(files[:3])}" if files else "no vector"
        if not files and rule.id in ARGUED:
            what = f"argued: {ARGUED[rule.id]}"
        lines += [f"{rule.id} {rule.level} ({rule.heading}): {what}", f"    {rule.words}"]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
