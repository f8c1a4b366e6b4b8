"""Tables of the events of a recording, CSV and NPZ."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from mcz.model.text_format import printable, spreadsheet_cell
from mcz.model.types import Settings

TEXTS = ("label", "context", "subject", "description")


class Event(Protocol):
    """The part of a ``mcz.Event`` that a table shows: its time and ``TEXTS``."""

    @property
    def time(self) -> float: ...


Events = Sequence[Event]


def to_csv(events: Events) -> bytes:
    """UTF-8 text: a header row, then a row an event; times in seconds, see ``mcz.times``.

    Texts are escaped as in other tables.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time", *TEXTS])
    for event in events:
        texts = (spreadsheet_cell(printable(getattr(event, name))) for name in TEXTS)
        writer.writerow([repr(event.time), *texts])
    return text.getvalue().encode("utf-8", "surrogateescape")


def to_npz(events: Events) -> bytes:
    """A NumPy archive of times (float64, seconds), label, context, subject, description."""
    buffer = io.BytesIO()
    columns: Settings = {
        name: np.array([getattr(event, name) for event in events], np.str_) for name in TEXTS
    }
    np.savez_compressed(
        buffer, times=np.array([event.time for event in events], np.float64), **columns
    )
    return buffer.getvalue()


EVENT_EXPORTS: dict[str, Callable[[Events], bytes]] = {"csv": to_csv, "npz": to_npz}
