"""A plain decoder of codecs 7 to 10, of Hou's family, written from SPEC.md alone and in its order.

Python integers and floats only, one value at a time: slow, small, and independent of the package.
Entropy coding and residuals are those of the plain decoder of mrdwt, the tables of bases that of
the one of pca.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

from tests import plain_pca
from tests.plain_pca import table
from tests.plain_qbc import in_range
from tests.plain_wavelets import (
    ANNEX,
    Bytes,
    Coder,
    Model,
    Residuals,
    bits,
    refuse,
    side,
    starts_of,
)

WINDOW_SHA256 = "53b13492238ccd51f5ff8532039dc6a2164b74d0880814083dcd5a3e307105ae"
FRAME_SHA256 = "7a72518fd8cc341261bac2d5b5511dc85738108fa7aedae50b9331314af38d21"
(WINDOW_START,) = starts_of("window_start.json", WINDOW_SHA256)
(FRAME_START,) = starts_of("frame_start.json", FRAME_SHA256)

FRAME, CLIP, MDTT, PCA_RDO = 7, 8, 9, 10  # ids
APART, WEIGHTED, MEAN, COURSES = 1, 2, 4, 8  # flags of SPACE

Vector = list[float]
# id -> kind and data of the MODL, None where there is none.
FindModel = Callable[[bytes], tuple[int, bytes] | None]


class Segment(NamedTuple):
    first: int
    n_frames: int
    streams: Sequence[bytes]
    lead: int = 0
    tail: int = 0
    fresh: bool = True


# Bits and prefix codes


class Bits:
    """Bits in bytes, the highest of each byte first."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.taken = 0

    def plain(self, n: int) -> int:
        value = 0
        for _ in range(n):
            byte, place = divmod(self.taken, 8)
            value = 2 * value + (self.data[byte] >> (7 - place) & 1 if byte < len(self.data) else 0)
            self.taken += 1
        return value

    def finish(self) -> None:
        """Refuse data of another length than the bits take, and bits that are left and not 0."""
        if len(self.data) != (self.taken + 7) // 8 or self.plain(-self.taken % 8):
            raise refuse(f"{len(self.data)} bytes for {self.taken} bits")


class Prefix:
    """A prefix code of the classes of integers."""

    def __init__(self, fields: Bytes) -> None:
        lengths = list(fields.take(fields.varint()))
        if len(lengths) > 90 or any(length > 15 for length in lengths):
            raise refuse(f"code lengths {lengths}")
        used = [length for length in lengths if length]
        if used and used != [1] and sum(2 ** (15 - length) for length in used) != 2**15:
            raise refuse(f"code lengths {lengths} make no whole code")
        self.classes = [[c for c, v in enumerate(lengths) if v == length] for length in range(16)]

    def symbol(self, source: Bits) -> int:
        v = first = 0
        for length in range(1, 16):
            v = 2 * v + source.plain(1)
            own = self.classes[length]
            if v < first + len(own):
                return own[v - first]
            first = 2 * (first + len(own))
        raise refuse("bits that are no class")

    def integer(self, source: Bits) -> int:
        c = self.symbol(source)
        if c < 16:
            return c
        n = (c - 16) // 2 + 3
        return int((2 + c % 2) * 2**n + source.plain(n))


# Cosines


def root(v: float) -> float:
    r = 1.0
    for _ in range(40):
        r = (r + v / r) / 2
    return r


def quarter(m: int, n: int) -> float:
    x = (min(m, n - m) * 1.5707963267948966) / n
    q = x * x
    c = s = 1.0
    for i in range(9, 0, -1):
        c = 1 - (q * c) / ((2 * i - 1) * (2 * i))
        s = 1 - (q * s) / ((2 * i) * (2 * i + 1))
    return c if 2 * m <= n else x * s


@cache
def cosines(n: int, rows: int) -> list[Vector]:
    """The first ``rows`` of the ``n``."""
    if n == 0:
        return []
    quarters = [quarter(m, n) for m in range(n + 1)]
    flat, size = root(1 / n), root(2 / n)

    def cosine(k: int, j: int) -> float:
        if k == 0:
            return flat
        t = (2 * j + 1) * k % (4 * n)
        t = 4 * n - t if t > 2 * n else t
        return (quarters[t] if t <= n else -quarters[2 * n - t]) * size

    return [[cosine(k, j) for j in range(n)] for k in range(rows)]


# Bases


def bases_of(data: bytes) -> list[list[Vector]]:
    """The bases of a model of kind 1."""
    fields = Bytes(data)
    n_bases = fields.varint()
    if not 1 <= n_bases <= 16:
        raise refuse(f"{n_bases} bases")
    sizes = []
    for _ in range(n_bases):
        n_points, n_vectors = fields.varint(), fields.varint()
        if not 1 <= n_points <= 2048 or not 1 <= n_vectors <= n_points:
            raise refuse(f"{n_vectors} vectors of {n_points} entries")
        shifts = fields.take(n_vectors)
        if any(shift > 40 for shift in shifts):
            raise refuse(f"shifts {list(shifts)}")
        sizes.append((n_points, shifts))
    if sum(n_points * len(shifts) for n_points, shifts in sizes) > 2**22:
        raise refuse("more than 2^22 entries")
    coder = Coder(fields.rest())
    residuals = Residuals(Model(plain_pca.START, coder), 2568, 17)
    bases = []
    for n_points, shifts in sizes:
        scales = [2**shift >> (bits(n_points) >> 1) for shift in shifts]
        entries = [table(residuals, n_points, scale) for scale in scales]
        bases.append(
            [[e * 2.0**-shift for e in v] for v, shift in zip(entries, shifts, strict=True)]
        )
    coder.finish()
    return bases


def well_known() -> dict[bytes, tuple[int, bytes]]:
    """The models of the annexes that are no JSON, by the ids of their MODL."""
    paths = [path for path in ANNEX.rglob("*") if path.is_file() and path.suffix != ".json"]
    models = [path.read_bytes() for path in paths]
    return {hashlib.sha256(b"\1" + data).digest()[:16]: (1, data) for data in models}


KNOWN = well_known()


# Space


class Matrix(NamedTuple):
    channels: range  # of its points
    vectors: list[Vector]


class Space(NamedTuple):
    matrices: list[Matrix]
    step: float
    weights: Vector  # of each channel
    courses: list[Vector] | None  # of each frame of a window; at first as the model has them
    mean: Vector  # of each channel


def parse_space(fields: Bytes, n_channels: int, legal: int, find: FindModel) -> Space:
    """``legal``: the flags that the codec may have."""
    flags, basis = fields.u8(), fields.u8()
    if flags & ~legal or basis > 1:
        raise refuse(f"flags {flags}, basis {basis}")
    n_matrices = 3 if flags & APART else 1
    places = [range(m, n_channels, n_matrices) for m in range(n_matrices)]
    n_points = n_channels // n_matrices
    if n_channels % n_matrices or n_points > 2048:
        raise refuse(f"{n_channels} channels in {n_matrices} matrices")
    bases: list[list[Vector]] = []
    if basis or flags & (MEAN | COURSES):
        id_ = fields.take(16)
        found = find(id_) or KNOWN.get(id_)
        if found is None or found[0] != 1:
            raise refuse("no such model")
        bases = bases_of(found[1])
    step = fields.binary64()
    if not 2.0**-100 <= step <= 2.0**100:
        raise refuse(f"step {step}")
    codes = fields.take(fields.varint()) if flags & WEIGHTED else None
    if codes is not None and len(codes) != n_channels:
        raise refuse(f"{len(codes)} weights")
    weights = [1.0] * n_channels
    if codes is not None:
        weights = [(4 + w % 4) * 2.0 ** (w // 4 - 34) for w in codes]
    n_bases = (n_matrices if basis else 0) + bool(flags & COURSES) + bool(flags & MEAN)
    if len(bases) != n_bases:
        raise refuse(f"{len(bases)} bases where {n_bases} are due")
    mean = [0.0] * n_channels
    if flags & MEAN:
        (mean,) = checked(bases.pop(), n_channels, 1)
    courses = bases.pop() if flags & COURSES else None
    vectors = bases if basis else [cosines(n_points, n_points)] * n_matrices
    matrices = [Matrix(own, checked(v, n_points)) for own, v in zip(places, vectors, strict=True)]
    return Space(matrices, step, weights, courses, mean)


def checked(basis: list[Vector], n_points: int, n_vectors: int | None = None) -> list[Vector]:
    """``basis``, refused unless its vectors have ``n_points`` and are as many."""
    if any(len(vector) != n_points for vector in basis):
        raise refuse(f"vectors that have not {n_points} entries")
    if n_vectors is not None and len(basis) != n_vectors:
        raise refuse(f"{len(basis)} vectors")
    return basis


class Code(NamedTuple):
    """How coefficients become bits: by two prefix codes, or none."""

    gaps: Prefix | None = None
    values: Prefix | None = None


def parse_code(fields: Bytes) -> Code:
    coder = fields.u8()
    if coder > 1:
        raise refuse(f"coder {coder}")
    return Code(Prefix(fields), Prefix(fields)) if coder else Code()


def sparse(code: Code, n: int, source: Bits) -> list[int]:
    """A vector of ``n`` coefficients."""
    assert code.gaps and code.values
    vector = [0] * n
    at = 0
    for _ in range(source.plain(bits(n))):
        gap = code.gaps.integer(source)
        if gap >= n - at:
            raise refuse(f"a gap of {gap} at {at} of {n}")
        at += gap
        size = in_range(code.values.integer(source) + 1)
        vector[at] = -size if source.plain(1) else size
        at += 1
    return vector


class Kinds:
    """The residuals of lengths, of first coefficients and of others."""

    def __init__(self, model: Model) -> None:
        self.lengths = Residuals(model)
        self.firsts = Residuals(model, 2568, 17)
        self.others = Residuals(model, 5136, 34)


def residual(
    kind: Residuals, scales: tuple[int, int], near: int, sides: tuple[int, int, int] = (0, 0, 0)
) -> int:
    """``sides``: side1, side2, other."""
    kind.near = near
    kind.side1, kind.side2, kind.other = sides
    return kind.residual(*scales)


def at(row: Sequence[int], k: int) -> int:
    return row[k] if k < len(row) else 0


# Windows

Rows = list[list[list[int]]]  # of each matrix its rows of coefficients


class Windows(NamedTuple):
    window: int
    n_frequencies: int
    space: Space
    code: Code


def parse_windows(codec: int, data: bytes, n_channels: int, find: FindModel) -> Windows:
    fields = Bytes(data)
    window, n_frequencies = fields.varint(), fields.varint()
    if not 1 <= n_frequencies <= window <= 2048:
        raise refuse(f"{n_frequencies} frequencies, windows of {window}")
    legal = APART | WEIGHTED | (MEAN | COURSES if codec == PCA_RDO else 0)
    space = parse_space(fields, n_channels, legal, find)
    if space.courses is not None:
        space = space._replace(courses=courses_of(space.courses, window, n_frequencies))
    code = parse_code(fields)
    if fields.rest():
        raise refuse("bytes after the header")
    return Windows(window, n_frequencies, space, code)


def courses_of(basis: list[Vector], window: int, n_frequencies: int) -> list[Vector]:
    """The courses of a whole window, from what they are of its cosines."""
    n_points = len(basis[0])
    if (
        len(basis) != n_frequencies
        or n_points > window
        or n_frequencies * n_points * window > 2**30
    ):
        raise refuse(f"{len(basis)} courses of {n_points} cosines, of {window} frames")
    courses = []
    for e in basis:
        course = [0.0] * window
        for size, row in zip(e, cosines(window, n_points), strict=True):
            course = [v + size * x for v, x in zip(course, row, strict=True)]
        courses.append(course)
    return courses


def adaptive_window(counts: Sequence[int], n: int, coder: Coder) -> Rows:
    """``counts``: of each matrix its rows, of ``n`` coefficients."""
    kinds = Kinds(Model(WINDOW_START, coder))
    slow, near = 16 * n, 0
    expected = n
    matrices: Rows = []
    for m, count in enumerate(counts):
        rows: list[list[int]] = []
        for r in range(count):
            above = rows[-1] if rows else []
            beside = at_row(matrices[m - 1], r) if m else None
            expected = expected if beside is None else len(beside)
            length = residual(kinds.lengths, (16 * expected, slow), near)
            if not 0 <= length <= n:
                raise refuse(f"a row of {length} coefficients")
            near = (near + bits(16 * length) - bits(slow)) >> 1
            slow += (16 * length - slow) >> 2
            rows.append(adaptive_row(kinds, length, above, beside or []))
            expected = length
        matrices.append(rows)
    return matrices


def at_row(rows: list[list[int]], r: int) -> list[int] | None:
    return rows[r] if r < len(rows) else None


def adaptive_row(
    kinds: Kinds, length: int, above: Sequence[int], beside: Sequence[int]
) -> list[int]:
    """The first ``length`` coefficients of a row; those behind them are 0."""
    c: list[int] = []
    last = before = s = t = 0
    for k in range(length):
        a, b = abs(at(above, k)), abs(at(beside, k))
        if k == 0:
            sides = side(at(above, 0)), side(at(beside, 0)), 0
            c.append(in_range(residual(kinds.firsts, (16 * a, 16 * b), -3, sides)))
            continue
        around = abs(at(above, k + 1)) + abs(at(beside, k + 1))
        if k > 1:
            around += abs(at(above, k - 1)) + abs(at(beside, k - 1))
        scales = 8 * last + 4 * before + 2 * (a + b), 6 * (a + b) + 3 * around
        near = min(bits(length - k), 7) - 3
        c.append(in_range(residual(kinds.others, scales, near, (s, t, side(at(above, k))))))
        before, last = last, abs(c[k])
        t, s = s, side(c[k])
    return c


def prefix_window(code: Code, counts: Sequence[int], n: int, source: Bits) -> Rows:
    return [[sparse(code, n, source) for _ in range(count)] for count in counts]


def window_rows(header: Windows, data: bytes, n_frames: int) -> Rows:
    counts = [len(matrix.vectors) for matrix in header.space.matrices]
    n = min(header.n_frequencies, n_frames)
    if header.code.gaps is None:
        coder = Coder(data)
        rows = adaptive_window(counts, n, coder)
        coder.finish()
    else:
        source = Bits(data)
        rows = prefix_window(header.code, counts, n, source)
        source.finish()
    return rows


def window_values(header: Windows, rows: Rows, n_frames: int) -> list[Vector]:
    """A row of channels of each frame of a window."""
    space = header.space
    whole = space.courses is not None and n_frames == header.window
    courses = space.courses if whole else cosines(n_frames, min(header.n_frequencies, n_frames))
    assert courses is not None
    values = [[0.0] * len(space.weights) for _ in range(n_frames)]
    for matrix, own in zip(space.matrices, rows, strict=True):
        sums = [[0.0] * n_frames for _ in matrix.channels]
        for c, e in zip(own, matrix.vectors, strict=True):
            course = [0.0] * n_frames
            for k, size in enumerate(c):
                course = [v + size * x for v, x in zip(course, courses[k], strict=True)]
            for j, line in enumerate(sums):
                sums[j] = [v + e[j] * x for v, x in zip(line, course, strict=True)]
        for channel, line in zip(matrix.channels, sums, strict=True):
            for f, v in enumerate(line):
                scaled = (v * space.step) * space.weights[channel]
                values[f][channel] = space.mean[channel] + scaled
    return values


def windows_segment(header: Windows, data: bytes, n_frames: int) -> list[Vector]:
    fields = Bytes(data)
    values: list[Vector] = []
    for first in range(0, n_frames, header.window):
        size = min(header.window, n_frames - first)
        rows = window_rows(header, fields.take(fields.varint()), size)
        values += window_values(header, rows, size)
    if fields.rest():
        raise refuse("bytes after the last window")
    return values


# Codec 7: lsdt-frame


class Frames(NamedTuple):
    space: Space
    code: Code


def parse_frames(data: bytes, n_channels: int, find: FindModel) -> Frames:
    fields = Bytes(data)
    header = Frames(
        parse_space(fields, n_channels, APART | WEIGHTED, find),
        parse_code(fields),
    )
    if fields.rest():
        raise refuse("bytes after the header")
    return header


class Row:
    """What is remembered of a row."""

    last = before = fast = slow = 0

    def remember(self, c: int) -> None:
        size = 16 * abs(c)
        self.before, self.last = self.last, c
        self.fast += (size - self.fast) >> 1
        self.slow += (size - self.slow) >> 4


class State:
    """What a segment leaves to the next: models, what is remembered, and values."""

    def __init__(self, header: Frames) -> None:
        self.header = header
        self.model = Model(FRAME_START, Coder(b""))
        self.kinds = Kinds(self.model)
        self.rows = [[Row() for _ in matrix.vectors] for matrix in header.space.matrices]
        self.lengths = [0 for _ in self.rows]
        self.values = [0.0 for _ in header.space.weights]

    def adaptive_frame(self, fresh: bool) -> list[list[int]]:
        """The coefficients of each matrix."""
        found: list[list[int]] = []
        for m in range(len(self.rows)):
            found.append(self.adaptive_matrix(m, found[-1] if m else [], fresh))
        if not fresh:
            for rows, own in zip(self.rows, found, strict=True):
                for row, c in zip(rows, own, strict=True):
                    row.remember(c)
        return found

    def adaptive_matrix(self, m: int, matrix_before: Sequence[int], fresh: bool) -> list[int]:
        n = len(self.rows[m])
        scales = 16 * self.lengths[m], 16 * self.lengths[max(m - 1, 0)]
        length = residual(self.kinds.lengths, scales, -3)
        if not 0 <= length <= n:
            raise refuse(f"{length} coefficients of {n}")
        self.lengths[m] = length
        c = [0] * n
        above = higher = 0
        for r in range(length):
            row, beside = self.rows[m][r], at(matrix_before, r)
            if fresh:
                scales, near = (16 * abs(above), 16 * abs(beside)), -3
                sides = side(above), side(beside), 0
                kind = self.kinds.firsts
            else:
                f = (3 * row.fast + 16 * abs(beside)) >> 2
                scales = f, (row.slow + 8 * abs(above) + 4 * abs(higher)) >> 1
                near = min(bits(length - r), 7) - 3
                sides = side(row.last), side(beside), side(row.before)
                kind = self.kinds.others
            c[r] = in_range(residual(kind, scales, near, sides))
            higher, above = above, c[r]
        return c

    def add(self, coefficients: Sequence[Sequence[int]]) -> Vector:
        """The values of the next frame."""
        space = self.header.space
        for matrix, own in zip(space.matrices, coefficients, strict=True):
            sums = [0.0] * len(matrix.channels)
            for c, e in zip(own, matrix.vectors, strict=True):
                sums = [v + c * x for v, x in zip(sums, e, strict=True)]
            for channel, v in zip(matrix.channels, sums, strict=True):
                self.values[channel] += (v * space.step) * space.weights[channel]
        return list(self.values)


def frames_segment(state: State, data: bytes, n_frames: int, fresh: bool) -> list[Vector]:
    code = state.header.code
    values: list[Vector] = []
    if code.gaps is None:
        coder = state.model.coder = Coder(data)
        for f in range(n_frames):
            values += [state.add(state.adaptive_frame(fresh and f == 0))]
        coder.finish()
    else:
        source = Bits(data)
        for _ in range(n_frames):
            values += [state.add([sparse(code, len(rows), source) for rows in state.rows])]
        source.finish()
    return values


# All


def check_segments(codec: int, n_channels: int, n_frames: int, segments: Sequence[Segment]) -> None:
    end = 0
    for segment in segments:
        if segment.first != end or segment.n_frames < 1 or segment.lead or segment.tail:
            raise refuse(f"{segment} where {end} is due")
        if not segment.fresh and (codec != FRAME or not segment.first):
            raise refuse(f"segment {segment.first} does not start fresh")
        if len(segment.streams) != min(n_channels, 1):
            raise refuse(f"{len(segment.streams)} streams")
        end += segment.n_frames
    if end != n_frames:
        raise refuse(f"segments end at {end} of {n_frames}")


def decode(
    codec: int,
    header: bytes,
    n_channels: int,
    n_frames: int,
    segments: Sequence[Segment],
    find: FindModel,
) -> list[Vector]:
    """All rows of a signal; ``codec`` is the id. Raises ValueError where a reader must refuse."""
    check_segments(codec, n_channels, n_frames, segments)
    rows: list[Vector] = []
    if codec == FRAME:
        fields = parse_frames(header, n_channels, find)
        state = State(fields)
        for segment in segments:
            state = State(fields) if segment.fresh else state
            for data in segment.streams:
                rows += frames_segment(state, data, segment.n_frames, segment.fresh)
    else:
        windows = parse_windows(codec, header, n_channels, find)
        for segment in segments:
            for data in segment.streams:
                rows += windows_segment(windows, data, segment.n_frames)
    return rows if n_channels else [[] for _ in range(n_frames)]
