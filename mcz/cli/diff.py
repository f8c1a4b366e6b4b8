"""``mcz diff``: how far one motion is from another, in channels, units and centimeters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from fractions import Fraction
from math import inf
from typing import TYPE_CHECKING, Any

import click

from mcz.cli.common import (
    EXIT_CODES,
    Exit,
    Failure,
    about,
    echo,
    existing,
    opened,
    print_json,
)
from mcz.cli.diff_lines import lines_of
from mcz.cli.options import (
    arrays_option,
    decoded_option,
    frames_option,
    json_option,
    model_option,
    rate_option,
    skeleton_option,
    unit_option,
    up_option,
    where_option,
)
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.files.reading.file import File
    from mcz.model.motion import Motion

RATIOS = ("cr_source", "cr_float32", "cr_40B")
Cut = tuple[int, int | None] | None


def _to_radius(ctx: click.Context, param: click.Parameter, value: float) -> float:
    """Callback of a radius in cm."""
    if not 0 < value < inf:
        raise click.BadParameter(f"{value:g} is not a length above 0")
    return value


def _to_names(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[str, ...]:
    """Callback of names with commas between them."""
    return () if value is None else tuple(name.strip() for name in value.split(",") if name.strip())


@click.command(short_help="Measure how far one motion is from another.", epilog=EXIT_CODES)
@click.argument("a", metavar="A", type=click.Path(readable=False))
@click.argument("b", metavar="B", type=click.Path(readable=False))
@click.option(
    "--clip",
    "names",
    metavar="NAME",
    multiple=True,
    help=("Choose a clip of an .mcz (repeatable). Default: the only one, or all that both have."),
)
@where_option
@frames_option("Frames A <= f < B of both, from 0.")
@unit_option("Length unit of a file that says none.")
@skeleton_option("The ASF of an AMC, or none.")
@rate_option()
@up_option("Axis that points up, of a file that does not say.")
@arrays_option
@model_option
@click.option(
    "--shell",
    "shell_cm",
    metavar="CM",
    type=float,
    default=3.0,
    callback=_to_radius,
    help="Set the radius of the shell around joints. Default: 3.",
)
@click.option("--by-joint", is_flag=True, help="Print the distances of every joint.")
@click.option("--contacts", is_flag=True, help="Print every contact of a foot with the floor.")
@click.option(
    "--feet",
    metavar="NAME,...",
    callback=_to_names,
    help=(
        "Name the joints that stand on the floor. Default: those called foot, toe, ankle or heel."
    ),
)
@decoded_option
@json_option
def command(
    a: str,
    b: str,
    names: tuple[str, ...],
    where: str | None,
    frames: Cut,
    max_decoded: int | None,
    as_json: bool,
    **options: Any,
) -> Exit:
    """Compare B with A, the original: any two of .mcz and of source formats.

    Print errors of channels, and of positions in length units and cm (docs/reference/measures.md),
    how far feet slide that stand in A, and compression ratios of an .mcz. The exit code is 0
    whenever the two could be compared, however much they differ. --where is asked of the clips of
    A, or of B where A is no .mcz.
    """
    wanted = _Wanted(frames=frames, **options)
    if (a, b) == ("-", "-"):
        raise Failure("only one of A and B can be standard input", Exit.USAGE)
    with ExitStack() as stack:
        left, right = (_Side(path, stack, wanted, max_decoded) for path in (a, b))
        asked = names if where is None else _taken(left, right, names, where)
        pairs = list(_pairs(left, right, asked))
        documents = [_compared(left, right, *pair, wanted) for pair in pairs]
    only = {
        f"only_in_{key}": sorted(set(own.clips) - set(other.clips))
        for key, own, other in (("a", left, right), ("b", right, left))
        if _by_name(left, right) and not asked
    }
    if as_json:
        print_json({"a": a, "b": b, "clips": documents, **only})
        return Exit.FINE
    for number, document in enumerate(documents):
        for line in ([""] if number else []) + list(lines_of(a, b, document)):
            echo(line)
    for key, found in only.items():
        for name in found:
            echo(f"only in {a if key == 'only_in_a' else b}: {name}")
    return Exit.FINE


@dataclass(frozen=True, slots=True, kw_only=True)
class _Wanted:
    """Options of a comparison, and facts that the files lack."""

    frames: Cut
    unit: str | None
    rate: Fraction | None
    up: str | None
    skeleton: str | None
    arrays: str | None
    model: str | None
    shell_cm: float
    by_joint: bool
    contacts: bool
    feet: tuple[str, ...]

    def told(self, motion: Motion) -> Motion:
        """``motion`` with what it does not say itself."""
        from mcz.files.reading.source_files import SourceOptions

        said = SourceOptions(rate=self.rate, unit=self.unit, up=self.up)
        return said.completing(motion)


@dataclass(frozen=True, slots=True)
class _Loaded:
    """One motion to compare, where its frames begin in its clip, and its ratios."""

    motion: Motion
    start: int
    ratios: dict[str, float | None] | None


class _Side:
    """A or B: a source file, or an .mcz that stays open."""

    def __init__(
        self,
        path: str,
        stack: ExitStack,
        wanted: _Wanted,
        max_decoded: int | None,
    ) -> None:
        from mcz.files.reading.file import is_mcz

        self.path, self._wanted = path, wanted
        self.file: File | None = None
        if path == "-" or is_mcz(path):
            self.file = stack.enter_context(opened(path, max_decoded=max_decoded))
        else:
            existing(path)

    @property
    def clips(self) -> list[str]:
        return [] if self.file is None else list(self.file.clips)

    def load(self, name: str | None) -> _Loaded:
        """The motion called ``name``, or the only one, cut to the frames that are wanted."""
        import mcz
        from mcz.files.reading.sizes import clip_ratios

        frames = self._wanted.frames
        with about(self.path):
            if self.file is None:
                wanted = self._wanted
                motion = mcz.read(
                    self.path,
                    skeleton=wanted.skeleton,
                    arrays=wanted.arrays,
                    model=wanted.model,
                )
                start, stop = _range(frames, motion.n_frames, self.path)
                motion = motion.cut(start, stop)
                ratios = None
            else:
                clip = self.file.only_clip(name)
                start, stop = _range(frames, clip.n_frames, f"clip {clip.name!r}")
                motion = clip.motion((start, stop))
                found = clip_ratios(self.file, clip)
                ratios = {key: found[key] for key in RATIOS}
            motion = self._wanted.told(motion)
        return _Loaded(motion, start, ratios)


def _range(frames: Cut, n_frames: int, what: str) -> tuple[int, int]:
    start, stop = frames or (0, None)
    stop = n_frames if stop is None else stop
    if not start <= stop <= n_frames:
        raise Failure(f"{what} has frames 0 to {n_frames}, not {start}:{stop}", Exit.USAGE)
    return start, stop


def _by_name(left: _Side, right: _Side) -> bool:
    """Return whether clips are paired by name: two .mcz files, at least one with several clips."""
    return bool(left.file and right.file) and max(len(left.clips), len(right.clips)) > 1


def _taken(left: _Side, right: _Side, names: tuple[str, ...], where: str) -> tuple[str, ...]:
    """The names of the clips that ``where`` takes, none where each side is one clip."""
    side = left if left.file is not None else right
    if side.file is None:
        raise Failure("--where chooses among the clips of an .mcz", Exit.USAGE)
    clips = side.file.chosen(names or None, where)
    if names:
        return tuple(name for name in names if side.file[name] in clips)
    if left.file is not None and right.file is not None:
        return _common(left, right, [clip.name for clip in clips]) if _by_name(left, right) else ()
    return tuple(clip.name for clip in clips)


def _common(left: _Side, right: _Side, names: Sequence[str]) -> tuple[str, ...]:
    """The ``names`` of clips that both sides have; raises Failure if there are none."""
    held = set(left.clips) & set(right.clips)
    both = tuple(name for name in names if name in held)
    if not both:
        raise Failure(f"{left.path} and {right.path} have no clip in common", Exit.USAGE)
    return both


def _pairs(
    left: _Side, right: _Side, names: tuple[str, ...]
) -> Iterator[tuple[str | None, str | None]]:
    """The clips to compare, by name on each side; None is the only one."""
    if names:
        for name in names:
            yield name, name
    elif _by_name(left, right):
        for name in _common(left, right, left.clips):
            yield name, name
    else:
        yield None, None


def _compared(
    left: _Side, right: _Side, a: str | None, b: str | None, wanted: _Wanted
) -> JsonObject:
    """The document of one pair of motions."""
    from mcz.files.reading.differences import document_of
    from mcz.kinematics.metrics.diff_document import diff_document

    one, other = left.load(a), right.load(b)
    if one.motion.n_frames != other.motion.n_frames:
        raise Failure(
            f"{left.path} has {one.motion.n_frames} frames, {right.path} "
            f"{other.motion.n_frames}; --frames A:B chooses what both have"
        )
    with about(f"{left.path}, {right.path}"):
        document = diff_document(
            one.motion,
            other.motion,
            start=one.start,
            shell_cm=wanted.shell_cm,
            contacts=wanted.feet or wanted.contacts or None,
            by_joint=wanted.by_joint,
            contact_list=wanted.contacts,
        )
        found = document_of(one.motion, other.motion)
    return document | {"differences": found, "ratios_a": one.ratios, "ratios_b": other.ratios}
