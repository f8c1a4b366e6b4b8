"""Templates of C3D with outputs, and their signals, at fault."""

from __future__ import annotations

from dataclasses import replace

from mcz.formats.c3d_layout import C3dOutputsTemplate
from mcz.schema import varint
from tools.vectors.build.c3d_files import C3D_SPEC, c3d_outputs, take_c3d
from tools.vectors.build.edits import Edit, plus, put
from tools.vectors.build.files import Unrestorable, file_of
from tools.vectors.build.source_files import with_template


def add(shelf: Unrestorable) -> None:
    """The runs of a file of five points are 1, 1, 1, 1, 1."""
    motion = take_c3d(c3d_outputs().build(), "prop")

    def runs(*sizes: int) -> Edit:
        return put(C3dOutputsTemplate, "outputs", b"".join(map(varint, (len(sizes), *sizes))))

    cases = (
        ("run-of-none", "a run of no points, amid the right ones", runs(1, 1, 0, 0, 1, 1, 1)),
        ("run-of-none-last", "a run of no points behind the others", runs(1, 1, 1, 1, 1, 0)),
        ("less", "runs of four points of five", runs(1, 1, 1, 1)),
        ("more", "runs of six points of five", runs(1, 1, 1, 1, 1, 1)),
        ("many", "runs of 2^53 - 1 points", runs(1, 1, 1, 1, 2**53 - 1)),
        ("other", "three outputs, but a signal of two", runs(0, 1, 1, 1, 1, 1)),
        ("one-less", "one output, but a signal of two", runs(1, 1, 3)),
        ("swapped", "an output and a point, each in the place of the other", runs(0, 1, 2, 1, 1)),
        ("tail", "a byte behind it, which is closed", plus(b"\0")),
        ("cut", "it ends early", lambda data: data[:-1]),
    )
    for name, purpose, edit in cases:
        data = file_of(motion, SRCE=with_template(edit))
        purpose = f"A template of C3D with outputs: {purpose}."
        shelf.add(f"c3d-outputs-{name}", C3D_SPEC, purpose, data)
    signals = tuple(s for s in motion.signals if s.name != "outputs")
    purpose = "A clip without the signal outputs, which its template of C3D needs."
    data = file_of(replace(motion, signals=signals))
    shelf.add("c3d-outputs-missing", C3D_SPEC, purpose, data)
