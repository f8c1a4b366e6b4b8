"""A decoder with one rule of SPEC.md broken: what proves that the vectors notice.

``python -m tests.broken ID`` is ``python -m mcz.cli.conformance`` in which the rule with that
requirement id does not hold, so that the runner can be pointed at it. The tables of this package
say how: a piece of the source of one module, and what stands there instead.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import CodeType, ModuleType


@dataclass(frozen=True)
class Break:
    """One rule broken: in each patch (module, old, new) the text ``old`` of that module is ``new``.

    ``old`` occurs there once. Each of ``vectors`` alone shows it: the broken decoder fails it.
    Where several breaks have one ``id``, ``variant`` tells them apart. ``crashes``: no vector gets
    an answer, since what the rule keeps out leads beyond the ends of what is there.
    """

    id: str
    vectors: tuple[str, ...]
    patches: tuple[tuple[str, str, str], ...]
    variant: str = ""
    crashes: bool = False

    @property
    def name(self) -> str:
        return f"{self.id}{self.variant and '.'}{self.variant}"


class StaleError(BaseException):
    """A break does not fit its module; no ``except Exception`` may take that for a broken rule."""


class _Loader(SourceFileLoader):
    """Loads a module from its changed source."""

    broken: Break

    def get_code(self, fullname: str) -> CodeType:
        source = self.get_source(fullname)
        assert source is not None
        for module, old, new in self.broken.patches:
            if module == fullname:
                if source.count(old) != 1:
                    times = source.count(old)
                    raise StaleError(f"{self.broken.name}: {times} times in {module}: {old!r}")
                source = source.replace(old, new)
        try:
            return compile(source, self.path, "exec", dont_inherit=True)
        except SyntaxError as error:
            raise StaleError(f"{self.broken.name}: {error}") from None


class _Finder(MetaPathFinder):
    def __init__(self, broken: Break) -> None:
        self.broken = broken
        self.modules = {module for module, _, _ in broken.patches}

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = PathFinder.find_spec(fullname, path) if fullname in self.modules else None
        if spec is None or spec.origin is None:
            return None
        loader = _Loader(fullname, spec.origin)
        loader.broken = self.broken
        spec.loader = loader
        return spec


def install(broken: Break) -> None:
    """Break the rule in this process, in which nothing of mcz may have been imported yet."""
    loaded = [name for name in sys.modules if name.partition(".")[0] == "mcz"]
    if loaded:
        raise ImportError(f"too late to break {broken.name}: {loaded[0]} is there")
    # Compiled loops are cached by the time of their file, which does not change.
    os.environ["NUMBA_DISABLE_JIT"] = "1"
    sys.meta_path.insert(0, _Finder(broken))
