"""Archives packed, verified and read by the machines of a Dask cluster (the extra ``mcz[dask]``).

The processes of ``mcz.jobs`` are one engine, a cluster is another: the same work is given to it,
and what comes back is joined in the same order. So a machine that is lost costs time and nothing
else: Dask does again what it had in hand.
"""

from mcz.dask.packing import pack
from mcz.dask.reading import map_clips, verify

__all__ = ["map_clips", "pack", "verify"]
