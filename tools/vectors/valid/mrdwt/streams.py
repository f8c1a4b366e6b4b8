"""Streams of mrdwt: wavelets, levels, steps, heads, coefficients."""

from __future__ import annotations

from mcz.codecs.parameters import SCALED
from mcz.codecs.wavelet.streams import CONSTANT, MAX_INDEX
from mcz.transforms.wavelets import MAX_LEVELS, MAX_TAP, MAX_TAPS, WAVELETS, Wavelet
from tools.vectors.build.motions import wave
from tools.vectors.build.wavelet_clips import (
    BIOR,
    DB2,
    DB3,
    DB8,
    HAAR,
    HEADING,
    Band,
    Head,
    Plan,
    Wave,
    Waves,
    details,
    waves,
    zeros,
)

WAVELET_HEADING = "Wavelets"
EQUAL = (Head(halves=CONSTANT, predictor=0),)
SPEC = f"{HEADING}; Residuals"
_SINGLE: tuple[tuple[list[int], int], ...] = (([0], 0), ([-1], 1), ([2**40], 62), ([-(2**40)], 40))


def add(shelf: Waves) -> None:
    _wavelets(shelf)
    _inline(shelf)
    _levels(shelf)
    _decimals(shelf)
    _steps(shelf)
    _predictors(shelf)
    _constants(shelf)
    _empty(shelf)
    _details(shelf)
    _sizes(shelf)


def _wavelets(shelf: Waves) -> None:
    spec = f"{HEADING}; {WAVELET_HEADING}"
    for id_, name in enumerate(WAVELETS, 1):
        plan = Plan(45, id_, levels=3, decimals=id_ % 5)
        requests = [(0, (17, 24), None), (1, (0, 45), None), (3, (40, 45), None)]
        purpose = f"The registered wavelet {name}, 3 levels of an odd number of frames."
        shelf.wave(f"wavelet-{name.replace('.', '-')}", purpose, plan, spec=spec, requests=requests)


def _inline(shelf: Waves) -> None:
    spec = f"{HEADING}; {WAVELET_HEADING}"
    many = tuple(((37 * k) % MAX_TAPS - 31.5) / 96 for k in range(MAX_TAPS))
    tiny = 2.0**-520
    filters = {
        "2-taps": ("Filters of two taps, no wavelet's", Wavelet((0.9, 0.3), (-0.2, 1.1))),
        "64-taps": ("Filters of 64 taps", Wavelet(many, many[::-1])),
        "greatest-taps": (
            "Taps of 16 and -16",
            Wavelet((MAX_TAP, -MAX_TAP, 1.0, 0.0), (-MAX_TAP, 0.5, -0.0, MAX_TAP)),
        ),
        "subnormal": (
            "Taps so small that values are subnormal or vanish",
            Wavelet((tiny, 3 * tiny, -tiny, tiny / 7), (-tiny, tiny, 5e-324, 0.0)),
        ),
        "rounding": (
            "Sums that another order, or a fused product, would round to another number",
            Wavelet((1 / 3, 0.1, -2 / 3, 0.7, 1 / 7, -0.3), (0.1, -1 / 9, 0.6, 1 / 3, -0.9, 0.2)),
        ),
    }
    for name, (purpose, filter_) in filters.items():
        plan = Plan(37, filter_, decimals=1)
        requests = [(0, (5, 9), None), (2, (0, 37), None)]
        shelf.wave(f"inline-{name}", f"{purpose}.", plan, spec=spec, requests=requests)


def _levels(shelf: Waves) -> None:
    for levels in range(6):
        plan = Plan(71, DB3, levels)
        requests = [(levels // 2, (31, 44), None), (levels, (0, 71), None)]
        shelf.wave(f"levels-{levels}", f"{levels} levels.", plan, requests=requests)
    plan = Plan(150, HAAR, 7, least=3)
    purpose = "Seven bands of details: all start tables, the last of them for four bands."
    shelf.wave("start-tables", purpose, plan, spec=f"{HEADING}; Entropy coding")
    for name, id_ in (("haar", HAAR), ("db2", DB2), ("db8", DB8)):
        plan = Plan(3, id_, MAX_LEVELS, decimals=1)
        requests = [(16, (0, 3), None), (3, (2, 3), None)]
        purpose = f"16 levels of a clip of 3 frames, {name}."
        shelf.wave(f"levels-16-{name}", purpose, plan, requests=requests)
    plan = Plan(5, DB8, 4)
    purpose = "A wavelet of 16 taps on 5 frames: more coefficients than frames."
    shelf.wave("short-for-its-taps", purpose, plan, requests=[(0, (1, 3), None)])
    for n in range(8, 13):
        plan = Plan(n, BIOR, 3, decimals=3)
        shelf.wave(f"length-{n}", f"{n} frames: lengths odd or even on the way down.", plan)


def _decimals(shelf: Waves) -> None:
    for decimals in (0, 1, 15):
        plan = Plan(40, BIOR, decimals=decimals)
        shelf.wave(f"decimals-{decimals}", f"Coefficients of {decimals} decimals.", plan)
    plan = Plan(24, HAAR, 0, decimals=15)
    a = [(2**40 - 7 * k * k) * (-1) ** k for k in range(24)]
    purpose = "Long coefficients with 15 decimals, divided once and not multiplied by 10^-15."
    shelf.wave("decimals-15-long", purpose, plan, [zeros(plan, a=a)])
    plan = Plan(40, decimals=SCALED, unit=0.25)
    purpose = "Scaled coefficients; a detail is set back by a sixteenth of a step."
    shelf.wave("scaled", purpose, plan, requests=[(1, (9, 17), None)])


def _steps(shelf: Waves) -> None:
    steps = (0, 1, 2, 3, 127, 128, 129, 254, 255)
    plan = Plan(13, DB2, decimals=SCALED, unit=1 / 3)
    made = [Wave(w.bands, (Head(s),)) for w, s in zip(waves(plan, 9), steps, strict=True)]
    purpose = "Step codes from 0 to 255, a channel each."
    shelf.wave("step-codes", purpose, plan, made)
    for name, unit, step in (("least", 2.0**-100, 0), ("greatest", 2.0**100, 255)):
        plan = Plan(13, DB2, decimals=SCALED, unit=unit)
        made = list(waves(plan, heads=(Head(step),)))
        purpose = f"A unit of {unit!r} with step code {step}."
        shelf.wave(f"unit-{name}", purpose, plan, made)


def _predictors(shelf: Waves) -> None:
    curve = [round(100 * value) for value in wave(48, 3)]
    for predictor in range(4):
        for halves in (0, 9, 62):
            plan = Plan(48, BIOR, 0)
            made = [zeros(plan, a=curve, heads=(Head(0, predictor, halves),))]
            purpose = f"Predictor {predictor}, a first scale of {halves} half octaves."
            shelf.wave(f"predict-{predictor}-scale-{halves}", purpose, plan, made, spec=SPEC)
    plan = Plan(3, HAAR, 0)
    made = [
        zeros(plan, a=[-9, 12, 5], heads=(Head(0, predictor, 5 + predictor),))
        for predictor in range(4)
    ]
    purpose = "Three approximations: a predictor has too few before it."
    shelf.wave("predict-first", purpose, plan, made)
    made = [Wave([values[:1]], heads=(Head(0, 3, halves),)) for values, halves in _SINGLE]
    purpose = "One approximation under heads with scales: no bits follow."
    shelf.wave("predict-nothing", purpose, Plan(1, HAAR, 0), made)
    ramp = [(-7 * k) * (1 if k < 30 else -1) for k in range(60)]
    plan = Plan(60, HAAR, 0, decimals=0)
    made = [zeros(plan, a=ramp, heads=(Head(0, p, 3),)) for p in range(4)]
    purpose = "Ramps, down and up, which some predictors hit: shifts of negative numbers."
    shelf.wave("predict-ramps", purpose, plan, made)


def _constants(shelf: Waves) -> None:
    plan = Plan(29, BIOR)
    n, whole = plan.lengths[-1], waves(plan, 3)
    made = [
        zeros(plan, a=[4321] * n, heads=EQUAL),
        zeros(plan, a=[-1] * n, heads=EQUAL),
        Wave([[-777] * n, *whole[2].bands[1:]], EQUAL),
        zeros(plan, a=[300] * n, heads=(Head(0, 2, 8),)),
    ]
    purpose = "Equal approximations, said once: alone, negative, with details; and one in bits."
    shelf.wave("constants", purpose, plan, made, requests=[(2, (3, 8), None)])
    plan = Plan(6, HAAR, 0, decimals=0)
    made = [zeros(plan, a=[sign * MAX_INDEX] * 6, heads=EQUAL) for sign in (1, -1)]
    purpose = "Constants of 2^40 and -2^40."
    shelf.wave("constants-greatest", purpose, plan, made)


def _empty(shelf: Waves) -> None:
    plan = Plan(33, DB3, 3)
    purpose = "Nothing but empty streams: all values are 0."
    shelf.wave("empty", purpose, plan, [zeros(plan)] * 2)
    silent = zeros(plan)
    full = waves(plan)[0]
    made = [
        Wave([silent.bands[0], *full.bands[1:]]),
        Wave([*full.bands[:2], silent.bands[2], full.bands[3]]),
        Wave([full.bands[0], silent.bands[1], full.bands[2], silent.bands[3]]),
    ]
    purpose = "An empty approximation or detail above others, whose context is zeros."
    shelf.wave("empty-between", purpose, plan, made, requests=[(1, (10, 12), None)])
    scaled = Plan(33, DB3, 3, decimals=SCALED, unit=0.5)
    made = [
        Wave([silent.bands[0], *full.bands[1:]], (Head(140, 0, CONSTANT),)),
        Wave([silent.bands[0], *full.bands[1:]], (Head(90, 2, 4),)),
        zeros(scaled, heads=(Head(7, 0, CONSTANT),), spoken=(0,)),
        zeros(scaled),
    ]
    purpose = "Approximations of 0 that say the step of their details, one of them in bits."
    shelf.wave("empty-with-step", purpose, scaled, made)
    made = [Wave([full.bands[0], *silent.bands[1:]], spoken=(1, 2, 3))]
    purpose = "Zeros that are written with bits."
    shelf.wave("zeros-written", purpose, Plan(33, DB3, 3), made)


def _details(shelf: Waves) -> None:
    for name, least in (("2", 2), ("1000", 1000), ("2-39", 2**39)):
        plan = Plan(40, DB3, least=least, decimals=0)
        purpose = f"No detail but 0 is smaller than {least}."
        shelf.wave(f"least-{name}", purpose, plan, spec=SPEC, requests=[(1, (30, 40), None)])
    plan = Plan(600, HAAR, 1)
    lone = {1, 4, 9, 17, 34, 67, 134, 270, 271, 299}
    band = [(-1) ** k * (k % 7 + 1) if k in lone else 0 for k in range(300)]
    purpose = "Runs of zeros of all lengths to 135, between lone details."
    shelf.wave("runs", purpose, plan, [zeros(plan, d1=band)], spec=SPEC)
    plan = Plan(64, DB2, 3)
    loud = [[40 * value for value in band] for band in waves(plan)[0].bands]
    made = [Wave([loud[0], *(details(plan, len(band), 3) for band in loud[1:3]), loud[3]])]
    purpose = "Details far larger than those of the coarser band beside them."
    shelf.wave("louder", purpose, plan, made, spec=SPEC)
    plan = Plan(400, HAAR, 1)
    noise = [(k * k * 7919 + 31 * k) % 997 - 498 for k in range(200)]
    made = [zeros(plan, a=noise[::-1], d1=noise, heads=(Head(0, 0, 16),))]
    purpose = "Noise without a zero: probabilities and weights reach far."
    shelf.wave("noise", purpose, plan, made, spec=SPEC)


def _sizes(shelf: Waves) -> None:
    lengths = [*range(41), *range(39, -1, -1), *[40, 0, 39, 1, 30, 2, 20, 10, 0, 0, 0, 40] * 2]
    sized = [(2**n * 2 // 3 + n % 3) * (-1) ** (n // 2) if n else 0 for n in lengths]
    most = [-MAX_INDEX, MAX_INDEX, MAX_INDEX, -MAX_INDEX, 0, -MAX_INDEX, MAX_INDEX]
    plan = Plan(len(sized) + 7, HAAR, 0, decimals=3)
    made = [zeros(plan, a=[*sized, *most], heads=(Head(0, p, 6),)) for p in (0, 3)]
    purpose = "Approximations of all sizes to 2^40, and leaps from end to end: 42 bits and more."
    shelf.wave("sizes", purpose, plan, made, spec=SPEC)
    ends: list[Band] = []
    for least in (1, 2**39):
        plan = Plan(2 * len(sized) + 8, HAAR, 1, decimals=3, least=least)
        greatest = MAX_INDEX - 1
        band = [value if abs(value) >= least else 0 for value in sized]
        ends = [band, [greatest, -greatest, 0, -greatest]]
        made = [zeros(plan, d1=[value for part in ends for value in part])]
        purpose = f"Details of all sizes to 2^40 - 1, none below {least}."
        shelf.wave(f"sizes-details-{least}", purpose, plan, made, spec=SPEC)
