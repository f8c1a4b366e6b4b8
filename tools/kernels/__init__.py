"""The build of kernels: Python functions of numbers and arrays, compiled ahead of time by Cython.

``python -m tools.kernels`` builds them in place; the hook of the package's build does the same. A
unit is a family of kernels (``mcz/kernels/units.py``). ``source`` reads its modules, ``functions``
and ``expressions`` translate each function that it needs to Cython, with the type of every
variable, ``unit`` puts them together, and ``compiling`` has that compiled.

Why not Cython's own annotations in the kernels: those need Cython wherever kernels run as plain
Python, constants of a module become objects, and code that several families share, as the entropy
coder, would not be compiled into each. Declared here, integers have 64 bits whatever the platform.
"""
