"""A tracked motion held against inertial sensors: clocks, places, calibration, and what is wrong.

After Baak (2012), chapter 7, from raw sensors, without a calibration pose and without a map: whose
clock is how late, which sensor sits on which limb, how its world and mount lie, where limb and
sensor disagree.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.inertial.calibration import (
    CalibrationSettings,
    calibrate_direction,
    match_limb,
)
from motionary.inertial.detection import (
    OF_DIRECTIONS,
    DetectionSettings,
    calibrate_drifting,
    doubt,
    find_wrong,
    name_misreading,
)
from motionary.inertial.limbs import TrackedLimbs, compare_speeds, track_limbs
from motionary.inertial.orientations import (
    Lag,
    correlate,
    orient_all,
    peak_of,
    resample_orientations,
    speeds_of_turn,
    swing_twist_deg,
    synchronise,
)
from motionary.io.sensors import SensorRecording
from motionary.labels import LabelTrack, label_frames
from motionary.motion import Motion
from motionary.rotations import conjugate_quaternions, multiply_quaternions

Floats = NDArray[np.float64]

_MOST_LAG_S = 15.0
# Limbs whose rates are nearly as much like a sensor's as the best one's; a rough calibration
# decides among them.
_NEARLY = 0.35
_UNSURE_PEAK = 0.5
# Frames below which nothing is calibrated, and seconds below which it is doubted.
_LEAST, _SHORT_S = 20, 4.0
# So many times worse must the next best limb fit; and a limb that a map tells to be doubted.
_SURE, _EXCHANGED = 1.3, 2.0
_NO_LIMB = "fits no limb, or the map names none for it"
_DIRECTION_ONLY = "only the direction is tracked: twist is not checked"
_UNSURE_LIMB = "the next best limb fits nearly as well: give a map; nothing is called wrong here"
# Between limbs that fit alike: nobody wears a sensor on the belly if one is on the pelvis.
_USUAL = ("root", "chest", "head")


@dataclass(frozen=True, slots=True)
class CheckSettings:
    """How a motion is held against sensors.

    Attributes
    ----------
    fused : take orientations that the file brings instead of fusing raw measurements
    magnetic : let the magnetometer tell headings
    calibration, detection, of_directions : see there; the last for limbs without turns
    """

    fused: bool = False
    magnetic: bool = False
    calibration: CalibrationSettings = field(default_factory=CalibrationSettings)
    detection: DetectionSettings = field(default_factory=DetectionSettings)
    of_directions: DetectionSettings = OF_DIRECTIONS


class LimbCheck(NamedTuple):
    """What one sensor says of the limb that it sits on.

    Attributes
    ----------
    sensor, limb : names; the limb is empty if the sensor fits none
    residual_deg : array, shape (frames of the motion,); NaN where one is not known
    swing_deg, twist_deg : the same across and about the limb; None where only directions are
        tracked
    heading_deg : of the sensor's world against the tracker's
    deviation_deg : expected error of the calibration; NaN if not to be had
    drift_deg : largest drift of the heading that was taken out
    margin : residual of the next best limb over this one's; NaN where a map told the limb
    wrong : segments of frames, first and one past the last
    notes : what makes it doubtful
    """

    sensor: str
    limb: str
    residual_deg: Floats
    swing_deg: Floats | None
    twist_deg: Floats | None
    heading_deg: float
    deviation_deg: float
    drift_deg: float
    margin: float
    wrong: list[tuple[int, int]]
    notes: tuple[str, ...]


class TrackingCheck(NamedTuple):
    """A motion held against its sensors.

    Attributes
    ----------
    limbs : one for each sensor, by name
    lag : of the sensors' clock behind the motion's
    track : the segments that are wrong, as labels of the motion
    notes : what was noticed of all
    """

    limbs: list[LimbCheck]
    lag: Lag
    track: LabelTrack
    notes: tuple[str, ...]


def check_tracking(
    motion: Motion,
    sensors: Sequence[SensorRecording],
    *,
    limbs: Mapping[str, str] | None = None,
    settings: CheckSettings | None = None,
) -> TrackingCheck:
    """Where a motion is tracked wrongly, by the sensors that were worn.

    Parameters
    ----------
    motion : as tracked
    sensors : of one system, whose clocks agree
    limbs : limb of each sensor by name; found if None
    settings : see there

    Raises
    ------
    InvalidInput
        If a name is unknown, or no sensor can be compared.
    UnknownSkeleton, NotHuman
        If the motion's joints are not known.
    """
    settings = settings or CheckSettings()
    if not sensors:
        raise InvalidInput("a check needs at least one sensor")
    if motion.n_frames < _LEAST:
        raise InvalidInput(f"a check needs at least {_LEAST} frames, got {motion.n_frames}")
    tracked = track_limbs(motion)
    measured, problems = orient_all(sensors, fused=settings.fused, magnetic=settings.magnetic)
    if not measured:
        raise InvalidInput(f"no sensor can be compared: {problems[0]}")
    given = _checked_limbs(limbs, measured, tracked) if limbs is not None else None
    lag, likely = _find_lag(tracked, measured, sensors, given)
    times = np.arange(motion.n_frames) / motion.rate_hz
    rates = {sensor.name: sensor.rate_hz for sensor in sensors}
    seen = {
        name: resample_orientations(turns, lag.sensor_times(times) * rates[name])
        for name, turns in measured.items()
    }
    placed: dict[str, str] = given or {}
    margins: dict[str, float] = {}
    if given is None:
        placed, margins = _place(tracked, seen, likely)
    checks = []
    for name in sorted(seen):
        limb = placed.get(name, "")
        checks.append(
            _check_limb(name, limb, tracked, seen[name], margins.get(name, np.nan), settings)
        )
    if given is not None:
        checks = [_name_exchanged(one, tracked, seen) for one in checks]
    notes = [*problems, *compare_speeds(tracked, seen, placed)]
    if motion.duration_s < _SHORT_S:
        notes.append(
            f"the motion is {motion.duration_s:.1f} s long: below {_SHORT_S:.0f} s calibrations "
            "are several degrees less sure than is told"
        )
    if lag.peak < _UNSURE_PEAK:
        notes.append(
            f"rates of turn agree by {lag.peak:.2f} only: the lag of {lag.offset_s:.2f} s is unsure"
        )
    return TrackingCheck(checks, lag, _to_track(motion, checks), tuple(notes))


def _name_exchanged(
    check: LimbCheck, tracked: TrackedLimbs, seen: Mapping[str, Floats]
) -> LimbCheck:
    """The check, with a note if a map puts the sensor where it fits far worse than elsewhere."""
    if not check.wrong:
        return check
    costs = _residuals(tracked, tracked.limbs, seen[check.sensor])
    best = min(costs, key=lambda limb: costs[limb])
    if costs[check.limb] <= _EXCHANGED * costs[best]:
        return check
    return check._replace(notes=(f"fits {best} much better: is the map right?", *check.notes))


def _checked_limbs(
    limbs: Mapping[str, str], measured: Mapping[str, Floats], tracked: TrackedLimbs
) -> dict[str, str]:
    for name, limb in limbs.items():
        if name not in measured:
            raise InvalidInput(
                f"the map names a sensor {name!r}; there are {', '.join(sorted(measured))}"
            )
        if limb not in tracked.limbs:
            known = ", ".join(tracked.limbs)
            raise InvalidInput(f"the map puts {name} on {limb!r}; the motion has {known}")
    return dict(limbs)


def _find_lag(
    tracked: TrackedLimbs,
    measured: Mapping[str, Floats],
    sensors: Sequence[SensorRecording],
    limbs: Mapping[str, str] | None,
) -> tuple[Lag, dict[str, list[str]]]:
    """The common lag, and the limbs whose rates are most like each sensor's at it."""
    rates = {sensor.name: sensor.rate_hz for sensor in sensors}
    rate = tracked.rate_hz
    speeds = {limb: tracked.speeds(limb) for limb in tracked.limbs}
    own = {}
    for name, turns in measured.items():
        fast = speeds_of_turn(turns, rates[name])
        at = np.arange(int(len(fast) / rates[name] * rate)) * rates[name] / rate
        own[name] = np.interp(at, np.arange(len(fast)), fast)
    n_most = round(_MOST_LAG_S * rate)
    curves = {
        name: {
            limb: correlate(speeds[limb], one, n_most)
            for limb in ([limbs[name]] if limbs and name in limbs else speeds)
        }
        for name, one in own.items()
        if not limbs or name in limbs
    }
    best = np.mean([np.max(list(of.values()), axis=0) for of in curves.values()], axis=0)
    offset_s, _, _ = peak_of(best, n_most, rate)
    peak = round(offset_s * rate) + n_most
    likely = {
        name: [
            limb
            for limb in sorted(of, key=lambda limb: -float(of[limb][peak]))
            if of[limb][peak] > max(float(one[peak]) for one in of.values()) - _NEARLY
        ]
        for name, of in curves.items()
    }
    pairs = [(speeds[likely[name][0]], own[name]) for name in likely]
    lag = synchronise(
        [a for a, _ in pairs], [b for _, b in pairs], rate_hz=rate, most_s=_MOST_LAG_S
    )
    return lag, likely


def _place(
    tracked: TrackedLimbs,
    seen: Mapping[str, Floats],
    likely: Mapping[str, list[str]],
) -> tuple[dict[str, str], dict[str, float]]:
    """Which limb each sensor sits on: the smallest residuals; several may share a limb.

    The margin is the residual on the next best limb over that on the chosen one.
    """
    placed, margins = {}, {}
    for name, limbs in likely.items():
        costs = _residuals(tracked, limbs, seen[name])
        if not costs:
            continue
        least = min(costs.values())
        # Neighbours of the trunk turn alike: then where sensors are usually worn.
        close = [limb for limb in costs if costs[limb] < 1.1 * least + 0.1]
        chosen = min(
            close, key=lambda limb: (_USUAL.index(limb) if limb in _USUAL else 9, costs[limb])
        )
        placed[name] = chosen
        others = [cost for limb, cost in costs.items() if limb != chosen]
        margins[name] = min(others, default=np.nan) / max(costs[chosen], 0.1)
    return placed, margins


def _residuals(tracked: TrackedLimbs, limbs: Sequence[str], measured: Floats) -> dict[str, float]:
    """How badly a sensor fits each of some limbs, degrees; without those that do not tell."""
    costs = {}
    for limb in limbs:
        try:
            if limb in tracked.turns:
                costs[limb] = match_limb(tracked.turns[limb], measured)
            else:
                away = calibrate_direction(tracked.directions[limb], measured).residual_deg
                costs[limb] = float(np.sqrt(np.nanmean(np.minimum(away, 45.0) ** 2)))
        except InvalidInput:
            continue
    return costs


def _check_limb(
    name: str,
    limb: str,
    tracked: TrackedLimbs,
    measured: Floats,
    margin: float,
    settings: CheckSettings,
) -> LimbCheck:
    nothing = np.full(len(measured), np.nan)
    check = LimbCheck(name, limb, nothing, None, None, np.nan, np.nan, 0.0, margin, [], (_NO_LIMB,))
    try:
        if limb in tracked.turns:
            return _check_turns(check, tracked, measured, settings)
        return _check_direction(check, tracked, measured, settings) if limb else check
    except InvalidInput as error:
        return check._replace(notes=(str(error),))


def _check_turns(
    check: LimbCheck, tracked: TrackedLimbs, measured: Floats, settings: CheckSettings
) -> LimbCheck:
    turns = tracked.turns[check.limb]
    found, steadied, drift = calibrate_drifting(
        turns, measured, tracked.rate_hz, settings.calibration
    )
    told = multiply_quaternions(
        multiply_quaternions(conjugate_quaternions(found.world), steadied),
        conjugate_quaternions(found.mount),
    )
    swing, twist = swing_twist_deg(turns, told, tracked.axes[check.limb])
    wrong, notes = _judge(found.residual_deg, check.margin, tracked.rate_hz, settings.detection)
    drift_deg = float(np.degrees(np.abs(drift - np.median(drift))).max())
    notes += doubt(found.residual_deg, drift_deg)
    # Only what disagrees can be misread.
    if wrong and (misread := name_misreading(turns, measured)):
        wrong, notes = [], (misread, *notes)
    return check._replace(
        residual_deg=found.residual_deg,
        swing_deg=swing,
        twist_deg=twist,
        heading_deg=float(np.degrees(2 * np.arctan2(found.world[3], found.world[0])) % 360),
        deviation_deg=found.deviation_deg,
        drift_deg=drift_deg,
        wrong=wrong,
        notes=(*found.notes, *notes),
    )


def _check_direction(
    check: LimbCheck, tracked: TrackedLimbs, measured: Floats, settings: CheckSettings
) -> LimbCheck:
    found = calibrate_direction(tracked.directions[check.limb], measured)
    residual = found.residual_deg
    wrong, notes = _judge(residual, check.margin, tracked.rate_hz, settings.of_directions)
    return check._replace(
        residual_deg=residual,
        heading_deg=float(np.degrees(found.heading_rad) % 360),
        wrong=wrong,
        notes=(_DIRECTION_ONLY, *notes, *doubt(residual)),
    )


def _judge(
    residual_deg: Floats, margin: float, rate_hz: float, detection: DetectionSettings
) -> tuple[list[tuple[int, int]], tuple[str, ...]]:
    """What is wrong, and why nothing is called so where the limb itself is unsure."""
    # The margin is NaN, and no limb unsure, where a map told the limb.
    if margin < _SURE:
        return [], (_UNSURE_LIMB,)
    return find_wrong(residual_deg, rate_hz, detection), ()


def _to_track(motion: Motion, checks: Sequence[LimbCheck]) -> LabelTrack:
    """The segments as labels: the limb is wrong, by how much, and in which way."""
    labels = []
    for check in checks:
        for first, stop in check.wrong:
            worst = float(np.nanmax(check.residual_deg[first:stop]))
            kind = "direction"
            if check.swing_deg is not None and check.twist_deg is not None:
                swing = np.nanmedian(check.swing_deg[first:stop])
                kind = "direction" if swing > np.nanmedian(check.twist_deg[first:stop]) else "twist"
            extra = {"sensor": check.sensor, "worst_deg": f"{worst:.0f}", "kind": kind}
            labels.append(label_frames(motion.recording, f"{check.limb} off", first, stop, extra))
    return LabelTrack(motion.recording, tuple(labels))
