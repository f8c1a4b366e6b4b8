"""Sources of clips and skeletons at fault: hashes, sizes, formats, paths."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np

from mcz.codecs import raw
from mcz.container import payloads
from mcz.formats import amc, asf
from mcz.motion import Source
from mcz.schema import varint
from mcz.writing.clip_writer import write_skeleton
from tools.vectors.build.edits import Edit, put
from tools.vectors.build.files import Broken, Crafter, Unrestorable, file_of, finished
from tools.vectors.build.source_files import AMC, ASF, EXAMPLE, HEADING, PLAIN, called, take


def add(shelf: Unrestorable) -> None:
    _clip(shelf)
    _acclaim(shelf)
    _skeletons(shelf)
    _other_skeletons(shelf)
    _two_rows(shelf)
    _unsupported_source(shelf)


def _unsupported_source(shelf: Broken) -> None:
    first, second = (replace(take(PLAIN, name), name=name) for name in ("first", "second"))
    crafter = Crafter()
    crafter.clip(first, codec=replace(raw.CODEC, id=2**20))
    crafter.edits["CEND"] = put(payloads.Cend, "source_sha256", b"\1" + b"s" * 32)
    crafter.clip(second)
    purpose = "A source with another hash, behind one of a clip whose codec is unknown."
    shelf.add("hash-behind-unknown-codec", "CEND; Strict reading", purpose, finished(crafter))


def _clip(shelf: Broken) -> None:
    cases: list[tuple[str, str, str, str, bytes]] = [
        ("hash", "CEND", "Another hash.", "source_sha256", b"\1" + b"s" * 32),
        ("hash-missing", "CEND", "No hash.", "source_sha256", b"\0"),
        ("size", "CLIP", "Another size.", "source.0.size", varint(len(PLAIN) + 1)),
        ("format-differs", "CLIP", "Another format than SRCE.", "source.0.format", b"\2"),
    ]
    paths = {"up": "../a.bvh", "absolute": "/a.bvh", "empty-part": "a//b.bvh", "drive": "c:/a.bvh"}
    for name, text in paths.items():
        path = varint(len(text)) + text.encode()
        cases.append((f"path-{name}", "CLIP", f"The path {text!r}.", "source.0.path", path))
    for name, kind, purpose, path, new in cases:
        edit = put(getattr(payloads, kind.capitalize()), path, new)
        data = file_of(take(PLAIN, "plain"), **{kind: edit})
        shelf.add(name, f"{kind}; {HEADING}", f"A source: {purpose}", data)
    edits = {
        "SRCE": put(payloads.Srce, "format", b"\1"),
        "CLIP": put(payloads.Clip, "source.0.format", b"\1"),
    }
    purpose = "A clip whose source is an ASF file, which is one of a skeleton."
    data = file_of(take(PLAIN, "plain"), **edits)
    shelf.add("format-of-skeletons", f"CLIP; {HEADING}", purpose, data)


def _acclaim(shelf: Broken) -> None:
    skeleton = asf.read(ASF, "mannequin")
    for name, field, new in (
        ("hash", "sha256", b"s" * 32),
        ("size", "size", b"\1"),
        ("template-missing", "template", b"t" * 16),
    ):
        crafter = Crafter(SKEL=put(payloads.Skel, f"source.0.{field}", new))
        crafter.alias("small.asf", payloads.OF_SKELETON, write_skeleton(crafter, skeleton))
        purpose = f"The source of a skeleton: another {field}."
        shelf.add(f"ASF-{name}", f"SKEL; {HEADING}", purpose, finished(crafter))
    motion = called(amc.read(AMC, "take", skeleton), "take.amc")
    data = file_of(replace(motion, frame_numbers=None))
    purpose = "Frame numbers with a gap, which the clip does not state."
    shelf.add("AMC-frame-numbers", f"{HEADING}; Time", purpose, data)


def _other_skeletons(shelf: Unrestorable) -> None:
    """Skeletons whose own source, of right size and hash, describes another one."""
    skeleton = asf.read(ASF, "mannequin")
    tails = b"\1" + np.array([1.0, 2.0, 3.0], "<f8").tobytes()
    cases: tuple[tuple[str, str, str, bytes], ...] = (
        ("name", "another name", "name", b"\4Mime"),
        ("angle-unit", "radians", "angle_unit", b"\2"),
        ("up-axis", "an up axis, which no ASF file has", "up_axis", b"\2"),
        ("handedness", "a handedness, which no ASF file has", "handedness", b"\1"),
        ("joint-name", "another name of a joint", "joints.1.name", b"\5thigh"),
        ("tail", "another bone", "joints.1.tails", tails),
        ("channel", "another channel", "joints.2.channels.0.kind", b"\5"),
        ("parent", "another parent", "joints.2.parent", b"\1"),
    )
    for name, purpose, field, new in cases:
        crafter = Crafter(SKEL=put(payloads.Skel, field, new))
        crafter.alias("small.asf", payloads.OF_SKELETON, write_skeleton(crafter, skeleton))
        said = f"A skeleton has {purpose}; its source, of right size and hash, has not."
        shelf.add(f"ASF-other-{name}", f"SKEL; {HEADING}", said, finished(crafter))
    for name, purpose, old, new in (
        ("word", "a word that is no number", b"length 7.04", b"length 7,04"),
        ("circle", "a circle of bones", b"root lfemur", b"ltibia lfemur"),
        ("two-numbers", "two numbers where three stand", b"position 0 0 0", b"position 0 0"),
        ("angle-missing", "no word behind angle", b"angle deg", b"angle"),
        ("angle-other", "an angle unit of its own", b"angle deg", b"angle grad"),
        ("name-twice", "two bones of a name", b"name ltibia", b"name lfemur"),
        ("name-missing", "a bone without a name", b"name ltibia", b"name"),
        ("parents", "a bone with two parents", b"lfemur ltibia", b"lfemur ltibia ltibia"),
        ("point", "a number of two points", b"length 6.9", b"length 6.9.0"),
        ("blank", "a key of bones outside of a bone", b":hierarchy", b"length 1\n:hierarchy"),
    ):
        text = ASF.replace(old, new)
        source = Source("asf", text, size=len(text), sha256=hashlib.sha256(text).digest())
        crafter = Crafter()
        made = write_skeleton(crafter, replace(skeleton, source=source))
        crafter.alias("small.asf", payloads.OF_SKELETON, made)
        said = f"The source of a skeleton, of right size and hash, has {purpose}."
        shelf.add(f"ASF-no-skeleton-{name}", f"SKEL; {HEADING}", said, finished(crafter))


def _skeletons(shelf: Unrestorable) -> None:
    """The own source of a skeleton, of another format than it may have."""
    skeleton = asf.read(ASF, "mannequin")
    cases = (
        ("ASF-format", "BVH, which is one of clips", {"SRCE": b"\3", "SKEL": b"\3"}),
        ("ASF-format-differs", "ASF, where its SRCE says AMC", {"SRCE": b"\2"}),
    )
    for name, what, formats in cases:
        edits: dict[str, Edit] = {}
        for kind, new in formats.items():
            path = "format" if kind == "SRCE" else "source.0.format"
            edits[kind] = put(getattr(payloads, kind.capitalize()), path, new)
        crafter = Crafter(**edits)
        crafter.alias("small.asf", payloads.OF_SKELETON, write_skeleton(crafter, skeleton))
        purpose = f"The source of a skeleton: its format is {what}."
        shelf.add(name, "SKEL; Source reconstruction", purpose, finished(crafter))


def _two_rows(shelf: Unrestorable) -> None:
    """Two rows that have one frame number."""
    motion = called(amc.read(EXAMPLE, "example"), "example.amc")
    signal = replace(motion.signals[0], samples_per_frame=2)
    motion = replace(motion, signals=(signal,), frame_numbers=None)
    purpose = "An AMC file of a clip with two rows a frame, which would come back."
    shelf.add("AMC-rows", "The text of AMC and BVH", purpose, file_of(motion))
