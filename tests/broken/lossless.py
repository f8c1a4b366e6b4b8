"""Codec 1: lossless."""

from __future__ import annotations

from tests.broken import Break

BASE = "mcz.codecs.base"
CODEC = "mcz.codecs.lossless"
HEADS = "mcz.codecs._lossless_heads"
KERNELS = "mcz.codecs._lossless_kernels"
PLAN = "mcz.codecs._lossless_plan"
START = "mcz.coding.start"
UNITS = "mcz.codecs._lossless_units"

HEAD: tuple[Break, ...] = (
    Break(
        "LOSS-01",
        ("invalid/lossless/header",),
        ((BASE, "    if header:\n", '    if header and name != "lossless":\n'),),
    ),
    Break(
        "LOSS-02",
        ("invalid/lossless/kind-3",),
        (
            (HEADS, "elif kind & 3 == CONSTANT:", "elif kind & 1 == CONSTANT:"),
            (HEADS, "heads.append((kind & 3, found", "heads.append((kind & 1 or kind & 3, found"),
        ),
    ),
    Break(
        "LOSS-03",
        ("invalid/lossless/copy-bit-2", "invalid/lossless/copy-bit-7"),
        ((HEADS, "elif kind == COPY:", "elif kind & 3 == COPY:"),),
    ),
    Break(
        "LOSS-04",
        ("invalid/lossless/constant-bit-6", "invalid/lossless/constant-bit-7"),
        ((HEADS, "    size = kind >> 2\n", "    size = kind >> 2 & 15\n"),),
    ),
    Break(
        "LOSS-05",
        ("invalid/lossless/taps-9", "invalid/lossless/taps-15"),
        (
            (HEADS, "or len(taps) > MAX_TAPS", "or False"),
            (HEADS, "kind >> 2 & 1, taps), unit, at", "kind >> 2 & 1, taps[:MAX_TAPS]), unit, at"),
        ),
    ),
    Break(
        "LOSS-06",
        ("invalid/lossless/constant-9-bytes",),
        (
            (HEADS, "if size > 8 or at", "if at"),
            (
                HEADS,
                'stream[at : at + size], "little")',
                'stream[at : at + min(size, 8)], "little")',
            ),
        ),
    ),
    Break(
        "LOSS-07",
        ("invalid/lossless/constant-zero", "invalid/lossless/constant-long"),
        ((HEADS, "if size and stream[at + size - 1] == 0:", "if False:"),),
    ),
    Break(
        "LOSS-08",
        ("valid/lossless/constants",),
        (
            (
                CODEC,
                "            columns[:, channel] = found\n",
                "            columns[0, channel] = found\n",
            ),
        ),
    ),
    Break(
        "LOSS-09",
        ("valid/lossless/copy-earlier", "valid/lossless/copy-later"),
        ((CODEC, "columns[:, channel] = source[:, place]", "columns[:, channel] = source[:, 0]"),),
    ),
    Break(
        "LOSS-10",
        ("invalid/lossless/copy-of-no-group", "invalid/lossless/copy-of-no-channel"),
        (
            (
                CODEC,
                "    if not group < len(layout.groups) or not place < len(layout.groups[group]):",
                "    if False:",
            ),
            (
                CODEC,
                "            source, others = self._own(other)\n",
                (
                    "            source, others = self._own(other % len(self.layout.groups))\n"
                    "            place = place % source.shape[1]\n"
                ),
            ),
        ),
    ),
    Break(
        "LOSS-11",
        ("invalid/lossless/copy-of-copy", "invalid/lossless/copy-of-itself"),
        ((CODEC, "if place in others:", "if False:"),),
    ),
    Break(
        "LOSS-12",
        ("invalid/lossless/unit-0", "invalid/lossless/unit-tiny", "invalid/lossless/unit-huge"),
        ((HEADS, "if not 2.0**-200 <= unit <= 2.0**80:", "if False:"),),
    ),
    Break(
        "LOSS-13",
        ("valid/lossless/multiples-ties", "valid/lossless/multiples-subnormal"),
        (
            (
                UNITS,
                '(multiples * np.float64(unit)).astype("<f4")',
                'multiples.astype("<f4") * np.float32(unit)',
            ),
        ),
        "binary32",
    ),
    Break(
        "LOSS-15",
        ("valid/lossless/grid-general", "valid/lossless/grid-text64", "valid/lossless/grid-vax-f"),
        (
            (
                HEADS,
                "form, drop, unit = form_of_grid(grid), 0, None",
                "form, drop, unit = 0, 0, None",
            ),
        ),
    ),
    Break(
        "LOSS-16",
        ("invalid/lossless/form-16", "invalid/lossless/form-87"),
        (
            (HEADS, "1 <= form <= 15 and", "1 <= form <= 16 and"),
            (HEADS, "form in (64 + 24, 64 + 53) and", "form > 66 and"),
        ),
    ),
    Break(
        "LOSS-16",
        ("invalid/lossless/form-63", "invalid/lossless/form-64", "invalid/lossless/form-255"),
        (
            (
                HEADS,
                '    raise FormatError(f"lossless: form {form}, drop {drop}")',
                "    return Lattice(0, 0, drop)",
            ),
        ),
        "plain",
    ),
    Break(
        "LOSS-17",
        ("invalid/lossless/drop-of-plain",),
        ((HEADS, "(form == 0 and drop <= MAX_DROP)", "(form == 0 and drop < 60)"),),
    ),
    Break(
        "LOSS-17",
        ("invalid/lossless/drop-of-decimal", "invalid/lossless/drop-of-multiples"),
        (
            (HEADS, "(form == MULTIPLES and drop == 0)", "form == MULTIPLES"),
            (HEADS, "1 <= form <= 15 and drop == 0:", "1 <= form <= 15:"),
        ),
        "none",
    ),
    Break(
        "LOSS-17",
        ("invalid/lossless/drop-of-binary32", "invalid/lossless/drop-of-binary64"),
        ((HEADS, "drop <= form - 64 - 2:", "drop <= form - 64 - 1:"),),
        "mantissas",
    ),
    Break(
        "LOSS-18",
        (
            "invalid/lossless/top-of-decimal",
            "invalid/lossless/top-of-binary32",
            "invalid/lossless/top-of-binary64",
        ),
        ((HEADS, "(shape.base and top > max_top(shape))", "False"),),
    ),
    Break(
        "LOSS-19",
        ("invalid/lossless/tap-512", "invalid/lossless/tap-minus-512"),
        ((HEADS, "or any(abs(t) > MAX_TAP for t in taps)", "or False"),),
    ),
    Break(
        "LOSS-20",
        ("invalid/lossless/scale-173",),
        ((HEADS, "if scale > MAX_SCALE:", "if False:"),),
    ),
    Break(
        "LOSS-21",
        ("invalid/lossless/constant-and-byte", "invalid/lossless/copy-and-byte"),
        ((CODEC, "        if data:\n", "        if False:\n"),),
    ),
)

BITS: tuple[Break, ...] = (
    Break(
        "LOSS-22",
        ("valid/lossless/grid-fixed",),
        (
            (
                START,
                "probabilities.astype(np.int64) * 256 + 128",
                "probabilities.astype(np.int64) * 256",
            ),
        ),
    ),
    Break(
        "LOSS-22",
        ("valid/lossless/segments", "valid/lossless/groups-joint"),
        (
            (
                CODEC,
                "    state = _start_state().copy()\n    rows",
                "    state = _start_state()\n    rows",
            ),
        ),
        "anew",
    ),
    Break(
        "LOSS-23",
        ("invalid/lossless/byte-behind", "invalid/lossless/bytes-behind"),
        ((CODEC, "if coding.coded_size(state) != len(bits):", "if False:"),),
    ),
    Break(
        "LOSS-24",
        ("valid/lossless/predict-fitted",),
        ((KERNELS, "    total = 16\n", "    total = 0\n"),),
    ),
    Break(
        "LOSS-24",
        ("valid/lossless/predict-eight-taps",),
        ((KERNELS, "range(MAX_TAPS - 1, 0, -1)", "range(MAX_TAPS - 2, 0, -1)"),),
        "differences",
    ),
    Break(
        "LOSS-24",
        ("valid/lossless/predict-clamped",),
        (
            (
                KERNELS,
                "clamp(value - track[LAST], -MAX_DIFFERENCE, MAX_DIFFERENCE)",
                "value - track[LAST]",
            ),
        ),
        "clamp",
    ),
    Break(
        "LOSS-24",
        ("valid/lossless/surprises", "valid/lossless/constants-between"),
        ((KERNELS, "            flow[OTHER] = track[SIDE_1]\n", ""),),
        "other",
    ),
    Break(
        "LOSS-25",
        ("valid/lossless/predict-clamped", "valid/lossless/predict-clamped-below"),
        ((KERNELS, "clamp(predict(plan, track), -MAX_PLAIN, MAX_PLAIN)", "predict(plan, track)"),),
    ),
    Break(
        "LOSS-25",
        ("valid/lossless/form-plain-drop",),
        (
            (
                KERNELS,
                "int(value << plan[DROP]) | number(state, data, ordinal, plan[DROP])",
                "int(value << plan[DROP])",
            ),
        ),
        "drop",
    ),
    Break(
        "LOSS-26",
        ("invalid/lossless/value-beyond", "invalid/lossless/multiple-beyond"),
        ((KERNELS, "predicted + residual < MAX_PLAIN:", "predicted + residual <= MAX_PLAIN:"),),
    ),
    Break(
        "LOSS-26",
        ("invalid/lossless/value-below",),
        ((KERNELS, "not -MAX_PLAIN <= predicted", "not -MAX_PLAIN - 1 <= predicted"),),
        "below",
    ),
    Break(
        "LOSS-27",
        ("valid/lossless/class-creep-general",),
        (
            (
                KERNELS,
                "(mantissa + powers[-shift] // 2) // powers[-shift]",
                "mantissa // powers[-shift]",
            ),
        ),
    ),
    Break(
        "LOSS-27",
        ("valid/lossless/class-signs-binary32", "valid/lossless/class-ends"),
        ((KERNELS, "upper = 0 if under < over else 1", "upper = 0 if under <= over else 1"),),
        "guess",
    ),
    Break(
        "LOSS-27",
        ("valid/lossless/class-signs-general", "valid/lossless/class-signs-binary32"),
        ((KERNELS, "C_MINUS + 16 + (f if inside else 8 + s)", "C_MINUS + 16 + f"),),
        "sign",
    ),
    Break(
        "LOSS-27",
        ("valid/lossless/class-zeros-general", "valid/lossless/class-signs-text64"),
        ((KERNELS, "        return -1 if negative else 0\n", "        return 0\n"),),
        "zero",
    ),
    # A decoder without the bound reads on, from contexts that there are not.
    Break(
        "LOSS-28",
        ("invalid/lossless/class-far",),
        (
            (KERNELS, "    while at <= MAX_STEPS_LENGTH:", "    while at < 999:"),
            (KERNELS, "    if at > MAX_STEPS_LENGTH:\n        return -1\n", ""),
        ),
        crashes=True,
    ),
    Break(
        "LOSS-29",
        ("invalid/lossless/class-beyond",),
        ((KERNELS, "not 0 <= found - shift <= plan[TOP])", "not 0 <= found - shift)"),),
    ),
    Break(
        "LOSS-29",
        ("invalid/lossless/class-below",),
        ((KERNELS, "not 0 <= found - shift <= plan[TOP])", "not found - shift <= plan[TOP])"),),
        "below",
    ),
    Break(
        "LOSS-30",
        ("invalid/lossless/mantissa-beyond",),
        ((KERNELS, "or not low <= guess + residual < low * plan[BASE]", "or False"),),
    ),
)

BREAKS = (*HEAD, *BITS)
