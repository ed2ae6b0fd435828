"""Which recordings are at hand, and what are their words?

All are read once per run; scripts take what they need.
"""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from motionary.batch import Failure
from motionary.features import FULL_BODY, FULL_BODY_2006, FeatureSequence, read_features
from motionary.io import name_recordings, read
from motionary.motion import Motion

VARIABLE = "MOTIONARY_DATA"

HDM05 = (
    "HDM05 (Müller, Röder, Clausen, Eberhardt, Krüger, Weber: Documentation Mocap Database "
    "HDM05, CG-2007-2, Universität Bonn, 2007), CC BY-SA 3.0"
)
CMU = "CMU Graphics Lab Motion Capture Database, mocap.cs.cmu.edu, funded by NSF EIA-0196217"
BANDAI = "Bandai Namco Research Motiondataset, CC BY-NC 4.0 (numbers only, no pictures)"
TRUTH = "labels of the authors of Müller, Baak and Seidel (2009)"

ACTORS = ("bd", "bk", "dg", "mm", "tr")

#: Files that repeat another one, or that no known skeleton reads.
_LEFT_OUT = ("01_01.bvh", "13_29.amc", "13_30.amc", "iclone_05_13.bvh", "iclone_07_01.bvh")


class Clip(NamedTuple):
    """An example: its file, class and actor, and its words."""

    name: str
    motion_class: str
    actor: str
    packed: FeatureSequence


@dataclass(frozen=True, eq=False)
class Recordings:
    """Words of all recordings.

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
        path = self.folder.resolve().parent / "reference" / "golden" / name
        return json.loads(path.read_text("utf-8"))

    def motion(self, name: str) -> Motion:
        """Positions of a clip or another recording, by its name."""
        top = name.split("/")[0]
        inside = self.folder / "hdm05" if top in self.classes else self.folder
        return read(inside / name)


def load(*, jobs: int = 1) -> Recordings:
    """Words of all recordings of the folder that MOTIONARY_DATA names."""
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
    """Words of the 39 relations of 2006: the same without F40, the last."""
    last = np.uint64(1) << np.uint64(len(FULL_BODY) - 1)
    return replace(
        packed, packed=packed.packed & ~last, known=packed.known & ~last, feature_set=FULL_BODY_2006
    )


def minutes(sequences: Iterable[FeatureSequence]) -> float:
    """Length of recordings together."""
    return sum(len(sequence) for sequence in sequences) / 30 / 60


def data_entry(what: str, sequences: Sequence[FeatureSequence]) -> dict[str, Any]:
    """What a record says of some data."""
    return {"what": what, "files": len(sequences), "minutes": round(minutes(sequences), 2)}
