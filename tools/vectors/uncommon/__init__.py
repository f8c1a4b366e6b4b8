"""Files that are rare but legal: containers, and a module for the folders of all codecs."""

from tools.vectors.uncommon import codecs, container

MODULES = (container, codecs)
