"""Streams of ``best``, to order: references and echoes that its encoder would never choose.

Heads are those that the encoder of fast chooses, in integers alone but for taps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mcz.codecs.coding.fast.encoder import StreamBuilder
from mcz.codecs.lossless.best import AS_FAST, code_plan
from mcz.codecs.lossless.echoes import Echo
from mcz.model.numbers import Grid


def build_stream(
    ordinals: Any,
    grids: tuple[Grid, ...],
    clip_grids: Sequence[Grid],
    references: Sequence[Sequence[int]],
    *,
    method: int = 1,
    echoes: Sequence[Echo] = (),
) -> bytes:
    """The stream of a group; of method 0 where no channel is coded, of method 2 with ``echoes``.

    ``references``: of each coded channel; of more than there are, the first ones are taken.
    """
    builder = StreamBuilder(clip_grids, [range(len(clip_grids))])
    plan = builder.plan(np.array(ordinals, np.int64), grids)
    n_coded = len(plan.lanes.numbers)
    if method == AS_FAST or n_coded == 0:
        return bytes((AS_FAST,)) + builder.write(plan)[0]
    return code_plan(plan, references[:n_coded], echoes)
