"""``python -m tests.broken RULE [ARGUMENTS]``: a decoder with that rule of SPEC.md broken.

RULE is an id, or an id and one of its variants, such as CHUNK-06:1.off.1. In place of a request:
``--list`` prints the variants, ``--show [PREFIX ...]`` the vectors, of those whose names begin so,
that it fails. ``python -m tests.broken --find [RULE ...]`` searches for variants that vectors of
the manifest notice, those that were found before first, and writes found.txt.
"""

from __future__ import annotations

import sys

from tests.broken import answers, find, install, variants


def main(what: str, *arguments: str) -> int:
    if what == "--find":
        return find.main(arguments)
    rule, _, name = what.partition(":")
    if arguments[:1] == ("--list",):
        print("\n".join(variants.names(rule)))
        return 0
    install.install(variants.codes(rule, name or find.read_catches()[rule][0].variant))
    if arguments[:1] == ("--show",):
        for vector, row in answers.vectors().items():
            if any(vector.startswith(prefix) for prefix in arguments[1:] or [""]):
                fault = answers.fault(row)
                if fault:
                    print(f"{vector}: {fault[:120]}")
        return 0
    from mcz.cli import conformance

    return conformance.main(list(arguments))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
