"""Figures printed by Kwak and Bajic, sections III and V.

C.-H. Kwak, I. V. Bajic, Online MoCap data coding with bit allocation, rate control, and
motion-adaptive post-processing.
"""

from __future__ import annotations

TARGETS = (3.0, 4.0, 5.0, 6.0, 7.0)  # kbps

# Table III, against MOD: dB and percent of RC, RCA, FIL.
BD = {
    "13_29": ((3.24, 5.44, 7.35), (-19.96, -35.45, -44.16)),
    "85_12": ((2.04, 3.47, 5.42), (-18.39, -29.51, -41.21)),
    "86_02": ((2.45, 4.61, 6.49), (-8.41, -21.38, -34.31)),
    "86_08": ((3.94, 6.12, 8.02), (-17.79, -30.53, -40.22)),
}
METHODS = ("RC", "RCA", "FIL")  # their order there

# Tables IV and V, markers, and VIII and IX, skeletons: kbps asked for, of RC, of RCA.
RATES = {
    (True, "13_29"): (
        *((2.98, 3.0, 3.0), (4.01, 4.03, 4.02), (5.05, 5.05, 5.04)),
        *((5.99, 6.0, 6.0), (6.99, 7.0, 7.0)),
    ),
    (True, "85_12"): (
        *((3.0, 3.01, 3.01), (3.98, 3.99, 3.98), (5.0, 5.01, 5.01)),
        *((5.98, 5.99, 5.99), (7.02, 7.02, 7.03)),
    ),
    (False, "85_12"): (
        *((3.0, 3.0, 3.0), (4.0, 4.0, 4.0), (5.0, 5.0, 5.0), (6.0, 6.0, 6.0), (7.0, 7.0, 6.99)),
    ),
    (False, "17_10"): (
        *((3.0, 3.01, 3.02), (4.0, 4.01, 4.01), (5.0, 5.0, 5.0), (6.0, 6.0, 6.0)),
        (7.0, 7.0, 6.99),
    ),
}

# Tables VI, markers, and X, skeletons: deviation of bytes a group of MOD, RC, RCA.
DEVIATIONS = {
    (True, "13_29"): (42.5, 12.9, 14.5),
    (True, "85_12"): (50.4, 10.4, 9.7),
    (True, "86_02"): (60.3, 10.8, 13.1),
    (True, "86_08"): (51.5, 9.3, 10.4),
    (False, "85_12"): (51.7, 11.9, 12.4),
    (False, "17_08"): (24.9, 10.5, 9.3),
    (False, "17_10"): (30.4, 11.9, 12.6),
    (False, "15_04"): (56.7, 16.6, 13.9),
}

# a and b of eq. 14 as printed, for markers and for points of a skeleton; those of our preset are
# fitted to our coder.
PRINTED_FITS = {"c3d": (-0.4121, 3.2745), "bvh": (0.05, 2.0492)}

MOST_OFF = 1.0  # percent of a rate
RCA_SAVES, FIL_SAVES = (10.0, 15.0), (9.0, 13.0)  # percent of bits
VIRTUAL_COST = (1.5, 2.0)  # of bytes with virtual markers to bytes without
ENCODE_MS, DECODE_MS = 14.0, 11.0  # a frame


def usual_deviation(markers: bool, column: int) -> float:
    """The mean of a column, for clips that the paper does not have."""
    found = [row[column] for (of, _), row in DEVIATIONS.items() if of == markers]
    return sum(found) / len(found)
