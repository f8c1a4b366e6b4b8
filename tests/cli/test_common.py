"""Errors on one line, exit codes, argument types, output that is never half there."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import click
import pytest

import mcz
from mcz.cli.command_groups import OTHER_NAMES
from mcz.cli.common import OUT_OF_MEMORY, Exit, Failure, errors_about, run, write_output
from mcz.cli.main import COMMANDS, cli
from mcz.cli.terminal import Progress, say, table
from mcz.errors import AccessError, ChecksumError, ExistsError, MczError, OptionError
from tests.motions import smooth


def outcome(capsys: pytest.CaptureFixture[str], error: Exception) -> tuple[int, str]:
    @click.command()
    def command() -> None:
        with errors_about("walk.mcz"):
            raise error

    code = run(command, "mcz", [])
    captured = capsys.readouterr()
    assert captured.out == ""
    return code, captured.err


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (ChecksumError("crc of DATA\n at 93"), 1, "mcz: walk.mcz: crc of DATA at 93\n"),
        (MczError("at 7", path="other.mcz"), 1, "mcz: other.mcz: at 7\n"),
        (OptionError("no codec 'x'"), 2, "mcz: walk.mcz: no codec 'x'\n"),
        (FileNotFoundError(2, "No such file", "a.bvh"), 1, "mcz: a.bvh: No such file\n"),
        (FileExistsError(17, "File exists", "b.mcz"), 2, "mcz: b.mcz: File exists\n"),
        (Failure("gone", Exit.NOT_VERIFIED), 3, "mcz: gone\n"),
        (KeyboardInterrupt(), 130, "\nmcz: interrupted\n"),
        (MczError("a \x1b[31mred\x07 name"), 1, "mcz: walk.mcz: a \\x1b[31mred\\x07 name\n"),
    ],
)
def test_errors_are_one_line(
    capsys: pytest.CaptureFixture[str], error: Exception, code: int, line: str
) -> None:
    assert outcome(capsys, error) == (code, line)


def test_a_bug_keeps_its_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ZeroDivisionError):
        outcome(capsys, ZeroDivisionError())


def test_output_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    write_output(path, b"one", force=False)
    with pytest.raises(ExistsError, match="force"):
        write_output(path, b"two", force=False)
    assert path.read_bytes() == b"one"
    write_output(path, b"two", force=True)
    assert path.read_bytes() == b"two"
    with pytest.raises(AccessError, match="No such file"):
        write_output(tmp_path / "absent" / "out.csv", b"", force=False)
    assert [p.name for p in tmp_path.iterdir()] == ["out.csv"]


def test_table_aligns() -> None:
    shown = table([["a", "b"], ["long", "12"], ["", "3"]], "lr")
    assert shown == ["a      b", "long  12", "       3"]


def test_progress_is_silent_without_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mcz.cli.terminal.PATIENCE", 0.0)
    with Progress() as progress:
        progress(1, 2, "walk")
    assert capsys.readouterr().err == ""


def test_progress_shows_on_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mcz.cli.terminal.PATIENCE", 0.0)
    monkeypatch.setattr("mcz.cli.terminal.INTERVAL", 0.0)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "40")
    with Progress() as progress:
        progress(1, 2, "walk")
        line = "[############------------]  50% walk"
        assert capsys.readouterr().err == f"\r{line}"
        say("a note")
        assert capsys.readouterr().err == f"\r{' ' * len(line)}\rmcz: a note\n"
        progress(2, 2, "a run of three hours")
        assert capsys.readouterr().err == f"\r[{'#' * 24}] 100% a run o"
        progress(3, 2, "\u6b69\u304f\u6b69\u304f\u6b69")
        assert capsys.readouterr().err == f"\r[{'#' * 24}] 100% \u6b69\u304f\u6b69 "
    assert capsys.readouterr().err == f"\r{' ' * 38}\r"
    with Progress():
        pass
    assert capsys.readouterr().err == ""


def test_progress_waits_for_a_second_of_work(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [5.0]
    monkeypatch.setattr("mcz.cli.terminal.time.monotonic", lambda: now[0])
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    with Progress() as progress:
        seen = []
        for now[0] in (5.9, 6.0, 6.05, 6.15):
            progress(1, 2, "walk")
            seen.append(bool(capsys.readouterr().err))
    assert seen == [False, True, False, True]


def test_errors_are_json_where_it_is_asked_for(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def document(*arguments: object) -> Any:
        run(cli, "mcz", [*map(str, arguments), "--json"])
        captured = capsys.readouterr()
        assert captured.out == "" and captured.err.count("\n") == 1
        return json.loads(captured.err)["error"]

    none = tmp_path / "none.mcz"
    assert document("info", none) == {
        "exit_code": 1,
        "class": "AccessError",
        "message": f"{none}: no such file",
        "file": str(none),
        "clip": None,
        "line": None,
        "offset": None,
        "where": None,
        "value": None,
        "note": None,
        "hint": None,
    }
    bad = tmp_path / "bad.bvh"
    joint = b"{ OFFSET 0 0 0 CHANNELS 1 Zrotation }"
    bad.write_bytes(b"HIERARCHY\nROOT a\n" + joint + b"\nMOTION\nFrames: 1\nFrame Time: 1\nx\n")
    found = document("encode", bad)
    assert (found["class"], found["line"], found["file"]) == ("SourceError", 7, str(bad))
    assert (found["value"], found["hint"]) == ("x", "verbatim")
    assert found["message"].startswith(f"{bad}: line 7: 'x' is not a number; --verbatim keeps")
    usage = document("encode", bad, "--nonsense")
    assert (usage["class"], usage["exit_code"], usage["file"]) == ("UsageError", 2, None)
    assert document("encod")["message"].startswith("no command 'encod'; did you mean encode")
    cut = tmp_path / "cut.mcz"
    mcz.write(smooth(12), cut)
    data = bytearray(cut.read_bytes())
    data[40] ^= 1
    cut.write_bytes(data)
    found = document("decode", cut, "--to", "csv")
    assert (found["class"], found["exit_code"]) == ("ChecksumError", 1)
    assert f" at {found['offset']} " in found["message"] and found["value"] is not None
    (tmp_path / "walk.bvh").write_bytes(b"HIERARCHY")
    found = document("sample", tmp_path)
    assert (found["class"], found["hint"]) == ("ExistsError", "force")
    assert found["message"].endswith(": already exists; use --force to replace it")


@pytest.mark.parametrize("name", [*COMMANDS, "stream encode", "stream decode", ""])
def test_h_is_help(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, "mcz", [*name.split(), "-h"]) == 0
    assert capsys.readouterr().out.startswith("Usage: mcz")


@pytest.mark.parametrize(
    ("given", "meant"),
    [("encod", "encode"), ("verfy", "verify"), ("strem", "stream"), ("un", "unpack")],
)
def test_a_command_is_suggested(given: str, meant: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, "mcz", [given]) == 2
    assert f"no command '{given}'; did you mean {meant}" in capsys.readouterr().err


def test_a_command_by_another_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, "mcz", ["cut"]) == 2
    assert "no command 'cut'; did you mean extract?" in capsys.readouterr().err
    for meant in OTHER_NAMES.values():
        assert meant.split()[0] in COMMANDS


def test_a_command_unlike_all_lists_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, "mcz", ["xyzzy"]) == 2
    assert "there are: sample, encode" in capsys.readouterr().err
    assert run(cli, "mcz", ["stream", "decod"]) == 2
    assert "did you mean decode" in capsys.readouterr().err


def test_info_alone_has_a_version() -> None:
    command = [sys.executable, "-m", "mcz.cli.info", "--version"]
    shown = subprocess.run(command, check=True, capture_output=True, text=True)
    assert (shown.stdout, shown.stderr) == (f"mcz {mcz.__version__}\n", "")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_a_script_that_asks_mcz(
    shell: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run(cli, "mcz", ["completion", shell]) == 0
    assert f"_MCZ_COMPLETE={shell}_complete" in capsys.readouterr().out
    environment = {"_MCZ_COMPLETE": f"{shell}_complete", "COMP_WORDS": "mcz enc", "COMP_CWORD": "1"}
    if shell == "fish":
        environment["COMP_CWORD"] = "enc"
    for key, value in environment.items():
        monkeypatch.setenv(key, value)
    with pytest.raises(SystemExit) as left:
        run(cli, "mcz", [])
    assert left.value.code == 0
    assert "encode" in capsys.readouterr().out


def test_out_of_memory_is_a_message(capsys: pytest.CaptureFixture[str]) -> None:
    code, line = outcome(capsys, MemoryError())  # type: ignore[arg-type]
    assert (code, line) == (1, f"mcz: walk.mcz: {OUT_OF_MEMORY}\n")
