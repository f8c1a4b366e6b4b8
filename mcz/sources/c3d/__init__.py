"""C3D: points, analog channels and parameters.

``c3d`` reads and writes files, ``data_section`` checks and restores their data, ``layout`` keeps
all other bytes, ``recording`` has the metadata; ``plain`` writes motions that come from elsewhere.
"""
