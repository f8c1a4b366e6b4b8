"""NPY and NPZ: arrays as NumPy saves them, read and written byte for byte without NumPy's loader.

Nothing is unpickled here. SPEC.md, "Template of arrays", is normative.
"""
