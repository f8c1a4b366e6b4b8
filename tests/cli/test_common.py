"""Errors on one line, exit codes, argument types, output that is never half there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import pytest

from mcz.cli.common import Exit, Failure, about, run, table, write_output
from mcz.cli.progress import Progress
from mcz.errors import ChecksumError, MczError, OptionError


def outcome(capsys: pytest.CaptureFixture[str], error: Exception) -> tuple[int, str]:
    @click.command()
    def command() -> None:
        with about("walk.mcz"):
            raise error

    code = run(command, "mcz", [])
    captured = capsys.readouterr()
    assert captured.out == ""
    return code, captured.err


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (ChecksumError("crc of DATA\n at 93"), 1, "mcz: walk.mcz: crc of DATA at 93\n"),
        (MczError("walk.mcz: at 7"), 1, "mcz: walk.mcz: at 7\n"),
        (OptionError("no codec 'x'"), 2, "mcz: walk.mcz: no codec 'x'\n"),
        (FileNotFoundError(2, "No such file", "a.bvh"), 1, "mcz: walk.mcz: a.bvh: No such file\n"),
        (FileExistsError(17, "File exists", "b.mcz"), 2, "mcz: walk.mcz: b.mcz: File exists\n"),
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
    with pytest.raises(Failure, match="--force"):
        write_output(path, b"two", force=False)
    assert path.read_bytes() == b"one"
    write_output(path, b"two", force=True)
    assert path.read_bytes() == b"two"
    with pytest.raises(Failure, match="No such file"):
        write_output(tmp_path / "absent" / "out.csv", b"", force=False)
    assert [p.name for p in tmp_path.iterdir()] == ["out.csv"]


def test_table_aligns() -> None:
    shown = table([["a", "b"], ["long", "12"], ["", "3"]], "lr")
    assert shown == "a      b\nlong  12\n       3"


def test_progress_is_silent_without_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mcz.cli.progress.PATIENCE", 0.0)
    with Progress() as progress:
        progress(1, 2, "walk")
    assert capsys.readouterr().err == ""


def test_progress_shows_on_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mcz.cli.progress.PATIENCE", 0.0)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    shown: list[Any] = []
    with Progress() as progress:
        progress(1, 2, "walk")
        shown.append(progress.bar.tasks[0].description)
    assert shown == ["walk"]
    capsys.readouterr()
