"""Frames in a basis of space: lsdt-clip, lsdt-frame, mdtt and pca-rdo."""
