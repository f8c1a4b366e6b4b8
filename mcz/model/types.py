"""Names of the types that travel between the parts of the package."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from typing import Any, BinaryIO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mcz.kernels.types import Items as Items

Ints: TypeAlias = NDArray[np.int64]
Floats: TypeAlias = NDArray[np.float64]
Bools: TypeAlias = NDArray[np.bool_]

Values: TypeAlias = NDArray[np.float64 | np.int64]
"""Values of a signal: binary64, or int64 if grids are of integers."""

Reals: TypeAlias = NDArray[np.floating]
"""Poses and positions as float64 or float32, as the caller chooses."""

Params: TypeAlias = Mapping[str, Any]
"""Parameters of a codec by name; its table of parameters has their types."""

JsonObject: TypeAlias = dict[str, Any]
"""An object of JSON, as printed by ``--json``."""

Settings: TypeAlias = dict[str, Any]
"""Parameters or options by name, while they are collected."""

Progress: TypeAlias = Callable[[int, int, str], None]
"""A listener to long work: amount done, total, and a name."""

Target: TypeAlias = str | PathLike[str] | bytes | BinaryIO
"""A file: a path, an address for fsspec, its bytes, or a stream."""
