"""C3D files made for tests, independently of the package: every byte order and encoding."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

INTEL, DEC, SGI = 84, 85, 86


def real(value: float, processor: int) -> bytes:
    """The bytes of a float; of a VAX, which has neither infinity nor -0, by exponent + 2."""
    if processor == SGI:
        return struct.pack(">f", value)
    data = struct.pack("<f", value)
    if processor == INTEL or value == 0:
        return data
    word = int.from_bytes(data, "little") + (2 << 23)
    return struct.pack("<HH", word >> 16, word & 0xFFFF)


def real_of(data: bytes, processor: int) -> float:
    """The value of a float's bytes; of a VAX word with a minus sign and exponent 0: NaN."""
    if processor == SGI:
        return float(struct.unpack(">f", data)[0])
    if processor == INTEL:
        return float(struct.unpack("<f", data)[0])
    high, low = struct.unpack("<HH", data)
    exponent = high >> 7 & 0xFF
    if exponent == 0:
        return float("nan") if high >> 15 else 0.0
    fraction = ((high & 0x7F) << 16 | low) / 2**24 + 0.5
    return (-1.0 if high >> 15 else 1.0) * fraction * 2.0 ** (exponent - 128)


def word(value: int, processor: int) -> bytes:
    return struct.pack(">H" if processor == SGI else "<H", value & 0xFFFF)


@dataclass
class Made:
    """A C3D file: ``points`` (n_frames, n_points, 4) and ``analog`` (n_frames, subframes,
    n_channels) are unsigned words as stored. What is None follows from the rest."""

    points: NDArray[np.uint32]
    analog: NDArray[np.uint32]
    processor: int = INTEL
    size: int = 4  # bytes of a word
    scale: float = 0.25
    rate: float = 100.0
    first: int = 1
    last: int | None = None  # in the header
    labels: list[bytes] | None = None
    parameters: dict[str, dict[str, tuple[int, tuple[int, ...], bytes]]] = field(
        default_factory=dict
    )
    header_points: int | None = None
    header_samples: int | None = None
    start_block: int | None = None  # of the data
    parameter_block: int = 2
    blocks: int | None = None  # of the parameter section, as stated
    tail: bytes = b""

    @property
    def n_frames(self) -> int:
        return len(self.points)

    def number(self, value: int) -> tuple[int, tuple[int, ...], bytes]:
        return 2, (), word(value, self.processor)

    def real(self, value: float) -> tuple[int, tuple[int, ...], bytes]:
        return 4, (), real(value, self.processor)

    def texts(self, texts: list[bytes]) -> tuple[int, tuple[int, ...], bytes]:
        width = max(map(len, texts), default=0)
        return -1, (width, len(texts)), b"".join(text.ljust(width) for text in texts)

    def long(self, value: int) -> tuple[int, tuple[int, ...], bytes]:
        words = (value & 0xFFFF, value >> 16)
        return 2, (2,), b"".join(word(w, self.processor) for w in words)

    def groups(self) -> dict[str, dict[str, tuple[int, tuple[int, ...], bytes]]]:
        n_points, channels = self.points.shape[1], self.analog.shape[2]
        labels = [f"p{k}".encode() for k in range(n_points)]
        point = {
            "USED": self.number(n_points),
            "FRAMES": self.number(self.n_frames),
            "SCALE": self.real(-self.scale if self.size == 4 else self.scale),
            "RATE": self.real(self.rate),
            "LABELS": self.texts(labels if self.labels is None else self.labels),
            "UNITS": self.texts([b"mm"]),
        }
        groups = {"POINT": point, "ANALOG": {"USED": self.number(channels)}}
        for group, more in self.parameters.items():
            groups.setdefault(group, {}).update(more)
        return groups

    def section(self) -> bytes:
        data = b"\1\x50"
        body = b""
        for number, (group, parameters) in enumerate(self.groups().items(), 1):
            name = group.encode()
            body += struct.pack("bb", len(name), -number) + name
            body += word(3, self.processor) + b"\0"
            for key, (kind, dims, content) in parameters.items():
                name = key.encode()
                body += struct.pack("bb", -len(name), number) + name
                body += word(5 + len(dims) + len(content), self.processor)
                body += struct.pack("bB", kind, len(dims)) + bytes(dims) + content + b"\0"
        body += b"\0\0"
        blocks = -(-(len(body) + 4) // 512)
        stated = blocks if self.blocks is None else self.blocks
        data += bytes((stated, self.processor)) + body
        return data.ljust(512 * blocks, b"\0")

    def build(self) -> bytes:
        _, subframes, channels = self.analog.shape
        section = self.section()
        start = self.start_block or self.parameter_block + len(section) // 512
        last = self.first + self.n_frames - 1 if self.last is None else self.last
        header = bytes((self.parameter_block, 0x50))
        for value in (
            self.points.shape[1] if self.header_points is None else self.header_points,
            subframes * channels if self.header_samples is None else self.header_samples,
            self.first,
            last,
            10,
        ):
            header += word(value, self.processor)
        header += real(-self.scale if self.size == 4 else self.scale, self.processor)
        header += word(start, self.processor) + word(subframes, self.processor)
        header += real(self.rate, self.processor)
        header = header.ljust(512, b"\0").ljust(512 * (self.parameter_block - 1), b"\7")
        samples = self.analog.reshape(self.n_frames, subframes * channels)
        points = self.points.reshape(self.n_frames, 4 * self.points.shape[1])
        frames = np.concatenate([points, samples], axis=1)
        kind = f"{'>' if self.processor == SGI else '<'}u{self.size}"
        before = (header + section).ljust(512 * (start - 1), b"\5")
        return before + frames.astype(kind).tobytes() + self.tail


def make_c3d(
    n_frames: int = 3,
    n_points: int = 2,
    channels: int = 0,
    subframes: int = 1,
    seed: int = 1,
    **more: object,
) -> Made:
    """A file of small positive numbers, valid throughout."""
    rng = np.random.default_rng(seed)
    processor, size = more.get("processor", INTEL), more.get("size", 4)
    assert isinstance(processor, int)

    def words(*shape: int) -> NDArray[np.uint32]:
        if size == 2:
            return rng.integers(0, 3000, shape).astype(np.uint32)
        values = [real(float(v), processor) for v in rng.integers(1, 3000, shape).flat]
        kind = ">u4" if processor == SGI else "<u4"
        return np.frombuffer(b"".join(values), kind).astype(np.uint32).reshape(shape)

    points, analog = words(n_frames, n_points, 4), words(n_frames, subframes, channels)
    return Made(points, analog, **more)  # type: ignore[arg-type]


RAW = st.one_of(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0x7F800001, 0xFFC00001, 0x80000000, 0x00008000, 0xFF800000, 0x7FFF, 1]),
)
NUMBERS = st.tuples(
    st.sampled_from([1, 2, 4]), st.just((2,)), st.binary(min_size=8, max_size=8)
).map(lambda t: (t[0], t[1], t[2][: 2 * t[0]]))
EXTRAS = st.dictionaries(
    st.sampled_from(["POINT", "ANALOG", "TRIAL", "ROTATION", "EVENT"]),
    st.dictionaries(
        st.sampled_from(
            "USED FRAMES LONG_FRAMES SCALE RATE LABELS2 DATA_START RATIO FORMAT UNITS "
            "ACTUAL_START_FIELD ACTUAL_END_FIELD".split()
        ),
        NUMBERS,
        max_size=3,
    ),
    max_size=3,
)


@st.composite
def c3d_files(draw: st.DrawFn, extras: bool = True) -> Made:
    """A file of any words, counts, byte order and encoding."""
    size = draw(st.sampled_from([2, 4]))
    n_frames, n_points = draw(st.integers(0, 4)), draw(st.integers(0, 3))
    channels, subframes = draw(st.integers(0, 2)), draw(st.integers(1, 3))

    def words(*shape: int) -> np.ndarray:
        n = int(np.prod(shape))
        limit = 2 ** (8 * size) - 1
        drawn = draw(st.lists(RAW, min_size=n, max_size=n))
        return np.array([w & limit for w in drawn], np.uint32).reshape(shape)

    block = draw(st.sampled_from([2, 2, 3]))
    return Made(
        words(n_frames, n_points, 4),
        words(n_frames, subframes, channels),
        processor=draw(st.sampled_from((INTEL, DEC, SGI))),
        size=size,
        scale=draw(st.sampled_from([0.25, 0.1, 1.0])),
        rate=draw(st.sampled_from([100.0, 59.94006, 65.03, 0.0, 69.992615])),
        first=draw(st.sampled_from([1, 0, 40, 65_535])),
        parameters=draw(EXTRAS) if extras else {},
        parameter_block=block,
        tail=draw(st.one_of(st.just(b""), st.binary(max_size=700), st.just(bytes(512)))),
    )
