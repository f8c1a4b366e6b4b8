"""A decoder that breaks one rule of SPEC.md fails the vectors that are said to show it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.broken import answers
from tests.broken.table import BREAKS

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def nursery() -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, "-W", "ignore", "-m", "tests.broken.nursery"],
        cwd=ROOT,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        yield process


@pytest.mark.parametrize("name", BREAKS)
def test_a_broken_rule_is_caught(name: str, nursery: subprocess.Popen[str]) -> None:
    assert nursery.stdin is not None
    assert nursery.stdout is not None
    nursery.stdin.write(f"{name}\n")
    nursery.stdin.flush()
    found = json.loads(nursery.stdout.readline())
    assert isinstance(found, dict), found
    assert len(found) == len(BREAKS[name].vectors)
    assert all(found.values()), [file for file, faults in found.items() if not faults]
    told = [fault for faults in found.values() for fault in faults]
    assert BREAKS[name].crashes == all(f": {answers.CRASH}: " in fault for fault in told), told


def test_without_a_break_nothing_is_caught() -> None:
    names = sorted({vector for row in BREAKS.values() for vector in row.vectors})
    found = {row["file"]: answers.faults(row) for row in answers.by_name(names)}
    assert not any(found.values()), {file: faults for file, faults in found.items() if faults}
