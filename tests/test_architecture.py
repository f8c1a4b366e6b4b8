"""Rules about the source itself: the arrows of the layers, bytes, construct, lazy imports."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

import mcz

PACKAGE = Path(mcz.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))
ROOT = Path(__file__).parent.parent

# Rooms, and what each may import beside itself.
BASE = {"errors", "hints"}
MODEL = BASE | {"model"}
MOTION = MODEL | {"kinematics"}
FILES = MOTION | {"codecs", "container", "sources", "files"}
PUBLIC = ""  # mcz/__init__.py
ROOMS = {
    "model": BASE,
    "kinematics": MODEL,
    "codecs": MOTION,
    "container": MODEL,
    "sources": MOTION,
    "files": FILES,
    "exchange": FILES | {"version"},
    "show": FILES,
    "bench": FILES | {"show", PUBLIC},
    "cli": FILES | {"exchange", "show", "bench", PUBLIC},
}
ALLOWED = ROOMS | {
    "hints": set(),
    "errors": {"hints"},
    "version": set(),
    "kernels": set(),
    "dask": {"files"},
    "__main__": {"cli"},
    PUBLIC: FILES | {"exchange", "show", "version"},
}
# Parts of a room from below: none imports a part of a later line.
LAYERS = {
    "model": (
        "checks extras identity notebook text_format threads types",
        "schema",
        "numbers",
        "skeleton",
        "signal",
        "clock",
        "motion",
        "units",
    ),
    "codecs": ("coding transforms", "*", "training"),
    "container": ("*", "recovery"),
    "kinematics": ("*", "metrics poses retargeting"),
    "sources": ("*", "sample"),
    "files": ("queries query_tree tables", "reading jobs", "bags writing", "editing live", "dask"),
    "exchange": ("conversion", "*"),
    "show": ("pictures viewing", "rerun"),
}
KERNELS = {"kernels"}  # their decorator and types: any layer's kernels may use them

BANNED_CONSTRUCTS = {"GreedyRange", "Enum", "Flag", "Padding", "VarInt", "Compressed"}
HEAVY = {"fsspec", "pywt", "matplotlib", "PIL", "av"}
HEAVY |= {"xarray", "rerun"}


def name_of(path: Path) -> str:
    """``numbers`` or ``codecs.raw``; "" for the package itself."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def part_of(name: str) -> str:
    return name.partition(".")[0]


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text("utf-8"), str(path))


@cache
def imports(path: Path) -> frozenset[str]:
    """Names below ``mcz`` of the modules that ``path`` imports, at any depth of its code."""
    return frozenset(_imports(path))


def _imports(path: Path) -> Iterator[str]:
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


def faults(of: Callable[[Path], object]) -> dict[str, object]:
    """Results of ``of`` for each module where they are not empty."""
    return {name_of(path): wrong for path in MODULES if (wrong := of(path))}


def test_the_package_stands_alone() -> None:
    """The tools, tests and runner import the package, never the other way round."""
    around = re.compile(r"(?m)^\s*(?:from|import) (?:tools|tests|conformance)\b.*")
    assert not faults(lambda path: around.findall(path.read_text("utf-8")))


@pytest.mark.parametrize("folder", ["tools", "tests", "conformance"])
def test_what_others_import_of_the_package_is_there(folder: str) -> None:
    """Each name, at any depth of their code, but for what 0.9 alone has."""
    asked = {
        (node.module, alias.name)
        for path in sorted((ROOT / folder).rglob("*.py"))
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "mcz"
        for alias in node.names
    }
    missing = {f"{module}.{name}" for module, name in asked if not _is_there(module or "", name)}
    assert missing <= {"mcz.editing.protecting.redundancy_of"}


def _is_there(module: str, name: str) -> bool:
    try:
        found = importlib.import_module(module)
    except ImportError:
        return False
    return hasattr(found, name) or importlib.util.find_spec(f"{module}.{name}") is not None


def longest_module(parts: list[str]) -> str:
    while parts:
        base = PACKAGE.joinpath(*parts)
        if base.with_suffix(".py").exists() or (base / "__init__.py").exists():
            break
        parts = parts[:-1]
    return ".".join(parts)


def layer_of(name: str) -> int:
    """Line of ``LAYERS`` that has the part of a room that ``name`` is in."""
    room, _, rest = name.partition(".")
    layers = [set(line.split()) for line in LAYERS.get(room, ())]
    at = [i for i, parts in enumerate(layers) if part_of(rest) in parts]
    others = [i for i, parts in enumerate(layers) if "*" in parts]
    return (at + others)[0] if rest and layers else 0


def against_the_arrows(path: Path) -> set[str]:
    here = name_of(path)
    room = part_of(here)
    allowed = ALLOWED[room] | {room} | KERNELS
    own = {name for name in imports(path) if part_of(name) == room != ""}
    above = {name for name in own if layer_of(name) > layer_of(here)} if "." in here else set()
    return {name for name in imports(path) if part_of(name) not in allowed} | above


def test_every_room_has_a_page() -> None:
    rooms = {path.parent.name: path for path in PACKAGE.glob("*/__init__.py")}
    assert rooms.keys() == ROOMS.keys() | KERNELS
    pages = {room: ast.get_docstring(tree_of(path)) or "" for room, path in rooms.items()}
    assert not [room for room in ROOMS if len(pages[room].splitlines()) < 5]


def test_imports_follow_the_arrows() -> None:
    assert not faults(against_the_arrows)


CODEC_MODULES = {
    name_of(path)
    for path in PACKAGE.glob("codecs/**/*.py")
    if "\nCODEC = Codec(" in path.read_text("utf-8")
}
FAMILIES = {path.name for path in (PACKAGE / "codecs").iterdir() if (path / "__init__.py").exists()}
FAMILIES -= {"coding", "transforms"}


def other_families(path: Path) -> set[str]:
    names = name_of(path).split(".")
    if names[0] != "codecs" or len(names) == 1 or names[1] == "training":
        return set()  # mcz/codecs/__init__.py holds the table, which names them all
    return {n.split(".")[1] for n in imports(path) if n.startswith("codecs.")} & FAMILIES - {
        names[1]
    }


def test_codec_families_do_not_import_each_other() -> None:
    assert not faults(other_families)


def test_a_codec_does_not_import_another() -> None:
    assert not faults(lambda path: CODEC_MODULES & imports(path) - {name_of(path)})


def test_no_module_imports_itself_in_a_circle() -> None:
    """Taking away modules that import none of the rest leaves nothing."""
    rest = {name_of(path): imports(path) - {name_of(path)} for path in MODULES}
    while rest:
        free = {name for name, needs in rest.items() if not needs & set(rest)}
        assert free, f"in circles: {sorted(rest)}"
        rest = {name: needs for name, needs in rest.items() if name not in free}


def calls(path: Path) -> Iterator[tuple[ast.Call, ast.Attribute]]:
    """Every call of an attribute, ``x.name(...)``."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            yield node, node.func


def others(path: Path) -> Iterator[str]:
    """The packages other than this one that ``path`` imports, at any depth of its code."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield (node.module or "").partition(".")[0]


def test_one_door_to_construct() -> None:
    """Records are parsed and built by ``mcz.model.schema`` alone, which turns errors into ours."""

    def opens_it(path: Path) -> set[str]:
        names = {"construct_type", "compiled_type", "_parsereport"}
        return {func.attr for _, func in calls(path) if func.attr in names}

    assert faults(opens_it).keys() == {"model.schema.records", "model.schema.types"}


def test_what_is_optional_is_imported_on_use() -> None:
    """Within functions, so that who reads needs neither; ``tests/bare.py`` reads without them."""

    def at_once(path: Path) -> set[str]:
        found: set[str] = set()
        for node in tree_of(path).body:
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                found.add((node.module or "").partition(".")[0])
        return found & HEAVY

    assert not faults(at_once)
    pywt = faults(lambda path: "pywt" in set(others(path)))
    assert pywt.keys() == {"codecs.transforms.wavelets"}


def banned_constructs(path: Path) -> set[str]:
    """Types of construct that accept malformed bytes, by the names under which they come."""
    used = {node.attr for node in ast.walk(tree_of(path)) if isinstance(node, ast.Attribute)}
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.ImportFrom) and node.module == "construct":
            used |= {alias.name for alias in node.names}
    return BANNED_CONSTRUCTS & used


def test_no_banned_construct() -> None:
    assert not faults(lambda path: "construct" in set(others(path)) and banned_constructs(path))


def is_explicit(dtype: ast.expr) -> bool:
    """True if a dtype names its byte order, has none, or is a variable."""
    if isinstance(dtype, ast.JoinedStr):
        dtype = dtype.values[0]
    if isinstance(dtype, ast.Constant):
        return str(dtype.value).lstrip("|").startswith(("<", ">", "u1", "i1", "S", "V"))
    if isinstance(dtype, ast.Attribute):
        return dtype.attr in ("uint8", "int8", "bool_")
    return True


def orders_left_open(path: Path) -> list[str]:
    """Calls that make or take bytes in the order of whatever machine runs them."""
    places = []
    for node, func in calls(path):
        if func.attr in ("frombuffer", "fromfile"):
            dtypes = node.args[1:2] + [k.value for k in node.keywords if k.arg == "dtype"]
            if not dtypes or not is_explicit(dtypes[0]):
                places.append(f"line {node.lineno}: {ast.unparse(node)}")
        if func.attr == "tobytes" and isinstance(func.value, ast.Call):
            inner = func.value
            if isinstance(inner.func, ast.Attribute) and inner.func.attr == "astype":
                is_open = not is_explicit(inner.args[0])
            else:
                made = ast.unparse(inner.func)
                is_open = made in ("np.uint16", "np.uint32", "np.uint64", "np.int64")
            places += [f"line {node.lineno}: {ast.unparse(node)}"] * is_open
    return places


def test_bytes_have_an_explicit_byte_order() -> None:
    assert not faults(orders_left_open)


def test_modules_stay_short() -> None:
    def too_long(path: Path) -> int:
        n = len(path.read_text("utf-8").splitlines())
        return n * (n > 420)

    assert not faults(too_long)


# Words that open a clause where PEP 257 wants a noun or an imperative.
CLAUSES = {"How", "Of", "That", "Those", "What", "When", "Where", "Whether", "Which", "Who", "Why"}


def clauses(path: Path) -> list[str]:
    documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    nodes = (node for node in ast.walk(tree_of(path)) if isinstance(node, documented))
    texts = (ast.get_docstring(node) or "." for node in nodes)
    return [text for text in texts if text.split()[0] in CLAUSES]


def test_docstrings_begin_with_a_noun_or_a_verb() -> None:
    assert not faults(clauses)


@pytest.mark.parametrize("folder", ["tests", "tools", "conformance"])
def test_docstrings_around_the_package_begin_with_a_noun_or_a_verb(folder: str) -> None:
    paths = [p for p in (ROOT / folder).rglob("*.py") if "node_modules" not in p.parts]
    assert paths
    assert not {str(path): texts for path in paths if (texts := clauses(path))}


MOST_PARAMETERS = 8


def test_functions_have_few_parameters() -> None:
    """But for public functions with keywords, commands of click, and kernels."""
    public = {(home.replace(".", "/"), name) for name, home in mcz._HOME_OF.items()}
    public |= {("mcz/files/dask", "pack"), ("mcz/exchange/datasets/member_list", "dataset")}
    public.add(("mcz/files/live/writer", "__init__"))

    def crowded(path: Path) -> list[str]:
        if path.stem.endswith("kernels"):
            return []
        home = path.relative_to(PACKAGE.parent).with_suffix("").as_posix()
        names = []
        for node in ast.walk(tree_of(path)):
            if not isinstance(node, ast.FunctionDef) or (home, node.name) in public:
                continue
            if any(ast.unparse(call).startswith("click.") for call in node.decorator_list):
                continue
            given = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            if len(given) - (bool(given) and given[0].arg in ("self", "cls")) > MOST_PARAMETERS:
                names.append(node.name)
        return names

    assert not faults(crowded)


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


def test_the_wheel_has_the_package_alone() -> None:
    tool = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text("utf-8"))["tool"]
    assert tool["hatch"]["build"]["targets"]["wheel"]["packages"] == ["mcz"]


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


MOST_ANY = 300  # words, imports included; this may only fall


def test_types_say_what_is_passed() -> None:
    n_any = sum(len(re.findall(r"\bAny\b", path.read_text("utf-8"))) for path in MODULES)
    assert n_any <= MOST_ANY
