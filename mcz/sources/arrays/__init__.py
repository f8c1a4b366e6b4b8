"""NPY and NPZ: arrays as NumPy saves them, read and written byte for byte without NumPy's loader.

``array_files`` reads and writes files, ``interpretation`` finds the motion, ``columns`` has the
numbers, ``layout`` all other bytes. Nothing is unpickled here.

SPEC.md, "Template of arrays", is normative.
"""
