"""The targets by name."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial

from tools.fuzz import files, readers
from tools.fuzz.guard import HangError, call_in_time
from tools.fuzz.mutation import Mutation
from tools.fuzz.repair import with_hashes
from tools.fuzz.seeds import vectors

AFRESH = 0.4
Check = Callable[[bytes], bool]
Mutator = Callable[[bytes, int, int], bytes]


@dataclass(frozen=True, slots=True)
class Target:
    """A property of bytes, the bytes to begin with, and how they are changed.

    ``check`` tells whether the bytes were decoded; it raises MczError where they are refused.
    ``mutator(data, most, seed)`` gives other bytes, at most so many; None: libFuzzer's own.
    """

    name: str
    purpose: str
    check: Check
    seeds: Callable[[], dict[str, bytes]]
    mutator: Mutator | None = None
    words: Sequence[str] = ()


def _reader(name: str, check: Check) -> Target:
    purpose = f"{name.upper()} text or bytes: read, written, stored and restored"
    seeds = partial(readers.seeds, name)
    return Target(name, purpose, check, seeds, words=readers.words(name))


def mutator(raw: float, seeds: Callable[[], dict[str, bytes]], hashed: float = 0) -> Mutator:
    """Mutations by structure, repaired; ``raw`` is how often bytes are changed as they are.

    ``hashed`` is how often the hashes of values and sources are made right, too. Most of what
    libFuzzer keeps is refused, so that some mutations begin with a seed.
    """
    known = cache(lambda: sorted(seeds().values()))

    def mutate(data: bytes, most: int, seed: int) -> bytes:
        import atheris

        rng = random.Random(seed)
        begin = rng.choice(known()) if rng.random() < AFRESH else data
        made = Mutation(rng, atheris.Mutate).of(begin, most, raw)
        if rng.random() < hashed:
            with suppress(Exception, HangError):  # what goes wrong does so in the check, too
                right = call_in_time(partial(with_hashes, max_decoded=files.DECODED), made)
                made = right if len(right) <= most else made
        return made

    return mutate


def _decoder(name: str, *folders: str) -> Target:
    seeds = partial(vectors, *folders)
    purpose = f"{', '.join(folders)}: headers, models and streams behind right checksums"
    return Target(name, purpose, files.check_decoder, seeds, mutator(0.01, seeds))


TARGETS: dict[str, Target] = {
    target.name: target
    for target in (
        _reader("bvh", readers.check_bvh),
        _reader("asf", readers.check_asf),
        _reader("amc", readers.check_amc),
        _reader("c3d", readers.check_c3d),
        _reader("trc", readers.check_trc),
        _reader("mot", readers.check_mot),
        _reader("sto", readers.check_sto),
        _reader("csv", readers.check_csv),
        _reader("mvnx", readers.check_mvnx),
        _reader("npy", readers.check_npy),
        _reader("npz", readers.check_npz),
        _reader("pickle", readers.check_pickle),
        _reader("torch", readers.check_torch),
        Target(
            "mcz",
            "whole files: strict, in parts, salvaged, live, verified",
            files.check_file,
            vectors,
            mutator(0.2, vectors, hashed=0.5),
        ),
        _decoder("raw", "raw", "numbers", "notes"),
        _decoder("best", "best"),
        _decoder("fast", "fast"),
        _decoder("wavelets", "mrdwt", "dwt", "awt"),
        _decoder("qbc", "qbc"),
        _decoder("pca", "pca", "pca-rdo", "mdtt"),
        _decoder("lsdt", "lsdt-frame", "lsdt-clip"),
        _decoder("online", "online"),
        _decoder("posewave", "posewave"),
        _decoder("sources", "sources", "skeletons"),
        _decoder("others", "filtered", "cut", "container", "packets", "clip", "data", "shared"),
    )
}
