"""C3D in memory: ``c3d.Reader``, read frame by frame, and the dictionary of ``ezc3d.c3d``."""

from __future__ import annotations

import io
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError, OptionError
from mcz.exchange.conversion import convert
from mcz.files.reading.source_files import ANALOG, recording
from mcz.model.checks import check_arguments
from mcz.model.extras import import_extra
from mcz.model.motion import A_MOTION, Motion, Signal
from mcz.sources import FORMATS
from mcz.sources.c3d.layout import FORMAT, OUTPUTS_FORMAT

if TYPE_CHECKING:
    from c3d import Reader
    from ezc3d import c3d


def from_c3d(reader: Reader, *, name: str = "motion") -> Motion:
    """The motion in the file of a ``c3d.Reader``, or in the output of a ``c3d.Writer``.

    It has all contents of the file, with its source. Raises SourceError for a malformed C3D,
    OptionError if the file of the reader is closed.
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
        raise OptionError(f"{type(reader).__name__} is neither a c3d.Reader nor a c3d.Writer")
    motion: Motion = FORMATS["c3d"].read(data, name)
    return motion


@check_arguments(motion=A_MOTION)
def to_c3d(motion: Motion) -> Reader:
    """``motion`` as a ``c3d.Reader``; needs c3d (``mcz[c3d]``).

    It reads the C3D file of the motion, its source's if it has one, from memory; its ``to_writer``
    allows changes. Raises MotionError if c3d cannot read that file, and as ``mcz.convert(motion,
    "c3d")``.
    """
    c3d, data = import_extra("c3d", "c3d"), c3d_bytes(motion)
    try:
        return c3d.Reader(io.BytesIO(data))
    except Exception as error:  # it raises any exception of its parser, such as AssertionError
        raise MotionError(f"c3d cannot read it: {error}", clip=motion.name) from error


def as_c3d_motion(motion: Motion) -> Motion:
    """``motion`` itself if its source is a C3D, else its points as markers."""
    if motion.source is not None and motion.source.format in (FORMAT, OUTPUTS_FORMAT):
        return motion
    return convert(motion, "c3d")


def c3d_bytes(motion: Motion) -> bytes:
    """The C3D file of a motion: its source's, or a plain one of its points."""
    data: bytes = FORMATS["c3d"].write(as_c3d_motion(motion))
    return data


RoleArrays = dict[str | None, tuple[NDArray[np.float64], NDArray[np.bool_]]]
OUTPUTS = "outputs"  # role of the signal of model outputs, which ezc3d has among the points
REFUSED = (OSError, ValueError, RuntimeError, LookupError)  # what ezc3d raises
NOTE = "numbers that binary32 cannot hold: without the events and parameters of its C3D"


def from_ezc3d(c3d: object, *, name: str = "motion") -> Motion:
    """The motion in an ``ezc3d.c3d``: points, residuals, outputs of models, analog, events.

    It is the motion in the file that ezc3d writes, with its source. If points or analog samples are
    numbers that such a file would round to binary32, filtered ones for example, they are kept, but
    not the source, events and parameters; the ``source-note`` of the metadata mentions it. Raises
    OptionError if ezc3d cannot write the file, and SourceError.
    """
    if not hasattr(c3d, "write"):
        raise OptionError(f"{type(c3d).__name__} is not an ezc3d.c3d; to read a file, use mcz.read")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "motion.c3d")
        try:
            c3d.write(str(path))
        except REFUSED as error:
            raise OptionError(f"ezc3d cannot write it: {error}") from error
        motion: Motion = FORMATS["c3d"].read(path.read_bytes(), name)
    arrays = _arrays_by_role(c3d, motion)
    signals = tuple(_with_numbers(signal, arrays) for signal in motion.signals)
    if all(own is other for own, other in zip(signals, motion.signals, strict=True)):
        return motion
    note = "; ".join(filter(None, (motion.metadata.get("source-note"), NOTE)))
    metadata = {**motion.metadata, "source-note": note}
    return replace(motion, signals=signals, metadata=metadata).without_source()


@check_arguments(motion=A_MOTION)
def to_ezc3d(motion: Motion) -> c3d:
    """``motion`` as an ``ezc3d.c3d``; needs ezc3d (``mcz[ezc3d]``).

    It has the contents of the C3D file of the motion (``mcz.to_c3d``), with points and analog
    samples in binary64; ezc3d writes them as binary32. Unknown values are NaN. Raises MotionError
    if ezc3d cannot read that file, and as ``mcz.convert(motion, "c3d")``.
    """
    ezc3d = import_extra("ezc3d", "ezc3d")
    plain = as_c3d_motion(motion)
    data = c3d_bytes(plain)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "motion.c3d")
        path.write_bytes(data)
        try:
            file = ezc3d.c3d(str(path))
        except REFUSED as error:
            raise MotionError(f"ezc3d cannot read it: {error}", clip=motion.name) from error
    arrays = _arrays_by_role(file, FORMATS["c3d"].read(data, motion.name))
    for signal in plain.signals:
        if signal.role in arrays:
            array, chosen = arrays[signal.role]
            target, values = array[chosen], signal.masked().T
            if target.size != values.size:
                raise MotionError(
                    f"signal {signal.name!r} has {values.size} numbers, but ezc3d reads "
                    f"{target.size}",
                    clip=motion.name,
                )
            array[chosen] = values.reshape(target.shape)
    return file


def _arrays_by_role(data: c3d, motion: Motion) -> RoleArrays:
    """By the roles of signals of ``motion``, an array of ezc3d, time last, and the rows to use.

    Residuals are not among them: ezc3d keeps them unchanged.
    """
    facts = recording(motion)
    is_point = np.array([not point.groups for point in facts.points] if facts else [], np.bool_)
    places, samples = (data["data"]["points"][:3].transpose(1, 0, 2), data["data"]["analogs"][0])
    if len(places) != len(is_point):
        raise MotionError(
            f"ezc3d has {len(places)} points, but the C3D has {len(is_point)}", clip=motion.name
        )
    return {
        "motion": (places, is_point),
        OUTPUTS: (places, ~is_point),
        ANALOG: (samples, np.ones(len(samples), np.bool_)),
    }


def _with_numbers(signal: Signal, arrays: RoleArrays) -> Signal:
    """``signal``, in binary64 if its numbers differ from ezc3d's."""
    if signal.role not in arrays or not signal.values.size:
        return signal
    array, chosen = arrays[signal.role]
    rows = array[chosen]
    values = np.ascontiguousarray(rows.reshape(-1, rows.shape[-1]).T, np.float64)
    if np.array_equal(signal.masked(), values, equal_nan=True):
        return signal
    known = np.isfinite(values)
    return Signal(
        np.where(known, values, 0.0),
        name=signal.name,
        samples_per_frame=signal.samples_per_frame,
        mask=None if known.all() else known,
        channels=signal.channels,
        role=signal.role,
        of=signal.of,
    )
