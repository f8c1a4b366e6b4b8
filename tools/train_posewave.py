"""Train the start tables of posewave: what its model knows before a clip.

    python tools/train_posewave.py OUT.json ROUNDS FILE...

An Acclaim motion FILE has its skeleton with it: ``NAME.amc:NAME.asf``. Each clip is cut into
beginnings and a piece of its middle (``PIECES``), for what a start table is worth shows in the
first frames of a segment. The codec's own encoder codes each piece at every step below, with the
tables as they are by then; ROUNDS times, for what it chooses depends on them.

What is learned again quickly is fitted to all pieces: the probability and the count of a context
are those of the beta distribution with which the ones and zeros of the pieces are likeliest. What
is learned slowly, such as weights of mixers, goes on from piece to piece without a reset, and the
mean over the pieces of a round is taken.

The annex was made in two rounds from the clips that TRAINED_ON names, without those the codec is
measured with; the first began with tables of a prototype. Each run begins with the annex of the
tree. Contexts of exponents, which no piece here has, stay even. Changing a table changes the
format: tables are annexes of SPEC.md.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding import mixing
from mcz.codecs.posewave import choices, segment
from mcz.codecs.posewave.header import parse_posewave_header
from mcz.codecs.posewave.model import N_SECOND, Start, start_of, start_tables
from mcz.codecs.posewave.model_state import (
    C_LEVEL,
    C_ROWS,
    N_CLASSES,
    N_OWN,
    N_SETS,
    N_SHARED,
    N_SLOTS,
    N_SMALL_MIXERS,
    USUAL,
    Model,
)
from tools.posewave_counting import Counting
from tools.training_clips import Piece, pieces_of, read, step_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TRAINED_ON = """
cmu/amc: 02_01 02_03 02_08 05_02 05_03 05_07 05_11 05_18 07_05 09_01 09_06 09_12 10_03 131_04 135_04
135_06 135_08 14_02 14_04 14_09 14_21 14_37 16_01 16_05 16_08 16_11 16_15 16_30 16_41 16_58 17_03
49_03 49_06 49_08
cmu/bvh: 06_01 06_10; cmu/bvh-3dsmax: 131_01 131_02; cmu/bvh-daz: 02_01 05_02 07_01 10_03 12_01
135_04 13_31; cmu/bvh-blender: 02_01; bvh-toolbox: test_mocapbank; pymo: AV_8Walk_Meredith_HVHA_Rep1
btk-data: Gait PiG_Motion3_FF; ezc3d-testfiles: Qualisys Vicon; c3d.org/sample_13: Dance
"""
SETS = (0.0035, 0.006, 0.011, 0.022, 0.045), (0.08, 0.13, 0.22, 0.36, 0.5)  # steps in cm
PIECES = (0, 360), (0, 1000), (800, 1500)  # frames
COUNTS = np.array([0, 1, 2, 3, 4, 6, 9, 13, 18, 26, 38, 55, 80, 120, 180, 250])
SPREAD = 0.02  # how much likelier a count is than one e times as far from 1, squared
N_SOME = 0.8  # bits that stand for what similar contexts have seen
FITTINGS = 3
SEED = 1
EARLY_SHARE = 0.4  # of the steps that a piece is coded with in a round before the last
PER_LINE = 192


class Seen:
    """Zeros and ones of contexts, by piece."""

    def __init__(self) -> None:
        self.parts: list[Ints] = []

    def add(self, zeros: Ints, ones: Ints, contexts: Ints | None = None) -> None:
        """``contexts``: which these are; several may be the same one."""
        used = np.flatnonzero(zeros + ones)
        which = used if contexts is None else contexts[used]
        self.parts.append(np.stack([which, zeros[used], ones[used]]).astype(np.int32))

    def fit(self, groups: Ints) -> tuple[Ints, Ints]:
        """Bytes of probabilities, and numbers in COUNTS; contexts of a group are alike."""
        which, zeros, ones = np.concatenate(self.parts, axis=1)
        return fit(which, zeros.astype(np.float64), ones.astype(np.float64), groups)


def fit(which: Ints, zeros: Floats, ones: Floats, groups: Ints) -> tuple[Ints, Ints]:
    """See ``Seen.fit``."""
    n, size = zeros + ones, len(groups)
    share = np.minimum(n, 50) / n  # so that a piece does not outweigh many
    best = np.zeros(size, np.int64)
    used = np.bincount(which, n, size)
    for _ in range(FITTINGS):
        s, s1 = np.bincount(which, n * share, size), np.bincount(which, ones * share, size)
        of_group = (np.bincount(groups, s1) + 0.4) / (np.bincount(groups, s) + 0.8)
        p = (s1 + N_SOME * of_group[groups]) / (s + N_SOME)
        best, most = np.zeros(size, np.int64), np.full(size, -np.inf)
        for k, count in enumerate(COUNTS):
            weight = float(count + 1)
            a = p[which] * weight
            b = weight - a
            likely = log_gamma(a + ones) - log_gamma(a) + log_gamma(b + zeros) - log_gamma(b)
            likely += log_gamma(np.array([weight])) - log_gamma(n + weight)
            total = np.bincount(which, likely, size) - SPREAD * np.log(weight) ** 2
            better = (total > most) & (count <= 4 * used)
            best[better], most[better] = k, total[better]
        share = 1 / (1 + (n - 1) / (COUNTS[best][which] + 2))
    return np.clip(np.floor(p * 256), 0, 255).astype(np.int64), best


def log_gamma(x: Floats) -> Floats:
    """Logarithm of gamma for numbers above 0: Stirling's series, shifted by 5."""
    z = x + 5
    series = (z - 0.5) * np.log(z) - z + 0.9189385332046727 + 1 / (12 * z) - 1 / (360 * z**3)
    found: Floats = series - np.log(x * (x + 1) * (x + 2) * (x + 3) * (x + 4))
    return found


def groups_of_slots() -> Ints:
    """Group of each slot: slots of shared contexts, then of own ones by class."""
    shared = np.searchsorted([C_LEVEL, C_ROWS], np.arange(N_SHARED), side="right")
    own = 3 + np.repeat(np.arange(N_CLASSES), N_OWN)
    kinds = np.concatenate([shared, own])
    found: Ints = (kinds[:, None] * N_SLOTS + np.arange(N_SLOTS)).ravel()
    return found


class Round:
    """Inputs and results of one round of coding."""

    def __init__(self, start: Start) -> None:
        self.start = start
        self.slots, self.small = Seen(), Seen()
        self.sums: dict[str, Any] = {}
        self.n_pieces, self.of_class = 0, np.zeros(N_CLASSES)

    def add(self, model: Model) -> None:
        """Learn from a model that has coded a piece."""
        classes, n = model.classes, len(model.classes)
        _, zeros, ones = model.slots.reshape(3, -1)
        shared = N_SHARED * N_SLOTS
        own = shared + (classes[:, None] * N_OWN * N_SLOTS + np.arange(N_OWN * N_SLOTS)).ravel()
        self.slots.add(zeros, ones, np.concatenate([np.arange(shared), own]))
        coder, zeros, ones = model.coder.reshape(3, -1)
        self.small.add(zeros[mixing.MODELS :: 2], ones[mixing.MODELS :: 2])
        counts = np.bincount(classes, minlength=N_CLASSES)
        self.n_pieces, self.of_class = self.n_pieces + 1, self.of_class + counts
        start, by_class = self.start, ByClass(classes)
        own_weights = by_class.mean(model.weights[N_SETS:], start.own_weights)
        small = start.small.copy()
        small[: 3 * 64] = coder[mixing.WEIGHTS : mixing.MODELS]
        self.start = start._replace(
            small=small,
            weights=model.weights[:N_SETS].copy(),
            own_weights=np.rint(own_weights).astype(np.int64),
            second=model.second.mean(axis=0).astype(np.int64),
            taps=model.taps.copy(),
            level_sizes=model.level_weights.copy(),
            own_sizes=by_class.mean(model.own_weights[:, :n].T, start.own_sizes),
        )
        for name in ("weights", "second", "taps", "level_sizes"):
            self.sum(name, getattr(self.start, name))
        self.sum("small", small[: 3 * N_SMALL_MIXERS])
        self.sum("own_weights", by_class.sum(model.weights[N_SETS:]))
        self.sum("own_sizes", by_class.sum(model.own_weights[:, :n].T))
        self.sum("usual", by_class.sum(model.features[USUAL, :n]))

    def sum(self, name: str, values: Any) -> None:
        self.sums[name] = self.sums.get(name, 0) + np.asarray(values, np.float64)

    def table(self) -> dict[str, Any]:
        """The fields that ``start_of`` reads."""
        means = {name: total / self.n_pieces for name, total in self.sums.items()}
        for name in ("own_weights", "own_sizes", "usual"):
            n = np.maximum(self.of_class, 1).reshape(-1, *[1] * (self.sums[name].ndim - 1))
            means[name] = self.sums[name] / n
        probabilities, counts = self.slots.fit(groups_of_slots())
        n_small = (len(self.start.small) - 3 * 64) // 2
        small_probabilities, small_counts = self.small.fit(np.arange(n_small))
        weights = np.concatenate([means["weights"], means["own_weights"]])
        return {
            "probabilities": digits(probabilities, 2),
            "counts": digits(counts, 1),
            "small_probabilities": digits(small_probabilities, 2),
            "small_counts": digits(small_counts, 1),
            "small_weights": np.rint(means["small"]).astype(int).tolist(),
            "weights": digits(np.rint(weights / 1024) + 128, 2),
            "second": digits(means["second"].reshape(N_SLOTS, N_SECOND) // 256, 2),
            **{
                name: np.rint(means[name] * 1024).astype(int).ravel().tolist()
                for name in ("taps", "level_sizes", "own_sizes", "usual")
            },
        }


@dataclass(frozen=True)
class ByClass:
    """Sums and means of what channels have, by their class; ``old`` where there are none."""

    classes: Ints

    def sum(self, values: Any) -> Floats:
        sums = [values[self.classes == k].sum(axis=0) for k in range(N_CLASSES)]
        return np.stack(sums).astype(np.float64)

    def mean(self, values: Any, old: Any) -> Floats:
        counts = np.bincount(self.classes, minlength=N_CLASSES)
        found = old.astype(np.float64)
        some = counts > 0
        n = counts[some].reshape(-1, *[1] * (found.ndim - 1))
        found[some] = self.sum(values)[some] / n
        return found


def digits(values: Any, n_digits: int) -> list[str]:
    """Hexadecimal digits of integers, so many each, in lines."""
    most = 16**n_digits - 1
    numbers = np.clip(values, 0, most).astype(int).ravel().tolist()
    text = "".join(f"{number:0{n_digits}x}" for number in numbers)
    return [text[at : at + PER_LINE] for at in range(0, len(text), PER_LINE)]


def levels_of(piece: Piece, steps: Sequence[float]) -> int:
    """Number of levels that the encoder chooses at the middle one of ``steps``."""
    middle = sorted(steps)[len(steps) // 2]
    if middle not in piece.levels:
        params = {"step": step_of(piece.skeleton, middle), "levels": None}
        choice = choices.choose(piece, params)
        piece.levels[middle] = parse_posewave_header(choice.header, piece.layout).levels
    return piece.levels[middle]


def train(
    pieces: Sequence[Piece], steps: Sequence[float], start: Start, share: float
) -> dict[str, Any]:
    """A start table from one round, in which each piece is coded at a ``share`` of the steps."""
    counting, now, size = COUNTING, Round(start), 0
    order = np.random.default_rng(SEED).permutation(len(pieces) * len(steps))
    for number in order[: int(share * len(order))].tolist():
        piece, step_cm = pieces[number // len(steps)], steps[number % len(steps)]
        skeleton = piece.skeleton
        params = {"step": step_of(skeleton, step_cm), "levels": levels_of(piece, steps)}
        choice = choices.choose(piece, params)
        header = replace(parse_posewave_header(choice.header, piece.layout), start=now.start)
        streams, _ = segment.encode_segment(header, skeleton, piece.frames, choice.weights)
        size += sum(map(len, streams))
        if len(counting.model.classes):
            now.add(counting.model)
    print(f"{steps}: {now.n_pieces} pieces, {size} bytes", file=sys.stderr, flush=True)
    return now.table()


def format_document(document: dict[str, Any]) -> str:
    """JSON, with a list of numbers on one line."""
    sets = [
        ",\n".join(
            f'  "{name}": '
            + (json.dumps(of) if isinstance(of[0], int) else json.dumps(of, indent=3)[:-1] + "  ]")
            for name, of in table.items()
        )
        for table in document["sets"]
    ]
    tables = ",\n".join(f" {{\n{text}\n }}" for text in sets)
    return f'{{\n "counts": {json.dumps(document["counts"])},\n "sets": [\n{tables}\n ]\n}}\n'


COUNTING = Counting()

if __name__ == "__main__":
    given = [piece for name in sys.argv[3:] for piece in pieces_of(read(name), PIECES)]
    starts = list(start_tables())
    for share in (*(EARLY_SHARE,) * (int(sys.argv[2]) - 1), 1.0):
        document = {"counts": COUNTS.tolist(), "sets": []}
        for index, steps in enumerate(SETS):
            document["sets"].append(train(given, steps, starts[index], share))
            starts[index] = start_of(document["sets"][index], COUNTS)
        Path(sys.argv[1]).write_text(format_document(document))
