"""Rules about the source itself: the arrows of the layers, bytes, construct, lazy imports."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import mcz

PACKAGE = Path(mcz.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))

# What a part may import; a part is the first name after ``mcz.``. Each may import itself.
GROUND = {"errors", "schema", "numbers"}
MODEL = GROUND | {"motion"}
ALLOWED = {
    "jit": set(),
    "errors": set(),
    "schema": {"errors"},
    "numbers": {"errors", "schema"},
    "motion": GROUND,
    "kinematics": MODEL,
    "angles": MODEL,
    "metrics": MODEL | {"angles", "kinematics"},
    "bjontegaard": GROUND,
    "coding": GROUND,
    "transforms": GROUND,
    "codecs": MODEL | {"angles", "kinematics", "metrics", "coding", "transforms"},
    "container": MODEL,
    "formats": MODEL | {"kinematics"},
    "sample": MODEL | {"formats"},
    "files": MODEL | {"kinematics", "metrics", "transforms", "codecs", "container", "formats"},
    "training": MODEL | {"kinematics", "transforms", "codecs"},
    "cli": MODEL | {"kinematics", "metrics", "files", "sample", "training"},
    # On top of all: it measures every part by itself.
    "bench": MODEL
    | {
        "angles",
        "kinematics",
        "metrics",
        "training",
        "bjontegaard",
        "transforms",
        "codecs",
        "container",
        "formats",
        "files",
        "",
    },
    "": MODEL | {"kinematics", "metrics", "files"},  # mcz/__init__.py
}
COMPILER = {"jit"}  # the decorator of compiled loops: any layer's kernels may use it

BANNED_CONSTRUCTS = {"GreedyRange", "Enum", "Flag", "Padding", "VarInt", "Compressed"}
HEAVY = {"numba", "rich", "fsspec", "pywt", "scipy", "matplotlib"}


def name_of(path: Path) -> str:
    """``numbers`` or ``codecs.raw``; "" for the package itself."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def part_of(name: str) -> str:
    return name.partition(".")[0]


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text("utf-8"), str(path))


def imports(path: Path) -> Iterator[str]:
    """Names below ``mcz`` of the modules that ``path`` imports, at any depth of its code."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            module = node.module or ""
            names = [f"{module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            if name.split(".")[0] == "mcz":
                yield longest_module(name.split(".")[1:])


def longest_module(parts: list[str]) -> str:
    while parts:
        base = PACKAGE.joinpath(*parts)
        if base.with_suffix(".py").exists() or (base / "__init__.py").exists():
            break
        parts = parts[:-1]
    return ".".join(parts)


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_imports_follow_the_arrows(path: Path) -> None:
    part = part_of(name_of(path))
    allowed = ALLOWED[part] | {part} | COMPILER
    if part == "cli":
        allowed |= {""}  # the command line uses the public names
    if name_of(path) == "cli.bench":
        allowed |= {"bench"}
    if name_of(path) == "cli.conformance":
        allowed |= {"container"}  # a decoder under test looks at every chunk, too
    wrong = {name for name in imports(path) if part_of(name) not in allowed}
    assert not wrong


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_codecs_do_not_import_each_other(path: Path) -> None:
    package, _, own = name_of(path).partition(".")
    if package != "codecs" or not own:
        return  # mcz/codecs/__init__.py holds the table, which names them all
    others = {n for n in imports(path) if n.startswith("codecs.")} - {f"codecs.{own}"}
    assert {n for n in others if n != "codecs.base" and not n.startswith("codecs._")} == set()


def calls(path: Path) -> Iterator[tuple[ast.Call, ast.Attribute]]:
    """Every call of an attribute, ``x.name(...)``."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            yield node, node.func


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_only_schema_calls_construct(path: Path) -> None:
    if name_of(path) == "schema":
        return
    doors = {"parse", "parse_stream", "build", "build_stream"}
    lines = [
        node.lineno
        for node, func in calls(path)
        if func.attr in doors and node.args and is_schema(func.value)
    ]
    assert not lines, "schema.parse and schema.build are the doorway"


def is_schema(value: ast.expr) -> bool:
    """Whether ``value`` may be a construct: a constant in capitals, or made on the spot."""
    if isinstance(value, ast.Name | ast.Attribute):
        return (value.id if isinstance(value, ast.Name) else value.attr).isupper()
    return True


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_no_banned_construct(path: Path) -> None:
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "construct":
            assert not BANNED_CONSTRUCTS & {alias.name for alias in node.names}
        if isinstance(node, ast.Import):
            assert "construct" not in {alias.name for alias in node.names}, "import names from it"


def is_explicit(dtype: ast.expr) -> bool:
    """Whether a dtype names its byte order, or has none, or is a variable that may."""
    if isinstance(dtype, ast.JoinedStr):
        dtype = dtype.values[0]
    if isinstance(dtype, ast.Constant):
        return str(dtype.value).lstrip("|").startswith(("<", ">", "u1", "i1", "S", "V"))
    if isinstance(dtype, ast.Attribute):
        return dtype.attr in ("uint8", "int8", "bool_")
    return True


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_bytes_have_an_explicit_byte_order(path: Path) -> None:
    for node, func in calls(path):
        where = f"{path.name}:{node.lineno}"
        if func.attr in ("frombuffer", "fromfile"):
            dtypes = node.args[1:2] + [k.value for k in node.keywords if k.arg == "dtype"]
            assert dtypes, f"{where}: no dtype"
            assert is_explicit(dtypes[0]), f"{where}: {ast.unparse(dtypes[0])}"
        if func.attr == "tobytes" and isinstance(func.value, ast.Call):
            inner = func.value
            if isinstance(inner.func, ast.Attribute) and inner.func.attr == "astype":
                assert is_explicit(inner.args[0]), f"{where}: {ast.unparse(inner)}"
            else:
                made = ast.unparse(inner.func)
                assert made not in ("np.uint16", "np.uint32", "np.uint64", "np.int64"), where


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_modules_stay_short(path: Path) -> None:
    assert len(path.read_text("utf-8").splitlines()) <= 420


@pytest.mark.parametrize("module", ["mcz", "mcz.cli.info", "mcz.cli.main"])
def test_importing_stays_light(module: str) -> None:
    code = f"import sys, {module}; print(*sys.modules)"
    shown = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert not HEAVY & {name.partition(".")[0] for name in shown.split()}
    assert "mcz.bench" not in shown.split()


def test_the_version_is_one() -> None:
    project = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["version"] == mcz.__version__


def test_public_names_are_where_their_types_say() -> None:
    """The lazy table of ``mcz/__init__.py`` and its imports for type checkers are one list."""
    typed = {
        (node.module, alias.name)
        for node in ast.walk(tree_of(PACKAGE / "__init__.py"))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("mcz.")
        for alias in node.names
    }
    assert typed == {(home, name) for name, home in mcz._HOME_OF.items()}
    assert all(getattr(mcz, name).__name__ == name for name in mcz.__all__)
    assert set(mcz.__all__) == set(mcz._HOME_OF) <= set(dir(mcz))
    with pytest.raises(AttributeError, match="nonsense"):
        mcz.nonsense  # noqa: B018
