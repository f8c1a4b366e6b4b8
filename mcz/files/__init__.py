"""MCZ files and archives: combines model, codecs, container and sources.

``reading`` opens and verifies, ``writing`` encodes, ``editing`` cuts, packs, repairs and unpacks,
``live`` streams frames. ``queries`` selects clips, ``tables`` exports to pandas and xarray,
``bags`` checks folders, ``jobs`` and ``dask`` distribute the work to processes and machines.

Imports these folders: ``model``, ``kinematics``, ``codecs``, ``container``, ``sources``.
"""
