"""File > Import > MCZ, and files dropped onto the 3D viewport."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)
from bpy_extras.io_utils import ImportHelper

import mcz
from mcz.kernels import lacks_compiled_kernels

from .clips import SUFFIXES, Wanted, found, loaded
from .scenes import Settings, put

UNITS = [(unit, unit, "") for unit in ("mm", "cm", "m", "in", "ft")]
AXES = [(axis, axis.upper(), "") for axis in "xyz"]
CLIP, SETTINGS = (
    ("clip", "where", "every_clip", "first", "stop", "step", "resolution", "skeleton", "salvage"),
    ("unit", "up", "rate", "start", "sets_rate", "sets_range"),
)


def clips_like(self: Any, context: Any, text: str) -> list[tuple[str, str]]:
    """The clips of the chosen archive that a text or a query finds."""
    try:
        return found(self.paths()[0], text)
    except (mcz.MczError, IndexError):
        return []


class ImportMCZ(bpy.types.Operator, ImportHelper):
    """Import motion capture: skeletons as armatures, markers as empties"""

    bl_idname = "import_anim.mcz"
    bl_label = "Import MCZ"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    filename_ext = ".mcz"
    filter_glob: StringProperty(default=";".join(f"*{s}" for s in SUFFIXES), options={"HIDDEN"})
    directory: StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE", "HIDDEN"})
    files: CollectionProperty(
        type=bpy.types.OperatorFileListElement, options={"SKIP_SAVE", "HIDDEN"}
    )
    clip: StringProperty(
        name="Clip",
        description="A clip of an archive: type words of its name or metadata, or a query",
        search=clips_like,
        options={"SKIP_SAVE"},
    )
    where: StringProperty(
        name="Query",
        description="Import every clip that matches: n_frames > 500 and name like 'walk*'",
        options={"SKIP_SAVE"},
    )
    every_clip: BoolProperty(name="All Clips", description="Import every clip of an archive")
    first: IntProperty(name="First Frame", min=0, description="Counted from 0")
    stop: IntProperty(name="Stop", min=0, description="The frame after the last; 0: to the end")
    step: IntProperty(name="Step", min=1, default=1, description="Every n-th frame")
    resolution: IntProperty(
        name="Coarser", min=0, max=16, description="Number of the finest resolutions to leave out"
    )
    skeleton: StringProperty(
        name="ASF",
        subtype="FILE_PATH",
        description="The skeleton of an AMC, if it is not beside the AMC",
    )
    salvage: BoolProperty(
        name="Salvage", description="Read the intact parts of a damaged file, and report the losses"
    )
    unit: EnumProperty(
        name="Unit", items=UNITS, default="cm", description="If the file states none"
    )
    up: EnumProperty(name="Up", items=AXES, default="y", description="If the file states none")
    rate: FloatProperty(
        name="Rate", min=0.001, default=120.0, description="If the file states none"
    )
    start: IntProperty(
        name="Start at", default=1, description="The scene's frame for the first frame"
    )
    sets_rate: BoolProperty(
        name="Set Frame Rate",
        default=True,
        description="Give the scene the clip's rate; otherwise keys may lie between frames",
    )
    sets_range: BoolProperty(name="Set Range", default=True)

    def paths(self) -> list[str]:
        """The chosen files."""
        if self.files and self.files[0].name:
            return [str(Path(self.directory, file.name)) for file in self.files]
        return [self.filepath]

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for settings of dropped files, otherwise for files."""
        return self.invoke_popup(context)

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for title, names in (("Clip", CLIP), ("Where the File Does Not Say", SETTINGS[:3])):
            box = layout.box()
            box.label(text=title)
            for name in names:
                box.prop(self, name)
        for name in SETTINGS[3:]:
            layout.prop(self, name)
        tell_what_is_slow(layout)

    def execute(self, context: Any) -> set[str]:
        wanted = Wanted(
            self.clip,
            self.where.strip(),
            self.every_clip,
            self.first,
            self.stop,
            self.step,
            self.resolution,
            bpy.path.abspath(self.skeleton) if self.skeleton else "",
            self.salvage,
        )
        settings = Settings(
            self.unit, self.up, self.rate, self.start, self.sets_rate, self.sets_range
        )
        return bring(self, context, self.paths(), wanted, settings)


def tell_what_is_slow(layout: Any) -> None:
    """Say so where kernels are not compiled."""
    if lacks_compiled_kernels():
        layout.label(text="Without compiled kernels all but 'fast' takes long", icon="INFO")


def bring(
    operator: Any, context: Any, paths: list[str], wanted: Wanted, settings: Settings
) -> set[str]:
    """Import what is wanted of each file; errors and notes are told by ``operator``."""
    manager = context.window_manager
    made: list[Any] = []
    manager.progress_begin(0, 1000 * len(paths))
    try:
        for number, path in enumerate(paths):
            for at, (n_clips, motion) in enumerate(loaded(path, wanted)):

                def step(share: float, at: int = at, n: int = n_clips, file: int = number) -> None:
                    manager.progress_update(round(1000 * (file + (at + share) / n)))

                thing, notes = put(context, motion, settings, step)
                made.append(thing)
                for note in notes:
                    operator.report({"WARNING"}, mcz_line(note))
    except mcz.MczError as error:
        error.add(path=Path(path).name)
        operator.report({"ERROR"}, mcz_line(str(error)))
        return {"FINISHED"} if made else {"CANCELLED"}
    finally:
        manager.progress_end()
    if bpy.context.mode == "OBJECT":
        for thing in context.view_layer.objects:
            thing.select_set(thing in made)
        if made:
            context.view_layer.objects.active = made[-1]
    operator.report({"INFO"}, f"{len(made)} imported")
    return {"FINISHED"}


def mcz_line(text: str) -> str:
    """One line, without what a terminal or a status bar would take for more than text."""
    from mcz.model.text_format import printable

    return printable(" ".join(text.split()))


def register() -> None:
    bpy.utils.register_class(ImportMCZ)


def unregister() -> None:
    bpy.utils.unregister_class(ImportMCZ)
