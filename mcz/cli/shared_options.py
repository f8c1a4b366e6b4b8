"""Options that several commands share, declared once."""

from __future__ import annotations

import re
from collections.abc import Callable
from fractions import Fraction
from functools import wraps
from typing import Any

import click

from mcz.cli.common import Exit, Failure, require_file
from mcz.cli.outputs import resolve_output
from mcz.cli.terminal import echo
from mcz.model.types import JsonObject, Settings

EFFORTS = ("fast", "best")  # as in mcz.codecs, which takes longer to import
SKELETON_HELP = "Use this ASF for an AMC; none: read it without one."
RATE_HELP = "Set the frame rate of files that state none (120, 29.97, 30000/1001)."
ITS_RATE_HELP = "Set the frame rate (120, 29.97, 30000/1001), replacing the one in the source."
PRESETS = {"mm": 0.1, "visible": 0.5, "preview": 3.0}  # cm, as for the codec posewave
Function = Callable[..., object]


def combine(*options: Callable[[Function], Function]) -> Callable[[Function], Function]:
    """A decorator that adds several options, in the order of the help."""

    def add_all(function: Function) -> Function:
        for option in reversed(options):
            function = option(function)
        return function

    return add_all


def to_frames(
    ctx: click.Context, param: click.Parameter, value: str | None
) -> tuple[int, int | None] | None:
    """Parse ``A:B``: frames A <= f < B counted from 0; either end may be left out."""
    if value is None:
        return None
    start, colon, stop = value.partition(":")
    digits = all(re.fullmatch("[0-9]{1,16}", part) for part in (start, stop) if part)
    if not colon or not digits or (start and stop and int(start) > int(stop)):
        raise click.BadParameter(f"{value!r} is not a range A:B of frames with A <= B")
    return int(start or 0), int(stop) if stop else None


def to_rate(ctx: click.Context, param: click.Parameter, value: str | None) -> Fraction | None:
    """Parse a rate: frames a second as ``120``, ``29.97`` or ``30000/1001``."""
    if value is None:
        return None
    rate = Fraction(0)
    if re.fullmatch(r"[0-9]{1,15}(\.[0-9]{1,15}|/0*[1-9][0-9]{0,14})?", value):
        rate = Fraction(value)
    if rate <= 0:
        raise click.BadParameter(f"{value!r} is not a rate such as 120, 29.97 or 30000/1001")
    return rate


def to_params(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> JsonObject:
    """Parse ``KEY=VALUE``; numbers and truths are converted."""
    pairs = {}
    for value in values:
        key, equals, text = value.partition("=")
        if not equals or not key:
            raise click.BadParameter(f"{value!r} is not KEY=VALUE")
        pairs[key] = literal(text)
    return pairs


def literal(text: str) -> Any:
    """
    >>> literal("3"), literal("4.4"), literal("true"), literal("bior4.4")
    (3, 4.4, True, 'bior4.4')
    """
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(text, text)


def to_bytes(ctx: click.Context, param: click.Parameter, value: str | None) -> int | None:
    """Callback of a number of bytes: ``200000000``, ``200M`` or ``2G``; K, M, G, T are binary."""
    if value is None:
        return None
    match = re.fullmatch(r"([0-9]{1,15})([KMGT]?)(?:i?B)?", value, re.IGNORECASE)
    if not match:
        raise click.BadParameter(f"{value!r} is not a number of bytes such as 200M or 2G")
    factor: int = 1024 ** " KMGT".index(match[2].upper() or " ")
    return int(match[1]) * factor


def _print_version(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    if value:
        from mcz import __version__

        echo(f"mcz {__version__}")
        ctx.exit()


version = click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_version,
    help="Print the version and exit.",
)

json = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")

force = click.option("--force", is_flag=True, help="Overwrite existing files.")


def output(function: Function) -> Function:
    """``-o``; by default the command replaces its input file."""

    @wraps(function)
    def command(*, file: str, output: str | None, **options: object) -> object:
        require_file(file)
        return function(file=file, output=output and resolve_output(output, file), **options)

    return click.option(
        "-o",
        "--output",
        metavar="OUT.mcz",
        help="Write OUT.mcz and keep FILE.mcz. Default: replace FILE.mcz once the new file is "
        "complete.",
    )(command)


salvage = click.option(
    "--salvage", is_flag=True, help="Read the intact parts of a damaged file; report the rest."
)

max_decoded = click.option(
    "--max-decoded",
    metavar="BYTES",
    callback=to_bytes,
    help="Limit the decoded bytes of one file (200M, 2G). Default: 64 MiB or 4096 times its size, "
    "whichever is more.",
)


def threads(function: Function) -> Function:
    """``--threads``, the argument ``threads`` of ``mcz.open`` and ``mcz.write``."""

    @wraps(function)
    def command(*args: object, threads: int | None, **options: object) -> object:
        if threads is None:
            return function(*args, **options)
        from mcz.model.threads import limit_threads

        with limit_threads(threads):
            return function(*args, **options)

    return click.option(
        "--threads",
        metavar="N",
        type=click.IntRange(1),
        help="Use N threads. Default: one per processor.",
    )(command)


def jobs(function: Function) -> Function:
    """``--jobs``, the argument ``jobs`` of ``mcz.pack`` and others, by default all cores."""

    @wraps(function)
    def command(*args: object, jobs: int | None, **options: object) -> object:
        from mcz.files.jobs import limit_jobs
        from mcz.model import threads

        with limit_jobs(jobs or threads.processors()):
            return function(*args, **options)

    return click.option(
        "--jobs",
        metavar="N",
        type=click.IntRange(1),
        help="Use up to N processes. Default: one per processor.",
    )(command)


def copies(default: str) -> Callable[[Function], Function]:
    """``--copies``, the argument ``copies`` of ``mcz.encode`` and others, None: ``default``."""
    return click.option(
        "--copies/--no-copies",
        default=None,
        help="Store skeletons, templates and similar parts twice, so that a flipped bit in them "
        f"costs no clip. Default: {default}.",
    )


clips = click.option(
    "--clip",
    "clips",
    metavar="NAME",
    multiple=True,
    help="Choose a clip (repeatable). Default: all.",
)


def _to_query(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Check a query before a file is opened; raises OptionError."""
    if value is not None:
        from mcz.files.queries import Query

        Query(value)
    return value


where = click.option(
    "--where",
    metavar="QUERY",
    callback=_to_query,
    help="Select the clips that match a query, such as \"subject == '05' and n_frames > 500\"; "
    "see docs/reference/queries.md.",
)


def token(what: str) -> Callable[[Function], Function]:
    """``--token``, the argument ``token``; ``what`` begins its help."""
    hint = "Use MCZ_TOKEN to keep it out of the process list. It is not encryption."
    return click.option("--token", metavar="TEXT", envvar="MCZ_TOKEN", help=f"{what} {hint}")


params = click.option(
    "--param",
    "params",
    metavar="KEY=VALUE",
    multiple=True,
    callback=to_params,
    help="Set a codec parameter (repeatable).",
)


def _to_unit(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Parse a length unit: ``cm``, or a number of centimeters, ``5.6444cm``."""
    from mcz.errors import OptionError
    from mcz.model.units import unit_cm_of

    if value is not None:
        try:
            unit_cm_of(value)
        except OptionError as error:
            raise click.BadParameter(str(error)) from None
    return value


def unit(what: str) -> Callable[[Function], Function]:
    """``--unit``, the argument ``unit``, the length unit of ``what``."""
    return click.option(
        "--unit",
        metavar="UNIT",
        callback=_to_unit,
        help=f"Set the length unit of {what}: mm, cm, dm, m, in, ft, or a length (5.6444cm).",
    )


def up(what: str) -> Callable[[Function], Function]:
    """``--up``, the argument ``up``; ``what`` is its help."""
    return click.option("--up", type=click.Choice(("x", "y", "z", "-x", "-y", "-z")), help=what)


ARRAYS = ("positions", "rotation-vectors", "quaternions-wxyz", "quaternions-xyzw")
ROBOTS = ("unitree-g1-29", "unitree-g1-23", "unitree-h1", "unitree-h1-2", "booster-t1")

arrays = click.option(
    "--arrays",
    type=click.Choice((*ARRAYS, *ROBOTS)),
    help="Set the meaning of the numbers of a plain array, or name a robot's columns.",
)

model = click.option(
    "--model",
    metavar="NPZ",
    help="Read the bone lengths of bodies in an .npz from your model file of the SMPL family. "
    "{gender} is replaced by the gender of the take, {body} by smpl, smplh or smplx.",
)

key_error = click.option(
    "--key-error",
    metavar="MM",
    type=click.FloatRange(min=0),
    help="Drop animation keys while the error stays within MM (with --to glb); 0 keeps all. "
    "Default: 0.1, or 1/20,000 of the figure if its unit is unknown.",
)


def skeleton(help_text: str) -> Callable[[Function], Function]:
    """``--skeleton``, the argument ``skeleton``: the path of an ASF."""
    path = click.Path(readable=False)
    return click.option("--skeleton", metavar="FILE.asf", type=path, help=help_text)


def frames(help_text: str) -> Callable[[Function], Function]:
    """``--frames``, the argument ``frames``: a range."""
    return click.option("--frames", metavar="A:B", callback=to_frames, help=help_text)


def rate(help_text: str = RATE_HELP) -> Callable[[Function], Function]:
    """``--rate``, the argument ``rate``, by default of files that state none."""
    return click.option("--rate", metavar="R", callback=to_rate, help=help_text)


force_rate = click.option(
    "--force-rate", is_flag=True, help="Use --rate even for files that state another."
)


def _to_quality(ctx: click.Context, param: click.Parameter, value: str | None) -> float | None:
    """Callback of the greatest error, a length or a word of ``PRESETS``, in centimeters."""
    from mcz.errors import OptionError
    from mcz.model.units import unit_cm_of

    if value is None or value in PRESETS:
        return None if value is None else PRESETS[value]
    try:
        if value[:1] in "0123456789.":
            return unit_cm_of(value)
    except OptionError:
        pass
    text = f"{value!r} is not one of {', '.join(PRESETS)}, nor a length such as 0.5mm"
    raise click.BadParameter(text)


def check_force_rate(options: Settings) -> None:
    """Raise Failure for ``--force-rate`` without ``--rate``."""
    if options["force_rate"] and options["rate"] is None:
        raise Failure("--force-rate needs --rate", Exit.USAGE)


def encoding(function: Function) -> Function:
    """``--codec --effort --param --unit --up ...``, the arguments of those names."""
    options = (
        click.option(
            "--codec", metavar="NAME", help="Set the codec. Default: fast, which is lossless."
        ),
        click.option(
            "--effort",
            type=click.Choice(EFFORTS),
            help="Choose the lossless codec: fast (fastest to read) or best (smallest).",
        ),
        click.option(
            "--quality",
            metavar="Q",
            callback=_to_quality,
            help="Encode lossy and limit the error of every point: a length (0.5mm), mm (1 mm), "
            "visible (5 mm) or preview (3 cm). Default codec: lossy.",
        ),
        params,
        unit("the source"),
        up("Set the axis that points up. BVH and AMC state none."),
        arrays,
        model,
        click.option(
            "--verbatim", is_flag=True, help="Keep files that cannot be parsed as attachments."
        ),
        click.option(
            "--profile",
            type=click.Choice(("small", "base", "large")),
            default="base",
            help="Set the limits of the file; small is for embedded readers. Default: base.",
        ),
    )

    @wraps(function)
    def command(
        *args: object, codec: str | None, quality: float | None, params: Settings, **others: object
    ) -> object:
        if quality is not None:
            if "max_error_cm" in params or "preset" in params:
                raise click.UsageError(
                    "--quality and --param both limit the error; give one of them"
                )
            codec, params = codec or "lossy", params | {"max_error_cm": quality}
        return function(*args, codec=codec, params=params, **others)

    return combine(*options)(command)
