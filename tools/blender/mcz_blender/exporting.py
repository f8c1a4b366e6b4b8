"""File > Export > MCZ: selected armatures and empties, as a new file or added to an archive."""

from __future__ import annotations

import tempfile
import textwrap
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

import mcz

from .durations import slow_warning
from .importing import AXES, UNITS, mcz_line, tell_what_is_slow
from .recording import KEEP, Terms, most_values, recorded, things_of

CODECS = [
    ("fast", "Fast", "Lossless on the grid of the decimals below; read fastest"),
    ("best", "Best", "Lossless on the grid of the decimals below; fewest bytes, slow"),
    ("lossy", "Lossy", "No joint farther off than the greatest error below"),
]
LINE = 44  # characters of a line of the panel
RANGES = [
    ("scene", "Scene", "The scene's range of frames"),
    ("action", "Action", "From the first to the last key of the action"),
]


class ExportMCZ(bpy.types.Operator, ExportHelper):
    """Export the motion of selected armatures and empties, baked frame by frame"""

    bl_idname = "export_anim.mcz"
    bl_label = "Export MCZ"
    bl_options = {"PRESET"}

    filename_ext = ".mcz"
    filter_glob: StringProperty(default="*.mcz", options={"HIDDEN"})
    adds: BoolProperty(
        name="Add to Archive", description="Add to an existing file instead of replacing it"
    )
    clip_name: StringProperty(
        name="Clip Name", description="Name of a single clip; several keep their names"
    )
    codec: EnumProperty(name="Codec", items=CODECS, default="fast")
    max_error_cm: FloatProperty(
        name="Greatest Error", min=0.001, default=0.5, description="In cm, for a lossy file"
    )
    angle_decimals: IntProperty(name="Decimals of Degrees", min=0, max=9, default=4)
    length_decimals: IntProperty(
        name="Decimals of Lengths", min=-1, max=9, default=-1, description="-1: a micrometer"
    )
    unit: EnumProperty(
        name="Unit", items=[(KEEP, "Keep", "As imported, otherwise cm"), *UNITS], default=KEEP
    )
    up: EnumProperty(name="Up", items=[(KEEP, "Keep", "As imported, otherwise z"), *AXES])
    frames: EnumProperty(name="Frames", items=RANGES, default="scene")
    accepts_slow: BoolProperty(
        name="Export Anyway",
        description="Export even if it takes over a minute",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        return any(thing.type in ("ARMATURE", "EMPTY") for thing in context.selected_objects)

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in ("adds", "clip_name", "codec"):
            layout.prop(self, name)
        shown = ("max_error_cm",) if self.codec == "lossy" else ()
        for name in (*shown, "angle_decimals", "length_decimals", "unit", "up", "frames"):
            layout.prop(self, name)
        warning = warning_of(self, context)
        if warning:
            box = layout.box()
            for line in textwrap.wrap(warning, LINE):
                box.label(text=line)
            box.prop(self, "accepts_slow")
        tell_what_is_slow(layout)

    def execute(self, context: Any) -> set[str]:
        manager = context.window_manager
        things = things_of(context)
        manager.progress_begin(0, 1000)
        try:
            warning = "" if self.accepts_slow else warning_of(self, context)
            if warning:
                raise mcz.OptionError(f"{warning}; tick Export Anyway (accepts_slow) to export")
            if self.clip_name and len(things) > 1:
                raise mcz.OptionError(f"{len(things)} clips cannot all be {self.clip_name!r}")
            motions = []
            for number, (thing, markers) in enumerate(things):

                def step(share: float, number: int = number) -> None:
                    manager.progress_update(round(1000 * (number + share) / len(things)))

                terms = terms_of(self, context, thing, markers)
                motions.append(recorded(context, thing, markers, terms, step))
            self._write(motions, Path(bpy.path.abspath(self.filepath)))
        except mcz.MczError as error:
            self.report({"ERROR"}, mcz_line(str(error)))
            return {"CANCELLED"}
        finally:
            manager.progress_end()
        self.report({"INFO"}, f"{len(motions)} exported")
        return {"FINISHED"}

    def _write(self, motions: list[mcz.Motion], target: Path) -> None:
        """All of them, or none: several, and those that are added, are written aside first."""
        codec = {"codec": "lossy", "max_error_cm": self.max_error_cm}
        terms: dict[str, Any] = codec if self.codec == "lossy" else {"effort": self.codec}
        adds = self.adds and target.exists()
        if len(motions) == 1 and not adds:
            mcz.write(motions[0], target, force=True, **terms)
            return
        with tempfile.TemporaryDirectory(prefix="mcz-") as folder:
            parts = [str(Path(folder, f"{number}.mcz")) for number in range(len(motions))]
            for motion, part in zip(motions, parts, strict=True):
                mcz.write(motion, part, **terms)
            if adds:
                mcz.append(parts, target)
            else:
                mcz.merge(parts, target, force=True)


def terms_of(operator: Any, context: Any, thing: Any, markers: list[Any]) -> Terms:
    """The frames and facts that an export of ``thing`` is set to."""
    first, last = context.scene.frame_start, context.scene.frame_end
    data = (markers[0] if markers else thing).animation_data
    if operator.frames == "action" and data and data.action:
        first, last = (round(frame) for frame in data.action.frame_range)
    decimals = operator.angle_decimals, operator.length_decimals
    return Terms(first, last, operator.clip_name, operator.unit, operator.up, *decimals)


def warning_of(operator: Any, context: Any) -> str:
    """A warning where the export of what is selected takes over a minute, or nothing."""
    n_values = 0
    for thing, markers in things_of(context):
        frames = terms_of(operator, context, thing, markers).frames
        n_values += most_values(thing, markers, len(frames))
    return slow_warning(operator.codec, n_values)


def register() -> None:
    bpy.utils.register_class(ExportMCZ)


def unregister() -> None:
    bpy.utils.unregister_class(ExportMCZ)
