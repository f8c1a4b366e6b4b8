"""Files with one fault: a module or a package a folder of conformance/vectors/invalid."""

from tools.vectors.invalid import (
    parts,
    sources,
)

MODULES = (
    parts,
    sources,
)
