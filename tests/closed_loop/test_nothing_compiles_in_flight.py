"""Compiling takes seconds and loading kernels milliseconds: both are over before a flight.

What is loaded is a matter of the process, so each flight has one of its own:
``python -m tests.closed_loop.test_nothing_compiles_in_flight NAME`` flies and prints the kernels
that were not ready.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest
from numba.core.dispatcher import Dispatcher

from fsw.autopilot.parameters.control_choice import ControlChoice
from fsw.autopilot.signals import AttitudeSetpoint, JointSetpoint, Mode, MotionSetpoint
from fsw.runtime.assembly import flight_software
from sitl.faults.keys import KINDS, Fault
from sitl.rehearsal import rehearse
from sitl.scenario import ActuatorKeys, AirKeys, Scenario, Wind
from sitl.scenario_file import SUITE_NAMES, load_scenario
from sitl.simulation import Controls, Simulation
from tests.closed_loop.harness import ARM, SET_MODE, Flight, command, hover

_LEVEL = (1.0, 0.0, 0.0, 0.0)


def _follow(flight: Flight) -> None:
    flight.follow()
    flight.run(0.5)
    assert flight.snapshot.plan is not None


def _listen_to_setpoints(flight: Flight) -> None:
    flight.step(command(ARM, 1.0))
    flight.streamed = {"motion": MotionSetpoint(False, v=(0.2, 0.0, 0.0))}
    flight.run(0.1)
    flight.step(command(SET_MODE, 1.0, 6.0, 0.0))
    assert flight.mode is Mode.OFFBOARD, flight.texts
    for streamed in (
        {"motion": MotionSetpoint(False, p=(0.1, 0.0, -1.5), yaw=0.2)},
        {"motion": MotionSetpoint(True, p=(0.3, 0.0, -1.3)), "joints": JointSetpoint((0.2, 0.3))},
        {"joints": JointSetpoint((0.2, 0.3))},
        {"attitude": AttitudeSetpoint(0.52, _LEVEL)},
    ):
        flight.streamed = streamed
        flight.run(0.3)
    assert flight.mode is Mode.OFFBOARD, flight.texts


FLIGHTS: dict[str, Callable[[], tuple[Flight, Callable[[Flight], None]]]] = {
    "walls": lambda: (Flight(load_scenario("walls")), _follow),
    "workspace": lambda: (Flight(load_scenario("workspace")), _follow),
    "branches": lambda: (Flight(load_scenario("branches")), _follow),
    "setpoints": lambda: (Flight(hover()), _listen_to_setpoints),
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("walls", marks=pytest.mark.long),
        pytest.param("workspace", marks=pytest.mark.long),
        "branches",  # walls and points
        pytest.param("setpoints", marks=pytest.mark.long),
    ],
)
def test_a_flight_finds_every_kernel_ready(name: str) -> None:
    module = "tests.closed_loop.test_nothing_compiles_in_flight"
    flown = subprocess.run(
        [sys.executable, "-m", module, name], capture_output=True, text=True, check=False
    )
    assert flown.returncode == 0, flown.stderr
    assert json.loads(flown.stdout) == []


# Everything of the air and of the actuators that a scenario can ask for.
_REAL: dict[str, Any] = {
    "air": AirKeys(
        wind_m_s=(3.0, 1.0, 0.0), turbulence_m_s=5.0, rotor_drag_1_s=(0.3, 0.3, 0.0),
        body_drag_m2=0.02, ground_effect=True, ceiling_effect=True, wall_suction=0.02,
    ),
    "actuators": ActuatorKeys(
        quadratic_thrust=True, dead_time_ms=4.0, battery_a_h=2.0, motor_inertia_kg_m2=0.001,
        backlash_deg=1.0,
    ),
    "disturbances": (Wind((0.5, 0.0, 0.0)),),
}  # fmt: skip
SIMULATIONS: dict[str, Callable[[str], Scenario]] = {
    "walls and faults": lambda suite: load_scenario("walls", suite),
    "workspace and faults": lambda suite: load_scenario("workspace", suite),
    "moving zones and faults": lambda suite: load_scenario("gate", suite),
    "ground and faults": lambda suite: load_scenario("ground", suite),
    "air and faults": lambda suite: replace(load_scenario("walls", suite), **_REAL),
}


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [
        "walls and faults",
        "workspace and faults",
        "moving zones and faults",
        "ground and faults",  # where no trim has been computed
        "air and faults",
    ],
)
def test_no_fault_of_a_simulation_finds_a_kernel_that_is_not_ready(name: str) -> None:
    test_a_flight_finds_every_kernel_ready(name)


def _fail(name: str) -> list[str]:
    """Let everything fail in each way with each suite; kernels that were not ready for it."""
    unready: list[str] = []
    for suite in SUITE_NAMES:
        simulation = Simulation(SIMULATIONS[name](suite), 0)
        rehearse(Simulation(simulation.scenario, 0))
        simulation.measurements()
        ready = _variants()
        for unit, kinds in KINDS.items():
            for kind in kinds:
                if simulation.inject(Fault(unit, kind)) is None:
                    _step(simulation)
                    simulation.faults.clear(unit, 0, simulation.step + 1)
        assert {Fault("joint", "stuck"), Fault("motor", "off")} <= {*simulation.faults.take_begun()}
        simulation.result()
        unready += [kernel for kernel, count in _variants().items() if count != ready.get(kernel)]
    return unready


def _step(simulation: Simulation) -> None:
    joints = len(simulation.vehicle.joints)
    for _ in range(4):
        simulation.advance(Controls((0.5, 0.5, 0.5, 0.5), (0.1,) * joints, armed=True))
        simulation.sense(), simulation.measurements(), simulation.battery()
    simulation.truth()


def _variants() -> dict[str, int]:
    """How many types each kernel of both processes is ready for."""
    return {name: len(kernel.signatures) for name, kernel in _kernels()}


def _kernels() -> Iterator[tuple[str, Dispatcher]]:
    for name, module in list(sys.modules.items()):
        if name.startswith(("fsw.", "sitl.")):
            for key, value in vars(module).items():
                if isinstance(value, Dispatcher):
                    yield f"{name}.{key}", value


def _fly(name: str) -> list[str]:
    flight, fly = FLIGHTS[name]()
    flight_software(ControlChoice())
    rehearse(Simulation(flight.scenario, 0))
    ready = _variants()
    assert ready["fsw.autopilot.mpc.costs._add_tracking"] > 0
    assert ready["fsw.autopilot.flight.fast_loop.fast_loop"] > 0
    fly(flight)
    return [kernel for kernel, count in _variants().items() if count != ready.get(kernel)]


if __name__ == "__main__":
    print(json.dumps((_fail if sys.argv[1] in SIMULATIONS else _fly)(sys.argv[1])))
