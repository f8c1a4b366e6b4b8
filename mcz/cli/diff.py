"""``mcz diff``: how far one motion is from another, in channels, units and centimeters."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import PurePath
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
    plural,
    print_json,
    to_frames,
)
from mcz.cli.figures import figure_lines
from mcz.cli.options import UNITS, decoded_option, json_option
from mcz.errors import MczError

if TYPE_CHECKING:
    from mcz.metrics import Comparison
    from mcz.motion import Motion
    from mcz.reading.file import File

FEW = 12  # names of joints that are shown
RATIOS = ("cr_source", "cr_float32", "cr_40B")
Cut = tuple[int, int | None] | None


@click.command(short_help="How far one motion is from another.", epilog=EXIT_CODES)
@click.argument("a", metavar="A", type=click.Path(readable=False))
@click.argument("b", metavar="B", type=click.Path(readable=False))
@click.option(
    "--clip",
    "names",
    metavar="NAME",
    multiple=True,
    help="Which clip of an .mcz; may be repeated. Default: the only one, or all that both have.",
)
@click.option(
    "--frames", metavar="A:B", callback=to_frames, help="Frames A <= f < B of both, from 0."
)
@click.option("--unit", type=click.Choice(UNITS), help="Length unit of a file that says none.")
@click.option(
    "--skeleton",
    metavar="FILE.asf",
    type=click.Path(readable=False),
    help="The ASF of an AMC, or none.",
)
@decoded_option
@json_option
def command(
    a: str,
    b: str,
    names: tuple[str, ...],
    frames: Cut,
    unit: str | None,
    skeleton: str | None,
    max_decoded: int | None,
    as_json: bool,
) -> Exit:
    """Compare B with A, the original: any two of .amc, .bvh, .c3d and .mcz.

    Errors of channels and of positions in length units and cm, SPEC.md's "Metrics"; compression
    ratios of an .mcz. The exit code is 0 whenever the two could be compared, however much they
    differ.
    """
    if (a, b) == ("-", "-"):
        raise Failure("only one of A and B can be standard input", Exit.USAGE)
    with ExitStack() as stack:
        left, right = (_Side(path, stack, unit, skeleton, max_decoded) for path in (a, b))
        pairs = list(_pairs(left, right, names))
        documents = [_compared(left, right, *pair, frames) for pair in pairs]
    only = {
        f"only_in_{key}": sorted(set(own.clips) - set(other.clips))
        for key, own, other in (("a", left, right), ("b", right, left))
        if _by_name(left, right) and not names
    }
    if as_json:
        print_json({"a": a, "b": b, "clips": documents, **only})
        return Exit.FINE
    for number, document in enumerate(documents):
        for line in ([""] if number else []) + list(_lines(a, b, document)):
            echo(line)
    for key, found in only.items():
        for name in found:
            echo(f"only in {a if key == 'only_in_a' else b}: {name}")
    return Exit.FINE


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
        unit: str | None,
        skeleton: str | None,
        max_decoded: int | None,
    ) -> None:
        self.path, self._unit, self._skeleton = path, unit, skeleton
        self.file: File | None = None
        if path == "-" or PurePath(path).suffix.lower() == ".mcz":
            self.file = stack.enter_context(opened(path, max_decoded=max_decoded))
        else:
            existing(path)

    @property
    def clips(self) -> list[str]:
        return [] if self.file is None else list(self.file.clips)

    def load(self, name: str | None, frames: Cut) -> _Loaded:
        """The motion called ``name``, or the only one, cut to ``frames``."""
        import mcz
        from mcz.reading.report import clip_ratios
        from mcz.reading.source_files import with_facts

        with about(self.path):
            if self.file is None:
                is_amc = PurePath(self.path).suffix.lower() == ".amc"
                motion = mcz.read(self.path, skeleton=self._skeleton if is_amc else None)
                start, stop = _range(frames, motion.n_frames, self.path)
                signals = tuple(signal.cut(start, stop) for signal in motion.signals)
                motion = replace(motion, signals=signals, source=None, frame_numbers=None)
                ratios = None
            else:
                clip = self.file.only_clip(name)
                start, stop = _range(frames, clip.n_frames, f"clip {clip.name!r}")
                motion = clip.motion((start, stop))
                found = clip_ratios(self.file, clip)
                ratios = {key: found[key] for key in RATIOS}
            if motion.skeleton.unit_cm is None:
                motion = with_facts(motion, None, self._unit)
        return _Loaded(motion, start, ratios)


def _range(frames: Cut, n_frames: int, what: str) -> tuple[int, int]:
    start, stop = frames or (0, None)
    stop = n_frames if stop is None else stop
    if not start <= stop <= n_frames:
        raise Failure(f"{what} has frames 0 to {n_frames}, not {start}:{stop}", Exit.USAGE)
    return start, stop


def _by_name(left: _Side, right: _Side) -> bool:
    """Whether the clips of the same names are compared: two .mcz, not both of one clip."""
    return bool(left.file and right.file) and max(len(left.clips), len(right.clips)) > 1


def _pairs(
    left: _Side, right: _Side, names: tuple[str, ...]
) -> Iterator[tuple[str | None, str | None]]:
    """The clips to compare, by name on each side; None is the only one."""
    if names:
        for name in names:
            yield name, name
    elif _by_name(left, right):
        both = [name for name in left.clips if name in set(right.clips)]
        if not both:
            raise Failure(f"{left.path} and {right.path} have no clip in common", Exit.USAGE)
        for name in both:
            yield name, name
    else:
        yield None, None


def _compared(
    left: _Side, right: _Side, a: str | None, b: str | None, frames: Cut
) -> dict[str, Any]:
    """The document of one pair of motions."""
    import mcz

    one, other = left.load(a, frames), right.load(b, frames)
    if one.motion.n_frames != other.motion.n_frames:
        raise Failure(
            f"{left.path} has {one.motion.n_frames} frames, {right.path} "
            f"{other.motion.n_frames}; --frames A:B chooses what both have"
        )
    with about(f"{left.path}, {right.path}"):
        found = mcz.compare(one.motion, other.motion)
    entries = found.entries()
    if found.where is not None:
        entries["max_position_error_frame"] = found.where[0] + one.start
    document: dict[str, Any] = {"name_a": one.motion.name, "name_b": other.motion.name, **entries}
    document["joints"] = _by_joints(one.motion, other.motion, found, one.start)
    document |= {"notes": list(found.notes), "ratios_a": one.ratios, "ratios_b": other.ratios}
    return document


def _by_joints(a: Motion, b: Motion, found: Comparison, start: int) -> dict[str, Any] | None:
    """The distances of joints of the same names, of skeletons whose points are not alike."""
    from mcz.joint_errors import joint_errors
    from mcz.kinematics import point_set

    if found.points is not None and point_set(a.skeleton) == point_set(b.skeleton):
        return None
    try:
        errors = joint_errors(a, b)
    except MczError:  # no kinematics, as the notes say
        return None
    document = errors.document()
    if errors.frame is not None:
        document["frame"] = errors.frame + start
    return document


def _joint_lines(a: str, b: str, found: dict[str, Any]) -> Iterator[str]:
    n_joints = len(found["joints"])
    if not n_joints:
        yield "no joint has the same name in both"
        return
    suffix, unit = ("", "units") if found["unit_cm"] is None else ("_cm", "cm")
    if found["mean"] is not None:
        mean, most = found[f"mean{suffix}"], found[f"greatest{suffix}"]
        yield (
            f"{plural(n_joints, 'joint')} of the same name: mean {mean:.6g} {unit} apart, "
            f"at most {most:.6g} {unit} (frame {found['frame']}, {found['joint']})"
        )
    for path, names in ((a, found["only_in_a"]), (b, found["only_in_b"])):
        if names:
            more = f" and {len(names) - FEW} more" if len(names) > FEW else ""
            yield f"joints of {path} alone: {', '.join(names[:FEW])}{more}"


def _lines(a: str, b: str, document: dict[str, Any]) -> Iterator[str]:
    """The text that people read, without line ends."""
    entries = dict(document)
    names = entries.pop("name_a"), entries.pop("name_b")
    notes, ratios = entries.pop("notes"), [entries.pop("ratios_a"), entries.pop("ratios_b")]
    yield f"{a} ({names[0]}) and {b} ({names[1]})"
    joints = entries.pop("joints")
    yield from (f"  {line}" for line in figure_lines(entries))
    if joints is not None:
        yield from (f"  {line}" for line in _joint_lines(a, b, joints))
    for path, found in zip((a, b), ratios, strict=True):
        known = {key: value for key, value in (found or {}).items() if value is not None}
        if known:
            shown = ", ".join(f"{key} {value:.4g}" for key, value in known.items())
            yield f"  {path}: {shown}"
    yield from (f"  note: {note}" for note in notes)
