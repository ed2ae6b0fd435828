"""Sensors beside tracked motion, on simulated sensors whose truth is known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motionary.errors import InvalidInput
from motionary.inertial import (
    CalibrationSettings,
    CheckSettings,
    DetectionSettings,
    calibrate,
    calibrate_direction,
    calibrate_published,
    check_tracking,
    find_wrong,
    heading_drift,
    orient,
    synchronise,
    track_limbs,
    without_drift,
)
from motionary.inertial.limbs import (
    IDEAL,
    SensorSettings,
    integrate_rates,
    magnetic_field,
    simulate_sensor,
)
from motionary.inertial.orientations import (
    distance_deg,
    heading,
    orient_all,
    resample_orientations,
    speeds_of_turn,
    swing_twist_deg,
)
from motionary.io.sensors import SensorRecording
from motionary.rotations import (
    conjugate_quaternions,
    continuous_signs,
    multiply_quaternions,
    quaternions_to_matrices,
    quaternions_to_rotation_vectors,
    rotate,
    rotation_vectors_to_quaternions,
)
from motionary.samples import synthetic_stream

ANY = CalibrationSettings(world="any")
FUSED = CheckSettings(fused=True)


def turning(n=400, *, seed=0, size=0.06):
    """Orientations that turn smoothly about changing axes."""
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.normal(size=(n // 20 + 1, 3)) * size, 20, axis=0)[:n]
    result = np.empty((n, 4))
    result[0] = 1, 0, 0, 0
    for k in range(1, n):
        result[k] = multiply_quaternions(result[k - 1], rotation_vectors_to_quaternions(steps[k]))
    return result


def drawn_quaternion(rng):
    one = rng.normal(size=4)
    return one / np.linalg.norm(one)


def measured_from(tracked, world, mount, *, noise_deg=0.0, seed=0):
    rng = np.random.default_rng(seed)
    clean = multiply_quaternions(multiply_quaternions(world, tracked), mount)
    noise = rotation_vectors_to_quaternions(
        np.radians(noise_deg) * rng.normal(size=(len(clean), 3))
    )
    return multiply_quaternions(clean, noise)


def plain_distance(a, b):
    """(7.2) as printed."""
    return 360 / math.pi * math.acos(min(1.0, abs(sum(x * y for x, y in zip(a, b, strict=True)))))


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_distances_logs_and_parts(seed):
    rng = np.random.default_rng(seed)
    a, b = drawn_quaternion(rng), drawn_quaternion(rng)
    assert distance_deg(a, b) == pytest.approx(plain_distance(a, b), abs=1e-5)
    assert distance_deg(a, -a) == pytest.approx(0, abs=1e-9)
    tiny = multiply_quaternions(a, rotation_vectors_to_quaternions([1e-9, 0, 0]))
    assert distance_deg(a, tiny) == pytest.approx(np.degrees(1e-9), rel=1e-4)
    vector = quaternions_to_rotation_vectors(a)
    assert np.linalg.norm(vector) <= np.pi + 1e-12
    assert distance_deg(rotation_vectors_to_quaternions(vector), a) == pytest.approx(0, abs=1e-9)
    axis = np.array([0.0, 0, 1])
    twisted = multiply_quaternions(a, rotation_vectors_to_quaternions([0, 0, 0.7]))
    swing, twist = swing_twist_deg(a, twisted, axis)
    assert swing == pytest.approx(0, abs=1e-5)
    assert twist == pytest.approx(np.degrees(0.7))


def test_orientations_between_frames_lie_on_the_arc_and_gaps_stay():
    turns = rotation_vectors_to_quaternions(np.arange(6)[:, None] * [0.0, 0.2, 0.0])
    turns[3] *= -1
    turns[5] = np.nan
    found = resample_orientations(turns, np.array([0.5, 2.5, 4.0, 4.5, -1.0]))
    expected = rotation_vectors_to_quaternions(np.array([[0, 0.1, 0], [0, 0.5, 0], [0, 0.8, 0]]))
    assert distance_deg(found[:3], expected).max() < 1e-6
    assert np.isnan(found[3:]).all()
    np.testing.assert_allclose(continuous_signs(turns[:5])[3], -turns[3])


@settings(max_examples=10)
@given(st.integers(0, 1000))
def test_exact_calibrations_are_found(seed):
    rng = np.random.default_rng(seed)
    tracked = turning(seed=seed)
    world, mount = drawn_quaternion(rng), drawn_quaternion(rng)
    found = calibrate(tracked, measured_from(tracked, world, mount), ANY)
    assert distance_deg(found.world, world) < 1e-5
    assert distance_deg(found.mount, mount) < 1e-5
    assert np.nanmax(found.residual_deg) < 1e-5
    published = calibrate_published(tracked, measured_from(tracked, world, mount))
    assert distance_deg(published[0], world) < 1e-5
    assert distance_deg(published[1], mount) < 1e-5
    turned = heading(rng.uniform(0, 6))
    by_heading = calibrate(tracked, measured_from(tracked, turned, mount))
    assert distance_deg(by_heading.world, turned) < 1e-5


def test_half_of_the_frames_may_be_wrong_where_the_printed_solver_is_lost():
    ours, printed = [], []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        tracked = turning(600, seed=seed)
        world, mount = drawn_quaternion(rng), drawn_quaternion(rng)
        measured = measured_from(tracked, world, mount, noise_deg=3, seed=seed)
        wrong = tracked.copy()
        for first in rng.choice(20, 10, replace=False) * 30:
            wrong[first : first + 30] = multiply_quaternions(
                wrong[first : first + 30], drawn_quaternion(rng)
            )
        found = calibrate(wrong, measured, ANY)
        ours.append(max(distance_deg(found.world, world), distance_deg(found.mount, mount)))
        park = calibrate_published(wrong, measured)
        printed.append(max(distance_deg(park[0], world), distance_deg(park[1], mount)))
    assert np.median(ours) < 1
    assert max(ours) < 3
    assert np.median(printed) > 5


def test_what_the_motion_does_not_determine_is_refused():
    hinge = rotation_vectors_to_quaternions(np.sin(np.arange(300) / 20)[:, None] * [1.2, 0, 0])
    world, mount = heading(0.4), drawn_quaternion(np.random.default_rng(1))
    measured = measured_from(hinge, world, mount, noise_deg=2)
    assert calibrate(hinge, measured).deviation_deg < 5, "gravity tells the rest"
    with pytest.raises(InvalidInput, match="two axes"):
        calibrate(hinge, measured, ANY)
    still = np.tile([1.0, 0, 0, 0], (300, 1))
    with pytest.raises(InvalidInput, match="two axes"):
        calibrate(still, measured_from(still, world, mount, noise_deg=2))
    with pytest.raises(InvalidInput, match="at least 20 frames"):
        calibrate(hinge[:10], measured[:10])
    with pytest.raises(InvalidInput, match="unit quaternions"):
        calibrate(hinge, measured * 2)
    with pytest.raises(InvalidInput, match="as many orientations"):
        calibrate(hinge, measured[:50])
    with pytest.raises(InvalidInput, match="nothing turns"):
        calibrate_published(still, still)


def test_the_expected_error_is_that_of_repeated_calibrations():
    rng = np.random.default_rng(0)
    world, mount = drawn_quaternion(rng), drawn_quaternion(rng)
    errors, expected = [], []
    for seed in range(12):
        tracked = turning(300, seed=100 + seed, size=0.05)
        found = calibrate(
            tracked, measured_from(tracked, world, mount, noise_deg=4, seed=seed), ANY
        )
        errors.append(max(distance_deg(found.world, world), distance_deg(found.mount, mount)))
        expected.append(found.deviation_deg)
    ratio = np.sqrt(np.mean(np.square(errors))) / np.mean(expected)
    assert 0.5 < ratio < 2


def test_a_direction_is_enough_for_heading_and_axis():
    tracked = turning(400, seed=3)
    axis = np.array([0.0, 0.0, -1.0])
    mount = drawn_quaternion(np.random.default_rng(3))
    measured = measured_from(tracked, heading(1.1), mount, noise_deg=1)
    directions = rotate(tracked, np.broadcast_to(axis, (400, 3)))
    directions[100:130] = rotate(tracked[100:130], np.broadcast_to([0.8, 0, 0.6], (30, 3)))
    directions[7] = np.nan
    found = calibrate_direction(directions, measured)
    assert found.heading_rad == pytest.approx(1.1, abs=0.02)
    expected = rotate(conjugate_quaternions(mount), axis)
    assert np.degrees(np.arccos(found.axis @ expected)) < 1.5
    assert np.isnan(found.residual_deg[7])
    assert np.nanmedian(found.residual_deg) < 2
    assert np.median(found.residual_deg[100:130]) > 50
    with pytest.raises(InvalidInput, match="keeps its direction"):
        calibrate_direction(np.tile(axis, (400, 1)), measured)


def test_stretches_begin_high_and_stay_above_low():
    residual = np.zeros(200)
    residual[20:40] = 15
    residual[60:70], residual[70:75], residual[75:90] = 14, 5, 30
    residual[120:123] = 80
    residual[150:160] = np.nan
    chosen = DetectionSettings(high_deg=25, low_deg=12, min_s=0.05, max_gap_s=0.05)
    assert find_wrong(residual, 100.0, chosen) == [(60, 90)]
    assert find_wrong(residual, 100.0, DetectionSettings(min_s=0.02, max_gap_s=0.1)) == [
        (60, 90),
        (120, 123),
    ]


def test_a_slow_drift_of_heading_is_taken_out_and_a_wrong_run_is_not():
    tracked = turning(3000, seed=2)
    drift = np.linspace(0, np.radians(20), 3000)
    measured = multiply_quaternions(heading(drift), tracked)
    measured[1000:1100] = multiply_quaternions(
        measured[1000:1100], rotation_vectors_to_quaternions([0, 1.0, 0])
    )
    found = heading_drift(tracked, measured, 100.0)
    assert np.degrees(np.abs(found - drift)).max() < 1
    left = distance_deg(tracked, without_drift(measured, found))
    assert np.median(left) < 1
    assert np.median(left[1000:1100]) > 50
    assert not heading_drift(tracked[:500], measured[:500], 100.0).any(), "too short to tell"


def test_lag_and_drift_of_clocks():
    rng = np.random.default_rng(0)
    knots = np.abs(rng.normal(size=1300)) * 3
    times = np.arange(0, 120, 0.01)

    def speed(at):
        return np.interp(at * 8, np.arange(1300), knots)

    measured = [speed(times) + rng.normal(size=len(times)) * 0.1]
    tracked = [speed((times[:11000] * (1 + 150e-6)) + 0.743)]
    tracked[0][0] = 9000.0
    found = synchronise(tracked, measured, rate_hz=100.0)
    assert found.offset_s == pytest.approx(0.743, abs=0.001)
    assert found.drift == pytest.approx(150e-6, abs=1e-5)
    short = synchronise([tracked[0][:3000]], [measured[0][:4000]], rate_hz=100.0)
    assert short.offset_s == pytest.approx(0.745, abs=0.003)
    assert short.margin > 0.1
    with pytest.raises(InvalidInput):
        synchronise([np.zeros(500)], [np.zeros(500)], rate_hz=100.0)
    with pytest.raises(InvalidInput, match="at least 3 frames"):
        speeds_of_turn(turning(2), 100.0)


def test_simulated_rates_integrate_back_and_rest_reads_gravity_and_field():
    turns = turning(600, seed=4)
    read = simulate_sensor(turns, np.zeros((600, 3)), rate_hz=100.0, settings=IDEAL)
    back = integrate_rates(turns[0], read.gyr, 100.0)
    assert distance_deg(back, turns).max() < 1e-5
    np.testing.assert_allclose(np.linalg.norm(read.acc, axis=1), 9.81, atol=1e-6)
    np.testing.assert_allclose(rotate(turns, read.acc), np.tile([0, 0, 9.81], (600, 1)), atol=1e-6)
    field = rotate(turns, read.mag)
    np.testing.assert_allclose(field, np.tile(magnetic_field(IDEAL), (600, 1)), atol=1e-6)
    assert magnetic_field(IDEAL, declination_deg=10)[1] < 0, "magnetic north lies to the east"
    # As printed, in the world's axes, the rates lead elsewhere.
    printed = rotate(turns, read.gyr)
    assert np.median(distance_deg(integrate_rates(turns[0], printed, 100.0), turns)) > 20
    with pytest.raises(InvalidInput, match="at least 8"):
        simulate_sensor(turns[:4], np.zeros((4, 3)), rate_hz=100.0)


def test_simulated_noise_is_seeded_and_of_the_size_told():
    still = np.tile([1.0, 0, 0, 0], (4000, 1))
    made = SensorSettings(soft_tissue_deg=0, gyr_bias=0.0, acc_bias=0.0)
    reads = [
        simulate_sensor(still, np.zeros((4000, 3)), rate_hz=100.0, settings=made, seed=s)
        for s in (1, 1, 2)
    ]
    np.testing.assert_array_equal(reads[0].gyr, reads[1].gyr)
    assert not np.array_equal(reads[0].gyr, reads[2].gyr)
    assert reads[0].gyr.std() == pytest.approx(np.radians(0.01) * 10, rel=0.05)
    moving = simulate_sensor(still, np.zeros((4000, 3)), rate_hz=100.0, seed=1)
    away = distance_deg(still, moving.orientations)
    assert np.sqrt(np.mean(away**2)) == pytest.approx(2.0, rel=0.1)


LIMBS = {
    "pelvis sensor": "root",
    "S1": "lthigh",
    "S2": "rshank",
    "S3": "rforearm",
    "S4": "lforearm",
}


@pytest.fixture(scope="module")
def worn():
    """A synthetic stream, and simulated sensors on five limbs, 0.4 s late, at another rate."""
    names = ["squat", "kick_left", "jumping_jack", "walk", "punch_right", "spin_left"]
    motion, _ = synthetic_stream(names, seed=5, rate_hz=60.0)
    turns = track_limbs(motion)
    rng = np.random.default_rng(0)
    sensors = []
    for number, (name, limb) in enumerate(LIMBS.items()):
        n = int((motion.duration_s - 0.5) * 100)
        at = (np.arange(n) / 100 - 0.4) * 60
        limb_turns = resample_orientations(turns.turns[limb], np.clip(at, 0, motion.n_frames - 1))
        read = simulate_sensor(
            limb_turns,
            np.zeros((n, 3)),
            rate_hz=100.0,
            mount=drawn_quaternion(rng),
            settings=SensorSettings(soft_tissue_deg=1.0),
            seed=number,
        )
        world = heading(rng.uniform(0, 6))
        told = multiply_quaternions(world, read.orientations)
        sensors.append(SensorRecording(name, 100.0, read.gyr, read.acc, orientations=told))
    return motion, sensors


def test_a_check_finds_clocks_limbs_and_planted_twists(worn):
    from motionary.motion import forward_kinematics
    from motionary.rotations import quaternions_to_matrices

    motion, sensors = worn
    fused = CheckSettings(fused=True)
    clean = check_tracking(motion, sensors, settings=fused)
    assert clean.lag.offset_s == pytest.approx(0.4, abs=0.02)
    assert {one.sensor: one.limb for one in clean.limbs} == LIMBS
    assert not len(clean.track)
    assert max(np.nanmedian(one.residual_deg) for one in clean.limbs) < 3
    # The right shank is twisted by 60 degrees for a second.
    assert motion.skeleton is not None
    rotations = motion.rotations.copy()
    knee = motion.skeleton.names.index("rknee")
    stretch = slice(200, 260)
    rotations[stretch, knee] = multiply_quaternions(
        rotations[stretch, knee], rotation_vectors_to_quaternions([0, np.radians(60), 0])
    )
    twisted = replace(motion, rotations=rotations)
    assert forward_kinematics(
        motion.skeleton, quaternions_to_matrices(rotations[200:201]), np.zeros((1, 3))
    ).shape[1] == len(motion.names)
    found = check_tracking(twisted, sensors, limbs=LIMBS, settings=fused)
    (label,) = found.track
    assert label.name == "rshank off"
    assert label.extra["kind"] == "twist"
    assert label.start_s == pytest.approx(200 / 60, abs=0.1)
    assert label.end_s == pytest.approx(260 / 60, abs=0.1)
    assert (label.start_frame, label.end_frame) == pytest.approx((200, 259), abs=4)


def test_a_check_by_directions_where_a_motion_holds_no_turns(worn):

    motion, sensors = worn
    points = replace(motion, skeleton=None, rotations=None)
    legs = {"S1": "lthigh", "S2": "rshank"}
    found = check_tracking(points, sensors, limbs=legs, settings=CheckSettings(fused=True))
    by_name = {one.sensor: one for one in found.limbs}
    assert np.nanpercentile(by_name["S1"].residual_deg, 95) < 5
    assert by_name["S1"].twist_deg is None
    assert "twist is not checked" in by_name["S1"].notes[0]
    assert by_name["S3"].limb == ""


def test_what_cannot_be_checked_is_told(worn):

    motion, sensors = worn
    fused = CheckSettings(fused=True)
    still = SensorRecording("still", 100.0, orientations=np.tile([1.0, 0, 0, 0], (900, 1)))
    found = check_tracking(motion, [*sensors, still, sensors[0]], settings=fused)
    assert any("does not move" in note for note in found.notes)
    assert any("is there twice" in note for note in found.notes)
    with pytest.raises(InvalidInput, match="names a sensor 'X'"):
        check_tracking(motion, sensors, limbs={"X": "root"}, settings=fused)
    with pytest.raises(InvalidInput, match="puts S1 on 'tail'"):
        check_tracking(motion, sensors, limbs={"S1": "tail"}, settings=fused)
    with pytest.raises(InvalidInput, match="at least one"):
        check_tracking(motion, [])
    with pytest.raises(InvalidInput, match="no sensor can be compared"):
        check_tracking(motion, [still])
    with pytest.raises(InvalidInput, match="need one length, got"):
        replace(sensors[0], acc=sensors[0].acc[:50])
    brief = replace(sensors[1], gyr=None, acc=None, orientations=sensors[1].orientations[:200])
    (part,) = check_tracking(motion, [brief], limbs={"S1": "lthigh"}, settings=fused).limbs
    assert "known together in 9% of the frames" in part.notes


@pytest.mark.parametrize(
    ("misread", "reason"),
    [
        (lambda q: q * [1, -1, 1, -1], "its axes are left-handed"),
        (lambda q: q * [1, -1, -1, -1], "turns from the world to the sensor"),
        (lambda q: q[:, [1, 2, 3, 0]], "in the order xyzw"),
    ],
)
def test_orientations_that_are_misread_are_named_and_call_no_limb_wrong(worn, misread, reason):
    motion, sensors = worn
    thigh = sensors[1]
    wrong = replace(thigh, orientations=misread(thigh.orientations))
    (found,) = check_tracking(motion, [wrong], limbs={"S1": "lthigh"}, settings=FUSED).limbs
    assert reason in found.notes[0]
    assert found.wrong == []


def test_what_makes_a_check_doubtful_is_told(worn):
    motion, sensors = worn
    thigh, limbs = sensors[1], {"S1": "lthigh"}

    def notes(sensor, part=motion, settings=FUSED):
        found = check_tracking(part, [sensor], limbs=limbs, settings=settings)
        return " ".join([*found.notes, *found.limbs[0].notes])

    assert notes(thigh) == ""
    gap = thigh.orientations.copy()
    gap[100:400] = np.nan
    assert "known together in 78% of the frames" in notes(replace(thigh, orientations=gap))
    assert "below 4 s calibrations" in notes(thigh, motion.cut(0, 120))
    with pytest.raises(InvalidInput, match="at least 20 frames, got 15"):
        notes(thigh, motion.cut(0, 15))
    turned = np.tile(drawn_quaternion(np.random.default_rng(0)), (len(gap), 1))
    still = replace(thigh, orientations=turned)
    with pytest.raises(InvalidInput, match="does not move"):
        notes(still)
    slow = heading(np.radians(np.linspace(0, 50, len(gap))))
    drifting = replace(thigh, orientations=multiply_quaternions(slow, thigh.orientations))
    assert "slow turn about the vertical" in notes(drifting)


def test_fields_and_units_that_cannot_be_are_told(worn):
    pytest.importorskip("vqf")
    motion, sensors = worn
    thigh = sensors[1]
    field = rotate(
        conjugate_quaternions(thigh.orientations), np.tile([20.0, 0, -40], (len(thigh.gyr), 1))
    )
    calm, near = (
        replace(thigh, mag=field),
        replace(thigh, mag=field * np.linspace(1, 2, len(field))[:, None]),
    )
    notes = [orient_all([one], magnetic=True)[1] for one in (calm, near)]
    assert notes[0] == []
    assert "the field about S1 varies by" in notes[1][0]
    fast = replace(thigh, gyr=np.degrees(thigh.gyr), orientations=None)
    found = check_tracking(motion, [fast], limbs={"S1": "lthigh"})
    assert "times as fast as lthigh" in found.notes[0]


def test_the_rotation_nearest_to_the_scatter_is_that_of_opencv_and_of_print():
    tracked = turning(40, seed=9, size=0.1)
    rng = np.random.default_rng(9)
    world, mount = drawn_quaternion(rng), drawn_quaternion(rng)
    measured = measured_from(tracked, world, mount)
    logs = [
        quaternions_to_rotation_vectors(
            multiply_quaternions(conjugate_quaternions(one[:-7]), one[7:])
        )
        for one in (measured, tracked)
    ]
    both = logs[1].T @ logs[0]
    # (7.14) as printed: (M'M)^-1/2 M', M the scatter of the logs.
    values, vectors = np.linalg.eigh(both.T @ both)
    printed = vectors @ np.diag(values**-0.5) @ vectors.T @ both.T
    found = quaternions_to_matrices(
        conjugate_quaternions(calibrate_published(tracked, measured)[1])
    )
    np.testing.assert_allclose(printed, found, atol=1e-6)
    cv2 = pytest.importorskip("cv2")
    if not hasattr(cv2, "calibrateHandEye"):
        pytest.skip("OpenCV 5 has no calibrateHandEye")
    sensor = list(quaternions_to_matrices(measured))
    limb = list(quaternions_to_matrices(conjugate_quaternions(tracked)))
    nowhere = [np.zeros((3, 1))] * len(sensor)
    turn, _ = cv2.calibrateHandEye(sensor, nowhere, limb, nowhere, method=cv2.CALIB_HAND_EYE_PARK)
    np.testing.assert_allclose(turn, found, atol=1e-6)


def test_raw_measurements_are_fused():
    pytest.importorskip("vqf")
    turns = turning(2000, seed=6, size=0.02)
    read = simulate_sensor(turns, np.zeros((2000, 3)), rate_hz=100.0, seed=1)
    sensor = SensorRecording("S", 100.0, read.gyr, read.acc, read.mag)
    told = orient(sensor)
    fit = calibrate(read.orientations, told)
    assert np.median(fit.residual_deg) < 3
    gap = read.gyr.copy()
    gap[50:60] = np.nan
    assert np.isnan(orient(SensorRecording("S", 100.0, gap, read.acc))[50:60]).all()
    with pytest.raises(InvalidInput, match="need rates of turn"):
        orient(SensorRecording("S", 100.0, orientations=turns))


def test_a_walk_with_nine_sensors_worn_is_clean_and_all_sit_where_they_were_worn(data):
    pytest.importorskip("vqf")
    import motionary as mo
    from motionary.io.sensors import read_sensors

    worn_on = {
        "00B40B91": "root", "00B40C45": "lthigh", "00B40C3C": "rthigh", "00B40C44": "lshank",
        "00B40C47": "rshank", "00B40C55": "lfoot", "00B40C48": "rfoot", "00B40BA5": "lshank",
        "00B40C35": "rshank",
    }  # fmt: skip
    folder = data / "sensors" / "neura"
    motion = mo.read(folder / "S02-Trial-Walk-1.bvh").cut(1119, 2074)
    found = check_tracking(motion, read_sensors(folder / "imu"))
    assert found.lag.offset_s == pytest.approx(11.19, abs=0.01)
    assert {one.sensor: one.limb for one in found.limbs} == worn_on
    assert not len(found.track)
    assert max(np.nanmedian(one.residual_deg) for one in found.limbs) < 4
