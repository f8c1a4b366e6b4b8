"""Archives packed, verified and read by the machines of a Dask cluster (the extra ``mcz[dask]``).

The processes of ``mcz.files.jobs`` are one engine, a cluster is another: both do the same work, and
their results are joined in the same order. A lost machine costs only time: Dask repeats its work.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from mcz.errors import OptionError
from mcz.files.dask.cluster import Cluster, connect
from mcz.files.dask.packing import pack
from mcz.files.jobs import use_engine
from mcz.files.reading import faults
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Where
from mcz.files.reading.faults import Problem
from mcz.files.reading.file import File, open
from mcz.files.reading.parallel_clips import can_be_shared, share_clips
from mcz.model.types import Target

__all__ = ["map_clips", "pack", "verify"]


Result = TypeVar("Result")


def verify(
    target: Target,
    client: object = None,
    *,
    max_decoded: int | None = None,
    where: Where | None = None,
) -> list[Problem]:
    """Check an MCZ file as ``mcz.verify``, its clips on the workers of ``client``.

    ``target`` is a path or URL that all of them can read; ``client`` is as in ``pack``. Raises as
    ``mcz.verify``, and WorkerError where machines are lost.
    """
    with connect(client) as used, use_engine(Cluster(used)):
        return faults.verify(target, max_decoded=max_decoded, where=where)


def map_clips(
    target: Target,
    function: Callable[[Clip], Result],
    client: object = None,
    *,
    where: Where | None = None,
    max_decoded: int | None = None,
) -> list[Result]:
    """``function`` of every clip of an MCZ file, on the workers; results in the order of the clips.

    ``where`` selects clips, see ``File.find``. The rest is as in ``verify``. An error raised by
    ``function`` is raised here.
    """
    with open(target, max_decoded=max_decoded) as file, connect(client) as used:
        if not can_be_shared(file):
            raise OptionError("no file that the machines of a cluster can open", path=file.name)
        names = [clip.name for clip in file.chosen(where=where)]
        with use_engine(Cluster(used)), share_clips(_mapped, file, names, function) as answers:
            return [answer() for answer in answers]


def _mapped(shared: tuple[File, Callable[[Clip], Result]], name: str) -> Result:
    file, function = shared
    return function(file.clips[name])
