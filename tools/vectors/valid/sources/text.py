"""BVH, AMC and ASF: files, templates that clips share, widths, parts."""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np

from mcz.container import payloads
from mcz.formats import amc, asf, c3d
from mcz.formats.layout import Template
from mcz.motion import Motion
from mcz.schema import parse
from mcz.writing.clip_writer import write_skeleton
from tools.vectors.build.c3d_files import C3D_SPEC, c3d_rotations, take_c3d
from tools.vectors.build.cuts import CUT_HEADING, cut, shown
from tools.vectors.build.files import Crafter, Whole, file_of, finished
from tools.vectors.build.source_files import (
    AMC,
    ASF,
    BOTH,
    EXAMPLE,
    HEADING,
    HIERARCHY,
    ODD,
    ODD_ASF,
    ODD_ROWS,
    PLAIN,
    ROWS,
    called,
    padded,
    take,
    with_asf,
)


def add(shelf: Whole) -> None:
    _bvh(shelf)
    _shared_template(shelf)
    _acclaim(shelf)
    _derived(shelf)
    _parts(shelf)
    _widths(shelf)
    _rows(shelf)


def _widths(shelf: Whole) -> None:
    """What restores texts, at the ends of its ranges."""
    for name, style in (("255", "255.2f"), ("255-left", "<255.2f")):
        text = padded(style)
        motion = take(text, f"width-{name}")
        purpose = f"Columns padded to 255 bytes, {'left' if 'left' in name else 'right'} justified."
        spec = f"{HEADING}; The text of AMC and BVH"
        sources = ((f"width-{name}.bvh", text),)
        data = file_of(motion)
        shelf.hold(f"bvh-width-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def _rows(shelf: Whole) -> None:
    """A BVH clip of two rows a frame: it has no frame numbers to print."""
    plain = take(PLAIN, "plain")
    motion = replace(plain, signals=(replace(plain.signals[0], samples_per_frame=2),))
    shelf.hold(
        "bvh-two-rows", "Source reconstruction; The text of AMC and BVH",
        "Two rows a frame: the rows of the file are those of the signal.",
        file_of(motion), motion, sources=(("plain.bvh", PLAIN),), modes=BOTH,
    )  # fmt: skip


def _bvh(shelf: Whole) -> None:
    _check_values(take(PLAIN, "plain"), ROWS.split()[5:])
    _check_values(take(ODD, "odd"), ODD_ROWS.decode().split()[5:])
    latin = (HIERARCHY % "R\xfccken" + ROWS).encode("latin-1")
    empty = (HIERARCHY % "Spine" + "Frames: 0\nFrame Time: 0.01\n").encode()
    cases = (
        ("plain", "A BVH file printed by one printf.", PLAIN, 0),
        (
            "odd",
            "Two line ends, tabs, a wrong count, odd numbers, no last line end; notes a segment.",
            ODD,
            2,
        ),
        ("padded", "Columns padded to a width, right justified.", _padded("9.2f"), 0),
        ("padded-left", "Columns padded to a width, left justified.", _padded("<9.2f"), 0),
        ("padded-sign", "A blank where a sign could be.", _padded(" .2f"), 0),
        ("latin-1", "A name that is not UTF-8: its bytes are in the template alone.", latin, 0),
        ("empty", "A BVH file without a frame.", empty, 0),
    )
    for name, purpose, source, segment_frames in cases:
        motion = take(source, name)
        assert ("padded" in name) == _has_widths(motion)
        data = file_of(motion, segment_frames=segment_frames)
        spec = f"{HEADING}; The text of AMC and BVH; Frame notes of AMC and BVH"
        sources = ((f"{name}.bvh", source),)
        shelf.hold(f"bvh-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def _padded(style: str) -> bytes:
    """A file whose numbers are in a style of ``format``, of as many widths as make that plain."""
    rows = []
    for row in range(20):
        values = [
            (row * row * 397 + c * 911) % 41 * (1, 3.25, 10.5, 34.25)[c % 4] - 20 for c in range(9)
        ]
        rows.append(" ".join(format(value, style) for value in values))
    text = "\n".join((f"Frames: {len(rows)}", "Frame Time: 0.01", *rows, ""))
    return (HIERARCHY % "Spine" + text).encode()


def _has_widths(motion: Motion) -> bool:
    assert motion.source is not None
    patterns = parse(Template, motion.source.template, "template").patterns
    return any(run.width for pattern in patterns for run in pattern.runs)


def _check_values(motion: Motion, words: list[str]) -> None:
    """What this package parsed is what Python's own parser makes of the words."""
    values = motion.signals[0].values
    expected = np.array([float(word) for word in words]).reshape(values.shape)
    assert np.array_equal(values, expected, equal_nan=True)


def _shared_template(shelf: Whole) -> None:
    row = b"0.20 93.45 0.00 1.00 2.00 3.00 4.00 5.00 6.00\n"
    longer_text = PLAIN.replace(b"Frames: 4", b"Frames: 5") + row
    plain, longer = take(PLAIN, "plain"), take(longer_text, "longer")
    crafter = Crafter()
    crafter.clip(plain)
    crafter.clip(longer)
    crafter.alias("again/plain.bvh", payloads.OF_CLIP, b"plain")
    assert sorted(kind for kind, _ in crafter.directory.shared) == [b"SKEL", b"SRCE"]
    shelf.hold(
        "bvh-shared-template",
        f"{HEADING}; SRCE; ALIA",
        "Two clips share skeleton and template; a third file is the same as the first.",
        finished(crafter),
        plain,
        longer,
        sources=(("plain.bvh", PLAIN), ("longer.bvh", longer_text), ("again/plain.bvh", PLAIN)),
        modes=BOTH,
    )


def _acclaim(shelf: Whole) -> None:
    skeleton = asf.read(ASF, "mannequin")
    crafter, named = Crafter(), ("small.asf", ASF)
    with_asf(crafter, skeleton)
    purpose = "A skeleton with a source file of its own."
    spec = f"SKEL; ALIA; {HEADING}"
    shelf.hold("asf", spec, purpose, finished(crafter), sources=(named,), modes=BOTH)
    crafter = Crafter()
    write_skeleton(crafter, skeleton)
    purpose = "A skeleton with a source file of its own that no ALIA names: nothing is restored."
    shelf.hold("asf-unnamed", spec, purpose, finished(crafter), modes=BOTH)
    odd = asf.read(ODD_ASF, "nobody")
    crafter = Crafter()
    with_asf(crafter, odd)
    purpose = (
        "No name behind :name, keys twice, words too many, no end of a bone; Latin-1, \\r alone, (."
    )
    named = ("small.asf", ODD_ASF)
    shelf.hold("asf-odd", spec, purpose, finished(crafter), sources=(named,), modes=BOTH)
    named = ("small.asf", ASF)
    motion = called(amc.read(AMC, "take", skeleton), "take.amc")
    assert motion.signals[0].mask is not None
    crafter = Crafter()
    with_asf(crafter, skeleton)
    crafter.clip(motion, segment_frames=3)
    shelf.hold(
        "amc",
        f"{HEADING}; Frame notes of AMC and BVH; Masks; Registry",
        "Bones in another order than the skeleton's, a gap in the frame numbers, a frame without "
        "a bone, CR LF, no last line end, exponents of three digits.",
        finished(crafter),
        motion,
        sources=(("take.amc", AMC), named),
        modes=BOTH,
    )
    odd_numbers = AMC.replace(b"\r\n5\r", b"\r\n007\r").replace(b"\r\n6\r", b"\r\n+8\r")
    for name, purpose, source in (
        ("alone", "An AMC file without its ASF: a flat skeleton.", AMC),
        ("example", "The worked example of the specification.", EXAMPLE),
        ("odd-numbers", "Frame numbers with zeros and a sign before them.", odd_numbers),
    ):
        motion = called(amc.read(source, name), f"{name}.amc")
        spec, sources = f"{HEADING}; Frame notes of AMC and BVH", ((f"{name}.amc", source),)
        data = file_of(motion)
        shelf.hold(f"amc-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def _derived(shelf: Whole) -> None:
    skeleton = asf.read(ASF, "mannequin")
    wider = AMC.replace(b"ltibia 1", b"ltibia 0.5 1").replace(b"ltibia -1", b"ltibia 0.5 -1")
    derived = called(amc.read(wider, "wider", skeleton), "wider.amc")
    crafter = Crafter()
    base = with_asf(crafter, skeleton)
    derived = replace(derived, skeleton=replace(derived.skeleton, base=base))
    shelf.hold(
        "amc-derived",
        f"{HEADING}; SKEL",
        "A bone with more values than its ASF says: a derived skeleton.",
        finished(crafter, derived),
        derived,
        sources=(("wider.amc", wider), ("small.asf", ASF)),
        modes=BOTH,
    )


def _parts(shelf: Whole) -> None:
    skeleton = asf.read(ASF, "mannequin")
    whole = called(amc.read(AMC, "take", skeleton), "take.amc")
    crafter = Crafter()
    with_asf(crafter, skeleton)
    crafter.clip(whole, segment_frames=1)
    data = cut(finished(crafter), frames=(1, 3))
    numbers = whole.frame_numbers
    assert numbers is not None
    motion = replace(shown(whole, 1, 3), frame_numbers=numbers[1:3])
    assert whole.source is not None and whole.source.notes is not None
    source = amc.write(_noted(motion, whole, 1, 3))
    shelf.hold(
        "amc-range",
        f"{HEADING}; {CUT_HEADING}; Registry",
        "Frames 1 and 2 of an AMC file, with their numbers; a bone is absent from one.",
        data,
        motion,
        sources=(("take.amc", source), ("small.asf", ASF)),
        modes=BOTH,
    )
    whole = take_c3d(c3d_rotations().build(), "turned")
    data = cut(file_of(whole, segment_frames=1), frames=(1, 2))
    assert whole.frame_numbers is None or len(whole.frame_numbers) == 2
    motion = replace(shown(whole, 1, 2), frame_numbers=np.array([2]))
    source = c3d.write(motion)
    assert struct.unpack_from("<HH", source, 6) == (2, 2)
    shelf.hold(
        "c3d-rotations-range",
        f"{C3D_SPEC}; {CUT_HEADING}",
        "The second of two frames of a C3D file with rotations, which begin in another block.",
        data,
        motion,
        sources=(("turned.c3d", source),),
        modes=BOTH,
    )


def _noted(motion: Motion, whole: Motion, start: int, stop: int) -> Motion:
    """``motion`` with the frame notes of a part of ``whole``."""
    from mcz.formats.notes import join_notes

    source = whole.source
    assert source is not None and source.notes is not None
    notes = join_notes([(0, stop - start, source.notes.cut(start, stop))])
    return replace(motion, source=replace(source, notes=notes))
