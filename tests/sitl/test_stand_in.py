"""What drives rotors and joints while no command comes: level, and the arm as it is."""

from __future__ import annotations

import math

import pytest

from sitl.scenario import Hold, Pilot, Scenario, Start
from sitl.simulation import STEP_US, Controls, Simulation
from sitl.stand_in import STALE_S, StandIn

STEP_S = 1e-6 * STEP_US


def hovering() -> tuple[Simulation, Controls]:
    """A vehicle in the air, and what holds it there."""
    scenario = Scenario("hover", 600.0, Start("airborne"), Pilot("none"), Hold((0.0, 0.0, -1.2)))
    simulation = Simulation(scenario, 1)
    thrust, vehicle = simulation.truth().thrust, simulation.vehicle
    full, most = vehicle.rotors[0].thrust_max, vehicle.joints[0].torque_max
    torque = tuple(one / most for one in simulation.healthy().tau_arm)
    f1, f2, f3, f4 = (one / full for one in thrust)
    return simulation, Controls((f1, f2, f3, f4), torque, armed=True)


def tilt_of(simulation: Simulation) -> float:
    _, x, y, _ = simulation.truth().q_WB
    return math.acos(1.0 - 2.0 * (x * x + y * y))


def upset(simulation: Simulation, controls: Controls) -> Controls:
    """Turn the vehicle by more thrust on two sides for 60 ms; that is the last command then."""
    f1, f2, f3, f4 = controls.thrust
    turning = controls._replace(thrust=(f1, f2 + 0.15, f3 + 0.1, f4 - 0.15))
    for _ in range(30):
        simulation.advance(turning)
    return turning


@pytest.mark.parametrize("stands_in", [True, False])
def test_a_vehicle_that_turns_comes_to_rest_level_without_commands(stands_in: bool) -> None:
    simulation, controls = hovering()
    stand_in = StandIn(simulation.vehicle)
    for _ in range(250):
        stand_in.applied(controls, 0.0, simulation.healthy())
    last, worst = upset(simulation, controls), 0.0
    for step in range(250):
        held_s = STALE_S + (step + 1) * STEP_S
        applied = stand_in.applied(last, held_s, simulation.healthy()) if stands_in else last
        simulation.advance(applied)
        worst = max(worst, tilt_of(simulation))
    assert (worst < 0.2) is stands_in
    if stands_in:
        assert tilt_of(simulation) < 0.03
        assert math.hypot(*simulation.truth().w_WB_B) < 0.2


def test_joints_hold_the_angle_at_which_commands_stopped() -> None:
    simulation, controls = hovering()
    stand_in = StandIn(simulation.vehicle)
    stand_in.applied(controls, 0.0, simulation.healthy())
    angles = simulation.truth().q_arm
    pushed = controls._replace(torque=(controls.torque[0] + 0.05, controls.torque[1]))
    for step in range(250):
        held_s = STALE_S + (step + 1) * STEP_S
        simulation.advance(stand_in.applied(pushed, held_s, simulation.healthy()))
    assert simulation.truth().q_arm == pytest.approx(angles, abs=0.05)


def test_commands_that_come_in_time_are_applied_as_they_are() -> None:
    simulation, controls = hovering()
    stand_in, readings = StandIn(simulation.vehicle), simulation.healthy()
    assert stand_in.applied(controls, 0.0, readings) is controls
    assert stand_in.applied(controls, STALE_S, readings) is controls
    off = controls._replace(armed=False)
    assert stand_in.applied(off, 0.9, readings) is off
