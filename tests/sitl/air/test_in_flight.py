"""Real air and actuators in the plant: off they change no bit, on they act as they should."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sitl.plant.parameters import GRAVITY
from sitl.plant.state import P_WB, THRUST, V_WB, W_WB_B
from sitl.scenario import (
    ActuatorKeys,
    AirKeys,
    Hold,
    Pilot,
    Scenario,
    ScenarioWall,
    Start,
)
from sitl.scenario_file import ScenarioError
from sitl.simulation import Controls, Simulation

ROTORS = slice(THRUST, THRUST + 4)
AIRBORNE = Scenario(
    "test", 60.0, Start(kind="airborne", arm_deg=(0.0, 0.0)), Pilot("none"), Hold((0.0, 0.0, -50.0))
)


def flown(scenario: Scenario, steps: int, thrust: float | None = None) -> Simulation:
    """The simulation after so many steps with the same thrust [N] on all rotors; None: hover."""
    simulation = Simulation(scenario, 0)
    weight = 0.25 * simulation.vehicle.mass * GRAVITY
    share = (weight if thrust is None else thrust) / simulation.vehicle.rotors[0].thrust_max
    for _ in range(steps):
        simulation.advance(Controls((share,) * 4, (0.0, 0.0), armed=True))
    return simulation


def state(simulation: Simulation) -> np.ndarray:
    """The plant's state vector."""
    return np.frombuffer(simulation.state_bytes())


def test_drag_brings_the_vehicle_to_the_speed_of_the_wind_as_faessler_has_it() -> None:
    keys = AirKeys(wind_m_s=(2.0, 0.0, 0.0), rotor_drag_1_s=(0.544, 0.386, 0.0))
    simulation = flown(replace(AIRBORNE, air=keys), 250)
    # v' = -d (v - w) from rest; the arm hangs and swings a little.
    expected = 2.0 * (1.0 - math.exp(-0.544 * 0.5))
    assert state(simulation)[V_WB] == pytest.approx(expected, rel=0.02)


def test_wind_without_anything_that_feels_it_changes_no_bit() -> None:
    keys = AirKeys(wind_m_s=(5.0, 0.0, 0.0), turbulence_m_s=15.0)
    blown = flown(replace(AIRBORNE, air=keys), 50)
    assert blown.state_bytes() == flown(AIRBORNE, 50).state_bytes()


def test_turbulence_shakes_and_draws_nothing_of_what_others_draw() -> None:
    keys = AirKeys(wind_m_s=(4.0, 0.0, 0.0), turbulence_m_s=15.4, rotor_drag_1_s=(0.5, 0.4, 0.0))
    one, two = (flown(replace(AIRBORNE, air=keys), 300) for _ in range(2))
    assert one.state_bytes() == two.state_bytes()
    assert abs(state(one)[V_WB + 1]) > 0.01


def test_near_the_ground_the_thrust_of_hover_lifts() -> None:
    low = replace(AIRBORNE, trajectory=Hold((0.0, 0.0, -0.05)), body="points")
    near = replace(low, air=AirKeys(ground_effect=True))
    assert state(flown(near, 50))[V_WB + 2] < state(flown(low, 50))[V_WB + 2] - 0.01


def test_below_a_ceiling_the_thrust_of_hover_lifts_and_a_wall_pulls() -> None:
    roof = ScenarioWall("roof", (0.0, 0.0, 1.0), -50.45, 0.02)
    below = replace(AIRBORNE, walls=(roof,), body="points")
    near = replace(below, air=AirKeys(ceiling_effect=True))
    assert state(flown(near, 30))[V_WB + 2] < -0.01
    side = ScenarioWall("side", (-1.0, 0.0, 0.0), -0.7, 0.02)
    beside = replace(AIRBORNE, walls=(side,), air=AirKeys(wall_suction=0.05), body="points")
    assert state(flown(beside, 50))[V_WB] > 0.003


@pytest.mark.parametrize("where", ["ground", "ceiling"])
def test_what_a_surface_adds_to_the_thrust_it_does_not_add_to_the_torque_about_yaw(
    where: str,
) -> None:
    """Both laws are of thrust at the same power: at the same speed the torque is the same."""
    roof = ScenarioWall("roof", (0.0, 0.0, 1.0), -50.45, 0.02)
    low = replace(AIRBORNE, trajectory=Hold((0.0, 0.0, -0.3)), body="points")
    below = replace(AIRBORNE, walls=(roof,), body="points")
    free = low if where == "ground" else below
    near = replace(free, air=AirKeys(ground_effect=True, ceiling_effect=True))

    def turned(scenario: Scenario) -> tuple[float, float]:
        simulation = Simulation(scenario, 0)
        weight = 0.25 * simulation.vehicle.mass * GRAVITY
        share = weight / simulation.vehicle.rotors[0].thrust_max
        pairs = (1.2 * share, 0.8 * share, 1.2 * share, 0.8 * share)
        for _ in range(10):
            simulation.advance(Controls(pairs, (0.0, 0.0), armed=True))
        now = state(simulation)
        return float(now[W_WB_B + 2]), float(now[V_WB + 2])

    (spin, climb), (spin_near, climb_near) = turned(free), turned(near)
    assert climb_near < climb - 2e-3
    assert spin > 5e-4
    assert spin_near == pytest.approx(spin, rel=1e-3)


def test_more_walls_than_there_is_room_for_are_refused() -> None:
    walls = tuple(ScenarioWall(f"wall{k}", (-1.0, 0.0, 0.0), -5.0 - k, 0.1) for k in range(8))
    crowded = replace(AIRBORNE, walls=walls, air=AirKeys(ground_effect=True))
    with pytest.raises(ScenarioError, match="8 walls"):
        Simulation(crowded, 0)
    Simulation(replace(crowded, air=AirKeys()), 0)


def test_with_quadratic_thrust_the_speed_lags_by_the_stated_time() -> None:
    keys = ActuatorKeys(quadratic_thrust=True)
    simulation = flown(replace(AIRBORNE, actuators=keys), 20, thrust=16.0)
    lag = simulation.vehicle.rotors[0].lag
    start = math.sqrt(0.25 * simulation.vehicle.mass * GRAVITY)
    speed = 4.0 + (start - 4.0) * math.exp(-0.04 / lag)
    assert np.sqrt(state(simulation)[ROTORS]) == pytest.approx([speed] * 4, rel=1e-3)


def test_a_rotor_with_quadratic_thrust_starts_from_rest() -> None:
    ground = replace(AIRBORNE, start=Start(kind="ground"), trajectory=Hold((0.0, 0.0, -1.0)))
    keys = ActuatorKeys(quadratic_thrust=True)
    simulation = flown(replace(ground, actuators=keys), 40, thrust=4.0)
    lag = simulation.vehicle.rotors[0].lag
    expected = 4.0 * (1.0 - math.exp(-0.08 / lag)) ** 2
    assert state(simulation)[ROTORS] == pytest.approx([expected] * 4, rel=0.1)


def test_a_dead_time_holds_the_command_back_by_exactly_that() -> None:
    late = replace(AIRBORNE, actuators=ActuatorKeys(dead_time_ms=10.0))
    hover = state(flown(late, 0))[ROTORS]
    assert state(flown(late, 5, thrust=16.0))[ROTORS] == pytest.approx(hover)
    after = state(flown(late, 8, thrust=16.0))[ROTORS]
    prompt = state(flown(AIRBORNE, 3, thrust=16.0))[ROTORS]
    assert after == pytest.approx(prompt)


def test_a_battery_sags_under_load_and_thrust_with_its_square() -> None:
    keys = ActuatorKeys(battery_a_h=5.0, battery_ohm=0.03)
    full, ideal = flown(replace(AIRBORNE, actuators=keys), 250), flown(AIRBORNE, 250)
    share = state(full)[THRUST] / state(ideal)[THRUST]
    assert 0.8 < share < 0.97
    assert state(full)[P_WB + 2] > state(ideal)[P_WB + 2]


def test_a_flight_with_everything_is_the_same_twice() -> None:
    everything = replace(
        AIRBORNE,
        air=AirKeys(
            wind_m_s=(2.0, 1.0, 0.0), turbulence_m_s=7.7, rotor_drag_1_s=(0.5, 0.4, 0.1),
            body_drag_m2=0.03, ground_effect=True, ceiling_effect=True, wall_suction=0.02,
        ),
        actuators=ActuatorKeys(
            quadratic_thrust=True, dead_time_ms=4.0, battery_a_h=5.0,
            motor_inertia_kg_m2=0.0025, backlash_deg=0.5,
        ),
    )  # fmt: skip
    assert flown(everything, 100).state_bytes() == flown(everything, 100).state_bytes()


def test_backlash_keeps_the_torque_from_a_link_until_the_gap_is_crossed() -> None:
    loose = replace(AIRBORNE, actuators=ActuatorKeys(backlash_deg=1.0, motor_inertia_kg_m2=0.0025))
    rates = []
    for scenario in (AIRBORNE, loose):
        simulation = Simulation(scenario, 0)
        for _ in range(2):
            simulation.advance(Controls((0.5,) * 4, (0.1, 0.0), armed=True))
        rates.append(state(simulation)[19])
    assert rates[0] > 0.01
    assert abs(rates[1]) < 0.1 * rates[0]
