"""Limits on what a text may request while it is parsed.

The numbers of joints and channels are those of the profile of large limits, so that no file is
refused here that could be stored. The depth is that of a chain of all joints of the base profile.
"""

from __future__ import annotations

from mcz.errors import SourceError

MOST_JOINTS = 2**18
MOST_CHANNELS = 2**20
MOST_DEPTH = 4096


def check(what: str, number: int, most: int) -> None:
    """Raise SourceError where a skeleton has more than it may have of ``what``."""
    if number > most:
        raise SourceError(f"more than {most:,} {what}; no skeleton is stored with as many")
