"""Export of clips to other formats: a file a clip, or a data set of Motion-BIDS.

Source of the latter: BIDS 1.10, "Motion". ``mcz.sources.tables.motion_bids`` reads what is written
here.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import numpy as np

from mcz.errors import FormatError, MczError, MotionError, OptionError
from mcz.exchange.conversion import TARGETS, conversion_losses, converted_files
from mcz.exchange.conversion.scenes import WRITERS, to_scene
from mcz.files.editing import Outcome, Report, failure_outcome
from mcz.files.editing.folders import Folder, PortableNames
from mcz.files.editing.unpacking import safe_path
from mcz.files.jobs import limit_jobs, share_clips
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Where
from mcz.files.reading.file import File, open, suffixes_of
from mcz.files.reading.source_files import SourceOptions
from mcz.files.tables import EXPORTS, table_of
from mcz.hints import Hint
from mcz.model.checks import PATH, STRING, check_arguments
from mcz.model.motion import Joint, Motion
from mcz.model.text_format import printable, quote_name
from mcz.model.types import JsonObject, Target
from mcz.sources.tables.layout import UNIT_CM
from mcz.sources.tables.motion_bids import ABOUT, CHANNELS, MOTION_SUFFIX
from mcz.version import VERSION

BIDS_VERSION = "1.10.0"
NOT_APPLICABLE, MISSING = "n/a", "NaN"
COLUMNS = ("name", "component", "type", "tracked_point", "units")
UNKNOWN = "unknown"  # the label of a subject that no metadata name
TYPES = {"tx": "POS", "ty": "POS", "tz": "POS", "rx": "JNTANG", "ry": "JNTANG", "rz": "JNTANG"}
QUATERNION = {f"q{part}": f"quat_{part}" for part in "xyzw"}
BY_UNIT = {"rad": "JNTANG", "deg": "JNTANG", "m/s": "VEL", "m/s^2": "ACCEL", "s": "LATENCY"}
KINDS = "ACCEL ANGACCEL GYRO JNTANG LATENCY MAGN MISC ORNT POS VEL".split()
_LABEL = "[0-9A-Za-z+]+"
_NAME = re.compile(
    rf"sub-({_LABEL})(_ses-({_LABEL}))?_task-({_LABEL})_tracksys-{_LABEL}"
    rf"(_acq-{_LABEL})?(_run-[0-9]+)?_motion"
)
README = """\
Motion exported by mcz {version}.

Each clip is a table below sub-*/motion; its _channels.tsv names the columns, its _motion.json has
the frame rate. A value that is missing is NaN.
"""


class BidsRecording(NamedTuple):
    """The place of a clip in a data set: ``stem`` has all entities."""

    subject: str
    session: str
    task: str
    stem: str

    def path(self, suffix: str) -> str:
        session = [f"ses-{self.session}"] if self.session else []
        return "/".join([f"sub-{self.subject}", *session, "motion", self.stem + suffix])


class _Column(NamedTuple):
    """A row of ``_channels.tsv``."""

    name: str
    component: str
    type: str
    point: str
    units: str


def recording_of(motion: Motion) -> BidsRecording:
    """The place of a clip: that of its name if BIDS made it, else one of subject and name."""
    match = _NAME.fullmatch(PurePosixPath(motion.name).name)
    if match is not None:
        subject, session, task = match[1], match[3] or "", match[4]
        return BidsRecording(subject, session, task, match[0].removesuffix("_motion"))
    subject = _label(motion.metadata.get("subject", "")) or UNKNOWN
    task = _label(motion.name) or UNKNOWN
    is_inertial = motion.source is not None and motion.source.format == "mvnx"
    system = "imu" if is_inertial else "omc"  # optical
    return BidsRecording(subject, "", task, f"sub-{subject}_task-{task}_tracksys-{system}")


def clip_files(motion: Motion) -> dict[str, bytes]:
    """The files of a clip by their paths: the table, its channels, its rate.

    Raises MotionError for a clip without a frame rate, which BIDS requires.
    """
    if motion.frame_rate is None:
        raise MotionError("BIDS requires a frame rate", clip=motion.name, hint=Hint.RATE)
    recording = recording_of(motion)
    table = table_of(motion)
    values = np.where(table.mask, table.values, np.nan)
    columns = _columns(motion)
    timeline = motion.timeline
    if timeline is not None and table.times is not None and len(timeline.runs) > 1:
        values = np.hstack([values, table.times[:, None] - table.times[:1]])
        columns.append(_Column("latency", NOT_APPLICABLE, "LATENCY", NOT_APPLICABLE, "s"))
    rate = float(motion.frame_rate) * table.samples_per_frame
    about = {
        "SamplingFrequency": int(rate) if rate.is_integer() else rate,
        "TaskName": recording.task,
        "MotionChannelCount": len(columns),
        "TrackedPointsCount": len({c.point for c in columns} - {NOT_APPLICABLE}),
        "MissingValues": MISSING,
        "SoftwareVersions": f"mcz {VERSION}",
    } | {f"{kind}ChannelCount": sum(c.type == kind for c in columns) for kind in KINDS}
    return {
        recording.path(MOTION_SUFFIX): _tsv([map(_number, row) for row in values.tolist()]),
        recording.path(CHANNELS): _tsv([COLUMNS, *columns]),
        recording.path(ABOUT): _json(about),
    }


def data_set_files(name: str, paths: Iterable[str]) -> dict[str, bytes]:
    """The files at the root of a data set that has files of clips at ``paths``."""
    rows = [(subject,) for subject in sorted({path.partition("/")[0] for path in paths})]
    description = {
        "Name": name,
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        "GeneratedBy": [{"Name": "mcz", "Version": VERSION}],
    }
    return {
        "dataset_description.json": _json(description),
        "participants.tsv": _tsv([("participant_id",), *rows]),
        "README": README.format(version=VERSION).encode(),
    }


def _columns(motion: Motion) -> list[_Column]:
    signal, skeleton = motion.signals[0], motion.skeleton
    if signal.channels is not None or not skeleton.n_channels:
        raise MotionError("the motion has neither joints nor points", clip=motion.name)
    length = next((u for u, cm in UNIT_CM.items() if cm == skeleton.unit_cm), NOT_APPLICABLE)
    angle = skeleton.angle_unit or NOT_APPLICABLE
    points = map(_word, skeleton.addresses())
    return [
        _Column(*column)
        for point, joint in zip(points, skeleton.joints, strict=True)
        for column in _columns_of(point, joint, length, angle)
    ]


def _columns_of(
    point: str, joint: Joint, length: str, angle: str
) -> Iterable[tuple[str, str, str, str, str]]:
    """The columns of a joint; plain scalars are not points."""
    for channel in joint.channels:
        label, unit = _word(channel.label), _word(channel.unit) or NOT_APPLICABLE
        name = point if len(joint.channels) == 1 else f"{point}_{label}"
        kind = TYPES.get(channel.kind)
        if kind is not None:
            units = length if kind == "POS" else angle
            yield f"{point}_{label}", channel.kind[1], kind, point, units
        elif channel.kind in QUATERNION:
            yield f"{point}_{label}", QUATERNION[channel.kind], "ORNT", point, NOT_APPLICABLE
        else:
            yield name, NOT_APPLICABLE, BY_UNIT.get(unit, "MISC"), NOT_APPLICABLE, unit


def _word(text: str) -> str:
    """A text in a cell, without quotes, which BIDS does not have."""
    return printable(text).replace('"', "'")


def _label(text: str) -> str:
    """The letters and digits of a text, at most 64: a file name holds three such labels."""
    return "".join(re.findall(_LABEL, text))[:64]


def _number(value: float) -> str:
    """The shortest text that is read as this number."""
    return MISSING if value != value else repr(int(value) if _is_whole(value) else value)


def _is_whole(value: float) -> bool:
    return value.is_integer() and abs(value) < 2**53 and (value != 0 or str(value)[0] != "-")


def _tsv(rows: Iterable[Iterable[str]]) -> bytes:
    return "".join("\t".join(row) + "\n" for row in rows).encode()


def _json(content: object) -> bytes:
    return (json.dumps(content, indent=2, ensure_ascii=False) + "\n").encode()


Progress = Callable[[int, int, str], None]
BIDS = "bids"
FORMS = (*EXPORTS, *TARGETS, *WRITERS, BIDS)


@check_arguments(directory=PATH, to=STRING)
def export(
    target: Target,
    directory: str | os.PathLike[str],
    to: str,
    *,
    clips: Sequence[str] | None = None,
    where: Where | None = None,
    rate: Fraction | float | None = None,
    unit: str | None = None,
    key_error_mm: float | None = None,
    force: bool = False,
    max_decoded: int | None = None,
    threads: int | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """Write every clip of an MCZ file below ``directory`` as another format.

    ``to`` is "npz", "csv", "glb", "usda", "bids" or a format of ``mcz.convert``. A clip "day1/walk"
    becomes "day1/walk.npz"; an AMC comes with its ASF; "bids" makes a data set of Motion-BIDS.
    ``clips`` and ``where`` select clips, as in ``unpack``. ``rate`` and ``unit`` apply to clips
    that state none; ``key_error_mm`` is as in ``to_glb``. A clip that the format cannot hold, or
    whose file exists and not ``force``, is reported as failed and the others are written. Files
    appear when they are complete; no link below ``directory`` is followed. ``jobs`` processes work
    in parallel, by default one. Raises OptionError and as ``mcz.open``.
    """
    if to not in FORMS:
        raise OptionError(f"unknown format {to!r}; the formats are {', '.join(FORMS)}")
    folder, report, written = Folder(Path(directory)), Report(), set[str]()
    portable = PortableNames()

    def write(name: str, files: Callable[[], Iterable[Exported]]) -> None:
        """Write files, or report ``name`` as failed."""
        try:
            for own, data, notes in files():
                path = portable(str(safe_path(own)))
                if path in written:
                    raise FormatError(f"another clip is also written to {path}")
                folder.write(path, data, target, force=force)
                written.add(path)
                report.outcomes.append(Outcome(path, "written", len(data), notes=notes))
        except (MczError, OSError) as error:
            report.outcomes.append(failure_outcome(name, error))

    options: JsonObject = {"max_decoded": max_decoded, "threads": threads, "verify": True}
    with limit_jobs(jobs), open(target, **options) as file:
        chosen = file.select_clips(clips, where)
        called = [clip.name for clip in chosen]
        with share_clips(_export_clip, file, called, (to, rate, unit, key_error_mm)) as converting:
            for done, (name, converted) in enumerate(zip(called, converting, strict=True)):
                run = partial(_as_run, name, converted, written)
                write(name, run if to == BIDS else converted)
                if progress is not None:
                    progress(done + 1, len(called), name)
        if to == BIDS and written:
            root = data_set_files(Path(directory).name, sorted(written))
            write("dataset_description.json", lambda: [(path, d, ()) for path, d in root.items()])
    return report


Exported = tuple[str, bytes, tuple[str, ...]]  # name of the file, its content, remarks


def _export_clip(
    shared: tuple[File, tuple[str, Fraction | float | None, str | None, float | None]], name: str
) -> list[Exported]:
    """The files that the clip ``name`` becomes."""
    file, (to, rate, unit, key_error) = shared
    clip = file.clips[name]
    motion = SourceOptions(rate=rate, unit=unit).complete(clip.motion())
    return list(_files(clip, to, motion, key_error))


def _as_run(
    clip: str, converted: Callable[[], Iterable[Exported]], written: set[str]
) -> list[Exported]:
    """The BIDS files of a clip: run 2 and so on if another clip has written files of its names."""
    files, run = list(converted()), 1
    if any("_run-" in path for path, _, _ in files):
        return files
    parts = [path.rpartition("_") for path, _, _ in files]
    names = [path for path, _, _ in files]
    while written.intersection(names):
        run += 1
        names = [f"{stem}_run-{run}_{suffix}" for stem, _, suffix in parts]
    added = () if run == 1 else (f"the clip {quote_name(clip)}: another has the name without run",)
    return [
        (name, data, notes + added if name.endswith(MOTION_SUFFIX) else notes)
        for name, (_, data, notes) in zip(names, files, strict=True)
    ]


def _files(clip: Clip, to: str, motion: Motion, key_error: float | None) -> Iterator[Exported]:
    """The files that a clip becomes: an ASF before the AMC that needs it."""
    if to in EXPORTS:
        yield _file_name(clip, to), EXPORTS[to](table_of(motion)), conversion_losses(motion, to)
        return
    if to in WRITERS:
        scene = to_scene(motion, to, key_error_mm=key_error)
        yield _file_name(clip, to), scene.data, scene.notes
        return
    if to == BIDS:
        for path, data in clip_files(motion).items():
            yield path, data, conversion_losses(motion, to) if path.endswith(MOTION_SUFFIX) else ()
        return
    files = converted_files(motion, to, None, True)
    for suffix in sorted(files, reverse=True):
        notes = conversion_losses(motion, to) if suffix == to else ()
        yield _file_name(clip, suffix), files[suffix], notes


def _file_name(clip: Clip, to: str) -> str:
    """The clip's name with the suffix of the format ``to``, unless it has one."""
    suffixes = suffixes_of(to)
    own = PurePosixPath(clip.name).suffix.lower()
    return clip.name if own in suffixes else f"{clip.name}{suffixes[0]}"
