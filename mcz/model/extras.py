"""Packages that not every installation has: imported on use, named where they are missing."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from mcz.errors import OptionError


def import_extra(name: str, extra: str, *, package: str = "", purpose: str = "") -> ModuleType:
    """The module ``name``; raises OptionError that names the extra where it is not installed.

    ``package`` is its name for users, where that is another one; ``purpose`` is a noun phrase, for
    the message: "s3://takes/walk.mcz".
    """
    package = package or name.partition(".")[0]
    try:
        return import_module(name)
    except ImportError as error:
        missing = f"{purpose} needs {package}, which is" if purpose else f"{package} is"
        raise OptionError(f"{missing} not installed (pip install 'mcz[{extra}]')") from error
