"""The real files of the folder that MCZ_DATA names: every one comes back byte for byte."""

from __future__ import annotations

import os
import warnings
from collections import Counter
from pathlib import Path

import pytest

import mcz
from mcz import Motion, Skeleton, SkeletonWarning, SourceError
from mcz.sources import FORMATS, format_of
from mcz.sources.tables.csv_files import is_motion

DATA = Path(os.environ.get("MCZ_DATA", "no-data"))
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif("MCZ_DATA" not in os.environ, reason="MCZ_DATA is not set"),
]
SUFFIXES = {suffix for f in FORMATS.values() for suffix in f.suffixes}
MALFORMED = "malformed-in-the-wild"
REFUSED = {
    "no-hierarchy-section.bvh": "line 1: no HIERARCHY section",
    "empty.c3d": "offset 0: the file is truncated",
    "zero-filled.c3d": "offset 515: processor 0",
    "truncated.trc": "line 2: no line begins with Frame#",
}


def read(path: Path) -> Motion | Skeleton:
    source_format = format_of(path)
    data = path.read_bytes()
    if not source_format.wants_skeleton:
        return source_format.read(data, path.stem)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkeletonWarning)
        return mcz.read(path)


def files(malformed: bool) -> list[Path]:
    paths = sorted(p for p in DATA.rglob("*") if p.suffix.lower() in SUFFIXES)
    paths = [p for p in paths if p.suffix != ".csv" or is_motion(p.read_bytes())]
    assert paths
    return [path for path in paths if (MALFORMED in path.parts) == malformed]


def test_every_file_comes_back_byte_for_byte() -> None:
    """Nearly all numbers are spelled by the grids, without exceptions."""
    counts: Counter[str] = Counter()
    n_exceptions = n_tokens = 0
    for path in files(malformed=False):
        source_format = format_of(path)
        read_as = read(path)
        assert source_format.write(read_as) == path.read_bytes(), path
        counts[source_format.name] += 1
        if isinstance(read_as, Motion):
            n_exceptions += len(read_as.signals[0].exceptions)
            n_tokens += read_as.signals[0].values.size
    print(f"{dict(counts)}, {n_exceptions} exceptions among {n_tokens} tokens")
    assert n_exceptions < 2e-4 * n_tokens


def test_malformed_files_are_read_exactly_or_refused_with_a_reason() -> None:
    for path in files(malformed=True):
        if path.name in REFUSED:
            with pytest.raises(SourceError, match=REFUSED[path.name]):
                read(path)
        else:
            assert format_of(path).write(read(path)) == path.read_bytes(), path


def test_clips_of_one_make_share_a_template() -> None:
    motions = [read(path) for path in sorted((DATA / "cmu/bvh-daz").glob("*.bvh"))]
    templates = {m.source.template for m in motions if isinstance(m, Motion) and m.source}
    headers = {p.read_bytes().split(b"MOTION")[0] for p in (DATA / "cmu/bvh-daz").glob("*.bvh")}
    assert len(templates) == len(headers)
