"""``mcz.dask.pack``: files are read and coded on the machines of a cluster, and joined here."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import cast

from mcz.container.limits import profile_named
from mcz.files.dask.cluster import Cluster, connected
from mcz.files.dask.sources import FarAsk, Found, coded_there, listed, skeletons_beside
from mcz.files.editing.archive import write_in_turn
from mcz.files.editing.batch_report import Outcome, Report
from mcz.files.editing.coded_parts import Far, Part, ask_of
from mcz.files.editing.folders import NO_MOTION, motion_files
from mcz.files.editing.safe_names import notes_on
from mcz.files.jobs import Answer
from mcz.files.reading.source_files import SourceOptions
from mcz.files.writing.atomic import replacing
from mcz.files.writing.source_encoder import SourceEncoder, WritingOptions, encoding_options
from mcz.files.writing.write_transaction import WriteTransaction
from mcz.model.types import Params, Progress, Target


def pack(
    root: str | os.PathLike[str],
    target: Target,
    client: object = None,
    *,
    codec: str | None = None,
    effort: str | None = None,
    params: Params | None = None,
    rate: float | None = None,
    force_rate: bool = False,
    unit: str | None = None,
    up: str | None = None,
    arrays: str | None = None,
    model: str | os.PathLike[str] | None = None,
    verbatim: bool = False,
    keep_all: bool = False,
    force: bool = False,
    profile: str = "base",
    copies: bool = True,
    progress: Progress | None = None,
) -> Report:
    """Pack every motion file below ``root`` into one MCZ file, as ``mcz.pack`` does.

    ``root`` and ``target`` are paths or URLs that fsspec knows ("s3://bucket/takes"); all machines
    can read ``root``, only this one writes ``target``. ``client`` is a ``distributed.Client``, the
    address of a scheduler, or None for the client that there is. The bytes are those of
    ``mcz.pack``. Raises OptionError, and WorkerError where the cluster has no workers; a file whose
    machines are lost again and again is reported as failed.
    """
    root = os.fspath(root)
    found, others = listed(root, target)
    taken, left = _chosen(found, keep_all)
    options = SourceOptions(
        rate=rate,
        force_rate=force_rate,
        unit=unit,
        up=up,
        arrays=arrays,
        model=model,
        verbatim=verbatim or keep_all,
        flat=True,
    )
    encoding = encoding_options(codec, effort, params)
    paths = [os.path.join(root, one.name) for one in taken] if "://" not in root else []  # noqa: PTH118
    inputs = (*paths, *encoding.params.values())
    report, writing = Report(), WritingOptions(force, profile_named(profile), copies)
    skeletons = [one.name for one in found if one.name.lower().endswith(".asf")]
    entries = [SourceEncoder(Path(root, one.name), one.name, options, encoding) for one in taken]
    asks = (
        FarAsk(root, ask_of(entry, writing.profile), skeletons_beside(entry.name, skeletons))
        for entry in entries
    )
    with connected(client) as used, replacing(target, force=force, inputs=inputs) as stream:
        transaction = WriteTransaction(stream, writing.profile, copies=writing.copies)
        with closing(Cluster(used).in_order(coded_there, asks, None)) as answers:
            given = cast(Iterator[Answer[Part]], answers)  # none is None
            made = zip(entries, given, taken, strict=True)
            parts = (Far(entry, answer, one.size) for entry, answer, one in made)
            write_in_turn(transaction, parts, len(taken), report, progress, {})
        transaction.finish()
    report.size = transaction.writer.offset
    report.note(notes_on(one.name for one in taken))
    report.outcomes += sorted([*others, *left], key=lambda one: os.fsencode(one.path))
    return report


def _chosen(found: Sequence[Found], keep_all: bool) -> tuple[list[Found], list[Outcome]]:
    """The files that are packed, and what becomes of the others."""
    motions, _ = motion_files([Path(one.name) for one in found])
    known = {path.as_posix() for path in motions}
    left = [Outcome(o.name, "skipped", o.size, NO_MOTION) for o in found if o.name not in known]
    return (list(found), []) if keep_all else ([o for o in found if o.name in known], left)
