"""``python -m tests.broken NAME [ARGUMENTS]``: a decoder with one rule broken.

With ``--show [PREFIX ...]`` in place of a request: the vectors, of those whose names begin so, that
it fails, a line each.
"""

from __future__ import annotations

import sys

from tests.broken import answers, install
from tests.broken.table import BREAKS


def main(name: str, *arguments: str) -> int:
    install(BREAKS[name])
    if arguments[:1] == ("--show",):
        for vector in answers.by_name(arguments[1:] or [""]):
            found = answers.faults(vector)
            if found:
                print(f"{vector['file']}: {found[0][:120]}")
        return 0
    from mcz.cli import conformance

    return conformance.main(list(arguments))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
