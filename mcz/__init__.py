"""MCZ: archival, compressed files of skeletal motion capture. SPEC.md describes the format.

The public names and nothing else. Each is loaded when it is first used, so that ``import mcz`` and
``mcz-info --help`` do not wait for numpy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mcz import version as _version

if TYPE_CHECKING:
    from mcz.adapters.c3d import from_c3d, to_c3d
    from mcz.adapters.ezc3d import from_ezc3d, to_ezc3d
    from mcz.adapters.movement import from_movement, to_movement
    from mcz.adapters.pybvh import from_pybvh, to_pybvh
    from mcz.adapters.rerun import to_rerun
    from mcz.bags import BagCheck, bag, check_bag
    from mcz.conversion import Fit, convert, from_positions, left_out
    from mcz.conversion.scenes import SceneFile, to_glb, to_usda
    from mcz.datasets import Dataset, Window, dataset
    from mcz.editing.archive import append, pack
    from mcz.editing.batch_report import Outcome, Report
    from mcz.editing.exporting import export
    from mcz.editing.extraction import ExtractedClip, Extraction, extract
    from mcz.editing.merging import merge
    from mcz.editing.metadata_edit import set_metadata, set_rate
    from mcz.editing.protecting import Protection
    from mcz.editing.recovering import Recovery
    from mcz.editing.reorganize import delete_clips, rename_clips, reorder_clips, split
    from mcz.editing.repair import Repair, repair
    from mcz.editing.replacing import Replacement, replace
    from mcz.editing.rewriting import protect
    from mcz.editing.unpacking import unpack
    from mcz.errors import (
        AccessError,
        ChecksumError,
        ContactWarning,
        ExistsError,
        FormatError,
        LimitError,
        LostFrameError,
        MczError,
        MotionError,
        OptionError,
        OutOfRangeError,
        SkeletonWarning,
        SourceError,
        TruncatedError,
        UnknownNameError,
        UnsupportedError,
        WorkerError,
    )
    from mcz.formats.body_models import offsets_from_positions, offsets_of_model
    from mcz.formats.body_trees import body_skeleton
    from mcz.formats.c3d_events import Event
    from mcz.formats.c3d_recording import ForcePlatform, Recording
    from mcz.hints import Hint
    from mcz.kinematics.contacts import Contact, Contacts, contacts
    from mcz.kinematics.marker_motion import in_positions
    from mcz.kinematics.rest_pose import rest_positions
    from mcz.live.concealment import LiveFrame
    from mcz.live.generators import LiveReader, stream_decode, stream_encode
    from mcz.live.reader_with_losses import StreamSummary
    from mcz.live.strict_reader import live_frames
    from mcz.live.writer import LiveWriter
    from mcz.metrics import Comparison, compare
    from mcz.motion import Channel, Exceptions, Joint, Motion, Signal, Skeleton, Source
    from mcz.pictures.plotting import Plotted, plot
    from mcz.pictures.rendering import Rendered, render
    from mcz.poses import (
        Root,
        accelerations,
        point_names,
        positions,
        resample,
        root,
        rotations,
        times,
        velocities,
    )
    from mcz.reading.clip import Clip
    from mcz.reading.faults import Problem, verify
    from mcz.reading.file import Attachment, File, open
    from mcz.reading.post_filtering import post_filter
    from mcz.reading.read import read
    from mcz.reading.source_files import read_skeleton
    from mcz.reading.source_info import recording
    from mcz.retargeting.joint_maps import joint_map
    from mcz.retargeting.mirroring import mirror
    from mcz.retargeting.offsets import with_offsets
    from mcz.retargeting.renaming import rename
    from mcz.retargeting.retargeting import retarget
    from mcz.retargeting.selection import select
    from mcz.tables import to_pandas, to_xarray
    from mcz.viewing.view import View, view
    from mcz.writing.file import encode, to_npz, write

__version__ = _version.VERSION

_HOMES = {
    "mcz.adapters.c3d": ("from_c3d", "to_c3d"),
    "mcz.adapters.ezc3d": ("from_ezc3d", "to_ezc3d"),
    "mcz.adapters.movement": ("from_movement", "to_movement"),
    "mcz.adapters.pybvh": ("from_pybvh", "to_pybvh"),
    "mcz.adapters.rerun": ("to_rerun",),
    "mcz.bags": ("BagCheck", "bag", "check_bag"),
    "mcz.editing.metadata_edit": ("set_metadata", "set_rate"),
    "mcz.editing.exporting": ("export",),
    "mcz.tables": ("to_pandas", "to_xarray"),
    "mcz.datasets": ("Dataset", "Window", "dataset"),
    "mcz.editing.archive": ("append", "pack"),
    "mcz.editing.unpacking": ("unpack",),
    "mcz.editing.reorganize": ("delete_clips", "rename_clips", "reorder_clips", "split"),
    "mcz.editing.merging": ("merge",),
    "mcz.editing.batch_report": ("Outcome", "Report"),
    "mcz.reading.clip": ("Clip",),
    "mcz.live.concealment": ("LiveFrame",),
    "mcz.conversion": ("Fit", "convert", "from_positions", "left_out"),
    "mcz.conversion.scenes": ("SceneFile", "to_glb", "to_usda"),
    "mcz.editing.rewriting": ("protect",),
    "mcz.editing.protecting": ("Protection",),
    "mcz.editing.recovering": ("Recovery",),
    "mcz.editing.repair": ("Repair", "repair"),
    "mcz.editing.replacing": ("Replacement", "replace"),
    "mcz.hints": ("Hint",),
    "mcz.errors": (
        "AccessError",
        "ChecksumError",
        "ContactWarning",
        "ExistsError",
        "FormatError",
        "LimitError",
        "LostFrameError",
        "MczError",
        "MotionError",
        "OptionError",
        "OutOfRangeError",
        "SkeletonWarning",
        "SourceError",
        "TruncatedError",
        "UnknownNameError",
        "UnsupportedError",
        "WorkerError",
    ),
    "mcz.editing.extraction": ("ExtractedClip", "Extraction", "extract"),
    "mcz.reading.file": ("Attachment", "File", "open"),
    "mcz.reading.read": ("read",),
    "mcz.reading.source_info": ("recording",),
    "mcz.writing.file": ("encode", "to_npz", "write"),
    "mcz.reading.post_filtering": ("post_filter",),
    "mcz.kinematics.marker_motion": ("in_positions",),
    "mcz.live.strict_reader": ("live_frames",),
    "mcz.live.writer": ("LiveWriter",),
    "mcz.poses": (
        "Root",
        "accelerations",
        "point_names",
        "positions",
        "resample",
        "root",
        "rotations",
        "times",
        "velocities",
    ),
    "mcz.pictures.plotting": ("Plotted", "plot"),
    "mcz.pictures.rendering": ("Rendered", "render"),
    "mcz.kinematics.contacts": ("Contact", "Contacts", "contacts"),
    "mcz.reading.faults": ("Problem", "verify"),
    "mcz.metrics": ("Comparison", "compare"),
    "mcz.motion": ("Channel", "Exceptions", "Joint", "Motion", "Signal", "Skeleton", "Source"),
    "mcz.reading.source_files": ("read_skeleton",),
    "mcz.kinematics.rest_pose": ("rest_positions",),
    "mcz.formats.body_models": ("offsets_from_positions", "offsets_of_model"),
    "mcz.formats.body_trees": ("body_skeleton",),
    "mcz.formats.c3d_events": ("Event",),
    "mcz.formats.c3d_recording": ("ForcePlatform", "Recording"),
    "mcz.retargeting.joint_maps": ("joint_map",),
    "mcz.retargeting.mirroring": ("mirror",),
    "mcz.retargeting.offsets": ("with_offsets",),
    "mcz.retargeting.renaming": ("rename",),
    "mcz.retargeting.retargeting": ("retarget",),
    "mcz.retargeting.selection": ("select",),
    "mcz.live.generators": ("LiveReader", "stream_decode", "stream_encode"),
    "mcz.live.reader_with_losses": ("StreamSummary",),
    "mcz.viewing.view": ("View", "view"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "AccessError",
    "Attachment",
    "BagCheck",
    "Channel",
    "ChecksumError",
    "Clip",
    "Comparison",
    "Contact",
    "ContactWarning",
    "Contacts",
    "Dataset",
    "Event",
    "Exceptions",
    "ExistsError",
    "ExtractedClip",
    "Extraction",
    "File",
    "Fit",
    "ForcePlatform",
    "FormatError",
    "Hint",
    "Joint",
    "LimitError",
    "LiveFrame",
    "LiveReader",
    "LiveWriter",
    "LostFrameError",
    "MczError",
    "Motion",
    "MotionError",
    "OptionError",
    "OutOfRangeError",
    "Outcome",
    "Plotted",
    "Problem",
    "Protection",
    "Recording",
    "Recovery",
    "Rendered",
    "Repair",
    "Replacement",
    "Report",
    "Root",
    "SceneFile",
    "Signal",
    "Skeleton",
    "SkeletonWarning",
    "Source",
    "SourceError",
    "StreamSummary",
    "TruncatedError",
    "UnknownNameError",
    "UnsupportedError",
    "View",
    "Window",
    "WorkerError",
    "accelerations",
    "append",
    "bag",
    "body_skeleton",
    "check_bag",
    "compare",
    "contacts",
    "convert",
    "dataset",
    "delete_clips",
    "encode",
    "export",
    "extract",
    "from_c3d",
    "from_ezc3d",
    "from_movement",
    "from_positions",
    "from_pybvh",
    "in_positions",
    "joint_map",
    "left_out",
    "live_frames",
    "merge",
    "mirror",
    "offsets_from_positions",
    "offsets_of_model",
    "open",
    "pack",
    "plot",
    "point_names",
    "positions",
    "post_filter",
    "protect",
    "read",
    "read_skeleton",
    "recording",
    "rename",
    "rename_clips",
    "render",
    "reorder_clips",
    "repair",
    "replace",
    "resample",
    "rest_positions",
    "retarget",
    "root",
    "rotations",
    "select",
    "set_metadata",
    "set_rate",
    "split",
    "stream_decode",
    "stream_encode",
    "times",
    "to_c3d",
    "to_ezc3d",
    "to_glb",
    "to_movement",
    "to_npz",
    "to_pandas",
    "to_pybvh",
    "to_rerun",
    "to_usda",
    "to_xarray",
    "unpack",
    "velocities",
    "verify",
    "view",
    "with_offsets",
    "write",
]


if not TYPE_CHECKING:  # a type checker shall find a name that is not there

    def __getattr__(name: str) -> Any:
        if name not in _HOME_OF:
            raise AttributeError(f"module 'mcz' has no attribute {name!r}")
        value = getattr(import_module(_HOME_OF[name]), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
