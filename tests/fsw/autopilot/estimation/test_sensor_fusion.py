"""What the estimator makes of good and of bad sensors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from fsw.autopilot.estimation.error_state import BA, NO_HEADING, V
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.estimation.fusion_memory import FusionMemory, at_start
from fsw.autopilot.estimation.sensor_fusion import SensorFusion
from fsw.autopilot.estimation.sensors.base import chi_square
from fsw.autopilot.estimation.sensors.rangefinder import Rangefinder, RangefinderTuning
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.flight.estimate.estimator_report import estimator_report
from fsw.autopilot.geometry.rotation import matrix_from_quaternion, quaternion_from_matrix
from fsw.autopilot.measurements import (
    GnssSample,
    ImuSample,
    JointSample,
    PoseSample,
    PressureSample,
    RangeSample,
    Sample,
    Sensor,
)
from fsw.autopilot.signals import StateEstimate
from fsw.autopilot.tick_record import Expected
from fsw.autopilot.tuning import tuned
from tests.fsw.autopilot.estimation.sensor_runs import (
    ARM,
    MOCAP,
    RTK,
    START,
    TICK,
    VIO,
    Run,
    Suite,
    multiply,
    rotations,
    run,
)

Array = NDArray[np.float64]
Change = Callable[[float, Sample], Sample | None]


def errors(estimate: StateEstimate, flown: Run, now: float) -> Array:
    """Position, velocity and attitude, truth minus estimate (9,)."""
    truth = flown.truth
    k = truth.at(now)
    q = np.array(quaternion_from_matrix(estimate.R_WB))
    turn = multiply((q * [1.0, -1.0, -1.0, -1.0])[None], truth.q[k][None])[0]
    turn *= np.sign(turn[0])
    return np.concatenate([truth.p[k] - estimate.p_WB, truth.v[k] - estimate.v_WB, 2.0 * turn[1:]])


NOTHING_LASTS = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # m^2, rad^2


class Flown:
    """A run through the estimator; ``change`` alters or removes (None) samples."""

    def __init__(self, flown: Run, change: Change | None = None) -> None:
        self.fusion = SensorFusion(flown.suite.tuning, 2)
        self.run = flown
        self.memory: FusionMemory = at_start(2)
        self.found: set[tuple[Sensor, SensorFault]] = set()
        self.worst = 0.0  # of the position's error against its standard deviation, on one axis
        self.estimate: StateEstimate | None = None
        self.now = 0.0
        for tick, (now, samples) in enumerate(flown):
            if change is not None:
                changed = [change(now, sample) for sample in samples]
                samples = [sample for sample in changed if sample is not None]
            self.memory, self.estimate = self.fusion.step(self.memory, samples, now)
            self.now = now
            for health in self.memory.health:
                if health.fault and health.fault_at == now:
                    self.found.add((health.sensor, health.fault))
            if tick % 25 == 0 and now > START + 0.5:
                self.worst = max(self.worst, *self.in_sigmas()[:3])

    @property
    def estimate_now(self) -> StateEstimate:
        """The last one."""
        assert self.estimate is not None
        return self.estimate

    def error(self) -> Array:
        """Errors and biases now (15,)."""
        assert self.estimate is not None
        x = self.memory.numbers[0]
        return np.concatenate(
            [
                errors(self.estimate, self.run, self.now),
                self.run.accel_bias - x["bias"][:3],
                self.run.gyro_bias - x["bias"][3:],
            ]
        )

    def in_sigmas(self) -> Array:
        """Errors of position, velocity and attitude over their standard deviations (9,)."""
        assert self.estimate is not None
        sigma = np.sqrt(np.diag(self.fusion.covariance(self.memory, self.now)))[:9]
        found: Array = abs(errors(self.estimate, self.run, self.now)) / sigma
        return found


def nees(suite: Suite, runs: int, duration: float) -> float:
    """Mean of the normalised squared error of 15 states at the end of each of some runs."""
    total = 0.0
    for seed in range(runs):
        flown = Flown(run(suite, seed, duration))
        error = flown.error()
        P = flown.fusion.covariance(flown.memory, flown.now)[:15, :15]
        total += float(error @ np.linalg.solve(P, error))
    return total / runs


@pytest.mark.requirement("REQ-EST-2")
@pytest.mark.long
@pytest.mark.parametrize(
    ("suite", "duration", "runs"),
    [(MOCAP, 2.0, 100), (VIO, 3.0, 300), (RTK, 5.0, 100)],
    ids=["mocap", "vio", "rtk"],
)
def test_the_filter_is_as_sure_as_it_may_be(suite: Suite, duration: float, runs: int) -> None:
    low, high = chi2.ppf([0.025, 0.975], 15 * runs) / runs
    assert low < nees(suite, runs, duration) < high


assert VIO.pose is not None
EARLY = replace(VIO, pose=replace(VIO.pose, drift=0.02, recognises=0.6))


@pytest.mark.requirement("REQ-EST-2")
@pytest.mark.parametrize("suite", [MOCAP, EARLY], ids=["mocap", "vio"])
def test_a_few_runs_are_as_sure_as_they_may_be(suite: Suite) -> None:
    runs = 8
    low, high = chi2.ppf([0.025, 0.975], 15 * runs) / runs
    assert low < nees(suite, runs, 1.0) < high


def innovations(suite: Suite, seed: int, duration: float) -> tuple[float, int]:
    """Sum of the chi-square of all innovations after the first second, and their dimension."""
    flown = run(suite, seed, duration)
    fusion, memory = SensorFusion(suite.tuning, 2), at_start(2)
    total, dimension = 0.0, 0
    size = {Sensor.POSE: 3, Sensor.GNSS: 3, Sensor.BAROMETER: 1, Sensor.MAGNETOMETER: 1}
    gate = {n: chi_square(5.0, n) for n in (1, 3)}
    for now, samples in flown:
        before = {h.sensor: h for h in memory.health}
        memory, _ = fusion.step(memory, samples, now)
        if now < START + 1.0:
            continue
        for health in memory.health:
            old = before.get(health.sensor)
            # A sensor's ratio is a new object whenever it was fused.
            if health.ratio and (old is None or old.ratio is not health.ratio):
                n = size[health.sensor]
                total += gate[n] * sum(health.ratio)
                dimension += n * len(health.ratio)
    return total, dimension


# An offset that is not estimated makes innovations alike, and the bounds are those of innovations
# that know nothing of each other. Errors are bounded with it, above.
NO_OFFSET = replace(RTK, tuning=tuned(RTK.tuning, (("magnetometer.offset", 0.0),)))


@pytest.mark.requirement("REQ-EST-2")
@pytest.mark.long
@pytest.mark.parametrize("suite", [MOCAP, VIO, NO_OFFSET], ids=["mocap", "vio", "rtk"])
def test_innovations_are_as_large_as_expected(suite: Suite) -> None:
    found = [innovations(suite, seed, 3.0) for seed in range(100)]
    total, dimension = sum(f[0] for f in found), sum(f[1] for f in found)
    low, high = chi2.ppf([0.025, 0.975], dimension)
    assert low < total < high


def test_what_odometry_drifts_before_the_filter_starts_is_no_noise() -> None:
    assert VIO.pose is not None
    far = replace(VIO, pose=replace(VIO.pose, drift=0.02))
    frame = Flown(run(far, 0, 0.3)).memory.frame
    assert frame.place_noise == pytest.approx((VIO.pose.position**2,) * 3, rel=1e-6)
    assert frame.variance[2] == pytest.approx(0.02**2 * 0.2, rel=0.2)


def test_a_hidden_delay_of_the_pose_is_found_within_2_ms() -> None:
    tuning = tuned(MOCAP.tuning, (("pose.delay_sigma", 0.01),))
    pose = MOCAP.pose
    assert pose is not None
    suite = replace(MOCAP, tuning=tuning, pose=replace(pose, hidden_delay=0.012))
    for seed in (0, 1):
        flown = Flown(run(suite, seed, 4.0))
        assert flown.memory.numbers[0]["pose_delay"] == pytest.approx(0.012, abs=2e-3)
        assert max(flown.in_sigmas()) < 4.0


@pytest.mark.requirement("REQ-EST-1")
def test_a_filter_that_starts_from_poses_older_than_its_imu_makes_up_no_velocity() -> None:
    def reading(time: float, shake: float) -> ImuSample:
        return ImuSample(time, (0.0, shake, -9.81), (0.0, 0.0, 0.0))

    fusion, memory = SensorFusion(MOCAP.tuning, 2), at_start(2)
    level, place, noise = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -1.0), ((1e-6,) * 3, (1e-5,) * 3)
    poses = [
        PoseSample(0.784, (3e-4, 0.0, -1.0), level, *noise),
        PoseSample(0.792, place, level, *noise),
    ]
    shaken = [reading(0.956 + TICK * k, 1.5 if k == 0 else 0.0) for k in range(21)]
    joints = [JointSample(0.956 + TICK * k, (0.1, 0.2)) for k in range(21)]
    memory, _ = fusion.step(memory, [*poses, *shaken, *joints], 0.996)
    memory, estimate = fusion.step(memory, [reading(0.998, 0.0)], 0.998)
    assert estimate is not None
    assert np.linalg.norm(estimate.v_WB) < 0.01  # 0.25 with the first reading for all before it
    assert np.linalg.norm(np.subtract(estimate.p_WB, place)) < 0.002
    M = fusion.covariance(memory, 0.998)
    assert M[0, 0] > (0.5 * MOCAP.tuning.velocity * 0.2) ** 2, "and does not know how it moved"


@pytest.mark.parametrize(
    ("measured", "comes", "fault"),
    [
        (0.944, 0.998, SensorFault.NONE),  # before the filter began, with the IMU's first reading
        (0.5, 0.998, SensorFault.TOO_OLD),  # later than any receiver
        (0.957, 1.3, SensorFault.TOO_OLD),  # after it had begun
    ],
)
def test_a_fix_from_before_the_filter_began_is_no_fault(
    measured: float, comes: float, fault: SensorFault
) -> None:
    fusion, memory, still = SensorFusion(MOCAP.tuning, 2), at_start(2), (0.0, 0.0, 0.0)
    level, place, fine = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (1e-4,) * 3
    poses = [PoseSample(0.784 + x, (x, 0.0, -1.0), level, fine, fine) for x in (0.0, 0.008)]
    first = [ImuSample(0.956 + TICK * k, (0.0, 0.0, -9.81 + 1e-4 * k), still) for k in range(21)]
    memory, _ = fusion.step(memory, [*poses, *first, JointSample(0.996, ARM)], 0.996)
    assert memory.started
    for k in range(1, round((comes - 0.996) / TICK) + 1):
        now = 0.996 + TICK * k
        samples: list[Sample] = [JointSample(now, ARM), ImuSample(now, (0.0, 0.0, -9.8), still)]
        pose = PoseSample(now, (1e-3 * k, 0.0, -1.0), level, fine, fine)
        memory, _ = fusion.step(memory, [pose, *samples], now)
    fix = GnssSample(measured, place, still, fine, fine)
    health = fusion.take(memory, fix, now).of(Sensor.GNSS)
    assert health.came == now
    assert health.fault is fault


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize("bad", ["far", "upside_down", "tilted"])
def test_the_filter_does_not_start_from_a_pose_that_no_other_agrees_with(bad: str) -> None:
    lie = {"far": far, "upside_down": upside_down, "tilted": tilted}[bad]
    seen = 0

    def first_lies(now: float, sample: Sample) -> Sample:
        nonlocal seen
        if isinstance(sample, PoseSample):
            seen += 1
            return lie(sample) if seen == 1 else sample
        return sample

    flown = Flown(run(MOCAP, 3, 0.5), first_lies)
    assert flown.memory.started
    assert flown.memory.reset.number == 0
    assert max(flown.in_sigmas()) < 4.0


def at(t: float, change: Callable[[PoseSample], Sample | None], duration: float = 0.0) -> Change:
    """A change of poses that are measured within an interval after the start."""
    first, last = START + t, START + t + duration + 1.0 / 120.0

    def changed(now: float, sample: Sample) -> Sample | None:
        if isinstance(sample, PoseSample) and first <= sample.time < last:
            return change(sample)
        return sample

    return changed


def far(sample: PoseSample) -> PoseSample:
    """A place 1e6 m away."""
    return replace(sample, position=(1e6, 0.0, 0.0))


def upside_down(sample: PoseSample) -> PoseSample:
    """An attitude turned by 180 degrees."""
    w, x, y, z = sample.attitude
    return replace(sample, attitude=(-x, w, z, -y))


def tilted(sample: PoseSample) -> PoseSample:
    """An attitude turned by 11 degrees."""
    q = multiply(np.array([sample.attitude]), np.array([[math.cos(0.1), math.sin(0.1), 0.0, 0.0]]))
    return replace(sample, attitude=tuple(q[0].tolist()))


FAULTS: list[tuple[str, Change, SensorFault]] = [
    ("far away", at(1.2, far), SensorFault.IMPLAUSIBLE),
    ("upside down", at(1.2, upside_down), SensorFault.JUMP),
    ("tilted", at(1.2, tilted), SensorFault.JUMP),
    (
        "a metre aside for 0.1 s",
        at(1.2, lambda s: replace(s, position=(s.position[0] + 1.0, *s.position[1:])), 0.1),
        SensorFault.JUMP,
    ),
    (
        "10 s ahead",
        at(1.2, lambda s: replace(s, time=s.time + 10.0)),
        SensorFault.FUTURE,
    ),
    ("1 s back", at(1.2, lambda s: replace(s, time=s.time - 1.0)), SensorFault.REPEATED),
    (
        "not a number",
        at(1.2, lambda s: replace(s, attitude=(math.nan, 0.0, 0.0, 0.0))),
        SensorFault.NOT_FINITE,
    ),
    ("gone for 0.2 s", at(1.2, lambda s: None, 0.2), SensorFault.NONE),
]


@pytest.mark.drawn(4)
@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize(("name", "change", "fault"), FAULTS, ids=[fault[0] for fault in FAULTS])
def test_a_bad_pose_leaves_the_estimate_within_3_sigma(
    name: str, change: Change, fault: SensorFault
) -> None:
    good, bad = Flown(run(MOCAP, 4, 1.6)), Flown(run(MOCAP, 4, 1.6), change)
    assert good.worst < 3.0
    assert bad.worst < 3.0
    assert bad.found == good.found | ({(Sensor.POSE, fault)} if fault else set())
    # It is fused again: as sure in the end as if nothing had been.
    np.testing.assert_allclose(bad.error()[:3], good.error()[:3], atol=5e-4)


def test_a_pose_frozen_for_300_ms_leaves_the_estimate_within_3_sigma() -> None:
    held: list[PoseSample] = []

    def freeze(sample: PoseSample) -> PoseSample:
        held.append(sample)
        return replace(held[0], time=sample.time)

    flown = Flown(run(MOCAP, 5, 1.8), at(1.2, freeze, 0.3))
    assert flown.worst < 3.0
    assert (Sensor.POSE, SensorFault.STUCK) in flown.found


@pytest.mark.requirement("REQ-EST-1")
def test_a_pose_with_a_frozen_time_stamp_is_not_fused() -> None:
    held: list[PoseSample] = []

    def freeze(sample: PoseSample) -> PoseSample:
        held.append(sample)
        return held[0]

    flown = Flown(run(MOCAP, 5, 1.8), at(1.2, freeze, 0.3))
    assert flown.worst < 3.0
    assert (Sensor.POSE, SensorFault.REPEATED) in flown.found


@pytest.mark.requirement("REQ-EST-1")
def test_a_velocity_of_a_million_is_not_believed() -> None:
    def change(now: float, sample: Sample) -> Sample:
        if isinstance(sample, GnssSample) and abs(sample.time - START - 2.0) < 0.01:
            return replace(sample, velocity=(1e6, 0.0, 0.0))
        return sample

    flown = Flown(run(RTK, 1, 2.5), change)
    assert flown.worst < 4.0
    assert (Sensor.GNSS, SensorFault.IMPLAUSIBLE) in flown.found


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize(
    ("force", "rate", "fault"),
    [
        ((1e3, 0.0, 0.0), (0.0, 0.0, 0.0), SensorFault.IMPLAUSIBLE),
        ((100.0, 0.0, 0.0), (0.0, 0.0, 0.0), SensorFault.JUMP),
        ((0.0, 0.0, -9.81), (0.0, 20.0, 0.0), SensorFault.JUMP),
        ((math.nan, 0.0, 0.0), (0.0, 0.0, 0.0), SensorFault.NOT_FINITE),
    ],
)
def test_one_bad_reading_of_the_imu_is_not_integrated(
    force: tuple[float, float, float], rate: tuple[float, float, float], fault: SensorFault
) -> None:
    def change(now: float, sample: Sample) -> Sample:
        if isinstance(sample, ImuSample) and abs(now - START - 1.2) < 1e-4:
            return ImuSample(sample.time, force, rate)
        return sample

    flown = Flown(run(MOCAP, 6, 1.6), change)
    assert (Sensor.IMU, fault) in flown.found
    assert flown.worst < 3.5


@pytest.mark.requirement("REQ-EST-6")
def test_a_stuck_imu_is_found_and_the_pose_carries_on() -> None:
    held: list[ImuSample] = []

    def change(now: float, sample: Sample) -> Sample:
        if isinstance(sample, ImuSample) and 1.2 <= now - START < 2.2:
            held.append(sample)
            return replace(held[0], time=sample.time)
        return sample

    flown = Flown(run(MOCAP, 7, 3.0), change)
    assert (Sensor.IMU, SensorFault.STUCK) in flown.found
    assert abs(flown.error()[:3]).max() < 2e-3
    assert abs(flown.error()[9:12]).max() < 0.1  # the bias that was known before is taken up


def test_a_pose_that_has_moved_for_good_is_taken_and_the_jump_reported() -> None:
    def change(now: float, sample: Sample) -> Sample:
        if isinstance(sample, PoseSample) and sample.time > START + 1.0:
            x, y, z = sample.position
            return replace(sample, position=(x - 0.3, y, z))
        return sample

    flown = Flown(run(MOCAP, 8, 2.5), change)
    reset = flown.memory.reset
    assert reset.number == 1
    np.testing.assert_allclose(reset.position, (-0.3, 0.0, 0.0), atol=0.02)
    np.testing.assert_allclose(flown.error()[:3], (0.3, 0.0, 0.0), atol=5e-3)


@pytest.mark.requirement("REQ-EST-10")
@pytest.mark.parametrize("suite", [MOCAP, VIO], ids=["mocap", "vio"])
@pytest.mark.parametrize("step", [0.06, 0.15])
def test_jumps_add_up_and_are_no_motion_of_the_vehicle(suite: Suite, step: float) -> None:
    """Half of a staircase had become a velocity, and a vehicle in Hold flew against it."""

    def change(now: float, sample: Sample) -> Sample:
        if isinstance(sample, PoseSample) and sample.time > START + 1.0:
            x, y, z = sample.position
            return replace(sample, position=(x - step * (int(sample.time - START)), y, z))
        return sample

    flown, sound = Flown(run(suite, 8, 4.9), change), Flown(run(suite, 8, 4.9))
    assert flown.memory.unproven == pytest.approx((-4.0 * step, 0.0, 0.0), abs=0.05)
    assert sound.memory.unproven == (0.0, 0.0, 0.0)
    assert not flown.memory.reset.expected
    np.testing.assert_allclose(flown.error()[:3], (4.0 * step, 0.0, 0.0), atol=0.05)
    np.testing.assert_allclose(flown.error()[3:6], sound.error()[3:6], atol=0.01)
    bias, of_sound = [one.memory.numbers[0]["bias"][:3] for one in (flown, sound)]
    np.testing.assert_allclose(bias, of_sound, atol=0.05)


@pytest.mark.parametrize("until", [2.1, 4.2])
def test_a_jump_that_was_believed_and_was_none_is_undone_after_half_a_second(until: float) -> None:
    """A metre away, it would take a second again; where the filter can go back, none at all."""

    def change(now: float, sample: Sample) -> Sample:
        if isinstance(sample, PoseSample) and 1.0 < sample.time - START < until:
            x, y, z = sample.position
            return replace(sample, position=(x, y - 1.07, z))
        return sample

    flown = Flown(run(VIO, 8, until + 0.7), change)
    reset, went_back = flown.memory.reset, flown.memory.replays
    assert (reset.number, went_back) == (2, until < 3.0)
    if not went_back:
        np.testing.assert_allclose(reset.position, (0.0, 1.07, 0.0), atol=0.1)
    np.testing.assert_allclose(flown.memory.unproven, 0.0, atol=0.15)  # what it drifted meanwhile
    np.testing.assert_allclose(flown.error()[:3], 0.0, atol=0.05)


@pytest.mark.requirement("REQ-EST-10")
@pytest.mark.parametrize("gained", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("seed", [8, 9])
def test_each_jump_needs_poses_of_its_own_that_say_so(gained: float, seed: int) -> None:
    """Once a run was believed, each pose of it was: 18 jumps after a frame that ran away."""
    heard = [0.0]

    def runs_away(now: float, sample: Sample) -> Sample | None:
        if not isinstance(sample, PoseSample) or now < START:
            return sample
        if sample.time - heard[-1] < 0.12:  # seldom, so that it steps from one to the next
            return None
        heard.append(sample.time)
        x, y, z = sample.position
        lasts = max(sample.time - START - 1.0, 0.0)
        return replace(sample, position=(x, y + 0.5 * gained * lasts**2, z))

    # In 3 s: of what is off by half a metre each needs more than the 0.3 s of a short run.
    assert Flown(run(MOCAP, seed, 4.0), runs_away).memory.reset.number <= 2


@pytest.mark.requirement("REQ-EST-10")
@pytest.mark.parametrize("step", [0.3, 0.5])
@pytest.mark.parametrize("seed", [2, 3])
def test_each_jump_of_satellites_needs_fixes_of_its_own_that_say_so(step: float, seed: int) -> None:
    """A staircase, too quick for a run, behind a jump that was believed: 8 jumps followed it."""

    def climbs(now: float, sample: Sample) -> Sample:
        if not isinstance(sample, GnssSample) or sample.time < START + 1.5:
            return sample
        x, y, z = sample.position
        stairs = max((sample.time - START - 2.2) // 0.2, 0.0)
        return replace(sample, position=(x, y + 0.8 + step * stairs, z))

    reset = Flown(run(RTK, seed, 4.0), climbs).memory.reset
    assert reset.number == 1
    np.testing.assert_allclose(reset.position[:2], (0.0, 0.8), atol=0.15)


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.drawn(2)
@pytest.mark.parametrize("lasts", [0.2, 0.4, 0.6])
def test_what_poses_have_taught_is_taken_back_where_later_ones_refute_it(lasts: float) -> None:
    """A pose that froze for 0.4 s left a bias of 0.8 rad/s, and the good ones were refused."""
    kept: dict[str, PoseSample] = {}

    def freezes(now: float, sample: Sample) -> Sample:
        if not isinstance(sample, PoseSample) or not 2.5 < now - START < 2.5 + lasts:
            return sample
        last = kept.setdefault("pose", sample)
        x, y, z = last.position
        return replace(last, time=sample.time, position=(x, y, z + 1e-5 * math.sin(1e3 * now)))

    flown = Flown(run(MOCAP, 4, 4.0), freezes)
    error = flown.error()
    assert np.linalg.norm(error[:3]) < 0.01
    assert np.linalg.norm(error[3:6]) < 0.05
    assert np.linalg.norm(error[12:]) < 0.02


def test_a_frame_that_drifts_makes_the_place_uncertain_and_no_number_of_poses_helps() -> None:
    flown = Flown(run(VIO, 3, 1.9))
    sigma = np.sqrt(np.diag(flown.fusion.covariance(flown.memory, flown.now)))
    # What the poses have stated about the frame's walk, and not much more.
    assert 5e-3 * math.sqrt(1.8) < sigma[:3].min() <= sigma[:3].max() < 5e-3 * math.sqrt(2.5)
    assert flown.worst < 4.0
    still = Flown(run(replace(VIO, pose=replace(VIO.pose, drift=0.0)), 3, 1.9))  # type: ignore[type-var]
    sure = np.sqrt(np.diag(still.fusion.covariance(still.memory, still.now)))
    assert sure[:3].max() < 2e-3


def test_a_place_recognised_again_is_taken_at_once_and_reported_as_a_jump() -> None:
    """Within the gate of so uncertain a place: no reading is refused."""
    pose = replace(VIO.pose, drift=0.05, recognises=1.0, recognised=(1e-3, 1e-3))  # type: ignore[type-var]
    for seed in range(3):
        flown = Flown(run(replace(VIO, pose=pose), seed, 1.2))
        reset = flown.memory.reset
        assert reset.number == 1
        assert np.linalg.norm(reset.position) > 0.03
        assert not flown.found
        assert flown.in_sigmas().max() < 3.5
        sigma = np.sqrt(np.diag(flown.fusion.covariance(flown.memory, flown.now)))
        assert sigma[:3].max() < 0.025  # of 0.15 s, and not of 1.2 s


@pytest.mark.parametrize("suite", [MOCAP, VIO], ids=["mocap", "vio"])
@pytest.mark.parametrize("first", [0.5, 1000.0, math.inf])
def test_a_jump_that_the_sensor_announces_is_taken_once_two_poses_agree(
    suite: Suite, first: float
) -> None:
    """The ``first`` one may have jumped elsewhere [m]."""
    jumped: list[PoseSample] = []

    def change(now: float, sample: Sample) -> Sample:
        if isinstance(sample, PoseSample) and sample.time > START + 1.0:
            x, y, z = sample.position
            jumped.append(sample)
            jump = first if len(jumped) == 1 else 0.5
            return replace(sample, position=(x, y + jump, z), reset_counter=1)
        return sample

    flown = Flown(run(suite, 8, 1.3), change)
    assert flown.memory.reset.number == 1
    assert abs(flown.memory.reset.position[1]) == pytest.approx(0.5, abs=0.03)
    np.testing.assert_allclose(flown.error()[:3], (0.0, -0.5, 0.0), atol=0.03)


@pytest.mark.requirement("REQ-EST-10")
@pytest.mark.parametrize("jump", [0.02, 0.03, 0.045])
def test_a_small_jump_that_is_announced_is_taken_as_it_is_and_reported(jump: float) -> None:
    def change(now: float, sample: Sample) -> Sample:
        if isinstance(sample, PoseSample) and sample.time > START + 1.0:
            x, y, z = sample.position
            return replace(sample, position=(x, y + jump, z), reset_counter=1)
        return sample

    reset = Flown(run(MOCAP, 8, 1.2), change).memory.reset
    assert reset.number == 1
    assert reset.position[1] == pytest.approx(jump, abs=6e-3)


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize("suite", [MOCAP, VIO], ids=["mocap", "vio"])
def test_garbage_that_announces_a_jump_is_not_believed(suite: Suite) -> None:
    random = np.random.default_rng(3)

    def change(now: float, sample: Sample) -> Sample:
        if isinstance(sample, PoseSample) and sample.time > START + 1.0:
            x, y, z = random.normal(0.0, 50.0, 3).tolist()
            return replace(sample, position=(x, y, z), reset_counter=int(sample.time * 10.0))
        return sample

    flown = Flown(run(suite, 8, 1.5), change)
    assert flown.memory.reset.number == 0
    assert (Sensor.POSE, SensorFault.JUMP) in flown.found
    assert abs(flown.error()[:3]).max() < 0.3


@pytest.mark.parametrize("sigma", [0.3, 5.0])
def test_garbage_is_not_used_as_a_pose_with_much_noise(sigma: float) -> None:
    """Used so, it would hide that no position is measured, and the vehicle would wait for one."""
    random = np.random.default_rng(3)

    def change(now: float, sample: Sample) -> Sample:
        if isinstance(sample, PoseSample) and sample.time > START + 1.0:
            return replace(sample, position=tuple(random.normal(0.0, sigma, 3).tolist()))
        return sample

    flown = Flown(run(MOCAP, 8, 2.5), change)
    assert max(flown.memory.numbers[0]["noise_scale"]) < 2.0
    fused = flown.memory.of(Sensor.POSE).fused
    assert START + 2.5 - fused[0] > 0.2


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize("alike", [0.0, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("seed", [9, 10])
def test_noise_of_places_is_found_however_alike_one_is_to_the_next(alike: float, seed: int) -> None:
    """Differences from one to the next hold 1 - alike of its variance, and the rest was a fault."""
    random, sigma, noise = np.random.default_rng(seed), 3.5e-3, np.zeros(3)

    def change(now: float, sample: Sample) -> Sample:
        if not isinstance(sample, PoseSample) or sample.time < START + 1.0:
            return sample
        noise[:] = alike * noise + math.sqrt(1.0 - alike**2) * random.normal(0.0, sigma, 3)
        x, y, z = (np.array(sample.position) + noise).tolist()
        return replace(sample, position=(x, y, z))

    flown = Flown(run(MOCAP, seed, 4.0), change)
    pose = MOCAP.pose
    assert pose is not None
    found = math.sqrt(flown.memory.numbers[0]["noise_scale"][0]) * pose.position
    assert 0.3 * sigma < found < 1.5 * sigma
    assert not flown.found


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    "place",
    [
        lambda t: 0.05 * t,
        lambda t: 1.0 * t,
        lambda t: 0.15 * t * t,
        lambda t: 1.5 * t * t,
        lambda t: 0.1 * math.sin(2.0 * t),
        lambda t: 0.03 * math.sin(12.0 * t),
    ],
    ids=["drifts", "drifts fast", "gains speed", "gains it fast", "sways", "sways fast"],
)
def test_what_grows_is_no_noise(place: Callable[[float], float]) -> None:
    def change(now: float, sample: Sample) -> Sample:
        if not isinstance(sample, PoseSample) or sample.time < START + 1.0:
            return sample
        x, y, z = sample.position
        return replace(sample, position=(x + place(sample.time - START - 1.0), y, z))

    # The last one goes back within the longest lag, and some of it counts.
    assert Flown(run(MOCAP, 8, 3.0), change).memory.numbers[0]["noise_scale"][0] < 4.0


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize("seed", [8, 9])
@pytest.mark.parametrize(
    ("suite", "size", "every"),
    [(VIO, 0.06, 1.0), (VIO, 0.12, 0.8), (MOCAP, 0.06, 1.0), (MOCAP, 0.3, 1.5)],
)
def test_places_that_step_are_neither_noise_nor_a_velocity(
    suite: Suite, size: float, every: float, seed: int
) -> None:
    """Each jump that was believed was seen to go back, and made a scale of 51."""

    def change(now: float, sample: Sample) -> Sample:
        if not isinstance(sample, PoseSample) or sample.time < START + 1.0:
            return sample
        x, y, z = sample.position
        steps = 1.0 + (sample.time - START - 1.0) // every
        return replace(sample, position=(x - size * steps, y, z))

    flown = Flown(run(suite, seed, 8.0), change)
    assert flown.memory.numbers[0]["noise_by_lag"][0, 1:].max() / 12.0 < 4.0
    assert flown.memory.numbers[0]["leant_at"] == 0.0


@pytest.mark.requirement("REQ-EST-10")
@pytest.mark.parametrize("seed", [2, 3, 4])
@pytest.mark.parametrize("jump", [0.6, 1.0, 1.4])
def test_of_satellites_whose_place_jumps_a_wrong_velocity_moves_nothing(
    jump: float, seed: int
) -> None:
    """Half of it was used, the rest became a force, and the vehicle flew against both."""

    def jumps(speed: float) -> Flown:
        def change(now: float, sample: Sample) -> Sample:
            if not isinstance(sample, GnssSample) or sample.time < START + 1.5:
                return sample
            (x, y, z), (vx, vy, vz) = sample.position, sample.velocity
            return replace(sample, position=(x - jump, y, z), velocity=(vx - speed, vy, vz))

        # Until the place is believed, a second a metre.
        return Flown(run(RTK, seed, 1.5 + 0.8 * jump), change)

    sound, wrong = jumps(0.0), jumps(0.3 * jump)
    assert (Sensor.GNSS, SensorFault.JUMP) in wrong.found
    assert wrong.memory.numbers[0]["leant_at"] == 0.0
    np.testing.assert_allclose(wrong.error()[:6], sound.error()[:6], atol=0.06)


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("seed", [2, 3])
@pytest.mark.parametrize("off", [-3.0, -1.5, 2.0, 2.5, 3.0])
def test_a_force_that_is_wrong_beside_satellites_shows_in_their_next_velocities(
    off: float, seed: int
) -> None:
    """Ten a second make a step of it that stays, which counted for none: 1.7 m/s, and a wall.

    Where the magnetometer is named a wrong heading explains it as well, and forces are believed.
    """

    def change(now: float, sample: Sample) -> Sample:
        if not isinstance(sample, ImuSample) or sample.time < START + 1.5:
            return sample
        x, y, z = sample.acceleration
        return replace(sample, acceleration=(x + off, y, z))

    flown = Flown(run(RTK, seed, 2.3), change)
    assert abs(flown.error()[3:6]).max() < 0.3
    memory, fusion = at_start(2), SensorFusion(RTK.tuning, 2)
    for now, samples in run(RTK, seed, 2.3):
        memory.numbers["suspect"] = NO_HEADING
        memory, _ = fusion.step(memory, [change(now, one) for one in samples], now)
        M = memory.numbers[0]["covariance"]
        assert now < START + 1.5 or M[BA, BA] < 1.0
    assert memory.started


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize("sigma", [0.046, 0.07])
def test_noise_of_attitudes_that_begins_at_once_makes_no_bias(sigma: float) -> None:
    """Three refused poses that agreed by chance made a gyro's bias of 1.5 rad/s of 46 mrad."""
    for seed in range(8):
        random = np.random.default_rng(seed)

        def noisy(now: float, sample: Sample, random: np.random.Generator = random) -> Sample:
            if not isinstance(sample, PoseSample) or sample.time < START + 1.0:
                return sample
            turn = (1.0, *(0.5 * random.normal(0.0, sigma, 3)))
            q = multiply(np.array([sample.attitude]), np.array([turn]))[0]
            return replace(sample, attitude=tuple((q / np.linalg.norm(q)).tolist()))

        flown, fusion, memory = run(MOCAP, 8, 2.0), SensorFusion(MOCAP.tuning, 2), at_start(2)
        for now, samples in flown:
            memory, _ = fusion.step(memory, [noisy(now, one) for one in samples], now)
            assert abs(memory.numbers[0]["bias"][3:]).max() < 0.1, (seed, now - START)


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize(("suite", "sigma"), [(MOCAP, 0.01), (VIO, 0.02)])
def test_noise_of_places_that_begins_at_once_makes_no_velocity(suite: Suite, sigma: float) -> None:
    """It was up to 17 m/s off, by a bias of the accelerometer; 3.7 m/s for one that leans."""
    for seed in range(8):
        random = np.random.default_rng(seed)

        def noisy(now: float, sample: Sample, random: np.random.Generator = random) -> Sample:
            if not isinstance(sample, PoseSample) or sample.time < START + 1.0:
                return sample
            off = random.normal(0.0, sigma, 3)
            return replace(sample, position=tuple((np.array(sample.position) + off).tolist()))

        flown, fusion, memory = run(suite, 8, 3.0), SensorFusion(suite.tuning, 2), at_start(2)
        for now, samples in flown:
            memory, estimate = fusion.step(memory, [noisy(now, one) for one in samples], now)
            if estimate is not None and now > START + 1.0:
                off = np.linalg.norm(errors(estimate, flown, now)[3:6])
                assert off < 0.3, (seed, now - START)


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize("lasted", [0.1, 0.8])
def test_after_a_refused_pose_none_far_off_is_used_within_a_wide_gate(lasted: float) -> None:
    """At the end of a climb one pose of garbage tilted the estimate by 46 deg; a run is used.

    Odometry that came back from afar made a velocity of 10 m/s.
    """
    flown, fusion, memory = run(MOCAP, 8, 3.5), SensorFusion(MOCAP.tuning, 2), at_start(2)
    jumped, estimate = 0.0, None
    for now, samples in flown:
        since = now - START - 1.0
        tried = lasted < since < lasted + 0.02
        if tried:
            M = memory.numbers[0]["covariance"]
            M[[0, 1, 2], [0, 1, 2]], M[[6, 7, 8], [6, 7, 8]] = 4.0, 1.0
        heard: list[Sample] = []
        for one in samples:
            if isinstance(one, PoseSample) and 0.0 < since < 1.0:
                x, y, z = one.position
                turned = (math.cos(0.2), math.sin(0.2), 0.0, 0.0) if tried else one.attitude
                by = 0.5 if tried else 50.0
                heard.append(replace(one, position=(x + by, y, z), attitude=turned))
            else:
                heard.append(one)
        before = estimate
        memory, estimate = fusion.step(memory, heard, now)
        if before is not None and estimate is not None and 0.0 < since < 1.0:
            jumped = max(jumped, math.dist(before.p_WB, estimate.p_WB))
    assert jumped < 0.1
    assert estimate is not None
    assert estimate.p_WB == pytest.approx(flown.truth.p[flown.truth.at(now)], abs=0.02)


@pytest.mark.requirement("REQ-EST-1")
def test_what_scatters_for_long_is_not_taken_for_noise() -> None:
    """An attitude that is off by as much as that noise would be is one of garbage, too."""
    flown, fusion, memory = run(MOCAP, 8, 2.5), SensorFusion(MOCAP.tuning, 2), at_start(2)
    random, off = np.random.default_rng(3), 0.0
    for now, samples in flown:
        since = now - START - 1.0
        tried = 0.8 < since < 0.85
        if since > 0.82:  # poses are 15 ms late
            M = memory.numbers[0]["covariance"]
            M[[6, 7, 8], [6, 7, 8]] = 1.0
        heard: list[Sample] = []
        for one in samples:
            if isinstance(one, PoseSample) and 0.0 < since < 0.85:
                angle = 0.15 if tried else random.uniform(0.5, 3.0)
                turn = (math.cos(0.5 * angle), math.sin(0.5 * angle), 0.0, 0.0)
                q = multiply(np.array([one.attitude]), np.array([turn]))[0]
                one = replace(one, attitude=tuple(q.tolist()))
            heard.append(one)
        memory, estimate = fusion.step(memory, heard, now)
        if estimate is not None and 0.5 < since < 0.9:
            off = max(off, float(np.linalg.norm(errors(estimate, flown, now)[6:])))
    assert off < 0.03


@pytest.mark.parametrize("size", [2.0, 100.0])
def test_garbage_is_no_noise_and_makes_no_place_less_sure(size: float) -> None:
    """Variances had grown to a hundred times the stated, until garbage was within the gate."""
    random = np.random.default_rng(4)

    def change(now: float, sample: Sample) -> Sample:
        if isinstance(sample, GnssSample) and now > START + 1.0:
            return replace(sample, position=tuple(random.uniform(-size, size, 3).tolist()))
        return sample

    flown = Flown(run(RTK, 8, 5.0), change)
    assert flown.memory.numbers["noise_scale"][0, 2] < 2.0
    assert (Sensor.GNSS, SensorFault.JUMP) in flown.found
    assert (Sensor.GNSS, SensorFault.NOISY) not in flown.found


def test_of_noise_that_is_known_most_poses_are_used() -> None:
    """Noise that passes the gate needs no run, though the pose before it was refused."""
    random, used = np.random.default_rng(0), []

    def noisy(sample: Sample) -> Sample:
        if not isinstance(sample, PoseSample) or sample.time < START + 1.0:
            return sample
        turn = (1.0, *(0.5 * random.normal(0.0, 0.1, 3)))
        q = multiply(np.array([sample.attitude]), np.array([turn]))[0]
        return replace(sample, attitude=tuple((q / np.linalg.norm(q)).tolist()))

    flown, fusion, memory = run(MOCAP, 8, 2.5), SensorFusion(MOCAP.tuning, 2), at_start(2)
    last: tuple[float, ...] = ()
    for now, samples in flown:
        memory, _ = fusion.step(memory, [noisy(one) for one in samples], now)
        ratio = memory.of(Sensor.POSE).ratio
        if now > START + 1.5 and ratio != last:
            used.append(ratio[1] <= 1.0)
            last = ratio
    assert len(used) > 80
    assert np.mean(used) > 0.6


@pytest.mark.drawn(3)
@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("suite", [MOCAP, RTK], ids=["mocap", "rtk"])
def test_an_axis_that_repeats_itself_is_stuck_while_the_others_go_on(
    suite: Suite, axis: int
) -> None:
    held: list[Sample] = []

    def change(now: float, sample: Sample) -> Sample:
        if not isinstance(sample, PoseSample | GnssSample) or sample.time < START + 1.0:
            return sample
        held.append(sample)
        first = held[0]
        assert isinstance(first, type(sample))
        place = list(sample.position)
        place[axis] = first.position[axis]
        x, y, z = place
        if isinstance(sample, PoseSample):
            return replace(sample, position=(x, y, z))
        assert isinstance(first, GnssSample)
        velocity = list(sample.velocity)
        velocity[axis] = first.velocity[axis]
        u, v, w = velocity
        return replace(sample, position=(x, y, z), velocity=(u, v, w))

    seconds = 1.5 if suite is MOCAP else 3.0
    sensor = Sensor.POSE if suite is MOCAP else Sensor.GNSS
    assert (sensor, SensorFault.STUCK) in Flown(run(suite, 8, seconds), change).found
    assert (sensor, SensorFault.STUCK) not in Flown(run(suite, 8, seconds)).found


def test_a_tick_leaves_the_memory_it_was_given_as_it_was() -> None:
    flown = run(MOCAP, 9, 0.3)
    fusion, memory = SensorFusion(MOCAP.tuning, 2), at_start(2)
    for now, samples in flown:
        memory, _ = fusion.step(memory, samples, now)
    now, samples = now + TICK, [ImuSample(now + TICK, (0.0, 0.0, -9.0), (0.1, 0.0, 0.0))]
    _, first = fusion.step(memory, samples, now)
    _, second = fusion.step(memory, samples, now)
    assert first == second


def test_without_a_pose_there_is_no_estimate() -> None:
    flown = run(MOCAP, 9, 0.1)
    fusion, memory = SensorFusion(MOCAP.tuning, 2), at_start(2)
    for now, samples in flown:
        readings = [one for one in samples if not isinstance(one, PoseSample)]
        memory, estimate = fusion.step(memory, readings, now)
        assert estimate is None


@pytest.mark.parametrize("latency", [0.005, 0.06, 0.2])
def test_the_filter_stays_as_far_behind_as_the_pose_is_late(latency: float) -> None:
    pose = MOCAP.pose
    assert pose is not None
    flown = Flown(run(replace(MOCAP, pose=replace(pose, latency=latency)), 3, 1.0))
    assert latency <= flown.memory.delay < latency + 0.003
    assert flown.worst < 3.5
    assert not flown.found


def test_a_pose_later_than_all_delays_is_named() -> None:
    pose = MOCAP.pose
    assert pose is not None
    flown = Flown(run(replace(MOCAP, pose=replace(pose, latency=0.45)), 3, 0.8))
    assert (Sensor.POSE, SensorFault.TOO_OLD) in flown.found


@pytest.mark.parametrize(("known", "estimated"), [(0.012, 0.0), (0.0, 0.01)])
def test_the_delay_of_the_pose_can_be_set_and_estimated_from_one_tick_to_the_next(
    known: float, estimated: float
) -> None:
    """As a parameter that a ground station changes: another estimator, the same memory."""
    assert MOCAP.pose is not None
    suite = replace(MOCAP, pose=replace(MOCAP.pose, hidden_delay=0.012))
    flown = run(suite, 0, 4.0)
    before = SensorFusion(MOCAP.tuning, 2)
    tuning = tuned(MOCAP.tuning, (("pose.delay", known), ("pose.delay_sigma", estimated)))
    after, memory, estimate = SensorFusion(tuning, 2), at_start(2), None
    for now, samples in flown:
        fusion = before if now < START + 1.0 else after
        memory, estimate = fusion.step(memory, samples, now)
    assert estimate is not None
    assert memory.numbers[0]["pose_delay"] == pytest.approx(0.012, abs=2e-3)
    sigma = np.sqrt(np.diag(after.covariance(memory, now)))[:9]
    assert (abs(errors(estimate, flown, now)) / sigma).max() < 4.0


def test_a_delay_of_satellites_that_is_known_is_taken_out() -> None:
    assert RTK.gnss is not None
    late = replace(RTK, tuning=tuned(RTK.tuning, (("gnss.delay", 0.06),)))

    def stamped_late(now: float, sample: Sample) -> Sample:
        return (
            replace(sample, time=sample.time + 0.06) if isinstance(sample, GnssSample) else sample
        )

    run_as_known = Flown(replace_suite(run(RTK, 2, 3.0), late), stamped_late)
    right = Flown(run(RTK, 2, 3.0))
    np.testing.assert_allclose(run_as_known.error(), right.error(), atol=1e-6)


def replace_suite(flown: Run, suite: Suite) -> Run:
    """The same readings, for an estimator that takes its sensors for another suite."""
    return replace(flown, suite=suite)


@pytest.mark.long
def test_a_wider_gate_lets_a_farther_reading_in() -> None:
    # One that is off by little may be the IMU's fault, and nothing is said of it.
    aside = at(1.2, lambda s: replace(s, position=(s.position[0] + 0.06, *s.position[1:])))
    wide = replace(MOCAP, tuning=tuned(MOCAP.tuning, (("pose.gate", 200.0),)))
    narrow = Flown(run(MOCAP, 4, 2.0), aside)
    assert narrow.found == {(Sensor.POSE, SensorFault.JUMP)}
    assert not Flown(replace_suite(run(MOCAP, 4, 2.0), wide), aside).found


@pytest.mark.parametrize("readings", [1, 3])
def test_gates_are_as_rare_as_so_many_deviations_of_one_reading(readings: int) -> None:
    for sigmas in (1.0, 3.0, 5.0):
        assert chi2.sf(chi_square(sigmas, readings), readings) == pytest.approx(
            chi2.sf(sigmas**2, 1), rel=1e-6
        )


def test_garbage_is_never_taken_for_a_frame_that_has_moved() -> None:
    random = np.random.default_rng(5)

    def garbage(now: float, sample: Sample) -> Sample:
        if isinstance(sample, PoseSample) and now - START > 1.0:
            return replace(sample, position=tuple(random.uniform(-100.0, 100.0, 3).tolist()))
        return sample

    flown = Flown(run(MOCAP, 8, 2.2), garbage)
    assert flown.memory.reset.number == 0
    assert flown.worst < 4.0


@pytest.mark.drawn(3)
@pytest.mark.parametrize("half", ["force", "rate"])
@pytest.mark.parametrize("how", ["stuck", "garbage", "wrong"])
def test_half_an_inertial_unit_that_fails_leaves_the_place_to_the_pose(half: str, how: str) -> None:
    random = np.random.default_rng(6)
    held: list[ImuSample] = []

    def spoil(now: float, sample: Sample) -> Sample:
        if not isinstance(sample, ImuSample) or now - START < 1.0:
            return sample
        held.append(sample)
        force, rate = sample.acceleration, sample.rate
        size = 50.0 if half == "force" else 10.0
        noise = tuple(random.uniform(-size, size, 3).tolist())
        if half == "force":
            off = tuple((np.array(force) + (1.0, -1.0, 2.0)).tolist())
            said = {"stuck": held[0].acceleration, "garbage": noise, "wrong": off}[how]
            return replace(sample, acceleration=said)
        off = tuple((np.array(rate) + (0.5, -0.3, 0.2)).tolist())
        return replace(sample, rate={"stuck": held[0].rate, "garbage": noise, "wrong": off}[how])

    flown = Flown(run(MOCAP, 8, 2.5), spoil)
    assert flown.found or how == "wrong", "told; what is off is told where there are rotors"
    assert flown.memory.reset.number == 0, "the frame has not moved"
    assert abs(flown.error()[:3]).max() < 0.02
    assert abs(flown.error()[3:6]).max() < 0.3


@pytest.mark.parametrize("seed", [3, 8])
@pytest.mark.parametrize("suite", [MOCAP, VIO], ids=["mocap", "vio"])
def test_what_a_blow_changes_is_the_velocity_and_no_bias(suite: Suite, seed: int) -> None:
    # A hard touch-down: the legs stop the vehicle within a few readings, each refused as a jump.
    at, blow = START + 1.0, (60.0, 120.0, 155.0, 120.0, 60.0)
    flown = run(suite, seed, 2.0)
    stopped = sum(blow) * TICK  # m/s, up
    came: list[float] = []

    def change(now: float, sample: Sample) -> Sample:
        if isinstance(sample, ImuSample) and now > at and len(came) < len(blow):
            fx, fy, fz = sample.acceleration
            came.append(sample.time)
            return replace(sample, acceleration=(fx, fy, fz - blow[len(came) - 1]))
        if isinstance(sample, PoseSample):
            x, y, z = sample.position
            since = [
                TICK * force * max(sample.time - t, 0.0)
                for t, force in zip(came, blow, strict=False)
            ]
            return replace(sample, position=(x, y, z - sum(since)))
        return sample

    after = Flown(flown, change)
    assert (Sensor.IMU, SensorFault.JUMP) in after.found
    assert (Sensor.POSE, SensorFault.JUMP) not in after.found
    assert abs(after.error()[3:6] - (0.0, 0.0, stopped)).max() < 0.1, "but for what it leaned"
    assert abs(after.error()[9:12]).max() < 0.15


@pytest.mark.parametrize(("leap", "rate"), [(0.02, 2.5), (0.05, 2.5), (0.2, 1.3)])
def test_places_that_leap_turn_nothing_where_no_attitude_comes_with_them(
    leap: float, rate: float
) -> None:
    # Any attitude and any bias would explain them.
    def change(now: float, sample: Sample) -> Sample:
        if not isinstance(sample, PoseSample) or now - START < 1.0:
            return sample
        x, y, z = sample.position
        x += leap * (math.floor(rate * (now - START)) % 2)
        return replace(sample, position=(x, y, z), attitude_variance=(math.inf,) * 3)

    flown = Flown(run(MOCAP, 8, 4.0), change)
    assert abs(flown.error()[:3]).max() < leap + 0.01
    assert abs(flown.error()[6:9]).max() < 0.02
    assert abs(flown.error()[9:12]).max() < 0.1


def test_readings_of_the_imu_that_are_late_are_none() -> None:
    held: list[ImuSample] = []

    def late(now: float, sample: Sample) -> Sample | None:
        if isinstance(sample, ImuSample) and now - START > 1.0:
            held.append(sample)
            return held[-101] if len(held) > 100 else None
        return sample

    flown = Flown(run(MOCAP, 8, 1.4), late)
    assert (Sensor.IMU, SensorFault.TOO_OLD) in flown.found
    assert flown.memory.imu_came < START + 1.01, "as if there were none"


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize("angles", [(math.nan, 0.1), (0.1, math.nan)])
def test_one_encoder_that_says_no_number_is_not_used_and_named(
    angles: tuple[float, float],
) -> None:
    def spoilt(now: float, sample: Sample) -> Sample:
        if isinstance(sample, JointSample) and now - START > 0.5:
            return replace(sample, angles=angles)
        return sample

    flown = Flown(run(MOCAP, 8, 0.8), spoilt)
    assert flown.memory.restarts == 0
    assert (Sensor.ENCODERS, SensorFault.IMPLAUSIBLE) in flown.found
    assert flown.memory.joints_came < START + 0.51, "as if there were none"


@pytest.mark.requirement("REQ-EST-12")
def test_without_imu_and_pose_the_rate_goes_on_as_the_rotors_make_it() -> None:
    flown = Flown(run(MOCAP, 8, 0.6))
    assert flown.estimate is not None
    before, memory, now = flown.estimate, flown.memory, flown.now
    expected = Expected()
    expected.model[:] = (1.0, -2.0, 0.5, 9.9)
    for _ in range(50):  # 0.1 s
        now += TICK
        memory, estimate = flown.fusion.step(memory, (), now, expected)
    assert estimate is not None
    turned = [after - rate for after, rate in zip(estimate.w_WB_B, before.w_WB_B, strict=True)]
    assert turned == pytest.approx([0.1, -0.2, 0.05], abs=0.03)
    assert estimate.specific_force == pytest.approx(9.9, abs=0.2)
    assert not memory.of(Sensor.IMU).fault, "it is silent, and says nothing wrong"
    _, held = flown.fusion.step(flown.memory, (), now)
    assert held is not None
    assert held.w_WB_B == pytest.approx(before.w_WB_B, abs=0.03), "not known: as it was"


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-2")
@pytest.mark.parametrize("lost", [ImuSample, PoseSample])
def test_a_covariance_stays_one_after_a_sensor_was_lost_and_back_for_long(lost: type) -> None:
    """Rounding makes halves that differ, which grew until a variance was negative."""
    fusion, memory = SensorFusion(MOCAP.tuning, 2), at_start(2)
    for now, samples in run(MOCAP, 8, 20.0):
        if 1.0 < now - START < 3.0:
            samples = [one for one in samples if not isinstance(one, lost)]
        memory, _ = fusion.step(memory, samples, now)
        M = memory.numbers[0]["covariance"]
        scale = np.sqrt(np.outer(np.diag(M), np.diag(M))) + 1e-30
        # Between two measurements rounding may add up; each one makes them one again.
        assert (abs(M - M.T) / scale).max() < 1e-9
    ordered = np.linalg.eigvalsh(M / scale)
    assert ordered[0] > -1e-9


@pytest.mark.parametrize(
    ("name", "at", "value"),
    [("joints", (0, 1), math.nan), ("covariance", (1, 1), -1e-9), ("covariance", (7, 7), math.nan)],
)
def test_a_filter_without_numbers_starts_anew(name: str, at: tuple[int, int], value: float) -> None:
    flown = run(MOCAP, 8, 2.0)
    fusion, memory, estimates = SensorFusion(MOCAP.tuning, 2), at_start(2), []
    for tick, (now, samples) in enumerate(flown):
        if tick == 700:
            numbers = memory.numbers.copy()
            numbers[name][0][at] = value
            memory = replace(memory, numbers=numbers)
        memory, estimate = fusion.step(memory, samples, now)
        estimates.append(estimate)
    assert memory.restarts == 1
    assert estimates[700] is None
    missing = sum(estimate is None for estimate in estimates[700:])
    assert 0 < missing < 30
    assert estimate is not None
    assert abs(errors(estimate, flown, now)[:3]).max() < 0.01


def test_a_barometer_far_off_is_used_all_the_same_once_it_says_so_for_a_while() -> None:
    def high(now: float, sample: Sample) -> Sample:
        if isinstance(sample, PressureSample):
            return replace(sample, altitude=sample.altitude + 40.0)
        return sample

    flown = Flown(run(replace(RTK, baro=0.2), 2, 2.0), high)
    health = flown.memory.of(Sensor.BAROMETER)
    assert health.ratio[0] < 1.0
    assert flown.memory.numbers[0]["baro_bias"] == pytest.approx(40.0, abs=2.0)
    assert flown.worst < 4.0


def test_a_receiver_without_a_fix_is_named_heard_and_not_fused() -> None:
    def blind(now: float, sample: Sample) -> Sample:
        if isinstance(sample, GnssSample) and now - START > 1.5:
            return replace(sample, fix_type=1, satellites=3, position=(50.0, 0.0, -1.0))
        return sample

    flown = Flown(run(RTK, 2, 2.5), blind)
    assert (Sensor.GNSS, SensorFault.NO_FIX) in flown.found
    health = flown.memory.of(Sensor.GNSS)
    assert flown.now - health.came < 0.11
    assert flown.now - max(health.fused) > 0.8
    assert flown.memory.reset.number == 0
    report = estimator_report(
        flown.memory,
        flown.fusion.covariance(flown.memory, flown.now),
        NOTHING_LASTS,
        flown.estimate_now,
        flown.now,
        0.5,
    )
    assert report.fix is not None
    assert (report.fix.kind, report.fix.satellites) == (1, 3)
    assert report.fix.t_us >= round(1e6 * (flown.now - 0.25))


def test_a_receiver_that_falls_silent_has_no_fix_any_more() -> None:
    flown = Flown(run(RTK, 2, 1.0))
    covariance = flown.fusion.covariance(flown.memory, flown.now)

    def kind(memory: FusionMemory, stale: float) -> tuple[int, int]:
        report = estimator_report(
            memory, covariance, NOTHING_LASTS, flown.estimate_now, memory.now, stale
        )
        assert report.fix is not None
        return report.fix.kind, report.fix.satellites

    assert kind(flown.memory, 0.5) == (3, 255)
    assert kind(replace(flown.memory, now=flown.now + 0.6), 0.5) == (1, 255)


def test_satellites_that_came_once_too_seldom_do_not_confirm_each_other() -> None:
    """Two fixes of a spoofer 1 s apart; between them what is right."""
    seen: list[float] = []

    def spoofed(now: float, sample: Sample) -> Sample:
        if isinstance(sample, GnssSample) and now - START > 2.0:
            seen.append(now)
            if len(seen) % 5 == 0:
                return replace(sample, position=(50.0, 0.0, -1.0))
        return sample

    flown = Flown(run(RTK, 2, 4.0), spoofed)
    assert (Sensor.GNSS, SensorFault.JUMP) in flown.found
    assert flown.memory.reset.number == 0


@pytest.mark.parametrize(("size", "taken"), [(0.8, 1), (8.0, 0)])
def test_a_jump_is_believed_the_later_the_farther_it_is(size: float, taken: int) -> None:
    """Satellites that come twice a second, for 1.6 s after the jump: a metre takes one second."""
    seen: list[float] = []

    def seldom_and_moved(now: float, sample: Sample) -> Sample | None:
        if not isinstance(sample, GnssSample):
            return sample
        if seen and sample.time - seen[-1] < 0.49:
            return None
        seen.append(sample.time)
        x, y, z = sample.position
        return replace(sample, position=(x, y + size, z)) if now - START > 2.0 else sample

    flown = Flown(run(RTK, 2, 3.6), seldom_and_moved)
    assert flown.memory.reset.number == taken
    np.testing.assert_allclose(flown.memory.reset.position[:2], (0.0, taken * size), atol=0.3)


@pytest.mark.requirement("REQ-EST-10")
def test_a_rangefinder_makes_no_velocity_of_a_jump_that_nobody_confirms() -> None:
    """A frame that rises by 0.2 m, and a velocity that is not known any more: the two disagree."""
    rangefinder = Rangefinder(RangefinderTuning(ground=4.0))
    landed = Flown(run(VIO, 8, 1.0)).memory

    def velocity_made(jumped: float) -> float:
        memory = replace(landed, numbers=landed.numbers.copy(), unproven=(0.0, 0.0, jumped))
        x = memory.numbers[0]
        x["covariance"][V : V + 3, V : V + 3] += 0.25 * np.eye(3)
        down = matrix_from_quaternion(tuple(x["q"].tolist()))[8]
        before = float(x["v"][2])
        for k in range(1, 8):
            distance = (4.0 - float(x["p"][2])) / down + 0.2
            sample = RangeSample(float(x["time"]) + 0.02 * k, distance, 1e-4)
            rangefinder.fuse(memory, sample, half=False)
        return abs(float(x["v"][2]) - before)

    made, kept = velocity_made(0.0), velocity_made(-0.2)
    assert made > 0.25
    assert kept < 0.6 * made


def in_sigmas_beside_a_long_rangefinder(tuning: EstimatorTuning, seed: int) -> float:
    """Largest error of roll and pitch over its deviation, with ranges 2 % too long."""
    flown = run(replace(RTK, tuning=tuning), seed, 4.0)
    random, due = np.random.default_rng(seed), START
    for now, samples in flown.ticks:
        if now >= due:
            k = flown.truth.at(now)
            down = rotations(flown.truth.q[k][None])[0][2, 2]
            distance = 1.02 * (tuning.rangefinder.ground - flown.truth.p[k, 2]) / down
            read = distance + 0.025 * random.standard_normal()
            samples.append(RangeSample(now, float(read), 0.025**2))
            due += 0.02
    return float(Flown(flown).in_sigmas()[6:8].max())


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-2")
def test_a_rangefinder_that_is_wrong_in_proportion_does_not_tilt_the_estimate() -> None:
    tuning = tuned(RTK.tuning, (("rangefinder.ground", 4.0),))
    assert max(in_sigmas_beside_a_long_rangefinder(tuning, seed) for seed in range(4)) < 3.0
    blind = tuned(tuning, (("rangefinder.share", 0.0),))
    assert max(in_sigmas_beside_a_long_rangefinder(blind, seed) for seed in range(4)) < 3.0
