"""Input options of ``mcz render`` and ``mcz plot``, and the motion that they select."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from mcz.cli.common import about, existing, opened
from mcz.cli.options import (
    arrays_option,
    decoded_option,
    frames_option,
    model_option,
    rate_option,
    skeleton_option,
    unit_option,
    up_option,
)

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip
    from mcz.model.motion import Motion

Function = Callable[..., object]


def moving_options(function: Function) -> Function:
    """``--clip --frames --rate --unit --up --skeleton --arrays --model --max-decoded``."""
    options = (
        click.option(
            "--clip",
            "name",
            metavar="NAME",
            help="Choose the clip of an .mcz. Default: the only one.",
        ),
        frames_option("Frames A <= f < B, from 0."),
        rate_option(),
        unit_option("Length unit of a file without."),
        up_option("Axis that points up, of a file that does not say."),
        skeleton_option("The ASF of an AMC, or none."),
        arrays_option,
        model_option,
        decoded_option,
    )
    for option in reversed(options):
        function = option(function)
    return function


@contextmanager
def moving_of(
    path: str,
    *,
    name: str | None,
    max_decoded: int | None,
    **said: Any,
) -> Iterator[Motion | Clip]:
    """The motion of a source file, or a clip of an .mcz that stays open; errors name the file.

    ``said`` are fields of ``SourceOptions``. They change a source file alone: whoever draws a clip
    is given the same.
    """
    import mcz
    from mcz.files.reading.file import is_mcz
    from mcz.files.reading.source_files import SourceOptions

    if path == "-" or is_mcz(path):
        with opened(path, max_decoded=max_decoded) as file, about(path):
            yield file.only_clip(name)
        return
    existing(path)
    with about(path):
        read = {name: said.pop(name) for name in ("skeleton", "arrays", "model")}
        yield SourceOptions(**said).completing(mcz.read(path, **read))


def cut_of(frames: tuple[int, int | None] | None, moving: Motion | Clip) -> tuple[int, int] | None:
    """``--frames`` with its end, of this motion."""
    if frames is None:
        return None
    start, stop = frames
    return start, moving.n_frames if stop is None else stop
