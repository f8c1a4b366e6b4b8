"""CSV and NPZ: the two exports of ``mcz decode --to``; docs/scripts.md describes them."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mcz.cli.terminal import printable
from mcz.motion import Channel, Skeleton


@dataclass(frozen=True, slots=True)
class Table:
    """Some channels of some frames.

    ``values`` is float64 (n_frames, n_channels) in source units; ``mask`` (bool, same shape) is
    True where a value is valid; ``frame_numbers`` (int64) are the source's own.
    """

    names: list[str]
    values: NDArray[np.float64]
    mask: NDArray[np.bool_]
    frame_numbers: NDArray[np.int64]
    frame_rate: Fraction | None


def channel_names(skeleton: Skeleton, own: Sequence[Channel] | None = None) -> list[str]:
    """``joint.channel`` of every column; ``joint#n`` where a joint's name repeats.

    Of a signal with ``own`` channels their names, or ``channel-n`` where one has none.
    """
    if own is not None:
        return [channel.label or f"channel-{n}" for n, channel in enumerate(own)]
    return [
        f"{address}.{channel.label}"
        for address, joint in zip(skeleton.addresses(), skeleton.joints, strict=True)
        for channel in joint.channels
    ]


def to_csv(table: Table) -> bytes:
    """UTF-8 text: a header row, then a row a frame; an invalid value is an empty cell.

    What would steer a terminal is escaped in the names, as text it is often printed on one.
    Values are the shortest decimals that read back as the same binary64.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["frame", *map(printable, table.names)])
    rows = zip(
        table.frame_numbers.tolist(), table.values.tolist(), table.mask.tolist(), strict=True
    )
    for number, values, valid in rows:
        cells = [repr(v) if ok else "" for v, ok in zip(values, valid, strict=True)]
        writer.writerow([number, *cells])
    return text.getvalue().encode("utf-8", "surrogateescape")


def to_npz(table: Table) -> bytes:
    """A NumPy archive of values, mask, frame_numbers, frame_rate and names, without pickles."""
    rate = table.frame_rate
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        values=table.values,
        mask=table.mask,
        frame_numbers=table.frame_numbers,
        frame_rate=np.float64(np.nan if rate is None else float(rate)),
        frame_rate_fraction=np.array(
            [0, 1] if rate is None else [rate.numerator, rate.denominator], np.int64
        ),
        names=np.array(table.names, dtype=np.str_),
    )
    return buffer.getvalue()


EXPORTS: dict[str, Callable[[Table], bytes]] = {"csv": to_csv, "npz": to_npz}
