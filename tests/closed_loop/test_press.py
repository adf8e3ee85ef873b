"""The tool presses on a wall in the plant: the scenario probe, of any stiffness in its range."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import Mode
from sitl.scenario import Push, Scenario, Uniform, vehicle_of
from sitl.scenario_file import load_scenario
from sitl.simulation import START_US, Simulation
from studies.flight.closed_loop import ScenarioFlight
from tests.closed_loop.harness import Flight

HOLD_S = 2.0


def push(stiffness: float = 1000.0, disturbance: float = 0.8) -> Scenario:
    """One place of the scenario ``probe``, pressed on for a shorter time."""
    whole = load_scenario("probe")
    assert isinstance(whole.trajectory, Push)
    (panel,) = whole.zones
    assert panel.touch is not None
    one = replace(
        whole.trajectory, position_m=whole.trajectory.position_m[:1], force_n=(5.0,),
        hold_s=(HOLD_S,),
    )  # fmt: skip
    touch = replace(panel.touch, stiffness_n_m=stiffness)
    shaken = (Uniform(disturbance, 0.1),) if disturbance else ()
    zones = (replace(panel, touch=touch),)
    return replace(whole, trajectory=one, zones=zones, disturbances=shaken)


def flown(scenario: Scenario, seed: int, seconds: float) -> tuple[Flight, np.ndarray]:
    """A flight, and of each tick: force, its estimate, its uncertainty, force asked for [N]."""
    config = flight_config(body="full", vehicle=vehicle_of(scenario))
    flight, seen = Flight(scenario, seed, config=config), []
    flight.follow()
    while flight.sim.step * 0.002 < seconds:
        flight.step()
        k = flight.state.record.pressing
        force = -flight.sim.touch.force()[0]
        seen.append((force, k.pressed, k.unsure, k.asked))
    return flight, np.array(seen)


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-SAFE-13")
@pytest.mark.parametrize("stiffness", [500.0, 2000.0])
def test_a_wall_is_pressed_on_with_the_force_asked_for_and_never_harder(stiffness: float) -> None:
    flight, seen = flown(push(stiffness), seed=2, seconds=11.0)
    (use,) = flight.sim.touch.uses().values()
    assert use.force_max_n < use.force_bound_n
    held = np.abs(seen[:, 3] - 5.0) < 0.01
    assert held.sum() * 0.002 > HOLD_S - 0.5
    error = seen[held, 0] - 5.0
    assert math.sqrt(float((error**2).mean())) < 1.0  # 20 %
    observed = np.abs(seen[held, 1] - seen[held, 0])
    assert np.mean(observed < seen[held, 2]) > 0.85
    assert flight.mode is Mode.TRAJECTORY, flight.texts
    assert flight.snapshot.safety.breaches == 0


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-14")
@pytest.mark.parametrize("starts_s", [5.5, 7.0])
def test_a_wall_that_comes_is_left_behind(starts_s: float) -> None:
    """While the tool is pressed on it, and when it is just leaving it."""
    scenario = push()
    (panel,) = scenario.zones
    coming = replace(panel, velocity_m_s=(-0.1, 0.0, 0.0), starts_s=starts_s)
    flight, seen = flown(replace(scenario, zones=(coming,)), seed=2, seconds=starts_s + 3.0)
    (use,) = flight.sim.touch.uses().values()
    assert seen[:, 3].max() > 4.9  # it was pressed on
    assert use.force_max_n < use.force_bound_n
    assert any("surface not where announced" in text for text in flight.texts), flight.texts
    assert flight.mode is Mode.HOLD
    assert flight.sim.touch.normal() == 0.0


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-13")
def test_a_tool_that_slides_over_a_wall_keeps_the_force() -> None:
    whole = load_scenario("wipe")
    assert isinstance(whole.trajectory, Push)
    short = replace(whole.trajectory, slide_m=((0.0, 0.0, -0.25),), hold_s=(5.0,))
    flight, seen = flown(replace(whole, trajectory=short), seed=2, seconds=11.0)
    (use,) = flight.sim.touch.uses().values()
    assert use.slip_m > 0.25
    assert flight.mode is Mode.TRAJECTORY, flight.texts
    held = np.abs(seen[:, 3] - 3.0) < 0.01
    assert held.sum() * 0.002 > 4.5
    assert math.sqrt(float(((seen[held, 0] - 3.0) ** 2).mean())) < 0.6  # 20 %


@pytest.mark.long
def test_a_tool_that_friction_holds_swings_no_arm_straight() -> None:
    """What was to move the tool aside pressed with 7.5 N of 5, and pushed the base away."""
    scenario = load_scenario("probe", "mocap")
    config = flight_config(body=scenario.body, vehicle=vehicle_of(scenario))
    flight = ScenarioFlight(Simulation(scenario, 315), config)
    while flight.loop.simulation.truth().t_us < START_US + 5_500_000:
        flight.step()
        assert max(np.abs(flight.loop.simulation.truth().qd_arm)) < 5.0
    assert flight.recorder.modes == [], flight.recorder.texts
