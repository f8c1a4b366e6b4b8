"""Invalid, one fault each: headers, models, signals and segments of online.

Where a reader can overlook the fault, the hash is that of what it then decodes: the clips are of
zeros, which every header makes of frames with nothing in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.basis_models import Basis, build_bases
from mcz.codecs.contract import Model, id_of
from mcz.container import payloads
from mcz.numbers import Grid, GridKind
from tools.records import built
from tools.vectors.build.edits import BAD_STEPS, binary64, headed, put, says, swap
from tools.vectors.build.files import Broken, rehash
from tools.vectors.build.online_clips import file_with
from tools.vectors.build.online_units import HEADING, REORDERED, Plan, header
from tools.vectors.build.spatial_clips import basis_of, still

SPACE = f"{HEADING}; Space"


def add(shelf: Broken) -> None:
    _headers(shelf)
    _steps(shelf)
    _points(shelf)
    _models(shelf)
    _signal(shelf)
    _segments(shelf)


def _silent(plan: Plan, **edits: Any) -> bytes:
    """A file of zeros."""
    return file_with(replace(plan, fill=still), **edits)


def _headers(shelf: Broken) -> None:
    plan = Plan(("I6",), 4, bases=(basis_of(4, 2),))
    weighted = replace(plan, weights=bytes(4))
    cosines = replace(plan, bases=())
    cases: dict[str, tuple[str, Plan, dict[str, bytes]]] = {
        "flags-16": ("A flag that is reserved.", plan, {"flags": b"\x10"}),
        "basis-2": ("A basis of kind 2.", plan, {"basis": b"\2"}),
        "model-absent": ("Bases of a model, which is not named.", plan, {"model": b""}),
        "model-beside": ("A model is named beside cosines.", cosines, {"model": bytes(16)}),
        "weights-fewer": ("3 weights of 4 channels.", weighted, {"weights": b"\3" + bytes(3)}),
        "weights-more": ("5 weights of 4 channels.", weighted, {"weights": b"\5" + bytes(5)}),
        "weights-beside": ("Weights, but no flag.", plan, {"weights": b"\4" + bytes(4)}),
        "order-2": ("Order 2.", plan, {"order": b"\2"}),
        "order-255": ("Order 255.", plan, {"order": b"\xff"}),
        "coder-2": ("Coder 2.", plan, {"coder": b"\2"}),
        "coder-255": ("Coder 255.", plan, {"coder": b"\xff"}),
        "coder-absent": ("A header without its last field.", plan, {"coder": b""}),
        "header-and-byte": ("A byte behind the header.", plan, {"coder": b"\0\0"}),
    }
    for case, (purpose, made, parts) in cases.items():
        shelf.add(case, SPACE, purpose, _silent(made, CLIP=says(header(made, **parts))))
    shelf.add("header-none", SPACE, "A header of no bytes.", _silent(plan, CLIP=says(b"")))
    nothing = Plan(("I6",), 1, bases=(basis_of(1, 1, entries=[[0]]),))
    for case, purpose, flag in (
        ("flags-mean", "A mean, of zeros, which the codec has not.", b"\4"),
        ("flags-courses", "Courses, which the codec has not.", b"\x08"),
    ):
        said = says(header(nothing, flags=flag, basis=b"\0"))
        shelf.add(case, SPACE, purpose, _silent(nothing, CLIP=said))


def _steps(shelf: Broken) -> None:
    plan = Plan(("I6",), 2)
    for case, step in BAD_STEPS.items():
        said = says(header(plan, step=binary64(step)))
        shelf.add(f"step-{case}", SPACE, f"A step of {step!r}.", _silent(plan, CLIP=said))


def _points(shelf: Broken) -> None:
    """Channels that make no points."""
    four, six = Plan(("I6",), 4), Plan(("I6",), 6, order=REORDERED)
    cases: dict[str, tuple[str, Plan, dict[str, bytes]]] = {
        "channels-4": ("x, y and z apart, of 4 channels.", four, {"flags": b"\1"}),
        "order-channels-4": ("x, y and z of 4 channels are reordered.", four, {"order": b"\1"}),
        "order-apart": ("x, y and z are apart and reordered.", six, {"flags": b"\1"}),
    }
    for case, (purpose, plan, parts) in cases.items():
        shelf.add(case, SPACE, purpose, _silent(plan, CLIP=says(header(plan, **parts))))


def _with_model(plan: Plan, kind: int, bases: Sequence[Basis]) -> bytes:
    """The file of ``plan`` with another model, which the clip names."""
    old, data = plan.space.model, build_bases(bases)
    assert old is not None
    payload = built(payloads.Modl, {"kind": kind, "data": data}, "MODL")
    named = swap(id_of(old), id_of(Model(kind, data)))
    return _silent(plan, MODL=lambda _: payload, CLIP=named)


def _models(shelf: Broken) -> None:
    spec = f"{SPACE}; Bases"
    plan = Plan(("I9",), 6, bases=(basis_of(6, 3),))
    own = plan.bases[0]
    third = (basis_of(2, 2),) * 3
    reordered = replace(plan, order=REORDERED)
    apart = Plan(("I9",), 6, apart=True, bases=third)
    wide = Basis(own.shifts, np.pad(own.entries, ((0, 0), (0, 1))))
    cases: dict[str, tuple[str, Plan, int, Sequence[Basis]]] = {
        "kind": ("A model of kind 2, with the bases that are due.", plan, 2, plan.bases),
        "bases-2": ("A model of two bases, where one is due.", plan, 1, (own, own)),
        "points-2": ("Vectors of 2 entries for 6 points.", plan, 1, third[:1]),
        "points-7": ("Vectors of 7 entries for 6 points, the last 0.", plan, 1, (wide,)),
        "reordered": ("Three bases, of channels that are reordered.", reordered, 1, third),
        "bases-1": ("A model of one basis, where three are due.", apart, 1, third[:1]),
        "third": (
            "The third basis has vectors of 3 entries.",
            apart,
            1,
            (*third[:2], basis_of(3, 2)),
        ),
    }
    for case, (purpose, made, kind, bases) in cases.items():
        shelf.add(f"model-{case}", spec, purpose, _with_model(made, kind, bases))


def _signal(shelf: Broken) -> None:
    plan = Plan(("I8",), 6)
    spec = f"{HEADING}; CLIP"
    twice = put(payloads.Clip, "signals.0.samples_per_frame", b"\2")

    def rows(found: Any) -> Any:
        return replace(found, signals=(replace(found.signals[0], samples_per_frame=2),))

    data = _silent(plan, CLIP=twice, CEND=rehash(np.zeros((16, 6))), row=rows)
    shelf.add("samples", spec, "Two rows a frame.", data)
    more = put(payloads.Clip, "signals.0.n_resolutions", b"\2")
    data = _silent(plan, CLIP=more, segments=lambda made: [(h, [*s, b""]) for h, s in made])
    shelf.add("resolutions", spec, "Two resolutions.", data)
    listed = put(payloads.Clip, "signals.0.groups", b"\3\2\3\3")
    data = _silent(plan, CLIP=listed, segments=lambda made: [(h, [*s, *s]) for h, s in made])
    shelf.add("groups", spec, "Two groups.", data)
    run = built(payloads.GridRun, {"n_channels": 6, "grid": Grid(GridKind.INTEGER)}, "grids")
    integers = put(payloads.Clip, "signals.0.grids", b"\1" + run)
    data = _silent(plan, CLIP=integers, CEND=rehash(np.zeros((8, 6), np.int64)))
    purpose = "All grids are INTEGER, but the codec decodes no ordinals."
    shelf.add("integers", f"{spec}; Codecs", purpose, data)


def _segments(shelf: Broken) -> None:
    """What the heads of segments say; that they start fresh, where the first unit does not."""
    plan = Plan(("I4 L4", "L4", "S3", "I5"), 3)
    spec = f"{HEADING}; DATA"
    cases: dict[str, tuple[str, Plan, Any]] = {
        "segment-lead": ("A lead, which no segment has.", plan, headed(1, lead=1)),
        "segment-tail": ("A tail, which no segment has.", plan, headed(0, tail=1)),
        "segment-first": ("The first segment does not start fresh.", plan, headed(0, flags=0)),
        "fresh-ltr": ("A segment that starts fresh begins with an LTR.", plan, headed(1, flags=1)),
        "fresh-str": ("A segment that starts fresh begins with an STR.", plan, headed(2, flags=1)),
        "fresh-not": (
            "A segment that does not start fresh begins with an intra coded LTR.",
            plan,
            headed(3, flags=0),
        ),
        "first-ltr": (
            "The first frame of the clip is an LTR.",
            Plan(("L4 L4",), 3),
            headed(0, flags=1),
        ),
        "first-str": (
            "The first frame of the clip is an STR.",
            Plan(("S4 I4",), 3),
            headed(0, flags=1),
        ),
    }
    for case, (purpose, made, edit) in cases.items():
        shelf.add(case, spec, purpose, file_with(made, segments=edit))
    live = Plan(tuple("I1 S1 L1 S1".split()), 3)
    for case, purpose, at in (
        ("live-fresh-ltr", "A packet that starts fresh has an LTR.", 2),
        ("live-fresh-str", "A packet that starts fresh has an STR.", 3),
    ):
        data = file_with(live, packets=True, frames=1, segments=headed(at, flags=1))
        shelf.add(case, f"{HEADING}; Open DATA and packets", purpose, data)
