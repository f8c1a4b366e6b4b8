"""Files that every decoder decodes: a module or a package a folder of conformance/vectors/valid."""

from tools.vectors.valid import (
    random,
    recovery,
)

MODULES = (
    recovery,
    random,
)
