"""Six and eight rotors between walls, of which one is lost or weak: told, landed, no contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import Mode
from sitl.faults.keys import Fault
from sitl.scenario import vehicle_of
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import Flight

ROTORS = {"hexa-3r": 6, "octo-4r": 8}
CASES = [
    (vehicle, rotor, share, suite)
    for share in (0.0, 0.5)
    for suite in ("perfect", "mocap")
    for vehicle, count in ROTORS.items()
    for rotor in range(1, count + 1)
]
WITHIN_S = 12.0


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-ACT-1", "REQ-ACT-3")
@pytest.mark.parametrize(("vehicle", "rotor", "share", "suite"), CASES)
def test_it_is_told_and_lands_without_contact(
    vehicle: str, rotor: int, share: float, suite: str
) -> None:
    random = np.random.default_rng(CASES.index((vehicle, rotor, share, suite)))
    start_s, seed = round(float(random.uniform(2.0, 12.0)), 2), int(random.integers(100_000))
    fault = Fault("motor", "weak", instance=float(rotor), share=share, start_s=start_s)
    walls = load_scenario("walls", suite, vehicle)
    scenario = replace(walls, duration_s=600.0, faults=(fault,))
    config = flight_config(body=walls.body, vehicle=vehicle_of(walls))
    flight = Flight(scenario, seed=seed, config=config)
    flight.follow()
    flight.run(start_s)
    assert flight.mode is Mode.TRAJECTORY, "until then it flew"
    said = len(flight.texts)
    told = "gives nothing" if share == 0.0 else "% of what is commanded"
    while flight.mode is not Mode.DISARMED and flight.sim.time_s < start_s + WITHIN_S:
        flight.step()
        assert flight.sim.ended is None, flight.sim.ended
        if flight.mode is not Mode.TRAJECTORY:
            flight.sim.leave_trajectory(flight.sim.t_us, flight.mode.value)
    assert flight.mode is Mode.DISARMED, flight.texts
    texts = [text for text in flight.texts[said:] if "failed: " in text or "lost: " in text]
    assert texts
    assert all(f": rotor {rotor} " in text for text in texts), texts
    assert any(told in text for text in texts), texts
    assert flight.modes[-2:] == [Mode.LAND, Mode.DISARMED]
