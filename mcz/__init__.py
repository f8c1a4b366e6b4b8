"""MCZ: archival, compressed files of skeletal motion capture. SPEC.md describes the format.

The public names and nothing else. Each is loaded when it is first used, so that ``import mcz`` and
``mcz-info --help`` do not wait for numpy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import mcz.model.notebook as _notebook
from mcz import version as _version

if TYPE_CHECKING:
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
    from mcz.exchange.adapters.c3d import from_c3d, from_ezc3d, to_c3d, to_ezc3d
    from mcz.exchange.adapters.movement import from_movement, to_movement
    from mcz.exchange.adapters.pybvh import from_pybvh, to_pybvh
    from mcz.exchange.conversion import Fit, conversion_losses, convert, from_positions
    from mcz.exchange.conversion.scenes import SceneFile, to_glb, to_usda
    from mcz.exchange.datasets import (
        Dataset,
        FieldStatistics,
        Window,
        dataset,
        humanml3d,
        humanml3d_positions,
    )
    from mcz.exchange.exporting import export
    from mcz.files.bags import BagCheck, bag, check_bag
    from mcz.files.editing import Outcome, Report
    from mcz.files.editing.appending import Protection
    from mcz.files.editing.archive import append, pack
    from mcz.files.editing.extraction import ExtractedClip, Extraction, extract
    from mcz.files.editing.merging import merge
    from mcz.files.editing.metadata_edit import set_metadata, set_rate
    from mcz.files.editing.recovering import Recovery, protect
    from mcz.files.editing.reorganize import delete_clips, rename_clips, reorder_clips, split
    from mcz.files.editing.repair import Repair, repair
    from mcz.files.editing.replacing import Replacement, replace
    from mcz.files.editing.unpacking import unpack
    from mcz.files.live.clip_state import LiveFrame, StreamSummary
    from mcz.files.live.generators import LiveReader, live_frames, stream_decode, stream_encode
    from mcz.files.live.writer import LiveWriter
    from mcz.files.reading.clip import Clip
    from mcz.files.reading.faults import Problem, verify
    from mcz.files.reading.file import Attachment, File, open
    from mcz.files.reading.post_filtering import post_filter
    from mcz.files.reading.read import read
    from mcz.files.reading.source_files import read_skeleton, recording
    from mcz.files.tables import to_pandas, to_xarray
    from mcz.files.writing.file import encode, to_npz, write
    from mcz.hints import Hint
    from mcz.kinematics.contacts import Contact, Contacts, contacts
    from mcz.kinematics.metrics import Comparison, compare
    from mcz.kinematics.points import in_positions
    from mcz.kinematics.poses import (
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
    from mcz.kinematics.rest_pose import rest_positions
    from mcz.kinematics.retargeting.joint_maps import joint_map
    from mcz.kinematics.retargeting.mirroring import mirror
    from mcz.kinematics.retargeting.retargeting import retarget
    from mcz.kinematics.retargeting.selection import rename, select, with_offsets
    from mcz.model.motion import Channel, Exceptions, Joint, Motion, Signal, Skeleton, Source
    from mcz.show.pictures.plotting import Plotted, plot
    from mcz.show.pictures.rendering import Rendered, render
    from mcz.show.rerun import to_rerun
    from mcz.show.viewing.view import View, view
    from mcz.sources.arrays.array_files import split_clips
    from mcz.sources.arrays.body_models import offsets_from_positions, offsets_of_model
    from mcz.sources.arrays.skeletons import body_skeleton
    from mcz.sources.c3d.recording import Event, ForcePlatform, Recording

__version__ = _version.VERSION

_HOMES = {
    "mcz.exchange.adapters.c3d": ("from_c3d", "from_ezc3d", "to_c3d", "to_ezc3d"),
    "mcz.exchange.adapters.movement": ("from_movement", "to_movement"),
    "mcz.exchange.adapters.pybvh": ("from_pybvh", "to_pybvh"),
    "mcz.show.rerun": ("to_rerun",),
    "mcz.files.bags": ("BagCheck", "bag", "check_bag"),
    "mcz.files.editing.metadata_edit": ("set_metadata", "set_rate"),
    "mcz.exchange.exporting": ("export",),
    "mcz.files.tables": ("to_pandas", "to_xarray"),
    "mcz.exchange.datasets": (
        "Dataset",
        "FieldStatistics",
        "Window",
        "dataset",
        "humanml3d",
        "humanml3d_positions",
    ),
    "mcz.files.editing.archive": ("append", "pack"),
    "mcz.files.editing.unpacking": ("unpack",),
    "mcz.files.editing.reorganize": ("delete_clips", "rename_clips", "reorder_clips", "split"),
    "mcz.files.editing.merging": ("merge",),
    "mcz.files.editing": ("Outcome", "Report"),
    "mcz.files.reading.clip": ("Clip",),
    "mcz.files.live.clip_state": ("LiveFrame", "StreamSummary"),
    "mcz.exchange.conversion": ("Fit", "convert", "from_positions", "conversion_losses"),
    "mcz.exchange.conversion.scenes": ("SceneFile", "to_glb", "to_usda"),
    "mcz.files.editing.appending": ("Protection",),
    "mcz.files.editing.recovering": ("Recovery", "protect"),
    "mcz.files.editing.repair": ("Repair", "repair"),
    "mcz.files.editing.replacing": ("Replacement", "replace"),
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
    "mcz.files.editing.extraction": ("ExtractedClip", "Extraction", "extract"),
    "mcz.files.reading.file": ("Attachment", "File", "open"),
    "mcz.files.reading.read": ("read",),
    "mcz.files.reading.source_files": ("read_skeleton", "recording"),
    "mcz.files.writing.file": ("encode", "to_npz", "write"),
    "mcz.files.reading.post_filtering": ("post_filter",),
    "mcz.kinematics.points": ("in_positions",),
    "mcz.files.live.writer": ("LiveWriter",),
    "mcz.kinematics.poses": (
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
    "mcz.show.pictures.plotting": ("Plotted", "plot"),
    "mcz.show.pictures.rendering": ("Rendered", "render"),
    "mcz.kinematics.contacts": ("Contact", "Contacts", "contacts"),
    "mcz.files.reading.faults": ("Problem", "verify"),
    "mcz.kinematics.metrics": ("Comparison", "compare"),
    "mcz.model.motion": (
        "Channel",
        "Exceptions",
        "Joint",
        "Motion",
        "Signal",
        "Skeleton",
        "Source",
    ),
    "mcz.kinematics.rest_pose": ("rest_positions",),
    "mcz.sources.arrays.body_models": ("offsets_from_positions", "offsets_of_model"),
    "mcz.sources.arrays.array_files": ("split_clips",),
    "mcz.sources.arrays.skeletons": ("body_skeleton",),
    "mcz.sources.c3d.recording": ("Event", "ForcePlatform", "Recording"),
    "mcz.kinematics.retargeting.joint_maps": ("joint_map",),
    "mcz.kinematics.retargeting.mirroring": ("mirror",),
    "mcz.kinematics.retargeting.retargeting": ("retarget",),
    "mcz.kinematics.retargeting.selection": ("rename", "select", "with_offsets"),
    "mcz.files.live.generators": ("LiveReader", "live_frames", "stream_decode", "stream_encode"),
    "mcz.show.viewing.view": ("View", "view"),
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
    "FieldStatistics",
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
    "conversion_losses",
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
    "humanml3d",
    "humanml3d_positions",
    "in_positions",
    "joint_map",
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
    "split_clips",
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


def _play(motion: object) -> str:
    html: str = import_module("mcz.show.viewing.player").player(motion)
    return html


_notebook.register_player(_play)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
