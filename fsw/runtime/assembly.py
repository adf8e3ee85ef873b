"""Builds the flight software from a configuration."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import cast

from fsw.autopilot.control.cascade import Inner
from fsw.autopilot.flight.state import first_state
from fsw.autopilot.flight.tuned_autopilot import TunedAutopilot
from fsw.autopilot.geometry.geodesy import DEFAULT_ORIGIN, to_local
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.control_choice import FULL, ControlChoice
from fsw.autopilot.parameters.flight_config import FlightConfig, above_px4, flight_config
from fsw.autopilot.ports import VehicleFacts
from fsw.autopilot.signals import Origin
from fsw.autopilot.tuning import Tuning, flat
from fsw.link.services.mission_store import MissionStore, Site
from fsw.runtime import clock
from fsw.runtime.program import FlightProgram
from fsw.storage.parameter_store import ParameterStore
from vehicles.description import Vehicle


def flight_software(
    choice: ControlChoice,
    *,
    origin: Origin = DEFAULT_ORIGIN,
    vehicle: Vehicle | None = None,
    to_plan: bool = True,
    px4: Tuning = (),
) -> FlightProgram:
    """Build the program and, unless ``to_plan`` is False, compile it: a minute the first time.

    For a ``vehicle``; without one, the paper's. Above PX4, ``px4`` is what is known of its loops
    at the start.

    Raises:
        ValueError: For an unknown name, listing the known ones.
    """
    config = configured(choice, origin, vehicle, px4)
    planner = Planner(config.planner, config.airframe, clock.stopwatch_us)
    flight = TunedAutopilot(config)
    if to_plan:
        planner.warm_up()
        flight.warm_up()
    # Whose defaults are those of a vehicle of which nothing is known.
    parameters = ParameterStore(configured(choice, origin, vehicle), flight.prepare)
    missions = MissionStore(
        Site(
            locate=partial(to_local, config.origin),
            clearance=lambda: flight.config.limits.fence_clearance,
            ceiling=lambda: flight.config.steering.highest,
        )
    )
    return FlightProgram(
        facts=vehicle_facts(config),
        first_state=first_state(config.airframe),
        control=flight.control,
        conclude=flight.conclude,
        planner=planner,
        parameters=parameters,
        missions=missions,
        numbers=flat(config),
    )


def configured(
    choice: ControlChoice,
    origin: Origin = DEFAULT_ORIGIN,
    vehicle: Vehicle | None = None,
    px4: Tuning = (),
) -> FlightConfig:
    """The configuration of the start; raises as :func:`flight_software` does."""
    # flight_config refuses unknown names of inner loops and solvers.
    config = flight_config(
        choice.controller,
        cast(Inner, choice.inner),
        choice.lambda_,
        solver=choice.solver,
        body=choice.body or FULL,
        soft=choice.allow_inconsistent,
        vehicle=vehicle,
    )
    if config.inner == "px4":
        config = above_px4(config, px4)
    return replace(config, origin=origin)


def vehicle_facts(config: FlightConfig) -> VehicleFacts:
    """The constants of a configuration that links and logs need."""
    return VehicleFacts(
        airframe=config.airframe,
        tick_period_us=config.tick_period_us,
        mpc_period_us=config.mpc_period_us,
        mpc_delay_us=config.plan_delay_ticks * config.tick_period_us,
        horizon=config.planner.horizon,
        sqp_iterations=config.planner.sqp_iterations,
    )
