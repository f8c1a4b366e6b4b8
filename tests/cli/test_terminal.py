"""No name steers a terminal, whatever the command, and whoever prints."""

from __future__ import annotations

import ast
import json
import os
import pty
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import mcz
from mcz.cli import terminal
from mcz.cli.common import run
from mcz.cli.main import COMMANDS, cli
from mcz.cli.terminal import Progress
from tests.motions import smooth

CLI = Path(terminal.__file__).parent
STEERING = "\x1b]0;pwn\x07\x9b31m\u202eX\r\x7f\u2066"
PRINTS = {"terminal.py", "conformance.py"}  # the latter is a decoder under test, no command


def steers(text: str) -> set[str]:
    return {letter for letter in text if not letter.isprintable() and letter != "\n"}


@pytest.fixture
def hostile(tmp_path: Path) -> Path:
    """A file whose clip, joints, attachment, skeleton and metadata have names that steer."""
    motion = smooth(12, metadata={"subject": STEERING, "source-note": STEERING})
    joints = tuple(replace(j, name=f"{j.name}{STEERING}") for j in motion.skeleton.joints)
    skeleton = replace(motion.skeleton, joints=joints, name=STEERING, unit_cm=1.0)
    path = tmp_path / "hostile.mcz"
    mcz.write(replace(motion, skeleton=skeleton, name=STEERING), path, "mrdwt")
    (tmp_path / f"note{STEERING}.bvh").write_bytes(b"no motion")
    mcz.append([tmp_path / f"note{STEERING}.bvh"], path, verbatim=True)
    return path


def arguments_of(name: str, file: Path) -> list[list[str]]:
    """Calls of a command that have something to say of ``file``."""
    out, odd = file.parent / f"out-{STEERING}", str(file.parent / f"none{STEERING}.bvh")
    calls = {
        "sample": [[str(out)]],
        "encode": [[odd], [str(file.parent / f"note{STEERING}.bvh")]],
        "convert": [
            [str(file), f"{out}c.csv"],
            [str(file), f"{out}{STEERING}.x{STEERING}"],
            [str(file.parent / f"note{STEERING}.bvh"), f"{out}c.trc"],
            [odd, f"{out}c.bvh", "--joints", STEERING],
        ],
        "decode": [
            [str(file), "--to", "csv", "-o", "-"],
            [str(file), "--to", "csv", "-o", f"{out}.csv"],
            [str(file), "--to", "bvh", "-o", f"{out}.bvh", "--rate", "30"],
            [str(file), "--clip", STEERING, "--joints", STEERING, "--to", "csv"],
            [str(file), "--clip", STEERING[:-1], "--to", "csv"],
        ],
        "info": [[str(file)], [str(file), "--layout"], [str(file), "--validate"]],
        "verify": [[str(file)], [str(file), "--source", odd], [str(file), "--quick"]],
        "bag": [
            [str(file), str(out)],
            [str(file), str(out), "--info", f"{STEERING}=a"],
            [odd, "x"],
        ],
        "protect": [[str(file)], [str(file), "--check"]],
        "repair": [[str(file), "-o", f"{out}.mcz"]],
        "pack": [[str(file.parent), f"{out}.mcz"]],
        "append": [[odd, str(file)]],
        "unpack": [[str(file), str(out)]],
        "merge": [[str(file), str(file), "-o", f"{out}.mcz"], [str(file), "-o", f"{out}.mcz"]],
        "delete": [[str(file), STEERING], [str(file), STEERING[:-1], "-o", f"{out}.mcz"]],
        "rename": [[str(file), STEERING, f"{STEERING}2", "-o", f"{out}.mcz"]],
        "reorder": [[str(file), STEERING, "-o", f"{out}.mcz"], [str(file), "--by", STEERING]],
        "split": [[str(file), str(out), "--rest", STEERING], [str(file), str(out)]],
        "export": [[str(file), str(out), "--to", to] for to in ("npz", "amc", "glb", "usda")],
        "list": [[str(file)], [str(file), "--columns", f"name,{STEERING}"], [str(file), "--csv"]],
        "meta": [
            [str(file)],
            [str(file), "--set", f"{STEERING}=1"],
            [str(file), "--set", f"subject={STEERING}", "--match", STEERING],
            [str(file)],
        ],
        "extract": [[str(file), f"{out}.mcz"], [str(file), f"{out}2.mcz", "--joints", STEERING]],
        "replace": [[str(file), f"{out}.mcz", "--joint", STEERING, "--values", str(file)]],
        "diff": [[str(file), str(file)], [str(file), odd]],
        "view": [
            [str(file), "-o", f"{out}.html"],
            [str(file), "-o", f"{out}2.html", "--clip", STEERING],
            [str(file), "-o", f"{out}3.html", "--max-size", "9"],
            [odd],
            [str(file.parent / f"note{STEERING}.bvh"), "-o", f"{out}4.html"],
            [str(file), "-o", f"{out}5.rrd"],
        ],
        "render": [
            [str(file), "-o", f"{out}.png", "--size", "64"],
            [str(file), "-o", f"{out}.svg", "--clip", STEERING[:-1]],
            [odd],
        ],
        "plot": [
            [str(file), "-o", f"{out}.png"],
            [str(file), str(file), "-o", f"{out}.html"],
            [str(file), "-o", f"{out}.svg", "--what", "bytes"],
            [str(file), "-o", f"{out}.svg", "--joint", STEERING],
        ],
        "stream": [["decode", str(file)], ["encode", "--skeleton", odd]],
        "bench": [[odd]],
        "train": [[odd, "-o", str(out)]],
        "codecs": [[STEERING], []],
        "selftest": [[]],
        "completion": [["bash"], [STEERING]],
    }
    return calls[name]


@pytest.mark.parametrize("name", COMMANDS)
def test_no_command_lets_a_name_steer_the_terminal(
    name: str, hostile: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A command that is new has no row above, and fails here."""
    for arguments in arguments_of(name, hostile):
        for json_too in ([], ["--json"]):
            run(cli, "mcz", [name, *arguments, *json_too])
            captured = capsys.readouterr()
            assert not steers(captured.out), arguments
            assert not steers(captured.err), arguments
            assert captured.out or captured.err


def test_only_one_module_prints() -> None:
    """``terminal`` escapes what it prints; whoever goes around it could forget."""
    for path in CLI.glob("*.py"):
        if path.name not in PRINTS:
            assert not ways_around(ast.parse(path.read_text("utf-8"))), path


def ways_around(tree: ast.Module) -> list[str]:
    banned = {"click.echo", "click.secho", "click.echo_via_pager", "print", "click.style"}
    banned |= {"sys.stdout.write", "sys.stderr.write", "sys.stdout.buffer.write", "os.write"}
    parsed = [ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return [name for name in parsed if name in banned or name.endswith(("stdout.buffer.write",))]


@pytest.mark.parametrize("text", ["click.echo(1)", "print(2)", "sys.stderr.write('a')"])
def test_a_way_around_is_found(text: str) -> None:
    assert ways_around(ast.parse(text))


def on_a_terminal(*arguments: object) -> bytes:
    """Output of a command on a terminal."""
    shown = bytearray()

    def read(handle: int) -> bytes:
        data = os.read(handle, 65536)
        shown.extend(data)
        return data

    pid, handle = pty.fork()
    if pid == 0:
        os.execv(sys.executable, [sys.executable, "-m", "mcz", *map(str, arguments)])
    while True:
        try:
            if not read(handle):
                break
        except OSError:  # the command has ended
            break
    os.waitpid(pid, 0)
    os.close(handle)
    return bytes(shown)


def test_a_source_on_a_terminal_is_escaped_there_alone(tmp_path: Path, samples: Path) -> None:
    text = (samples / "walk.bvh").read_bytes().replace(b"Hips", b"Hi\x1b[2Jps\xc2\x9b")
    text = text[: text.index(b"Frames:")] + b"Frames: 0\nFrame Time: .01\n"
    (tmp_path / "odd.bvh").write_bytes(text)
    mcz.encode(tmp_path / "odd.bvh", tmp_path / "odd.mcz")
    shown = on_a_terminal("decode", tmp_path / "odd.mcz", "-o", "-")
    assert b"\x1b" not in shown and b"\xc2\x9b" not in shown
    if b"Hips" in (samples / "walk.bvh").read_bytes():
        assert b"Hi\\x1b[2Jps" in shown


def test_binary_data_are_not_printed_on_a_terminal(hostile: Path) -> None:
    shown = on_a_terminal("decode", hostile, "--to", "npz", "-o", "-")
    assert b"binary data are not printed on a terminal" in shown


def test_progress_shows_names_as_they_are_meant(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mcz.cli.terminal.PATIENCE", 0.0)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    with Progress() as progress:
        progress(1, 2, f"[/red]{STEERING}")
        shown = capsys.readouterr().err
    assert shown.startswith("\r") and " [/red]" in shown
    assert not steers(shown[1:])


def test_csv_names_are_found_again_in_csv(
    hostile: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """``replace`` reads the names that decode --to csv prints."""
    table, out = hostile.parent / "a.csv", hostile.parent / "b.mcz"
    assert run(cli, "mcz", ["decode", str(hostile), "--to", "csv", "-o", str(table)]) == 0
    arguments = ["replace", str(hostile), str(out), "--joint", "0", "--values", str(table)]
    code = run(cli, "mcz", arguments)
    assert code == 0, capsys.readouterr().err


def test_what_is_seen_stays() -> None:
    text = "Väsa 歩く ß — [x] \\ '"
    assert terminal.printable(text) == text
    assert json.loads(terminal.json_text({text: [STEERING]})) == {text: [STEERING]}
    assert not steers(terminal.json_text({STEERING: STEERING}))
    assert terminal.json_text("\U000e0001\ud800") == '"\\udb40\\udc01\\ud800"'
