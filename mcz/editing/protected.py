"""``protect``: recovery data for an MCZ file, for what has none, or for all of it anew.

``protecting.py`` makes them.
"""

from __future__ import annotations

import os

from mcz.editing.protecting import DEFAULT, Protection, add_recovery
from mcz.editing.rewriting import protected_anew
from mcz.recovery.making import Step
from mcz.recovery.shape import check_redundancy


def protect(
    target: str | os.PathLike[str],
    redundancy: float = DEFAULT,
    *,
    anew: bool = False,
    progress: Step | None = None,
) -> list[Protection]:
    """Append recovery data to an MCZ file, of ``redundancy`` times its bytes.

    ``mcz.repair`` restores every byte of it as long as no more blocks are bad than there are
    recovery blocks, wherever they lie: single bytes, a burst, the beginning, the end. Where the
    file has some already, what was appended since gets its own; where nothing was, nothing is
    done. ``anew``: what it has is left out, and all of the file gets recovery data together, for
    which it is rewritten. Returns what there is of it then, in the order of the file. Raises
    OptionError, FormatError where rewriting would lose a chunk that nobody here knows, AccessError
    where another process is appending, and as ``mcz.append`` for a file cut short.
    """
    check_redundancy(redundancy)
    if anew and (found := protected_anew(target, redundancy, progress)) is not None:
        return [found]
    return add_recovery(target, redundancy, progress)
