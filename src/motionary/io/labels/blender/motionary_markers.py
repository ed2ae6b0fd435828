"""An add-on of Blender: a motion with its labels as markers of its action, and back.

Install it in Blender by Edit, Preferences, Add-ons, Install from Disk. File, Import, Motion with
labels takes the .json that `motionary labels convert --to blender` writes, and the .bvh beside
it. File, Export, Labels writes the markers of the active object's action again;
`motionary labels convert FILE.json -o labels.csv` reads them.

Frames count from 1, both ends of a label are included.
"""

import json
from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper, ImportHelper

bl_info = {
    "name": "Labels of motions",
    "blender": (3, 6, 0),
    "category": "Import-Export",
    "description": "Imports a BVH with its labels as action markers, and exports them",
}

RECORDING, RATE = "motionary_recording", "motionary_rate_hz"


def load(path):
    """The armature of a motion, its action with a marker at both ends of each label."""
    path = Path(path)
    content = json.loads(path.read_text("utf-8"))
    bpy.ops.import_anim.bvh(
        filepath=str(path.with_name(content["bvh"])),
        frame_start=1,
        use_fps_scale=False,
        update_scene_fps=True,
        update_scene_duration=True,
    )
    armature = bpy.context.object
    action = armature.animation_data.action
    action[RECORDING], action[RATE] = content["recording"], content["rate_hz"]
    for marker in content["markers"]:
        action.pose_markers.new(marker["name"]).frame = marker["frame"]
    return armature


def save(armature, path):
    """Write the markers of an armature's action."""
    action = armature.animation_data.action
    render = bpy.context.scene.render
    markers = sorted((marker.frame, marker.name) for marker in action.pose_markers)
    content = {
        "recording": action.get(RECORDING, armature.name),
        "rate_hz": action.get(RATE, render.fps / render.fps_base),
        "markers": [{"frame": frame, "name": name} for frame, name in markers],
    }
    text = json.dumps(content, ensure_ascii=False, indent=1)
    Path(path).write_text(text + "\n", "utf-8")


class ImportLabelledMotion(bpy.types.Operator, ImportHelper):
    """Import a BVH with its labels as markers."""

    bl_idname = "import_anim.motionary_labels"
    bl_label = "Motion with labels (.json)"
    filename_ext = ".json"

    def execute(self, context):
        """Load the chosen file."""
        load(self.filepath)
        return {"FINISHED"}


class ExportLabels(bpy.types.Operator, ExportHelper):
    """Export the markers of the active object's action as labels."""

    bl_idname = "export_anim.motionary_labels"
    bl_label = "Labels (.json)"
    filename_ext = ".json"

    def execute(self, context):
        """Save to the chosen file."""
        data = context.object and context.object.animation_data
        if not (data and data.action):
            self.report({"ERROR"}, "choose an object with an action")
            return {"CANCELLED"}
        save(context.object, self.filepath)
        return {"FINISHED"}


def _add_import(menu, _context):
    menu.layout.operator(ImportLabelledMotion.bl_idname)


def _add_export(menu, _context):
    menu.layout.operator(ExportLabels.bl_idname)


def register():
    """Add both to the menus."""
    bpy.utils.register_class(ImportLabelledMotion)
    bpy.utils.register_class(ExportLabels)
    bpy.types.TOPBAR_MT_file_import.append(_add_import)
    bpy.types.TOPBAR_MT_file_export.append(_add_export)


def unregister():
    """Take both out of the menus."""
    bpy.types.TOPBAR_MT_file_import.remove(_add_import)
    bpy.types.TOPBAR_MT_file_export.remove(_add_export)
    bpy.utils.unregister_class(ImportLabelledMotion)
    bpy.utils.unregister_class(ExportLabels)


if __name__ == "__main__":
    register()
