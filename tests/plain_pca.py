"""A plain decoder of codec 4, pca, written from SPEC.md alone and in its order.

Python integers and floats only, one value at a time: slow, small, and independent of the package.
Entropy coding and residuals are those of the plain decoder of mrdwt, `first` that of qbc.
"""

from __future__ import annotations

from collections.abc import Sequence

from tests.plain_qbc import first_of, in_range
from tests.plain_wavelets import Bytes, Coder, Model, Residuals, bits, refuse, side, starts_of

START_SHA256 = "3b90dbcf16577c556f48d58676920229fcc0b7d0d5bf0ff32f13ddb375f43282"
(START,) = starts_of("pca_start.json", START_SHA256)


def parse_header(data: bytes) -> int:
    fields = Bytes(data)
    decimals = fields.u8()
    if 15 < decimals < 255 or fields.rest():
        raise refuse(f"{decimals} decimals, or bytes after the header")
    return decimals


def scale_of(h: int) -> int:
    return (2 + h % 2) * 2 ** (h // 2) // 2


def table(model: Residuals, n_values: int, scale: int) -> list[int]:
    values = []
    fast = slow = 16 * scale
    near = side1 = side2 = 0
    for _ in range(n_values):
        model.near, model.side1, model.side2, model.other = near, side1, side2, 3
        v = in_range(model.residual(fast, slow))
        values.append(v)
        size = 16 * abs(v)
        near = (near + bits(size) - bits(slow)) >> 1
        fast += (size - fast) >> 2
        slow += (size - slow) >> 4
        side2, side1 = side1, side(v)
    return values


class Component:
    """What is remembered of the coefficients of one component."""

    def __init__(self, form: int, first: int) -> None:
        self.predictor = form // 64
        self.fast = self.slow = 16 * scale_of(form % 64)
        self.side1 = self.side2 = self.moved = 0
        self.y = [first]

    def predicted(self) -> int:
        y = self.y
        d = y[-1] - y[-2] if len(y) > 1 else 0
        e = y[-2] - y[-3] if len(y) > 2 else 0
        return y[-1] + (0, d >> 1, d, (3 * d - 2 * e) >> 2)[self.predictor]

    def following(self, model: Residuals, near: int) -> int:
        """Decode the next coefficient; what ``near`` then is."""
        model.near, model.other = near, self.moved
        model.side1, model.side2 = self.side1, self.side2
        p = self.predicted()
        r = model.residual(self.fast, self.slow)
        self.y.append(in_range(p + r))
        size = 16 * abs(r)
        near = (near + bits(size) - bits(self.slow)) >> 1
        self.fast += (size - self.fast) >> 1
        self.slow += (size - self.slow) >> 5
        self.side2, self.side1 = self.side1, side(r)
        if self.y[-1] != self.y[-2]:
            self.moved = side(self.y[-1] - self.y[-2])
        return near


def segment(decimals: int, data: bytes, c: int, n: int) -> list[list[float]]:
    """The rows of a segment of ``n`` frames and ``c`` channels."""
    if not data:
        return [[0.0] * c for _ in range(n)]
    fields = Bytes(data)
    s = fields.u8() if decimals == 255 else 0
    mean_scale, count = fields.u8(), fields.varint()
    if count > c or count > n + 1 or mean_scale > 62:
        raise refuse(f"{count} components, scale {mean_scale}")
    shifts = [fields.u8() for _ in range(count)]
    forms = [fields.u8() for _ in range(count)]
    if any(shift > 40 for shift in shifts) or any(form % 64 == 63 for form in forms):
        raise refuse("a shift or a form")
    coder = Coder(fields.rest())
    model = Model(START, coder)
    means = table(Residuals(model), c, scale_of(mean_scale))
    residuals = Residuals(model, 2568, 17)
    basis = [table(residuals, c, 2**shift >> (bits(c) >> 1)) for shift in shifts]
    residuals = Residuals(model, 5136, 34)
    components = [Component(form, first_of(coder)) for form in forms]
    for _ in range(1, n):
        near = 0
        for component in components:
            near = component.following(residuals, near)
    coder.finish()
    return values(decimals, s, means, shifts, basis, [component.y for component in components], n)


def values(
    decimals: int,
    s: int,
    means: Sequence[int],
    shifts: Sequence[int],
    basis: Sequence[Sequence[int]],
    columns: Sequence[Sequence[int]],
    n: int,
) -> list[list[float]]:
    step = (4 + s % 4) * 2.0 ** (s // 4 - 34)

    def mean(m: int) -> float:
        return m * (step / 4) if decimals == 255 else m / 10**decimals

    def coefficient(y: int) -> float:
        return y * step if decimals == 255 else y / 10**decimals

    rows = []
    for f in range(n):
        row = [mean(m) for m in means]
        for i, column in enumerate(columns):
            y = coefficient(column[f])
            row = [v + y * (w * 2.0 ** -shifts[i]) for v, w in zip(row, basis[i], strict=True)]
        rows.append(row)
    return rows


def decode(
    header: bytes, n_channels: int, segments: Sequence[tuple[int, bytes]]
) -> list[list[float]]:
    """All rows of a signal; ``segments`` are (frames, stream). Raises ValueError for a refusal."""
    decimals = parse_header(header)
    return [row for n, data in segments for row in segment(decimals, data, n_channels, n)]
