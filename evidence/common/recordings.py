"""Recordings at hand and their features.

All are read once per run; scripts take what they need. Labels of recordings are those of
Müller, Baak and Seidel (2009); several classes of clips have one name there.
"""

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from motionary.batch import Failure
from motionary.features import FULL_BODY, FULL_BODY_2006, FeatureSequence, read_features
from motionary.io import name_recordings, read
from motionary.motion import Motion
from motionary.recording import Recording

VARIABLE = "MOTIONARY_DATA"

HDM05 = (
    "HDM05 (Müller, Röder, Clausen, Eberhardt, Krüger, Weber: Documentation Mocap Database "
    "HDM05, CG-2007-2, Universität Bonn, 2007), CC BY-SA 3.0"
)
CMU = "CMU Graphics Lab Motion Capture Database, mocap.cs.cmu.edu, funded by NSF EIA-0196217"
BANDAI = "Bandai Namco Research Motiondataset, CC BY-NC 4.0 (numbers only, no pictures)"
TRUTH = "labels of the authors of Müller, Baak and Seidel (2009)"

#: By the beginning of the names of recordings; "clips" have none.
SOURCES = {
    "clips": HDM05,
    "hdm05_takes": "HDM05, uncut takes",
    "cmu": CMU,
    "bandai": BANDAI,
    "truth": TRUTH,
}
EVERYTHING = ("clips", "hdm05_takes", "cmu", "bandai")

Results = dict[str, Any]

ACTORS = ("bd", "bk", "dg", "mm", "tr")

#: Recordings with labels, and their names in the table of truth.
LABELLED = {
    "cmu/01_01.amc": "01_01",
    "cmu/49_08.amc": "49_08",
    "cmu/86_01.amc": "86_01",
    "hdm05_takes/HDM_bd_03-03_01_120.amc": "HDM_bd_03-03_01_120",
}
#: The actor of the last.
UNSEEN = "bd"
#: What the authors of the truth call the classes of the clips.
NAMES = {
    "depositFloorR": "grabDepR",
    "grabHighR": "grabDepR",
    "elbowToKnee1RepsLelbowStart": "exercise",
    "squat1Reps": "exercise",
    "hopBothLegs1hops": "jump",
    "jogLeftCircle4StepsRstart": "move",
    "sneak2StepsLStart": "move",
    "kickLFront1Reps": "kick",
    "lieDownFloor": "sitLieDown",
    "rotateArmsBothBackward1Reps": "rotateArms",
    "throwBasketball": "throwR",
}

#: Files that repeat another one, or that no known skeleton reads.
_LEFT_OUT = ("01_01.bvh", "13_29.amc", "13_30.amc", "iclone_05_13.bvh", "iclone_07_01.bvh")


class Clip(NamedTuple):
    """An example: its file, class and actor, and its features."""

    name: str
    motion_class: str
    actor: str
    packed: FeatureSequence


@dataclass(frozen=True, eq=False)
class Recordings:
    """Features of all recordings.

    Attributes
    ----------
    folder : where the files are
    clips : examples of HDM05, by class, then by the number in their name
    others : all further recordings by name, such as "cmu/86_01.amc"
    """

    folder: Path
    clips: tuple[Clip, ...]
    others: Mapping[str, FeatureSequence]

    @cached_property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes, sorted."""
        return tuple(sorted({clip.motion_class for clip in self.clips}))

    def of(
        self, *, motion_class: str | None = None, actors: Iterable[str] = ACTORS
    ) -> tuple[Clip, ...]:
        """Clips of a class, or of all, by some actors."""
        wanted = set(actors)
        return tuple(
            clip
            for clip in self.clips
            if clip.actor in wanted and motion_class in (None, clip.motion_class)
        )

    def halves(self) -> tuple[tuple[Clip, ...], tuple[Clip, ...]]:
        """The authors' training and evaluation half."""
        table = self.golden("half_split.json")
        train = {stem for half in table.values() for stem in half["train"]}
        test = {stem for half in table.values() for stem in half["test"]}
        stems = [Path(clip.name).stem for clip in self.clips]
        return (
            tuple(c for c, stem in zip(self.clips, stems, strict=True) if stem in train),
            tuple(c for c, stem in zip(self.clips, stems, strict=True) if stem in test),
        )

    def golden(self, name: str) -> Any:
        """A published table that lies beside the recordings."""
        return json.loads(self.golden_path(name).read_text("utf-8"))

    def golden_path(self, name: str) -> Path:
        """Where it lies."""
        return self.folder.resolve().parent / "reference" / "golden" / name

    def motion(self, name: str) -> Motion:
        """Positions of a clip or another recording, by its name."""
        top = name.split("/")[0]
        inside = self.folder / "hdm05" if top in self.classes else self.folder
        return read(inside / name)


def load(*, jobs: int = 1) -> Recordings:
    """Features of all recordings of the folder that MOTIONARY_DATA names."""
    named = os.environ.get(VARIABLE, "")
    if not named or not Path(named).is_dir():
        raise SystemExit(f"{VARIABLE} must name the folder of the recordings, got {named!r}")
    folder = Path(named)
    clips = list(name_recordings(folder / "hdm05").items())
    others = [
        (f"{part}/{name}", path)
        for part in ("cmu", "bandai", "hdm05_takes")
        for name, path in name_recordings(folder / part).items()
        if path.name not in _LEFT_OUT and path.suffix.lower() in (".amc", ".bvh")
    ]
    packed = {}
    for (name, _), item in zip(
        clips + others, read_features(clips + others, jobs=jobs), strict=True
    ):
        if isinstance(item, Failure):
            raise item.error
        packed[name] = item
    return Recordings(
        folder,
        tuple(_clip(name, packed[name]) for name, _ in sorted(clips)),
        {name: packed[name] for name, _ in others},
    )


def _clip(name: str, packed: FeatureSequence) -> Clip:
    motion_class, file = name.split("/")
    return Clip(name, motion_class, file.split("_")[1], packed)


def examples(clips: Iterable[Clip]) -> dict[str, dict[str, list[FeatureSequence]]]:
    """Clips as `learn_classes` takes them."""
    result: dict[str, dict[str, list[FeatureSequence]]] = {}
    for clip in clips:
        by_class = result.setdefault(clip.motion_class, {clip.motion_class: []})
        by_class[clip.motion_class].append(clip.packed)
    return {name: result[name] for name in sorted(result)}


def of_2006(packed: FeatureSequence) -> FeatureSequence:
    """The 39 features of 2006: the same without F40, the last."""
    last = np.uint64(1) << np.uint64(len(FULL_BODY) - 1)
    return replace(
        packed, packed=packed.packed & ~last, known=packed.known & ~last, feature_set=FULL_BODY_2006
    )


def clips_of_2006(clips: Iterable[Clip]) -> tuple[Clip, ...]:
    """Clips with these features alone."""
    return tuple(clip._replace(packed=of_2006(clip.packed)) for clip in clips)


def of_class(clips: Iterable[Clip], name: str) -> list[Clip]:
    """Clips of a class."""
    return [clip for clip in clips if clip.motion_class == name]


def join(sequences: Sequence[FeatureSequence], source: str = "") -> FeatureSequence:
    """Recordings one behind the other."""
    return FeatureSequence(
        np.concatenate([one.packed for one in sequences]),
        np.concatenate([one.known for one in sequences]),
        sequences[0].feature_set,
        Recording(source),
    )


Extent = tuple[int, float]
Pick = str | Callable[[Recordings], Sequence[FeatureSequence] | Extent] | Extent


def describe(recordings: Recordings, data: Sequence[str | tuple[str, Pick]]) -> list[Results]:
    """What a record says of the data.

    Parameters
    ----------
    data : keys of `SOURCES`; or what it is, in which sources are named, and how it is picked:
        by such a key, or files and minutes, or either by a function of all recordings
    """
    entries = []
    for entry in data:
        what, pick = (f"{{{entry}}}", entry) if isinstance(entry, str) else entry
        picked = pick(recordings) if callable(pick) else pick
        if isinstance(picked, str):
            picked = _picked(recordings, picked)
        if isinstance(picked, tuple):
            files, minutes = picked
        else:
            files, minutes = len(picked), round(sum(map(len, picked)) / 30 / 60, 2)
        entries.append({"what": what.format(**SOURCES), "files": files, "minutes": minutes})
    return entries


def extent_of(motions: Iterable[Motion]) -> Extent:
    """How many motions, and their minutes."""
    seconds = [motion.n_frames / motion.rate_hz for motion in motions]
    return len(seconds), round(sum(seconds) / 60, 2)


def _picked(recordings: Recordings, key: str) -> list[FeatureSequence]:
    if key == "clips":
        return clips_packed(recordings.clips)
    return [packed for name, packed in recordings.others.items() if name.startswith(key)]


def clips_packed(clips: Iterable[Clip]) -> list[FeatureSequence]:
    """Features of clips."""
    return [clip.packed for clip in clips]
