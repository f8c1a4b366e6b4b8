"""``mcz selftest``: every codec is tried, and one that fails is named."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

import mcz
from mcz.codecs import CODECS
from tests.commands import Call


def test_every_codec_works_here(call: Call) -> None:
    code, out, _ = call("selftest", "--json")
    document = json.loads(out)
    assert code == 0
    assert document["version"] == mcz.__version__
    assert [row["name"] for row in document["codecs"]] == list(CODECS)
    assert not [row["fault"] for row in document["codecs"] if row["fault"]]
    assert all(row["bytes"] and row["encode"] and row["decode"] for row in document["codecs"])


def test_a_codec_that_fails_is_named(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    def encode(*_: object) -> None:
        raise ValueError("no such luck")

    monkeypatch.setitem(CODECS, "fast", replace(CODECS["fast"], encode=encode))
    code, out, _ = call("selftest")
    assert code == 1
    assert "no such luck" in out and out.endswith("1 codec failed: fast\n")
