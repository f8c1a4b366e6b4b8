"""Codec 11: units, predictions, steps and coefficients."""

from __future__ import annotations

from tests.broken import Break

CODER = "mcz.codecs._online_coder"
FRAMES = "mcz.coding.frames"
LOOPS = "mcz.codecs._online_kernels"
ONLINE = "mcz.codecs.online"
SPACE = "mcz.codecs._space"
UNITS = "mcz.codecs._online_units"

BREAKS: tuple[Break, ...] = (
    Break(
        "ONLINE-01",
        ("invalid/online/groups",),
        ((SPACE, "if len(layout.groups) > 1:", "if False:"),),
    ),
    Break(
        "ONLINE-02",
        ("invalid/online/samples",),
        (
            (
                SPACE,
                "if layout.samples_per_frame != 1 or layout.n_resolutions != 1:",
                "if layout.n_resolutions != 1:",
            ),
        ),
        crashes=True,
    ),
    Break(
        "ONLINE-03",
        (
            "invalid/online/segment-lead",
            "invalid/online/segment-tail",
        ),
        (
            (
                SPACE,
                "if span.lead or span.tail or (fresh and not span.fresh):",
                "if fresh and not span.fresh:",
            ),
        ),
    ),
    Break(
        "ONLINE-03",
        ("invalid/online/resolutions",),
        (
            (
                SPACE,
                "if layout.samples_per_frame != 1 or layout.n_resolutions != 1:",
                "if layout.samples_per_frame != 1:",
            ),
        ),
        "resolutions",
    ),
    Break(
        "ONLINE-04",
        (
            "invalid/online/flags-mean",
            "invalid/online/flags-courses",
        ),
        ((CODER, "if fields.space.flags & (MEAN | COURSES):", "if False:"),),
    ),
    Break(
        "ONLINE-05",
        ("invalid/online/order-apart",),
        (
            (CODER, "if fields.order == REORDERED and fields.space.flags & APART:", "if False:"),
            (
                CODER,
                "    if fields.order == AS_IS:\n",
                "    if fields.order == AS_IS or fields.space.flags & APART:\n",
            ),
        ),
    ),
    Break(
        "ONLINE-06",
        ("invalid/online/order-channels-4",),
        (
            (CODER, "if layout.n_channels % N_COORDINATES:", "if False:"),
            (
                CODER,
                "space.columns.reshape(-1, N_COORDINATES).T.reshape(1, -1)",
                (
                    "np.concatenate([space.columns[:, k::N_COORDINATES] for k in "
                    "range(N_COORDINATES)], axis=1)"
                ),
            ),
        ),
    ),
    Break(
        "ONLINE-07",
        ("valid/online/reordered",),
        ((CODER, "    if fields.order == AS_IS:\n", "    if True:\n"),),
    ),
    Break(
        "ONLINE-07",
        (
            "valid/online/reordered-golomb",
            "valid/online/reordered-weights",
        ),
        (
            (
                CODER,
                "space.columns.reshape(-1, N_COORDINATES).T.reshape(1, -1)",
                "space.columns.reshape(N_COORDINATES, -1).T.reshape(1, -1)",
            ),
        ),
        "inverse",
    ),
    Break(
        "ONLINE-07",
        ("valid/online/reordered-weights",),
        (
            (
                CODER,
                "columns=np.ascontiguousarray(columns))",
                (
                    "columns=np.ascontiguousarray(columns), "
                    "weights=space.weights.reshape(N_COORDINATES, -1).T.ravel())"
                ),
            ),
        ),
        "weights",
    ),
    Break(
        "ONLINE-08",
        (
            "invalid/online/stream-empty-zeros",
            "invalid/online/unit-missing-zeros",
        ),
        (
            (UNITS, "    while left:\n", "    while left and at < len(stream):\n"),
            (ONLINE, "units[0].kind == INTRA):", "(units[0].kind if units else INTRA) == INTRA):"),
        ),
    ),
    Break(
        "ONLINE-09",
        (
            "invalid/online/kind-3-first",
            "invalid/online/kind-3-intra",
        ),
        (
            (UNITS, "if kind > INTRA or not", "if not"),
            (UNITS, "kind, size = head % 4, head // 4", "kind, size = min(head % 4, 2), head // 4"),
        ),
    ),
    Break(
        "ONLINE-10",
        (
            "invalid/online/frames-0",
            "invalid/online/frames-0-first",
        ),
        ((UNITS, "not 1 <= size <= left", "not 0 <= size <= left"),),
    ),
    Break(
        "ONLINE-11",
        (
            "invalid/online/frames-7",
            "invalid/online/frames-4",
        ),
        (
            (UNITS, "    while left:\n", "    while left > 0:\n"),
            (UNITS, "not 1 <= size <= left:", "not 1 <= size:"),
            (UNITS, "        if left:\n", "        if left > 0:\n"),
        ),
    ),
    Break(
        "ONLINE-12",
        ("invalid/online/size-beyond-zeros",),
        (
            (UNITS, "    while left:\n", "    while left and at < len(stream):\n"),
            (UNITS, "if n_bytes > len(stream) - at:", "if False:"),
        ),
    ),
    Break(
        "ONLINE-13",
        (
            "invalid/online/fresh-ltr",
            "invalid/online/fresh-str",
        ),
        ((ONLINE, "        if span.fresh != (units[0].kind == INTRA):", "        if False:"),),
    ),
    Break(
        "ONLINE-14",
        (
            "invalid/online/distance-less",
            "invalid/online/distance-older",
            "invalid/online/distance-segment",
        ),
        ((CODER, "self._ltr is None or self.distance() != unit.distance", "False"),),
    ),
    Break(
        "ONLINE-15",
        (
            "valid/online/cosines",
            "valid/online/cosines-golomb",
        ),
        (
            (
                CODER,
                "_start_states()[N_KINDS * self.coder + (kind == LTR)]",
                "_start_states()[N_KINDS * self.coder]",
            ),
        ),
    ),
    Break(
        "ONLINE-15",
        (
            "valid/online/units-parts",
            "valid/online/units-parts-golomb",
        ),
        (
            (
                CODER,
                "        if kind != STR:\n            table",
                "        if True:\n            table",
            ),
        ),
        "left",
    ),
    Break(
        "ONLINE-15",
        (
            "valid/online/cosines",
            "valid/online/intra-0-golomb",
        ),
        (
            (
                CODER,
                "        if kind != STR:\n            table",
                "        if kind == INTRA:\n            table",
            ),
        ),
        "kept",
    ),
    Break(
        "ONLINE-16",
        (
            "valid/online/steps-ltr",
            "valid/online/cosines",
        ),
        (
            (
                LOOPS,
                "before = memory[LTR_STEP] if kind == LTR else memory[LAST_STEP]",
                "before = memory[LAST_STEP]",
            ),
        ),
        "ltr",
    ),
    Break(
        "ONLINE-16",
        (
            "valid/online/quiet-str",
            "valid/online/quiet-str-golomb",
        ),
        (
            (
                LOOPS,
                "context = kind + 1 if kind else memory[PRESENT]",
                "context = kind + 1 if kind else 1",
            ),
        ),
        "present",
    ),
    Break(
        "ONLINE-16",
        (
            "valid/online/quiet-str",
            "valid/online/quiet-ltr",
        ),
        (
            (
                LOOPS,
                (
                    "    elif kind == INTRA:\n"
                    "        step = FIRST_STEP\n"
                    "    else:\n"
                    "        step = memory[LTR_STEP] if kind else memory[LAST_STEP]\n"
                ),
                "    else:\n        step = FIRST_STEP\n",
            ),
        ),
        "quiet",
    ),
    Break(
        "ONLINE-16",
        (
            "valid/online/cosines",
            "valid/online/steps-ltr",
        ),
        ((LOOPS, "flags + C_SAME + (1 if kind else 0)", "flags + C_SAME"),),
        "context",
    ),
    Break(
        "ONLINE-16",
        (
            "valid/online/quiet-str",
            "valid/online/quiet-ltr",
        ),
        ((LOOPS, "    memory[PRESENT] = 0 if kind else present", "    memory[PRESENT] = present"),),
        "memory",
    ),
    Break(
        "ONLINE-17",
        (
            "invalid/online/step-length-10-wrapped",
            "invalid/online/step-length-10-wrapped-golomb",
        ),
        (
            (
                LOOPS,
                (
                    "flags + C_LONGER + length - 1):\n"
                    "        length += 1\n"
                    "        if length > 9:\n"
                    "            return N_STEPS\n"
                ),
                (
                    "flags + C_LONGER + length - 1):\n"
                    "        length += 1\n"
                    "        if length > 9:\n"
                    "            break\n"
                ),
            ),
            (
                LOOPS,
                "return int(found) if 0 <= found < N_STEPS else N_STEPS",
                "return int(found) & 511",
            ),
        ),
    ),
    Break(
        "ONLINE-18",
        (
            "invalid/online/step-below-wrapped",
            "invalid/online/step-above-wrapped",
        ),
        (
            (
                LOOPS,
                "return int(found) if 0 <= found < N_STEPS else N_STEPS",
                "return int(found) & 511",
            ),
        ),
    ),
    Break(
        "ONLINE-18",
        (
            "invalid/online/step-below-clamped",
            "invalid/online/step-above-clamped",
        ),
        (
            (
                LOOPS,
                "return int(found) if 0 <= found < N_STEPS else N_STEPS",
                "return int(min(max(found, 0), 511))",
            ),
        ),
        "clamped",
    ),
    Break(
        "ONLINE-18",
        (
            "invalid/online/step-below",
            "invalid/online/step-below-golomb",
        ),
        (
            (
                LOOPS,
                "return int(found) if 0 <= found < N_STEPS else N_STEPS",
                "return int(found) if found != N_STEPS else 513",
            ),
        ),
        "negative",
    ),
    Break(
        "ONLINE-19",
        ("valid/online/cosines",),
        (
            (
                LOOPS,
                "lengths, tracks, 1 if kind else 0)",
                "lengths, tracks, 1 if kind == INTRA else 0)",
            ),
        ),
    ),
    Break(
        "ONLINE-19",
        (
            "valid/online/cosines",
            "valid/online/intra-1",
        ),
        (
            (
                LOOPS,
                "    if kind:\n        lengths[:] = 0\n        tracks[:] = 0\n",
                "    if kind:\n        lengths[:] = 0\n",
            ),
        ),
        "forget",
    ),
    Break(
        "ONLINE-20",
        ("valid/online/cosines-golomb",),
        (
            (
                LOOPS,
                "activity = 2 * one + two + 2 * sizes[r]",
                "activity = 2 * one + two + sizes[r]",
            ),
        ),
    ),
    Break(
        "ONLINE-20",
        (
            "valid/online/cosines-apart-golomb",
            "valid/online/learned-unlike-golomb",
        ),
        ((LOOPS, "if r + 1 < starts[m + 1]:", "if r + 1 < len(indices):"),),
        "matrix",
    ),
    Break(
        "ONLINE-20",
        ("valid/online/cosines-golomb",),
        (
            (
                LOOPS,
                (
                    "number(state, data, 1 if indices[r] < 0 else 0, 1):\n"
                    "            indices[r] = -size"
                ),
                (
                    "not number(state, data, 1 if indices[r] < 0 else 0, 1):\n"
                    "            indices[r] = -size"
                ),
            ),
        ),
        "signs",
    ),
    Break(
        "ONLINE-20",
        ("valid/online/prefixes",),
        ((LOOPS, "MOST_ONES = 16", "MOST_ONES = 17"),),
        "ones",
    ),
    Break(
        "ONLINE-20",
        ("valid/online/cosines-golomb",),
        ((LOOPS, "sizes[r] = 0 if kind else size", "sizes[r] = size"),),
        "p",
    ),
    Break(
        "ONLINE-21",
        ("invalid/online/prefix-length-0",),
        (
            (LOOPS, "if length == 0 or length > 42:", "if length > 42:"),
            (
                LOOPS,
                "1 << (length - 1) | number(state, data, prefix - ones + 1, length - 1)",
                "(1 << length) >> 1 | number(state, data, prefix - ones + 1, max(length - 1, 0))",
            ),
        ),
    ),
    Break(
        "ONLINE-21",
        (
            "invalid/online/prefix-length-43",
            "invalid/online/prefix-length-62",
        ),
        (
            (LOOPS, "length == 0 or length > 42", "length == 0"),
            (LOOPS, "    if ones > MAX_INDEX >> rice:\n        return MAX_INDEX + 1\n", ""),
            (LOOPS, "            if size > MAX_INDEX:\n                return 1\n", ""),
        ),
        "more",
    ),
    Break(
        "ONLINE-22",
        (
            "invalid/online/prefix-size-plain",
            "invalid/online/prefix-size-str",
            "invalid/online/prefix-size-wrapped",
        ),
        (
            (LOOPS, "            if size > MAX_INDEX:\n                return 1\n", ""),
            (LOOPS, "    if ones > MAX_INDEX >> rice:\n        return MAX_INDEX + 1\n", ""),
        ),
    ),
    Break(
        "ONLINE-23",
        (
            "invalid/online/byte-behind-intra",
            "invalid/online/byte-0-behind-str",
        ),
        ((CODER, "if _coding().coded_size(self._state) != len(data):", "if False:"),),
    ),
    Break(
        "ONLINE-24",
        (
            "valid/online/rounding",
            "valid/online/rounding-golomb",
        ),
        ((FRAMES, "(sums[j] * step) * weights[c]", "sums[j] * (step * weights[c])"),),
    ),
    Break(
        "ONLINE-24",
        (
            "valid/online/steps-all",
            "valid/online/cosines",
        ),
        (
            (
                LOOPS,
                "float(8 + (code & 7)) * 2.0 ** ((code >> 3) - 35)",
                "2.0 ** ((code - 256) / 8)",
            ),
        ),
        "ratio",
    ),
    Break(
        "ONLINE-24",
        (
            "valid/online/cosines",
            "valid/online/steps-ltr",
        ),
        ((LOOPS, "        values[:] = reference\n", "        pass\n"),),
        "predicted",
    ),
    Break(
        "ONLINE-24",
        ("valid/online/intra-0",),
        (
            (
                LOOPS,
                "        out[at] = values\n        if kind:\n            reference[:] = values\n",
                (
                    "        out[at] = values\n"
                    "        if kind == INTRA:\n"
                    "            reference[:] = values\n"
                ),
            ),
        ),
        "reference",
    ),
    Break(
        "ONLINE-24",
        (
            "valid/online/rounding",
            "valid/online/rounding-golomb",
        ),
        (
            (
                LOOPS,
                (
                    "        used = step * _ratio(code)\n"
                    "        add_frame(values, indices, vectors, starts, columns, used, "
                    "weights, sums)\n"
                    "        out"
                ),
                (
                    "        add_frame(values, indices, vectors, starts, columns, step, "
                    "weights * _ratio(code), sums)\n"
                    "        out"
                ),
            ),
        ),
        "scale",
    ),
)
