"""A calm flight kept tick by tick: what a search for the worst disturbance starts from.

While the fast loop holds the vehicle, a plan follows from the plan before it and not from where
the disturbance has pushed the vehicle. So the plans of a calm flight are those of a disturbed one,
and a disturbed stretch can be flown again from any instant without the planner.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.shapes.zones import NO_ZONES, moving_zones
from fsw.autopilot.signals import TickOutputs
from fsw.autopilot.tick_record import Accelerations, PlanState, Tick
from sitl.disturbances.items import Push
from sitl.scenario import Scenario
from sitl.simulation import Simulation
from studies.flight.closed_loop import ClosedLoop, InlinePlanner
from studies.flight.own_parts import planner_of

EVERY = 50  # ticks between two starts
_WARN = 1  # of SAFE_BREACH_ACT
_Seen = Callable[[Simulation, FlightState, TickOutputs], None]


@dataclass(frozen=True, slots=True)
class Start:
    """Where a stretch can begin."""

    row: int  # tick of the plan
    step: int  # of the simulation
    state: Array  # (17 + 2j,) [SI] of the plant
    memory: Tick
    margin_m: float = math.inf  # of the calm flight here
    touches: bool = False  # the tool does, of what cannot become another surface then


@dataclass(frozen=True, slots=True)
class PlanRecord:
    """The plan of a calm flight."""

    states: NDArray[Any]  # (ticks,) of ``PlanState``
    inputs: NDArray[Any]  # (ticks,) of ``Accelerations``
    zones: Array  # (rows, columns) [SI] of the safety filter, all that it had in the flight
    spans: NDArray[np.int64]  # (ticks, 2) which of them it had: first, and one after the last
    starts: tuple[Start, ...]


def record(
    scenario: Scenario, config: FlightConfig, report: Callable[[float, float], None]
) -> PlanRecord:
    """Fly a scenario without its disturbances; ``report`` receives seconds flown and in all."""
    states: list[bytes] = []
    inputs: list[bytes] = []
    zones = _ZonesSeen()
    starts: list[Start] = []
    before: list[tuple[Array, Tick]] = []
    touched: list[bool] = []

    def sense(simulation: Simulation, state: FlightState) -> None:
        if len(states) % EVERY == 0:
            now = np.frombuffer(simulation.state_bytes()).copy()
            before[:] = [(now, state.record)]
            touched[:] = [simulation.touch.depth() > 0.0]

    def see(simulation: Simulation, state: FlightState, outputs: TickOutputs) -> None:
        if outputs.snapshot.plan_state is None:
            return
        if len(states) % EVERY == 0:
            margin = min(simulation.truth().margins_m, default=math.inf)
            starts.append(Start(len(states), simulation.step - 1, *before[0], margin, *touched))
        states.append(state.record.plan.numbers.tobytes())
        inputs.append(state.record.u.numbers.tobytes())
        zones.add(state)
        if len(states) % 500 == 0:
            report(simulation.time_s, scenario.duration_s)

    fly(replace(scenario, disturbances=()), config, (), see, sense=sense)
    return PlanRecord(
        np.frombuffer(bytearray().join(states), PlanState.dtype),
        np.frombuffer(bytearray().join(inputs), Accelerations.dtype),
        *zones.arrays(),
        tuple(starts),
    )


class _ZonesSeen:
    """The zones that the safety filter was given, tick by tick; equal ones are kept once."""

    def __init__(self) -> None:
        self._kept = [NO_ZONES]
        self._spans: list[tuple[int, int]] = []
        self._of: tuple[object, object] = (None, None)
        self._end = 0

    def add(self, state: FlightState) -> None:
        """Take those of a tick."""
        kept, target = state.kept, state.reference
        if kept is not self._of[0] or target is not self._of[1]:
            self._of = (kept, target)
            zones = moving_zones(kept.safe_set, target, kept.added)
            if not np.array_equal(zones, self._kept[-1]):
                self._kept.append(zones)
                self._end += len(zones)
        self._spans.append((self._end - len(self._kept[-1]), self._end))

    def arrays(self) -> tuple[Array, NDArray[np.int64]]:
        """All zones, and which of them each tick had."""
        return np.concatenate(self._kept), np.array(self._spans, dtype=np.int64)


def fly(
    scenario: Scenario,
    config: FlightConfig,
    more: tuple[Push, ...],
    see: _Seen,
    *,
    sense: Callable[[Simulation, FlightState], None] | None = None,
    last_step: int | None = None,
) -> Simulation:
    """Fly the whole stack in one process; ``see`` receives each tick's outputs, ``sense`` precedes.

    ``more`` pushes come on top of the scenario's. It ends after ``last_step``, if that is given.
    A breach of the safe set is only reported: a retreat would fly another plan than the recorded.
    """
    config = replace(config, limits=replace(config.limits, breach_action=_WARN))
    simulation = Simulation(scenario, 0, more)
    planner = InlinePlanner(planner_of(config))
    loop = ClosedLoop(simulation, Autopilot(config).tick, planner, config.airframe)
    while simulation.ended is None and (last_step is None or simulation.step <= last_step):
        if sense is not None:
            sense(simulation, loop.state)
        outputs = loop.step(loop.inputs(*loop.observe()))
        see(simulation, loop.state, outputs)
    return simulation
