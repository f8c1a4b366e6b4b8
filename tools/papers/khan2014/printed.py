"""Figures printed in Khan 2014 and Khan 2017, as far as the tables compare them with ours."""

from __future__ import annotations

# Khan 2014, Table 4: bytes of the .amc (bits / 8); parameter, its value, MSE, CR of each codec.
BYTES_2014 = {"38_01": 280861, "10_03": 288143, "05_01": 479866, "143_37": 438386}
KHAN_2014: dict[str, dict[str, tuple[str, int, float, float]]] = {
    "38_01": {
        "pca": ("q", 13, 0.346, 12.59),
        "dwt": ("t_w", 4, 0.334, 31.35),
        "awt": ("a_w", 39, 0.341, 23.62),
        "qbc": ("d2_lmt", 7, 0.329, 37.94),
    },
    "10_03": {
        "pca": ("q", 22, 0.258, 7.919),
        "dwt": ("t_w", 3, 0.266, 24.88),
        "awt": ("a_w", 53, 0.259, 18.46),
        "qbc": ("d2_lmt", 5, 0.255, 26.60),
    },
    "05_01": {
        "pca": ("q", 13, 1.042, 14.37),
        "dwt": ("t_w", 15, 1.085, 47.84),
        "awt": ("a_w", 41, 1.046, 41.71),
        "qbc": ("d2_lmt", 24, 1.087, 67.07),
    },
    "143_37": {
        "pca": ("q", 17, 1.415, 10.85),
        "dwt": ("t_w", 15, 1.419, 43.09),
        "awt": ("a_w", 38, 1.517, 40.90),
        "qbc": ("d2_lmt", 28, 1.406, 59.41),
    },
}
# Khan 2014's DWT as its author's program computes it: clip -> threshold -> MSE.
DWT_2014 = {
    "10_03": {
        3: 0.265,
        6: 0.595,
        9: 0.966,
        12: 1.278,
        15: 1.68,
        18: 1.974,
        21: 2.283,
        24: 2.588,
        27: 2.76,
    },
    "05_01": {15: 1.0857},
}
QBC_2014 = {"10_03": (5, 0.2552), "05_01": (24, 1.0875)}  # the same of its QBC: limit, MSE

# Khan 2017, text and Table III: clip -> codec -> (MSE, CR).
KHAN_2017: dict[str, dict[str, tuple[float, float]]] = {
    "10_03": {"qbc": (1.0, 45.0)},  # "more than 45 at an MSE below 1"
    "05_01": {"qbc": (1.0, 64.0)},  # "64 at an MSE below 1"
    "143_37": {
        "pca": (1.4155, 10.855),
        "dwt": (1.4196, 42.975),
        "qbc": (1.4065, 58.9308),
    },
}
