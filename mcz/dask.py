"""Archives packed, verified and read by a Dask cluster (the extra ``mcz[dask]``): public names."""

from mcz.files.dask import map_clips, pack, verify

__all__ = ["map_clips", "pack", "verify"]
