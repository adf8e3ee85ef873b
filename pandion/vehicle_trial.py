"""What a flight of a vehicle would be refused for: each kind of flight is begun, and no more."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.parameters.flight_config import flight_config
from sitl.scenario import vehicle_of
from sitl.scenario_file import ScenarioError, load_scenario
from sitl.simulation import Simulation
from studies.flight.closed_loop import RefusedError, ScenarioFlight

TRIED: Final = ("ground", "walls", "gate", "workspace", "branches")
_STEPS: Final = {"ground": 1, "airborne": 2}  # to arm, and to follow the trajectory


def refusals(vehicle: str) -> list[str]:
    """Why simulator or flight software would not begin flights of a vehicle, a sentence each.

    It is named or the path of a file, as for ``pandion fly --vehicle``.
    """
    whys: dict[str, list[str]] = {}
    for name in TRIED:
        why = _refusal(name, vehicle)
        if why is not None:
            whys.setdefault(why, []).append(name)
    return [f"{_joined(names)} {why}" for why, names in whys.items()]


def _joined(names: list[str]) -> str:
    return (
        "no flight of it begins:" if names == [*TRIED] else f"it does not fly {', '.join(names)}:"
    )


def _refusal(name: str, vehicle: str) -> str | None:
    try:
        scenario = load_scenario(name, None, vehicle)
        simulation = Simulation(scenario, 0)
        config = flight_config(body=scenario.body, vehicle=vehicle_of(scenario))
        flight = ScenarioFlight(simulation, config)
        for _ in range(_STEPS[scenario.start.kind]):
            flight.step()
    except (ScenarioError, RefusedError) as error:
        return str(error)
    if simulation.ended is None:
        return None
    return f"{simulation.ended.sentence}: see where feet.positions and [[parts]] are"
