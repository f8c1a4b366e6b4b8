"""MCZ files and archives: where model, codecs, container and sources meet.

``reading`` opens and verifies, ``writing`` encodes, ``editing`` cuts, packs, repairs and unpacks,
``live`` streams frames. ``queries`` selects clips, ``tables`` gives pandas and xarray, ``bags``
checks folders, ``jobs`` and ``dask`` share the work among processes and machines.

Imports every room named so far: ``model``, ``kinematics``, ``codecs``, ``container``, ``sources``.
"""
