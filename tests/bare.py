"""``python -m tests.bare [N [FILE]]``: MCZ with Python, NumPy and construct alone, as in Blender.

Every other package is refused, installed or not. N vectors of each codec and each group are decoded
(all of them without N); FILE is opened, asked, checked, salvaged, converted and written anew.
Prints how many vectors there were, what was loaded and how often it was said that loops are slow.
"""

from __future__ import annotations

import io
import json
import sys
import warnings
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

OWN = {"mcz", "tests", "conformance", "tools", "numpy", "construct"}


class Only(MetaPathFinder):
    """A finder that finds what is of Python, and ``allowed``, and nothing else."""

    def __init__(self, finder: Any, allowed: set[str]) -> None:
        self.finder, self.allowed = finder, allowed

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        top = name.partition(".")[0]
        if top not in sys.stdlib_module_names and top not in self.allowed:
            return None
        spec: ModuleSpec | None = self.finder.find_spec(name, path, target)
        return spec


def choose_vectors(most: int) -> list[str]:
    """The smallest vectors of each first codec and group, and of those with sources."""
    from tests.broken import answers

    kinds: dict[tuple[str, ...], list[str]] = {}
    for name, row in answers.vectors().items():
        codecs = tuple(row.get("codecs", [])[:1])
        kinds.setdefault((name.partition("/")[0], *codecs), []).append(name)
        if "sources" in row.get("modes", []):
            kinds.setdefault((name.partition("/")[0], *row.get("formats", [])), []).append(name)
    for names in kinds.values():
        names.sort(key=answers._size)
    return sorted({name for names in kinds.values() for name in names[:most]})


def decode_vectors(most: int) -> int:
    from tests.broken import answers

    names = choose_vectors(most) if most else sorted(answers.vectors())
    faults = {name: answers.fault(answers.vectors()[name]) for name in names}
    wrong = {name: fault for name, fault in faults.items() if fault}
    assert not wrong, wrong
    return len(names)


def use(path: Path) -> None:
    """Round-trip a source file and edit the result, with NumPy alone."""
    import numpy as np

    import mcz
    from mcz.files.reading.report import info

    data = path.read_bytes()
    with mcz.open(path) as file:
        (clip,) = file.find("n_frames > 10")
        values, part = clip.values[:], clip.read((5, 9))
        assert np.array_equal(part, values[5:9])
        assert len(clip.skeleton.joints) > 20
        assert mcz.positions(clip)[9:].shape[2] == 3
        source, motion = clip.source_bytes(), clip.motion((0, 12))
        assert info(file)["clips"]
    assert source == path.with_suffix(".source").read_bytes()
    assert mcz.convert(motion, "bvh")
    assert np.isfinite(mcz.rotations(mcz.resample(motion, 60), "euler")).all()
    assert mcz.verify(path) == []
    with mcz.open(data[:-40], salvage=True) as file:
        assert np.array_equal(file.only_clip().values[:], values)
    out = io.BytesIO()
    mcz.write(motion, out, codec="fast")
    with mcz.open(out.getvalue()) as file:
        assert np.array_equal(file.only_clip().values[:], values[:12])


def main(most: str = "0", path: str = "") -> int:
    sys.meta_path[:] = [Only(finder, OWN) for finder in sys.meta_path]
    with warnings.catch_warnings(record=True) as messages:
        warnings.simplefilter("always")
        n_vectors = decode_vectors(int(most))
        if path:
            use(Path(path))
    slow = [str(w.message) for w in messages if "plain Python" in str(w.message)]
    others = [
        f"{w.filename}:{w.lineno}: {w.message}" for w in messages if str(w.message) not in slow
    ]
    assert not others, others
    loaded = {name.partition(".")[0] for name in sys.modules} - sys.stdlib_module_names
    print(json.dumps({"vectors": n_vectors, "loaded": sorted(loaded & OWN), "slow": slow}))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
