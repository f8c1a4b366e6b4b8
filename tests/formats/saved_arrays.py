"""NPY and NPZ files as NumPy and zipfile write them, made for tests."""

from __future__ import annotations

import io
import zipfile
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from tools.vectors.build.array_files import floats

CODES = ("?", "<i2", ">i4", "<i8", "|u1", "<u8", "<f2", ">f4", "<f4", "<f8", ">f8")


def save_npz(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


@st.composite
def arrays(draw: st.DrawFn) -> Any:
    """An array of any type and order; any bits are numbers."""
    code = draw(st.sampled_from(CODES))
    shape = draw(hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=4))
    dtype = np.dtype(code)
    count = int(np.prod(shape))
    if draw(st.booleans()):
        words = draw(st.lists(st.integers(-99, 99), min_size=count, max_size=count))
        array = (np.array(words, np.float64) / 4).astype(dtype).reshape(shape)
    else:
        size = count * dtype.itemsize
        array = np.frombuffer(draw(st.binary(min_size=size, max_size=size)), dtype).reshape(shape)
    return np.asfortranarray(array) if draw(st.booleans()) else array


@st.composite
def archives(draw: st.DrawFn) -> bytes:
    """An NPZ by zipfile, with options of its own for each member."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.comment = draw(st.sampled_from([b"", b"PK\5\6 is no end", b"x" * 300]))
        names = draw(st.lists(st.text("abc/é", min_size=1, max_size=4), unique=True, max_size=4))
        for name in (*names, "motion"):
            array = floats(3, 2) if name == "motion" else draw(arrays())
            part = io.BytesIO()
            np.save(part, array)
            info = zipfile.ZipInfo(f"{name}.npy", (draw(st.integers(1980, 2100)), 2, 3, 4, 5, 6))
            info.comment = draw(st.binary(max_size=3))
            info.extra = draw(st.sampled_from([b"", b"\xfe\xca\4\0abcd", b"ab"]))
            info.external_attr = draw(st.integers(0, 2**32 - 1))
            method = zipfile.ZIP_DEFLATED if draw(st.booleans()) else zipfile.ZIP_STORED
            info.compress_type = zipfile.ZIP_STORED if name == "motion" else method
            wide = draw(st.booleans())
            with archive.open(info, "w", force_zip64=wide) as file:
                file.write(part.getvalue())
    return buffer.getvalue()
