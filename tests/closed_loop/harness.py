"""Plant, flight loop and planner in one process, joined as the lockstep shell joins them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import studies.flight.rival_planners  # noqa: F401 - whose names configurations have
from fsw.autopilot.flight.state import FlightState, first_state
from fsw.autopilot.flight.tuned_autopilot import TunedAutopilot
from fsw.autopilot.geometry.geodesy import DEFAULT_ORIGIN, to_local
from fsw.autopilot.measurements import Sample
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.ports import PlanningCycle as AnyPlanner
from fsw.autopilot.signals import (
    ActuatorCommand,
    Command,
    CommandRequest,
    EndEffectorTarget,
    FlightSnapshot,
    MissionUpdate,
    Mode,
    Plan,
    PlanFailure,
    PlanRequest,
    SensorFrame,
    TickInputs,
    TickOutputs,
)
from fsw.autopilot.tuning import Tuning
from fsw.link.wire.decode_commands import command as read_command
from sitl.disturbances.sequence import Played
from sitl.scenario import Hold, Pilot, Scenario, Start
from sitl.simulation import STEP_US, Simulation
from studies.flight.closed_loop import ClosedLoop, InlinePlanner
from studies.flight.mission import announced

ARM, TAKEOFF, LAND, SET_MODE = 400, 22, 21, 176
STREAM_STEPS = 25
LOCATE = partial(to_local, DEFAULT_ORIGIN)


def hover(arm_deg: tuple[float, float] | None = None, yaw_deg: float = 0.0) -> Scenario:
    """In the air, calm, nothing asked for."""
    start = Start("airborne", yaw_deg=yaw_deg)
    if arm_deg is not None:
        start = Start("airborne", arm_deg=arm_deg, yaw_deg=yaw_deg)
    return Scenario("hover", 600.0, start, Pilot("none"), Hold((0.0, 0.0, -1.2)))


# Standing 3 m from a wall, nothing asked for.
BESIDE_A_WALL = """
duration_s = inf
[start]
kind = "ground"
[pilot]
plan = "none"
[trajectory]
kind = "hold"
position_m = [0.0, 0.0, -1.2]
[[zones]]
name = "wall"
shape = "half-space"
normal = [-1.0, 0.0, 0.0]
offset_m = -3.0
clearance_m = 0.1
"""


def on_the_ground() -> Scenario:
    """Standing, disarmed, nothing asked for."""
    return Scenario("ground", 600.0, Start("ground"), Pilot("none"), Hold((0.0, 0.0, -1.2)))


def real_planner(config: FlightConfig) -> Planner:
    return Planner(config.planner, config.airframe, stopwatch_us=lambda: 0.0)


def on_time(_plan_id: int) -> int:
    return 0


def as_measured(frame: SensorFrame) -> SensorFrame:
    return frame


def as_sampled(samples: tuple[Sample, ...]) -> tuple[Sample, ...]:
    return samples


@dataclass
class Flight:
    """One flight, step by step; all status texts are kept.

    ``spoil`` and ``spoil_samples`` stand between sensors and flight software, ``late_ticks`` says
    by how many ticks each plan comes after its time.
    """

    scenario: Scenario
    seed: int = 11
    config: FlightConfig = field(default_factory=lambda: flight_config(body="points"))
    planner: AnyPlanner | None = None
    spoil: Callable[[SensorFrame], SensorFrame] = as_measured
    spoil_samples: Callable[[tuple[Sample, ...]], tuple[Sample, ...]] = as_sampled
    late_ticks: Callable[[int], int] = on_time
    announces: bool = True  # the safe set
    upload: MissionUpdate | None = None  # told to the next tick
    pushes: tuple[Played, ...] = ()  # beside the scenario's own
    state: FlightState = field(init=False)
    texts: list[str] = field(default_factory=list)
    results: list[tuple[int, int]] = field(default_factory=list)  # command, MAV_RESULT
    modes: list[Mode] = field(default_factory=list)  # each change
    # What a ground station sends 20 times a second: fields of TickInputs.
    streamed: dict[str, Any] = field(default_factory=dict)
    sent: list[ActuatorCommand] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.sim = Simulation(self.scenario, self.seed, self.pushes)
        # A scenario says what keeps clear, as for `pandion fly`.
        planner = replace(self.config.planner, body=self.scenario.body)
        self.config = replace(self.config, planner=planner)
        self.loop = TunedAutopilot(self.config)
        self.state = first_state(self.config.airframe)
        self.planner = self.planner or real_planner(self.config)
        self.closed = ClosedLoop(self.sim, self._tick, Late(self), self.config.airframe)
        self.inputs: TickInputs | None = None  # of the last tick
        self._outputs: TickOutputs | None = None

    def _tick(self, first: FlightState, inputs: TickInputs) -> tuple[FlightState, TickOutputs]:
        self.state, outputs = self.loop.tick(self.state, inputs)
        return first, outputs

    @property
    def outputs(self) -> TickOutputs:
        """Of the last tick."""
        assert self._outputs is not None, "no tick yet"
        return self._outputs

    @property
    def snapshot(self) -> FlightSnapshot:
        """The vehicle as telemetry shows it."""
        return self.outputs.snapshot

    @property
    def mode(self) -> Mode:
        return Mode.DISARMED if self._outputs is None else self._outputs.mode

    def follow(self) -> None:
        """Arm and start the scenario's trajectory, both in their first possible tick."""
        self.step(command(ARM, 1.0))
        self.step(command(SET_MODE, 1.0, 4.0, 11.0))
        assert self.mode is Mode.TRAJECTORY, self.texts

    def run(self, seconds: float) -> None:
        """Fly on for a while; a plant that ended its run is an error."""
        for _ in range(round(seconds * 1e6) // STEP_US):
            self.step()
            assert self.sim.ended is None, self.sim.ended

    def until(self, mode: Mode, within_s: float) -> None:
        """Fly on into a mode; not to be in it after so many seconds is an error."""
        end_s = self.sim.time_s + within_s
        while self.mode is not mode:
            assert self.sim.time_s < end_s, (self.mode, self.texts)
            self.run(0.02)

    def step(self, *commands: Command, tuning: Tuning | None = None) -> TickOutputs:
        """Sense, tick, plan, advance."""
        sensors, samples = self.closed.observe()
        sensors = self.spoil(sensors)
        self.inputs = TickInputs(
            sensors,
            self.closed.planner.take(sensors.t_us),
            commands,
            self.targets(),
            announced(self.scenario) if self.announces and self.sim.step == 0 else (),
            tuning=tuning,
            mission=self.upload,
            samples=self.spoil_samples(samples),
        )
        self.upload = None
        if self.streamed and self.sim.step % STREAM_STEPS == 0:
            self.inputs = replace(self.inputs, **self.streamed)
        return self.step_with(self.inputs)

    def targets(self) -> tuple[EndEffectorTarget, ...]:
        return self.closed.targets() if self.scenario.pilot.plan == "trajectory" else ()

    def step_with(self, inputs: TickInputs) -> TickOutputs:
        """Tick, plan, advance, with inputs from somewhere else."""
        before = self.mode
        outputs = self._outputs = self.closed.step(inputs)
        self.texts += [text.text for text in outputs.texts]
        self.results += [(ack.command, ack.result) for ack in outputs.acks]
        if self.mode is not before:
            self.modes.append(self.mode)
        self.sent.append(outputs.actuators)
        return outputs


class Late(InlinePlanner):
    """The planner of a flight; each plan comes as many ticks late as the flight says."""

    def __init__(self, flight: Flight) -> None:
        assert flight.planner is not None
        super().__init__(flight.planner)
        self._late_ticks = flight.late_ticks
        self._late_us = 0

    def submit(self, request: PlanRequest) -> None:
        super().submit(request)
        self._late_us = STEP_US * self._late_ticks(request.plan_id)

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        return super().take(t_us - self._late_us)


def command(
    number: int, *params: float, frame: int | None = None, confirmation: int = 0
) -> Command:
    """A command as the link reads it; parameters that are not used are NaN."""
    p = (*params, *[float("nan")] * (7 - len(params)))
    values = (p[0], p[1], p[2], p[3], p[4], p[5], p[6])
    return read_command(CommandRequest(number, values, 255, 190, confirmation, frame), LOCATE)
