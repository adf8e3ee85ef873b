"""Margins over time by the simulator's true state, computed by what made ``result.json``."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.body import parts_of
from sitl.mission_clock import MissionClock
from sitl.scenario import Scenario, vehicle_of
from sitl.scenario_file import ScenarioError, load_scenario, scenario_digest
from view.flight_data import FlightData, Table

Array = NDArray[np.float64]
_TRUTH = "sim_ground_truth"
_STATE = ("p_WB", "v_WB", "q_WB", "w_WB_B", "thrust", "q_arm", "qd_arm")


@dataclass(frozen=True, slots=True)
class TrueMargins:
    """Margins at the logged samples of the true state."""

    keys: tuple[str, ...]  # zone/part, as in result.json
    t: Array  # (samples,) s, sensor time
    values: Array  # (samples, keys) m; infinite while a zone does not apply
    places: Array  # (samples, rows, 3) m, NED: rows of ``sitl.plant.places``
    tip: int  # the end-effector's row
    near: dict[
        str, int
    ]  # row of each part: a link's is at its end, what is on the base at its origin

    def of_zones(self) -> dict[str, Array]:
        """The least over the parts of each zone (samples,) [m], by zone."""
        zones = [key.partition("/")[0] for key in self.keys]
        return {
            zone: self.values[:, [name == zone for name in zones]].min(axis=1)
            for zone in dict.fromkeys(zones)
        }

    @property
    def least(self) -> Array:
        """The least of all (samples,) [m]; infinite without zones."""
        return np.asarray(self.values.min(axis=1, initial=np.inf), dtype=np.float64)


def scenario_of(flight: FlightData) -> Scenario | None:
    """The scenario that was flown, None where it is not among those of this build."""
    digest = flight.information.get("scenario_digest")
    # A flight from Python has its scenario beside the log.
    beside = str(flight.path.with_name("scenario.toml"))
    for name in (beside, str(flight.information.get("scenario", ""))):
        with contextlib.suppress(ScenarioError):
            if scenario_digest(name) == digest:
                return load_scenario(name)
    return None


def true_margins(flight: FlightData, scenario: Scenario) -> TrueMargins | None:
    """Margins of a flight; None for a log without truth.

    The samples are 20 ms apart (2 ms with ``LOG_PROFILE`` 1), those of ``result.json`` 1 ms.
    """
    truth = flight.tables.get(_TRUTH)
    if truth is None:
        return None
    from sitl.world import World  # here, because it loads the kernels

    world, clock = World(scenario), MissionClock(scenario)
    placed = _placed(truth, scenario)
    values = np.empty((len(truth), len(world.keys)))
    since = truth.t - flight.begin  # the simulation's time
    for row, time_s, places in zip(values, since.tolist(), placed, strict=True):
        target = clock.target_at(time_s).p if world.follows and clock.counts(time_s) else None
        row[:] = world.margins(places, time_s, target)
    vehicle = vehicle_of(scenario)
    near = {one.name: (one.end or one.begin)[0] for one in parts_of(scenario.body, vehicle)}
    tip = 1 + len(vehicle.joints)
    return TrueMargins(world.keys, truth.t, values, placed[:, :-3], tip, near)


def _placed(truth: Table, scenario: Scenario) -> Array:
    """Rows of ``sitl.plant.places`` and the base's axes of each record, (records, rows, 3)."""
    from sitl.plant.integrator import held, places
    from sitl.plant.parameters import plant
    from sitl.plant.places import rows_of

    vehicle = vehicle_of(scenario)
    out = np.empty((len(truth), rows_of(vehicle) + 3, 3))
    numbers, memory = plant(vehicle), held()
    states = np.concatenate([truth[name] for name in _STATE], axis=1)
    for k, state in enumerate(states):
        places(numbers, state, memory, out[k : k + 1])
    return out
