"""A flight in one process whose flight software, or planner, stands still for a while.

As in real time: the vehicle flies on, what stands in for commands drives it, and what came
meanwhile is there when the flight software goes on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.measurements import Sample
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import (
    EndEffectorTarget,
    Plan,
    PlanFailure,
    SafeSetAnnouncement,
    TickInputs,
)
from sitl.result import EndKind
from sitl.scenario_file import load_scenario
from sitl.simulation import STEP_US, Controls, Simulation
from sitl.stand_in import StandIn
from studies.flight.closed_loop import FIRST_COMMANDS, ClosedLoop, InlinePlanner

AFTER_S = 5.0  # flown after the pause
_STEP_S = 1e-6 * STEP_US
_CONTACTS = (EndKind.COLLISION, EndKind.CRASH, EndKind.DIVERGED)


@dataclass
class Outcome:
    """What a flight came to."""

    contact: str = ""
    least_m: float = math.inf  # margin, from the pause on
    texts: list[tuple[float, str]] = field(default_factory=list)


class StandingPlanner(InlinePlanner):
    """A planner that stands still for a while: what it was asked for is answered afterwards."""

    def __init__(self, planner: Planner, begin_us: int, end_us: int) -> None:
        super().__init__(planner)
        self._pause = begin_us, end_us

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        begin_us, end_us = self._pause
        return None if begin_us <= t_us < end_us else super().take(t_us)


def fly_paused(
    scenario: str,
    seed: int,
    at_s: float,
    pause_s: float,
    *,
    sensors: str = "mocap",
    planner_only: bool = False,
) -> Outcome:
    """Fly a scenario until ``AFTER_S`` [s] after a pause of ``pause_s`` [s] at ``at_s`` [s]."""
    flown = load_scenario(scenario, sensors)
    simulation = Simulation(replace(flown, duration_s=at_s + pause_s + AFTER_S + 1.0), seed)
    config = flight_config(body=flown.body)
    begin, end = round(at_s / _STEP_S), round((at_s + pause_s) / _STEP_S)
    inner = Planner(config.planner, config.airframe, lambda: 0.0)
    start_us = simulation.t_us
    stands = (begin * STEP_US + start_us, (end if planner_only else begin) * STEP_US + start_us)
    planner, autopilot = StandingPlanner(inner, *stands), Autopilot(config)
    loop = ClosedLoop(simulation, autopilot.tick, planner, config.airframe)
    drives, outcome = StandIn(simulation.vehicle), Outcome()
    sent = Controls((0.0,) * 4, (0.0, 0.0), armed=False)
    targets: tuple[EndEffectorTarget, ...] = ()
    announced: tuple[SafeSetAnnouncement, ...] = ()
    samples: tuple[Sample, ...] = ()
    while simulation.ended is None and simulation.time_s < at_s + pause_s + AFTER_S:
        step = simulation.step
        sensed, measured = loop.observe()
        targets += loop.targets()
        announced += loop.announced()
        samples += measured
        if begin <= step < end and not planner_only:
            held_s = (step + 1 - begin) * _STEP_S
            simulation.advance(drives.applied(sent, held_s, simulation.healthy()))
        else:
            commands = FIRST_COMMANDS[step] if step < len(FIRST_COMMANDS) else ()
            plan = planner.take(sensed.t_us)
            inputs = TickInputs(
                sensed, plan, commands, targets=targets, announced=announced, samples=samples
            )
            targets, announced, samples = (), (), ()
            outputs = loop.step(inputs)
            sent = loop.controls(outputs.actuators, armed=outputs.snapshot.armed)
            drives.applied(sent, 0.0, simulation.healthy())
            outcome.texts += [(simulation.time_s, one.text) for one in outputs.texts]
        if step >= begin and step % 5 == 0:
            outcome.least_m = min(outcome.least_m, *simulation.truth().margins_m)
    if simulation.ended is not None and simulation.ended.kind in _CONTACTS:
        outcome.contact = simulation.ended.sentence
    return outcome
