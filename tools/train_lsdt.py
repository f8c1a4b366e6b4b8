"""Train the bases that ship with the package: those of the 31 points of the CMU ASF skeleton.

    python tools/train_lsdt.py OUT.bin CLIP.amc...
    python tools/train_lsdt.py --bvh OUT.bin CLIP.amc...
    python tools/train_lsdt.py --virtual-markers OUT.bin CLIP.amc...

The recipe is ``mcz.codecs.training.SHIPPED``, tried from several starts; the best basis of each
coordinate is kept; ``mcz train`` takes any other. With --bvh the clips are converted first, and the
points are the 38 of CMU's BVH files. With three virtual markers a joint beside the
points it is ``VIRTUAL``: mirrored axes are no axes, and one start of so many points is near enough.
The clips were ``TRAINING_CLIPS`` of tools/papers/hou2016/training.py, in that order. BLAS differs
between machines in the last digits, which may turn an entry: what is normative is the file, by its
hash.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from fractions import Fraction
from functools import reduce
from pathlib import Path

import numpy as np

import mcz
from mcz.codecs.basis_models import build_bases, falling_digits, round_vectors
from mcz.codecs.training import SHIPPED, Recipe, Trained, training_set

TRIES = (("dct", 20), ("haar", 20), ("dct", 40), ("haar", 40), ("dct", 80))
VIRTUAL = Recipe(sparsity=16, iterations=150, growth=6, headings=4, every=4)
VIRTUAL_DIGITS = 12, 5  # binary, from the first vector to the last: more save no bytes
SHOWN = (0, 1, 10, 50, 100, 200, 300)


def lines(trained: Trained) -> list[str]:
    """The convergence of each coordinate, in cm rms a point and coordinate."""
    found = []
    for axis, learned in zip("xyz", trained.learned, strict=True):
        left = trained.left_out(learned)
        marks = [learned.n_growth + mark for mark in SHOWN]
        shown = left[np.minimum([0, *marks], len(left) - 1)]
        figures = " ".join(f"{value:.4f}" for value in shown)
        found.append(f"{axis}: {learned.n_iterations} iterations, rms left out: {figures} cm")
    return found


def main(out: str, *given: str) -> None:
    clips = list(given)
    if out == "--virtual-markers":
        with_virtual_markers(*clips)
        return
    as_bvh = out == "--bvh"
    if as_bvh:
        out, *clips = clips
    decoded = training_set(_convert_to_bvh(clip) if as_bvh else mcz.read(clip) for clip in clips)
    tries = []
    for start, growth in TRIES:
        tries.append(replace(SHIPPED, start=start, growth=growth).learn(decoded))
        print(f"from {start}, growth {growth}", *lines(tries[-1]), sep="\n  ", file=sys.stderr)
    trained = reduce(Trained.better, tries)
    Path(out).write_bytes(trained.data)
    print(f"{out}: {len(trained.data)} bytes from {trained.n_vectors} vectors", file=sys.stderr)
    for line in lines(trained):
        print(line, file=sys.stderr)


def _convert_to_bvh(clip: str) -> mcz.Motion:
    motion = mcz.read(clip)
    return mcz.convert(replace(motion, frame_rate=motion.frame_rate or Fraction(120)), "bvh")


def with_virtual_markers(out: str, *clips: str) -> None:
    motions = (mcz.in_positions(mcz.read(clip), virtual_markers=True) for clip in clips)
    trained = VIRTUAL.learn(training_set(motions))
    digits = falling_digits(len(trained.source.names), *VIRTUAL_DIGITS)
    bases = [round_vectors(found.basis, digits) for found in trained.learned]
    Path(out).write_bytes(build_bases(bases))
    for line in lines(trained):
        print(line, file=sys.stderr)


if __name__ == "__main__":
    main(*sys.argv[1:])
