"""Train the priors of posewave: how channels of a skeleton move together.

    python tools/train_priors.py OUT.json NAME FILE... [-- NAME FILE...]...

The FILEs behind a NAME have skeletons alike, and make one prior. An Acclaim motion FILE has its
skeleton with it: ``NAME.amc:NAME.asf``. The codec's own encoder codes each file, without a prior,
at the steps below; of rows of level 0 that are not all zeros the mean of q q' / (1 + 1.25 |q|)^2 is
taken, |q| the mean magnitude of a row, as decoders weigh rows that they learn from. A prior counts
for ``SEEN`` rows of that mean, beside the variance with which a channel begins that nobody knows.

The annex was made from the clips that TRAINED_ON names, without those the codec is measured with.
Changing a prior changes the format: they are an annex of SPEC.md.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.posewave import choices
from mcz.codecs.posewave.header import Header, parse_posewave_header
from mcz.codecs.posewave.model import (
    PRIOR_ROWS,
    UNITS,
    VARIANCE,
    VARIANCE_UNITS,
    layout_of,
    start_coder,
)
from mcz.codecs.posewave.orders import Orders
from mcz.codecs.posewave.row_coder import RowCoder, Stream, code_head
from mcz.codecs.posewave.segment import classes_of, encode_segment, kinds_of
from mcz.model.motion import Skeleton
from tools.training_clips import Piece, pieces_of, read, step_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TRAINED_ON = """
Acclaim, CMU: cmu/amc: 02_01 02_03 02_08 05_02 05_03 05_07 05_11 05_18 07_05 09_01 09_06 09_12 10_03
131_04 135_04 135_06 135_08 14_02 14_04 14_09 14_21 14_37 16_01 16_05 16_08 16_11 16_15 16_30 16_41
16_58 17_03 49_03 49_06 49_08
"""
STEPS = 0.14, 0.3, 0.6  # in cm
MOST_FRAMES = 3000  # of a clip
SURPLUS = 1.02, 0.01  # what a variance is multiplied by, and what is added, for clips not seen
LEAST = 0.005  # of an eigenvalue
DIGITS = 96  # of a line


class Covariance:
    """The sum of products of rows, and how many rows know each of them, (n, n)."""

    def __init__(self, n_channels: int) -> None:
        self.sums, self.counts = np.zeros((2, n_channels, n_channels))

    def add(self, rows: Floats, kept: Ints) -> None:
        live = rows[rows.any(axis=1)]
        scaled = live / (1 + 1.25 * np.abs(live).mean(axis=1, keepdims=True))
        at = np.ix_(kept, kept)
        self.sums[at] += scaled.T @ scaled
        self.counts[at] += len(live)

    def mean(self) -> Floats:
        """Positive definite; a channel that never moved has the median of variances."""
        found = self.sums / np.maximum(self.counts, 1)
        own = np.diag(found).copy()
        own[own <= 0] = np.median(own[own > 0])
        np.fill_diagonal(found, own * SURPLUS[0] + SURPLUS[1])
        values, vectors = np.linalg.eigh(found)
        mean: Floats = (vectors * np.maximum(values, LEAST)) @ vectors.T
        return mean


def coarsest_rows(header: Header, skeleton: Skeleton, values: Floats) -> tuple[Floats, Ints]:
    """The rows of level 0, in steps, and the channels that are kept."""
    weights = choices.weights_of(header.step * (skeleton.unit_cm or 1.0))
    streams, _ = encode_segment(header, skeleton, values, weights)
    _, data = Orders(header.orders, skeleton).read_notes(streams[0], len(values), "training")
    coder, classes = start_coder(header.start), classes_of(skeleton, header.whole)
    stream = Stream(coder, 0, data)
    moving, numbers = np.zeros((2, len(classes)), np.int64)
    code_head(stream, kinds_of(skeleton, header.whole), moving, numbers, "training")
    rows = RowCoder(header, classes, moving == 1, coder, "training")
    n_rows = len(values)
    for _ in range(header.levels):
        n_rows = -(-n_rows // 2)
    rows.begin(0, 0, n_rows, stream)
    return rows.decode(), np.flatnonzero(moving)


def rows_of(piece: Piece) -> Iterator[tuple[Floats, Ints]]:
    for step in STEPS:
        params = {"step": step_of(piece.skeleton, step), "levels": None}
        header = parse_posewave_header(choices.choose(piece, params).header, piece.layout)
        yield coarsest_rows(header, piece.skeleton, piece.frames)


def train(name: str, files: Sequence[str]) -> dict[str, object]:
    """A prior as the annex has it."""
    layout, covariance = None, Covariance(0)
    for file in files:
        motion = read(file)
        assert motion.skeleton is not None
        if layout is None:
            layout = layout_of(motion.skeleton)
            covariance = Covariance(motion.skeleton.n_channels)
        if layout != layout_of(motion.skeleton):
            raise SystemExit(f"{file}: not the skeleton of {files[0]}")
        for rows, kept in rows_of(next(pieces_of(motion, ((0, MOST_FRAMES),)))):
            covariance.add(rows, kept)
    assert layout is not None
    n = len(covariance.sums)
    root = np.linalg.cholesky(VARIANCE * np.eye(n) + PRIOR_ROWS * covariance.mean())
    own = np.diag(root)
    lower = np.clip(np.rint(root / own * UNITS), -127, 127)[np.tril_indices(n, -1)]
    digits = lower.astype(np.int8).tobytes().hex()
    return {
        "name": name,
        "parents": layout[0],
        "channels": layout[1],
        "lower": [digits[at : at + DIGITS] for at in range(0, len(digits), DIGITS)],
        "variances": np.rint(own * own * VARIANCE_UNITS).astype(int).tolist(),
    }


def format_priors(priors: Sequence[dict[str, object]]) -> str:
    """JSON, with a list on one line, but for digits."""
    tables = []
    for prior in priors:
        fields = {
            name: json.dumps(of, indent=4)[:-1] + "   ]" if name == "lower" else json.dumps(of)
            for name, of in prior.items()
        }
        tables.append("  {\n" + ",\n".join(f'   "{k}": {of}' for k, of in fields.items()) + "\n  }")
    return '{\n "priors": [\n' + ",\n".join(tables) + "\n ]\n}\n"


if __name__ == "__main__":
    jobs: list[list[str]] = [[]]
    for word in sys.argv[2:]:
        jobs.append([]) if word == "--" else jobs[-1].append(word)
    Path(sys.argv[1]).write_text(format_priors([train(name, files) for name, *files in jobs]))
