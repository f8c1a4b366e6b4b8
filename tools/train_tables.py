"""Train the start tables of lossy codecs: the states in which their coders begin.

    python tools/train_tables.py wavelet|qbc|pca|window|frame|online OUT.json FILE...

The files are coded twice, with every setting below, by coders that are never reset; see
``tools/start_tables.py``.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import mcz
from mcz.codecs import space
from mcz.codecs.coding import residuals
from mcz.codecs.contract import Codec
from mcz.codecs.curves import kernels as qbc_kernels
from mcz.codecs.curves import qbc
from mcz.codecs.curves import streams as qbc_streams
from mcz.codecs.online import coder as online_coder
from mcz.codecs.online import online
from mcz.codecs.pca import pca
from mcz.codecs.pca import streams as pca_streams
from mcz.codecs.spatial import lsdt_frame, window_codecs, windows
from mcz.codecs.wavelet import streams as wavelet_streams
from mcz.codecs.wavelet.threshold_codecs import MRDWT
from mcz.files.writing.planning import prepare
from mcz.files.writing.signal_source import MemorySource
from mcz.model.motion import Motion
from tools.start_tables import Kept, reset_state, table

SEGMENT_BYTES = 2**26


@dataclass(frozen=True)
class Plan:
    """A module with ``_start_states``, the codec that uses them, mixers and counts of each set."""

    module: ModuleType
    codec: Codec
    n_mixers: tuple[int, ...]
    max_count: int
    settings: tuple[Mapping[str, Any], ...]


PLANS = {
    "wavelet": Plan(
        wavelet_streams,
        MRDWT,
        (residuals.N_MIXERS,) * wavelet_streams.N_SETS,
        24,
        (
            {"T_g": 0.05},
            {"preset": "khan2016", "T_g": 12},
            {"T_g": 0.2},
            {"T_g": 0.5, "N": 5},
            {"preset": "khan2016", "T_g": 3},
            {"T_g": 1},
            {"T_g": 3, "N": 5},
            {"preset": "khan2016", "T_g": 30},
        ),
    ),
    "qbc": Plan(
        qbc_streams,
        qbc.CODEC,
        (residuals.N_MIXERS, qbc_kernels.N_DETAIL_MIXERS),
        24,
        (
            {"d2_lmt": 0.1},
            {"preset": "khan2014", "d2_lmt": 5},
            {"d2_lmt": 1},
            {"d2_lmt": 5, "delta": 120},
            {"preset": "khan2014", "d2_lmt": 24},
            {"d2_lmt": 24},
            {"d2_lmt": 5, "breaks": "fewest"},
        ),
    ),
    "pca": Plan(
        pca_streams,
        pca.CODEC,
        (pca_streams.N_SETS * residuals.N_MIXERS,),
        24,
        (
            {"q": 30},
            {"preset": "khan2014", "q": 22},
            {"q": 16},
            {"q": 20},
            {"preset": "khan2014", "q": 13},
            {"q": 24},
            {"q": 40},
            {"q": 12},
        ),
    ),
    "window": Plan(
        windows,
        window_codecs.LSDT_CLIP,
        (space.N_SETS * residuals.N_MIXERS,),
        60,  # of the few bits of a window
        (
            {"step": 0.02},
            {"step": 0.5, "window": 60},
            {"step": 0.1},
            {"step": 0.05, "window": 120},
            {"step": 1.0},
            {"step": 0.2, "window": 120},
            {"step": 0.3, "domain": "channels"},
        ),
    ),
    "frame": Plan(
        lsdt_frame,
        lsdt_frame.CODEC,
        (space.N_SETS * residuals.N_MIXERS,),
        24,
        (
            {"step": 0.02},
            {"step": 0.5},
            {"step": 0.1},
            {"step": 0.3, "domain": "channels"},
            {"step": 0.05},
            {"step": 1.0},
            {"step": 0.2},
        ),
    ),
    "online": Plan(
        online_coder,
        online.CODEC,
        (3 * residuals.N_MIXERS,) * 2 + (0,) * 2,
        20,  # of the few bits of a group
        (
            {"step": 0.2},
            {"preset": "mod", "step": 1.0},
            {"step": 1.0, "intra_period": 2},
            {"preset": "mod", "step": 0.3, "intra_period": 2, "ltr_step": 0.5},
            {"step": 0.4, "ltr_step": 1},
            {"preset": "mod", "step": 2.0, "intra_period": 3},
            {"step": 2.0, "intra_period": 1},
            {"preset": "mod", "step": 0.6, "ltr_step": 0.4},
            {"step": 0.6, "ltr_step": 0.3},
            {"preset": "mod", "step": 1.4},
        ),
    ),
}


def train(plan: Plan, motions: Sequence[Motion]) -> list[np.ndarray]:
    """The mean state of every set after the files of the second round."""
    states = [reset_state(state) for state in plan.module._start_states()]
    kept = tuple(state.view(Kept) for state in states)
    plan.module._start_states = lambda: kept  # type: ignore[attr-defined]
    totals = [np.zeros_like(state) for state in states]
    rounds = 0
    for number, motion in enumerate([*motions, *motions]):
        sizes = []
        for setting in plan.settings:
            options = plan.codec.options(setting)
            source = MemorySource(
                prepare_clip(plan.codec, setting, motion), 0, plan.codec, SEGMENT_BYTES
            )
            encoded = plan.codec.encode(source, options)
            sizes.append(sum(len(s) for part in encoded.segments for s in part.streams))
            if number >= len(motions):
                rounds += 1
                for total, state in zip(totals, states, strict=True):
                    total += state
        print(f"{motion.name}: {sizes}", file=sys.stderr)
    return [total // rounds for total in totals]


def prepare_clip(codec: Codec, params: Mapping[str, Any], motion: Motion) -> Motion:
    """A clip as input of the codec."""
    return prepare(motion, codec, params).motion


if __name__ == "__main__":
    chosen = PLANS[sys.argv[1]]
    trained = train(chosen, [mcz.read(name) for name in sys.argv[3:]])
    sets = [
        table(state, n_mixers, chosen.max_count)
        for state, n_mixers in zip(trained, chosen.n_mixers, strict=True)
    ]
    Path(sys.argv[2]).write_text(json.dumps({"sets": sets}, indent=1) + "\n")
