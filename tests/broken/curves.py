"""Codecs 3 and 4: Bezier curves, principal components."""

from __future__ import annotations

from tests.broken import Break

COMPONENTS = "mcz.codecs._pca_kernels"
COMPONENT_STREAMS = "mcz.codecs._pca_streams"
KERNELS = "mcz.codecs._qbc_kernels"
PCA = "mcz.codecs.pca"
QBC = "mcz.codecs.qbc"
RESIDUALS = "mcz.coding.residuals"
STREAMS = "mcz.codecs._qbc_streams"

SPAN = "(span.lead, span.tail, span.fresh) != (lead, 0, True):"
SPAN_OF_PCA = "(span.lead, span.tail, span.fresh) != (0, 0, True):"
TRUE = "lambda obj, ctx: True)"
DECIMALS = "lambda obj, ctx: obj <= MAX_DECIMALS or obj == SCALED)"

QBC_HEADER: tuple[Break, ...] = (
    Break(
        "QBC-01",
        ("invalid/qbc/samples",),
        (
            (QBC, "layout.samples_per_frame != 1 or layout.n_resolutions > 2:", "False:"),
            (
                QBC,
                (
                    "            _read_segment(out, fields, layout, spans, index, request, fetch)\n"
                    "    return out\n"
                ),
                (
                    "            _read_segment(out, fields, layout, spans, index, request, fetch)\n"
                    "    return np.repeat(out, layout.samples_per_frame, 0)\n"
                ),
            ),
        ),
    ),
    Break(
        "QBC-02",
        ("invalid/qbc/delta-0", "invalid/qbc/delta-2-20"),
        ((QBC, "lambda obj, ctx: 1 <= obj <= MAX_DELTA)", TRUE),),
    ),
    Break(
        "QBC-03",
        ("invalid/qbc/decimals-16", "invalid/qbc/decimals-254"),
        ((QBC, DECIMALS, TRUE),),
    ),
    Break(
        "QBC-04",
        ("invalid/qbc/step-0", "invalid/qbc/step-tiny", "invalid/qbc/position-step-huge"),
        ((QBC, "lambda obj, ctx: LEAST_STEP <= obj <= 1 / LEAST_STEP)", TRUE),),
    ),
    Break(
        "QBC-05",
        ("invalid/qbc/frames-fewer-hidden",),
        ((QBC, "if end > fields.coded_frames or (", "if ("),),
    ),
    Break(
        "QBC-06",
        ("invalid/qbc/segment-inside",),
        ((QBC, "if span.first % fields.delta or ", "if "),),
    ),
    Break(
        "QBC-07",
        ("invalid/qbc/end-inside-hidden",),
        ((QBC, " or (end < fields.coded_frames and end % fields.delta):", ":"),),
    ),
    Break(
        "QBC-08",
        ("invalid/qbc/segment-lead-less", "invalid/qbc/segment-lead-more"),
        ((QBC, SPAN, "(span.tail, span.fresh) != (0, True):"),),
    ),
    Break(
        "QBC-09",
        ("invalid/qbc/segment-tail",),
        ((QBC, SPAN, "(span.lead, span.fresh) != (lead, True):"),),
    ),
    Break(
        "QBC-10",
        ("invalid/qbc/segment-not-fresh",),
        ((QBC, SPAN, "(span.lead, span.tail) != (lead, 0):"),),
    ),
    Break(
        "QBC-11",
        ("valid/qbc/segments", "valid/qbc/segments-of-a-mark"),
        ((QBC, 'parse_first_mark(fetch(index + 1, 0, group), n, "qbc")', "marks[-1:]"),),
    ),
    Break(
        "QBC-12",
        ("invalid/qbc/missing-after", "invalid/qbc/missing-mark"),
        (
            (QBC, "    if own < len(frames) and is_last and needs_next:\n", "    if False:\n"),
            (
                QBC,
                'parse_first_mark(fetch(index + 1, 0, group), n, "qbc")',
                'marks[-1:] if is_last else parse_first_mark(fetch(index + 1, 0, group), n, "qbc")',
            ),
        ),
    ),
    Break(
        "QBC-13",
        ("valid/qbc/cut-end-at-mark", "valid/qbc/cut-end"),
        (
            (
                QBC,
                "    if own < len(frames) and is_last and needs_next:\n",
                "    if own < len(frames) and is_last:\n",
            ),
        ),
    ),
)

QBC_BITS: tuple[Break, ...] = (
    Break(
        "QBC-14",
        ("valid/qbc/pieces-halves", "valid/qbc/noise"),
        ((KERNELS, "KINDS = BREAKS, MIDDLES", "KINDS = MIDDLES, BREAKS"),),
    ),
    Break(
        "QBC-15",
        ("invalid/qbc/marks-byte-behind", "invalid/qbc/marks-byte-0-behind"),
        ((STREAMS, "        whole=True,\n", "        whole=False,\n"),),
    ),
    Break(
        "QBC-15",
        ("invalid/qbc/curves-byte-behind", "invalid/qbc/curves-byte-0-behind"),
        ((STREAMS, 'f"{name}: a curve", whole=whole)', 'f"{name}: a curve", whole=False)'),),
        "curves",
    ),
    Break(
        "QBC-16",
        ("invalid/qbc/scale-64", "invalid/qbc/scale-255"),
        ((STREAMS, "    halves = _scale(stream, 0, name)\n", "    halves = stream[0]\n"),),
    ),
    Break(
        "QBC-17",
        ("valid/qbc/firsts", "valid/qbc/delta-7"),
        (
            (
                RESIDUALS,
                "return -found if number(state, data, 1 if value < 0 else 0, 1) else found",
                "return found if number(state, data, 1 if value < 0 else 0, 1) else -found",
            ),
        ),
    ),
    Break(
        "QBC-17",
        ("valid/qbc/firsts", "valid/qbc/empty-beside"),
        (
            (
                RESIDUALS,
                "    if length == 0:\n        return 0\n    found = 1 << (length - 1)",
                (
                    "    if length == 0:\n        return 0 * number(state, data, 0, 1)\n"
                    "    found = 1 << (length - 1)"
                ),
            ),
        ),
        "zero",
    ),
    Break(
        "QBC-18",
        ("valid/qbc/delta-1", "valid/qbc/sizes-marks"),
        ((KERNELS, "(size - track[SLOW]) >> 4", "(size - track[SLOW]) >> 5"),),
    ),
    Break(
        "QBC-18",
        ("valid/qbc/delta-1", "valid/qbc/noise"),
        ((KERNELS, "track[SIDE_1] = other = side_of(error)", "track[SIDE_1] = side_of(error)"),),
        "other",
    ),
    Break(
        "QBC-20",
        ("invalid/qbc/first-beyond", "invalid/qbc/first-below"),
        ((KERNELS, "if abs(points[0, c]) > MAX_INDEX:", "if points[0, c] == FAULT:"),),
    ),
    Break(
        "QBC-21",
        ("invalid/qbc/mark-beyond", "invalid/qbc/break-below", "invalid/qbc/middle-beyond"),
        (
            (
                KERNELS,
                "if error == FAULT or abs(predicted[c] + error) > MAX_INDEX:",
                "if error == FAULT:",
            ),
        ),
    ),
    Break(
        "QBC-22",
        ("invalid/qbc/break-scale-64", "invalid/qbc/middle-scale-64"),
        ((STREAMS, "scale_of(_scale(stream, at, name))", "scale_of(stream[at])"),),
    ),
    Break(
        "QBC-23",
        ("valid/qbc/predicted", "valid/qbc/pieces-halves"),
        ((KERNELS, "(2 * (b - a) * part + whole) // (2 * whole)", "(b - a) * part // whole"),),
    ),
    Break(
        "QBC-23",
        ("valid/qbc/pieces-of-one", "valid/qbc/pieces-twos"),
        ((KERNELS, "        usual = n_here\n", ""),),
        "usual",
    ),
    Break(
        "QBC-23",
        ("valid/qbc/pieces-first-short", "valid/qbc/pieces-halves"),
        ((KERNELS, "(4 * left, left), min(n_here, 7)", "(4 * left, left), 3"),),
        "near",
    ),
    Break(
        "QBC-24",
        ("invalid/qbc/length-of-all",),
        ((KERNELS, "not 0 < half + error < left:", "not 0 < half + error <= left:"),),
    ),
    Break(
        "QBC-24",
        ("invalid/qbc/length-0",),
        (
            (KERNELS, "not 0 < half + error < left:", "not 0 <= half + error < left:"),
            (KERNELS, "            if length < 1:\n", "            if length < 0:\n"),
            (KERNELS, "else (length == 1):", "else (length <= 1):"),
        ),
        "none",
    ),
    Break(
        "QBC-25",
        ("valid/qbc/empty-beside", "valid/qbc/resolutions-1"),
        ((STREAMS, "(marks[:-1] + marks[1:]) >> 1)", "(marks[:-1] + marks[1:] + 1) >> 1)"),),
    ),
    Break(
        "QBC-26",
        ("valid/qbc/decimals-15-long",),
        ((QBC, "indices / 10.0**fields.decimals", "indices * 10.0**-fields.decimals"),),
    ),
    Break(
        "QBC-27",
        ("valid/qbc/step-positions",),
        ((QBC, "fields.position_step, fields.step\n", "fields.step, fields.step\n"),),
    ),
    Break(
        "QBC-28",
        ("valid/qbc/rounding", "invalid/qbc/hash-order"),
        (
            (
                KERNELS,
                "a * starts[k, channel] + b * mids[k, channel] + c * ends[k, channel]",
                "c * ends[k, channel] + b * mids[k, channel] + a * starts[k, channel]",
            ),
        ),
    ),
    Break(
        "QBC-28",
        ("valid/qbc/rounding",),
        (
            (
                KERNELS,
                "a, b, c = u * u, 2.0 * t * u, t * t",
                "a, b, c = u * u, 1 - u * u - t * t, t * t",
            ),
        ),
        "weights",
    ),
)

COMPONENTS_OF_FRAMES: tuple[Break, ...] = (
    Break(
        "PCA-01",
        ("invalid/pca/groups",),
        ((PCA, "    if len(layout.groups) > 1:\n", "    if False:\n"),),
    ),
    Break(
        "PCA-02",
        ("invalid/pca/samples", "invalid/pca/resolutions"),
        (
            (PCA, "layout.samples_per_frame != 1 or layout.n_resolutions != 1:", "False:"),
            (
                PCA,
                "block[start - span.first :]\n    return out\n",
                (
                    "block[start - span.first :]\n"
                    "    return np.repeat(out, layout.samples_per_frame, 0)\n"
                ),
            ),
        ),
    ),
    Break(
        "PCA-03",
        ("invalid/pca/segment-lead", "invalid/pca/segment-tail"),
        ((PCA, SPAN_OF_PCA, "not span.fresh:"),),
    ),
    Break(
        "PCA-04",
        ("invalid/pca/segment-not-fresh",),
        ((PCA, SPAN_OF_PCA, "(span.lead, span.tail) != (0, 0):"),),
    ),
    Break(
        "PCA-05",
        ("invalid/pca/decimals-16", "invalid/pca/decimals-254"),
        ((PCA, DECIMALS, TRUE),),
    ),
    Break(
        "PCA-06",
        ("invalid/pca/count-channels", "invalid/pca/count-frames"),
        (
            (
                COMPONENT_STREAMS,
                "    if count > min(n_channels, n_frames + 1):\n",
                "    if False:\n",
            ),
        ),
    ),
    Break(
        "PCA-07",
        ("invalid/pca/mean-scale-63",),
        ((COMPONENT_STREAMS, " or mean_scale > MAX_SCALE:", ":"),),
    ),
    Break(
        "PCA-07",
        ("invalid/pca/form-63", "invalid/pca/form-255"),
        (
            (
                COMPONENT_STREAMS,
                "if any(form & 63 > MAX_SCALE for form in sides[count:]):",
                "if False:",
            ),
        ),
        "forms",
    ),
    Break(
        "PCA-08",
        ("invalid/pca/shift-41",),
        ((COMPONENT_STREAMS, "    if max(sides[:count], default=0) > MAX_SHIFT or ", "    if "),),
    ),
    Break(
        "PCA-09",
        ("valid/pca/decimals-1", "valid/pca/wide"),
        ((COMPONENTS, "BASIS if is_basis else MEANS", "MEANS"),),
    ),
    Break(
        "PCA-10",
        ("valid/pca/wide", "valid/pca/scale-31"),
        (
            (
                COMPONENTS,
                "            fast += (size - fast) >> 2\n",
                "            fast += (size - fast) >> 1\n",
            ),
        ),
    ),
    Break(
        "PCA-10",
        ("valid/pca/wide", "valid/pca/shift-40"),
        (
            (
                COMPONENT_STREAMS,
                "(n_channels.bit_length() // 2)",
                "n_channels.bit_length()",
            ),
        ),
        "scale",
    ),
    Break(
        "PCA-11",
        ("valid/pca/stays",),
        (
            (
                COMPONENTS,
                "            if rows[at, i] != rows[at - 1, i]:\n",
                "            if True:\n",
            ),
        ),
    ),
    Break(
        "PCA-11",
        ("valid/pca/predictor-3",),
        ((COMPONENTS, "((3 * step - 2 * before) >> 2)", "((3 * step - 2 * before) >> 1)"),),
        "predictor",
    ),
    Break(
        "PCA-12",
        ("invalid/pca/mean-beyond", "invalid/pca/basis-beyond"),
        ((COMPONENTS, "if error == FAULT or abs(error) > MAX_INDEX:", "if error == FAULT:"),),
    ),
    Break(
        "PCA-13",
        ("invalid/pca/coefficient-beyond",),
        (
            (
                COMPONENTS,
                "if error == FAULT or abs(predicted + error) > MAX_INDEX:",
                "if error == FAULT:",
            ),
        ),
    ),
    Break(
        "PCA-14",
        ("invalid/pca/byte-behind", "invalid/pca/byte-0-behind"),
        ((COMPONENT_STREAMS, "whole=wanted == n_frames", "whole=False"),),
    ),
    Break(
        "PCA-15",
        ("valid/pca/step-128", "valid/pca/step-1"),
        ((PCA, "found.means * (step / MEAN_STEPS)", "found.means * step"),),
    ),
    Break(
        "PCA-16",
        ("valid/pca/decimals-15", "valid/pca/decimals-2"),
        (
            (
                PCA,
                "found.means / 10.0**decimals, found.coefficients / 10.0**decimals",
                "found.means * 10.0**-decimals, found.coefficients * 10.0**-decimals",
            ),
        ),
    ),
    Break(
        "PCA-17",
        ("valid/pca/rounding",),
        (
            (
                COMPONENTS,
                "        for i in range(len(basis)):\n",
                "        for i in range(len(basis) - 1, -1, -1):\n",
            ),
        ),
    ),
)

BREAKS = (*QBC_HEADER, *QBC_BITS, *COMPONENTS_OF_FRAMES)
