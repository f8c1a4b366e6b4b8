"""Lossless codecs of number grids."""
