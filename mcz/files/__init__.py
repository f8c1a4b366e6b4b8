"""Where motion, codec and container meet: files opened, read, written, cut, edited and compared.

``file.py`` opens and closes; ``sources.py`` reads source files, ``encoding.py`` turns a Motion into
chunks and ``clip.py`` chunks into values. The other modules are verbs of the public interface, or
one idea of these each.
"""
