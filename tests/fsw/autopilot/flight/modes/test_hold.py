"""Holding: come to rest, or stay where the mode before came to rest."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.flight.modes.hold import Hold
from fsw.autopilot.flight.setpoints.generator import PositionGoal, ReferenceState
from fsw.autopilot.flight.state import SetpointMemory
from fsw.autopilot.model.kinematics import end_effector
from fsw.autopilot.signals import MotionSetpoint, Vec3
from tests.fsw.autopilot.flight.in_flight import CONFIG, HANDOVER, flying, vehicle_at

HOLD = Hold(CONFIG)
HERE: Vec3 = (0.0, 0.0, -2.0)
UNDER_WAY = SetpointMemory(
    ReferenceState(False, HERE, (0.5, 0.0, 0.0), 0.3),
    PositionGoal(MotionSetpoint(False, (9.0, 0.0, -2.0)), joints=(0.1, 0.2)),
    waypoints=((1.0, 1.0, -2.0),),
)
DONE = replace(HANDOVER, completed=True)


@pytest.mark.parametrize("handover", [HANDOVER, DONE])
def test_a_setpoint_under_way_comes_to_rest_and_the_arm_stays_as_asked(handover: object) -> None:
    state = replace(flying(), setpoint=UNDER_WAY)
    after = HOLD.activate(state, vehicle_at(HERE, (0.5, 0.0, 0.0)), handover).setpoint  # type: ignore[arg-type]
    assert after.reference == UNDER_WAY.reference
    assert after.goal == PositionGoal(MotionSetpoint(False, v=(0.0, 0.0, 0.0)), joints=(0.1, 0.2))
    assert after.waypoints == ()


@pytest.mark.parametrize(("speed", "brakes"), [(0.099, False), (0.101, True)])
def test_without_a_setpoint_a_moving_end_effector_is_braked(speed: float, brakes: bool) -> None:
    estimate = vehicle_at(HERE, (0.0, speed, 0.0))
    after = HOLD.activate(flying(), estimate, HANDOVER).setpoint
    assert (after.reference is not None) is brakes
    if after.reference is not None:
        p_WE, v_WE = end_effector(CONFIG.airframe.bodies, estimate)
        assert after.reference.of_end_effector
        assert (after.reference.p, after.reference.v) == (p_WE, v_WE)
        assert after.goal == PositionGoal(MotionSetpoint(True, v=(0.0, 0.0, 0.0)))


def test_after_a_mode_that_is_done_its_reference_rests_already() -> None:
    fast = vehicle_at(HERE, (0.0, 1.0, 0.0))
    assert HOLD.activate(flying(), fast, DONE).setpoint == SetpointMemory()


def test_on_the_ground_nothing_is_steered() -> None:
    state = flying(mode=flying().vehicle.mode)
    standing = replace(state, vehicle=replace(state.vehicle, landed=True), setpoint=UNDER_WAY)
    fast = vehicle_at(HERE, (0.0, 1.0, 0.0))
    assert HOLD.activate(standing, fast, HANDOVER).setpoint == SetpointMemory()
