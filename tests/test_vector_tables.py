"""The tables of vectors: notation of bytes, edits and their repair, rows."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import pytest

import mcz
from mcz.errors import MczError
from tests.test_spec import SPEC
from tools.vectors.bases import base_bytes
from tools.vectors.build import by_hand
from tools.vectors.engine import tables
from tools.vectors.engine.edits import edit_file
from tools.vectors.engine.notation import read_bytes

DANCE = base_bytes("dance(8)", {"segment_frames": 3})
HEAD = '[TABLE]\nfolder = "invalid/x"\nbase = "dance()"\n[FAULTS]\n'


def nowhere(text: str) -> bytes:
    raise ValueError(text)


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("", b""),
        ("00 ff0a", b"\0\xff\n"),
        ("v:300 z:-1 u16:2^15", b"\xac\2\1\0\x80"),
        ('sized("ab" 00*2)', b"\4ab\0\0"),
        ("(01 02)*2 @end", b"\1\2\1\2!"),
        ('sha256("a")', hashlib.sha256(b"a").digest()),
        ("d:-0.5 f:1", b"\0\0\0\0\0\0\xe0\xbf\0\0\x80?"),
    ],
)
def test_notation(text: str, data: bytes) -> None:
    assert read_bytes(text, nowhere, {"end": '"!"'}) == data


def test_no_notation() -> None:
    with pytest.raises(ValueError, match="no notation"):
        read_bytes("00 xyz", nowhere, {})


@pytest.mark.parametrize(
    "edit",
    [
        "DATA#1[:] = <DATA#1>",
        'SKEL.name = sized("a longer name")',
        "CLIP.flags = 02",
        "swap SKEL.joints.1.channels.0 SKEL.joints.1.channels.0",
        'insert xtra+1 after CEND = "of no known type"',
        "HEAD.minor += 1",
    ],
)
def test_files_are_repaired_behind_an_edit(edit: str) -> None:
    with mcz.open(edit_file(DANCE, [edit])) as archive:
        assert archive["dance"].n_frames == 8


@pytest.mark.parametrize("edit", ["drop CEND", "DATA#1.first = 4", "DATA:[-1] ^= 01"])
def test_faults_stay(edit: str, tmp_path: Path) -> None:
    path = tmp_path / "faulty.mcz"
    path.write_bytes(edit_file(DANCE, [edit]))
    with pytest.raises(MczError):
        mcz.read(path)


@pytest.mark.parametrize("edit", ["CLIP", "drop CLIP#1", "copy", "CLIP.nobody = 00", "DATA#9 ="])
def test_edits_of_what_is_not_there(edit: str) -> None:
    with pytest.raises((ValueError, KeyError)):
        edit_file(DANCE, [edit])


@pytest.mark.parametrize(
    "text",
    [
        HEAD + '[a]\npurpose = "A."\nspec = "CLIP"\n',
        HEAD + 'f = "broken, crash: x"\n[a]\npurpose = "A."\nspec = "CLIP"\nfault = "f"\n',
        HEAD + 'f = "malformed, crash: x"\n[a]\nfault = "f"\nnobody = 1\n',
        HEAD + 'f = "malformed, crash: x"\ng = "malformed, hang: y"\n[a]\nfault = "f"\n',
    ],
)
def test_tables_that_are_none(text: str, tmp_path: Path) -> None:
    table = tmp_path / "x.toml"
    table.write_text(text)
    with pytest.raises(ValueError, match="fault|nobody"):
        list(tables.rows_of(table))


def test_each_structure_stands_in_a_file_that_was_written_by_hand() -> None:
    shown = [structure for name in by_hand.HELD for structure in by_hand.structures_of(name)]
    assert sorted(shown) == sorted(set(re.findall(r"<!-- table: (\w+) -->", SPEC)))
