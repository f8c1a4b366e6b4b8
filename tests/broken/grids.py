"""Number grids: their structure, ordinals to values and to text, tokens."""

from __future__ import annotations

from tests.broken import Break

CELLS = "mcz.formats.cells"
GRID = "mcz.numbers.grid"
KERNELS = "mcz.numbers.kernels"
MAGNITUDES = "mcz.numbers.magnitudes"
RULES = "mcz.numbers.rules"
SIGNAL = "mcz.files.signal_info"
SIGNALS = "mcz.files.signals"
TEXTGRIDS = "mcz.numbers.textgrids"
TOKENS = "mcz.numbers.tokens"
STYLE = "valid/sources/bvh-style-"

STRUCTURE: tuple[Break, ...] = (
    Break(
        "GRID-01",
        ("invalid/numbers/kind-0", "invalid/numbers/kind-11"),
        (
            (
                GRID,
                "return Grid(obj.kind, obj.digits,",
                "return Grid(min(max(obj.kind, 1), 10), obj.digits,",
            ),
        ),
    ),
    Break(
        "GRID-02",
        (
            "invalid/numbers/text32-digits",
            "invalid/numbers/text64-2-digits",
            "invalid/numbers/integer-digits",
        ),
        ((RULES, "    if digits not in allowed:\n", "    if False:\n"),),
    ),
    Break(
        "GRID-03",
        (
            "invalid/numbers/binary-flags",
            "invalid/numbers/fixed-upper",
            "invalid/numbers/trimmed-exponent",
        ),
        ((RULES, "if flags & ~style or any(", "if any("),),
        "kinds",
    ),
    Break(
        "GRID-03",
        ("invalid/numbers/fixed-point", "invalid/numbers/fixed-no-zero"),
        ((RULES, "if kind == GridKind.FIXED and flags & (", "if kind == 0 and flags & ("),),
        "fixed",
    ),
    Break(
        "GRID-03",
        ("invalid/numbers/text64-fixed-flags",),
        ((RULES, "digits >= FIXED_TEXT and flags:", "digits >= 256 and flags:"),),
        "text64",
    ),
    Break(
        "GRID-04",
        ("invalid/numbers/scale-huge", "invalid/numbers/scale-tiny"),
        ((RULES, "MIN_SCALE <= scale <= MAX_SCALE if", "scale > 0 if"),),
    ),
    Break(
        "GRID-05",
        tuple(f"invalid/numbers/ordinal-of-{kind}" for kind in ("fixed", "general", "integer")),
        (
            (
                GRID,
                "if ordinals.size and not (low <= ordinals.min() and ordinals.max() <= limit):",
                "if False:",
            ),
        ),
    ),
    Break(
        "GRID-06",
        ("invalid/numbers/point-twice", "invalid/numbers/exponent-twice"),
        ((RULES, " or any(flags & both == both for both in _CLASHES):", ":"),),
    ),
    Break(
        "GRID-06",
        ("invalid/numbers/flag-128",),
        ((RULES, "if flags & ~style or", "if flags & ~style & 127 or"),),
        "128",
    ),
)

VALUES: tuple[Break, ...] = (
    Break(
        "GRID-07",
        ("uncommon/container/grids-without-text",),
        (
            (
                CELLS,
                "            grid = SHORTEST\n",
                '            raise FormatError("a grid without text")\n',
            ),
        ),
    ),
    Break(
        "GRID-08",
        ("valid/numbers/fixed-4-quotients", "valid/numbers/fixed-17-quotients"),
        (
            (
                GRID,
                "np.divide(magnitudes, TENS[self.digits])",
                "np.multiply(magnitudes, 1 / TENS[self.digits])",
            ),
        ),
    ),
    Break(
        "GRID-09",
        ("valid/numbers/text32",),
        (
            (
                TEXTGRIDS,
                "values = np.array([float(str(value)) for",
                "values = np.array([float(value) for",
            ),
        ),
        "text32",
    ),
    Break(
        "GRID-09",
        ("valid/numbers/vax-f", "valid/numbers/vax-f-reserved"),
        ((MAGNITUDES, "return np.where(exponent == 0, 0.0, values)", "return values"),),
        "vax",
    ),
    Break(
        "GRID-09",
        ("valid/numbers/general", "valid/numbers/general-15-digits"),
        ((MAGNITUDES, "power + (MIN_POWER + 1 - digits)", "power + (MIN_POWER + 2 - digits)"),),
        "general",
    ),
    Break(
        "GRID-09",
        ("valid/numbers/fixed", "valid/numbers/text64"),
        (
            (
                GRID,
                "np.negative(values, where=negative & (values == values), out=values)",
                "np.negative(values, where=negative & (values != 0), out=values)",
            ),
        ),
        "minus-zero",
    ),
    Break(
        "GRID-10",
        ("valid/numbers/integers-among-others",),
        (
            (
                SIGNAL,
                "bool(self.grids) and all(grid.kind == GridKind.INTEGER",
                "bool(self.grids) and any(grid.kind == GridKind.INTEGER",
            ),
        ),
        "any",
    ),
    Break(
        "GRID-10",
        ("valid/numbers/integer", "valid/raw/two-signals"),
        (
            (
                SIGNAL,
                "return bool(self.grids) and all(grid.kind == GridKind.INTEGER for",
                "return False and all(grid.kind == GridKind.INTEGER for",
            ),
        ),
        "none",
    ),
)

TEXTS: tuple[Break, ...] = (
    Break(
        "GRID-11",
        ("valid/sources/bvh-lossy-near",),
        (
            (
                MAGNITUDES,
                "return np.rint(np.minimum(scaled, float(limit))).astype(np.int64)",
                "return np.minimum(scaled, float(limit)).astype(np.int64)",
            ),
        ),
    ),
    Break(
        "GRID-11",
        ("valid/sources/bvh-lossy-general-below",),
        ((MAGNITUDES, "power -= values < _POWERS[power - _LEAST_POWER]", "pass"),),
        "logarithm",
    ),
    Break(
        "TEXT-01",
        (f"{STYLE}upper", f"{STYLE}exponent1"),
        (
            (
                TEXTGRIDS,
                "return digits, -4, digits\n        case GridKind.TEXT32",
                "return digits, -5, digits\n        case GridKind.TEXT32",
            ),
        ),
        "low",
    ),
    Break(
        "TEXT-01",
        (f"{STYLE}python", f"{STYLE}shortest"),
        ((TEXTGRIDS, "else (17, -4, 16)", "else (17, -4, 17)"),),
        "high",
    ),
    Break(
        "TEXT-01",
        (f"{STYLE}javascript",),
        ((TEXTGRIDS, "return (17, -6, 21) if", "return (17, -7, 21) if"),),
        "javascript",
    ),
    Break(
        "TEXT-01",
        (f"{STYLE}no-zero", f"{STYLE}trimmed-no-zero"),
        ((KERNELS, "0 if flags & _NO_ZERO and fraction > 0 else 1", "1"),),
        "no-zero",
    ),
    Break(
        "TEXT-01",
        (f"{STYLE}plus", f"{STYLE}every-flag"),
        ((KERNELS, "if negative[i] or flags & _PLUS:", "if negative[i]:"),),
        "plus",
    ),
    Break(
        "TEXT-01",
        (f"{STYLE}point", f"{STYLE}trimmed-point"),
        ((KERNELS, "if flags & (_POINT_ZERO | _POINT_ONLY):", "if flags & _POINT_ZERO:"),),
        "point",
    ),
    Break(
        "TEXT-01",
        (f"{STYLE}exponent3-upper",),
        (
            (
                KERNELS,
                "    power = abs(power)\n    width = 3 if flags & _EXP3 or power",
                "    power = abs(power)\n    width = 3 if power",
            ),
        ),
        "exponent3",
    ),
    Break(
        "TEXT-01",
        (f"{STYLE}20f",),
        (
            (
                TEXTGRIDS,
                "kind == GridKind.TEXT64 and digits >= FIXED_TEXT:\n        return _joined",
                "kind == GridKind.TEXT64 and digits >= 256:\n        return _joined",
            ),
        ),
        "decimals",
        crashes=True,
    ),
    Break(
        "TEXT-03",
        ("valid/notes/tokens-ends",),
        (
            (
                TOKENS,
                "np.negative(out, where=(shape & loops.MINUS) != 0, out=out)",
                "np.negative(out, where=((shape & loops.MINUS) != 0) & (out != 0), out=out)",
            ),
        ),
        "minus-zero",
    ),
    Break(
        "TEXT-03",
        ("valid/notes/tokens-ends",),
        ((TOKENS, "slow |= (odd & loops.LONG) != 0", "slow &= (odd & loops.LONG) == 0"),),
        "long",
    ),
    Break(
        "TEXT-04",
        ("valid/notes/tokens-words",),
        ((TOKENS, "[-+]?(inf(inity)?|\\d\\.#inf\\d*)", "[-+]?inf(inity)?"),),
        "infinities",
    ),
    Break(
        "TEXT-04",
        ("valid/notes/tokens-words",),
        ((TOKENS, "(q?nan|snan|ind)", "(q?nan|ind)"),),
        "NaN",
    ),
    Break(
        "TEXT-04",
        ("valid/notes/tokens-words", "valid/notes/exceptions"),
        ((TOKENS, 'float("-inf" if text[:1] == b"-" else "inf")', 'float("inf")'),),
        "signs",
    ),
    Break(
        "TEXT-05",
        ("invalid/notes/spelling-blank", "invalid/notes/spelling-blank-behind"),
        (
            (
                SIGNALS,
                "values, bad = values_of_texts(texts)",
                "values, bad = values_of_texts([text.strip() for text in texts])",
            ),
        ),
        "blanks",
    ),
    Break(
        "TEXT-05",
        ("invalid/notes/spelling-underscore", "invalid/notes/spelling-comma"),
        (
            (
                SIGNALS,
                "values, bad = values_of_texts(texts)",
                (
                    'marks = bytes.maketrans(b",", b".")\n'
                    '    plain = [text.replace(b"_", b"").translate(marks) for text in texts]\n'
                    "    values, bad = values_of_texts(plain)"
                ),
            ),
        ),
        "marks",
    ),
    Break(
        "TEXT-05",
        ("invalid/notes/spelling-exponent", "invalid/notes/spelling-exponent-sign"),
        ((KERNELS, "if digits == 0 or at < end:", "if at < end:"),),
        "exponent",
    ),
)

BREAKS: tuple[Break, ...] = (*STRUCTURE, *VALUES, *TEXTS)
