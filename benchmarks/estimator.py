"""``python -m benchmarks estimator``: a tick with real sensors beside one with exact states."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Final

from command_line.parser import Parser
from fsw.autopilot.estimation.fusion_memory import at_start
from fsw.autopilot.estimation.sensor_fusion import SensorFusion
from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.measurements import Sample
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import TickInputs, TickOutputs
from sitl.scenario_file import load_scenario
from sitl.simulation import STEP_US, Simulation
from studies.flight.closed_loop import ClosedLoop, InlinePlanner
from studies.flight.result import processor_time_us

SCENARIO: Final = "walls"
SUITES: Final = ("perfect", "mocap", "vio", "rtk")
TICKS: Final = 5000
_SETTLED: Final = 500  # ticks that are not counted


class _Flight:
    """A flight with one suite whose ticks are timed."""

    def __init__(self, suite: str) -> None:
        config = flight_config(body="points")
        autopilot = Autopilot(config)
        autopilot.warm_up()
        self.times_us: list[float] = []
        self.samples: list[tuple[Sample, ...]] = []
        planner = InlinePlanner(Planner(config.planner, config.airframe, processor_time_us))
        simulation, tick = (
            Simulation(load_scenario(SCENARIO, suite), 0),
            self._timed(autopilot.tick),
        )
        self._loop = ClosedLoop(simulation, tick, planner, config.airframe)

    def step(self) -> None:
        """One tick."""
        loop = self._loop
        sensors, samples = loop.observe()
        self.samples.append(samples)
        loop.step(loop.inputs(sensors, samples))

    def _timed(
        self, tick: Callable[[FlightState, TickInputs], tuple[FlightState, TickOutputs]]
    ) -> Callable[[FlightState, TickInputs], tuple[FlightState, TickOutputs]]:
        def timed(state: FlightState, inputs: TickInputs) -> tuple[FlightState, TickOutputs]:
            began = time.perf_counter()
            found = tick(state, inputs)
            self.times_us.append(1e6 * (time.perf_counter() - began))
            return found

        return timed


def estimator_us(samples: list[tuple[Sample, ...]]) -> list[float]:
    """Microseconds of each tick of the estimator alone, fed with a flight's ``samples``."""
    fusion, memory = SensorFusion(flight_config().estimator, 2), at_start(2)
    fusion.warm_up()
    out = []
    for k, arrived in enumerate(samples):
        now = 1.0 + 1e-6 * STEP_US * k
        began = time.perf_counter()
        memory, _ = fusion.step(memory, arrived, now)
        out.append(1e6 * (time.perf_counter() - began))
    return out


def main(argv: list[str]) -> int:
    """Print the table; returns the exit code."""
    what = "Time the estimator, and a tick with it beside one without."
    Parser("python -m benchmarks estimator", what).read(argv)
    flights = {suite: _Flight(suite) for suite in SUITES}
    for _ in range(TICKS):
        for flight in flights.values():  # in turn: a busy machine slows all of them
            flight.step()
    exact = statistics.median(flights[SUITES[0]].times_us[_SETTLED:])
    print(f"{'µs':10}{'tick: median':>14}{'p99':>8}{'ratio':>8}{'estimator: median':>20}{'p99':>8}")
    for suite, flight in flights.items():
        ticks = sorted(flight.times_us[_SETTLED:])
        median, late = statistics.median(ticks), ticks[int(0.99 * len(ticks))]
        row = f"{suite:10}{median:14.1f}{late:8.1f}{median / exact:8.2f}"
        if any(flight.samples):
            alone = sorted(estimator_us(flight.samples)[_SETTLED:])
            row += f"{statistics.median(alone):20.1f}{alone[int(0.99 * len(alone))]:8.1f}"
        print(row)
    return 0
