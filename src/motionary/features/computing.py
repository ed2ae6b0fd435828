"""Packed features of a motion, and where in its file they stand.

Joint positions are brought to 120 Hz, features measured and switched there, and every fourth
frame kept: features at 30 Hz, as the thresholds of the published work expect. The switch is
that of Müller and Röder (2006), appendix A: on where the strong test becomes true, off where
the weak test fails; a gap (unknown frames) is a border, and what follows starts afresh.

Conventions: frame i of a sequence describes the time i / 30 s after the recording's first
frame; parts are half-open; the file's own frame numbers are inclusive, as people look them up.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput, UnknownSkeleton, WrongKind
from motionary.features.body import Body, Floats
from motionary.features.catalogue import FULL_BODY
from motionary.features.feature_set import FeatureSet, holds, hysteresis, needs_travel
from motionary.motion import GENERIC_JOINTS, JointMapping, Motion, resample
from motionary.packing import PackedFeatures, count_integers, full_mask, pack, unpack
from motionary.recording import Recording, Segment
from motionary.skeletons import find_mapping, known_mappings, named_mapping
from motionary.tables import Table, Tabular, build_frame

Bools = NDArray[np.bool_]

SEQUENCE_HZ = 30.0
MEASURE_HZ = 120.0
_STEP = 4

# Below, a frame tells nothing of speed, and a wrong rate would fill the memory.
_LEAST_HZ = 1.0
# Frames at 120 Hz of short motions that are computed together: a minute.
_FRAMES_TOGETHER = 7200
_KEPT_BYTES = 1 << 24


@dataclass(frozen=True, slots=True, eq=False)
class FeatureSequence(Tabular):
    """Packed features of one recording.

    Attributes
    ----------
    packed : array, shape (frames, n_integers), uint64, at 30 Hz; unknown features are 0
    known : array of the same shape: which features are known
    feature_set : what the bits mean
    recording : what they are of; where it has no rate or number of frames, the file's are
        those of the sequence
    """

    packed: PackedFeatures
    known: PackedFeatures
    feature_set: FeatureSet
    recording: Recording = field(default_factory=Recording)

    def __post_init__(self) -> None:
        n_integers = count_integers(len(self.feature_set))
        shape = self.packed.shape
        if len(shape) != 2 or shape[1] != n_integers or self.known.shape != shape:
            raise InvalidInput(
                f"feature set {self.feature_set.name!r} needs packed and known of shape "
                f"(frames, {n_integers}), got {shape} and {self.known.shape}"
            )
        own = self.recording
        if not (own.rate_hz and own.n_frames):
            rate_hz = own.rate_hz or SEQUENCE_HZ
            n_frames = own.n_frames or round(len(self) / SEQUENCE_HZ * rate_hz)
            whole = replace(own, rate_hz=rate_hz, n_frames=n_frames)
            object.__setattr__(self, "recording", whole)

    def __repr__(self) -> str:
        return (
            f"FeatureSequence({self.recording.name!r}, {len(self)} frames at {SEQUENCE_HZ:g} Hz, "
            f"{len(self.feature_set)} features of {self.feature_set.name!r})"
        )

    def list_rows(self) -> Table:
        """Of each feature, in which fraction of the known frames it holds."""
        fractions, known = self.fractions().tolist(), self.known_features.sum(axis=0).tolist()
        rows = [
            (one.id, one.name, None if k == 0 else held, k / len(self) if len(self) else None)
            for one, held, k in zip(self.feature_set.features, fractions, known, strict=True)
        ]
        return Table(("id", "feature", "holds", "known"), rows)

    def to_dataframe(self) -> Any:
        """A row for each frame and a column for each feature: 0, 1, or NA where unknown.

        Returns
        -------
        pandas.DataFrame, by `time_s`

        Raises
        ------
        InvalidInput
            If pandas is not installed.
        """
        times = {"time_s": np.arange(len(self)) / SEQUENCE_HZ}
        names = self.feature_set.names
        cells = np.where(self.known_features, self.features, np.nan)
        columns = dict(zip(names, cells.T, strict=True))
        return (
            build_frame(times | columns).astype(dict.fromkeys(names, "UInt8")).set_index("time_s")
        )

    def __len__(self) -> int:
        return int(self.packed.shape[0])

    @property
    def rate_hz(self) -> float:
        """Frames of the sequence per second."""
        return SEQUENCE_HZ

    @property
    def source(self) -> str:
        """Name of the recording."""
        return self.recording.name

    @property
    def duration_s(self) -> float:
        """Length of the recording in seconds."""
        return self.recording.duration_s

    @property
    def features(self) -> NDArray[np.uint8]:
        """Features, shape (frames, features), 0/1; unknown ones are 0."""
        return unpack(self.packed, len(self.feature_set)).view(np.uint8)

    @property
    def known_features(self) -> NDArray[np.uint8]:
        """Which features are known, shape (frames, features), 0/1."""
        return unpack(self.known, len(self.feature_set)).view(np.uint8)

    def fractions(self) -> Floats:
        """Of each feature, in which fraction of its known frames it holds; NaN if in none."""
        known = self.known_features.sum(axis=0, dtype=np.float64)
        fractions = np.full(len(known), np.nan)
        held = (self.features & self.known_features).sum(axis=0)
        np.divide(held, known, out=fractions, where=known > 0)
        return fractions

    def seconds(self, frame: int) -> float:
        """Time at which a frame begins; of the end, the recording's length at most."""
        return min(frame / SEQUENCE_HZ, self.duration_s)

    def segment(self, start: int, stop: int) -> Segment:
        """The time of frames start to stop (half-open)."""
        return Segment(self.seconds(start), self.seconds(stop))

    def leading(self, feature_set: FeatureSet) -> "FeatureSequence":
        """The sequence over a set that this one begins with."""
        if self.feature_set.ids[: len(feature_set)] != feature_set.ids:
            raise InvalidInput(
                f"{self.feature_set.name!r} does not begin with the features of "
                f"{feature_set.name!r}",
                file=self.source,
            )
        mask = full_mask(1, len(feature_set))[0]
        packed, known = (each[:, : len(mask)] & mask for each in (self.packed, self.known))
        return replace(self, packed=packed, known=known, feature_set=feature_set)

    def renamed(self, name: str) -> "FeatureSequence":
        """The sequence under another name of its recording."""
        return replace(self, recording=self.recording.renamed(name))

    def part(self, start: int, stop: int) -> "FeatureSequence":
        """Frames start to stop (half-open) as a sequence; times then count from `start`."""
        if not 0 <= start < stop <= len(self):
            raise InvalidInput(
                f"a part needs 0 <= start < stop <= {len(self)} frames, got {start} to {stop}",
                file=self.source,
            )
        rate_hz = self.recording.rate_hz
        first = round(start / SEQUENCE_HZ * rate_hz)
        last = min(round(stop / SEQUENCE_HZ * rate_hz), self.recording.n_frames)
        return replace(
            self,
            packed=self.packed[start:stop],
            known=self.known[start:stop],
            recording=self.recording.part(first, last),
        )


def compute_features(
    motion: Motion | ArrayLike,
    *,
    rate_hz: float | None = None,
    skeleton: str | Sequence[str] | None = None,
    source: str = "",
    feature_set: FeatureSet = FULL_BODY,
) -> FeatureSequence:
    """Features of a motion, or of an array of joint positions.

    Parameters
    ----------
    motion : Motion, or array, shape (frames, joints, 3), metres, y up, NaN = not seen
    rate_hz : frames per second; for arrays
    skeleton : for arrays: name of a known skeleton with a usual order of joints ("smpl"),
        or the joints' names in the order of the array; left out, the array holds the 24
        generic joints in their order
    source : for arrays: name of the recording, which hits and labels then have
    feature_set : features to compute

    Returns
    -------
    FeatureSequence at 30 Hz

    Raises
    ------
    InvalidInput
        If an array comes without rate, in another shape, or its joints are unknown; if a
        motion's joints are unknown or its rate is below 1 Hz.
    """
    if not isinstance(motion, Motion):
        motion = motion_from_array(motion, rate_hz, skeleton).renamed(source)
    elif rate_hz is not None or skeleton is not None or source:
        raise InvalidInput(
            "rate_hz=, skeleton= and source= go with arrays; a Motion has its own: read(..., "
            "rate_hz=, skeleton=), motion.renamed(name) or dataclasses.replace change them"
        )
    (sequence,) = _compute_some([resample_motion(motion)], feature_set)
    return sequence


class Resampled(NamedTuple):
    """Generic joints of a motion at 120 Hz, shape (frames, 24, 3), and what else counts."""

    positions: Floats
    recording: Recording
    in_place: bool


def resample_motion(motion: Motion) -> Resampled:
    """What features of a motion are computed from; raises as `compute_features`."""
    if motion.rate_hz < _LEAST_HZ:
        raise InvalidInput(
            f"features need at least {_LEAST_HZ:g} frames per "
            f"second, got {motion.rate_hz:g}; check the rate of the recording",
            file=motion.source or "motion",
        )
    positions = resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=MEASURE_HZ)
    return Resampled(positions, motion.recording, motion.in_place)


def compute_together(
    motions: Iterable[Resampled], feature_set: FeatureSet
) -> Iterator[FeatureSequence]:
    """Features of motions, of which short ones are one array for arithmetic."""
    # glibc from then on keeps freed memory up to this size, which it would otherwise give back
    # and ask for again with each motion: a quarter of the time.
    np.empty(_KEPT_BYTES, dtype=np.uint8)
    # Quantities from elsewhere may know nothing of several recordings in one body.
    most = _FRAMES_TOGETHER if feature_set.is_of_package else 0
    some: list[Resampled] = []
    for motion in motions:
        if some and sum(len(one.positions) for one in (*some, motion)) > most:
            yield from _compute_some(some, feature_set)
            some = []
        some.append(motion)
    if some:
        yield from _compute_some(some, feature_set)


def _compute_some(motions: Sequence[Resampled], feature_set: FeatureSet) -> list[FeatureSequence]:
    body = Body.from_recordings([motion.positions for motion in motions], rate_hz=MEASURE_HZ)
    before = np.zeros(len(feature_set), dtype=np.bool_)
    features, known = switch_features(body, feature_set, before, slice(None))
    for motion, part in zip(motions, body.parts, strict=True):
        if motion.in_place:
            lost = [needs_travel(feature) for feature in feature_set.features]
            features[part, lost] = known[part, lost] = False
    frames = np.concatenate([np.arange(part.start, part.stop, _STEP) for part in body.parts])
    packed, known_bits = pack(features[frames]), pack(known[frames])
    ends = np.cumsum([-(-len(motion.positions) // _STEP) for motion in motions])[:-1]
    return [
        FeatureSequence(bits, mask, feature_set, motion.recording)
        for bits, mask, motion in zip(
            np.split(packed, ends), np.split(known_bits, ends), motions, strict=True
        )
    ]


def feature_matrix(
    positions: Floats,
    feature_set: FeatureSet,
    *,
    before: Bools | None = None,
) -> tuple[Bools, Bools]:
    """Features at 120 Hz and which of them are known.

    Parameters
    ----------
    positions : array, shape (frames, 24, 3), generic joints, metres, y up, at 120 Hz
    feature_set : features to compute
    before : array, shape (features,): features that hold before the first frame, for a
        piece of a longer recording; none if left out

    Returns
    -------
    features, known : arrays, shape (frames, features), bool; unknown features are False
    """
    n_frames, n_features = positions.shape[0], len(feature_set)
    if positions.shape[1:] != (len(GENERIC_JOINTS), 3) or n_frames == 0:
        raise InvalidInput(
            f"features need positions of shape (frames, {len(GENERIC_JOINTS)} generic joints, "
            f"3), at least one frame, got {positions.shape}"
        )
    if before is None:
        before = np.zeros(n_features, dtype=np.bool_)
    if np.shape(before) != (n_features,):
        raise InvalidInput(f"before needs one state a feature, {n_features}, got {len(before)}")
    body = Body.from_positions(positions, rate_hz=MEASURE_HZ)
    return switch_features(body, feature_set, before, slice(None))


def switch_features(
    body: Body, feature_set: FeatureSet, before: Bools, part: slice
) -> tuple[Bools, Bools]:
    """Features of a body at 120 Hz in some of its frames, and which of them are known.

    Parameters
    ----------
    before : array, shape (features,): features that hold before the first of these frames
    part : the frames; those beside them are only measured with them
    """
    n_frames = len(range(*part.indices(body.n_frames)))
    features = np.empty((len(feature_set), n_frames), dtype=np.bool_)
    known = np.empty_like(features)
    measured: tuple[object, ...] = ()
    for i, feature in enumerate(feature_set.features):
        wanted = feature.quantity, feature.joints, feature.window_s, feature.unit
        if wanted != measured:
            # Thresholds of one quantity stand side by side.
            value, measured = feature.measure(body)[part], wanted
        known[i] = ~np.isnan(value)
        strong = holds(value, feature.test, feature.strong)
        if feature.weak == feature.strong:
            features[i] = strong
            continue
        weak = holds(value, feature.test, feature.weak)
        features[i] = hysteresis(strong, weak, known[i], before=bool(before[i]), starts=body.starts)
    return features.T, known.T


def motion_from_array(
    positions: ArrayLike, rate_hz: float | None, skeleton: str | Sequence[str] | None
) -> Motion:
    """Motion of an array of positions, as `compute_features` takes it."""
    try:
        array = np.asarray(positions, dtype=np.float64)
    except (TypeError, ValueError):
        raise WrongKind(
            f"motion must be a Motion or an array of positions, got {type(positions).__name__}; "
            "files are read first, and several one after the other: "
            "[compute_features(read(path)) for path in paths]"
        ) from None
    if rate_hz is None:
        raise InvalidInput("an array of positions needs rate_hz=, its frames per second")
    if array.ndim != 3 or array.shape[2] != 3:
        raise InvalidInput(
            f"positions need shape (frames, joints, 3), got {array.shape}; of a batch, compute one "
            "recording after the other"
        )
    names, mapping = _joints_of_array(skeleton)
    if array.shape[1] != len(names):
        expected = "skeleton= names" if skeleton is not None else "without skeleton= there must be"
        raise InvalidInput(
            f"{expected} {len(names)} joints, the array has {array.shape[1]}; pass "
            "skeleton= with the names of its joints, in the order of the array"
        )
    return Motion(names, array, Recording(rate_hz=rate_hz), mapping)


def _joints_of_array(
    skeleton: str | Sequence[str] | None,
) -> tuple[tuple[str, ...], JointMapping]:
    if skeleton is None:
        return GENERIC_JOINTS, named_mapping("generic")
    if isinstance(skeleton, str):
        mapping = named_mapping(skeleton)
        if not mapping.order:
            raise InvalidInput(
                f"joints of skeleton {skeleton!r} have no usual order; pass skeleton= with "
                "their names, in the order of the array"
            )
        return mapping.order, mapping
    names = tuple(skeleton)
    found = find_mapping(names)
    if found is None:
        raise UnknownSkeleton(
            f"no known skeleton has the joints {', '.join(names[:6])}, ...; "
            f"known are {', '.join(known_mappings())}"
        )
    return names, found
