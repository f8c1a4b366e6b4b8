"""The quality record of a clip after a cut: docs/parts.md, "Keys of cuts"."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from mcz.editing.cutting import ClipCut
from mcz.types import Values


def cut_quality(cut: ClipCut, old: Mapping[str, str]) -> dict[str, str]:
    """The entries of the quality record of a cut clip; ``old`` are those of the clip it came from.

    All are as they are stored: a cut leaves each joint its index.

    Where these say of a former cut what cannot be, it is taken for none.
    """
    now = _keys(cut, old)
    for key, value in old.items():
        if key.startswith(("param.", "uncut_")) or key in ("codec", "edit-joints"):
            now[key] = value
        elif not key.startswith("cut-"):
            now[f"uncut_{key}"] = value
    return now


def recoded_quality(
    cut: ClipCut, old: Mapping[str, str], now: dict[str, str], _: Sequence[Values]
) -> dict[str, str]:
    """The entries for a clip that was cut and coded anew; ``now`` are those of this coding."""
    before = {k: v for k, v in cut_quality(cut, old).items() if not k.startswith("param.")}
    return before | {"cut-recoded": "yes"} | now


def _keys(cut: ClipCut, old: Mapping[str, str]) -> dict[str, str]:
    """What a quality record says of a cut, of which ``old`` tells of earlier ones."""
    now = {key: value for key, value in old.items() if key.startswith("cut-")}
    if cut.resolution:
        before = _first_number(old.get("cut-resolution", ""), 1)
        now["cut-resolution"] = str(before + cut.resolution)
    if not cut.has_all_frames:
        start = _first_number(old.get("cut-frames", ""), 2)
        now["cut-frames"] = f"{start + cut.start}:{start + cut.stop}"
    if cut.joints is not None:
        now["cut-joints"] = ",".join(map(str, sorted(cut.joints)))
    return now


def _first_number(text: str, count: int) -> int:
    """The first of ``count`` numbers with colons between them, 0 where the text is another."""
    words = text.split(":")
    good = len(words) == count and all(re.fullmatch("[0-9]{1,16}", word) for word in words)
    return int(words[0]) if good else 0
