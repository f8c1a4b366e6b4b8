"""The tables of ``requirements`` for lossless codecs, wavelet, qbc, pca, and what they share."""

from __future__ import annotations

VECTORS: dict[str, tuple[str, ...]] = {
    "CODEC-02": ("valid/random/*",),
    "CODEC-03": ("uncommon/container/*-codec",),
    "CODEC-04": ("uncommon/container/newer-codec",),
}

ARGUED: dict[str, str] = {
    "WAVE-03": "Adding zeros gives the same bits, as the text says: every sum begins with +0.",
}
