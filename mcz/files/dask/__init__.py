"""Archives packed, verified and read by the machines of a Dask cluster (the extra ``mcz[dask]``).

The processes of ``mcz.files.jobs`` are one engine, a cluster is another: both do the same work,
and its results are joined in the same order. A lost machine costs time and nothing else: Dask does
its work again.
"""

from mcz.files.dask.packing import pack
from mcz.files.dask.reading import map_clips, verify

__all__ = ["map_clips", "pack", "verify"]
