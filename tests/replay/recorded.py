"""A short flight with its ticks kept, and the log that it makes."""

from __future__ import annotations

import dataclasses
from dataclasses import field
from pathlib import Path

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.parameters.control_choice import ControlChoice
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.parameters.registry import PARAMETERS
from fsw.autopilot.ports import GroupTiming
from fsw.autopilot.signals import Command, TickInputs, TickOutputs
from fsw.autopilot.tuning import flat
from fsw.log.flight_log import FlightLog, LogSubject, vehicle_facts
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import LAND, Flight, command
from vehicles.vehicle_file import load_vehicle

CHOICE = ControlChoice(body="points")


@dataclasses.dataclass
class Recorded(Flight):
    """A flight that keeps what went into each tick and what came out."""

    ticks: list[tuple[TickInputs, TickOutputs]] = field(default_factory=list)

    def step(self, *commands: Command) -> TickOutputs:
        outputs = super().step(*commands)
        assert self.inputs is not None
        self.ticks.append((self.inputs, outputs))
        return outputs


def flight(seconds: float) -> list[tuple[TickInputs, TickOutputs]]:
    """Walls, a trajectory, plans, an unsupported command, and the way down."""
    flight = Recorded(load_scenario("walls"), seed=5)
    flight.follow()
    flight.run(seconds / 2)
    flight.step(command(31010), command(LAND))
    flight.run(seconds / 2)
    return flight.ticks


def written(path: Path, ticks: list[tuple[TickInputs, TickOutputs]], lockstep: bool = True) -> Path:
    """The log of these ticks."""
    facts = {**CHOICE.facts(), **vehicle_facts(load_vehicle("paper"))}
    config = flight_config(body="points")
    values = {one.name: one.read(config) for one in PARAMETERS}
    log = FlightLog(path, LogSubject(facts, flat(config), values, AIRFRAME))
    log.begin(ticks[0][0].sensors.t_us, lockstep)
    for inputs, outputs in ticks:
        log.add(inputs, outputs)
        log.add_timing(inputs.sensors.t_us, 0, GroupTiming(4, 1, 2, 3, *(5.0,) * 6))
    log.close()
    return path
