"""Codecs in general, raw, and what codecs share: range coder, residuals."""

from __future__ import annotations

from tests.broken import Break

BASE = "mcz.codecs.base"
CODECS = "mcz.codecs"
COMPONENTS = "mcz.codecs._pca_kernels"
KERNELS = "mcz.coding.kernels"
LOGISTIC = "mcz.coding.logistic"
LOSSLESS = "mcz.codecs.lossless"
RAW = "mcz.codecs.raw"
RESIDUALS = "mcz.coding.residuals"
SIGNALS = "mcz.files.signals"
SYNTHESIS = "mcz.transforms._dwt_kernels"
WAVELETS = "mcz.codecs._wavelet_codec"

ADD = "out[f, c] = out[f, c] + y * basis[i, c]"

GENERAL: tuple[Break, ...] = (
    Break(
        "CODEC-01",
        ("invalid/mrdwt/integers", "invalid/qbc/integers", "invalid/pca/integers"),
        ((SIGNALS, 'if self.info.codec.domain == "values":', "if False:"),),
    ),
    Break(
        "CODEC-02",
        ("valid/pca/rounding",),
        (
            (
                COMPONENTS,
                ADD,
                (
                    "exact = [Fraction(float(x)) for x in (y, basis[i, c], out[f, c])]\n"
                    "                out[f, c] = float(exact[0] * exact[1] + exact[2])"
                ),
            ),
            (
                COMPONENTS,
                "import numpy as np\n",
                "from fractions import Fraction\nimport numpy as np\n",
            ),
        ),
        "fused",
    ),
    Break(
        "CODEC-02",
        ("valid/mrdwt/inline-subnormal",),
        (
            (
                SYNTHESIS,
                "out[n - start, c] + tap * approx[k - first, c]",
                (
                    "out[n - start, c] + tap * approx[k - first, c]\n"
                    "                if abs(out[n - start, c]) < 2.0**-1022:\n"
                    "                    out[n - start, c] = 0.0"
                ),
            ),
        ),
        "subnormals",
    ),
    Break(
        "CODEC-02",
        ("valid/pca/rounding",),
        ((COMPONENTS, ADD, ADD.replace("y *", "np.longdouble(y) *")),),
        "extended",
    ),
    Break(
        "CODEC-03",
        ("uncommon/container/unknown-codec",),
        (
            (
                CODECS,
                'raise UnsupportedError(f"codec {id_} is unknown")',
                "codec = raw.CODEC",
            ),
        ),
    ),
    Break(
        "CODEC-04",
        ("uncommon/container/newer-codec", "uncommon/lossless/newer-version"),
        ((CODECS, "if version > codec.version:", "if False:"),),
    ),
    Break(
        "CODEC-05",
        ("invalid/mrdwt/header-and-byte", "invalid/dwt/header-and-byte"),
        (
            (
                WAVELETS,
                'parse(WAVELET_HEADER, header, f"{name} header")\n        self.name',
                "WAVELET_HEADER.parse(header)\n        self.name",
            ),
        ),
    ),
    Break(
        "CODEC-05",
        (
            "invalid/mrdwt/frames-0-header",
            "invalid/qbc/frames-0-resolutions",
            "invalid/lsdt-clip/frames-0-model",
            "uncommon/container/frames-0-model-missing",
        ),
        ((SIGNALS, "if start == stop:", "if False:"),),
        "frames-0",
    ),
    Break(
        "RAW-01",
        ("invalid/clip/codec-header",),
        ((BASE, "    if header:\n", '    if header and name != "raw":\n'),),
    ),
    Break(
        "RAW-02",
        ("invalid/raw/width-9-zeros",),
        (
            (RAW, "if width > 8:", "if False:"),
            (RAW, "np.zeros((n_rows, 8)", "np.zeros((n_rows, max(8, width))"),
            (RAW, 'offsets.view("<u8")', 'offsets[:, :8].copy().view("<u8")'),
        ),
    ),
    Break(
        "RAW-03",
        ("valid/raw/wrapping",),
        (
            (
                RAW,
                '(offsets.view("<u8")[:, 0] + np.uint64(least)).view(np.int64)',
                (
                    'np.clip(offsets.view("<u8")[:, 0] + float(np.uint64(least).view(np.int64)), '
                    "-(2.0**63), 2.0**63 - 1024).astype(np.int64)"
                ),
            ),
        ),
    ),
    Break(
        "RAW-04",
        ("invalid/raw/too-long",),
        ((RAW, "    if at != len(stream):\n", "    if False:\n"),),
    ),
    Break(
        "RAW-04",
        ("invalid/raw/zero-missing",),
        (
            (RAW, "if at + size > len(stream):", "if False:"),
            (
                RAW,
                'np.frombuffer(stream, "u1", size, at)',
                'np.frombuffer(stream.ljust(at + size, b"\\0"), "u1", size, at)',
            ),
            (RAW, "    if at != len(stream):\n", "    if at < len(stream):\n"),
        ),
        "short",
    ),
)

CODER: tuple[Break, ...] = (
    Break(
        "RANGE-01",
        ("valid/lossless/grid-fixed", "valid/mrdwt/scaled"),
        (
            (
                KERNELS,
                "((width & 0xFFFF) * one >> 16)",
                "0",
            ),
        ),
    ),
    Break(
        "RANGE-01",
        ("valid/lossless/grid-fixed",),
        ((KERNELS, "1 if state[CODE] <= middle else 0", "1 if state[CODE] < middle else 0"),),
        "edge",
    ),
    Break(
        "RANGE-02",
        ("valid/lossless/no-bits", "valid/lossless/grid-text64"),
        ((KERNELS, "if at < len(data) else 0", "if at < len(data) else 255"),),
    ),
    Break(
        "RANGE-03",
        ("valid/lossless/residuals-large", "valid/qbc/firsts"),
        (
            (
                KERNELS,
                "out = out << 1 | code(state, data, value >> shift & 1, 32768)",
                "out |= code(state, data, 0, 32768) << (n_bits - 1 - shift)",
            ),
        ),
    ),
    Break(
        "RANGE-04",
        ("invalid/lossless/byte-0-behind", "invalid/mrdwt/approximation-byte-0-behind"),
        (
            (
                LOSSLESS,
                "if coding.coded_size(state) != len(bits):",
                "if coding.coded_size(state) > len(bits):",
            ),
            (
                "mcz.coding.streams",
                "_coder().coded_size(state) != len(data):",
                "_coder().coded_size(state) > len(data):",
            ),
        ),
    ),
    Break(
        "RANGE-04",
        ("valid/lossless/no-bits",),
        ((KERNELS, "    for size in range(4):\n", "    for size in range(1, 4):\n"),),
        "none",
    ),
    Break(
        "RANGE-05",
        ("valid/lossless/grid-fixed", "valid/mrdwt/scaled"),
        ((KERNELS, "((change + 8192) >> 14)", "(change >> 14)"),),
    ),
    Break(
        "RANGE-05",
        ("valid/lossless/long-classes", "valid/lossless/form-decimal-1"),
        ((LOGISTIC, "COUNT_LIMIT = 250", "COUNT_LIMIT = 249"),),
        "count",
    ),
    Break(
        "RANGE-05",
        ("valid/lossless/grid-fixed", "valid/qbc/noise"),
        ((LOGISTIC, "40793, 47911", "40794, 47911"),),
        "nodes",
    ),
    Break(
        "RANGE-05",
        ("valid/lossless/grid-fixed", "valid/lossless/noise"),
        ((LOGISTIC, "16 * np.arange(4096) + 8", "16 * np.arange(4096)"),),
        "stretch",
    ),
    Break(
        "RANGE-06",
        ("valid/online/constant",),
        ((KERNELS, "LEAST_ONE = 32", "LEAST_ONE = 16"),),
    ),
    Break(
        "RESID-01",
        ("valid/lossless/residuals-small", "valid/mrdwt/scaled"),
        ((RESIDUALS, "at + 64 + 4 * s + qs", "at + 64 + 4 * f + qs"),),
    ),
    Break(
        "RESID-01",
        ("valid/lossless/residuals-middle", "valid/qbc/noise"),
        ((RESIDUALS, "at + 128 + 8 * s + 2 * qs", "at + 128 + 8 * s + 2 * qf"),),
        "third",
    ),
    Break(
        "RESID-01",
        ("valid/lossless/grid-fixed", "valid/lossless/surprises"),
        ((RESIDUALS, "(1 if bf > bs else 0)", "(1 if bf >= bs else 0)"),),
        "more",
    ),
    Break(
        "RESID-01",
        ("valid/lossless/residuals-large",),
        ((RESIDUALS, "min(base - at, 15)", "min(base - at, 14)"),),
        "less",
    ),
    Break(
        "RESID-01",
        ("valid/lossless/residuals-large",),
        ((RESIDUALS, "(n - 1) & 3), 111)", "(n - 1) & 3), 159)"),),
        "quarters",
    ),
    # A decoder without the bound would go on: behind the end of the data all bits are 1.
    Break(
        "RESID-02",
        ("invalid/lossless/length-61", "invalid/mrdwt/detail-of-0"),
        (
            (RESIDUALS, "    while at <= 60:\n", "    while at <= 999:\n"),
            (
                RESIDUALS,
                "        at += 1\n    return -1",
                '        at += 1\n    raise RecursionError("no end")',
            ),
        ),
        crashes=True,
    ),
)

BREAKS = (*GENERAL, *CODER)
