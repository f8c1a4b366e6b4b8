"""Source files: templates, details, notes, the text of AMC and BVH, the bytes of C3D."""

from __future__ import annotations

from tests.broken import Break

CELLS = "mcz.formats.cells"
CLIP = "mcz.files.clip"
C3D = "mcz.formats.c3d_layout"
KERNELS = "mcz.formats._kernels"
LAYOUT = "mcz.formats.layout"
LIMITS = "mcz.container.limits"
NOTES = "mcz.formats.notes"
RESTORE = "mcz.formats.restore"
RESTORE_C3D = "mcz.formats.c3d_restore"
V = "valid/sources/"
X = "invalid/sources/"

# Two limits say no to a text of 96 MiB. The slice spares a loop over its bytes.
BOUNDLESS = (
    (RESTORE, "    if size > limit:\n", "    if False:\n"),
    (LIMITS, "return max(64 * MIB, 4096 * file_bytes)", "return 2**62"),
    (
        KERNELS,
        (
            "            for j in range(gap_start[k], gap_stop[k]):\n"
            "                out[at] = gaps[j]\n                at += 1\n"
        ),
        (
            "            gap = gaps[gap_start[k] : gap_stop[k]]\n"
            "            out[at : at + len(gap)] = gap\n            at += len(gap)\n"
        ),
    ),
)

TEMPLATES: tuple[Break, ...] = (
    Break(
        "SRC-01",
        (f"{X}hash",),
        (
            (
                CLIP,
                "if len(data) != info.size or digest != info.sha256:",
                "if len(data) != info.size:",
            ),
        ),
    ),
    Break(
        "SRC-01",
        (f"{X}ASF-hash",),
        (
            (
                "mcz.files.file",
                "if len(data) != source.size or hashlib.sha256(data).digest() != source.sha256:",
                "if len(data) != source.size:",
            ),
        ),
        "skeleton",
    ),
    Break(
        "SRC-02",
        (f"{X}size",),
        ((CLIP, "if len(data) != info.size or digest", "if digest"),),
    ),
    Break(
        "SRC-02",
        (f"{X}ASF-size",),
        (("mcz.files.file", "if len(data) != source.size or hashlib", "if hashlib"),),
        "skeleton",
    ),
    Break(
        "SRC-03",
        (f"{X}template-header-empty-part",),
        (
            (LAYOUT, '"header" / counted(SIZED, 2)', '"header" / counted(SIZED)'),
            (LAYOUT, "if len(shared.header) not in (1, 2) or len", "if len"),
            (RESTORE, "count.join(layout.header)", "count.join(layout.header[:2])"),
        ),
    ),
    Break(
        "SRC-04",
        (f"{X}template-two-patterns",),
        ((LAYOUT, " or len(shared.patterns) > 1:", ":"),),
    ),
    Break(
        "SRC-05",
        (f"{X}detail-pattern-of-all",),
        ((LAYOUT, "if own.patterns and not shared.patterns:", "if False:"),),
    ),
    Break(
        "SRC-06",
        (f"{X}detail-patterns-unused",),
        ((LAYOUT, "if len(own.patterns) >= MAX_PATTERNS:", "if False:"),),
    ),
    Break(
        "SRC-07",
        (f"{X}template-gaps-many",),
        ((LAYOUT, "MAX_GAPS = 2**20", "MAX_GAPS = 2**21"),),
    ),
    Break(
        "SRC-08",
        (f"{X}template-gap", f"{X}template-run-gap"),
        (
            (
                LAYOUT,
                "if any(run.gap >= len(gaps) for run in fields.runs) or fields.tail >= len(gaps):",
                "if False:",
            ),
        ),
        crashes=True,
    ),
    Break(
        "SRC-09",
        (f"{X}template-run-of-none",),
        ((LAYOUT, "n_columns < 1 or (column == 0 and", "(column == 0 and"),),
        "none",
    ),
    Break(
        "SRC-09",
        (f"{X}template-number-and-more",),
        ((LAYOUT, " or (column == 0 and n_columns > 1):", ":"),),
        "number",
    ),
    Break(
        "SRC-10",
        (f"{X}template-column-again",),
        ((LAYOUT, "if column < free or n_columns < 1", "if n_columns < 1"),),
    ),
    Break(
        "SRC-11",
        (f"{X}template-column",),
        ((LAYOUT, "    if free > n_channels + 1:\n", "    if False:\n"),),
        crashes=True,
    ),
    Break(
        "SRC-12",
        (f"{X}template-width",),
        ((LAYOUT, "<= MAX_WIDTH and obj != -1)", "<= MAX_WIDTH)"),),
        "minus-1",
    ),
    Break(
        "SRC-12",
        (f"{X}template-width-256",),
        ((LAYOUT, "MAX_WIDTH = 255", "MAX_WIDTH = 2**16"),),
        "range",
    ),
    Break(
        "SRC-13",
        (f"{X}detail-ends",),
        ((LAYOUT, "_BIT = ExprValidator(UVARINT, lambda obj, ctx: obj <= 1)", "_BIT = UVARINT"),),
    ),
    Break(
        "SRC-14",
        (f"{X}detail-rows-of-nothing",),
        ((LAYOUT, "if (own.rows and not own.count) or (", "if ("),),
    ),
    Break(
        "SRC-15",
        (f"{X}detail-ending",),
        ((LAYOUT, " or (own.ending and not own.ends):", ":"),),
    ),
    Break(
        "SRC-16",
        (f"{X}template-gap-size",),
        ((LAYOUT, "    if pattern.gap_size > MAX_ROW_GAPS:\n", "    if False:\n"),),
    ),
)

TEXTS: tuple[Break, ...] = (
    Break(
        "AMC-01",
        (f"{X}notes-run-of-none",),
        ((NOTES, "if run.n_rows < 1 or run.n_rows >", "if run.n_rows >"),),
    ),
    Break(
        "AMC-02",
        (f"{X}notes-rows-usual",),
        ((NOTES, "or run.n_rows > len(patterns) - row or", "or"),),
    ),
    Break(
        "AMC-03",
        (f"{X}notes-pattern",),
        ((RESTORE, "if numbers.max() >= len(layout.patterns):", "if False:"),),
        crashes=True,
    ),
    Break(
        "AMC-04",
        (f"{X}notes-row-beyond", f"{X}notes-row-sum"),
        ((NOTES, " or (distances and sum(distances) >= n_rows):", ":"),),
        "beyond",
    ),
    Break(
        "AMC-04",
        (f"{X}notes-row-twice",),
        ((NOTES, "if 0 in distances[1:] or (", "if ("),),
        "twice",
    ),
    Break(
        "AMC-05",
        (f"{X}notes-text", f"{X}notes-text-33-digits", f"{X}notes-text-empty"),
        ((NOTES, "    if wrong:\n", "    if False:\n"),),
    ),
    Break(
        "AMC-06",
        (f"{V}bvh-padded-sign",),
        (
            (
                KERNELS,
                "        return 0 if first == MINUS or first == PLUS else 1\n",
                "        return 1\n",
            ),
        ),
        "sign",
    ),
    Break(
        "AMC-06",
        (f"{V}bvh-padded-left",),
        (
            (KERNELS, "            if width > 0:\n", "            if width:\n"),
            (KERNELS, "            if width < 0:\n", "            if False:\n"),
        ),
        "left",
    ),
    Break(
        "AMC-06",
        (f"{V}bvh-odd", f"{V}amc"),
        (
            (
                RESTORE,
                "body[: len(body) - (len(runs[-1][0].tail) if runs else 0)] + layout.ending",
                "body + layout.ending",
            ),
        ),
        "ending",
    ),
    Break(
        "AMC-06",
        (f"{V}amc-odd-numbers",),
        ((RESTORE, "if int(text) == numbers[row]]", "if False]"),),
        "numbers",
    ),
    Break(
        "AMC-06",
        (f"{V}bvh-odd",),
        (
            (
                RESTORE,
                "layout.count if layout.count and layout.rows == signal.n_rows else",
                "layout.count if False else",
            ),
        ),
        "count",
    ),
    Break(
        "AMC-06",
        (f"{V}bvh-odd",),
        ((CELLS, "kept = np.flatnonzero(same)", "kept = np.flatnonzero(~same)"),),
        "exceptions",
    ),
    Break(
        "AMC-08",
        (f"{X}AMC-rows",),
        ((RESTORE, "if numbered and signal.samples_per_frame != 1:", "if False:"),),
    ),
    Break("AMC-07", (f"{X}text-bomb",), BOUNDLESS),
    Break("LIMIT-12", (f"{X}text-bomb",), BOUNDLESS),
)

BYTES: tuple[Break, ...] = (
    Break(
        "C3D-01",
        (f"{X}c3d-template-processor",),
        ((C3D, '"processor" / OneOf(Int8ul, (INTEL, DEC, SGI))', '"processor" / Int8ul'),),
    ),
    Break(
        "C3D-02",
        (f"{X}c3d-template-word",),
        ((C3D, '"word" / OneOf(Int8ul, (2, 4))', '"word" / Int8ul'),),
        crashes=True,
    ),
    Break(
        "C3D-03",
        (f"{X}c3d-template-unsigned",),
        ((C3D, "/ ExprValidator(Int8ul, lambda obj, ctx: obj <= 1)\n", "/ Int8ul\n"),),
    ),
    Break(
        "C3D-04",
        (f"{X}c3d-template-unsigned-floats",),
        ((C3D, "if shared.word == 4 and shared.unsigned:", "if False:"),),
    ),
    Break(
        "C3D-05",
        (f"{X}c3d-template-ratio-many",),
        (
            (
                C3D,
                "_WORD = ExprValidator(UVARINT, lambda obj, ctx: obj <= COUNTED)",
                "_WORD = UVARINT",
            ),
        ),
    ),
    Break(
        "C3D-06",
        (f"{X}c3d-template-ratio",),
        (
            (
                C3D,
                '"ratio" / ExprValidator(_WORD, lambda obj, ctx: obj >= 1)',
                '"ratio" / _WORD',
            ),
        ),
    ),
    Break(
        "C3D-07",
        (f"{X}c3d-template-rotations-there",),
        ((C3D, "if (shared.rotations and shared.word != 4) or (", "if ("),),
    ),
    Break(
        "C3D-08",
        (f"{X}c3d-template-gap-moved",),
        ((C3D, " or (shared.gap and not shared.rotations):", ":"),),
    ),
    Break(
        "C3D-09",
        (f"{X}c3d-template-field-kind",),
        (
            (C3D, "OneOf(Int8ul, tuple(Kind))", "Int8ul"),
            (C3D, "kind = Kind(entry.kind)\n", "kind = Kind(min(entry.kind, 6))\n"),
        ),
    ),
    Break(
        "C3D-10",
        (f"{X}c3d-template-field-descending",),
        ((C3D, "if not end <= entry.at <= len(head)", "if not entry.at <= len(head)"),),
    ),
    Break(
        "C3D-11",
        (f"{X}c3d-template-field-half",),
        (
            (
                C3D,
                "        if not end <= entry.at <= len(head) - kind.size:\n",
                (
                    "        if entry.at > len(head) - kind.size:\n"
                    "            taken += kind.size\n            continue\n"
                    "        if not end <= entry.at:\n"
                ),
            ),
        ),
    ),
    Break(
        "C3D-12",
        (f"{X}c3d-detail-values-and-byte",),
        ((C3D, 'if taken != len(own["values"]) or len(head)', "if len(head)"),),
    ),
    Break(
        "C3D-13",
        (f"{X}c3d-detail-zeros",),
        ((C3D, "    if own.zeros > MAX_ZEROS:\n", "    if False:\n"),),
    ),
    Break(
        "C3D-14",
        (f"{X}c3d-signals-points", f"{X}c3d-signals-channels", f"{X}c3d-signals-subframes"),
        (
            (
                RESTORE_C3D,
                "if (signal.n_channels, signal.samples_per_frame) != (n_channels, per_frame):",
                "if False:",
            ),
        ),
        "sizes",
        crashes=True,
    ),
    Break(
        "C3D-14",
        (f"{X}c3d-signals-grid-of-residuals",),
        (
            (RESTORE_C3D, "    if not kinds <= set(wanted):\n", "    if False:\n"),
            (
                RESTORE_C3D,
                "integral = signal.values.dtype == np.int64\n",
                (
                    "if kinds == {GridKind.BINARY64}:\n"
                    "        signal = replace(signal, values=signal.values.astype(np.int64), "
                    "grids=(Grid(GridKind.INTEGER),) * signal.n_channels, ordinals=None)\n"
                    "    integral = signal.values.dtype == np.int64\n"
                ),
            ),
        ),
        "grids",
    ),
    Break(
        "C3D-15",
        (f"{V}c3d-sgi-floats", f"{V}c3d-sgi-integers"),
        (
            (
                "mcz.formats.c3d_parameters",
                'return ">" if self.processor == SGI else "<"',
                'return "<"',
            ),
        ),
        "order",
    ),
    Break(
        "C3D-15",
        (f"{V}c3d-unsigned",),
        ((RESTORE_C3D, "low, high = (0, 0xFFFF) if unsigned else", "low, high ="),),
        "unsigned",
    ),
    Break(
        "C3D-15",
        (f"{V}c3d-range",),
        ((RESTORE_C3D, "if motion.n_frames == layout.n_frames:", "if True:"),),
        "range",
    ),
    Break(
        "C3D-15",
        (f"{V}c3d-range",),
        ((RESTORE_C3D, "    last = first + n_frames - 1\n", "    last = first + n_frames\n"),),
        "fields",
    ),
    Break(
        "C3D-15",
        (f"{V}c3d-nan-intel", f"{V}c3d-vax-reserved"),
        (
            (
                RESTORE_C3D,
                "signal.values if integral else signal.place()[0]",
                "signal.values if integral else replace(signal, ordinals=None).place()[0]",
            ),
        ),
        "payloads",
    ),
)

BREAKS: tuple[Break, ...] = (*TEMPLATES, *TEXTS, *BYTES)
