"""Model state shared by encoder and decoder, and its layout.

SPEC.md, "Rows in the metric", is normative; the names below are its names.
"""

from __future__ import annotations

from typing import NamedTuple

from mcz.kernels.types import Flags, Floats, Floats2, Floats3, Ints, Ints2, Ints3

N_LEVELS = 6
MAX_INDEX = 1 << 30
BLOCK = 64  # channels at most that are predicted from one another
LANES = 32  # rows of magnitudes and of values are padded with zeros to a multiple of this

# Features of a channel: magnitudes of coefficients around it.
N_FEATURES = 16
BEFORE_1, BEFORE_2, BEFORE_3, GRAND, PARENT, PARENT_NEXT, PARENT_LAST = range(7)
SIDE_1, SIDE_2, SIDE_3, SIDE_4, ROW, ROW_BEFORE, ROW_PARENT, USUAL, SCALED = range(7, 16)

# Sources of a mean in time: the values of two rows before and of three of the coarser level.
TAP_BEFORE_1, TAP_BEFORE_2, TAP_PARENT, TAP_NEXT, TAP_LAST, N_TAPS = range(6)

# Contexts of opinions, each of 12 slots: is it zero; is its bucket beyond 1, 2 .. 11.
N_SLOTS = 12
N_OPINIONS = 4
N_INPUTS = N_OPINIONS + 1
C_MEAN, C_LEVEL, C_ROWS, N_SHARED = 0, 384, 768, 1280  # the last opinion has contexts by channel
N_OWN = 36
N_SCALES, N_SETS = 16, 64
COUNT_LIMIT = 250
N_CLASSES = 6

# Contexts and mixers in ``coder``, as those of ``coding.mixing``.
C_FLAG, C_SIGN, C_EXTRA, C_ESCAPE, C_EXPONENT = 0, 208, 416, 428, 620
MAX_EXPONENT = 7
N_SMALL = C_EXPONENT + (MAX_EXPONENT + 1) * MAX_EXPONENT  # after them are those of the head
M_FLAG, M_SIGN, N_SMALL_MIXERS = 0, N_LEVELS, 2 * N_LEVELS

# A path through a row, after the means of a block: magnitudes of four channels, their sum; of a
# channel its mean, two sizes, two features; the cost to an encoder.
N_STATES = 8  # of dependent quantization
PATH_SIDE, PATH_TOTAL, PATH_MEAN, PATH_SIZE = BLOCK, BLOCK + 4, BLOCK + 5, BLOCK + 6
PATH_ROW, PATH_SCALED, PATH_COST, N_PATH = BLOCK + 8, BLOCK + 9, BLOCK + 10, BLOCK + 11


class Model(NamedTuple):
    """The state; ``wide`` is the number of channels rounded up to ``LANES``, one to spare.

    ``coder`` is a state of ``coding.mixing``. ``slots`` are the contexts of opinions, p << 8 | n
    each; ``weights`` (sets, slots, inputs), one set for each channel after the shared ones;
    ``second`` (scales, slots, 33). ``at`` and ``inputs`` describe one decision. ``columns``
    (blocks, 64, 64), ``variances`` (blocks, 64) and ``seen``, how many rows they know, are the
    prediction across channels, ``taps`` (2 levels, 5) and ``tap_energy`` that in time;
    ``level_weights`` (levels, 16) and ``own_weights`` (16, wide) predict magnitudes. ``paths`` (2,
    states, ``N_PATH``) are those before and after a channel, ``ways`` (n, states, 3) lead to them
    in an encoder. The others are tables and scratch space.
    """

    coder: Ints
    classes: Ints
    slots: Ints
    weights: Ints3
    second: Ints3
    at: Ints
    inputs: Ints
    stretch: Ints
    squash: Ints
    rates: Ints
    trust: Ints
    logs: Ints
    costs: Ints
    columns: Floats3
    variances: Floats2
    seen: Floats
    paths: Floats3
    ways: Ints3
    taps: Floats2
    tap_energy: Floats2
    timely: Floats
    sources: Floats2
    level_weights: Floats2
    own_weights: Floats2
    features: Floats2
    sizes: Floats2


class LevelRows(NamedTuple):
    """The rows of a level: ``q`` (rows, n), twice the values, in steps.

    ``y`` (rows, n) is what an encoder quantizes. ``here`` (3 + rows, 2 wide) are magnitudes and
    values, which ``code_rows`` writes after three rows of zeros; ``parent`` and ``grand`` those of
    the two coarser levels, without their rows of zeros, or one row of zeros. ``exponents`` (rows,):
    the step of a row is that of the level times 2^-s. An encoder does not choose rows that are
    ``is_kept`` (rows,): ``q`` has them.
    """

    q: Ints2
    y: Floats2
    here: Floats2
    parent: Floats2
    grand: Floats2
    exponents: Ints
    is_kept: Flags
