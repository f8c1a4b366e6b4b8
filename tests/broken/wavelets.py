"""Codecs 2, 5 and 6: wavelets."""

from __future__ import annotations

from tests.broken import Break

CODEC = "mcz.codecs._wavelet_codec"
FILTERS = "mcz.transforms.wavelets"
KERNELS = "mcz.codecs._wavelet_kernels"
RANGES = "mcz.transforms.dwt"
STREAMS = "mcz.codecs._wavelet_streams"
SYNTHESIS = "mcz.transforms._dwt_kernels"

SPAN = "(span.lead, span.tail, span.fresh) != (min(span.first, lead), 0, True):"

WAVELETS: tuple[Break, ...] = (
    Break(
        "WAVE-01",
        ("valid/mrdwt/wavelet-haar", "valid/mrdwt/wavelet-db2", "valid/mrdwt/wavelet-db3"),
        (
            (
                FILTERS,
                "        0.7071067811865476,\n        0.7071067811865476,\n",
                "        0.7071067811865475,\n        0.7071067811865476,\n",
            ),
            (FILTERS, "0.2241438680420134", "0.22414386804201337"),
            (FILTERS, "0.8068915093110925", "0.8068915093111925"),
        ),
    ),
    Break(
        "WAVE-01",
        ("valid/mrdwt/wavelet-db4", "valid/mrdwt/wavelet-sym4", "valid/mrdwt/wavelet-bior4-4"),
        (
            (FILTERS, "0.7148465705529157", "0.7148465705529156"),
            (FILTERS, "0.8037387518059161", "0.803738751805916"),
            (FILTERS, "0.7884856164055829", "0.788485616405583"),
        ),
        "longer",
    ),
    Break(
        "WAVE-01",
        ("valid/mrdwt/wavelet-haar", "valid/mrdwt/wavelet-db8"),
        (
            (
                FILTERS,
                "zip(signs, reversed(lo), strict=True)",
                "zip(signs[::-1], reversed(lo), strict=True)",
            ),
        ),
        "signs",
    ),
    Break(
        "WAVE-02",
        ("valid/mrdwt/inline-rounding", "invalid/mrdwt/hash-order"),
        (
            (
                SYNTHESIS,
                "            tap = lo[n + n_taps - 2 - 2 * k]\n",
                "            tap = hi[n + n_taps - 2 - 2 * k] if len(detail) else 0.0\n",
            ),
            (
                SYNTHESIS,
                "out[n - start, c] + tap * approx[k - first, c]",
                "out[n - start, c] + tap * (detail if len(detail) else approx)[k - first, c]",
            ),
            (
                SYNTHESIS,
                "        if len(detail) == 0:\n            continue\n",
                "",
            ),
            (
                SYNTHESIS,
                "            tap = hi[n + n_taps - 2 - 2 * k]\n",
                "            tap = lo[n + n_taps - 2 - 2 * k]\n",
            ),
            (SYNTHESIS, "tap * detail[k - first, c]", "tap * approx[k - first, c]"),
        ),
    ),
    Break(
        "WAVE-02",
        ("valid/mrdwt/inline-rounding",),
        (
            (
                SYNTHESIS,
                "range(n // 2, (n + n_taps - 2) // 2 + 1):\n            tap = lo",
                "range((n + n_taps - 2) // 2, n // 2 - 1, -1):\n            tap = lo",
            ),
        ),
        "backwards",
    ),
)

HEADER: tuple[Break, ...] = (
    Break(
        "MRDWT-01",
        ("invalid/mrdwt/groups",),
        (
            (CODEC, "if any(len(group) != 1 for group in layout.groups):", "if False:"),
            (
                CODEC,
                "    return decoder.read(request, fetch)\n",
                (
                    "    return np.resize(decoder.read(request, fetch),"
                    " (request.stop - request.start, n_columns))\n"
                ),
            ),
        ),
    ),
    Break(
        "MRDWT-02",
        ("invalid/mrdwt/samples", "invalid/dwt/samples"),
        (
            (CODEC, "if layout.samples_per_frame != 1:", "if False:"),
            (
                CODEC,
                "    return decoder.read(request, fetch)\n",
                "    return np.repeat(decoder.read(request, fetch), layout.samples_per_frame, 0)\n",
            ),
        ),
    ),
    Break(
        "MRDWT-03",
        ("invalid/mrdwt/resolutions",),
        (
            (CODEC, "if layout.n_resolutions > fields.levels + 1:", "if False:"),
            (
                CODEC,
                "n_bands = self.layout.n_resolutions - request.resolution",
                "n_bands = min(self.layout.n_resolutions, levels + 1) - request.resolution",
            ),
        ),
    ),
    Break(
        "MRDWT-04",
        ("valid/mrdwt/cut-resolution", "valid/mrdwt/resolutions-2"),
        (
            (
                CODEC,
                "n_bands = self.layout.n_resolutions - request.resolution",
                "n_bands = min(self.layout.n_resolutions, levels + 1 - request.resolution)",
            ),
        ),
    ),
    Break(
        "MRDWT-05",
        ("invalid/mrdwt/frames-fewer", "invalid/awt/frames-fewer"),
        (
            (CODEC, " or end > fields.coded_frames:", ":"),
            (
                CODEC,
                "self.wavelet.lengths(fields.coded_frames, fields.levels)",
                (
                    "self.wavelet.lengths("
                    "max(fields.coded_frames, spans[-1].stop if spans else 0), fields.levels)"
                ),
            ),
        ),
    ),
    Break(
        "MRDWT-06",
        ("invalid/mrdwt/taps-none", "invalid/mrdwt/taps-odd", "invalid/mrdwt/taps-66"),
        (
            (
                FILTERS,
                "if n_taps != len(self.hi) or n_taps % 2 or not 2 <= n_taps <= MAX_TAPS:",
                "if n_taps != len(self.hi):",
            ),
            (CODEC, "TAPS = counted(Float64l, MAX_TAPS)", "TAPS = counted(Float64l, 99)"),
        ),
    ),
    Break(
        "MRDWT-06",
        ("invalid/mrdwt/taps-unlike", "invalid/mrdwt/taps-unlike-hi"),
        (
            (
                FILTERS,
                "if n_taps != len(self.hi) or n_taps % 2 or not 2 <= n_taps <= MAX_TAPS:",
                "if False:",
            ),
        ),
        "unlike",
    ),
    Break(
        "MRDWT-07",
        ("invalid/mrdwt/taps-beyond", "invalid/mrdwt/taps-below", "invalid/mrdwt/taps-NaN"),
        (
            (
                FILTERS,
                "if not all(abs(tap) <= MAX_TAP for tap in (*self.lo, *self.hi)):",
                "if False:",
            ),
        ),
    ),
    Break(
        "MRDWT-08",
        ("invalid/mrdwt/levels-17",),
        ((CODEC, "lambda obj, ctx: obj <= MAX_LEVELS)", "lambda obj, ctx: True)"),),
    ),
    Break(
        "MRDWT-09",
        ("invalid/mrdwt/decimals-16", "invalid/mrdwt/decimals-254"),
        (
            (
                CODEC,
                "lambda obj, ctx: obj <= MAX_DECIMALS or obj == SCALED)",
                "lambda obj, ctx: True)",
            ),
        ),
    ),
    Break(
        "MRDWT-10",
        ("invalid/mrdwt/unit-0", "invalid/mrdwt/unit-tiny", "invalid/mrdwt/unit-huge"),
        ((CODEC, "lambda obj, ctx: 2.0**-100 <= obj <= 2.0**100)", "lambda obj, ctx: True)"),),
    ),
    Break(
        "MRDWT-11",
        ("invalid/mrdwt/least-0", "invalid/mrdwt/least-2-39"),
        ((CODEC, "lambda obj, ctx: 1 <= obj <= 2**39)", "lambda obj, ctx: True)"),),
    ),
    Break(
        "MRDWT-12",
        ("invalid/mrdwt/segment-inside",),
        ((CODEC, "any(span.first % unit for span in spans) or ", ""),),
    ),
    Break(
        "MRDWT-13",
        ("invalid/mrdwt/end-inside-hidden",),
        ((CODEC, "if end < fields.coded_frames and end % unit:", "if False:"),),
    ),
    Break(
        "MRDWT-14",
        ("valid/mrdwt/length-9", "valid/mrdwt/wavelet-db2"),
        ((RANGES, "    last = stop == lengths[0]\n", "    last = False\n"),),
    ),
    Break(
        "MRDWT-15",
        ("invalid/mrdwt/segment-lead-less", "invalid/mrdwt/segment-lead-more"),
        ((CODEC, SPAN, "(span.tail, span.fresh) != (0, True):"),),
    ),
    Break(
        "MRDWT-16",
        ("invalid/mrdwt/segment-tail", "invalid/dwt/segment-tail"),
        ((CODEC, SPAN, "(span.lead, span.fresh) != (min(span.first, lead), True):"),),
    ),
    Break(
        "MRDWT-17",
        ("invalid/mrdwt/segment-not-fresh", "invalid/awt/segment-not-fresh"),
        ((CODEC, SPAN, "(span.lead, span.tail) != (min(span.first, lead), 0):"),),
    ),
    Break(
        "MRDWT-18",
        ("invalid/mrdwt/missing-after",),
        ((CODEC, "        if due < wanted[0][1]:\n", "        if False:\n"),),
    ),
)

BITS: tuple[Break, ...] = (
    Break(
        "MRDWT-19",
        ("invalid/mrdwt/details-without-step",),
        ((STREAMS, "        if data and not known:\n", "        if False:\n"),),
    ),
    Break(
        "MRDWT-20",
        ("valid/mrdwt/zeros-written",),
        (
            (
                STREAMS,
                "        bands.append(band)\n",
                (
                    "        if data and not band.any():\n"
                    '            raise FormatError("zeros")\n'
                    "        bands.append(band)\n"
                ),
            ),
        ),
    ),
    Break(
        "MRDWT-21",
        ("invalid/mrdwt/equals-and-byte", "invalid/mrdwt/equals-and-bits"),
        ((STREAMS, "        if predictor or at != len(stream):\n", "        if predictor:\n"),),
    ),
    Break(
        "MRDWT-22",
        ("invalid/mrdwt/form-127", "invalid/mrdwt/form-255"),
        (
            (
                STREAMS,
                "        if predictor or at != len(stream):\n",
                "        if at != len(stream):\n",
            ),
        ),
    ),
    Break(
        "MRDWT-23",
        ("valid/mrdwt/constants", "valid/mrdwt/constants-greatest"),
        ((STREAMS, "np.full(prefix, first, np.int64)", "first * (np.arange(prefix) == 0)"),),
    ),
    Break(
        "MRDWT-24",
        ("invalid/mrdwt/first-beyond", "invalid/mrdwt/first-below"),
        ((STREAMS, "    if abs(first) > MAX_INDEX:\n", "    if False:\n"),),
    ),
    Break(
        "MRDWT-25",
        ("valid/mrdwt/predict-3-scale-9", "valid/mrdwt/predict-ramps"),
        ((KERNELS, "((3 * step - 2 * before) >> 2)", "((3 * step - 2 * before + 2) >> 2)"),),
    ),
    Break(
        "MRDWT-25",
        ("valid/mrdwt/predict-1-scale-0",),
        (
            (
                KERNELS,
                "        slow += (size - slow) >> 5\n",
                "        slow += (size - slow) >> 4\n",
            ),
        ),
        "slow",
    ),
    Break(
        "MRDWT-25",
        ("valid/mrdwt/predict-first",),
        ((KERNELS, "if at > 1 else 3\n", "if at > 1 else 0\n"),),
        "other",
    ),
    Break(
        "MRDWT-26",
        ("invalid/mrdwt/approximation-beyond", "invalid/mrdwt/approximation-below"),
        (
            (
                KERNELS,
                "if error == FAULT or abs(predicted + error) > MAX_INDEX:",
                "if error == FAULT:",
            ),
        ),
    ),
    Break(
        "MRDWT-27",
        ("valid/mrdwt/scaled", "valid/mrdwt/levels-1"),
        ((STREAMS, "    out[1] = 3\n", ""),),
    ),
    Break(
        "MRDWT-27",
        ("valid/mrdwt/levels-1", "valid/mrdwt/wavelet-haar"),
        ((STREAMS, "np.abs(np.diff(approximations, 2))", "np.abs(np.diff(approximations)[1:])"),),
        "size",
    ),
    Break(
        "MRDWT-27",
        ("valid/mrdwt/least-1000",),
        ((STREAMS, "np.abs(details) - coding.least + 1)", "np.abs(details))"),),
        "least",
    ),
    Break(
        "MRDWT-28",
        ("valid/mrdwt/scaled", "valid/mrdwt/start-tables"),
        ((KERNELS, "        run = run + 1 if found == 0 else 0\n", ""),),
    ),
    Break(
        "MRDWT-28",
        ("valid/mrdwt/wavelet-db3",),
        ((KERNELS, "        above = (at + shift) >> 1\n", "        above = at >> 1\n"),),
        "place",
    ),
    Break(
        "MRDWT-29",
        ("invalid/mrdwt/detail-beyond", "invalid/mrdwt/detail-beyond-least"),
        ((KERNELS, "if found == FAULT or abs(found) > MAX_INDEX - least:", "if found == FAULT:"),),
    ),
    Break(
        "MRDWT-30",
        ("valid/mrdwt/start-tables", "valid/mrdwt/levels-2"),
        ((STREAMS, "coarser, min(number, N_SETS - 1), coding\n", "coarser, 1, coding\n"),),
    ),
    Break(
        "MRDWT-30",
        ("valid/mrdwt/clips", "valid/mrdwt/levels-3"),
        (
            (
                STREAMS,
                (
                    "    return tuple(start_state(table) for table in"
                    ' json.loads(START_TABLE.read_text())["sets"])'
                ),
                (
                    "    class Kept(np.ndarray):\n"
                    "        def copy(self, *rest):\n"
                    "            return self\n\n"
                    "    return tuple(start_state(table).view(Kept) for table in"
                    ' json.loads(START_TABLE.read_text())["sets"])'
                ),
            ),
        ),
        "anew",
    ),
    Break(
        "MRDWT-31",
        ("invalid/mrdwt/approximation-byte-behind", "invalid/mrdwt/approximation-bytes-behind"),
        (
            (
                STREAMS,
                'f"{coding.name}: an approximation",\n        whole=prefix == count,',
                'f"{coding.name}: an approximation",\n        whole=False,',
            ),
        ),
    ),
    Break(
        "MRDWT-31",
        ("invalid/mrdwt/detail-byte-behind", "invalid/dwt/detail-byte-behind"),
        (
            (
                STREAMS,
                'f"{coding.name}: a detail",\n            whole=prefix == count,',
                'f"{coding.name}: a detail",\n            whole=False,',
            ),
        ),
        "details",
    ),
    Break(
        "MRDWT-32",
        ("valid/mrdwt/decimals-15-long", "valid/mrdwt/decimals-15"),
        ((CODEC, "found / 10.0**self.fields.decimals", "found * 10.0**-self.fields.decimals"),),
    ),
    Break(
        "MRDWT-33",
        ("valid/mrdwt/step-codes",),
        (
            (
                CODEC,
                "self.fields.unit * ratio_of(code)",
                "self.fields.unit * ratio_of(code // 4 * 4)",
            ),
        ),
    ),
    Break(
        "MRDWT-34",
        ("valid/mrdwt/scaled", "valid/dwt/scaled"),
        ((CODEC, "INWARD = 1 / 16", "INWARD = 1 / 8"),),
    ),
    Break(
        "MRDWT-35",
        ("valid/mrdwt/grids", "valid/mrdwt/wavelet-db2"),
        (
            (
                CODEC,
                "dwt.synthesize(bands, firsts, request.start, request.stop, self.wavelet)",
                (
                    "np.rint(100 * dwt.synthesize("
                    "bands, firsts, request.start, request.stop, self.wavelet)) / 100"
                ),
            ),
        ),
    ),
    Break(
        "DWT-01",
        ("valid/dwt/scaled", "valid/dwt/decimals"),
        (
            (
                "mcz.codecs.dwt",
                'decode=partial(_wavelet_codec.decode, "dwt"),',
                'decode=lambda *a: _wavelet_codec.decode("dwt", a[0][:-1] + b"\\2", *a[1:]),',
            ),
        ),
    ),
    Break(
        "AWT-01",
        ("valid/awt/scaled", "valid/awt/decimals"),
        (
            (
                "mcz.codecs.awt",
                'decode=partial(_wavelet_codec.decode, "awt"),',
                'decode=lambda *a: _wavelet_codec.decode("awt", a[0][:-1] + b"\\2", *a[1:]),',
            ),
        ),
    ),
)

BREAKS = (*WAVELETS, *HEADER, *BITS)
