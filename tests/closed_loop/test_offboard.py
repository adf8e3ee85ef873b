"""Setpoints for now: what lets them in, what ends them, and that they cannot fly into a wall.

The walls are those of Case I, the margin is the plant's own, between samples.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, replace
from typing import Any

import pytest

from fsw.autopilot.signals import (
    AttitudeSetpoint,
    EndEffectorTarget,
    JointSetpoint,
    Mode,
    MotionSetpoint,
    PositionFrom,
    SetpointKind,
    Vec3,
)
from sitl.scenario import Hold, Obstacle, Pilot, Scenario
from sitl.scenario_file import load_scenario
from tests.closed_loop import harness
from tests.closed_loop.harness import ARM, SET_MODE, Flight, command, hover, on_the_ground

NAN = math.nan
HOVERING: Vec3 = (0.0, 0.0, -1.2)
AFAR: Vec3 = (-2.0, 0.0, -1.2)  # run-up enough for 2 m/s


def walls(start: Vec3, disturbed: bool) -> Scenario:
    case = load_scenario("walls")
    case = replace(case, pilot=Pilot("none"), trajectory=Hold(start), duration_s=600.0)
    return case if disturbed else replace(case, disturbances=())


def offboard(scenario: Scenario, **streamed: Any) -> Flight:
    """Armed in the air, the stream there, the mode asked for."""
    flight = Flight(scenario)
    flight.step(command(ARM, 1.0))
    flight.streamed = streamed
    flight.run(0.1)
    flight.step(command(SET_MODE, 1.0, 6.0, 0.0))
    assert flight.mode is Mode.OFFBOARD, flight.texts
    return flight


def nose_down(angle: float, thrust: float = 0.52) -> AttitudeSetpoint:
    return AttitudeSetpoint(thrust, (math.cos(0.5 * angle), 0.0, math.sin(-0.5 * angle), 0.0))


def body(**parts: Any) -> dict[str, Any]:
    return {"motion": MotionSetpoint(False, **parts)}


def end_effector(**parts: Any) -> dict[str, Any]:
    return {"motion": MotionSetpoint(True, **parts)}


@dataclass
class ThroughTheWall(Flight):
    """Streams a straight path that goes on behind the wall."""

    speed: float = 1.0

    def targets(self) -> tuple[EndEffectorTarget, ...]:
        if self.sim.step % 50:
            return ()
        ahead = (self.sim.t_us + 100_000 * k for k in range(20))
        return tuple(self._point(t_us) for t_us in ahead)

    def _point(self, t_us: int) -> EndEffectorTarget:
        x, y, z = AFAR
        gone = self.speed * max(1e-6 * t_us - 1.5, 0.0)
        return EndEffectorTarget(t_us, (x + gone, y, z), (self.speed, 0.0, 0.0), (0.0, 0.0, 0.0))


ATTACKS = {
    "a place behind the wall": body(p=(8.0, 0.0, -1.5)),
    "the end-effector behind the wall": end_effector(p=(8.0, 0.0, -1.2)),
    "5 m/s at the wall": body(v=(5.0, 0.0, 0.0)),
    "5 m/s into the corner": body(v=(5.0, 5.0, 0.0), yaw_rate=0.5),
    "the end-effector into the corner": end_effector(v=(5.0, -5.0, 0.0)),
    "10 m/s^2 at the wall": body(a=(10.0, 0.0, 0.0), yaw=0.0),
    "a place that runs into the wall": body(p=(0.8, 0.0, -1.4), v=(5.0, 0.0, 0.0)),
    "nose down": {"attitude": nose_down(0.5)},
    "rates": {"attitude": AttitudeSetpoint(0.52, None, (0.2, -1.0, 0.0))},
    "the arm stretched at the wall": {
        **body(v=(3.0, 0.0, 0.0)),
        "joints": JointSetpoint((1.0, 0.5)),
    },
}
# Of each kind one is in the quick tests, here or among branches.
LONG_AT_WALLS = {
    "a place behind the wall",
    "the end-effector behind the wall",
    "5 m/s at the wall",
    "5 m/s into the corner",
    "nose down",
}


@pytest.mark.drawn(2)
@pytest.mark.requirement("REQ-SAFE-6")
@pytest.mark.parametrize(
    "attack",
    [
        pytest.param(attack, marks=pytest.mark.long) if attack in LONG_AT_WALLS else attack
        for attack in ATTACKS
    ],
)
def test_no_set_point_flies_the_arm_into_a_wall(attack: str) -> None:
    flight = offboard(walls(AFAR, disturbed=True), **ATTACKS[attack])
    fastest = 0.0
    for _ in range(50):
        flight.run(0.1)
        fastest = max(fastest, math.hypot(*flight.sim.truth().v_WB))
    assert fastest > 1.0, "or it was no test"
    assert flight.mode is Mode.OFFBOARD
    margin = flight.sim.min_margin_m
    assert margin is not None
    assert 0.02 < margin < 0.2


def among_branches() -> Scenario:
    """A point where the body is going to pass, and one for the end-effector."""
    tips = (("high", (0.5, 0.0, -1.4)), ("low", (1.2, 0.1, -1.2)))
    obstacles = tuple(Obstacle(name, place, 0.1) for name, place in tips)
    return replace(walls(AFAR, disturbed=True), walls=(), obstacles=obstacles)


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-6")
@pytest.mark.parametrize(
    "attack", ["the end-effector behind the wall", "5 m/s at the wall", "nose down"]
)
def test_no_set_point_flies_the_vehicle_into_a_branch(attack: str) -> None:
    flight = offboard(among_branches(), **ATTACKS[attack])
    flight.run(5.0)
    assert flight.mode is Mode.OFFBOARD
    margin = flight.sim.min_margin_m
    assert margin is not None
    assert 0.02 < margin < 0.6


@pytest.mark.long
def test_a_set_point_in_a_branch_is_held_at_its_clearance() -> None:
    flight = offboard(among_branches(), **end_effector(p=(0.5, 0.0, -1.4)))
    flight.run(7.0)
    followed = flight.snapshot.reference
    assert followed is not None
    assert 0.1 - 1e-6 < math.dist(followed.p_WE, (0.5, 0.0, -1.4)) < 0.25
    assert flight.sim.min_margin_m is not None
    assert 0.02 < flight.sim.min_margin_m < 0.2


def test_a_position_is_flown_to_and_held_with_its_heading() -> None:
    flight = offboard(hover(), **body(p=(1.0, -0.5, -2.0), yaw=0.3))
    flight.run(6.0)
    assert math.dist(flight.sim.truth().p_WB, (1.0, -0.5, -2.0)) < 0.03
    assert flight.snapshot.estimate.yaw == pytest.approx(0.3, abs=0.1)
    assert flight.snapshot.offboard.kind is SetpointKind.BODY


def test_a_velocity_is_flown_in_both_frames() -> None:
    flight = offboard(hover(), **body(v=(0.0, 0.5, -0.2)))
    flight.run(3.0)
    assert flight.sim.truth().v_WB == pytest.approx((0.0, 0.5, -0.2), abs=0.05)
    flight = offboard(hover(yaw_deg=90.0), **body(v=(0.5, 0.0, 0.0), along_heading=True))
    flight.run(3.0)
    assert flight.sim.truth().v_WB == pytest.approx((0.0, 0.5, 0.0), abs=0.05)


@pytest.mark.long
def test_a_height_is_held_while_the_rest_is_a_velocity() -> None:
    """Mask 0xBC3, as a pilot's stick or a visual servo sends it."""
    flight = offboard(hover(), **body(p=(NAN, NAN, -1.6), v=(0.4, -0.2, NAN)))
    flight.run(4.0)
    truth = flight.sim.truth()
    assert truth.p_WB[2] == pytest.approx(-1.6, abs=0.03)
    assert truth.v_WB[:2] == pytest.approx((0.4, -0.2), abs=0.05)


def test_an_offset_is_flown_from_where_the_vehicle_was_when_it_came() -> None:
    flight = offboard(hover(yaw_deg=90.0), **body(v=(0.0, 0.0, 0.0)))
    north, east, down = flight.sim.truth().p_WB
    ahead = body(p=(0.5, 0.0, -0.2), along_heading=True, p_from=PositionFrom.VEHICLE)
    flight.streamed = ahead
    while flight.snapshot.offboard.motion == MotionSetpoint(False, v=(0.0, 0.0, 0.0)):
        flight.step()
    flight.streamed = {"joints": JointSetpoint(flight.sim.truth().q_arm)}
    flight.run(0.4)
    asked = flight.snapshot.offboard.motion
    assert asked is not None
    assert asked.p == pytest.approx((north, east + 0.5, down - 0.2), abs=0.02)
    flight.streamed = {"motion": asked}
    flight.run(4.0)
    assert math.dist(flight.sim.truth().p_WB, asked.p or (NAN,) * 3) < 0.03


def test_setpoints_that_are_refused_are_told_with_their_reason_and_not_as_silence() -> None:
    flight = Flight(hover())
    flight.step(command(ARM, 1.0))
    wrong = {"refused_setpoints": 1, "setpoint_problem": "forces are not supported"}
    flight.streamed = wrong
    flight.run(0.1)
    assert flight.texts[-1] == "setpoint refused: forces are not supported"
    flight.step(command(SET_MODE, 1.0, 6.0, 0.0))
    assert flight.texts[-1] == "not offboard: setpoints are refused: forces are not supported"
    flight.streamed = body(v=(0.0, 0.0, 0.0))
    flight.run(0.1)
    flight.step(command(SET_MODE, 1.0, 6.0, 0.0))
    assert flight.mode is Mode.OFFBOARD
    flight.streamed = wrong
    flight.run(0.6)
    stopped = [text for text in flight.texts if "setpoints stopped" in text]
    assert len(stopped) == 1
    assert "setpoints stopped: refused: forces are not supported" in stopped[0]


@pytest.mark.parametrize(
    "phase", [0, 49, *(pytest.param(phase, marks=pytest.mark.long) for phase in (1, 17))]
)
@pytest.mark.parametrize("wanted", [body(v=(0.5, 0.0, 0.0)), {"attitude": nose_down(0.1, 0.5)}])
def test_a_set_point_moves_the_rotors_with_the_next_plan_and_not_before(
    wanted: dict[str, Any], phase: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The planner is asked every 50 ticks and answers for 10 ticks later: 10 to 59 ticks."""
    monkeypatch.setattr(harness, "STREAM_STEPS", 1)
    reported, twin = (offboard(hover(), **body(v=(0.0, 0.0, 0.0))) for _ in range(2))
    asked = reported.state.index // 50 * 50 + 50 + phase
    while reported.state.index < asked - 1:
        reported.step()
        twin.step()
    reported.streamed = wanted
    until_asked = -asked % 50
    ticks = next(n for n in range(60) if reported.step().actuators != twin.step().actuators)
    assert ticks == until_asked + reported.config.plan_delay_ticks


def test_an_attitude_accelerates_the_way_it_points() -> None:
    flight = offboard(hover(), attitude=nose_down(0.1, 0.5))
    flight.run(1.0)
    vx, vy, vz = flight.sim.truth().v_WB
    assert 0.4 < vx < 1.2
    assert abs(vy) < 0.05
    assert abs(vz) < 0.15


def test_the_end_effector_and_the_joints_go_where_they_are_told() -> None:
    joints = JointSetpoint((0.4, -0.8))
    flight = offboard(hover(), joints=joints, **end_effector(p=(0.6, 0.2, -1.5)))
    flight.run(6.0)
    truth = flight.sim.truth()
    assert math.dist(truth.p_WE, (0.6, 0.2, -1.5)) < 0.03
    assert truth.q_arm == pytest.approx(joints.q_arm, abs=0.05)
    assert flight.snapshot.offboard.kind is SetpointKind.END_EFFECTOR


def test_joints_alone_move_the_arm_and_leave_the_body() -> None:
    flight = offboard(hover(), joints=JointSetpoint((0.2, 0.3)))
    before = flight.sim.truth().p_WB
    flight.run(5.0)
    assert flight.sim.truth().q_arm == pytest.approx((0.2, 0.3), abs=0.05)
    assert math.dist(flight.sim.truth().p_WB, before) < 0.05


def test_without_a_set_point_in_the_last_half_second_it_does_not_begin() -> None:
    flight = Flight(hover())
    flight.step(command(ARM, 1.0))
    flight.step(command(SET_MODE, 1.0, 6.0, 0.0))
    assert flight.results[-1] == (SET_MODE, 1)
    assert "no setpoint" in flight.texts[-1]
    flight.streamed = body(v=(0.0, 0.0, 0.0))
    flight.run(0.1)
    flight.streamed = {}
    flight.run(0.55)
    flight.step(command(SET_MODE, 1.0, 6.0, 0.0))
    assert flight.mode is Mode.HOLD


@pytest.mark.requirement("REQ-LINK-2")
def test_silence_for_half_a_second_ends_it_in_hold_with_a_text() -> None:
    flight = offboard(hover(), **body(v=(1.0, 0.0, 0.0)))
    flight.run(2.0)
    flight.streamed = {}
    flight.run(0.6)
    assert flight.mode is Mode.HOLD
    assert any("setpoints stopped" in text for text in flight.texts)
    flight.run(4.0)
    assert math.hypot(*flight.sim.truth().v_WB) < 0.04


def test_a_velocity_whose_stream_ends_is_not_kept_alive_by_joints() -> None:
    flight = offboard(hover(), joints=JointSetpoint((-0.7, 1.4)), **body(v=(1.0, 0.0, 0.0)))
    flight.run(1.5)
    del flight.streamed["motion"]
    flight.run(3.0)
    assert flight.mode is Mode.OFFBOARD
    assert math.hypot(*flight.sim.truth().v_WB) < 0.05


def test_out_of_range_is_counted_and_changes_nothing() -> None:
    flight = offboard(hover(), **body(v=(0.0, 0.0, 0.0)))
    flight.run(0.2)
    accepted = flight.snapshot.offboard.accepted
    for wrong in (
        body(p=(5000.0, 0.0, -1.0)),
        body(v=(200.0, 0.0, 0.0)),
        {"attitude": AttitudeSetpoint(1.5, (1.0, 0.0, 0.0, 0.0))},
        {"attitude": AttitudeSetpoint(0.5, (1.0, 1.0, 0.0, 0.0))},
        {"joints": JointSetpoint((1.5, 0.0))},
    ):
        flight.streamed = wrong
        flight.run(0.1)
    report = flight.snapshot.offboard
    assert (report.accepted, report.refused) == (accepted, 10)
    assert flight.mode is Mode.HOLD, "half a second of nonsense is half a second of silence"
    assert math.hypot(*flight.sim.truth().v_WB) < 0.02


def test_from_the_ground_and_back_by_set_points_alone() -> None:
    flight = Flight(on_the_ground())
    flight.step(command(ARM, 1.0))
    flight.streamed = body(p=(0.0, 0.0, -0.32))
    flight.run(0.1)
    flight.step(command(SET_MODE, 1.0, 6.0, 0.0))
    flight.run(0.5)
    assert flight.snapshot.landed
    flight.streamed = body(p=(1.0, 0.0, -1.5))
    flight.run(5.0)
    assert not flight.snapshot.landed
    assert math.dist(flight.sim.truth().p_WB, (1.0, 0.0, -1.5)) < 0.05
    flight.streamed = body(v=(0.0, 0.0, 1.0))
    flight.run(5.0)
    assert flight.mode is Mode.OFFBOARD
    assert flight.snapshot.landed
    flight.step(command(ARM, 0.0))
    assert flight.mode is Mode.DISARMED


@pytest.mark.requirement("REQ-SAFE-6")
@pytest.mark.parametrize("speed", [pytest.param(1.0, marks=pytest.mark.long), 3.0])
def test_a_streamed_trajectory_through_the_wall_is_not_flown_there(speed: float) -> None:
    flight = ThroughTheWall(walls(AFAR, disturbed=True), speed=speed)
    flight.step(command(ARM, 1.0))
    flight.step(command(SET_MODE, 1.0, 4.0, 11.0))
    assert flight.mode is Mode.TRAJECTORY
    flight.run(6.0)
    margin = flight.sim.min_margin_m
    assert margin is not None
    assert 0.02 < margin < 0.2
    assert flight.mode is Mode.TRAJECTORY


def any_setpoint(chance: random.Random) -> dict[str, Any]:
    """One of everything, wild."""

    def vector(most: float) -> Vec3:
        return (
            chance.uniform(-most / 3.0, most),
            chance.uniform(-most, most),
            chance.uniform(-most / 4.0, most / 8.0),
        )

    place = (chance.uniform(-1.0, 8.0), chance.uniform(-4.0, 4.0), chance.uniform(-3.0, -0.5))
    rates = (chance.uniform(-1.0, 1.0), chance.uniform(-1.0, 1.0), chance.uniform(-1.0, 1.0))
    kinds = (
        body(p=place, yaw=chance.uniform(-3.0, 3.0)),
        body(v=vector(6.0), yaw_rate=chance.uniform(-2.0, 2.0)),
        body(a=vector(12.0)),
        end_effector(p=place),
        end_effector(v=vector(6.0), yaw=chance.uniform(-3.0, 3.0)),
        {"attitude": nose_down(chance.uniform(-0.2, 0.6), chance.uniform(0.4, 0.6))},
        {"attitude": AttitudeSetpoint(chance.uniform(0.4, 0.6), None, rates)},
    )
    joint1 = chance.uniform(-1.0, 1.0)
    joints = {"joints": JointSetpoint((joint1, chance.uniform(-1.4, 1.4) - joint1))}
    return {**chance.choice(kinds), **(joints if chance.random() < 0.4 else {})}


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-SAFE-6")
@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3))]
)
def test_wild_set_points_in_quick_succession_keep_the_walls(seed: int) -> None:
    chance = random.Random(seed)
    flight = offboard(walls(AFAR if seed % 2 else HOVERING, disturbed=True), **body(v=(1.0, 0, 0)))
    for _ in range(12):
        flight.streamed = any_setpoint(chance)
        flight.run(0.05 * chance.randrange(4, 18))
    assert flight.mode is Mode.OFFBOARD
    margin = flight.sim.min_margin_m
    assert margin is not None
    assert margin > 0.0
