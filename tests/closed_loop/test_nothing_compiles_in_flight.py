"""Compiling takes seconds: it is over before the vehicle flies."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest
from numba.core.dispatcher import Dispatcher

from fsw.mpc.planner import Planner
from fsw.parameters.control_choice import ControlChoice
from fsw.runtime.assembly import flight_software
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import Flight

_WHERE_ROWS_BIND = ("_want_near", "_numbered", "_want_violated")


def variants() -> dict[str, int]:
    """How many types each kernel of the flight software is compiled for."""
    return {name: len(kernel.signatures) for name, kernel in _kernels()}


def _kernels() -> Iterator[tuple[str, Dispatcher]]:
    for name, module in list(sys.modules.items()):
        if name.startswith("fsw."):
            for key, value in vars(module).items():
                if isinstance(value, Dispatcher):
                    yield f"{name}.{key}", value


@pytest.mark.parametrize("name", ["walls", "branches"])
def test_a_flight_compiles_nothing_more(name: str) -> None:
    program = flight_software(ControlChoice("blf", "tracking", "consistent", "clarabel", False))
    assert isinstance(program.planner, Planner)
    flight = Flight(load_scenario(name), planner=program.planner)
    ready = variants()
    assert all(ready[f"fsw.mpc.dual_solver.{kernel}"] for kernel in _WHERE_ROWS_BIND)
    flight.follow()
    flight.run(0.5)
    assert flight.snapshot.plan is not None
    assert variants() == ready
    assert ready["fsw.control.cascade._close_loops"] > 0
