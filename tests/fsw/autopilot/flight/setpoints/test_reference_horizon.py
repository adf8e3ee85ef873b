"""What reaches the planner: the mode's reference through the governor, and nothing new off plan."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fsw.autopilot.flight.modes.base import FlightMode, Px4Mode
from fsw.autopilot.flight.modes.hold import Hold
from fsw.autopilot.flight.modes.land import Land
from fsw.autopilot.flight.modes.mission import Mission
from fsw.autopilot.flight.modes.takeoff import Takeoff
from fsw.autopilot.flight.modes.trajectory import Trajectory
from fsw.autopilot.flight.plan_exchange import nominal_at_rest
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.setpoints.generator import PositionGoal, ReferenceState
from fsw.autopilot.flight.setpoints.reference_horizon import ReferenceHorizon
from fsw.autopilot.flight.state import FlightState, SetpointMemory
from fsw.autopilot.model.kinematics import end_effector
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import (
    EndEffectorTarget,
    Mode,
    MotionSetpoint,
    Orbit,
    SafeSet,
    StateEstimate,
    Vec3,
)
from tests.fsw.autopilot.flight.in_flight import CONFIG, GROUND_Z, flying, vehicle_at
from tests.fsw.records import with_record

HORIZON = ReferenceHorizon(CONFIG)
PERIOD = CONFIG.planner.period
HERE: Vec3 = (0.0, 0.0, -3.0)
FAR: Vec3 = (30.0, 0.0, -3.0)
SPEED = 0.4


def under_way(
    estimate: StateEstimate, plan_p: Vec3, goal: PositionGoal | None = None
) -> FlightState:
    """On the way far ahead at a speed, with the plan's body at a place."""
    reference = ReferenceState(False, HERE, (SPEED, 0.0, 0.0), 0.0, 0.0, (0.0, 0.0))
    goal = goal or PositionGoal(MotionSetpoint(False, FAR))
    nominal = nominal_at_rest(estimate)._replace(p=plan_p)
    state = replace(flying(), setpoint=SetpointMemory(reference, goal))
    return with_record(state, plan_state=nominal)


def speed_after(state: FlightState, estimate: StateEstimate) -> float:
    after, _ = HORIZON(Hold(CONFIG), state, estimate, 0)
    assert after.setpoint.reference is not None
    assert after.setpoint.goal == state.setpoint.goal, "what was asked for is remembered"
    return after.setpoint.reference.v[0]


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)])
@pytest.mark.parametrize("orbit", [None, Orbit((5.0, 0.0, -3.0), 5.0, 0.4)])
def test_a_vehicle_that_is_off_its_plan_is_asked_for_nothing_new(
    direction: Vec3, orbit: Orbit | None
) -> None:
    """Within 5 cm the setpoint speeds up; beyond, it slows down as fast as it may."""
    estimate = vehicle_at(HERE)
    change = CONFIG.steering.acceleration * PERIOD
    goal = PositionGoal(MotionSetpoint(False, FAR), orbit=orbit)
    for metres, expected in (
        (0.049, SPEED + change),
        (0.051, SPEED - change),
        (1.0, SPEED - change),
    ):
        x, y, z = (HERE[k] + metres * direction[k] for k in range(3))
        got = speed_after(under_way(estimate, (x, y, z), goal), estimate)
        if orbit is None or expected < SPEED:
            assert got == pytest.approx(expected)


def test_without_a_plan_nothing_is_off_it() -> None:
    estimate = vehicle_at(HERE)
    state = with_record(under_way(estimate, HERE), plan_state=None)
    assert speed_after(state, estimate) > SPEED


@pytest.mark.parametrize(("height", "on_plan"), [(0.2, True), (0.4, False)])
def test_near_the_ground_the_plan_may_be_lower_than_the_vehicle(
    height: float, on_plan: bool
) -> None:
    p: Vec3 = (0.0, 0.0, GROUND_Z - height)
    estimate = vehicle_at(p)
    lower = under_way(estimate, (0.0, 0.0, p[2] + 0.2))
    reference = lower.setpoint.reference
    assert reference is not None
    start = replace(reference, p=p, v=(0.1, 0.0, 0.0))
    state = replace(lower, setpoint=replace(lower.setpoint, reference=start))
    assert (speed_after(state, estimate) > 0.1) is on_plan
    aside = with_record(state, plan_state=nominal_at_rest(estimate)._replace(p=(0.06, 0.0, p[2])))
    assert speed_after(aside, estimate) < 0.1


def test_at_a_place_the_next_one_of_the_way_is_taken_and_at_the_last_it_stays() -> None:
    estimate = vehicle_at(HERE)
    reference = ReferenceState(False, HERE, (0.0, 0.0, 0.0), 0.0, 0.0, (0.0, 0.0))
    goal = PositionGoal(MotionSetpoint(False, HERE))
    ways = ((1.0, 0.0, -3.0), (1.0, 1.0, -3.0))
    state = replace(flying(), setpoint=SetpointMemory(reference, goal, ways))
    after, (targets, _) = HORIZON(Hold(CONFIG), state, estimate, 0)
    assert after.setpoint.goal == PositionGoal(MotionSetpoint(False, ways[0]))
    assert after.setpoint.waypoints == ways[1:]
    assert targets[-1].v_WE[0] > 0.0, "the horizon leads there already"
    last = replace(flying(), setpoint=SetpointMemory(reference, goal))
    after, _ = HORIZON(Hold(CONFIG), last, estimate, 0)
    assert after.setpoint.goal == goal


class Elsewhere(FlightMode):
    """A mode whose reference is somewhere else altogether, and moves."""

    mode = Mode.HOLD
    px4 = Px4Mode(0, 0, 0, "")

    def reference(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        return EndEffectorTarget(t_us, (9.0, 1e-6 * t_us, -3.0), (5.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class FromOutside(Elsewhere):
    external_reference = True


def test_a_reference_from_outside_is_governed_and_of_one_of_the_vehicles_own_the_way_aside() -> (
    None
):
    estimate = vehicle_at(HERE)
    p_WE, _ = end_effector(CONFIG.airframe.bodies, estimate)
    walled = flying()
    ahead = SafeSet((wall((-1.0, 0.0, 0.0), -0.2, 0.1),))
    walled = replace(walled, kept=InflatedSafeSet().of(ahead))
    _, (own, _) = HORIZON(Elsewhere(CONFIG), flying(), estimate, 400_000)
    assert [target.t_us for target in own] == [
        400_000 + node * CONFIG.mpc_period_us for node in range(CONFIG.planner.horizon + 1)
    ]
    for node, target in enumerate(own):  # aside as fast as it may be flown; the height is its own
        aside = math.dist(target.p_WE[:2], p_WE[:2])
        most = 0.4 + 1e-6 * node * CONFIG.mpc_period_us * CONFIG.steering.speed
        assert aside == pytest.approx(min(most, math.dist((9.0, 1e-6 * target.t_us), p_WE[:2])))
        assert target.p_WE[2] == -3.0
    _, (governed, joints) = HORIZON(FromOutside(CONFIG), flying(), estimate, 400_000)
    assert math.dist(governed[0].p_WE, p_WE) == pytest.approx(0.4)
    assert math.hypot(*governed[0].v_WE) == pytest.approx(1.0)
    assert joints == ()
    _, (behind, _) = HORIZON(FromOutside(CONFIG), walled, estimate, 0)
    assert max(target.p_WE[0] for target in behind) == pytest.approx(0.2)


class UpAndDown(FlightMode):
    """From outside: at rest on the ground, up past the lowest height, and to the ground again."""

    mode = Mode.MISSION
    px4 = Px4Mode(0, 0, 0, "")
    external_reference = True

    def reference(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        t = 1e-6 * t_us
        up = 0.5 * min(max(t - 1.0, 0.0), max(6.0 - t, 0.0))
        x, y, z = state.vehicle.mode_origin
        return still_at((x, y, z - up), t_us, 0.0)


def test_a_reference_that_comes_up_from_the_ground_is_limited_once_it_was_up() -> None:
    mode = UpAndDown(CONFIG)
    origin, _ = end_effector(CONFIG.airframe.bodies, vehicle_at((0.0, 0.0, GROUND_Z)))
    state = flying(Mode.MISSION, mode_origin=origin)
    for t_us in range(0, 6_000_000, CONFIG.mpc_period_us):
        up = origin[2] - mode.reference(state, t_us).p_WE[2]
        estimate = vehicle_at((0.0, 0.0, GROUND_Z - up))
        state, (targets, _) = HORIZON(mode, state, estimate, t_us)
        shown = HORIZON.target(mode, state, estimate, t_us)
        if t_us < 3_500_000:  # on the ground and on the way up nothing is changed, nor told
            assert state.limited == ""
            assert shown == mode.reference(state, t_us)
            assert all(one == mode.reference(state, one.t_us) for one in targets)
    assert "below 0.40 m" in state.limited
    assert -targets[-1].p_WE[2] == pytest.approx(-shown.p_WE[2]) == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize("mode", [Mission, Trajectory, Takeoff, Hold])
def test_no_mode_is_led_far_away_at_once(mode: type[FlightMode]) -> None:
    """Flown: a target that is far away is brought near, wherever it came from."""
    estimate = vehicle_at(HERE)
    state = flying(mode.mode, mode_origin=(9.0, 0.0, -3.0))
    far = still_at((9.0, 0.0, -3.0), 0, 0.0)
    state = replace(state, mission=replace(state.mission, stream=(far,)))
    _, (targets, _) = HORIZON(mode(CONFIG), state, estimate, 0)
    assert math.dist(targets[0].p_WE, estimate.p_WB) < 1.0


@pytest.mark.parametrize("mode", [Land, Takeoff])
def test_what_moves_on_by_itself_waits_for_a_vehicle_that_is_held_up(
    mode: type[FlightMode],
) -> None:
    """Flown: a landing went on below a zone for 14 s, and was caught up with at 2.6 m/s."""
    estimate = vehicle_at(HERE)
    origin, _ = end_effector(CONFIG.airframe.bodies, estimate)
    state, flown = flying(mode.mode, mode_origin=origin, climb=50.0), mode(CONFIG)
    for t_us in range(0, 14_000_000, CONFIG.mpc_period_us):
        before = state
        state, (targets, _) = HORIZON(flown, state, estimate, t_us)
        if t_us < 300_000:
            assert state is before, "a vehicle that only lags is not waited for"
    assert 0.1 < math.dist(targets[0].p_WE, origin) < 0.3
    assert math.hypot(*targets[0].v_WE) > 0.0, "it goes on as soon as it can"
    assert flown.update(state, vehicle_at(HERE, t_us=t_us))[1].next_mode is None


@pytest.mark.parametrize("mode", [Hold, Trajectory, Takeoff])
def test_while_nothing_of_ours_flies_the_target_is_where_the_vehicle_is(
    mode: type[FlightMode],
) -> None:
    """Carried, or flown by another autopilot: it begins there, and a sphere hangs there."""
    state = flying(Mode.DISARMED)
    for x in (0.0, 4.0):
        estimate = vehicle_at((x, 1.0, -3.0))
        target = HORIZON.target(mode(CONFIG), state, estimate, 5)
        here = end_effector(CONFIG.airframe.bodies, estimate)[0]
        assert target == still_at(here, 5, estimate.yaw)
