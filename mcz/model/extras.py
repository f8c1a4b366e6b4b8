"""Optional packages, imported on use, and the annexes of SPEC.md.

Annexes are in the folder ``annex`` of the package, to which ``conformance/annex`` is a link.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType

from mcz.errors import OptionError


def import_extra(name: str, extra: str, *, package: str = "", purpose: str = "") -> ModuleType:
    """Import the module ``name``; raises OptionError that names the extra if it is not installed.

    ``package`` is its name for users, if that is another one; ``purpose`` is a noun phrase for the
    message, such as "s3://takes/walk.mcz".
    """
    package = package or name.partition(".")[0]
    try:
        return import_module(name)
    except ImportError as error:
        missing = f"{purpose} needs {package}, which is" if purpose else f"{package} is"
        raise OptionError(f"{missing} not installed (pip install 'mcz[{extra}]')") from error


FOLDER = Path(__file__).parents[1] / "annex"


def annex_bytes(name: str) -> bytes:
    """The annex with this file name."""
    return (FOLDER / name).read_bytes()


def annex_names(pattern: str) -> list[str]:
    """The file names that fit a pattern such as ``bases_*.bin``, sorted."""
    return sorted(path.name for path in FOLDER.glob(pattern))
