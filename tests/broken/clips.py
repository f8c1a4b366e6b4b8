"""CLIP, packets of open DATA, REPT, CEND."""

from __future__ import annotations

from tests.broken import Break

BASE = "mcz.codecs.base"
CLIP = "mcz.files.clip"
DIGEST = "mcz.files.digest"
DIRECTORY = "mcz.container.directory"
FORMATS = "mcz.formats"
PACKETS = "mcz.container.packets"
PAYLOADS = "mcz.container.payloads"
READER = "mcz.container.reader"
SCAN = "mcz.container.scan"
SEGMENTS = "mcz.container.segments"
SIGNAL = "mcz.files.signal_info"
STRICT = "mcz.container.strict"

CLIPS: tuple[Break, ...] = (
    Break(
        "CLIP-01",
        ("invalid/clip/name-empty",),
        (
            (
                SCAN,
                "if not fields.name or fields.name in self.found.directory.clips:",
                "if fields.name in self.found.directory.clips:",
            ),
        ),
    ),
    Break(
        "CLIP-02",
        ("invalid/clip/metadata-twice",),
        ((STRICT, "if len(keys) != len(set(keys)):", "if False:"),),
    ),
    Break(
        "CLIP-03",
        ("invalid/sources/format-differs",),
        (
            (STRICT, "if templates.get(id_, source.format) != source.format:", "if False:"),
            (READER, "if fields.format != format_id:", "if False:"),
        ),
    ),
    Break(
        "CLIP-04",
        ("invalid/sources/format-of-skeletons",),
        (
            (STRICT, "if source.format in others:", "if False:"),
            (FORMATS, "if source_format.is_skeleton != of_skeleton:", "if False:"),
            (CLIP, "            format_by_id(fields.format).name,", '            "bvh",'),
        ),
    ),
    Break(
        "CLIP-05",
        ("invalid/clip/no-signal-at-all",),
        (
            (SCAN, "if not fields.signals:", "if False:"),
            (CLIP, "if not fields.signals:", "if False:"),
        ),
    ),
    Break(
        "CLIP-06",
        ("invalid/clip/grids-empty-run",),
        (
            (
                PAYLOADS,
                '"n_channels" / POSITIVE * "channels in a row',
                '"n_channels" / UVARINT * "channels in a row',
            ),
            (SIGNAL, "if not 1 <= run.n_channels <=", "if not 0 <= run.n_channels <="),
        ),
    ),
    Break(
        "CLIP-07",
        ("invalid/clip/grids-too-many",),
        (
            (SIGNAL, "if not 1 <= run.n_channels <= n_channels - len(grids):", "if False:"),
            (SIGNAL, "if len(grids) != n_channels:", "if False:"),
        ),
    ),
    Break(
        "CLIP-08",
        ("valid/skeletons/every-field",),
        (
            (
                SIGNAL,
                "        if size:\n            groups.append",
                "        if True:\n            groups.append",
            ),
        ),
        "joints",
    ),
    Break(
        "CLIP-08",
        ("valid/raw/groups-channel",),
        ((SIGNAL, "sizes = [1] * n_channels", "sizes = [n_channels]"),),
        "channels",
    ),
    Break(
        "CLIP-09",
        ("invalid/clip/groups-of-no-joints",),
        (
            (
                SIGNAL,
                "parse_groups(own.groups, skeleton if channels is None else None,",
                "parse_groups(own.groups, skeleton,",
            ),
        ),
    ),
    Break(
        "CLIP-10",
        ("invalid/clip/groups-empty",),
        ((SIGNAL, "if 0 in sizes or sum(sizes)", "if sum(sizes)"),),
    ),
    Break(
        "CLIP-11",
        ("invalid/clip/groups-of-fewer",),
        ((SIGNAL, "if 0 in sizes or sum(sizes) != n_channels:", "if 0 in sizes:"),),
    ),
    Break(
        "CLIP-12",
        ("invalid/clip/samples-0-of-no-frames",),
        ((PAYLOADS, '"samples_per_frame" / POSITIVE', '"samples_per_frame" / UVARINT'),),
    ),
    Break(
        "CLIP-14",
        ("invalid/clip/rate-unknown-over-0",),
        ((PAYLOADS, '"rate_denominator" / POSITIVE', '"rate_denominator" / UVARINT'),),
    ),
    Break(
        "CLIP-15",
        ("invalid/clip/resolutions-of-raw",),
        ((BASE, "    if layout.n_resolutions != 1:\n", "    if False:\n"),),
    ),
    Break(
        "CLIP-16",
        ("invalid/clip/open-with-frames",),
        ((READER, "            if n_frames:\n", "            if False:\n"),),
    ),
    Break(
        "CLIP-17",
        ("invalid/clip/CLIP-frames",),
        ((READER, "n_frames = fields.n_frames\n", "n_frames = row.n_frames\n"),),
    ),
    Break(
        "CLIP-18",
        ("valid/cut/frames-1-5", "valid/cut/segments-before"),
        ((CLIP, "reader.read(start + info.skip, stop + info.skip)", "reader.read(start, stop)"),),
    ),
    Break(
        "CLIP-19",
        ("invalid/cut/open",),
        ((DIRECTORY, "if clip.flags & payloads.OPEN_CLIP and any(cut):", "if False:"),),
    ),
    Break(
        "CLIP-21",
        ("valid/container/metadata-unknown",),
        (
            (
                STRICT,
                "if len(keys) != len(set(keys)):",
                'if len(keys) != len(set(keys)) or "weather" in keys:',
            ),
        ),
    ),
    Break(
        "CUT-04",
        ("valid/mrdwt/cut-resolution", "valid/mrdwt/resolutions-1"),
        (
            (
                "mcz.codecs._wavelet_codec",
                "if layout.n_resolutions > fields.levels + 1:",
                "if layout.n_resolutions != fields.levels + 1:",
            ),
        ),
    ),
    Break(
        "REG-01",
        ("invalid/clip/frame-numbers-zeros", "invalid/clip/frame-numbers-sign"),
        (
            (
                "mcz.files.frames",
                "if not _TEXT.fullmatch(text):\n            raise ValueError",
                "if False:\n            raise ValueError",
            ),
        ),
    ),
    Break(
        "GRAM-10",
        ("uncommon/lsdt-frame/model-later",),
        ((SIGNAL, "if chunk is None or chunk.offset > before:", "if chunk is None:"),),
    ),
)

PACKED: tuple[Break, ...] = (
    Break(
        "PACK-01",
        ("invalid/packets/no-end",),
        (
            (
                PACKETS,
                "    while True:\n        packet = read_packet(read, limit)\n",
                (
                    "    while not read._source.read(read.at, 1).isalpha():\n"
                    "        packet = read_packet(read, limit)\n"
                ),
            ),
        ),
    ),
    Break(
        "PACK-02",
        ("invalid/packets/sequence-gap", "invalid/packets/sequence-skipped"),
        ((PACKETS, "if packet.sequence != sequence:", "if False:"),),
    ),
    Break(
        "PACK-03",
        ("invalid/packets/head-check",),
        ((PACKETS, "if read(2) != _check16(bytes(head)):", "if read(2) is None:"),),
    ),
    Break(
        "PACK-04",
        ("invalid/packets/body-damaged",),
        (
            (PACKETS, "if stored != body_check(body):", "if False:"),
            (READER, "if data[-CHECK_SIZE:] != body_check(body, number):", "if False:"),
        ),
    ),
    Break(
        "PACK-05",
        ("invalid/packets/end-body",),
        ((PACKETS, "            if packet.body:\n", "            if False:\n"),),
    ),
    Break(
        "PACK-06",
        ("invalid/packets/end-check",),
        (
            (
                PACKETS,
                "if stored != body_check(body):",
                "if kind != END and stored != body_check(body):",
            ),
        ),
    ),
    Break(
        "PACK-07",
        ("uncommon/container/end-not-fresh",),
        (
            (
                PACKETS,
                "            if packet.body:\n",
                "            if packet.body or not packet.fresh:\n",
            ),
        ),
    ),
    Break(
        "PACK-08",
        ("invalid/packets/kind-bits",),
        ((PACKETS, "if kind > NUMBERED or head[0] & 0x70:", "if kind > NUMBERED:"),),
    ),
    Break(
        "PACK-09",
        ("invalid/packets/kind-4",),
        ((PACKETS, "if kind > NUMBERED or head[0] & 0x70:", "if head[0] & 0x70:"),),
    ),
    Break(
        "PACK-10",
        ("invalid/packets/outside",),
        (
            (
                SCAN,
                (
                    "        if self.clip is None:\n"
                    '            raise FormatError(f"chunk {chunk.label} is outside a clip")'
                ),
                (
                    "        if False:\n"
                    '            raise FormatError(f"chunk {chunk.label} is outside a clip")'
                ),
            ),
        ),
        "outside",
    ),
    Break(
        "PACK-10",
        ("invalid/packets/flags",),
        ((SCAN, "if chunk.length is None and not chunk.flags:", "if chunk.length is None:"),),
        "flags",
    ),
    Break(
        "PACK-11",
        ("invalid/packets/fresh",),
        ((SCAN, "if packet.fresh != bool(header.flags & FRESH):", "if False:"),),
    ),
    Break(
        "PACK-12",
        ("uncommon/container/frame-packets-no-index", "uncommon/container/numbered-packets"),
        (
            (
                SCAN,
                "SegmentHeader(0, self.first[0], 1, flags=",
                "SegmentHeader(0, self.first[0], 2, flags=",
            ),
        ),
    ),
    Break(
        "PACK-12",
        ("valid/online/packets-numbered",),
        ((SCAN, "flags=FRESH if packet.fresh else 0)", "flags=FRESH)"),),
        "fresh",
    ),
    Break(
        "PACK-13",
        ("invalid/packets/frame-of-first-group",),
        ((SEGMENTS, "if (counts.n_groups, counts.n_resolutions) != (1, 1):", "if False:"),),
        crashes=True,
    ),
    Break(
        "PACK-14",
        ("invalid/packets/frame-first", "invalid/packets/numbered-first"),
        ((SCAN, "            if not told:\n", "            if False:\n"),),
    ),
    Break(
        "PACK-15",
        ("invalid/packets/number-next-no-index", "invalid/packets/number-none"),
        (
            (
                PACKETS,
                "if packet.check not in (None, body_check(packet.body, number)):",
                "if False:",
            ),
            (READER, "if data[-CHECK_SIZE:] != body_check(body, number):", "if False:"),
        ),
    ),
    Break(
        "REPT-03",
        ("uncommon/container/REPT-of-nothing",),
        (
            (
                SCAN,
                "if self.salvage and chunk.type == REPEAT and self.clip is None:",
                "if chunk.type == REPEAT:",
            ),
        ),
    ),
    Break(
        "CEND-01",
        ("invalid/clip/source-hash-of-nothing",),
        ((CLIP, "len(fields.source_sha256) != len(self._fields.source):", "False:"),),
    ),
    Break(
        "CEND-02",
        ("invalid/clip/value-hash-more",),
        ((CLIP, "if len(hashes) != len(self.signals):", "if False:"),),
    ),
    Break(
        "CEND-03",
        ("valid/raw/plain", "valid/raw/groups-all"),
        ((DIGEST, '.astype("<f8").tobytes()', '.astype("<f8").tobytes("F")'),),
        "order",
    ),
    Break(
        "CEND-03",
        ("valid/numbers/integer", "valid/raw/two-signals"),
        (
            (
                DIGEST,
                'return values.astype("<i8").tobytes()',
                'return values.astype("<f8").tobytes()',
            ),
        ),
        "integers",
    ),
    Break(
        "CEND-04",
        ("valid/notes/masks", "valid/cut/mask"),
        ((DIGEST, 'mask.astype("u1").tobytes()', '(~mask).astype("u1").tobytes()'),),
        "marks",
    ),
    Break(
        "CEND-04",
        ("valid/notes/mask-of-ones", "valid/raw/plain"),
        ((DIGEST, "if any(isinstance(mask, bytes) for mask in self._masks):", "if True:"),),
        "always",
    ),
    Break(
        "CEND-05",
        ("invalid/clip/value-hash", "invalid/notes/mask-not-that-hashed"),
        ((CLIP, "if found != hashes[info.index]:", "if False:"),),
    ),
)

BREAKS: tuple[Break, ...] = (*CLIPS, *PACKED)
