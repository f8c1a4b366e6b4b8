"""Motions for other libraries: NPZ that needs no MCZ, xarray and pandas.

xarray and pandas are imported on first use.
"""

from __future__ import annotations

from mcz.files.tables.labelled import to_pandas, to_xarray

__all__ = ["to_pandas", "to_xarray"]
