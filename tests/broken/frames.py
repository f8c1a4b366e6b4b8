"""Codecs 7 to 10."""

from __future__ import annotations

from tests.broken import Break

FRAMES = "mcz.coding.frames"
LSDT_CLIP = "mcz.codecs.lsdt_clip"
LSDT_FRAME = "mcz.codecs.lsdt_frame"
MDTT = "mcz.codecs.mdtt"
PCA_RDO = "mcz.codecs.pca_rdo"
SPACE = "mcz.codecs._space"

BREAKS: tuple[Break, ...] = (
    Break(
        "FRAME-01",
        ("invalid/lsdt-frame/groups",),
        ((SPACE, "if len(layout.groups) > 1:", "if False:"),),
    ),
    Break(
        "FRAME-02",
        ("invalid/lsdt-frame/samples",),
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
        "FRAME-03",
        (
            "invalid/lsdt-frame/segment-lead",
            "invalid/lsdt-frame/segment-tail",
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
        "FRAME-03",
        ("invalid/lsdt-frame/resolutions",),
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
        "FRAME-04",
        (
            "valid/lsdt-frame/segments-one-on",
            "valid/lsdt-frame/segments-all-on-prefix",
        ),
        (
            (
                LSDT_FRAME,
                "        if span.fresh:\n            coder.restart()",
                "        if True:\n            coder.restart()",
            ),
        ),
    ),
    Break(
        "FRAME-04",
        ("valid/lsdt-frame/segments-one-on",),
        (
            (
                LSDT_FRAME,
                "        if span.fresh:\n            coder.restart()",
                (
                    "        if not span.fresh:\n"
                    "            coder._tracks[:] = 0\n"
                    "        if span.fresh:\n"
                    "            coder.restart()"
                ),
            ),
        ),
        "tracks",
    ),
    Break(
        "FRAME-05",
        (
            "invalid/lsdt-frame/flags-mean",
            "invalid/lsdt-frame/flags-courses",
        ),
        ((LSDT_FRAME, "if fields.space.flags & (MEAN | COURSES):", "if False:"),),
    ),
    Break(
        "FRAME-06",
        ("valid/lsdt-frame/cosines-apart-prefix",),
        (
            (
                LSDT_FRAME,
                "parse_vectors(stream, indices, self.space.starts, self",
                "parse_vectors(stream, indices, self.space.starts[[0, -1]], self",
            ),
        ),
    ),
    Break(
        "FRAME-07",
        ("valid/lsdt-frame/cosines",),
        ((LSDT_FRAME, '"frame_start.json"', '"window_start.json"'),),
    ),
    Break(
        "FRAME-07",
        ("valid/lsdt-frame/segments-one-on",),
        (
            (
                LSDT_FRAME,
                "            stream,\n            self._models,",
                "            stream,\n            _start_states()[0],",
            ),
        ),
        "left",
    ),
    Break(
        "FRAME-07",
        ("valid/lsdt-frame/segments-fresh",),
        (
            (
                LSDT_FRAME,
                "        self._models = _start_states()[0].copy()",
                (
                    "        self._models = self._models if hasattr(self, '_models') "
                    "else _start_states()[0].copy()"
                ),
            ),
        ),
        "fresh",
    ),
    Break(
        "FRAME-08",
        (
            "valid/lsdt-frame/cosines",
            "valid/lsdt-frame/frames-17",
        ),
        ((FRAMES, "(size - track[SLOW]) >> 4", "(size - track[SLOW]) >> 5"),),
        "slow",
    ),
    Break(
        "FRAME-08",
        ("valid/lsdt-frame/cosines",),
        ((FRAMES, "    if first == 0:\n        remember", "    if True:\n        remember"),),
        "fresh",
    ),
    Break(
        "FRAME-08",
        (
            "valid/lsdt-frame/cosines",
            "valid/lsdt-frame/rows-70",
        ),
        ((FRAMES, "8 * abs(above) + 4 * abs(higher)", "8 * abs(higher) + 4 * abs(above)"),),
        "above",
    ),
    Break(
        "FRAME-08",
        (
            "valid/lsdt-frame/cosines-apart",
            "valid/lsdt-frame/learned-unlike",
        ),
        ((FRAMES, "16 * lengths[max(m - 1, 0)]", "16 * lengths[m]"),),
        "lengths",
    ),
    Break(
        "FRAME-08",
        ("valid/lsdt-frame/cosines-apart",),
        ((FRAMES, "if 0 <= beside < start else 0", "if False else 0"),),
        "beside",
    ),
    Break(
        "FRAME-09",
        (
            "invalid/lsdt-frame/length-minus",
            "invalid/lsdt-frame/length-5",
        ),
        (
            (
                FRAMES,
                (
                    "        if length < 0 or length > stop - start:  # FAULT is far "
                    "below 0\n"
                    "            return 1\n"
                ),
                "        length = min(max(length, 0), stop - start)\n",
            ),
        ),
    ),
    Break(
        "FRAME-10",
        ("invalid/lsdt-frame/byte-0-behind-on",),
        (
            (
                LSDT_FRAME,
                "self._parse(stream, indices, whole=wanted == n_frames)",
                "self._parse(stream, indices, whole=False)",
            ),
        ),
    ),
    Break(
        "FRAME-11",
        ("valid/lsdt-frame/rounding",),
        ((FRAMES, "(sums[j] * step) * weights[c]", "sums[j] * (step * weights[c])"),),
    ),
    Break(
        "FRAME-11",
        (
            "invalid/lsdt-frame/hash-order",
            "valid/lsdt-frame/rounding",
        ),
        (
            (
                FRAMES,
                "for r in range(starts[m], starts[m + 1]):\n            if indices[r]",
                "for r in range(starts[m + 1] - 1, starts[m] - 1, -1):\n            if indices[r]",
            ),
        ),
        "order",
    ),
    Break(
        "LCLIP-01",
        (
            "valid/lsdt-clip/cosines-apart",
            "valid/lsdt-clip/weights",
        ),
        ((LSDT_CLIP, "partial(_windows.decode, NAME)", "partial(_windows.decode, NAME, flags=0)"),),
    ),
    Break(
        "LCLIP-02",
        (
            "invalid/lsdt-clip/flags-mean",
            "invalid/lsdt-clip/flags-courses",
        ),
        (
            (
                LSDT_CLIP,
                "partial(_windows.decode, NAME)",
                "partial(_windows.decode, NAME, flags=15)",
            ),
        ),
    ),
    Break(
        "MDTT-01",
        (
            "valid/mdtt/learned-unlike",
            "valid/mdtt/learned",
        ),
        ((MDTT, "partial(_windows.decode, NAME)", "partial(_windows.decode, NAME, flags=0)"),),
    ),
    Break(
        "MDTT-02",
        (
            "invalid/mdtt/flags-mean",
            "invalid/mdtt/flags-courses",
        ),
        ((MDTT, "partial(_windows.decode, NAME)", "partial(_windows.decode, NAME, flags=15)"),),
    ),
    Break(
        "RDO-01",
        (
            "valid/pca-rdo/all-flags",
            "valid/pca-rdo/mean-apart",
        ),
        ((PCA_RDO, "flags=APART | WEIGHTED | MEAN | COURSES", "flags=MEAN | COURSES"),),
    ),
)
