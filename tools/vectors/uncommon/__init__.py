"""Files that are rare but legal: containers."""

from tools.vectors.uncommon import container

MODULES = (container,)
