"""``python -m benchmarks plant``: one step of the simulator's plant."""

from __future__ import annotations

import statistics
import time

import numpy as np

from command_line.parser import Parser
from sitl.plant.aerial_manipulator import Inputs
from sitl.plant.integrator import STEP_S, held, integrate
from sitl.plant.parameters import plant
from sitl.plant.state import JOINTS_MAX, P_WB, ROTORS_MAX, THRUST, W_WB_B, at_rest
from sitl.scenario_file import load_scenario
from sitl.simulation import STEP_US, Controls, Simulation
from vehicles.vehicle_file import load_vehicle

STEPS = 2000  # per timed call: the call itself no longer counts
ROUNDS = 25
EXCHANGES = 500


def plant_step_us() -> list[float]:
    """Microseconds per 1 ms plant step, one value per round."""
    numbers = plant(load_vehicle("paper"))
    start = at_rest(4, 2)
    start[P_WB + 2] = -100.0
    start[THRUST + 4 : THRUST + 6] = (-0.7, 1.4)
    start[W_WB_B:THRUST] = (0.1, -0.2, 0.3)
    inputs = Inputs(np.full(ROTORS_MAX, 8.6), np.zeros(JOINTS_MAX), np.zeros(3), np.zeros(3))
    places = np.empty((STEPS, 4, 3))
    states = np.empty((STEPS, len(start)))
    blocks = held()
    integrate(numbers, start.copy(), inputs, STEP_S, places, states, blocks)
    out = []
    for _ in range(ROUNDS):
        state = start.copy()
        began = time.perf_counter()
        integrate(numbers, state, inputs, STEP_S, places, states, blocks)
        out.append(1e6 * (time.perf_counter() - began) / STEPS)
    return out


def exchange_us(scenario: str) -> list[float]:
    """Microseconds per sense + advance of a whole simulation, one value per round."""
    controls = Controls((0.5, 0.5, 0.5, 0.5), (0.0, 0.0), armed=True)
    out = []
    for _ in range(ROUNDS + 1):
        simulation = Simulation(load_scenario(scenario), 0)
        began = time.perf_counter()
        for _ in range(EXCHANGES):
            simulation.sense()
            simulation.advance(controls)
        out.append(1e6 * (time.perf_counter() - began) / EXCHANGES)
    return out[1:]  # the first round compiled


def main(argv: list[str]) -> int:
    """Print the table; returns the exit code."""
    Parser("python -m benchmarks plant", "Time one step of the simulator's plant.").read(argv)
    rows = [("plant step of 1 ms (RK4)", plant_step_us(), 1e6 * STEP_S)]
    for scenario in ("walls", "workspace"):
        rows.append((f"sense + advance, {scenario}", exchange_us(scenario), float(STEP_US)))
    print(f"{'':30}{'median µs':>10}{'best µs':>10}{'real-time factor':>18}")
    for name, values, simulated_us in rows:
        median = statistics.median(values)
        print(f"{name:30}{median:10.2f}{min(values):10.2f}{simulated_us / median:18.0f}")
    return 0
