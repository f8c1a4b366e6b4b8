"""One bit is wrong, in each chunk of files of ten kinds: what repair makes of it."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import mcz
from tests.commands import run
from tests.kinds import KINDS, Values, body_of, chunks_of, count_kept_values, files, values_of
from tests.repair import flip_bit

# What a bit in the payload of a chunk may cost of the values; all else that it costs is said.
COSTS_VALUES = {"CLIP", "DATA", "MODL"}
COSTS_NOTHING = {"HEAD", "INDX", "FOOT", "ALIA", "RECV", "REPT", "COPY"}
OF_A_TYPE = 2  # chunks of each type in a file


@pytest.fixture(scope="module")
def file_values(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[bytes, Values]]:
    found = files(tmp_path_factory.mktemp("kinds"))
    return {name: (data, values_of(data)) for name, data in found.items()}


def sizes(values: Values) -> int:
    return sum(array.size for signals in values.values() for array in signals.values())


@pytest.mark.parametrize("kind", KINDS)
def test_a_bit_in_a_payload(
    kind: str, file_values: dict[str, tuple[bytes, Values]], tmp_path: Path
) -> None:
    data, whole = file_values[kind]
    seen: Counter[str] = Counter()
    for of, at, size in chunks_of(data):
        seen[of] += 1
        if seen[of] > OF_A_TYPE:
            continue
        report = mcz.repair(
            flip_bit(data, body_of(of, at, size), 3), tmp_path / "o.mcz", force=True
        )
        repaired = (tmp_path / "o.mcz").read_bytes()
        assert not [p for p in mcz.verify(repaired) if p.heading != "Codecs"], of
        count = count_kept_values(repaired, whole)
        assert report.damage
        if kind == "protected":
            assert (report.restored, repaired) == (True, data), of
            continue
        assert count == sizes(whole) or (of in COSTS_VALUES and report.lost), of
        assert not report.lost or of not in COSTS_NOTHING, (of, report.lost)
        if of == "SRCE":
            assert any("source" in line for line in report.lost), report.lost
        if of == "CLIP":
            lost = {name for name in whole if not any(n.startswith(name) for n in report.clips)}
            assert len(lost) == 1


@pytest.mark.parametrize("kind", KINDS)
def test_a_bit_in_a_header_costs_nothing(
    kind: str, file_values: dict[str, tuple[bytes, Values]], tmp_path: Path
) -> None:
    data, whole = file_values[kind]
    seen: Counter[str] = Counter()
    for of, at, _ in chunks_of(data):
        seen[of] += 1
        if seen[of] == 1:
            bit = 8 * (at % 16) + at % 8
            bad = flip_bit(data, at + bit // 8, bit % 8)
            report = mcz.repair(bad, tmp_path / "o.mcz", force=True)
            assert report.lost == [], of
            assert count_kept_values((tmp_path / "o.mcz").read_bytes(), whole) == sizes(whole), of


@pytest.mark.parametrize("kind", ["bvh-fast", "acclaim", "c3d-best", "mdtt-archive"])
def test_salvage_reads_all_that_repair_writes(
    kind: str, file_values: dict[str, tuple[bytes, Values]], tmp_path: Path
) -> None:
    """With a template or skeleton lost every command gives the values, and says what is lost."""
    data, whole = file_values[kind]
    for of, at, size in chunks_of(data):
        if of not in ("SRCE", "SKEL", "CEND"):
            continue
        path, out = tmp_path / f"{of}{at}.mcz", tmp_path / f"{of}{at}"
        path.write_bytes(flip_bit(data, body_of(of, at, size), 3))
        assert kept_in_salvage(path.read_bytes(), whole) == sizes(whole)
        name = next(iter(whole))
        for arguments in (
            ["decode", str(path), "--clip", name, "--to", "csv", "-o", f"{out}.csv"],
            ["decode", str(path), "--clip", name, "--to", "npz", "-o", f"{out}.npz"],
            ["unpack", str(path), str(out)],
            ["list", str(path)],
            ["info", str(path)],
            ["repair", str(path), "-o", f"{out}-sound.mcz"],
        ):
            salvage = [] if arguments[0] == "repair" else ["--salvage"]
            code = run(*arguments, *salvage)
            is_all = arguments[0] == "repair" and of == "SKEL"
            is_none = arguments[0] == "unpack" and of != "SKEL" and kind != "acclaim"
            assert code == (0 if is_all else 1 if is_none else 4), arguments


def kept_in_salvage(data: bytes, whole: Values) -> int:
    found = values_of(data, salvage=True)
    for name, signals in found.items():
        for signal, values in signals.items():
            np.testing.assert_array_equal(values, whole[name][signal])
    return sizes(found)
