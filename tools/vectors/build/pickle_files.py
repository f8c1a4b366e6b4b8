"""Pickles to order, of protocol 4 and of joblib: opcode by opcode, since writers change theirs."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

ALIGNMENT = 16


def text(word: str) -> bytes:
    """SHORT_BINUNICODE."""
    data = word.encode()
    return b"\x8c" + bytes((len(data),)) + data


def integer(number: int) -> bytes:
    """BININT1, BININT2 or BININT."""
    if 0 <= number < 2**8:
        return b"K" + struct.pack("<B", number)
    return (
        b"M" + struct.pack("<H", number)
        if 0 <= number < 2**16
        else b"J" + struct.pack("<i", number)
    )


def tuple_of(*items: bytes) -> bytes:
    return b"(" + b"".join(items) + b"t"


def name(module: str, word: str) -> bytes:
    """STACK_GLOBAL."""
    return text(module) + text(word) + b"\x93"


def sized(data: bytes) -> bytes:
    """SHORT_BINBYTES or BINBYTES."""
    if len(data) < 256:
        return b"C" + bytes((len(data),)) + data
    return b"B" + struct.pack("<I", len(data)) + data


def dtype(array: NDArray[Any]) -> bytes:
    """The type of an array, which BUILD gives its byte order."""
    order = array.dtype.str[0]
    made = name("numpy", "dtype") + tuple_of(text(array.dtype.str[1:]), b"\x89", b"\x88") + b"R"
    rest = [integer(-1), integer(-1), integer(0)]
    return made + tuple_of(integer(3), text(order), b"N", b"N", b"N", *rest) + b"b"


def shape(array: NDArray[Any]) -> bytes:
    return tuple_of(*map(integer, array.shape))


def content(array: NDArray[Any], *, is_fortran: bool = False) -> bytes:
    return array.tobytes(order="F" if is_fortran else "C")


def plain_array(array: NDArray[Any], *, is_fortran: bool = False) -> bytes:
    """An array as NumPy pickles it."""
    made = name("numpy._core.multiarray", "_reconstruct") + tuple_of(
        name("numpy", "ndarray"), tuple_of(integer(0)), sized(b"b")
    )
    flag = b"\x88" if is_fortran else b"\x89"
    data = sized(content(array, is_fortran=is_fortran))
    return made + b"R" + tuple_of(integer(1), shape(array), dtype(array), flag, data) + b"b"


def buffer_array(array: NDArray[Any]) -> bytes:
    """An array as NumPy pickles it with protocol 5: BYTEARRAY8."""
    data = content(array)
    raw = b"\x96" + struct.pack("<Q", len(data)) + data
    made = name("numpy._core.numeric", "_frombuffer")
    return made + tuple_of(raw, dtype(array), shape(array), text("C")) + b"R"


def dictionary(items: Mapping[str, bytes]) -> bytes:
    return b"}(" + b"".join(text(key) + value for key, value in items.items()) + b"u"


def framed(data: bytes) -> bytes:
    """FRAME."""
    return b"\x95" + struct.pack("<Q", len(data)) + data


def pickle_file(items: Mapping[str, bytes], *, protocol: int = 4) -> bytes:
    """A dictionary in one frame."""
    return bytes((0x80, protocol)) + framed(dictionary(items) + b".")


def joblib_file(value: Mapping[str, Any], *, alignment: int | None = ALIGNMENT) -> bytes:
    """Dictionaries, arrays, texts and integers as joblib dumps them."""
    out = bytearray(b"\x80\4")
    _put(out, value, alignment)
    return bytes(out + b".")


def tensor_file(array: NDArray[Any]) -> bytes:
    """A dictionary with a tensor of binary32, as torch saves it."""
    buffer = io.BytesIO()
    rebuild, end = b"ctorch._utils\n_rebuild_tensor_v2\n", b"\x89ccollections\nOrderedDict\n)RtR"
    storage = b"ctorch\nFloatStorage\n" + _word("0") + _word("cpu") + integer(array.size)
    strides = tuple_of(*(integer(n // array.itemsize) for n in array.strides))
    tensor = rebuild + b"((" + _word("storage") + storage + b"tQK\0" + shape(array) + strides + end
    items = {"dof_pos": tensor, "fps": integer(30)}
    made = b"\x80\2}(" + b"".join(_word(key) + item for key, item in items.items()) + b"u."
    with zipfile.ZipFile(buffer, "w") as archive:
        members = {"data.pkl": made, "byteorder": b"little", "data/0": array.tobytes()}
        members["version"] = b"3\n"
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(f"take/{name}", (1980, 1, 1, 0, 0, 0)), data)
    return buffer.getvalue()


def _word(text: str) -> bytes:
    """BINUNICODE."""
    return b"X" + struct.pack("<I", len(text)) + text.encode()


def _put(out: bytearray, value: Any, alignment: int | None) -> None:
    if isinstance(value, Mapping):
        out += b"}("
        for key, item in value.items():
            out += text(key)
            _put(out, item, alignment)
        out += b"u"
    elif isinstance(value, np.ndarray):
        _put_array(out, value, alignment)
    elif isinstance(value, list):
        out += b"](" + b"".join(map(text, value)) + b"e"
    else:
        out += integer(value)


def _put_array(out: bytearray, array: NDArray[Any], alignment: int | None) -> None:
    """An array behind its wrapper, in a frame of its own, and behind padding."""
    state = {
        "subclass": name("numpy", "ndarray"),
        "shape": shape(array),
        "order": text("C"),
        "dtype": dtype(array),
        "allow_mmap": b"\x88",
    }
    if alignment is not None:
        state["numpy_array_alignment_bytes"] = integer(alignment)
    wrapper = name("joblib.numpy_pickle", "NumpyArrayWrapper") + b")\x81"
    out += framed(wrapper + dictionary(state) + b"b")
    if alignment is not None:
        n = alignment - (len(out) + 1) % alignment
        out += bytes((n,)) + b"\xff" * n
    out += content(array)
