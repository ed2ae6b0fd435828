"""The formats of recordings: one table of their suffixes, readers, writers and cutters.

A new format is a module here and a row in `FORMATS`. Modules are imported when a file of theirs
is read or written.

A recording of a file that holds several is called by the file's name, `#`, and the take:
`batch.npy#007`.
"""

import importlib
import re
from collections.abc import Callable, Sequence
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from motionary.io.text import PACKED, TAKE_MARK, format_suffix


class Format(NamedTuple):
    """How files of a format are handled; functions are named "module:function".

    Attributes
    ----------
    suffix : lower case
    read : (path, ReadOptions) -> FileContent; `UnreadableFile` if the file is missing, damaged,
        cut off or holds no motion, with the line where there is one; `InvalidInput` if something
        must be given (a rate, a take, an order of joints), or contradicts the file
    write : (motion, path, ...) -> None; empty where there is no writer; `InvalidInput` if the
        format does not hold the motion, `UnwritableFile` if the file cannot be written
    cut : of texts (lines, first, last) -> lines of a clip, of others
        (path, first, last, take) -> its bytes, both ends included; empty where no clips are cut
        out; errors as of `read`, and `InvalidInput` if these frames are not in the file
    takes : options of `read` that not every format has
    write_takes : options of `write` that not every format has
    is_text : whether a file may be packed with gzip
    several : whether a file may hold several recordings, of which one must be named
    in_folders : whether files are looked for in folders, or read where they are named only
    lacks : what the format cannot hold of a motion
    """

    suffix: str
    read: str
    write: str = ""
    cut: str = ""
    takes: tuple[str, ...] = ()
    write_takes: tuple[str, ...] = ()
    is_text: bool = False
    several: bool = False
    in_folders: bool = True
    lacks: tuple[str, ...] = ()


_GLTF = (".glb", ".gltf", ".vrm", ".vrma")
# OpenSim's tables rarely hold places, and those named .csv, and JSON, are mostly labels: they are
# read where they are named.
FORMATS = (
    Format(".amc", "amc:read_amc", "amc:write_amc", "amc:cut_amc", is_text=True,
           takes=("asf",), write_takes=("asf",), lacks=("events", "rate")),
    Format(".bvh", "bvh:read_bvh", "bvh_writing:write_bvh", "bvh_writing:cut_bvh", is_text=True,
           write_takes=("unit",), lacks=("events", "first frame")),
    Format(".c3d", "c3d:read_c3d", "c3d_writing:write_c3d", "c3d_writing:cut_c3d",
           takes=("trust_points",), lacks=("rig",)),
    Format(".trc", "trc:read_trc", "trc:write_trc", "trc:cut_trc", is_text=True,
           takes=("even_times",), lacks=("rig", "events")),
    Format(".csv", "point_tables:read_csv", is_text=True, in_folders=False, takes=("even_times",)),
    Format(".json", "json_points:read_json", is_text=True, in_folders=False, several=True,
           takes=("take", "even_times")),
    Format(".npz", "arrays:read_npz_motion", "npz:write_npz", "arrays:cut_npz", several=True,
           takes=("body_model", "take")),
    Format(".npy", "arrays:read_array", several=True, takes=("take",)),
    Format(".pkl", "arrays:read_pickle", several=True, takes=("take",)),
    Format(".fbx", "fbx:read_fbx", takes=("take",)),
    *(Format(suffix, "gltf:read_gltf", takes=("take",)) for suffix in _GLTF),
    Format(".mvnx", "mvnx:read_mvnx", several=True, takes=("take", "even_times")),
    *(Format(suffix, "point_tables:read_opensim", is_text=True, in_folders=False,
             takes=("even_times",)) for suffix in (".sto", ".mot")),
)  # fmt: skip
_PYTORCH = (
    "holds Python objects of PyTorch, which run when they are opened; where you trust it: "
    "numpy.savez('motion.npz', **{k: v.numpy() for k, v in torch.load(FILE).items()})"
)
# What to do about files that other programs read, by suffix.
_WAYS_OUT = {
    **dict.fromkeys((".pt", ".pth", ".ckpt"), _PYTORCH),
    **dict.fromkeys((".ma", ".mb", ".max"), "is a scene of its program: export FBX or BVH there"),
    ".abc": "holds shapes without joints: export FBX or BVH from the program that made it",
    ".xlsx": "is a workbook: save the sheet as CSV with columns such as hip_x, hip_y, hip_z",
    ".eaf": "holds labels of ELAN and no motion",
}
# How Blender opens what it reads.
_BLENDER = {
    ".fbx": "import_scene.fbx",
    ".dae": "wm.collada_import",
    ".blend": "wm.open_mainfile",
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), "wm.usd_import"),
}
# Names that no shell and no Python takes for more than a name.
_HARMLESS = re.compile(r"\w[\w .+-]*")
_BY_SUFFIX = {form.suffix: form for form in FORMATS}
_BY_SUFFIX |= {form.suffix + PACKED: form for form in FORMATS if form.is_text}

# Names of takes that are part of a path, and told from a suffix.
_PLAIN = re.compile(r"[\w-]+")
_FEWEST_DIGITS = 3

# Options that every format has.
_COMMON = frozenset({"rate_hz", "unit", "up", "skeleton", "sides", "fill_gaps_s", "fill_by"})

#: Instead of a take: asks a reader for the names of all.
EVERY = "*"

#: Suffixes that are looked for in folders.
MOTION_SUFFIXES = tuple(suffix for suffix, form in _BY_SUFFIX.items() if form.in_folders)

#: Suffixes of what can be written.
WRITTEN_SUFFIXES = tuple(suffix for suffix, form in _BY_SUFFIX.items() if form.write)


def find_format(path: str | PurePath) -> Format | None:
    """The format of a file, by its name; None if it is unknown."""
    return _BY_SUFFIX.get(format_suffix(path))


def way_out(path: str | PurePath) -> str | None:
    """What to do about a file of a format that is not read; None where nothing is known."""
    path = PurePath(path)
    if path.suffix.lower() in _BLENDER:
        return f"is read by Blender, which writes its bones as BVH: {blender_line(path)}"
    return _WAYS_OUT.get(path.suffix.lower())


def blender_line(path: str | PurePath) -> str:
    """The command with which Blender converts a file to BVH."""
    path = PurePath(path)
    suffix = path.suffix.lower()
    # A name may come from anybody, and the line is made to be run.
    stem = path.stem if _HARMLESS.fullmatch(path.name) else "FILE"
    return (
        f'blender --background --python-expr "import bpy; bpy.ops.{_BLENDER[suffix]}(filepath='
        f"'{stem}{path.suffix}'); bpy.context.view_layer.objects.active = next(o for o in "
        "bpy.data.objects if o.type == 'ARMATURE'); "
        f"bpy.ops.export_anim.bvh(filepath='{stem}.bvh')\""
    )


def options_of(path: str | Path) -> frozenset[str]:
    """The options of `read` that say something about a file, by its name."""
    form = find_format(path)
    return _COMMON | frozenset(form.takes) if form else _COMMON - {"rate_hz", "unit", "up"}


def load_function(place: str) -> Callable[..., Any]:
    """The function that a row of `FORMATS` names."""
    module, _, name = place.partition(":")
    function: Callable[..., Any] = getattr(
        importlib.import_module(f"motionary.io.formats.{module}"), name
    )
    return function


def label_takes(names: Sequence[str]) -> list[str]:
    """What takes are called behind a file's name: their names where plain, else numbers."""
    numbered = list(names) == [str(number) for number in range(1, len(names) + 1)]
    if not numbered and all(_PLAIN.fullmatch(name) for name in names):
        return list(names)
    digits = max(_FEWEST_DIGITS, len(str(len(names))))
    return [f"{number:0{digits}}" for number in range(1, len(names) + 1)]


def file_of(path: str | PurePath) -> Path:
    """The file of a recording, which may hold others, too."""
    return split_take(path)[0]


def split_take(path: str | PurePath) -> tuple[Path, str]:
    """The file and the take of a path; no take where a file is called so itself."""
    path = Path(path)
    name, mark, take = path.name.rpartition(TAKE_MARK)
    if not mark or TAKE_MARK not in path.suffix or path.exists():
        return path, ""
    return path.with_name(name), take
