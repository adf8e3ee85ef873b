"""Who is heard, and what suspicion does to a filter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from fsw.autopilot.estimation.error_state import BG, IMU_CAPACITY, LOST, NO_RATE
from fsw.autopilot.estimation.faults import residuals
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.estimation.faults.sources import NOBODY, Source
from fsw.autopilot.estimation.fusion_memory import FusionMemory, at_start
from fsw.autopilot.estimation.sensor_fusion import SensorFusion
from fsw.autopilot.estimation.sensors.base import attitude_of
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.geometry.quaternion import turned
from fsw.autopilot.measurements import ImuSample, JointSample, PoseSample, Sample, Sensor
from fsw.autopilot.signals import Vec3, Vec4
from fsw.autopilot.tick_record import Expected
from fsw.frozen import replace

FUSION = SensorFusion(EstimatorTuning(), 2)
HOVERS = Expected()  # what rotors make of it
HOVERS.model[3] = 9.81
STANDS = Expected()  # it does not fly
TICK = 0.002
POSES_UNTIL, WRONG_FROM = 3.0, 4.0  # s
LEVEL: Vec4 = (1.0, 0.0, 0.0, 0.0)
FINE: Vec3 = (1e-6, 1e-6, 1e-6)


def hovering(
    *,
    turns: float = 0.0,
    angle: float = 0.0,
    poses: bool = True,
    until: float = math.inf,
    garbage: bool = False,
    damaged: bool = False,
    touches: bool = False,
    turned_by: Callable[[float], Vec3] | None = None,
    moved_by: float = 0.0,
    pushed_by: float = 0.0,
    apart: int = 5,
    gust: float = 0.0,
    unit: bool = True,
    outliers: int = 1 << 30,
) -> Iterator[FusionMemory]:
    """The memories of 5 s.

    In the last second the gyro says that the vehicle ``turns`` [rad/s] about its vertical, and
    encoders jump by an ``angle`` [rad] and back; there may have been no ``poses`` for a second, or
    ``garbage`` in their place, and they may last ``until`` [s] only; a part of the vehicle may be
    known to be ``damaged``, and its tool ``touches`` something. Poses may be ``turned_by`` an angle
    [rad, FRD] at each time [s] of that second, and ``moved_by`` so much [m]; the accelerometer is
    ``pushed_by`` so much [m/s^2]. Poses are so many ticks ``apart``. A ``gust`` [m/s^2] carries the
    vehicle away; it may have had no inertial ``unit`` since poses have been good for 3 s. One pose
    in so many ticks is one of the ``outliers``, 0.3 m off.
    """
    memory, random = at_start(2), np.random.default_rng(3)
    for tick in range(round(5.0 / TICK)):
        t, now = TICK * tick, 1.0 + TICK * tick
        wrong = t > WRONG_FROM
        a, b, c, d, e, f = random.standard_normal(6).tolist()
        shakes = 1e-3 * a, 1e-3 * b, 1e-3 * c
        rate = *shakes[:2], shakes[2] + (turns if wrong else 0.0)
        reading = (angle if wrong else 1e-5) * (tick % 2)
        pushed = pushed_by + gust if wrong else 0.0
        samples: list[Sample] = [JointSample(now, (reading, 0.0))]
        if unit or t < POSES_UNTIL:
            felt = 0.02 * d + pushed, 0.02 * e, -9.81 + 0.02 * f
            samples.append(ImuSample(now, felt, rate))
        good = t < (until if poses else POSES_UNTIL)
        if tick % apart == 0 and (good or garbage):
            scatter = 1e-3 if good else 20.0
            carried = 0.5 * gust * max(t - WRONG_FROM, 0.0) ** 2
            place = scatter * d + carried, scatter * e, -1.5 + scatter * f
            attitude = turned(LEVEL, *shakes)
            if wrong and turned_by is not None:
                attitude = turned(attitude, *turned_by(t - WRONG_FROM))
                place = place[0] + moved_by, *place[1:]
            if tick % outliers == outliers - apart:
                place = place[0], place[1] + 0.3, place[2]
            samples.insert(0, PoseSample(now, place, attitude, FINE, FINE))
        memory, found = FUSION.take_in(memory, samples, now, HOVERS)
        memory, _ = FUSION.catch_up(memory, samples, found, damaged=damaged, touches=touches)
        yield memory


def hovered(
    *, turns: float = 0.0, angle: float = 0.0, poses: bool = True, garbage: bool = False
) -> tuple[FusionMemory, Source]:
    """The last memory of ``hovering``, and all who were suspects."""
    accused = NOBODY
    for memory in hovering(turns=turns, angle=angle, poses=poses, garbage=garbage):
        accused |= memory.verdict.suspects
    return memory, accused


def of_no_use(memory: FusionMemory) -> Source:
    evidence = memory.verdict.evidence
    assert evidence is not None
    return residuals.note_silence(evidence, NOBODY, memory.now)


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("garbage", [False, True])
def test_a_gyro_is_not_doubted_where_nothing_measured_could_find_its_bias(garbage: bool) -> None:
    """Suspicion alone ended a flight whose tilt was known to 0.1 deg, because its sigma grew."""
    memory, accused = hovered(turns=0.3, poses=False, garbage=garbage)
    assert accused & Source.GYRO
    M = memory.numbers[0]["covariance"]
    assert max(math.sqrt(M[BG + k, BG + k]) for k in range(3)) < 0.25


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("turns", [0.25, 0.4])
def test_a_bias_is_as_unknown_as_residuals_are_large(turns: float) -> None:
    """Taken for 0.5 rad/s whatever was seen, sound gyros of vehicles with satellites tilted them.

    What is known of it from before is kept, and taken up when the trial is over.
    """
    before, all_memories = at_start(2), hovering(turns=turns)
    for memory in all_memories:
        if memory.verdict.suspects & Source.GYRO:
            break
        before = memory
    assert 0.3 * turns < memory.verdict.unknown[1] < 1.3 * turns
    x = memory.numbers[0]
    assert x["lost"] & NO_RATE
    assert x["kept_bias"][3:] == pytest.approx(before.numbers[0]["bias"][3:], abs=1e-4)
    waiting = np.arange(x["first"], x["end"]) % IMU_CAPACITY
    assert all(int(lost) & NO_RATE for lost in x["imu"][waiting, LOST])


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("push", [True, False])
def test_a_doubted_bias_that_nothing_finds_any_more_is_what_it_was_unless_it_is_another(
    push: bool,
) -> None:
    """A rotor was weak for a moment, and then no pose came: the noise in it tilted the vehicle."""
    turns = 0.25 if push else 0.17
    turned_by = (lambda t: (0.0, 0.0, turns * t)) if push else None
    memory = last(hovering(turns=turns, turned_by=turned_by, until=4.4))
    assert memory.verdict.suspects & Source.GYRO
    x = memory.numbers[0]
    assert abs(x["bias"][5]) < 0.002 if push else x["bias"][5] > 0.1


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("touches", [False, True])
def test_what_turns_a_vehicle_whose_tool_touches_something_is_nobody_s_fault(touches: bool) -> None:
    """Gyro and poses say the same, and the rotors' model does not know of it."""

    def turned_by(since: float) -> Vec3:
        return 0.0, 0.0, 0.4 * since

    memories = hovering(turns=0.4, turned_by=turned_by, touches=touches)
    assert any(memory.verdict.is_on for memory in memories) is not touches


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("agrees", [False, True])
def test_beside_a_rotor_that_has_failed_a_gyro_is_a_suspect_only_where_the_pose_says_so(
    agrees: bool,
) -> None:
    suspects, angle = NOBODY, 0.3 if agrees else 0.0
    turned_by = lambda t: (0.0, 0.0, angle * t)  # noqa: E731
    for memory in hovering(turns=0.3, damaged=True, turned_by=turned_by):
        suspects |= memory.verdict.suspects
    assert bool(suspects & Source.GYRO) is not agrees


@pytest.mark.requirement("REQ-EST-13")
def test_doubts_do_not_end_with_a_descent_but_where_the_rotors_stand() -> None:
    """Near the ground a gyro that had drifted was taken for the one from before: 40 deg of tilt."""
    for memory in hovering(turns=0.3):
        if memory.verdict.suspects & Source.GYRO:
            break
    began, now, suspect = memory.verdict.since, memory.now, int(memory.numbers["suspect"][0])
    # The ground that is felt leaves the rotors' model unknown, as it is where they stand.
    for expected, flies in ((HOVERS, True), (STANDS, True), (STANDS, True), (STANDS, False)):
        for _ in range(round(residuals.EVERY / TICK) + 1):  # the next look is among them
            now += TICK
            samples: list[Sample] = [
                JointSample(now, (1e-3 * (now % 0.1), 0.0)),
                ImuSample(
                    now, (0.0, 0.0, -9.81 + 1e-3 * (now % 0.1)), (1e-4 * (now % 0.3), 0, 0.3)
                ),
            ]
            memory, found = FUSION.take_in(memory, samples, now, expected)
            how = {"aloft": lambda: False, "flies": flies}
            memory, _ = FUSION.catch_up(memory, samples, found, **how)
        assert memory.verdict.since == (began if flies else -1.0)
        assert int(memory.numbers["suspect"][0]) == (suspect if flies else 0)


@pytest.mark.requirement("REQ-EST-13")
def test_rotors_are_no_witness_while_nobody_knows_how_the_arm_moves() -> None:
    memory, accused = hovered()
    assert (accused, of_no_use(memory)) == (NOBODY, NOBODY)
    memory, _ = hovered(angle=0.5)
    assert of_no_use(memory) == Source.MODEL


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("source", [Source.POSE, Source.GYRO | Source.COMPASS])
def test_what_was_named_in_flight_is_believed_again_after_five_seconds_on_the_ground(
    source: Source,
) -> None:
    """Nobody compares it there: it would be out until the vehicle is started anew."""
    memory, _ = hovered()
    agreed = tuple([math.inf if one & source else -math.inf for one in Source])
    memory = replace(memory, verdict=memory.verdict._replace(wrong=source, agreed=agreed))
    memory.numbers["out"] = NO_RATE if source & Source.GYRO else 0
    began, now = memory.now, memory.now
    while memory.verdict.wrong:
        now += TICK
        samples: list[Sample] = [
            JointSample(now, (0.0, 0.0)),
            ImuSample(now, (0.0, 0.0, -9.81 + 1e-3 * (now % 0.1)), (1e-4 * (now % 0.3), 0.0, 0.0)),
        ]
        memory, found = FUSION.take_in(memory, samples, now)
        memory, _ = FUSION.catch_up(memory, samples, found, aloft=lambda: False)
        assert now - began < 5.1
    assert now - began > 4.9
    assert memory.numbers[0]["out"] == 0


def last(memories: Iterator[FusionMemory]) -> FusionMemory:
    *_, memory = memories
    return memory


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("rate", [(0.8, 0.0, 0.0), (0.0, -2.0, 0.0), (0.0, 0.0, 1.5)])
def test_of_a_pose_whose_attitude_is_wrong_the_place_is_used(rate: Vec3) -> None:
    """A frame that tilted was left for dead reckoning, at a tilt of 3 deg, and hit the ground."""
    memory = last(hovering(turned_by=lambda t: (t * rate[0], t * rate[1], t * rate[2])))
    assert memory.verdict.wrong == Source.ATTITUDE
    health = memory.of(Sensor.POSE)
    assert memory.now - health.fused[0] < 0.1
    assert memory.now - health.fused[1] > 0.5
    assert health.fault is SensorFault.DISAGREES
    x, y = memory.numbers[0]["q"][1:3].tolist()
    assert 2.0 * math.hypot(x, y) < 0.02
    assert math.dist(memory.numbers[0]["p"], (0.0, 0.0, -1.5)) < 0.02


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("rate", [0.1, -0.12])
@pytest.mark.parametrize("axis", [0, 1])
def test_of_poses_that_come_seldom_a_tilt_that_the_gyro_contradicts_is_not_followed(
    axis: int, rate: float
) -> None:
    """The vehicle leant as a frame that tilted, and flew into a wall."""

    def tilting(t: float) -> Vec3:
        return rate * t * (axis == 0), rate * t * (axis == 1), 0.0

    memory = last(hovering(turned_by=tilting, apart=30))
    assert memory.verdict.contested
    assert abs(2.0 * attitude_of(memory.numbers[0])[1 + axis]) < 0.3 * abs(rate)
    assert not last(hovering(turned_by=tilting)).verdict.contested


@pytest.mark.requirement("REQ-EST-13")
def test_a_heading_that_gyro_and_pose_contest_is_the_pose_s() -> None:
    """Its places turn with it, and nothing else of the suite knows a heading."""
    memory = last(hovering(turned_by=lambda t: (0.0, 0.0, 0.1 * t), apart=30))
    assert memory.verdict.suspects == Source.GYRO | Source.ATTITUDE
    assert not memory.verdict.contested
    assert 2.0 * attitude_of(memory.numbers[0])[3] == pytest.approx(0.1, abs=0.01)


@pytest.mark.requirement("REQ-EST-13")
def test_of_a_pose_whose_attitude_repeats_itself_the_place_is_used() -> None:
    memory, random, said = at_start(2), np.random.default_rng(5), LEVEL
    for tick in range(round(2.0 / TICK)):
        now = 1.0 + TICK * tick
        a, b, c = (1e-3 * random.standard_normal(3)).tolist()
        samples: list[Sample] = [
            JointSample(now, (1e-5 * (tick % 2), 0.0)),
            ImuSample(now, (0.0, 0.0, -9.81 + a), (a, b, c)),
        ]
        if tick % 5 == 0:
            said = turned(LEVEL, a, b, c) if now < 2.0 else said
            samples.insert(0, PoseSample(now, (a, b, c - 1.5), said, FINE, FINE))
        memory, found = FUSION.take_in(memory, samples, now, HOVERS)
        memory, _ = FUSION.catch_up(memory, samples, found)
    health = memory.of(Sensor.POSE)
    assert memory.now - health.fused[0] < 0.1
    assert memory.now - health.fused[1] > 0.5
    assert health.fault is SensorFault.STUCK


@pytest.mark.drawn(2)
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("turn", "is_believed"),
    [((0.15, 0.0, 0.0), False), ((0.0, -0.2, 0.0), False), ((0.0, 0.0, 0.2), True)],
)
def test_a_frame_may_jump_by_a_heading_and_never_by_a_tilt(turn: Vec3, is_believed: bool) -> None:
    """Down stays where it is: a jump of 22 deg was believed, and flown into the ground."""
    memory = last(hovering(turned_by=lambda _: turn, moved_by=0.5))
    assert bool(memory.reset.number) is is_believed
    assert (memory.now - memory.of(Sensor.POSE).fused[0] < 0.1) is is_believed


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("pushed_by", [-2.0, 3.0, 5.0])
def test_what_a_named_accelerometer_has_taught_is_forgotten(pushed_by: float) -> None:
    """A gyro's bias had been learnt from it, and the gyro was a suspect for that from then on."""
    memories = list(hovering(pushed_by=pushed_by))
    before = memories[round(WRONG_FROM / TICK) - 1].numbers[0]["baseline"]
    assert memories[-1].verdict.wrong is Source.ACCELEROMETER
    np.testing.assert_allclose(memories[-1].numbers[0]["baseline"], before, atol=1e-3)


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("gust", [1.2, -1.3])
def test_a_gust_accuses_no_pose_where_no_accelerometer_feels_it(gust: float) -> None:
    """A vehicle that held without one was landed for the wind; with one the rotors are named."""
    accused = NOBODY
    for memory in hovering(gust=gust, unit=False):
        accused |= memory.verdict.suspects
    assert accused is NOBODY
    assert last(hovering(gust=gust)).verdict.explained
    for memory in hovering(gust=2.0 * gust, unit=False):
        accused |= memory.verdict.suspects
    assert accused == Source.MODEL | Source.POSE


@pytest.mark.requirement("REQ-EST-13")
def test_a_pose_whose_place_has_jumped_accuses_nobody_by_its_attitude() -> None:
    """Without encoders a sound gyro was suspected for that, and in the end the rotors stopped."""
    memory = last(hovering(turned_by=lambda t: (0.15, 0.0, 0.05 * t), moved_by=0.5))
    assert not memory.verdict.is_on
    assert not memory.verdict.wrong
    assert not memory.reset.number


@pytest.mark.requirement("REQ-EST-13")
def test_an_attitude_that_turns_is_told_among_outliers() -> None:
    """One refused pose made all windows wait: an outlier in 2 s hid 2 deg/s for 8 s."""
    turns = hovering(turned_by=lambda t: (0.0, 0.0, 0.08 * t), apart=10, outliers=100)
    turning = last(turns)
    assert turning.verdict.suspects & Source.ATTITUDE
    assert not any(memory.verdict.is_on for memory in hovering(apart=10, outliers=100))


@pytest.mark.requirement("REQ-EST-13")
def test_a_gyro_that_goes_wrong_beside_an_outlier_is_named() -> None:
    """Poses said nothing from one outlier on, rotors and gyro were left, and a vehicle fell."""
    beside = round(WRONG_FROM / TICK) + 35
    memory = last(hovering(turns=0.4, outliers=beside))
    assert memory.verdict.wrong is Source.GYRO
