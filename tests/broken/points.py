"""Bases and Space: how the channels of codecs 7 to 11 become coefficients."""

from __future__ import annotations

from tests.broken import Break

BASES = "mcz.codecs._bases"
FRAMES = "mcz.coding.frames"
HUFFMAN = "mcz.coding.huffman"
SPACE = "mcz.codecs._space"
WINDOW_LOOPS = "mcz.codecs._window_kernels"

BREAKS: tuple[Break, ...] = (
    Break(
        "BASES-01",
        (
            "invalid/lsdt-clip/bases-byte-behind",
            "invalid/lsdt-clip/bases-byte-0-behind",
        ),
        ((BASES, "whole=True", "whole=False"),),
    ),
    Break(
        "BASES-02",
        ("invalid/lsdt-clip/bases-17-first",),
        (
            (BASES, "if not 1 <= n_bases <= MAX_BASES:", "if not n_bases:"),
            (SPACE, "if len(heads) != n_due:", "if len(heads) < n_due:"),
        ),
    ),
    Break(
        "BASES-03",
        ("invalid/pca-rdo/mean-2049",),
        ((BASES, "<= n_points <= MAX_POINTS or size", "<= n_points or size"),),
    ),
    Break(
        "BASES-04",
        ("invalid/lsdt-clip/bases-vectors-0",),
        (
            (BASES, "if not 1 <= n_vectors <= n_points <=", "if not n_vectors <= n_points <="),
            (BASES, "digits.max() >", "digits.max(initial=0) >"),
        ),
    ),
    Break(
        "BASES-04",
        ("invalid/lsdt-clip/bases-vectors-4",),
        (
            (
                BASES,
                "if not 1 <= n_vectors <= n_points <= MAX_POINTS",
                "if not 1 <= n_vectors or not n_points <= MAX_POINTS",
            ),
        ),
        "more",
    ),
    Break(
        "BASES-05",
        ("invalid/lsdt-clip/bases-shift-41",),
        ((BASES, " or digits.max() > MAX_SHIFT", ""),),
    ),
    Break(
        "BASES-06",
        ("invalid/pca-rdo/bases-entries",),
        (
            (BASES, "<= MAX_POINTS or size > MAX_ENTRIES", "<= MAX_POINTS"),
            (
                BASES,
                "    uncode(\n        data[at:],",
                (
                    "    sum(table.size for table in tables) > MAX_ENTRIES or uncode(\n"
                    "        data[at:],"
                ),
            ),
        ),
    ),
    Break(
        "BASES-07",
        ("valid/lsdt-clip/learned",),
        ((BASES, "(1 << digits) >> (table.shape[1].bit_length() // 2)", "1 << digits"),),
        "scales",
    ),
    Break(
        "BASES-07",
        (
            "valid/lsdt-clip/learned-apart",
            "valid/lsdt-clip/learned-unlike",
        ),
        (
            (
                BASES,
                "    for table, digits in zip(tables, shifts, strict=True):\n",
                (
                    "    start = state[_coder_size() :].copy()\n"
                    "    for table, digits in zip(tables, shifts, strict=True):\n"
                    "        state[_coder_size() :] = start\n"
                ),
            ),
            (
                BASES,
                "def _loop(",
                (
                    "def _coder_size() -> int:\n"
                    "    from mcz.coding import kernels\n"
                    "    return int(kernels.SQUASH)\n"
                    "\n"
                    "\n"
                    "def _loop("
                ),
            ),
        ),
        "restart",
    ),
    Break(
        "BASES-09",
        (
            "uncommon/lsdt-frame/model-missing",
            "uncommon/online/model-missing",
        ),
        ((BASES, 'raise UnsupportedError(f"{codec}: model', 'raise FormatError(f"{codec}: model'),),
    ),
    Break(
        "SPACE-01",
        (
            "valid/lsdt-clip/cosines-apart",
            "valid/lsdt-frame/learned-apart",
        ),
        ((SPACE, "channels.reshape(-1, N_COORDINATES).T", "channels.reshape(N_COORDINATES, -1)"),),
    ),
    Break(
        "SPACE-02",
        (
            "invalid/lsdt-clip/channels-4",
            "invalid/lsdt-frame/channels-4",
        ),
        (
            (SPACE, "if apart and n_channels % N_COORDINATES:", "if False:"),
            (
                SPACE,
                "channels.reshape(-1, N_COORDINATES).T",
                "channels[: n_channels // 3 * 3].reshape(-1, N_COORDINATES).T",
            ),
        ),
    ),
    Break(
        "SPACE-03",
        ("invalid/lsdt-clip/points-2049",),
        ((SPACE, "if n_points > MAX_POINTS:", "if False:"),),
    ),
    Break(
        "SPACE-04",
        (
            "valid/lsdt-clip/cosines",
            "valid/lsdt-clip/cosines-apart",
        ),
        ((SPACE, "[dct_matrix(n_points)] * n_matrices", "[dct_matrix(n_points).T] * n_matrices"),),
    ),
    Break(
        "SPACE-05",
        (
            "valid/lsdt-clip/learned-unlike",
            "valid/lsdt-clip/learned-apart",
        ),
        (
            (
                SPACE,
                "spatial, rest = rest[:n_spatial], rest",
                "spatial, rest = rest[:n_spatial][::-1], rest",
            ),
        ),
    ),
    Break(
        "SPACE-06",
        (
            "invalid/lsdt-clip/model-bases-2",
            "invalid/lsdt-clip/model-bases-4",
        ),
        ((SPACE, "if len(heads) != n_due:", "if len(heads) < n_due:"),),
    ),
    Break(
        "SPACE-06",
        (
            "invalid/pca-rdo/mean-first",
            "valid/pca-rdo/both",
        ),
        (
            (
                SPACE,
                "    courses = rest.pop(0).vectors if fields.flags & COURSES else None\n",
                (
                    "    if fields.flags & COURSES:\n"
                    "        rest.reverse()\n"
                    "    courses = rest.pop(0).vectors if fields.flags & COURSES else None\n"
                ),
            ),
            (
                SPACE,
                "if flags & MEAN and (len(heads[-1].shifts), heads[-1].n_points) !=",
                "if False and (0, 0) !=",
            ),
        ),
        "order",
    ),
    Break(
        "SPACE-07",
        (
            "invalid/lsdt-clip/model-points-5",
            "invalid/lsdt-clip/model-third",
        ),
        (
            (SPACE, "if head.n_points != due:", "if head.n_points < due:"),
            (
                SPACE,
                "[basis.vectors for basis in spatial]",
                "[basis.vectors[:, :n_points] for basis in spatial]",
            ),
        ),
    ),
    Break(
        "SPACE-07",
        (
            "invalid/lsdt-clip/model-points-3",
            "invalid/lsdt-frame/model-points-3",
        ),
        (
            (SPACE, "if head.n_points != due:", "if head.n_points > due:"),
            (
                SPACE,
                "[basis.vectors for basis in spatial]",
                (
                    "[np.pad(basis.vectors, ((0, 0), (0, n_points - "
                    "basis.vectors.shape[1]))) for basis in spatial]"
                ),
            ),
        ),
        "less",
    ),
    Break(
        "SPACE-07",
        (
            "invalid/pca-rdo/mean-5",
            "invalid/pca-rdo/means",
        ),
        ((SPACE, "if flags & MEAN and (", "if False and ("),),
        "mean",
    ),
    Break(
        "SPACE-08",
        (
            "invalid/lsdt-clip/model-kind",
            "invalid/lsdt-frame/model-kind",
        ),
        ((BASES, "if found.kind != BASES:", "if False:"),),
    ),
    Break(
        "SPACE-09",
        (
            "invalid/lsdt-clip/step-0",
            "invalid/lsdt-clip/step-huge",
        ),
        ((SPACE, "lambda obj, ctx: LEAST_STEP <= obj <= GREATEST_STEP", "lambda obj, ctx: True"),),
    ),
    Break(
        "SPACE-10",
        (
            "valid/lsdt-clip/weights",
            "valid/lsdt-frame/weights-apart",
        ),
        ((SPACE, "[ratio_of(code) for", "[2.0 ** (code / 4 - 32) for"),),
    ),
    Break(
        "SPACE-10",
        (
            "valid/lsdt-clip/weights-apart",
            "valid/pca-rdo/all-flags",
        ),
        (
            (
                SPACE,
                "        _weights(name, fields, n_channels),",
                "        _weights(name, fields, n_channels).reshape(columns.shape).T.ravel(),",
            ),
        ),
        "of-points",
    ),
    Break(
        "SPACE-11",
        (
            "invalid/lsdt-clip/weights-more",
            "invalid/lsdt-frame/weights-more",
        ),
        (
            (
                SPACE,
                "if len(fields.weights) != n_channels:",
                "if len(fields.weights) < n_channels:",
            ),
            (SPACE, "for code in fields.weights]", "for code in fields.weights[:n_channels]]"),
        ),
    ),
    Break(
        "SPACE-11",
        (
            "invalid/lsdt-clip/weights-fewer",
            "invalid/lsdt-clip/weights-0",
        ),
        (
            (
                SPACE,
                "if len(fields.weights) != n_channels:",
                "if len(fields.weights) > n_channels:",
            ),
            (
                SPACE,
                "for code in fields.weights]",
                "for code in [*fields.weights, *[128] * n_channels][:n_channels]]",
            ),
        ),
        "fewer",
    ),
    Break(
        "SPACE-12",
        (
            "invalid/lsdt-clip/first-beyond",
            "invalid/lsdt-clip/other-below",
        ),
        ((WINDOW_LOOPS, "if found == FAULT or abs(found) > MAX_INDEX:", "if found == FAULT:"),),
    ),
    Break(
        "SPACE-12",
        (
            "invalid/lsdt-frame/first-below",
            "invalid/lsdt-frame/other-beyond",
        ),
        ((FRAMES, "if found == FAULT or abs(found) > MAX_INDEX:", "if found == FAULT:"),),
        "frames",
    ),
    Break(
        "SPACE-13",
        (
            "invalid/lsdt-clip/gap-length-16",
            "invalid/lsdt-clip/value-length-16",
        ),
        ((HUFFMAN, "MAX_LENGTH = 15", "MAX_LENGTH = 16"),),
    ),
    Break(
        "SPACE-14",
        (
            "invalid/lsdt-clip/gap-lengths-91",
            "invalid/lsdt-clip/value-lengths-91",
        ),
        ((HUFFMAN, "N_CLASSES = 90", "N_CLASSES = 91"),),
    ),
)
