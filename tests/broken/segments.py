"""DATA, its streams, notes and masks."""

from __future__ import annotations

from tests.broken import Break

MASKS = "mcz.files.masks"
READER = "mcz.container.reader"
SCAN = "mcz.container.scan"
SEGMENTS = "mcz.container.segments"
SIGNAL = "mcz.files.signal_info"
SIGNALS = "mcz.files.signals"

BREAKS: tuple[Break, ...] = (
    Break(
        "DATA-01",
        ("invalid/data/streams-too-long",),
        ((READER, "if table.payload_size != row.size:", "if False:"),),
    ),
    Break(
        "CHUNK-06",
        ("invalid/data/table-crc",),
        ((SEGMENTS, "if stored != zlib.crc32(data[:at]):", "if False:"),),
    ),
    Break(
        "DATA-02",
        ("invalid/data/table-crc",),
        ((SEGMENTS, "if stored != zlib.crc32(data[:at]):", "if False:"),),
    ),
    Break(
        "DATA-03",
        ("valid/notes/all-sorts",),
        (
            (
                SEGMENTS,
                "return bool(self.header.flags & FRAME_NOTES) + group\n",
                "return self._codec_start() - self.counts.n_groups + group  # as a mask\n",
            ),
            (
                SEGMENTS,
                "return self._codec_start() - self.counts.n_groups + group\n",
                "return bool(self.header.flags & FRAME_NOTES) + group\n",
            ),
        ),
    ),
    Break(
        "DATA-04",
        ("invalid/data/stream-of-nothing",),
        ((SEGMENTS, "            if length == 0:\n", "            if False:\n"),),
    ),
    Break(
        "DATA-05",
        ("invalid/data/bit-beyond-streams",),
        ((SEGMENTS, "if bitmap >> n_streams:", "if False:"),),
    ),
    Break(
        "DATA-06",
        ("invalid/data/signal-of-none",),
        (
            (
                SCAN,
                'raise FormatError(f"DATA at {offset - HEADER.size}: signal {header.signal}")',
                "return",
            ),
        ),
    ),
    Break(
        "DATA-07",
        ("invalid/data/no-frames",),
        ((SEGMENTS, "if fields[2] == 0:", "if False:"),),
    ),
    Break(
        "DATA-08",
        ("invalid/data/order-no-index",),
        (
            (
                SCAN,
                "if header.first != due and not (self.salvage and header.first > due):",
                "if False:",
            ),
            (
                SCAN,
                "self.first[header.signal] = header.stop",
                "self.first[header.signal] = max(due, header.stop)",
            ),
            (
                SIGNAL,
                "tuple(segment for segment in row.segments if segment.header.signal == index)",
                (
                    "tuple(sorted((s for s in row.segments if s.header.signal == index), "
                    "key=lambda s: s.header.first))"
                ),
            ),
        ),
    ),
    Break(
        "DATA-09",
        ("valid/qbc/segments", "valid/qbc/cut-frames-21-30"),
        (
            (
                "mcz.codecs.qbc",
                'behind = parse_first_mark(fetch(index + 1, 0, group), n, "qbc")',
                "behind = marks[-1:]",
            ),
        ),
    ),
    Break(
        "DATA-10",
        ("invalid/data/lead-before-0",),
        ((SEGMENTS, " > MAX_COUNT or fields[3] > fields[1]:", " > MAX_COUNT:"),),
    ),
    Break(
        "DATA-11",
        ("valid/online/segments",),
        (
            (
                "mcz.codecs.online",
                "for index in range(max(fresh, default=0), len(spans)):",
                "for index in range(sum(s.stop <= request.start for s in spans), len(spans)):",
            ),
        ),
    ),
    Break(
        "DATA-12",
        ("invalid/data/first-not-fresh",),
        ((SIGNAL, "if not (row.header.first or row.header.flags & FRESH):", "if False:"),),
    ),
    Break(
        "NOTES-01",
        ("invalid/data/frame-notes-without-source",),
        ((SIGNAL, "if row.header.flags & FRAME_NOTES and not noted:", "if False:"),),
    ),
    Break(
        "NOTES-02",
        ("invalid/notes/change-order", "invalid/notes/change-twice"),
        ((SIGNALS, "if channels != sorted(set(channels)) or any(", "if any("),),
    ),
    Break(
        "NOTES-03",
        ("invalid/notes/change-channel",),
        ((SIGNALS, " or any(c >= n_channels for c in channels):", ":"),),
        "changes",
        crashes=True,
    ),
    Break(
        "NOTES-03",
        ("invalid/notes/exception-channel",),
        ((SIGNALS, "or e.channel >= n_channels or", "or"),),
        "exceptions",
        crashes=True,
    ),
    Break(
        "NOTES-04",
        ("invalid/notes/exception-descending", "invalid/notes/exception-again"),
        ((SIGNALS, " or (row, e.channel) <= last:", ":"),),
    ),
    Break(
        "NOTES-05",
        ("invalid/notes/exception-behind",),
        ((SIGNALS, "if row >= n_rows or e.channel", "if e.channel"),),
    ),
    Break(
        "NOTES-06",
        ("valid/notes/grid-changes",),
        (
            (
                SIGNALS,
                "wanted = rows[row].get(channel, grid)",
                "wanted = rows[row].get(channel, current[channel])",
            ),
        ),
    ),
    Break(
        "NOTES-07",
        ("invalid/notes/change-of-integers",),
        ((SIGNALS, "if self.info.is_integer and any(g.kind", "if False and any(g.kind"),),
    ),
    Break(
        "NOTES-08",
        ("invalid/notes/exception-of-binary", "invalid/notes/exception-of-changed"),
        ((SIGNALS, "if not current[e.channel].is_text:", "if False:"),),
    ),
    Break(
        "NOTES-08",
        ("invalid/notes/exception-of-changed",),
        ((SIGNALS, "dict(enumerate(grids)) | dict(changes)", "dict(enumerate(grids))"),),
        "changed",
    ),
    Break(
        "NOTES-09",
        ("invalid/notes/exception-far-ordinal",),
        (
            (
                SIGNALS,
                "            values = _values_of(coded,",
                (
                    "            coded[exceptions.rows, exceptions.channels] = 0\n"
                    "            values = _values_of(coded,"
                ),
            ),
        ),
    ),
    Break(
        "NOTES-10",
        ("valid/notes/exceptions", "valid/cut/exceptions"),
        ((SIGNALS, "        if len(exceptions):\n", "        if False:\n"),),
    ),
    Break(
        "NOTES-10",
        ("valid/sources/bvh-lossy-exceptions",),
        (
            (
                SIGNALS,
                "        if len(exceptions):\n",
                '        if len(exceptions) and self.info.codec.domain == "ordinals":\n',
            ),
        ),
        "lossy",
    ),
    Break(
        "MASK-01",
        ("valid/notes/masks",),
        (
            (
                MASKS,
                "return flat.reshape(n_channels, n_rows).T",
                "return flat.reshape(n_rows, n_channels)",
            ),
        ),
    ),
    Break(
        "MASK-02",
        ("invalid/notes/mask-empty-run-between",),
        ((MASKS, " or (run == 0 and at > 0):", ":"),),
    ),
    Break(
        "MASK-03",
        ("invalid/notes/mask-too-short",),
        ((MASKS, "    if start != size:\n", "    if False:\n"),),
    ),
    Break(
        "MASK-04",
        ("valid/notes/masks", "valid/cut/mask"),
        (
            (
                SIGNALS,
                "return values, self._mask(start, stop, columns)",
                (
                    "mask = self._mask(start, stop, columns)\n"
                    "        return values if mask is None else np.where(mask, values, 0), mask"
                ),
            ),
        ),
    ),
)
