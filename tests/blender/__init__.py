"""The Blender add-on: what of it needs no Blender, and all of it where there is one."""
