"""Every block of README, CONTRIBUTING and the manual is run; what they list is what there is.

A page's blocks run in order in one new folder: ``sh`` and ``python`` blocks as they stand, and an
``output`` block must be what the block before it printed ("..." stands for anything). A command
whose comment says ``exit code N`` must end so, all others with 0. Blocks of other languages
(``text`` and the like) are not run. ``mcz`` runs in this process, other programs as they are.
"""

from __future__ import annotations

import ast
import doctest
import inspect
import io
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

import click
import pytest

import mcz
from mcz.cli.common import Exit, run
from mcz.cli.info import info_command
from mcz.cli.main import COMMANDS, cli
from mcz.codecs import CODECS
from mcz.codecs.parameters import TARGETS
from mcz.sources import FORMATS
from tools import notebooks

ROOT = Path(mcz.__file__).parents[1]
MANUAL = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md"))
API = "docs/reference/api.md"  # a list of all public names
PAGES = ("README.md", "CONTRIBUTING.md", *MANUAL)
PROGRAMS = {"mcz": cli, "mcz-info": info_command}
# What is not run here, and what runs it.
ELSEWHERE = {
    "python3 -m venv": ".ci/run: a clean environment",
    ". .venv/bin/activate": ".ci/run: a clean environment",
    "pip install": ".ci/run: a clean environment",
    "python -m pytest": ".ci/run: the tests themselves",
    "tools/check": "what .ci/run does, step by step",
}


class Block(NamedTuple):
    line: int
    language: str
    text: str


def text_of(page: str) -> str:
    return (ROOT / page).read_text("utf-8")


def blocks(page: str) -> Iterator[Block]:
    text = text_of(page)
    for match in re.finditer(r"^```([\w{}-]*)\n(.*?)^```$", text, re.M | re.S):
        yield Block(text.count("\n", 0, match.start()) + 2, match[1], match[2])


class Ran(NamedTuple):
    code: int
    out: bytes
    err: bytes


def in_process(program: click.Command, words: list[str], data: bytes) -> Ran:
    """Run ``program`` with ``words`` as its arguments and ``data`` on its standard input."""
    streams = [io.TextIOWrapper(io.BytesIO(data)), *(_output() for _ in range(2))]
    before = sys.stdin, sys.stdout, sys.stderr
    sys.stdin, sys.stdout, sys.stderr = streams
    try:
        code = run(program, words[0], words[1:])
        out, err = (stream.buffer for stream in streams[1:])
        sys.stdout.flush(), sys.stderr.flush()
        return Ran(int(code), out.getvalue(), err.getvalue())
    finally:
        sys.stdin, sys.stdout, sys.stderr = before


def _output() -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(), "utf-8")


def command(words: list[str], data: bytes) -> Ran:
    """Run one command: ours in this process, others as they are."""
    words[0] = words[0].removeprefix(".venv/bin/")
    if words[0] in PROGRAMS:
        return in_process(PROGRAMS[words[0]], words, data)
    if words[0] == "python":
        words[0] = sys.executable
    done = subprocess.run(words, input=data, capture_output=True, check=False)
    return Ran(done.returncode, done.stdout, done.stderr)


def shell(line: str) -> Ran:
    """Run ``a < in | b > out && c``: as much of a shell as the pages need."""
    code, out, err = 0, b"", b""
    for part in re.split(r"\s&&\s", line):
        if any(part.strip().startswith(known) for known in ELSEWHERE):
            continue
        data = b""
        stages = re.split(r"\s\|\s", part)
        for stage in stages:
            words = shlex.split(stage)
            if "<" in words:
                at = words.index("<")
                data = Path(words[at + 1]).read_bytes()
                del words[at : at + 2]
            target = None
            if ">" in words:
                at = words.index(">")
                target = words[at + 1]
                del words[at : at + 2]
            code, data, errors = command(words, data)
            err += errors
            if target is not None:
                Path(target).write_bytes(data)
                data = b""
        out += data
        if code:
            break
    return Ran(code, out, err)


def run_shell(text: str, where: str) -> str:
    """Run the lines of a block; return what they print, errors included."""
    printed = ""
    for line in text.replace("\\\n", " ").replace("&&\n", "&& ").splitlines():
        wanted = re.search(r"#.*exit code (\d+)", line)
        line = re.sub(r"(^|\s)#.*", "", line)
        if not line.strip():
            continue
        ran = shell(line)
        printed += (ran.out + ran.err).decode("utf-8")
        assert ran.code == int(wanted[1] if wanted else 0), f"{where}: {line}\n{printed}"
    return printed


def run_python(block: Block, page: str, names: dict[str, object]) -> str:
    """Run a block among the names of those before it; return what it prints."""
    tree = ast.parse("\n" * (block.line - 1) + block.text, page)
    with redirect_stdout(io.StringIO()) as out:
        exec(compile(tree, page, "exec"), names)
    return out.getvalue()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A new folder to work in; codecs and formats that a page adds are gone after it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    tables: tuple[dict[Any, Any], ...] = CODECS, FORMATS
    before = [dict(table) for table in tables]
    yield tmp_path
    for table, rows in zip(tables, before, strict=True):
        table.clear()
        table.update(rows)


@pytest.mark.parametrize("page", PAGES)
def test_every_block_runs(page: str, folder: Path) -> None:
    if page == "CONTRIBUTING.md":  # its commands are about the tree
        for path in ROOT.iterdir():
            (folder / path.name).symlink_to(path)
    names: dict[str, object] = {"__name__": "__main__"}
    printed = ""
    for block in blocks(page):
        where = f"{page}:{block.line}"
        assert block.language, f"{where}: a block says its language, or text"
        if block.language == "sh":
            printed = run_shell(block.text, where)
        elif block.language == "python":
            printed = run_python(block, page, names)
        elif block.language == "output":
            alike = doctest.OutputChecker().check_output(
                block.text, printed, doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
            )
            assert alike, f"{where}: it prints\n{printed}"


@pytest.mark.parametrize("page", PAGES)
def test_links_and_paths_lead_somewhere(page: str) -> None:
    text = re.sub(r"^```.*?^```$", "", text_of(page), flags=re.M | re.S)
    for target in re.findall(r"\]\(([^)]+)\)", text):
        path, _, anchor = target.partition("#")
        if path.startswith("https://"):
            continue
        assert (ROOT / page).parent.joinpath(path).exists() or not path, target
        headings = re.findall(r"^#+ (.+)$", text, re.M)
        known = {re.sub(r"[^\w -]", "", h).lower().replace(" ", "-") for h in headings}
        assert not anchor or path or anchor in known, target
    for path in re.findall(r"`((?:mcz|tools|tests|conformance|docs)/[a-z_/.-]+)`", text):
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize(
    ("page", "most"), [("README.md", 110), *((p, 160) for p in MANUAL if p != API)]
)
def test_pages_stay_short(page: str, most: int) -> None:
    assert len(text_of(page).splitlines()) <= most


def test_readme_installs_without_extras_and_runs_the_main_job() -> None:
    """.ci/environment runs the first block in a clone that has nothing else."""
    first, second = [block.text.splitlines() for block in blocks("README.md")][:2]
    assert first[0].endswith("pip install -e .") and len(first) <= 6
    assert [line.split()[:2] for line in first[1:3]] == [["mcz", "sample"], ["mcz", "encode"]]
    assert first[-1].endswith("cmp samples/walk.bvh restored.bvh && echo identical")
    assert second == ["pip install -e '.[test]' && python -m pytest -n auto"]
    assert "readme_block 1 | bash" in text_of(".ci/environment")


def test_the_way_through_the_code_is_there() -> None:
    rows = re.findall(r"^\| `(mcz/[\w/]+\.py)` \| (.+?) \|", text_of("CONTRIBUTING.md"), re.M)
    assert len(rows) > 20
    for path, names in rows:
        body = ast.parse((ROOT / path).read_text("utf-8")).body
        kinds = (ast.FunctionDef, ast.ClassDef)
        known = {node.name: node for node in body if isinstance(node, kinds)}
        for name in re.findall(r"`([\w.]+)`", names):
            first, _, method = name.partition(".")
            assert first in known, f"{path}: {name}"
            inside = {node.name for node in known[first].body if isinstance(node, kinds)}
            assert not method or method in inside, f"{path}: {name}"


def test_contributing_lists_the_rooms_of_the_package() -> None:
    listed = set(re.findall(r"^\| `(\w+)/` \|", text_of("CONTRIBUTING.md"), re.M))
    folders = {p.name for p in (ROOT / "mcz").iterdir() if p.is_dir() and p.name[0] != "_"}
    assert listed | {"annex", "kernels"} == folders


def test_commands_and_their_options_are_in_the_manual() -> None:
    manual = "\n".join(map(text_of, MANUAL))
    for words, command in _commands(cli, "mcz"):
        assert f"`{words}" in manual, words
        for parameter in command.params:
            known = (*parameter.opts, *parameter.secondary_opts)
            is_documented = any(
                re.search(rf"(?<![\w-]){option}(?![\w-])", manual) for option in known
            )
            silent = isinstance(parameter, click.Argument) or getattr(parameter, "hidden", False)
            assert is_documented or silent, f"{words} {known}"
    assert set(COMMANDS) <= set(re.findall(r"^\| `mcz (\w+)", manual, re.M))


def _commands(group: click.Command, words: str) -> Iterator[tuple[str, click.Command]]:
    context = click.Context(group)
    for name in group.list_commands(context) if isinstance(group, click.Group) else ():
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from _commands(command, f"{words} {name}")
        else:
            yield f"{words} {name}", command


def test_exit_codes_are_in_the_manual() -> None:
    codes = re.findall(r"^\| (\d+) \| ", text_of("docs/reference/scripts.md"), re.M)
    assert [int(code) for code in codes] == list(Exit)


def test_codecs_and_their_parameters_are_in_the_manual() -> None:
    codecs, parameters = text_of("docs/guides/codecs.md"), text_of("docs/reference/parameters.md")
    documented = {
        n for row in re.findall(r"^\| (`.+?) \|", codecs, re.M) for n in row.split("`")[1::2]
    }
    assert {codec.name for codec in CODECS.values()} | {t.name for t in TARGETS} <= documented
    sections = dict(re.findall(r"^## (.+)\n((?:(?!## ).*\n?)*)", parameters, re.M))
    for codec in CODECS.values():
        (section,) = [text for names, text in sections.items() if codec.name in names.split(", ")]
        rows = {n for row in re.findall(r"^\| (`.+?) \|", section, re.M) for n in row.split("`")}
        assert {p.name for p in codec.parameters if not p.inner} - rows <= {"preset"}, codec.name


def test_public_names_are_in_the_manual() -> None:
    pages = "\n".join(text_of(page) for page in MANUAL if page != API)
    assert not [name for name in mcz.__all__ if not re.search(rf"\b{name}\b", pages)]
    listed = re.findall(r"^\.\. auto\w+:: (\w+)$", text_of(API), re.M)
    assert sorted(listed) == sorted(mcz.__all__)


def test_the_table_of_functions_is_complete() -> None:
    table = (ROOT / "docs/reference/python.md").read_text("utf-8").partition("## Functions")[2]
    names = {name for name in dir(mcz) if inspect.isfunction(getattr(mcz, name)) and name[0] != "_"}
    assert names <= set(re.findall(r"`(\w+)`", table))


def test_the_index_lists_every_page() -> None:
    listed = re.findall(r"^\| \[[\w-]+\]\(([\w/-]+\.md)\)", text_of("docs/index.md"), re.M)
    assert sorted(f"docs/{path}" for path in listed) == [p for p in MANUAL if p != "docs/index.md"]


def test_notebooks_have_every_block_of_their_page(tmp_path: Path) -> None:
    for page, path in zip(notebooks.PAGES, notebooks.write_notebooks(tmp_path), strict=True):
        cells = json.loads(path.read_text("utf-8"))["cells"]
        languages = [block.language for block in blocks(f"docs/{page}")]
        code = [cell for cell in cells if cell["cell_type"] == "code"]
        assert len(code) == 1 + languages.count("sh") + languages.count("python")
        assert sum(len(cell["outputs"]) for cell in code) == languages.count("output")


def test_the_picture_shows_what_is_measured(tmp_path: Path) -> None:
    """Within 1 %: the sizes are those of this machine's xz and zlib."""
    from mcz.sources.sample import write_samples
    from tools import picture

    write_samples(tmp_path)
    shown = re.findall(r">([\d,]+) bytes<", text_of("docs/walk.svg"))
    for text, (_, size, _) in zip(shown, picture.sizes(tmp_path), strict=True):
        assert int(text.replace(",", "")) == pytest.approx(size, rel=0.01)
        assert text in text_of("docs/evidence/figures.md")
