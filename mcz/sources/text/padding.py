"""Columns that are padded with blanks to a width, as printf's ``%10.4f``, ``%-10.4f``, ``% f`` do.

SPEC.md, "Source reconstruction", defines the widths: 0 none, 1 a blank where the sign is missing,
w > 1 right justified, w < -1 left justified.
"""

from __future__ import annotations

from collections.abc import Sequence

from mcz.sources.text.layout import MAX_WIDTH

_SIGNS = (b"-", b"+")


def padding(token: bytes, width: int) -> int:
    """Blanks beside ``token`` in a column of this width."""
    if width == 1:
        return int(token[:1] not in _SIGNS)
    return max(0, abs(width) - len(token))


def find_widths(
    data: bytes, samples: Sequence[tuple[int, list[tuple[int, int, int]], int]]
) -> dict[int, int]:
    """The width of each column that seems to be padded, from sample frames (start, tokens, end).

    Only samples with the same columns as the first are looked at.
    """
    columns = [column for _, _, column in samples[0][1]]
    chosen = [s for s in samples if [column for _, _, column in s[1]] == columns]
    widths: dict[int, int] = {}
    for k, column in enumerate(columns):
        tokens = [data[t[k][0] : t[k][1]] for _, t, _ in chosen]
        before = [data[(t[k - 1][1] if k else at) : t[k][0]] for at, t, _ in chosen]
        after = [data[t[k][1] : (t[k + 1][0] if k + 1 < len(t) else end)] for at, t, end in chosen]
        if columns[k - 1 : k] and widths.get(columns[k - 1], 0) < 0:
            before = [b""]  # its blanks belong to the column before
        width = _width(tokens, [len(gap) - len(gap.rstrip(b" ")) for gap in before])
        if not width:
            width = -_width(tokens, [len(gap) - len(gap.lstrip(b" ")) for gap in after])
            width = 0 if width == -1 else width
        if width:
            widths[column] = width
    return widths


def _width(tokens: Sequence[bytes], blanks: Sequence[int]) -> int:
    """The width that explains these numbers of blanks beside the tokens; 0: none does."""
    if len(set(blanks)) < 2:
        return 0
    for fixed in sorted({0, min(blanks)}):
        width = max(n - fixed + len(token) for token, n in zip(tokens, blanks, strict=True))
        for guess in (width, 1):
            pads = [padding(token, guess) for token in tokens]
            if guess <= MAX_WIDTH and all(
                n - fixed == p for n, p in zip(blanks, pads, strict=True)
            ):
                return guess
    return 0
