"""Conventions, chunks, FOOT, the grammar, strict reading."""

from __future__ import annotations

from tests.broken import Break

CHUNKS = "mcz.container.chunks"
CLI = "mcz.cli.conformance"
DIRECTORY = "mcz.container.directory"
FORMATS = "mcz.formats"
PAYLOADS = "mcz.container.payloads"
READER = "mcz.container.reader"
SCAN = "mcz.container.scan"
SCHEMA = "mcz.schema"
SEGMENTS = "mcz.container.segments"
STRICT = "mcz.container.strict"

CONVENTIONS: tuple[Break, ...] = (
    Break(
        "CONV-01",
        ("invalid/clip/rate-2-53",),
        ((SCHEMA, "MAX_COUNT = 2**53 - 1", "MAX_COUNT = 2**54 - 1"),),
    ),
    Break(
        "CONV-02",
        ("invalid/shared/varint-overlong", "invalid/packets/varint"),
        ((SCHEMA, "if byte == 0 and shift:", "if False:"),),
    ),
    Break(
        "CONV-03",
        ("invalid/clip/rate-2-53",),
        ((SCHEMA, "if value > MAX_COUNT or shift > 49:", "if shift > 62:"),),
    ),
    Break(
        "CONV-04",
        ("valid/container/two-clips", "valid/container/metadata"),
        ((SCHEMA, "        shift += 7\n", "        shift += 6 + (shift > 6)\n"),),
    ),
    Break(
        "CONV-05",
        ("valid/container/name-mark",),
        ((SCHEMA, 'return obj.decode("utf-8")', 'return obj.decode("utf-8").lstrip("\\ufeff")'),),
    ),
    Break(
        "CONV-06",
        ("invalid/shared/name-UTF-8", "invalid/shared/text-overlong"),
        ((SCHEMA, 'return obj.decode("utf-8")', 'return obj.decode("utf-8", "replace")'),),
    ),
    Break(
        "CONV-06",
        ("invalid/shared/text-surrogate",),
        ((SCHEMA, 'return obj.decode("utf-8")', 'return obj.decode("utf-8", "surrogatepass")'),),
        "surrogates",
    ),
    Break(
        "CONV-07",
        ("invalid/shared/optional-2",),
        ((PAYLOADS, "ExprValidator(UVARINT, lambda obj, ctx: obj <= 1)", "UVARINT"),),
    ),
    Break(
        "CONV-08",
        ("invalid/shared/SRCE-deflate-tail", "invalid/index/INDX-deflate"),
        ((SCHEMA, "or not inflater.eof or inflater.unused_data", "or not inflater.eof"),),
    ),
    Break(
        "CONV-08",
        ("invalid/shared/SRCE-deflate-end",),
        ((SCHEMA, "or not inflater.eof or inflater.unused_data", "or inflater.unused_data"),),
        "no-end",
    ),
    Break(
        "CONV-09",
        ("invalid/shared/SRCE-size", "invalid/index/INDX-size"),
        ((SCHEMA, "if len(out) != size or not", "if not"),),
    ),
    Break(
        "CONV-10",
        ("uncommon/container/extension-CLIP", "uncommon/container/extension-CEND"),
        (
            (
                SCHEMA,
                "EXTENSION = GreedyBytes",
                "EXTENSION = ExprValidator(GreedyBytes, lambda obj, ctx: not obj)",
            ),
        ),
    ),
    Break(
        "CONV-12",
        ("invalid/notes/exception-trailing-byte", "invalid/chunks/tail-ALIA"),
        ((SCHEMA, 'Struct("fields" / schema, Terminated)', 'Struct("fields" / schema)'),),
    ),
    Break(
        "CONV-13",
        ("invalid/notes/exception-zero-cut",),
        (
            (
                SCHEMA,
                "stream_read(stream, UVARINT._parse(stream, context, path), path)",
                "stream.read(UVARINT._parse(stream, context, path))",
            ),
        ),
    ),
    Break(
        "CONV-14",
        ("invalid/shared/SKEL-flag", "invalid/clip/flag"),
        ((PAYLOADS, "lambda obj, ctx: obj < 1 << len(names)", "lambda obj, ctx: True"),),
    ),
    Break(
        "CONV-15",
        ("invalid/shared/SRCE-encoding",),
        (
            (
                PAYLOADS,
                (
                    '"encoding" / OneOf(Int8ul, (STORED, DEFLATED)) * "0 stored, 1 raw deflate",\n'
                    '    "size" / UVARINT * "bytes of the template"'
                ),
                (
                    '"encoding" / Int8ul * "0 stored, 1 raw deflate",\n'
                    '    "size" / UVARINT * "bytes of the template"'
                ),
            ),
        ),
    ),
    Break(
        "CONV-16",
        ("uncommon/container/unknown-profile",),
        ((DIRECTORY, 'UnsupportedError(f"HEAD: profile', 'FormatError(f"HEAD: profile'),),
        "profile",
    ),
    Break(
        "CONV-16",
        ("uncommon/container/unknown-codec",),
        (("mcz.codecs", 'UnsupportedError(f"codec {id_}', 'ValueError(f"codec {id_}'),),
        "codec",
        crashes=True,
    ),
    Break(
        "CONV-16",
        ("uncommon/container/unknown-source",),
        ((FORMATS, 'UnsupportedError(f"source format', 'FormatError(f"source format'),),
        "source",
    ),
    Break(
        "CONV-17",
        ("valid/skeletons/alone", "valid/raw/plain"),
        (
            (
                PAYLOADS,
                "/ IfThenElse(this.flags & HAS_AXIS, VECTOR, Pass)",
                "/ IfThenElse(this.flags & HAS_OFFSET, VECTOR, Pass)",
            ),
        ),
    ),
    Break(
        "CONV-18",
        ("invalid/data/tail-2-53",),
        (
            (
                SEGMENTS,
                "fields[1] + fields[2] + fields[4] > MAX_COUNT or fields[3] > fields[1]",
                "fields[3] > fields[1]",
            ),
        ),
    ),
)

FRAMING: tuple[Break, ...] = (
    Break(
        "CHUNK-01",
        ("invalid/chunks/signature-last",),
        (
            (
                CHUNKS,
                "if data != SIGNATURE[: len(data)]:",
                "if data[:7] != SIGNATURE[: len(data)][:7]:",
            ),
        ),
    ),
    Break(
        "CHUNK-02",
        ("invalid/chunks/header-check",),
        ((CHUNKS, "if check != zlib.crc32(data[:6] + data[8:16]) & 0xFFFF:", "if False:"),),
    ),
    Break(
        "CHUNK-03",
        ("invalid/chunks/crc",),
        (
            (
                CHUNKS,
                "    if stored != computed:\n        raise ChecksumError(\n",
                "    if False:\n        raise ChecksumError(\n",
            ),
        ),
    ),
    # What asking for bytes that are not there would do.
    Break(
        "CHUNK-05",
        ("invalid/chunks/length-past-end",),
        (
            (
                CHUNKS,
                "if chunk.length is not None and chunk.offset + chunk.size > source.size:",
                "if False:",
            ),
            (
                "mcz.container.source",
                "if offset + size > self.size:\n            raise TruncatedError(",
                "if offset + size > self.size:\n            raise MemoryError(",
            ),
        ),
        crashes=True,
    ),
    Break(
        "CHUNK-08",
        ("invalid/chunks/type-digit",),
        ((CHUNKS, "if not (kind.isalpha() and kind.isascii()):", "if False:"),),
    ),
    Break(
        "CHUNK-09",
        ("invalid/chunks/reserved-byte",),
        ((CHUNKS, "if reserved or flags & ~KNOWN_FLAGS:", "if flags & ~KNOWN_FLAGS:"),),
    ),
    Break(
        "CHUNK-10",
        ("invalid/chunks/open-ancillary",),
        (
            (CHUNKS, 'if kind != b"DATA":', "if False:"),
            (SCAN, "if chunk.length is None and not chunk.flags:", "if chunk.length is None:"),
        ),
    ),
    Break(
        "CHUNK-11",
        ("uncommon/container/unknown-critical",),
        (
            (
                SCAN,
                'raise UnsupportedError(f"chunk {chunk.label} is critical and unknown")',
                "self._ancillary(chunk)",
            ),
        ),
    ),
    Break(
        "CHUNK-12",
        ("valid/container/unknown-ancillary",),
        (
            (
                SCAN,
                "elif chunk.flags & ANCILLARY:",
                "elif chunk.flags & ANCILLARY and chunk.type in FLAGS_OF:",
            ),
        ),
    ),
    Break(
        "CHUNK-15",
        ("invalid/chunks/ancillary-SKEL",),
        ((SCAN, "            if chunk.flags:\n", "            if False:\n"),),
    ),
    Break(
        "CHUNK-16",
        ("invalid/chunks/QUAL-critical",),
        ((CHUNKS, 'FLAGS_OF = {b"QUAL": ANCILLARY | SAFE_TO_COPY, ', "FLAGS_OF = {"),),
    ),
    Break(
        "CHUNK-17",
        ("invalid/packets/REPT-safe-to-copy", "invalid/packets/REPT-critical"),
        ((CHUNKS, "SAFE_TO_COPY, REPEAT: ANCILLARY}", "SAFE_TO_COPY}"),),
    ),
    Break(
        "FOOT-01",
        ("invalid/grammar/FOOT-flags",),
        ((CHUNKS, "    if flags:\n", "    if False:\n"),),
    ),
    Break(
        "FOOT-02",
        ("invalid/grammar/FOOT-damaged",),
        ((CHUNKS, "if crc != zlib.crc32(data[:4] + data[8:]):", "if False:"),),
    ),
    Break(
        "FOOT-03",
        ("invalid/grammar/FOOT-magic-alone",),
        (
            (
                CHUNKS,
                "if len(data) != FOOT.size or data[24:] != END_MAGIC:",
                "if len(data) != FOOT.size:",
            ),
        ),
    ),
    Break(
        "FOOT-04",
        ("invalid/grammar/FOOT-denies-INDX",),
        ((SCAN, "(foot.index_offset, foot.index_length) != index:", "False:"),),
    ),
)

GRAMMAR: tuple[Break, ...] = (
    Break(
        "GRAM-01",
        ("invalid/grammar/SKEL-in-clip", "invalid/grammar/ATTA-in-clip"),
        (
            (
                SCAN,
                "        if self.clip is not None:\n            if not self.salvage:\n",
                "        if self.clip is not None:\n            if False:\n",
            ),
            (SCAN, "            self._close_clip()\n\n    def _note", "\n    def _note"),
        ),
        "inside",
    ),
    Break(
        "GRAM-01",
        ("invalid/grammar/second-HEAD",),
        (
            (
                SCAN,
                "        if self.found.directory.head:\n            raise",
                "        if False:\n            raise",
            ),
        ),
        "HEAD",
    ),
    Break(
        "GRAM-01",
        ("invalid/grammar/INDX-of-nothing-not-before-FOOT",),
        (
            (SCAN, "        if self.index is not None:\n", "        if False:\n"),
            (CHUNKS, "        or index_offset + index_length != offset\n", ""),
        ),
        "INDX",
    ),
    Break(
        "GRAM-02",
        ("invalid/grammar/SKEL-after-CLIP",),
        ((STRICT, '    _refer(directory, b"SKEL", fields.skeleton, where)\n', ""),),
    ),
    Break(
        "GRAM-03",
        ("invalid/grammar/SRCE-after-CLIP",),
        ((STRICT, '    _refer(directory, b"SRCE", id_, where)\n', ""),),
    ),
    Break(
        "GRAM-04",
        ("invalid/grammar/ALIA-before-target",),
        ((SCAN, "if (fields.of, bytes(fields.target)) not in self.sourced:", "if False:"),),
    ),
    Break(
        "GRAM-05",
        ("uncommon/container/repeated-skeleton", "uncommon/container/repeated-template"),
        (
            (
                SCAN,
                "self.found.directory.shared.setdefault((chunk.type, id_), chunk)",
                "self.found.directory.shared[chunk.type, id_] = chunk",
            ),
        ),
    ),
    Break(
        "GRAM-06",
        ("invalid/grammar/same-clip-name-no-index",),
        (
            (
                SCAN,
                "if not fields.name or fields.name in self.found.directory.clips:",
                "if not fields.name:",
            ),
        ),
    ),
    Break(
        "GRAM-07",
        ("invalid/shared/ATTA-same-name",),
        (
            (
                SCAN,
                "row = rows.get(fields.name) or",
                "row = (rows.get(fields.name) if fields.part else None) or",
            ),
        ),
    ),
    Break(
        "GRAM-08",
        ("invalid/shared/ALIA-same-name",),
        ((SCAN, "if fields.name in self.found.directory.aliases:", "if False:"),),
    ),
    Break(
        "GRAM-09",
        ("uncommon/container/appended-no-index",),
        (
            (
                SCAN,
                "while at is not None and at != self._whole_until():",
                "while at is not None and at != self._whole_until() and not self.found.feet:",
            ),
        ),
    ),
    Break(
        "STRICT-01",
        ("invalid/grammar/no-FOOT",),
        (
            (
                SCAN,
                "self.found.directory.end == self.source.size and self.clip is None",
                "self.clip is None",
            ),
            (
                READER,
                "        if foot is None:\n",
                "        if foot is None:\n            return Foot(0, 0)\n        if not foot:\n",
            ),
        ),
    ),
    Break(
        "STRICT-03",
        ("invalid/shared/SRCE-deflate-tail", "invalid/index/ancillary-offset"),
        ((CLI, "scan(open_source(data), whole=True)", "pass"),),
    ),
    Break(
        "STRICT-04",
        ("invalid/index/ancillary-offset", "invalid/index/ancillary-missing"),
        (
            (
                SCAN,
                "strict.check_index(payload, chunk, self.found.directory, limit)",
                "pass",
            ),
        ),
    ),
    Break(
        "STRICT-04",
        ("invalid/index/first-of-two",),
        (
            (
                SCAN,
                "        if self.strict:\n            limit = index_limit",
                (
                    "        if self.strict and chunk.offset + chunk.size + FOOT.size == "
                    "self.source.size:\n            limit = index_limit"
                ),
            ),
        ),
        "last",
    ),
    Break(
        "STRICT-05",
        (
            "invalid/clip/value-hash-behind-unknown-codec",
            "invalid/clip/value-hash-beside-unknown-codec",
        ),
        ((CLI, "lacking = lacking or error\n                _", "raise\n                _"),),
    ),
    Break(
        "STRICT-05",
        ("invalid/data/table-crc-unknown-codec",),
        ((CLI, "_read_segments(file, signal)\n    if", "pass\n    if"),),
        "tables",
    ),
    Break(
        "STRICT-05",
        ("invalid/sources/hash-behind-unknown-codec",),
        ((CLI, "lacking = lacking or error\n            continue", "raise"),),
        "sources",
    ),
)

BREAKS: tuple[Break, ...] = (*CONVENTIONS, *FRAMING, *GRAMMAR)
