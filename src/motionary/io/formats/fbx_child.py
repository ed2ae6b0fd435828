"""Bones of an FBX file: a program of its own, run by `fbx`, as ufbx may crash on a file.

`python -m motionary.io.formats.fbx_child IN.fbx OUT.npz` writes names, parents, local turns
and places of the bones in metres with y up, or one line on stderr.
"""

import gc
import os
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# A day at 120 Hz.
_MOST_FRAMES = 120 * 86400

# Objects of ufbx 0.0.5 crash or hang when they are taken apart, or looked at by the search
# for cycles: all are kept until the process ends.
_kept: list[Any] = []


def main(arguments: list[str]) -> int:
    """Exit code: 0 when the file was written, 1 with the reason on stderr."""
    gc.disable()
    import ufbx

    source, target = arguments
    try:
        scene = ufbx.load_file(
            source,
            ignore_geometry=True,
            ignore_embedded=True,
            load_external_files=False,
            target_axes=ufbx.axes_right_handed_y_up,
            target_unit_meters=1.0,
            space_conversion=ufbx.SpaceConversion.ADJUST_TRANSFORMS,
        )
        _kept.append(scene)
        arrays = _bake(scene)
    except Exception as error:
        # Whatever it is, the parent tells it as one line.
        sys.stderr.write(f"{str(error) or type(error).__name__}\n")
        return 1
    np.savez(target, **arrays)
    return 0


def _bake(scene: Any) -> dict[str, Any]:
    """Names, parents and, for each frame of the first take, transforms of the bones."""
    nodes = _keep(list(_keep([scene.nodes])[0]))
    above = _keep([node.parent for node in nodes])
    ids = [node.typed_id for node in nodes]
    parent_ids = [-1 if node is None else node.typed_id for node in above]
    parents = [ids.index(i) if i in ids else -1 for i in parent_ids]
    kept = _choose(nodes, parents)
    (anim,) = _keep([scene.anim])
    (settings,) = _keep([scene.settings])
    fps = float(settings.frames_per_second)
    start_s, n_frames = _extent(scene, anim, fps)
    places = np.empty((n_frames, len(kept), 3))
    turns, scales = np.empty((n_frames, len(kept), 4)), np.empty((n_frames, len(kept), 3))
    chosen = [nodes[i] for i in kept]
    for i in range(n_frames):
        for j, node in enumerate(chosen):
            transform = node.evaluate_transform(anim, start_s + i / fps)
            x, y, z, w = transform.rotation
            places[i, j], scales[i, j] = transform.translation, transform.scale
            turns[i, j] = w, x, y, z
    index = {place: j for j, place in enumerate(kept)}
    return {
        "names": np.array([node.name for node in chosen], dtype=np.str_),
        "parents": np.array([index.get(parents[i], -1) for i in kept]),
        "places": places,
        "turns": turns,
        "scales": scales,
        "rate_hz": np.array(fps),
        "n_takes": np.array(len(_keep([scene.anim_stacks])[0])),
    }


def _keep(objects: list[Any]) -> list[Any]:
    _kept.extend(objects)
    return objects


def _choose(nodes: list[Any], parents: list[int]) -> list[int]:
    """Bones and what they hang on, parents first; without bones, nodes that show nothing."""
    roots = [node.is_root for node in nodes]
    wanted = [bone is not None for bone in _keep([node.bone for node in nodes])]
    if not any(wanted):
        shown = (_keep([node.mesh, node.camera, node.light]) for node in nodes)
        wanted = [all(part is None for part in parts) for parts in shown]
    kept = set()
    for place, is_wanted in enumerate(wanted):
        while is_wanted and place >= 0 and not roots[place]:
            kept.add(place)
            place = parents[place]
    depths = [node.node_depth for node in nodes]
    return sorted(kept, key=lambda place: (depths[place], place))


def _extent(scene: Any, anim: Any, fps: float) -> tuple[float, int]:
    """Start in seconds and number of frames; by the keys where the take does not say."""
    if not 0 < fps < 1e6:
        raise ValueError(f"says {fps:g} frames per second")
    start_s, end_s = float(anim.time_begin), float(anim.time_end)
    curves = _keep(list(_keep([scene.anim_curves])[0]))
    if not end_s > start_s and curves:
        start_s = min(curve.min_time for curve in curves)
        end_s = max(curve.max_time for curve in curves)
    n_frames = 1 + max(0, round((end_s - start_s) * fps))
    if n_frames > _MOST_FRAMES:
        raise ValueError(f"says that it has {n_frames} frames")
    return start_s, n_frames


if __name__ == "__main__":
    code = main(sys.argv[1:])
    sys.stderr.flush()
    # Without taking objects apart, for the same reason.
    os._exit(code)
