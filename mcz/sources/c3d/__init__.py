"""C3D: points, analog channels and parameters.

``c3d`` reads and writes files, ``shape`` checks their sections, ``layout`` keeps all bytes beside
the data, ``recording`` has the metadata; ``plain`` writes motions that come from elsewhere.
"""
