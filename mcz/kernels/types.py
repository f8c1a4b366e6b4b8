"""Array types of kernels: item and number of axes. The last axis is contiguous, except of columns.

A kernel is compiled for the types that its parameters are annotated with: these, ``int`` (64 bits),
``float`` (64 bits), ``bool``, tuples of numbers, and NamedTuples of all of these.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Ints2 = NDArray[np.int64]
Ints3 = NDArray[np.int64]
Words = NDArray[np.int32]
Words2 = NDArray[np.int32]
IntColumn = NDArray[np.int64]
IntColumns = NDArray[np.int64]  # two axes
Floats = NDArray[np.float64]
Floats2 = NDArray[np.float64]
Floats3 = NDArray[np.float64]
Floats4 = NDArray[np.float64]
FloatColumn = NDArray[np.float64]
FloatColumns = NDArray[np.float64]  # two axes
Bytes = NDArray[np.uint8]
Bytes2 = NDArray[np.uint8]
Flags = NDArray[np.bool_]
Items = NDArray[np.generic]  # numbers or words of any type, as a file or a caller has them
