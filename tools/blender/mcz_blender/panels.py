"""Menu lines, the handler of dropped files, and the sidebar that searches archives."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import CollectionProperty, IntProperty, PointerProperty, StringProperty

import mcz

from .clips import SUFFIXES, Wanted, found
from .exporting import ExportMCZ
from .importing import ImportMCZ, bring, mcz_line
from .scenes import Settings

DROPPED = ";".join(suffix for suffix in SUFFIXES if suffix != ".bvh")  # Blender reads BVH, too


class MCZ_FH_drop(bpy.types.FileHandler):
    """Files dropped onto the viewport or the outliner."""

    bl_label = "Motion capture"
    bl_import_operator = ImportMCZ.bl_idname
    bl_file_extensions = DROPPED

    @classmethod
    def poll_drop(cls, context: Any) -> bool:
        return bool(context.area and context.area.type in ("VIEW_3D", "OUTLINER"))


class MCZ_PG_clip(bpy.types.PropertyGroup):
    """A line of the list: the name of a clip, and what is said of it."""

    line: StringProperty()


class MCZ_PG_archive(bpy.types.PropertyGroup):
    """An archive that is searched."""

    path: StringProperty(name="Archive", subtype="FILE_PATH")
    text: StringProperty(
        name="Search", description="Words of names or metadata, or a query: n_frames > 500"
    )
    clips: CollectionProperty(type=MCZ_PG_clip)
    chosen: IntProperty()


class MCZ_UL_clips(bpy.types.UIList):
    """The clips that were found."""

    def draw_item(
        self,
        context: Any,
        layout: Any,
        data: Any,
        item: Any,
        icon: int,
        active_data: Any,
        active_property: str,
        index: int,
    ) -> None:
        line = layout.split(factor=0.45)
        line.label(text=item.name, translate=False)
        line.label(text=item.line, translate=False)


class MCZ_OT_search(bpy.types.Operator):
    """List the clips of the archive that the words or the query find"""

    bl_idname = "mcz.search"
    bl_label = "Search"

    def execute(self, context: Any) -> set[str]:
        archive = context.window_manager.mcz_archive
        archive.clips.clear()
        try:
            lines = found(bpy.path.abspath(archive.path), archive.text)
        except mcz.MczError as error:
            self.report({"ERROR"}, mcz_line(str(error)))
            return {"CANCELLED"}
        for name, line in lines:
            clip = archive.clips.add()
            clip.name, clip.line = name, mcz_line(line)
        archive.chosen = 0
        self.report({"INFO"}, f"{len(lines)} found")
        return {"FINISHED"}


class MCZ_OT_bring(bpy.types.Operator):
    """Import the clip that is chosen in the list"""

    bl_idname = "mcz.bring"
    bl_label = "Import Clip"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        archive = context.window_manager.mcz_archive
        if not 0 <= archive.chosen < len(archive.clips):
            self.report({"ERROR"}, "no clip is chosen")
            return {"CANCELLED"}
        wanted = Wanted(clip=archive.clips[archive.chosen].name)
        return bring(self, context, [bpy.path.abspath(archive.path)], wanted, Settings())


class MCZ_PT_archive(bpy.types.Panel):
    """The sidebar."""

    bl_label = "MCZ Archive"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "MCZ"

    def draw(self, context: Any) -> None:
        layout, archive = self.layout, context.window_manager.mcz_archive
        layout.prop(archive, "path", text="")
        row = layout.row(align=True)
        row.prop(archive, "text", text="", icon="VIEWZOOM")
        row.operator(MCZ_OT_search.bl_idname, text="", icon="FILE_REFRESH")
        layout.template_list("MCZ_UL_clips", "", archive, "clips", archive, "chosen")
        layout.operator(MCZ_OT_bring.bl_idname, icon="IMPORT")


CLASSES = (
    MCZ_FH_drop,
    MCZ_PG_clip,
    MCZ_PG_archive,
    MCZ_UL_clips,
    MCZ_OT_search,
    MCZ_OT_bring,
    MCZ_PT_archive,
)


def import_line(menu: Any, context: Any) -> None:
    menu.layout.operator(ImportMCZ.bl_idname, text="MCZ (.mcz, .bvh, .amc, .c3d, .trc)")


def export_line(menu: Any, context: Any) -> None:
    menu.layout.operator(ExportMCZ.bl_idname, text="MCZ (.mcz)")


def register() -> None:
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.WindowManager.mcz_archive = PointerProperty(type=MCZ_PG_archive)
    bpy.types.TOPBAR_MT_file_import.append(import_line)
    bpy.types.TOPBAR_MT_file_export.append(export_line)


def unregister() -> None:
    bpy.types.TOPBAR_MT_file_export.remove(export_line)
    bpy.types.TOPBAR_MT_file_import.remove(import_line)
    del bpy.types.WindowManager.mcz_archive
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
