"""``python -m tools.fuzz.worker``: one target in a process of its own, which libFuzzer ends."""

from __future__ import annotations

import argparse
import importlib
import os
import random
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).parents[2] / "mcz"
APART = ("mcz.bench", "mcz.cli", "mcz.exchange.datasets")  # not part of reading
WARM = 30  # seeds that are checked beforehand
HANG = 150  # seconds of wall time after which libFuzzer ends the process, in a loop of its own


def main() -> None:
    given = _parser().parse_args()
    if not given.sanitized:
        # An index out of bounds then raises in compiled loops, too.
        os.environ["MCZ_LOOPS"] = "interpreted" if given.plain else "checked"
    import atheris

    _import_instrumented(atheris, plain=given.plain)
    from mcz.kernels import MODE, lacks_compiled_kernels
    from tools.fuzz.guard import Record, limit_memory, limit_time
    from tools.fuzz.targets import TARGETS

    if lacks_compiled_kernels():
        sys.exit(f"kernels are not compiled, or have changed: python -m tools.kernels {MODE}")
    target = TARGETS[given.target]
    seeds = _choose_seeds(target.seeds(), given)
    for data in list(seeds.values())[:: 1 + len(seeds) // WARM]:
        _try(target.check, data)  # what is compiled and cached now is not charged to an input
    record = Record(target.name, given.findings, given.figures)
    if not given.sanitized:  # AddressSanitizer reserves far more than it uses, and limits itself
        limit_memory()
    limit_time()

    def check(data: bytes) -> None:
        record.run(target.check, data)

    options: dict[str, Any] = {}
    if target.mutator is not None:
        options["custom_mutator"] = target.mutator
    atheris.Setup([sys.argv[0], *_options(given, target.words, seeds)], check, **options)
    atheris.Fuzz()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="tools.fuzz.worker", description=__doc__)
    parser.add_argument("target")
    for folder in ("--corpus", "--seeds", "--findings", "--figures"):
        parser.add_argument(folder, type=Path, required=True)
    parser.add_argument("--seconds", type=int, default=0)
    parser.add_argument("--runs", type=int, default=-1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--most-seeds", type=int, default=10**6)
    parser.add_argument("--plain", action="store_true")
    parser.add_argument("--sanitized", action="store_true")
    return parser


def _import_instrumented(atheris: Any, *, plain: bool) -> None:
    """Import the package with counters of branches, but for loops that are to be compiled."""
    modules = {_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}
    wanted = [name for name in modules if not name.startswith(APART)]
    kernels = [name for name in wanted if "import kernel" in modules[name].read_text()]
    compiled = [] if plain else kernels
    with atheris.instrument_imports(include=["mcz"], exclude=["mcz.kernels", *compiled]):
        for name in wanted:
            importlib.import_module(name)


def _name(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


def _choose_seeds(seeds: dict[str, bytes], given: argparse.Namespace) -> dict[str, bytes]:
    if len(seeds) <= given.most_seeds:
        return seeds
    names = sorted(random.Random(given.seed).sample(sorted(seeds), given.most_seeds))
    return {name: seeds[name] for name in names}


def _try(check: Any, data: bytes) -> None:
    with suppress(Exception):  # it comes again, and counts then
        check(data)


def _options(given: argparse.Namespace, words: Any, seeds: dict[str, bytes]) -> list[str]:
    for name, data in seeds.items():
        (given.seeds / name).write_bytes(data)
    options = [f"-seed={given.seed}", f"-max_total_time={given.seconds}", f"-timeout={HANG}"]
    options.append(f"-report_slow_units={HANG}")
    options += ["-rss_limit_mb=0", "-max_len=32768", f"-artifact_prefix={given.findings}/dead-"]
    options += [f"-runs={given.runs}", "-print_final_stats=1"]
    if words:
        path = given.figures.with_suffix(".words")
        path.write_text("".join(f'"{_escape_word(word)}"\n' for word in words))
        options.append(f"-dict={path}")
    return [*options, str(given.corpus), str(given.seeds)]


def _escape_word(word: str) -> str:
    return word if word.startswith("\\x") else word.replace('"', '\\"')


if __name__ == "__main__":
    main()
