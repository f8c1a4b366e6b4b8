"""``c3d.Reader``: a C3D file that is read frame by frame."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from mcz.errors import MotionError, OptionError
from mcz.exchange.conversion import convert
from mcz.model.extras import import_extra
from mcz.model.motion import Motion
from mcz.sources import FORMATS
from mcz.sources.c3d.layout import FORMAT, OUTPUTS_FORMAT

if TYPE_CHECKING:
    from c3d import Reader


def from_c3d(reader: Reader, *, name: str = "motion") -> Motion:
    """The motion in the file of a ``c3d.Reader``, or in what a ``c3d.Writer`` would write.

    It is all that the file says, with its source. Raises SourceError for what is no C3D,
    OptionError where the file of the reader is closed.
    """
    if hasattr(reader, "read_frames"):
        try:
            reader._handle.seek(0)
            data = reader._handle.read()
        except ValueError as error:
            raise OptionError(f"the file of a c3d.Reader must be open: {error}") from None
    elif hasattr(reader, "add_frames"):
        stream = io.BytesIO()
        reader.write(stream)
        data = stream.getvalue()
    else:
        raise OptionError(f"a {type(reader).__name__} is neither a c3d.Reader nor a c3d.Writer")
    motion: Motion = FORMATS["c3d"].read(data, name)
    return motion


def to_c3d(motion: Motion) -> Reader:
    """``motion`` as a ``c3d.Reader``; needs c3d (``mcz[c3d]``).

    It reads the C3D file of the motion, its source's where it has one, from memory; its
    ``to_writer`` is for who goes on to change it. Raises MotionError where c3d cannot read that
    file, and as ``mcz.convert(motion, "c3d")`` does.
    """
    c3d, data = import_extra("c3d", "c3d"), c3d_bytes(motion)
    try:
        return c3d.Reader(io.BytesIO(data))
    except Exception as error:  # it raises whatever its parser met, AssertionError among others
        raise MotionError(f"c3d cannot read it: {error}", clip=motion.name) from error


def for_c3d(motion: Motion) -> Motion:
    """``motion`` itself where its source is a C3D, else its points as markers."""
    if motion.source is not None and motion.source.format in (FORMAT, OUTPUTS_FORMAT):
        return motion
    return convert(motion, "c3d")


def c3d_bytes(motion: Motion) -> bytes:
    """The C3D file of a motion: its source's, or a plain one of its points."""
    data: bytes = FORMATS["c3d"].write(for_c3d(motion))
    return data
