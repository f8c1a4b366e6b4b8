"""C3D files in which some points are outputs of models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcz.formats import c3d
from tests.formats.c3d_files import SGI, Made, real
from tools.vectors.build import wavelet_clips
from tools.vectors.build.c3d_files import (
    C3D_SPEC,
    ORDERS,
    c3d_file,
    c3d_outputs,
    lists,
    take_c3d,
)
from tools.vectors.build.cuts import CUT_HEADING, cut, shown
from tools.vectors.build.files import Whole, file_of
from tools.vectors.build.lossless_clips import codec_of
from tools.vectors.build.source_files import BOTH, path_of, restored, unhashed
from tools.vectors.build.wavelet_clips import HAAR, Plan, Wave


def add(shelf: Whole) -> None:
    _orders(shelf)
    _places(shelf)
    _masks(shelf)
    _lossy(shelf)
    _range(shelf)


def hold(shelf: Whole, name: str, purpose: str, file: Made, coded: bool = False) -> None:
    """Add the file, its clip coded by raw or by lossless."""
    source = file.build()
    motion = take_c3d(source, name)
    assert motion.source is not None and motion.source.format == "c3d-outputs"
    data = file_of(motion, codec=codec_of()) if coded else file_of(motion)
    sources = ((f"{name}.c3d", source),)
    shelf.hold(f"c3d-{name}", C3D_SPEC, purpose, data, motion, sources=sources, modes=BOTH)


def _orders(shelf: Whole) -> None:
    for order, processor in ORDERS.items():
        for word, size in (("integers", 2), ("floats", 4)):
            purpose = f"Outputs between points, {order}, {word}."
            file = c3d_outputs(processor=processor, size=size)
            hold(shelf, f"outputs-{order}-{word}", purpose, file)
    purpose = "Outputs between points, whose signals lossless codes."
    hold(shelf, "outputs-lossless", purpose, c3d_outputs(n_frames=9), coded=True)


def _places(shelf: Whole) -> None:
    """Outputs in every place, and labels that are listed in any way."""
    cases = {
        "first": (4, {"ANGLES": ["p0", "p1"]}, "The first two points of four are outputs."),
        "last": (4, {"POWERS": ["p3"]}, "The last point of four is an output."),
        "alone": (2, {"SCALARS": ["p1", "p0"]}, "All points are outputs: the motion is empty."),
        "twice": (
            4,
            {"ANGLES": ["p2", "p2"], "FORCES": ["p2", "p9"], "FORCE_UNITS": ["N"]},
            "An output that is listed three times, in two lists, and a label of no point.",
        ),
        "continued": (4, {"ANGLES": ["p0"], "ANGLES2": ["p2"]}, "A list that goes on."),
    }
    for name, (n_points, listed, purpose) in cases.items():
        file = c3d_file(n_points=n_points)
        file.parameters = {"POINT": lists(file, **listed)}
        hold(shelf, f"outputs-{name}", purpose, file)
    file = c3d_file(n_points=4, labels=[b"A", b"B", b"A", b""])
    file.parameters = {"POINT": lists(file, MOMENTS=["A", ""])}
    hold(shelf, "outputs-of-a-name", "Two outputs of one label, and a point without one.", file)


def _masks(shelf: Whole) -> None:
    """Points and outputs that are invalid, by their residuals or by NaN."""
    for order in ("intel", "sgi"):
        file = c3d_outputs(processor=ORDERS[order])
        kind = "big" if ORDERS[order] == SGI else "little"
        minus = int.from_bytes(real(-1.0, ORDERS[order]), kind)
        file.points[1, 1:3, 3] = file.points[3, 0, 3] = minus
        file.points[2, 3, 0] = file.points[2, 4, 2] = 0xFFC12345
        purpose = f"Points and outputs marked invalid by a residual of -1, and NaN; {order}."
        hold(shelf, f"outputs-invalid-{order}", purpose, file)
    file = c3d_outputs(size=2)
    file.points[1, 1:3, 3] = 65_535
    hold(shelf, "outputs-invalid-integers", "The same of integers.", file)
    file = c3d_outputs()
    file.points[:, :, 3] = 0
    file.points[1, 1, 3] = file.points[2, 2, 3] = 0xBF800000
    source = file.build()
    whole = take_c3d(source, "outputs-bare")
    kept = tuple(signal for signal in whole.signals if signal.name != "residuals")
    motion = replace(whole, signals=kept)
    assert c3d.write(motion) == source
    purpose = "No signal of residuals: 0 and -1 by the masks of points and of outputs."
    shelf.hold(
        "c3d-outputs-bare", C3D_SPEC, purpose, file_of(motion), motion,
        sources=(("outputs-bare.c3d", source),), modes=BOTH,
    )  # fmt: skip
    outputs = whole.signals[2]
    mask = np.ones(outputs.values.shape, np.bool_)
    mask[3, 1] = mask[0, 3:] = False
    gapped = replace(outputs, mask=mask)
    motion = replace(whole, signals=(*whole.signals[:2], gapped, *whole.signals[3:]))
    motion = unhashed(motion)
    purpose = "Outputs that the mask calls invalid and their residuals valid: NaN."
    sources = ((path_of(motion), restored(motion)),)
    shelf.hold(
        "c3d-outputs-gaps", C3D_SPEC, purpose, file_of(motion), motion,
        sources=sources, modes=BOTH,
    )  # fmt: skip


def _lossy(shelf: Whole) -> None:
    """Positions of mrdwt; outputs remain as they are."""
    file = c3d_file(13, 2, 0, 1, size=2, scale=0.1)
    file.parameters = {"POINT": lists(file, ANGLES=["p0"])}
    whole = take_c3d(file.build(), "outputs-lossy")
    plan = Plan(13, HAAR, 0, 2)
    counted = [k * k % 61 * 7 for k in range(13)]
    channels = [Wave([column]) for column in (counted, counted[::-1], counted)]
    values = wavelet_clips.values_of(plan, channels)
    first = replace(whole.signals[0], values=values, mask=None, ordinals=None)
    motion = replace(whole, signals=(first, *whole.signals[1:]))
    data = file_of(motion, codec=wavelet_clips.codec_of(plan, channels), grouping="channel")
    sources = ((path_of(motion), restored(motion)),)
    purpose = "A lossy clip whose outputs are lossless."
    shelf.hold("c3d-outputs-lossy", C3D_SPEC, purpose, data, motion, sources=sources, modes=BOTH)


def _range(shelf: Whole) -> None:
    file = c3d_outputs(n_frames=6, first=40)
    whole = take_c3d(file.build(), "outputs-range")
    data = cut(file_of(whole, segment_frames=2), frames=(1, 4))
    motion = replace(shown(whole, 1, 4), frame_numbers=np.arange(41, 44))
    purpose = "Frames 1 to 3 of 6 of a C3D file with outputs."
    sources = ((path_of(whole), restored(motion)),)
    shelf.hold(
        "c3d-outputs-range", f"{CUT_HEADING}; {C3D_SPEC}", purpose, data, motion,
        sources=sources, modes=BOTH,
    )  # fmt: skip
