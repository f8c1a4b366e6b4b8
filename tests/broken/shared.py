"""Limits, HEAD, SKEL, SRCE, ATTA, ALIA, paths, INDX, QUAL."""

from __future__ import annotations

from tests.broken import Break

ADAPTER = "mcz.cli.conformance"
DIRECTORY = "mcz.container.directory"
FILE = "mcz.files.file"
FORMATS = "mcz.formats"
LIMITS = "mcz.container.limits"
MOTION = "mcz.motion"
PAYLOADS = "mcz.container.payloads"
READER = "mcz.container.reader"
SCAN = "mcz.container.scan"
SKELETONS = "mcz.container.skeletons"
STRICT = "mcz.container.strict"

LIMITED: tuple[Break, ...] = (
    Break(
        "LIMIT-02",
        ("invalid/data/memory-bomb",),
        (
            (
                LIMITS,
                '    if value > limit:\n        raise LimitError(f"{what}: {value} is over',
                '    if value > limit << 99:\n        raise LimitError(f"{what}: {value} is over',
            ),
            (
                LIMITS,
                "    if value > limit:\n        raise LimitError(\n",
                "    if value > limit << 99:\n        raise LimitError(\n",
            ),
        ),
        crashes=True,
    ),
    Break(
        "LIMIT-03",
        ("invalid/clip/channel-limit",),
        ((LIMITS, 'BASE = Profile(0, "base", 16_384,', 'BASE = Profile(0, "base", 2**20,'),),
    ),
    Break(
        "LIMIT-01",
        ("uncommon/container/most-channels",),
        ((LIMITS, 'BASE = Profile(0, "base", 16_384,', 'BASE = Profile(0, "base", 16_383,'),),
        "channels",
    ),
    Break(
        "LIMIT-04",
        ("invalid/shared/joints-limit",),
        ((LIMITS, '"base", 16_384, 4_096,', '"base", 16_384, 2**18,'),),
    ),
    Break(
        "LIMIT-01",
        ("uncommon/container/most-joints",),
        ((LIMITS, '"base", 16_384, 4_096,', '"base", 16_384, 4_095,'),),
        "joints",
    ),
    Break(
        "LIMIT-05",
        ("invalid/data/memory-of-segment",),
        ((LIMITS, "4_096, 64 * MIB, 64 * MIB,", "4_096, 2**34, 64 * MIB,"),),
    ),
    Break(
        "LIMIT-08",
        ("invalid/packets/body-limit",),
        ((LIMITS, "2**31, 64 * 1024, 64 * MIB)", "2**31, MIB, 64 * MIB)"),),
    ),
    Break(
        "LIMIT-09",
        ("invalid/shared/SRCE-limit",),
        ((LIMITS, "2**31, 64 * 1024, 64 * MIB)", "2**31, 64 * 1024, 2**31)"),),
    ),
    Break(
        "LIMIT-10",
        ("invalid/data/memory-of-signal",),
        ((LIMITS, "return max(64 * MIB, 4096 * file_bytes)", "return 2**62"),),
    ),
    Break(
        "LIMIT-13",
        ("invalid/index/INDX-bomb",),
        ((LIMITS, "return max(64 * 1024, 2 * file_bytes)", "return 2**31"),),
    ),
    Break(
        "HEAD-01",
        ("uncommon/container/newer-major",),
        (
            (
                DIRECTORY,
                "if not payloads.LEAST_NEEDED <= needed <= ours:",
                "if needed[0] == ours[0] and not payloads.LEAST_NEEDED <= needed <= ours:",
            ),
        ),
    ),
    Break(
        "HEAD-01",
        (
            "uncommon/container/newer-major-index",
            "uncommon/container/unknown-critical-index",
        ),
        (
            (ADAPTER, "scan(open_source(data), whole=True)", "pass"),
            (READER, "None if self.source.remote else self._head()", "None"),
        ),
        "index",
    ),
    Break(
        "HEAD-02",
        ("uncommon/container/newer-minor",),
        (
            (
                DIRECTORY,
                "if not payloads.LEAST_NEEDED <= needed <= ours:",
                "if not payloads.LEAST_NEEDED <= needed <= (ours[0], 255):",
            ),
        ),
    ),
    Break(
        "HEAD-03",
        ("uncommon/container/older-minor",),
        (
            (
                DIRECTORY,
                "if not payloads.LEAST_NEEDED <= needed <= ours:",
                "if not needed <= ours:",
            ),
        ),
    ),
    Break(
        "HEAD-04",
        ("valid/container/newer-writer",),
        (
            (
                DIRECTORY,
                "needed = head.needs_major, head.needs_minor",
                "needed = max((head.needs_major, head.needs_minor), (head.major, head.minor))",
            ),
        ),
    ),
    Break(
        "HEAD-05",
        ("uncommon/container/newer-codec",),
        (("mcz.codecs", "if version > codec.version:", "if False:"),),
    ),
)

SHARED: tuple[Break, ...] = (
    Break(
        "SKEL-01",
        ("invalid/shared/unit-0", "invalid/shared/unit-negative"),
        ((MOTION, "(np.isfinite(self.unit_cm) and self.unit_cm > 0)", "True"),),
    ),
    Break(
        "SKEL-02",
        ("invalid/shared/base-later", "invalid/shared/base-missing"),
        ((STRICT, '        _refer(directory, b"SKEL", base, where)\n', "        pass\n"),),
    ),
    Break(
        "SKEL-03",
        ("invalid/sources/ASF-format",),
        (
            (STRICT, "if source.format in others:", "if False:"),
            (FORMATS, "if source_format.is_skeleton != of_skeleton:", "if False:"),
            (FILE, "FORMATS[source.format].write(skeleton)", "source.template"),
        ),
    ),
    Break(
        "SKEL-04",
        ("invalid/sources/ASF-format-differs",),
        (
            (STRICT, "if templates.get(id_, source.format) != source.format:", "if False:"),
            (READER, "if fields.format != format_id:", "if False:"),
        ),
    ),
    Break(
        "SKEL-05",
        ("invalid/shared/parent-later", "invalid/shared/parent-of-itself"),
        ((MOTION, "if not -1 <= joint.parent < index:", "if False:"),),
    ),
    Break(
        "SKEL-06",
        ("valid/container/columns", "valid/raw/plain"),
        (
            (
                MOTION,
                "start = sum(len(j.channels) for j in self.joints[:joint])",
                "start = sum(len(j.channels) for j in self.joints[joint + 1 :])",
            ),
        ),
    ),
    Break(
        "SKEL-07",
        ("uncommon/container/unknown-channel-kind",),
        (
            (
                SKELETONS,
                "known = 0 < row.kind <= len(CHANNEL_KINDS)\n",
                (
                    "known = 0 < row.kind <= len(CHANNEL_KINDS)\n"
                    "        if row.kind and not known:\n            raise FormatError(where)\n"
                ),
            ),
        ),
    ),
    Break(
        "SKEL-08",
        ("invalid/shared/offset-NaN", "invalid/shared/tail-infinite", "invalid/shared/axis-NaN"),
        (
            (PAYLOADS, "VECTOR = FINITE[3]", "VECTOR = FINITE.subcon[3]"),
            (
                MOTION,
                "return len(vector) == 3 and all(map(math.isfinite, vector))",
                "return len(vector) == 3",
            ),
        ),
    ),
    Break(
        "SRCE-01",
        ("invalid/shared/SRCE-stored-size",),
        ((STRICT, "if len(data) != size:", "if False:"),),
    ),
    Break(
        "ATTA-01",
        ("invalid/shared/ATTA-part-first",),
        (
            (SCAN, "fields.part != len(row.parts)\n            or ", ""),
            (SCAN, "if fields.part >= fields.n_parts:", "if False:"),
            (SCAN, "row = rows.get(fields.name) or", "row = rows.get(fields.name) or follows or"),
            (SCAN, "        row = rows.get", "        follows = None\n        row = rows.get"),
            (SCAN, "or (fields.part and not follows)", ""),
            (
                READER,
                "(fields.name, fields.part, fields.n_parts, fields.size) != expected",
                "(fields.name, number, fields.n_parts, fields.size) != expected",
            ),
        ),
        "numbers",
    ),
    Break(
        "ATTA-01",
        ("invalid/shared/ATTA-part-missing",),
        (
            (
                READER,
                "(fields.name, fields.part, fields.n_parts, fields.size) != expected",
                "(fields.name, fields.part, len(row.parts), fields.size) != expected",
            ),
        ),
        "count",
    ),
    Break(
        "ATTA-01",
        ("invalid/shared/ATTA-apart",),
        ((SCAN, "or (fields.part and not follows)", ""),),
        "consecutive",
    ),
    Break(
        "ATTA-02",
        ("invalid/shared/ATTA-hashes-differ",),
        ((READER, 'if digest not in (b"", fields.sha256):', "if False:"),),
        "hashes",
    ),
    Break(
        "ATTA-02",
        ("invalid/shared/ATTA-sizes-differ",),
        (
            (SCAN, "or fields.size != row.size\n", "\n"),
            (
                READER,
                "(fields.name, fields.part, fields.n_parts, fields.size) != expected",
                "(fields.name, fields.part, fields.n_parts, row.size) != expected",
            ),
        ),
        "sizes",
    ),
    Break(
        "ATTA-03",
        ("invalid/shared/ATTA-part-size",),
        (
            (STRICT, "if len(data) != size:", "if False:"),
            (READER, "if fields.part_size > left:", "if False:"),
            (READER, "left - fields.part_size, fields", "left - len(parts[-1]), fields"),
        ),
    ),
    Break(
        "ATTA-04",
        ("invalid/shared/ATTA-size",),
        ((READER, "if left or hashlib.sha256", "if hashlib.sha256"),),
    ),
    Break(
        "ATTA-05",
        ("invalid/shared/ATTA-hash",),
        ((READER, "if left or hashlib.sha256(data).digest() != digest:", "if left:"),),
    ),
    Break(
        "ALIA-01",
        ("invalid/shared/ALIA-skeleton-without-source",),
        ((SCAN, "self.templates, self.profile):", "self.templates, self.profile) or True:"),),
    ),
    Break(
        "ALIA-02",
        ("invalid/shared/ALIA-clip-without-source",),
        (
            (
                SCAN,
                "self.found.directory, self.templates\n        ):",
                "self.found.directory, self.templates\n        ) or self.strict:",
            ),
        ),
    ),
    Break(
        "PATH-01",
        ("invalid/shared/path-empty-part", "invalid/shared/path-empty"),
        ((STRICT, 'part in ("", ".", "..")', 'part in (".", "..")'),),
    ),
    Break(
        "PATH-02",
        ("invalid/shared/path-up", "invalid/shared/path-dot"),
        ((STRICT, 'part in ("", ".", "..")', 'part in ("",)'),),
    ),
    Break(
        "PATH-03",
        ("invalid/shared/path-backslash",),
        ((STRICT, ' or "\\\\" in name', ""),),
    ),
    Break("PATH-04", ("invalid/shared/path-NUL",), ((STRICT, ' or "\\0" in name', ""),)),
    Break("PATH-05", ("invalid/shared/path-drive",), ((STRICT, ' or ":" in parts[0]', ""),)),
)

INDEXED: tuple[Break, ...] = (
    Break(
        "INDX-01",
        ("valid/raw/plain", "valid/raw/three-segments"),
        (
            (
                DIRECTORY,
                "list(_parse_segments(row.segments, clip.offset + clip.size,",
                "list(_parse_segments(row.segments, clip.offset + clip.size - 4,",
            ),
        ),
    ),
    Break(
        "INDX-02",
        ("invalid/packets/numbered-index-fresh",),
        (
            (
                SCAN,
                "strict.check_index(payload, chunk, self.found.directory, limit)",
                "pass",
            ),
            (READER, "if row.packet in SHORT and not is_head(", "if False and not is_head("),
        ),
    ),
    Break(
        "INDX-03",
        ("invalid/packets/number-next", "invalid/packets/number-0"),
        (
            (
                "mcz.container.packets",
                "if packet.check not in (None, body_check(packet.body, number)):",
                "if False:",
            ),
            (READER, "if data[-CHECK_SIZE:] != body_check(body, number):", "if False:"),
        ),
    ),
    Break(
        "INDX-04",
        tuple(f"invalid/index/order-of-{what}" for what in ("clips", "shared", "aliases")),
        ((STRICT, "if list(ours) != list(theirs):", "if set(ours) != set(theirs):"),),
    ),
    Break(
        "INDX-05",
        ("invalid/index/clip-left-out", "invalid/index/alias-missing"),
        (
            (STRICT, "if list(ours) != list(theirs):", "if not set(theirs) <= set(ours):"),
            (STRICT, "if row != theirs[key]:", "if row != theirs.get(key, row):"),
        ),
        "less",
    ),
    Break(
        "INDX-05",
        ("invalid/index/alias-too-many",),
        ((STRICT, "if list(ours) != list(theirs):", "if not set(ours) <= set(theirs):"),),
        "more",
    ),
    Break(
        "QUAL-02",
        ("uncommon/container/quality-nonsense",),
        (
            (
                SCAN,
                "parse(payloads.QUAL, payload, chunk.label)",
                (
                    "seen = [e.key for e in parse(payloads.QUAL, payload, chunk.label).entries]\n"
                    "                if len(seen) != len(set(seen)):\n"
                    "                    raise FormatError(chunk.label)"
                ),
            ),
        ),
    ),
)

BREAKS: tuple[Break, ...] = (*LIMITED, *SHARED, *INDEXED)
