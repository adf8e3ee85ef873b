"""Margins over time by the simulator's true state, computed by what made ``result.json``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.mission_clock import MissionClock
from sitl.scenario import Scenario
from sitl.scenario_file import ScenarioError, load_scenario, scenario_digest
from view.recording import Recording

Array = NDArray[np.float64]
_TRUTH = "sim_ground_truth"
_STATE = ("p_WB", "v_WB", "q_WB", "w_WB_B", "thrust", "q_arm", "qd_arm")


@dataclass(frozen=True, slots=True)
class TrueMargins:
    """Margins at the logged samples of the true state."""

    keys: tuple[str, ...]  # zone/part, as in result.json
    t_s: Array  # (samples,) since the start
    values: Array  # (samples, keys) m; infinite while a zone does not apply
    places: Array  # (samples, 4, 3) m, NED: base, joint 1, joint 2, end-effector

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
        if not self.keys:
            return np.full(len(self.t_s), np.inf)
        return np.asarray(self.values.min(axis=1), dtype=np.float64)


def scenario_of(recording: Recording) -> Scenario | None:
    """The scenario that was flown, None where it is not among those of this build."""
    name = str(recording.facts.get("scenario", ""))
    try:
        if scenario_digest(name) != recording.facts.get("scenario_digest"):
            return None
        return load_scenario(name)
    except ScenarioError:
        return None


def true_margins(recording: Recording, scenario: Scenario) -> TrueMargins | None:
    """Margins of a flight; None for a log without truth.

    The samples are 20 ms apart (2 ms with ``LOG_PROFILE`` 1), those of ``result.json`` 1 ms.
    """
    truth = recording.topic(_TRUTH)
    if not len(truth):
        return None
    from sitl.world import World  # here, because it loads the kernels

    world, clock = World(scenario), MissionClock(scenario)
    t_s, placed = recording.seconds(_TRUTH), _placed(truth)
    values = np.empty((len(t_s), len(world.keys)))
    for row, time_s, places in zip(values, t_s.tolist(), placed, strict=True):
        target = clock.target_at(time_s).p if world.follows and clock.counts(time_s) else None
        row[:] = world.margins(places, time_s, target)
    return TrueMargins(world.keys, t_s, values, placed[:, :4])


def _placed(truth: Any) -> Array:
    """Base, joints, end-effector and the base's axes of each record, (records, 7, 3)."""
    from sitl.plant.aerial_manipulator import plant
    from sitl.plant.kinematics import places
    from sitl.plant.parameters import Vehicle

    numbers, out = plant(Vehicle()), np.empty((len(truth), 7, 3))
    states = np.concatenate([truth[name] for name in _STATE], axis=1)
    for k, state in enumerate(states):
        places(numbers, state, out[k : k + 1])
    return out
