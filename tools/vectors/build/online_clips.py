"""Files of ``online``, to order, and what is in them.

The values are summed from the coefficients, never decoded: a decoder has to agree.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import codec_by_name, raw
from mcz.codecs.contract import Encoded
from mcz.codecs.online import coder as online_coder
from tools.vectors.build.online_units import (
    ONE,
    ONLINE,
    Coding,
    Plan,
    header,
    segments_of,
)
from tools.vectors.build.spatial_clips import Ints

Floats = NDArray[np.float64]


def values_of(plan: Plan) -> Floats:
    """The values of all frames, of coefficients that may be none as well."""
    coder = online_coder.Coder(header(plan), plan.space.layout)
    space, table = coder.space, plan.table
    values = np.zeros((len(table), plan.n_channels))
    now = reference = np.zeros(plan.n_channels)
    step = ltr_step = 0
    for f, kind in enumerate(plan.kinds):
        here = table[f].any() or f in plan.said
        step = plan.steps(f, kind) if here else (step, ltr_step, ONE)[kind]
        now = (now, reference, np.zeros(plan.n_channels))[kind].copy()
        if here:
            _add(space, now, table[f], space.step * ((8 + step % 8) * 2.0 ** (step // 8 - 35)))
        if kind:
            ltr_step, reference = step, now
        values[f] = now
    return values


def _add(space: Any, values: Floats, row: Ints, step: float) -> None:
    """Add what the coefficients stand for."""
    for m, columns in enumerate(space.columns):
        sums = np.zeros(len(columns))
        for r in range(space.starts[m], space.starts[m + 1]):
            sums = sums + float(row[r]) * space.vectors[r]
        values[columns] = values[columns] + (sums * step) * space.weights[columns]


def codec_of(plan: Plan, coding: type[Coding] = Coding) -> Any:
    """The codec with this content, whatever the values of the motion."""
    model = plan.space.model
    own = (model,) if model and (plan.embedded or not plan.known) else ()
    known = (model,) if model and plan.known else ()

    def encode(source: Any, params: Any) -> Encoded:
        made = iter(segments_of(plan, coding))
        return Encoded(header(plan), made, models=own, known_models=known, preset=plan.preset)

    def decode(header: bytes, layout: Any, spans: Any, request: Any, fetch: Any) -> Floats:
        return values_of(plan)[request.start : request.stop]

    changes: dict[str, Any] = {
        "encode": encode,
        "decode": decode,
        "parameters": raw.CODEC.parameters,
    }
    return replace(codec_by_name(ONLINE), **changes, dial=None)


def steps_in_turn(values: Sequence[int]) -> Callable[[int, int], int]:
    """Steps of these codes in turn."""
    return lambda number, kind: values[number]
