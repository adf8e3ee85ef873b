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

import pytest
from numba.core.dispatcher import Dispatcher

from fsw.parameters.control_choice import ControlChoice
from fsw.runtime.assembly import flight_software
from fsw.signals import AttitudeSetpoint, JointSetpoint, Mode, MotionSetpoint
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import ARM, SET_MODE, Flight, command, hover

_WORKING_SET_KERNELS = ("_add_near", "_numbered", "_add_violated")
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


def _variants() -> dict[str, int]:
    """How many types each kernel of the flight software is ready for."""
    return {name: len(kernel.signatures) for name, kernel in _kernels()}


def _kernels() -> Iterator[tuple[str, Dispatcher]]:
    for name, module in list(sys.modules.items()):
        if name.startswith("fsw."):
            for key, value in vars(module).items():
                if isinstance(value, Dispatcher):
                    yield f"{name}.{key}", value


def _fly(name: str) -> list[str]:
    flight, fly = FLIGHTS[name]()
    flight_software(ControlChoice())
    ready = _variants()
    assert all(ready[f"fsw.mpc.dual_solver.{kernel}"] for kernel in _WORKING_SET_KERNELS)
    assert ready["fsw.control.cascade._close_loops"] > 0
    fly(flight)
    return [kernel for kernel, count in _variants().items() if count != ready.get(kernel)]


if __name__ == "__main__":
    print(json.dumps(_fly(sys.argv[1])))
