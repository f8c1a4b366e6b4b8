"""The post filter."""

from __future__ import annotations

from tests.broken import Break

CLI = "mcz.cli.conformance"
FILTER = "mcz.transforms.post_filter"
FILTERING = "mcz.files.filtering"
FILTER_LOOPS = "mcz.transforms._post_filter_kernels"

BREAKS: tuple[Break, ...] = (
    Break(
        "FILT-01",
        (
            "valid/filtered/frames-60",
            "valid/filtered/rate-30",
        ),
        ((CLI, "if given.post_filter and not signal:", "if not signal:"),),
    ),
    Break(
        "FILT-02",
        (
            "valid/filtered/rate-30",
            "valid/filtered/frames-60",
        ),
        (
            (
                FILTER_LOOPS,
                "tap * ((before[c] - middle[c]) + (after[c] - middle[c]))",
                "tap * ((before[c] + after[c]) - 2 * middle[c])",
            ),
        ),
    ),
    Break(
        "FILT-02",
        (
            "valid/filtered/rate-30",
            "valid/filtered/frames-60",
        ),
        (
            (
                FILTER_LOOPS,
                "    for k in range(1, SIDE + 1):\n        before, after",
                "    for k in range(SIDE, 0, -1):\n        before, after",
            ),
        ),
        "sums",
    ),
    Break(
        "FILT-04",
        ("valid/filtered/parts",),
        (
            (
                FILTERING,
                "values, mask = clip.read_masked(None, None, resolution)",
                "values, mask = clip.read_masked(frames, None, resolution)",
            ),
            (FILTERING, "rows = slice(start * per_frame, stop * per_frame)", "rows = slice(None)"),
        ),
    ),
    Break(
        "FILT-05",
        ("valid/filtered/odd-values",),
        ((FILTER_LOOPS, "filtered if abs(middle) < FAR else middle", "filtered"),),
    ),
    Break(
        "FILT-05",
        ("valid/filtered/gaps",),
        (
            (
                FILTERING,
                (
                    "return np.where(mask, filter_rows(np.where(mask, rows, np.nan), "
                    "rate, unit_cm), rows)"
                ),
                "return filter_rows(np.where(mask, rows, np.nan), rate, unit_cm)",
            ),
        ),
        "mask",
    ),
    Break(
        "FILT-05",
        ("valid/filtered/odd-values",),
        ((FILTER_LOOPS, "FAR = 2.0**40", "FAR = np.inf"),),
        "far",
    ),
    Break(
        "FILT-06",
        ("valid/filtered/gaps",),
        ((FILTERING, "filter_rows(np.where(mask, rows, np.nan)", "filter_rows(rows"),),
    ),
    Break(
        "FILT-06",
        (
            "valid/filtered/gaps",
            "valid/filtered/frames-60",
        ),
        (
            (
                FILTER_LOOPS,
                "window[row, c] if inside[c] else patched[nearer, c]",
                "window[row, c] if inside[c] else 0.0",
            ),
        ),
        "ends",
    ),
    Break(
        "FILT-07",
        (
            "valid/filtered/rate-30",
            "valid/filtered/frames-60",
        ),
        ((FILTER, "value / total * SCALE + 0.5", "value / total * SCALE"),),
    ),
    Break(
        "FILT-07",
        (
            "valid/filtered/rate-30",
            "valid/filtered/frames-60",
        ),
        ((FILTER, "total = total + 2.0 * value", "total = 1.0"),),
        "whole",
    ),
    Break(
        "FILT-07",
        ("valid/filtered/two-rows-a-frame",),
        (
            (
                FILTERING,
                "rate.numerator / rate.denominator * per_frame",
                "rate.numerator / rate.denominator",
            ),
        ),
        "rows",
    ),
    Break(
        "FILT-08",
        ("valid/filtered/threshold-low",),
        ((FILTER_LOOPS, "0 if error <= low", "0 if error < low"),),
        "low",
    ),
    Break(
        "FILT-08",
        ("valid/filtered/threshold-high",),
        ((FILTER_LOOPS, "1 if error <= high", "1 if error < high"),),
        "high",
    ),
    Break(
        "FILT-08",
        (
            "valid/filtered/frames-60",
            "valid/filtered/rate-30",
        ),
        ((FILTER_LOOPS, "speed - (past[1, c] - past[2, c])", "0.0"),),
        "past",
    ),
    Break(
        "FILT-08",
        (
            "valid/filtered/frames-60",
            "valid/filtered/rate-30",
        ),
        ((FILTER_LOOPS, "((before + speed)", "((past[0, c] + speed)"),),
        "before",
    ),
    Break(
        "FILT-08",
        (
            "valid/filtered/unit-mm",
            "valid/filtered/unit-inches",
        ),
        ((FILTER, "low, high = (threshold / unit_cm for", "low, high = (threshold for"),),
        "unit",
    ),
)
