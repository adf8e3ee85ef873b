"""Calm ticks say and leave what whole ones do, to the last bit; what is not calm is flown whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from dataclasses import replace as with_fields
from functools import partial
from typing import Any

import numpy as np
import pytest

from fsw.autopilot.estimation.fusion_memory import FusionMemory, Trail
from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.flight.state import AIDED, FlightState
from fsw.autopilot.measurements import ImuSample, Sample
from fsw.autopilot.model.actuator_health import ActuatorHealth
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import Mode, SensorFrame, TickInputs, TickOutputs
from fsw.frozen import replace
from sitl.disturbances.items import Uniform
from sitl.faults.keys import Fault
from sitl.scenario_file import load_scenario
from sitl.simulation import Simulation
from studies.flight.closed_loop import FIRST_COMMANDS, ClosedLoop, InlinePlanner, simulate

in_long = partial(pytest.param, marks=pytest.mark.long)


def told(x: Any) -> Any:
    """A filter's memory as what compares equal only bit by bit, and NaN with NaN."""
    if isinstance(x, np.ndarray):
        return x.tobytes()
    if isinstance(x, Trail):
        return x.began, x.ticks is None or repr(x.ticks[0])
    if isinstance(x, FusionMemory):
        return [told(getattr(x, field.name)) for field in fields(x)]
    return tuple(map(told, x)) if isinstance(x, tuple) else repr(x)


def halves(one: Sample) -> tuple[Sample, ...]:
    """A reading, after another one of a millisecond before if it is the inertial unit's."""
    if not isinstance(one, ImuSample):
        return (one,)
    return replace(one, time=one.time - 1e-3), one


class Flight:
    """A flight in the air, whose ticks are counted that are not controlled whole."""

    def __init__(
        self,
        name: str,
        push: float = 0.0,
        suite: str = "perfect",
        fault: Fault | None = None,
        *,
        twice: bool = False,
    ) -> None:
        """With an inertial unit that measures ``twice`` in each tick."""
        scenario = load_scenario(name, suite)
        if fault is not None:
            scenario = with_fields(scenario, faults=(fault,))
        if push > 0.0:
            scenario = with_fields(scenario, disturbances=(Uniform(push, 0.1),))
        config = flight_config(body=scenario.body)
        self.autopilot, self.plain = Autopilot(config), Autopilot(config)
        self.plain.calm.fly = lambda *_: None  # type: ignore[method-assign]
        self.planner = InlinePlanner(Planner(config.planner, config.airframe, lambda: 0.0))
        self.loop = ClosedLoop(Simulation(scenario, 7), self.tick, self.planner, config.airframe)
        self.calm, self._twice = 0, twice

    def tick(self, state: FlightState, inputs: TickInputs) -> tuple[FlightState, TickOutputs]:
        controlled = self.autopilot.control(state, inputs)
        self.calm += controlled.calm
        ours, said = self.autopilot.conclude(controlled)
        plain, expected = self.plain.tick(state, inputs)
        assert said.snapshot == expected.snapshot
        assert replace(said, shown=None) == replace(expected, shown=None)
        assert replace(ours, fusion=None) == replace(plain, fusion=None)
        assert told(ours.fusion) == told(plain.fusion)
        return ours, said

    def fly(self, ticks: int) -> None:
        loop = self.loop
        for _ in range(ticks):
            step, (sensors, samples) = loop.simulation.step, loop.observe()
            if loop.simulation.ended is not None:
                return
            if self._twice:
                samples = tuple([half for one in samples for half in halves(one)])
            loop.step(
                TickInputs(
                    sensors=sensors,
                    plan=self.planner.take(sensors.t_us),
                    commands=FIRST_COMMANDS[step] if step < 2 else (),
                    targets=loop.targets(),
                    announced=loop.announced(),
                    samples=samples,
                )
            )


@pytest.mark.parametrize(
    ("name", "ticks", "push", "min_calm"),
    [
        ("walls", 2000, 0.0, 0.88),
        in_long("workspace", 1500, 0.0, 0.88),
        ("branches", 1500, 0.0, 0.88),
        in_long("walls-calm", 1500, 0.0, 0.9),
        ("crossing", 1500, 0.0, 0.0),
        # Pushed off its plan, filtered, saturated, replanned, and retreating in the end.
        ("walls", 2000, 3.0, 0.0),
        in_long("workspace", 1500, 3.0, 0.0),
    ],
)
def test_a_calm_tick_is_a_whole_one_to_the_last_bit(
    name: str, ticks: int, push: float, min_calm: float
) -> None:
    flight = Flight(name, push)
    flight.fly(ticks)
    assert flight.calm >= min_calm * flight.loop.simulation.step


@pytest.mark.parametrize(
    ("suite", "push", "min_calm"),
    [("mocap", 0.0, 0.85), ("vio", 0.0, 0.7), ("rtk", 0.0, 0.7), ("mocap", 3.0, 0.0)],
)
def test_so_is_one_of_a_suite(suite: str, push: float, min_calm: float) -> None:
    flight = Flight("walls", push, suite)
    flight.fly(1500)
    assert flight.calm >= min_calm * flight.loop.simulation.step


@pytest.mark.parametrize("suite", ["mocap", "vio", "rtk"])
def test_so_is_one_with_two_readings_of_the_inertial_unit(suite: str) -> None:
    """Which the filter takes in by two calls, of which the last closes the loops."""
    flight = Flight("walls", suite=suite, twice=True)
    flight.fly(700)
    assert flight.calm >= 0.4 * flight.loop.simulation.step


@pytest.mark.parametrize(
    "fault",
    [
        Fault("motor", "weak", start_s=1.0, instance=2),
        Fault("gyro", "stuck", start_s=1.0),
        Fault("vio", "off", start_s=1.0, duration_s=0.5),
    ],
    ids=lambda fault: f"{fault.unit} {fault.kind}",
)
def test_what_fails_in_a_suite_ends_the_calm(fault: Fault) -> None:
    flight = Flight("walls", suite="mocap", fault=fault)
    flight.fly(1200)
    assert 400 < flight.calm < 1100
    assert bool(flight.loop.state.damage.rotor) == (fault.unit == "motor")


@pytest.mark.parametrize(("name", "push"), [("walls", 0.0), in_long("workspace", 3.0)])
def test_a_study_flies_the_same_flight_without_inputs_and_outputs(name: str, push: float) -> None:
    scenario = with_fields(load_scenario(name), duration_s=3.0)
    if push > 0.0:
        scenario = with_fields(scenario, disturbances=(Uniform(push, 0.1),))
    config = flight_config(body=scenario.body)
    # Traced flights have inputs and outputs in every tick.
    plain, ours = (simulate(scenario, 7, config, traced=traced) for traced in (True, False))
    assert ours.truth == plain.truth
    assert ours.planner.texts == plain.planner.texts
    assert ours.planner.metrics.as_json() == plain.planner.metrics.as_json()


def test_where_sensors_fail_a_study_has_inputs_in_every_tick() -> None:
    scenario, fault = load_scenario("walls-calm"), Fault("motor", "weak", start_s=1.0)
    assert Simulation(scenario, 0).tells_its_state
    assert not Simulation(with_fields(scenario, faults=(fault,)), 0).tells_its_state
    injected = Simulation(scenario, 0)
    injected.inject(fault)
    assert not injected.tells_its_state


@pytest.fixture(scope="module")
def calm() -> tuple[Flight, FlightState, SensorFrame]:
    """A flight, a state of it that is calm, and the next frame; nothing changes them."""
    flight = Flight("walls-calm")
    flight.fly(61)
    return flight, flight.loop.state, flight.loop.observe()[0]


CHANGES: dict[str, Callable[[FlightState], FlightState]] = {
    "another mode": lambda s: replace(s, vehicle=replace(s.vehicle, mode=Mode.HOLD)),
    "a condition": lambda s: replace(
        s, vehicle=replace(s.vehicle, conditions=(Condition.BATTERY_LOW,))
    ),
    "a restart": lambda s: replace(s, vehicle=replace(s.vehicle, restarts=True)),
    "contact with the ground": lambda s: replace(
        s, vehicle=replace(s.vehicle, unloaded=(s.t_us, 0.0))
    ),
    "off the plan": lambda s: replace(s, safety=replace(s.safety, off_plan_us=s.t_us)),
    "a filtered tick": lambda s: replace(s, safety=replace(s.safety, filter_us=s.t_us)),
    "a breach": lambda s: replace(s, safety=replace(s.safety, breach_us=s.t_us)),
    "a rotor": lambda s: replace(s, damage=s.damage._replace(rotor="rotor 1 gives nothing")),
    "a joint": lambda s: replace(s, damage=s.damage._replace(joint="joint 1 does not move")),
    "another health": lambda s: replace(s, damage=s.damage._replace(health=ActuatorHealth())),
    "a pose that is missing": lambda s: replace(s, aiding=AIDED._replace(unaided_us=2000)),
    "no plan": lambda s: replace(s, plan=replace(s.plan, running=None)),
    "a plan that was refused": lambda s: replace(s, plan=replace(s.plan, refused=True)),
    "a plan that is due": lambda s: replace(
        s, plan=replace(s.plan, awaited_id=9, awaited_us=s.t_us + 2000)
    ),
    "no more targets": lambda s: replace(s, mission=replace(s.mission, stream=())),
    "a time that is missing": lambda s: replace(s, t_us=s.t_us - 2000),
}


@pytest.mark.parametrize("what", CHANGES)
def test_no_tick_is_calm_while_something_goes_on(
    calm: tuple[Flight, FlightState, SensorFrame], what: str
) -> None:
    flight, state, frame = calm
    assert flight.autopilot.control(state, TickInputs(frame)).calm
    assert flight.autopilot.calm.fly(CHANGES[what](state), TickInputs(frame)) is None


FRAMES: dict[str, Callable[[SensorFrame], SensorFrame]] = {
    "a place that is none": lambda f: with_fields(f, p_WB=(np.nan, 0.0, -1.0)),
    "a place beyond all range": lambda f: with_fields(f, p_WB=(0.0, 1e6, -1.0)),
    "a rate that is none": lambda f: with_fields(f, gyro_B=(np.inf, 0.0, 0.0)),
    "off the plan": lambda f: with_fields(f, p_WB=(*f.p_WB[:2], f.p_WB[2] + 0.2)),
    "on its back": lambda f: with_fields(f, q_WB=(0.0, 1.0, 0.0, 0.0)),
    "a joint rate out of range": lambda f: with_fields(f, qd_arm=(200.0, 0.0)),
}


@pytest.mark.parametrize("what", FRAMES)
def test_a_frame_that_has_to_be_looked_at_is_flown_whole(
    calm: tuple[Flight, FlightState, SensorFrame], what: str
) -> None:
    flight, state, frame = calm
    inputs = TickInputs(FRAMES[what](frame))
    assert not flight.autopilot.control(state, inputs).calm
    ours, _ = flight.tick(state, inputs)
    assert ours.t_us == frame.t_us
    assert flight.autopilot.control(state, TickInputs(frame)).calm, "the state is what it was"


INPUTS: dict[str, dict[str, Any]] = {
    "a command": {"commands": FIRST_COMMANDS[0]},
    "an old frame": {"stale_us": 2000},
    "a ground station": {"ground_station_heard": True},
    "a refusal": {"refused": ("no",)},
    "a tuning": {"tuning": ()},
    "a jump of the clock": {"sensor_clock_jump_us": -5},
}


@pytest.mark.parametrize("what", INPUTS)
def test_what_else_comes_is_taken_in_by_a_whole_tick(
    calm: tuple[Flight, FlightState, SensorFrame], what: str
) -> None:
    flight, state, frame = calm
    assert not flight.autopilot.control(state, TickInputs(frame, **INPUTS[what])).calm
