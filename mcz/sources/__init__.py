"""Source formats: bytes -> Motion or Skeleton, and back, byte for byte.

``FORMATS`` is the explicit table; SPEC.md, "Registry", has the ids. ``text`` has ASF, AMC and BVH,
``tables`` TRC, STO, MOT and CSV, ``c3d`` C3D, ``arrays`` NPY, NPZ and pickles; ``sample`` makes
small files of every format.

Imports ``mcz.model`` and ``mcz.kinematics``: MCZ files are unknown here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from importlib import import_module
from pathlib import Path
from typing import Any

from mcz.errors import FormatError, SourceError, UnsupportedError
from mcz.hints import Hint
from mcz.model.motion import FrameNotes, Source
from mcz.model.text_format import compression_remark
from mcz.model.types import JsonObject
from mcz.sources.text.source import Arriving

__all__ = [
    "FORMATS",
    "Format",
    "arrays_of",
    "format_by_id",
    "format_of",
    "is_table",
    "likely_formats",
    "recording_of",
    "wants_skeleton",
    "with_analog_scales",
]

HEAD_BYTES = 2**20
BLENDER_SUFFIXES = (".fbx", ".dae", ".blend", ".glb", ".gltf", ".usd", ".usda", ".usdc")
_ASF_SECTION = re.compile(rb"(?m)^[ \t]*:(bonedata|hierarchy)\b")


@dataclass(frozen=True, slots=True)
class Format:
    """A source format.

    ``read(data, name)`` gives a Motion, a Skeleton if ``is_skeleton``, and takes the Skeleton or
    None as a third argument if ``wants_skeleton``; it raises SourceError. ``write`` is its
    inverse; it raises MotionError or FormatError. ``join_notes`` is the inverse of the notes' cut.
    ``arrive(lines, skeleton)`` reads what comes line by line, None if the format cannot.
    ``bones(data, whole=False)``: of a format that wants a skeleton, how many values each bone of
    the first frame, or of all, has. ``has_more_joints(data, most)`` says after a quick look whether
    a file surely has more, None if nobody can. ``states_rate``: the template holds the frame
    rate, so that it does not suit another; ``restate(template, rate)`` gives that rate and a
    template that states another one, see ``stated_rates``. ``is_table``: its header names every
    column, which is much of what is written. ``recording(name, template, detail)`` is what the
    source says beside all numbers, None if it says nothing; see ``mcz.Recording``.
    ``arrays(source, signals)`` lists what became of the arrays of a file that has some.
    ``is_motion(data)`` says of a suffix that others use, too, whether a file that begins so seems
    to be of this format.
    """

    name: str
    id: int
    suffixes: tuple[str, ...]
    read: Callable[..., Any]
    write: Callable[[Any], bytes]
    join_notes: Callable[[Sequence[tuple[int, int, bytes]]], FrameNotes] | None = None
    is_skeleton: bool = False
    wants_skeleton: bool = False
    states_rate: bool = False
    is_table: bool = False
    arrive: Callable[..., Arriving] | None = None
    recording: Callable[[str, bytes, bytes], Any] | None = None
    has_more_joints: Callable[..., bool] | None = None
    bones: Callable[..., dict[str, int]] | None = None
    arrays: Callable[..., list[JsonObject]] | None = None
    restate: Callable[[bytes, Fraction], Any] | None = None
    is_motion: Callable[[bytes], bool] | None = None

    @property
    def suffix(self) -> str:
        """The usual suffix of its files."""
        return self.suffixes[0]


def _of(module: str, name: str, **fixed: object) -> Callable[..., Any]:
    """The function of a format's module, which is imported when it is called."""

    def call(*arguments: object, **options: object) -> Any:
        function = getattr(import_module(f"{__name__}.{module}"), name)
        return function(*arguments, **fixed, **options)

    return call


FORMATS: dict[str, Format] = {
    f.name: f
    for f in (
        Format(
            "asf", 1, (".asf",), _of("text.asf", "read"), _of("text.asf", "write"), is_skeleton=True
        ),
        Format(
            "amc",
            2,
            (".amc",),
            _of("text.amc", "read"),
            _of("text.amc", "write"),
            _of("text.layout", "join_notes"),
            wants_skeleton=True,
            arrive=_of("text.amc", "arrive"),
            bones=_of("text.amc", "bones"),
        ),
        Format(
            "bvh",
            3,
            (".bvh",),
            _of("text.bvh", "read"),
            _of("text.bvh", "write"),
            _of("text.layout", "join_notes"),
            states_rate=True,
            arrive=_of("text.bvh", "arrive"),
            has_more_joints=_of("text.hierarchy", "has_more_joints"),
            restate=_of("stated_rates", "restate_bvh"),
        ),
        *(  # c3d-outputs: a C3D whose points are not all points; the table gives c3d for .c3d
            Format(
                name,
                format_id,
                (".c3d",),
                _of("c3d.c3d", "read"),
                _of("c3d.c3d", "write"),
                states_rate=True,
                restate=_of("stated_rates", restate),
                recording=_of("c3d.recording", "recording"),
            )
            for format_id, name, restate in (
                (4, "c3d", "restate_c3d"),
                (5, "c3d-outputs", "restate_outputs"),
            )
        ),
        *(  # the table gives csv for .csv; the reader determines which kind a file is
            Format(
                name,
                format_id,
                (".csv", ".tsv") if name == "csv" else (f".{name if kind else 'csv'}",),
                _of(module, f"read{kind}", **options),
                _of(module, f"write{kind}", **options),
                _of("text.source", "join_table_notes"),
                states_rate=True,
                is_table=True,
                restate=_of("stated_rates", "restate_table"),
                is_motion=None if kind else _of("tables.csv_files", "is_motion"),
            )
            for format_id, name, module, kind, options in (
                (6, "trc", "tables.opensim", "_trc", {}),
                (7, "mot", "tables.opensim", "_storage", {"format_name": "mot"}),
                (8, "sto", "tables.opensim", "_storage", {"format_name": "sto"}),
                (11, "csv", "tables.csv_files", "", {}),
                (9, "motive", "tables.csv_files", "", {}),
                (10, "vicon", "tables.csv_files", "", {}),
            )
        ),
        Format(
            "mvnx",
            16,
            (".mvnx",),
            _of("tables.mvnx", "read"),
            _of("tables.mvnx", "write"),
            _of("text.source", "join_table_notes"),
            states_rate=True,
            restate=_of("stated_rates", "restate_table"),
        ),
        *(
            Format(
                name,
                format_id,
                (f".{name}",),
                _of("arrays.array_files", f"read_{name}"),
                _of("arrays.array_files", "write_arrays"),
                states_rate=name == "npz",
                is_motion=_of(*is_motion),
                arrays=_of("arrays.pickles" if name == "npy" else "arrays.layout", "list_arrays"),
            )
            for format_id, name, is_motion in (
                (12, "npy", ("arrays.pickles", "is_npy_motion")),
                (13, "npz", ("arrays.columns", "is_motion")),
            )
        ),
        *(
            Format(
                name,
                format_id,
                suffixes,
                _of("arrays.array_files", read),
                _of("arrays.array_files", "write_arrays"),
                states_rate=True,
                is_motion=_of("arrays.pickles", is_motion),
                arrays=_of("arrays.pickles", "list_arrays"),
            )
            for format_id, name, suffixes, read, is_motion in (
                (14, "pickle", (".pkl", ".pickle", ".joblib"), "read_pickle_file", "is_motion"),
                (17, "torch", (".pt", ".pth"), "read_torch", "is_tensor_motion"),
            )
        ),
    )
}


def format_of(path: str | Path, data: bytes | None = None) -> Format:
    """The format of a file by its suffix, in any case; raises SourceError.

    ``data`` are the bytes of the file: if they begin as those of another format do, it is that;
    but rows of numbers alone, as in any CSV, tell nothing.
    """
    suffix = Path(path).suffix.lower()
    own = next((f for f in FORMATS.values() if suffix in f.suffixes), None)
    likely = () if data is None else likely_formats(data)
    if own is None:
        known = ", ".join(dict.fromkeys(s for f in FORMATS.values() for s in f.suffixes))
        is_unlike = bool(likely) and likely[0] != "csv"
        looks = f"; it looks like {FORMATS[likely[0]].suffix}" if is_unlike else ""
        hint = Hint.BLENDER if suffix in BLENDER_SUFFIXES else None
        if remark := compression_remark(data or b""):
            raise SourceError(remark, path=path)
        message = f"no source format has the suffix {suffix!r}, but {known}{looks}"
        raise SourceError(message, path=path, hint=hint)
    if not likely or likely[0] == "csv" or any(suffix in FORMATS[n].suffixes for n in likely):
        return own
    return FORMATS[likely[0]]


def has_known_suffix(path: str | Path) -> bool:
    """Return whether a source format has the suffix of a file."""
    return any(Path(path).suffix.lower() in known.suffixes for known in FORMATS.values())


def is_table(path: str | Path) -> bool:
    """Return True if the suffix is that of a table."""
    suffix = Path(path).suffix.lower()
    return any(f.is_table for f in FORMATS.values() if suffix in f.suffixes)


def wants_skeleton(path: str | Path, data: bytes | None = None) -> bool:
    """Return whether the format of a file, see ``format_of``, has its skeleton in another file."""
    try:
        return format_of(path, data).wants_skeleton
    except SourceError:
        return False


def likely_formats(data: bytes) -> tuple[str, ...]:
    """The names of the formats whose files begin as ``data`` does, the likeliest first.

    If a suffix has several formats, it is the one that the content has. What tells a text from
    others stands in its first ``HEAD_BYTES``.
    """
    head = data[:HEAD_BYTES]
    if head.startswith(b"\x93NUMPY"):
        return ("npy",)
    if head.startswith(b"PK\3\4"):
        return ("torch",) if b"/data.pkl" in head[:256] else ("npz",)
    if head[:1] == b"\x80" and head[1:2] in (b"\2", b"\3", b"\4", b"\5"):
        return ("pickle",)
    start = head.removeprefix(b"\xef\xbb\xbf").lstrip()[:16].upper()
    if start.startswith(b"HIERARCHY"):
        return ("bvh",)
    if head[1:2] == b"\x50" and b"\0" in head[:512]:
        return ("c3d",)
    if re.match(rb"PATHFILETYPE[ \t]", start):
        return ("trc",)
    if start.startswith(b"<") and _of("tables.mvnx", "is_mvnx")(head):
        return ("mvnx",)
    small = head.lower()
    # words first: an expression anchored to lines is far slower
    if b"endheader" in small and re.search(rb"(?m)^[ \t]*endheader[ \t]*\r?$", small):
        return ("sto", "mot")
    if (b":bonedata" in small or b":hierarchy" in small) and re.search(_ASF_SECTION, small):
        return ("asf",)
    vendor: str | None = _of("tables.csv_files", "vendor_of")(head)
    if vendor is not None:
        return (vendor,)
    if _of("text.amc", "is_amc")(head):
        return ("amc",)
    return () if _of("tables.csv_files", "kind_of")(head) is None else ("csv",)


def recording_of(source: Source | None) -> Any:
    """Recording metadata of ``source``, a ``mcz.Recording``, or None.

    Raises FormatError on bad bytes.
    """
    read = FORMATS[source.format].recording if source is not None else None
    if source is None or read is None:
        return None
    return read(source.format, source.template, source.detail)


def with_analog_scales(source: Source, scales: Mapping[int, float]) -> Source | None:
    """``source``, a C3D, with other scales of analog channels; None if it states none."""
    scaled: Source | None = _of("c3d.recording", "with_analog_scales")(source, scales)
    return scaled


def arrays_of(source: Source | None, signals: Sequence[str]) -> list[JsonObject] | None:
    """List the use of each array of a source, see ``arrays.layout``; None without arrays.

    ``signals`` are the names of the clip's signals. Raises FormatError on bad bytes.
    """
    listed = FORMATS[source.format].arrays if source is not None else None
    return None if listed is None else listed(source, signals)


def format_by_id(format_id: int, *, of_skeleton: bool = False) -> Format:
    """The format with this id, of clips or of skeletons.

    Raises UnsupportedError for an unknown one, FormatError for one of the other sort.
    """
    for source_format in FORMATS.values():
        if source_format.id == format_id:
            if source_format.is_skeleton != of_skeleton:  # CLIP-04, SKEL-03
                sort = "skeletons" if of_skeleton else "clips"
                raise FormatError(f"source format {source_format.name} is not of kind {sort}")
            return source_format
    raise UnsupportedError(f"source format {format_id} is unknown")  # CONV-16
