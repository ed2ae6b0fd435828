"""What is damaged, and how it is opened: a small folder of each kind of file.

A kind is made once per process; an input of it is what the folder holds with one file damaged.
"""

import contextlib
import gzip
import importlib
import io
import json
import pickle
import traceback
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np

from evidence.common.damage import damage
from motionary.errors import MotionaryError
from motionary.features import compute_features
from motionary.io import read, read_all, read_labels, read_query_collections, write, write_labels
from motionary.io.formats import fbx
from motionary.io.formats.npz import ArchivedArrays
from motionary.io.labels import FORMATS as LABEL_FORMATS
from motionary.io.labels import LabelFormat
from motionary.io.options import find_skeleton, save_skeleton
from motionary.labels import Label, LabelTrack
from motionary.models.keyframes import Gap, format_queries, from_features, parse_queries
from motionary.models.library import ClassLibrary, TrainingOptions, learn_classes
from motionary.models.templates import template_from_text, template_to_text
from motionary.motion import Event, Motion
from motionary.retrieval.index import Index
from motionary.retrieval.search import search
from motionary.samples import synthetic_motion

#: Lists of the 40 features of a set are shortened at the command line only.
_LONGEST = 1400


class Fault(Exception):
    """What was read is no valid motion, or an error's text is none for people."""


class Kind(NamedTuple):
    """Files of a kind: made in a folder, those of `damaged` are damaged, then opened."""

    make: Callable[[Path], None]
    damaged: tuple[str, ...]
    open: Callable[[Path, str], None]


class Bench:
    """One kind in a folder of its own; `try_one` damages, opens and restores."""

    def __init__(self, name: str, folder: Path) -> None:
        self.kind, self.name, self.folder = KINDS[name], name, folder
        folder.mkdir()
        self.kind.make(folder)
        files = [path for path in sorted(self.folder.rglob("*")) if path.is_file()]
        self.contents = {path.relative_to(self.folder).as_posix(): path.read_bytes()
                         for path in files}  # fmt: skip
        self.targets = sorted(
            (name for name in self.contents if any(Path(name).match(p) for p in self.kind.damaged)),
            # Folders of an index have names that are drawn.
            key=lambda name: (name.split("/")[0], Path(name).name),
        )

    def draw(self, seed: int) -> tuple[str, bytes]:
        """File and damaged content of an input."""
        rng = Random(f"{self.name} {seed}")
        name = rng.choice(self.targets)
        return name, _damage_inside(rng, name, self.contents[name], list(self.contents.values()))

    def try_one(self, seed: int) -> bool:
        """Whether the input was read; False if it was refused. Anything else is raised."""
        name, content = self.draw(seed)
        path = self.folder / name
        path.write_bytes(content)
        try:
            self.kind.open(self.folder, name)
        except MotionaryError as error:
            text = str(error).replace(str(self.folder), "")
            if len(text) > _LONGEST or not text.strip() or "\n" in text:
                place = _raised_in(error)
                raise Fault(f"{place}: a message of {len(text)}: {text[:60]!r}") from error
            return False
        finally:
            if path.exists() or path.parent.is_dir():
                path.write_bytes(self.contents[name])
        return True


def _raised_in(error: BaseException) -> str:
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f"{Path(frame.filename).name}:{frame.name}"


def _damage_inside(rng: Random, name: str, content: bytes, others: Sequence[bytes]) -> bytes:
    """Packed files are mostly damaged inside: check sums would refuse all else."""
    if rng.random() < 0.2:
        return damage(rng, content, others)
    if name.endswith(".gz"):
        return gzip.compress(damage(rng, gzip.decompress(content), others), 1)
    if name.endswith(".z.pkl"):
        return zlib.compress(damage(rng, zlib.decompress(content), others), 1)
    if name.endswith((".npz", ".xlsx")):
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            members = {one: packed.read(one) for one in packed.namelist()}
        one = rng.choice(sorted(members))
        how = rng.random()
        if how < 0.1:
            del members[one]
        elif how < 0.5 and name.endswith(".npz"):
            members[one] = _any_array(rng)
        else:
            members[one] = damage(rng, members[one], list(members.values()))
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w") as packed:
            for one, inside in members.items():
                packed.writestr(one, inside)
        return out.getvalue()
    if name.endswith(".npy") and rng.random() < 0.2:
        return _any_array(rng)
    return damage(rng, content, others)


def _any_array(rng: Random) -> bytes:
    """A file of an array of any shape and kind."""
    shape = tuple(rng.choice((0, 1, 2, 3, 4, 6, 8, 22, 72)) for _ in range(rng.randrange(5)))
    shape = shape if np.prod(shape) < 1e5 else shape[:2]
    dtype = rng.choice(("f8", "f4", "f2", "i4", "u1", "?", "U3", "c16", "M8[s]", "S2", ">f8"))
    array = np.zeros(shape, dtype=dtype)
    if dtype in ("f8", "f4", "f2", ">f8"):
        array += rng.choice((0.0, 1.0, 1e4, np.nan, np.inf, -1e-3))
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


def _oracles(module: str) -> Any:
    return importlib.import_module(f"tests.oracles.{module}")


# -- recordings ---------------------------------------------------------------------------


def _small(n_frames: int = 8) -> Motion:
    return synthetic_motion("squat", seed=0, rate_hz=60).cut(0, n_frames)


def _points() -> Motion:
    motion = _small()
    positions = motion.positions.copy()
    positions[2, 4] = np.nan
    events = (Event("Foot Strike", "left", 0.05),)
    return Motion(
        motion.names, positions, motion.recording, motion.mapping, events=events
    )  # fmt: skip


def _open_motion(folder: Path, name: str) -> None:
    rate_hz = 60 if Path(name).suffix in (".npy", ".npz", ".json") else None
    for motion in read_all(folder / name, rate_hz=rate_hz):
        _check(motion)


def _open_gltf(folder: Path, name: str) -> None:
    _open_motion(folder, "c.gltf" if name.endswith(".bin") else name)


def _open_acclaim(folder: Path, _: str) -> None:
    _check(read(folder / "a.amc", asf=folder / "a.asf"))


def _check(motion: Motion) -> None:
    gaps = np.isnan(motion.positions)
    if not motion.n_frames or not 0 < motion.rate_hz <= 1e6:
        raise Fault(f"{motion.n_frames} frames at {motion.rate_hz} Hz")
    if (gaps.all(axis=2) != gaps.any(axis=2)).any() or np.isinf(motion.positions).any():
        raise Fault("half a place is known, or infinite")
    if motion.rotations is not None and not np.isfinite(motion.rotations).all():
        raise Fault("a turn is not finite")
    if any("\n" in note for note in motion.notes):
        raise Fault("a note has two lines")
    if motion.mapping is not None:
        compute_features(motion)


def _make_bvh(folder: Path) -> None:
    write(_small(), folder / "a.bvh")
    write(_small(3), folder / "a.bvh.gz")
    rng, files = np.random.default_rng(22), _oracles("motion_files")
    nodes = files.random_bvh(rng)
    width = sum(len(channels) for *_, channels in nodes)
    text = files.bvh_text(nodes, rng.uniform(-99, 99, (8, width)).round(3))
    (folder / "b.bvh").write_text(text)


def _make_acclaim(folder: Path) -> None:
    rng, files = np.random.default_rng(21), _oracles("motion_files")
    bones, children = files.random_acclaim(rng)
    (folder / "a.asf").write_text(files.asf_text(bones, children))
    (folder / "a.amc").write_text(files.amc_text(bones, files.random_values(rng, bones, 8)))


def _make_c3d(folder: Path) -> None:
    write(_points(), folder / "a.c3d")
    rng, files = np.random.default_rng(3), _oracles("c3d_files")
    for machine, scale in ((files.INTEL, 0.1), (files.DEC, -1.0), (files.MIPS, -0.5)):
        content = files.c3d_bytes(
            rng.uniform(-900, 900, (5, 4, 3)), ["LASI", "RASI", "LKNE", "RKNE"],
            machine=machine, scale=scale, analog=2,
        )  # fmt: skip
        (folder / f"m{machine}.c3d").write_bytes(content)


def _make_trc(folder: Path) -> None:
    write(_points(), folder / "a.trc")
    write(_points(), folder / "a.trc.gz")


def _make_opensim(folder: Path) -> None:
    rows = "\n".join(f"{i / 50}\t1.5,2,3\t4,5.25,6" for i in range(8))
    head = "x\nDataType=Vec3\nversion=3\nendheader\ntime\ta\tb\n"
    for name in ("a.sto", "a.mot"):
        (folder / name).write_text(f"{head}{rows}\n")


def _make_csv(folder: Path) -> None:
    head = "time,hip_x,hip_y,hip_z,knee_x,knee_y,knee_z\n"
    rows = "\n".join(f"{i / 50},0.1,0.9,0.{i},0.1,0.5," for i in range(8))
    (folder / "plain.csv").write_text(head + rows)
    (folder / "nexus.csv").write_text(
        "Trajectories\n100\n,,P:LASI,,,P:RASI,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n"
        ",,mm,mm,mm,mm,mm,mm\n5,0,100,200,900,300,200,900\n6,0,101,200,900,,,\n"
    )
    (folder / "motive.csv").write_text(
        "Format Version,1.23,Export Frame Rate,120,Length Units,Meters\n,Type,Bone,Bone,Bone\n"
        ",Name,S:Hip,S:Hip,S:Hip\n,,Position,Position,Position\nFrame,Time (Seconds),X,Y,Z\n"
        "0,0.0,0.1,0.9,0.2\n1,0.008333,0.1,0.91,0.2\n"
    )


def _make_mvnx(folder: Path) -> None:
    text, _ = _oracles("rig_files").mvnx_text(_small())
    (folder / "a.mvnx").write_text(text)


def _make_gltf(folder: Path) -> None:
    gltf_of = _oracles("rig_files").gltf_of
    packed = [
        gltf_of(_small(4)).pack("data"),
        gltf_of(_small(), unit_m=0.01, humanoid="vrm1").pack("glb", "b"),
        gltf_of(_small(3), matrix=True, humanoid="vrm0").pack("beside", "c"),
    ]
    for name, content in (pair for files in packed for pair in files.items()):
        (folder / name).write_bytes(content)


def _make_json(folder: Path) -> None:
    motion = _small(4)
    frames = [dict(zip(motion.names, frame, strict=True)) for frame in motion.positions.tolist()]
    objects = [[{"name": n, "x": x, "y": y, "z": z} for n, (x, y, z) in f.items()] for f in frames]
    people = [{"time": i / 60, "people": [{"id": 1, "joints": f}]} for i, f in enumerate(frames)]
    lists = {"names": motion.names, "fps": 60, "positions": motion.positions.tolist()}
    named = {"fps": 60, "unit": "m", "frames": [{"joints": frame} for frame in frames]}
    contents = {"named": named, "lists": lists, "people": {"frames": people}, "objects": objects}
    for name, content in contents.items():
        (folder / f"{name}.json").write_text(json.dumps(content))


def _make_npz(folder: Path) -> None:
    write(_small(), folder / "own.npz")
    rng = np.random.default_rng(2)
    np.savez(folder / "amass.npz", poses=rng.normal(size=(4, 66)), trans=rng.normal(size=(4, 3)),
             betas=np.zeros(10), gender="male", mocap_framerate=60.0)  # fmt: skip
    np.savez(folder / "plain.npz", positions=_small().positions, fps=60.0)


def _make_npy(folder: Path) -> None:
    np.save(folder / "a.npy", _small().positions)
    np.save(folder / "b.npy", np.random.default_rng(3).normal(size=(2, 5, 22, 3)))
    np.save(folder / "c.npy", np.tile(np.random.default_rng(3).normal(size=263), (6, 1)))


def _make_pickles(folder: Path) -> None:
    rng = np.random.default_rng(3)
    content = {"keypoints3d": rng.normal(size=(4, 17, 3)), "b": [1, 2.0, "x", (1, 2), None, True]}
    for protocol in (0, 2, 4, 5):
        (folder / f"p{protocol}.pkl").write_bytes(pickle.dumps(content, protocol=protocol))
    (folder / "a.z.pkl").write_bytes(zlib.compress(pickle.dumps(content)))
    poses = {"smpl_poses": rng.normal(size=(4, 72)) / 50, "smpl_trans": rng.normal(size=(4, 3)),
             "smpl_scaling": np.ones(1)}  # fmt: skip
    (folder / "aist.pkl").write_bytes(pickle.dumps(poses))


def _make_fbx(folder: Path) -> None:
    bones = [("Hips", -1, (0, 90, 0)), ("Leg", 0, (9, -5, 0)), ("Foot", 1, (0, -40, 0))]
    turns = [[float(i * j) for i in range(6)] for j in range(3)]
    text = _oracles("fbx_files").fbx_text(bones, turns, [2.0 * i for i in range(6)])
    (folder / "a.fbx").write_text(text)


def _open_fbx(folder: Path, name: str) -> None:
    """As `read`, but for the process of its own, which costs a second."""
    target = folder / "bones.npz"
    target.unlink(missing_ok=True)
    with contextlib.redirect_stderr(io.StringIO()):
        if fbx.main([str(folder / name), str(target)]):
            raise MotionaryError("refused by ufbx")
    with np.errstate(all="ignore"):
        fbx._to_content(dict(ArchivedArrays(target)), None, [])


# -- labels, libraries, indexes, queries --------------------------------------------------


def _make_labels(folder: Path) -> None:
    write_labels(_track(), folder / "excel.csv", excel=True)
    rows = "x\twalk\t0\t1.5\tNA\n" * 3
    (folder / "b.tsv").write_text(f"recording\tlabel\tstart_s\tend_s\ta\n{rows}")


def _track() -> LabelTrack:
    labels = tuple(Label("walk, slowly", i, i + 0.5, cost=0.01 * i) for i in range(5))
    return LabelTrack(replace(_small().recording, name="a.bvh"), labels)


def _labels_as(form: LabelFormat) -> Kind:
    name = f"a{form.suffixes[0]}"

    def make(folder: Path) -> None:
        recording = None
        if form.needs_recording:
            is_c3d = form.name == "c3d"
            recording = folder / ("recording.c3d" if is_c3d else "recording.bvh")
            write(_points() if is_c3d else _small(), recording)
        write_labels(_track(), folder / name, to=form.name, recording=recording)

    return Kind(make, (name,), _open_labels)


def _open_labels(folder: Path, name: str) -> None:
    for track in read_labels(folder / name, rate_hz=60).values():
        for label in track:
            if not (label.name and -np.inf < label.start_s <= label.end_s < np.inf):
                raise Fault(f"a label {label}")


def _make_library(folder: Path) -> None:
    examples = {
        name: {str(seed): [compute_features(synthetic_motion(name, seed=seed, rate_hz=30))]
               for seed in range(2)}
        for name in ("squat", "kick_left")
    }  # fmt: skip
    learn_classes(examples, training=TrainingOptions(mirror=True)).save(folder)


def _open_library(folder: Path, _: str) -> None:
    repr(ClassLibrary.load(folder).names)


def _make_index(folder: Path) -> None:
    (folder / "recordings").mkdir()
    write(_small(30), folder / "recordings" / "a.bvh")
    for checked in (True, False):
        place = folder / ("index" if checked else "unchecked")
        Index.open(folder / "recordings", at=place).update()
        if not checked:
            # As before checksums were kept; damage then reaches what they shield.
            content = json.loads((place / "index.json").read_text())
            del content["checksum"]
            (place / "index.json").write_text(json.dumps(content))
            for path in place.glob("*/checksums.json"):
                path.unlink()


def _open_index(folder: Path, name: str) -> None:
    index = Index.open(folder / "recordings", at=folder / name.split("/")[0])
    repr(index.changes())
    if len(index):
        search(compute_features(_small(30)), index.collection())


def _query() -> Any:
    features = ({"F1": True, "F5": False}, {"F6": True}, {"F20": True, "F1": False})
    return from_features(features, [Gap(2, 9), Gap(1, 30)])


def _make_queries(folder: Path) -> None:
    (folder / "a.txt").write_text(format_queries([_query(), _query()]))
    one = {"keyframes": ["01*", "1*0"], "groups": ["a", "a"], "positions": [1, 9],
           "distances": [8], "stiffness": [0.5], "template_length": 20}  # fmt: skip
    (folder / "a.json").write_text(json.dumps({"walks": {"one": one, "two": one}}, indent=1))


def _open_queries(folder: Path, name: str) -> None:
    if name.endswith(".json"):
        read_query_collections(folder / name)
    else:
        parse_queries((folder / name).read_text("utf-8", "replace"))


def _make_templates(folder: Path) -> None:
    text = "from 0 to 0.5 s: F1, not F5\nfrom 0.5 to 1 s: F6\n"
    (folder / "a.txt").write_text(template_to_text(template_from_text(text), tolerance=0.1))


def _open_template(folder: Path, name: str) -> None:
    template_from_text((folder / name).read_text("utf-8", "replace"))


def _open_mapping(folder: Path, name: str) -> None:
    find_skeleton(folder / name)


KINDS: dict[str, Kind] = {
    "bvh": Kind(_make_bvh, ("*.bvh", "*.gz"), _open_motion),
    "asf": Kind(_make_acclaim, ("*.asf",), _open_acclaim),
    "amc": Kind(_make_acclaim, ("*.amc",), _open_acclaim),
    "c3d": Kind(_make_c3d, ("*.c3d",), _open_motion),
    "trc": Kind(_make_trc, ("*.trc", "*.gz"), _open_motion),
    "mvnx": Kind(_make_mvnx, ("*.mvnx",), _open_motion),
    "json": Kind(_make_json, ("*.json",), _open_motion),
    "gltf": Kind(_make_gltf, ("*.gl*", "*.bin"), _open_gltf),
    "csv": Kind(_make_csv, ("*.csv",), _open_motion),
    "sto": Kind(_make_opensim, ("*.sto",), _open_motion),
    "mot": Kind(_make_opensim, ("*.mot",), _open_motion),
    "fbx": Kind(_make_fbx, ("*.fbx",), _open_fbx),
    "npz": Kind(_make_npz, ("*.npz",), _open_motion),
    "npy": Kind(_make_npy, ("*.npy",), _open_motion),
    "pkl": Kind(_make_pickles, ("*.pkl",), _open_motion),
    "labels": Kind(_make_labels, ("*.?sv",), _open_labels),
    "library": Kind(_make_library, ("*.toml", "*.npz"), _open_library),
    "index": Kind(_make_index, ("index.json", "index/*/*", "unchecked/*/*"), _open_index),
    "queries": Kind(_make_queries, ("*.txt", "*.json"), _open_queries),
    "template": Kind(_make_templates, ("*.txt",), _open_template),
    "mapping": Kind(lambda folder: save_skeleton(_small(), folder / "rig.toml"), ("*.toml",),
                    _open_mapping),
}  # fmt: skip
KINDS |= {f"labels-{form.name}": _labels_as(form) for form in LABEL_FORMATS}
