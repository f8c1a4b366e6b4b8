"""Windows."""

from __future__ import annotations

from tests.broken import Break

SPACE = "mcz.codecs._space"
WINDOWS = "mcz.codecs._windows"
WINDOW_LOOPS = "mcz.codecs._window_kernels"
WINDOW_STREAMS = "mcz.codecs._window_streams"

BREAKS: tuple[Break, ...] = (
    Break(
        "WIND-01",
        (
            "invalid/lsdt-clip/groups",
            "invalid/mdtt/groups",
        ),
        ((SPACE, "if len(layout.groups) > 1:", "if False:"),),
    ),
    Break(
        "WIND-02",
        ("invalid/lsdt-clip/samples",),
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
        "WIND-02",
        ("invalid/lsdt-clip/resolutions",),
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
        "WIND-03",
        (
            "invalid/lsdt-clip/segment-lead",
            "invalid/lsdt-clip/segment-tail",
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
        "WIND-04",
        ("invalid/lsdt-clip/segment-not-fresh",),
        (
            (
                SPACE,
                "if span.lead or span.tail or (fresh and not span.fresh):",
                "if span.lead or span.tail:",
            ),
        ),
    ),
    Break(
        "WIND-05",
        ("invalid/lsdt-clip/window-2049",),
        ((WINDOWS, "MAX_WINDOW = 2048", "MAX_WINDOW = 4096"),),
    ),
    Break(
        "WIND-06",
        ("invalid/lsdt-clip/frequencies-9",),
        ((WINDOWS, "lambda n, ctx: 1 <= n <= ctx.window", "lambda n, ctx: 1 <= n"),),
    ),
    Break(
        "WIND-06",
        ("invalid/lsdt-clip/frequencies-0",),
        ((WINDOWS, "lambda n, ctx: 1 <= n <= ctx.window", "lambda n, ctx: n <= ctx.window"),),
        "0",
    ),
    Break(
        "WIND-07",
        (
            "invalid/lsdt-clip/window-behind",
            "invalid/lsdt-clip/window-4",
        ),
        ((WINDOW_STREAMS, "if at != len(stream):", "if False:"),),
    ),
    Break(
        "WIND-07",
        ("invalid/lsdt-clip/window-more",),
        (
            (WINDOW_STREAMS, "if size > len(stream) - at:", "if False:"),
            (WINDOW_STREAMS, "if at != len(stream):", "if at < len(stream):"),
        ),
        "cut",
    ),
    Break(
        "WIND-08",
        ("invalid/lsdt-clip/byte-0-behind",),
        (
            (
                WINDOW_STREAMS,
                '            f"{where}: a coefficient",\n            whole=True,',
                '            f"{where}: a coefficient",\n            whole=False,',
            ),
        ),
    ),
    Break(
        "WIND-09",
        (
            "valid/lsdt-clip/cosines-prefix",
            "valid/lsdt-clip/frequencies-3-prefix",
        ),
        (
            (
                WINDOW_STREAMS,
                "parse_vectors(data, rows, _one(rows)",
                "parse_vectors(data, rows.T, _one(rows.T)",
            ),
        ),
    ),
    Break(
        "WIND-10",
        ("valid/lsdt-clip/cosines",),
        ((WINDOW_STREAMS, '"window_start.json"', '"frame_start.json"'),),
    ),
    Break(
        "WIND-10",
        (
            "valid/lsdt-clip/cosines",
            "valid/lsdt-clip/segments",
        ),
        (
            (
                WINDOW_STREAMS,
                (
                    "            lambda state, data: _kernels().code_window(state, data, "
                    "rows, starts, lengths) < 0,\n"
                    "            f"
                ),
                (
                    "            lambda state, data: (_kernels().code_window(state, "
                    "data, rows, starts, lengths) < 0, "
                    "_start_states()[0].__setitem__(slice(None), state))[0],\n"
                    "            f"
                ),
            ),
        ),
        "each",
    ),
    Break(
        "WIND-11",
        ("valid/lsdt-clip/segments",),
        (
            (
                WINDOW_LOOPS,
                "near = (near + bits(16 * length) - bits(slow)) >> 1",
                "near = (near + bits(16 * length) - bits(slow)) >> 2",
            ),
        ),
        "near",
    ),
    Break(
        "WIND-11",
        (
            "valid/lsdt-clip/cosines-apart",
            "valid/lsdt-clip/learned-unlike",
        ),
        (
            (
                WINDOW_LOOPS,
                "            above, matrix = nothing, matrix + 1",
                "            matrix = matrix + 1",
            ),
        ),
        "above",
    ),
    Break(
        "WIND-11",
        ("valid/lsdt-clip/cosines",),
        (
            (
                WINDOW_LOOPS,
                "nothing, lengths[r - 1] if r else n",
                "nothing, lengths[r - 1] if r else 0",
            ),
        ),
        "expected",
    ),
    Break(
        "WIND-11",
        ("valid/lsdt-clip/cosines-apart",),
        ((WINDOW_LOOPS, "if 0 <= beside < starts[matrix - 1]:", "if False:"),),
        "beside",
    ),
    Break(
        "WIND-11",
        ("valid/lsdt-clip/learned-unlike",),
        (
            (WINDOW_LOOPS, "if 0 <= beside < starts[matrix - 1]:", "if matrix > 1:"),
            (
                WINDOW_LOOPS,
                "beside = starts[matrix - 2] + r - starts[matrix - 1] if matrix > 1 else -1",
                (
                    "beside = min(starts[matrix - 2] + r - starts[matrix - 1], "
                    "starts[matrix - 1] - 1) if matrix > 1 else -1"
                ),
            ),
        ),
        "unlike",
    ),
    Break(
        "WIND-11",
        ("valid/lsdt-clip/cosines",),
        (
            (
                WINDOW_LOOPS,
                "        if k > 0:\n            before, last",
                "        if True:\n            before, last",
            ),
        ),
        "first",
    ),
    Break(
        "WIND-11",
        ("valid/lsdt-clip/cosines",),
        ((WINDOW_LOOPS, "if k > 1 else 0", "if k > 0 else 0"),),
        "around",
    ),
    Break(
        "WIND-11",
        (
            "valid/lsdt-clip/longer",
            "valid/mdtt/longer-full",
            "valid/pca-rdo/courses-longer",
        ),
        (
            (
                WINDOW_LOOPS,
                "            side, expected = nothing, lengths[r - 1] if r else n",
                (
                    "            side, expected = _stale(r, n, len(starts)), lengths[r - "
                    "1] if r else n"
                ),
            ),
            (
                WINDOW_LOOPS,
                "        above = rows[r]\n    return -1\n",
                "        above = rows[r]\n    OLD.append(rows.copy())\n    return -1\n",
            ),
            (
                WINDOW_LOOPS,
                "BLOCK_FRAMES = 256",
                (
                    "OLD = []\n"
                    "\n"
                    "\n"
                    "def _stale(r, n, n_starts):\n"
                    "    if n_starts < 3 or not OLD or OLD[-1].shape[1] >= n:\n"
                    "        return np.zeros(n, np.int64)\n"
                    "    return np.pad(OLD[-1][r], (0, n - OLD[-1].shape[1]))\n"
                    "\n"
                    "\n"
                    "BLOCK_FRAMES = 256"
                ),
            ),
            (
                WINDOWS,
                "    check(name, layout, spans, fresh=True)\n",
                (
                    "    check(name, layout, spans, fresh=True)\n"
                    "    from mcz.codecs._window_kernels import OLD\n"
                    "\n"
                    "    OLD.clear()\n"
                ),
            ),
        ),
        "stale",
    ),
    Break(
        "WIND-12",
        (
            "invalid/lsdt-clip/length-minus",
            "invalid/lsdt-clip/length-5",
        ),
        (
            (
                WINDOW_LOOPS,
                (
                    "        if length < 0 or length > n:  # FAULT is far below 0\n"
                    "            return r\n"
                ),
                "        length = clamp(length, 0, n)\n",
            ),
        ),
    ),
    Break(
        "WIND-13",
        ("valid/lsdt-clip/rounding",),
        (
            (
                WINDOW_LOOPS,
                "start + (sums[j, f] * step) * weight",
                "start + sums[j, f] * (step * weight)",
            ),
        ),
    ),
    Break(
        "WIND-13",
        (
            "invalid/lsdt-clip/hash-order",
            "valid/lsdt-clip/rounding",
        ),
        (
            (
                WINDOW_LOOPS,
                "    for r in range(len(rows)):\n        if lengths",
                "    for r in range(len(rows) - 1, -1, -1):\n        if lengths",
            ),
        ),
        "order",
    ),
    Break(
        "WIND-13",
        ("valid/lsdt-clip/rounding",),
        (
            (
                WINDOW_LOOPS,
                "sums[j, f] = sums[j, f] + entry * course[f]",
                (
                    "sums[j, f] = float(np.longdouble(sums[j, f]) + np.longdouble(entry) "
                    "* np.longdouble(course[f]))"
                ),
            ),
        ),
        "exact",
    ),
    Break(
        "WIND-14",
        ("valid/pca-rdo/courses",),
        (
            (
                WINDOWS,
                (
                    "if space.courses is not None and n_frames == fields.window:\n"
                    "        return space.courses"
                ),
                (
                    "if space.courses is not None:\n"
                    "        return np.ascontiguousarray(space.courses[: "
                    "min(fields.n_frequencies, n_frames), :n_frames])"
                ),
            ),
        ),
    ),
    Break(
        "WIND-14",
        (
            "valid/pca-rdo/courses",
            "valid/pca-rdo/courses-all",
        ),
        ((WINDOWS, "if space.courses is not None and n_frames == fields.window:", "if False:"),),
        "cosines",
    ),
    Break(
        "WIND-15",
        ("valid/pca-rdo/mean",),
        (
            (
                SPACE,
                "        mean,\n        courses,",
                "        np.zeros(n_channels),\n        courses,",
            ),
        ),
    ),
    Break(
        "WIND-15",
        (
            "valid/pca-rdo/mean-apart",
            "valid/pca-rdo/all-flags",
        ),
        (
            (
                WINDOW_LOOPS,
                "start = weights[c], mean[c]",
                "start = weights[c], mean[m * len(sums) + j]",
            ),
        ),
        "of-points",
    ),
    Break(
        "WIND-16",
        ("invalid/pca-rdo/courses-6",),
        (
            (WINDOWS, "if count != fields.n_frequencies or n_cosines", "if n_cosines"),
            (
                WINDOWS,
                "        return space.courses\n",
                "        return space.courses[: fields.n_frequencies]\n",
            ),
        ),
    ),
    Break(
        "WIND-16",
        ("invalid/pca-rdo/courses-4",),
        (
            (WINDOWS, "if count != fields.n_frequencies or n_cosines", "if n_cosines"),
            (
                WINDOWS,
                "        return space.courses\n",
                (
                    "        return np.pad(space.courses, ((0, fields.n_frequencies - "
                    "len(space.courses)), (0, 0)))\n"
                ),
            ),
        ),
        "fewer",
    ),
    Break(
        "WIND-16",
        ("invalid/pca-rdo/courses-of-9",),
        (
            (
                WINDOWS,
                "count != fields.n_frequencies or n_cosines > fields.window",
                "count != fields.n_frequencies",
            ),
            (
                WINDOWS,
                "synthesize_courses(courses, space.courses, dct",
                "synthesize_courses(courses, space.courses[:, : fields.window], dct",
            ),
        ),
        "cosines",
    ),
    Break(
        "WIND-17",
        ("invalid/pca-rdo/courses-products",),
        (
            (WINDOWS, "MAX_PRODUCTS = 2**30", "MAX_PRODUCTS = 2**40"),
            (
                WINDOWS,
                "    synthesize_courses(courses, space.courses, dct",
                (
                    "    courses[:] = space.courses @ dct_matrix(fields.window)[: "
                    "n_cosines]\n"
                    "    (lambda *_: 0)(courses, space.courses, dct"
                ),
            ),
        ),
    ),
)
