"""Bits, prefix codes, sparse lists, cosines: what codecs 7 to 11 share."""

from __future__ import annotations

from tests.broken import Break

BITIO = "mcz.coding.bitio"
COSINES = "mcz.transforms.dct"
HUFFMAN = "mcz.coding.huffman"
LISTS = "mcz.codecs._prefix_streams"
LIST_LOOPS = "mcz.codecs._prefix_kernels"

BREAKS: tuple[Break, ...] = (
    Break(
        "BITS-01",
        (
            "valid/lsdt-clip/codes-long",
            "valid/lsdt-clip/cosines-prefix",
        ),
        ((BITIO, "mask = 128 >> (at & 7)", "mask = 1 << (at & 7)"),),
    ),
    Break(
        "BITS-01",
        (
            "valid/lsdt-clip/codes-long",
            "valid/lsdt-clip/cosines-prefix",
        ),
        ((BITIO, "out = out << 1 | bit", "out = out | bit << (n_bits - 1 - shift)"),),
        "numbers",
    ),
    Break(
        "BITS-02",
        (
            "invalid/lsdt-clip/byte-0-behind-prefix",
            "invalid/lsdt-frame/byte-0-behind-prefix",
        ),
        (
            (
                LISTS,
                "if whole and (-(-used // 8) != len(data) or (",
                "if whole and data and (False or (",
            ),
        ),
    ),
    Break(
        "BITS-02",
        (
            "invalid/lsdt-clip/byte-missing-prefix",
            "invalid/lsdt-clip/byte-missing-0-prefix",
        ),
        (
            (LISTS, "if fault >= 0 or used > 8 * len(data):", "if fault >= 0:"),
            (
                LISTS,
                "-(-used // 8) != len(data) or (used % 8 and data[-1] << used % 8 & 255)",
                "-(-used // 8) < len(data)",
            ),
        ),
        "less",
    ),
    Break(
        "BITS-03",
        (
            "invalid/lsdt-clip/padding",
            "invalid/lsdt-clip/padding-last",
        ),
        ((LISTS, "or (used % 8 and data[-1] << used % 8 & 255)", ""),),
    ),
    Break(
        "PREFIX-01",
        (
            "valid/lsdt-clip/sizes-prefix",
            "valid/lsdt-clip/gaps",
        ),
        ((LIST_LOOPS, "(2 | symbol & 1) << more", "(3 - (symbol & 1)) << more"),),
    ),
    Break(
        "PREFIX-01",
        (
            "valid/lsdt-clip/sizes-prefix",
            "valid/lsdt-clip/gaps",
        ),
        ((LIST_LOOPS, "more = (symbol - DIRECT) // 2 + 3", "more = (symbol - DIRECT) // 2 + 2"),),
        "bits",
    ),
    Break(
        "PREFIX-02",
        (
            "valid/lsdt-clip/cosines-prefix",
            "valid/lsdt-clip/codes-long",
        ),
        (
            (
                LIST_LOOPS,
                "table[PLACES, length] + number",
                "table[PLACES, length] + table[COUNTS, length] - 1 - number",
            ),
        ),
    ),
    Break(
        "PREFIX-03",
        (
            "invalid/lsdt-clip/no-gap-code",
            "invalid/lsdt-clip/no-value-class",
        ),
        ((LIST_LOOPS, "    return FAULT\n", "    return 0\n"),),
    ),
    Break(
        "PREFIX-04",
        (
            "invalid/lsdt-clip/gap-sum-less",
            "invalid/lsdt-clip/value-sum-less",
        ),
        ((HUFFMAN, "room != 1 << MAX_LENGTH", "room > 1 << MAX_LENGTH"),),
        "less",
    ),
    Break(
        "PREFIX-04",
        (
            "invalid/lsdt-clip/gap-sum-more",
            "invalid/lsdt-clip/value-sum-more",
        ),
        ((HUFFMAN, "room != 1 << MAX_LENGTH", "room < 1 << MAX_LENGTH"),),
        "more",
    ),
    Break(
        "PREFIX-05",
        (
            "valid/lsdt-clip/codes-none",
            "valid/lsdt-frame/codes-none-of-90",
        ),
        ((HUFFMAN, "([], [1])", "([1],)"),),
        "none",
    ),
    Break(
        "PREFIX-05", ("valid/lsdt-clip/codes-single",), ((HUFFMAN, "([], [1])", "([],)"),), "single"
    ),
    Break(
        "PREFIX-05",
        (
            "invalid/lsdt-clip/gap-single-2",
            "invalid/lsdt-clip/value-single-2",
        ),
        ((HUFFMAN, "used not in ([], [1])", "len(used) > 1"),),
        "single-2",
    ),
    Break(
        "SPARSE-01",
        ("valid/lsdt-clip/cosines-prefix",),
        (
            (
                LIST_LOOPS,
                "row[at] = -size if negative else size",
                "row[at] = size if negative else -size",
            ),
        ),
    ),
    Break(
        "SPARSE-01",
        (
            "valid/lsdt-clip/cosines-prefix",
            "valid/lsdt-clip/frequencies-1-prefix",
        ),
        (
            (
                LIST_LOOPS,
                "count = plain(coder, data, count, bits(n))",
                "count = plain(coder, data, count, bits(n - 1))",
            ),
        ),
        "count",
    ),
    Break(
        "SPARSE-01",
        ("valid/lsdt-clip/cosines-prefix",),
        ((LIST_LOOPS, "        at += 1\n    return 0", "    return 0"),),
        "gaps",
    ),
    Break(
        "SPARSE-02",
        (
            "invalid/lsdt-clip/gap-4",
            "invalid/lsdt-clip/gap-rest",
        ),
        (
            (
                LIST_LOOPS,
                "        if gap < 0 or gap >= n - at:\n            return 1\n",
                "        if gap < 0:\n            return 1\n",
            ),
            (LIST_LOOPS, "max(abs(row[at]) - 1, 0), values)", "0, values)"),
            (
                LIST_LOOPS,
                "1 if row[at] < 0 else 0, 1)\n        row[at] =",
                "0, 1)\n        if at < n:\n            row[at] =",
            ),
        ),
    ),
    Break(
        "SPARSE-03",
        (
            "invalid/lsdt-clip/size-beyond",
            "invalid/lsdt-clip/size-below",
        ),
        ((LIST_LOOPS, "if size < 1 or size > MAX_INDEX:", "if size < 1:"),),
    ),
    Break(
        "COS-01",
        ("valid/lsdt-clip/window-100",),
        (
            (
                COSINES,
                "(np.minimum(m, n - m) * HALF_PI) / n",
                "np.minimum(m, n - m) * (HALF_PI / n)",
            ),
        ),
    ),
    Break(
        "COS-01",
        (
            "valid/lsdt-clip/cosines",
            "valid/lsdt-clip/window-100",
        ),
        (
            (
                COSINES,
                "found: Floats = np.where(2 * m <= n, cosine, x * sine)",
                "found: Floats = np.cos(m * HALF_PI / n)",
            ),
        ),
        "library",
    ),
    Break(
        "COS-01",
        (
            "valid/lsdt-clip/cosines",
            "valid/lsdt-clip/window-100",
        ),
        ((COSINES, "    return root\n", "    return value**0.5\n"),),
        "root",
    ),
)
