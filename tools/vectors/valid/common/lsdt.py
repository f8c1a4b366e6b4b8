"""What lsdt-frame and lsdt-clip have: lengths, matrices, steps, codes, sizes, models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcz.container.limits import LARGE
from mcz.motion import Joint, Motion, Signal, Skeleton
from tools.vectors.build.files import Crafter, finished
from tools.vectors.build.spatial_clips import (
    CLIP,
    FRAME,
    MDTT,
    SCATTERED,
    UNLIKE,
    WEIGHTS,
    Ints,
    Plan,
    Spaces,
    basis_of,
    codec_of,
    listed,
    markers,
    motion_of,
    noise,
    still,
)

MOST = 2**40
LONG_CODES = ((*range(1, 15), 15, 15),) * 2
LEARNED = (basis_of(3, 3), basis_of(3, 3, 1), basis_of(3, 3, 2))


def add(shelf: Spaces) -> None:
    _lengths(shelf)
    _matrices(shelf)
    _steps(shelf)
    _codes(shelf)
    _sizes(shelf)
    _models(shelf)


def _lengths(shelf: Spaces) -> None:
    for n_frames in (0, 1, 2, 3, 8, 9, 17):
        for prefix in (False, True)[: 2 if n_frames in (1, 9) else 1]:
            plan = Plan(segments=(n_frames,) * bool(n_frames), prefix=prefix)
            name, how = ("-prefix", " in prefix codes") if prefix else ("", "")
            requests = [(n_frames // 2, n_frames)]
            purpose = f"A clip of {n_frames} frames{how}."
            shelf.plan(f"frames-{n_frames}{name}", purpose, plan, requests)
    plan = Plan(n_channels=0, segments=(6, 3))
    motion = Motion(Skeleton((Joint("rock"),)), (Signal(np.zeros((9, 0))),), name="still")
    shelf.plan("no-channels", "Nine frames without a channel.", plan, motion=motion)
    plan = Plan(n_channels=1, segments=(11,))
    shelf.plan("one-channel", "One channel.", plan, [(3, 4)])


def _matrices(shelf: Spaces) -> None:
    cases: dict[str, tuple[str, Plan]] = {
        "cosines": ("Cosines, one matrix", Plan(n_channels=7)),
        "cosines-apart": ("Cosines, three matrices", Plan(n_channels=15, apart=True)),
        "learned": ("One basis", Plan(n_channels=4, bases=(basis_of(4, 4),))),
        "learned-fewer": (
            "Two vectors of five entries",
            Plan(n_channels=5, bases=(basis_of(5, 2),)),
        ),
        "learned-apart": ("Three bases", Plan(n_channels=9, apart=True, bases=LEARNED)),
        "learned-unlike": (
            "Three bases, of one, three and two vectors",
            Plan(n_channels=9, apart=True, bases=UNLIKE),
        ),
        "weights": ("Weights from the least to the greatest", Plan(n_channels=12, weights=WEIGHTS)),
        "weights-apart": (
            "Weights, three matrices, bases",
            Plan(n_channels=9, apart=True, weights=WEIGHTS[3:], bases=LEARNED),
        ),
    }
    for name, (purpose, plan) in cases.items():
        for prefix in (False, True):
            end, how = ("-prefix", ", prefix codes") if prefix else ("", "")
            shelf.plan(f"{name}{end}", f"{purpose}{how}.", replace(plan, prefix=prefix), [(5, 12)])
    plan = Plan(n_channels=9, segments=(40,), window=40, step=0.1, fill=noise)
    purpose = "Sums that another order, or a fused product, would round to another number."
    bases = (basis_of(9, 9, shifts=SCATTERED),)
    plan = replace(plan, bases=bases, weights=bytes(range(120, 129)))
    shelf.plan("rounding", purpose, plan)


def _steps(shelf: Spaces) -> None:
    for name, step in (("third", 1 / 3), ("least", 2.0**-100), ("greatest", 2.0**100)):
        purpose = f"Coefficients are multiples of {step!r}."
        shelf.plan(f"step-{name}", purpose, Plan(step=step, segments=(12,)), [(2, 9)])


def _codes(shelf: Spaces) -> None:
    """Codes that are legal, from none to 90 lengths."""
    about = {"spec": "Prefix codes; Sparse lists"}
    plan = Plan(n_channels=2, segments=(9,), prefix=True)
    for name, purpose, lengths in (
        ("none", "Codes without a class, as there is no coefficient", ((), ())),
        ("none-of-90", "The same, said by 90 lengths of 0", ((0,) * 90,) * 2),
        ("none-beside", "Codes that nothing needs", ((1,), (0, 2, 1, 2))),
    ):
        made = replace(plan, fill=still, lengths=lengths)
        shelf.plan(f"codes-{name}", f"{purpose}.", made, [(4, 9)], **about)
    one = replace(plan, fill=_firsts)
    shelf.plan(
        "codes-single", "Codes of one class each.", replace(one, lengths=((1,), (1,))), **about
    )
    sides = replace(one, fill=_threes, n_channels=3, lengths=((1,), (0, 0, 1)))
    shelf.plan("codes-single-later", "A code whose one class is 2.", sides, **about)
    behind = replace(one, lengths=((1, 0, 0), (2, 1, 2, 0, 0)))
    shelf.plan("codes-zeros-behind", "Lengths of 0 behind the last code.", behind, **about)
    long = Plan(
        n_channels=17, segments=(17,), window=17, prefix=True, lengths=LONG_CODES, fill=_far
    )
    shelf.plan("codes-long", "Codes of 1 to 15 bits.", long, **about)


def _firsts(number: int, n_rows: int, n: int) -> Ints:
    """Frames of which every second one has a first coefficient."""
    table = np.zeros((n_rows, n), np.int64)
    table[::2, 0] = (-1) ** np.arange(len(table[::2]))
    return table


def _threes(number: int, n_rows: int, n: int) -> Ints:
    table = _firsts(number, n_rows, n)
    table[:, 1:2] = table[:, :1]
    return 3 * table


def _far(number: int, n_rows: int, n: int) -> Ints:
    """In each row one coefficient, in turn at each place but the last, of sizes 1 to 16."""
    table = np.zeros((n_rows, n), np.int64)
    for i in range(n_rows):
        table[i, i % 16] = (-1) ** i * (1 + 5 * i % 16)
    return table


def _sizes(shelf: Spaces) -> None:
    sizes = [1 + (2**k * 4 // 3 if k else 0) for k in range(40)] + [2**k for k in range(41)]
    sizes += [MOST, MOST - 1, 1, MOST, 2, MOST // 3, 3]
    signed = [(-1) ** (k * k // 2) * size for k, size in enumerate(sizes)]
    rows = [signed[i : i + 8] for i in range(0, len(signed), 8)]
    fill = listed(rows, [row[::-1] for row in rows[::-1]])
    plan = Plan(n_channels=len(rows), segments=(16,), fill=fill)
    if shelf.codec == FRAME:
        plan = Plan(n_channels=8, segments=(len(rows),) * 2, fresh=(True, False), fill=fill)
    shelf.plan("sizes", "Coefficients of all sizes to 2^40.", plan, spec="Residuals")
    classes = [*range(1, 17), *(1 + (2 + half) * 2**n + n for n in range(3, 39) for half in (0, 1))]
    classes = [min(size, MOST) for size in classes]
    signed = [(-1) ** (k // 3) * size for k, size in enumerate(classes)]
    rows = [signed[i : i + 8] for i in range(0, len(signed), 8)]
    plan = replace(plan, n_channels=len(rows), segments=(8,), fill=listed(rows), prefix=True)
    if shelf.codec == FRAME:
        plan = replace(plan, n_channels=8, segments=(len(rows),), fresh=())
    purpose = "Values of every class to 2^40 - 1, which means 2^40."
    shelf.plan("sizes-prefix", purpose, plan, spec="Prefix codes")
    great = [[MOST, -MOST, MOST], [-MOST, MOST], [0, MOST, -MOST]]
    for prefix in (False, True):
        end, how = ("-prefix", "In prefix codes t") if prefix else ("", "T")
        plan = Plan(segments=(3,), window=3, step=2.0**100, prefix=prefix, fill=listed(great))
        plan = replace(plan, weights=b"\xff\xfe\xfd")
        purpose = f"{how}he greatest coefficients with the greatest step and weights."
        shelf.plan(f"greatest{end}", purpose, plan)


def _models(shelf: Spaces) -> None:
    about = {"spec": "Bases; Space"}
    entries = [[MOST, -MOST, 1], [0, -1, MOST - 1], [0, 0, 0]]
    basis = basis_of(3, 3, entries=entries, shifts=[40, 0, 17])
    plan = Plan(bases=(basis,), segments=(9,))
    shelf.plan("model-entries", "Entries of up to 2^40, of 0 to 40 binary digits.", plan, **about)
    purpose = "A well-known model, which the file has not."
    known = Plan(shelf.codec, 93, (10,), window=6, apart=True, known="cmu31")
    motion = motion_of(known, skeleton=markers(31))
    shelf.plan("known", purpose, known, [(4, 7)], motion=motion, **about)
    embedded = replace(known, embedded=True)
    if shelf.codec == FRAME:
        purpose = "A well-known model that the file has, too."
        shelf.plan("known-embedded", purpose, embedded, [(4, 7)], motion=motion, **about)
    else:
        purpose = "A well-known model in a file of the archive profile, which has it."
        how = {"motion": motion, "profile": LARGE}
        shelf.plan("known-archive", purpose, embedded, [(4, 7)], **how, **about)
    _shared(shelf)


def _shared(shelf: Spaces) -> None:
    """Two clips, of two codecs, with one model."""
    other = CLIP if shelf.codec == FRAME else MDTT
    plans = [
        Plan(codec, 9, (n,), apart=True, bases=UNLIKE, step=0.5 * n)
        for codec, n in ((shelf.codec, 10), (other, 3))
    ]
    motions = [motion_of(plan, name=f"wave {i}") for i, plan in enumerate(plans)]
    crafter = Crafter()
    for plan, motion in zip(plans, motions, strict=True):
        crafter.clip(motion, codec=codec_of(plan), grouping="all", segment_frames=0)
    data = finished(crafter)
    assert sum(kind == b"MODL" for kind, _ in crafter.directory.shared) == 1
    purpose = f"Two clips with one model, the second of {other}."
    shelf.hold("model-shared", f"{shelf.spec}; MODL", purpose, data, *motions)
