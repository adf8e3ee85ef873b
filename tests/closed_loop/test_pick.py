"""The scenario ``pick``: its pilot closes the gripper, the vehicle carries, its pilot opens it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.parameters.flight_config import flight_config
from messages import message_ids
from sitl.link.pilot import Phase, PilotState, flight_plan, listen, speak
from sitl.link.pilot_messages import Ack, Heard, SendCommand
from sitl.mission_clock import MissionClock
from sitl.result import EndKind
from sitl.scenario import vehicle_of
from sitl.scenario_file import load_scenario
from sitl.simulation import START_US, Simulation
from studies.flight.closed_loop import ScenarioFlight

PUT_DOWN = (0.75, 1.0, -1.0)


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-15")
@pytest.mark.parametrize(("suite", "seed"), [(None, 7), ("mocap", 101)])
def test_a_payload_is_picked_carried_along_a_wall_and_put_down(
    suite: str | None, seed: int
) -> None:
    """With the second seed the rotors' model was suspected while the payload was weighed."""
    scenario = load_scenario("pick", suite)
    simulation = Simulation(scenario, seed)
    config = flight_config(body=scenario.body, vehicle=vehicle_of(scenario))
    flight = ScenarioFlight(simulation, config)
    weighed: list[float] = []
    while simulation.ended is None:
        flight.step()
        state: FlightState = flight.loop.state
        weighed.append(state.record.payload.mass)
    assert simulation.ended.kind is EndKind.DURATION
    use = simulation.payload.use()
    assert use is not None
    assert use.taken_s is not None
    assert use.released_m is not None
    assert math.dist(use.released_m, PUT_DOWN) < 0.1
    carried = weighed[round((use.taken_s + 3.0) * 500) : round(scenario.pilot.release_s * 500)]
    np.testing.assert_allclose(carried, use.mass_kg, rtol=0.05)
    assert weighed[-1] == 0.0


def test_the_pilot_on_the_link_asks_for_the_gripper_until_it_is_acknowledged() -> None:
    scenario = load_scenario("pick")
    clock = MissionClock(scenario)
    plan = flight_plan(scenario, lambda t: clock.target_at(1e-6 * (t - START_US)), lambda _: 0.0)
    state, asked = PilotState(Phase.FOLLOWING), list[float]()
    for k in range(400):
        t_us = START_US + 100_000 * k
        state, messages = speak(plan, state, t_us)
        for message in messages:
            if isinstance(message, SendCommand):
                assert message.command == message_ids.CMD_DO_GRIPPER
                asked.append(message.params[1])
                if len(asked) != 1:  # the first one is lost
                    ack = Heard(acks=(Ack(message.command, message_ids.ACCEPTED),))
                    state = listen(plan, state, ack, t_us)
    assert asked == [1.0, 1.0, 0.0]
    assert state.phase is Phase.FOLLOWING
    assert state.refusal is None
