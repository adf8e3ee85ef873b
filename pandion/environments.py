"""Environments for reinforcement learning, with the interface of Gymnasium.

    import gymnasium
    import pandion.environments

    env = gymnasium.make("pandion/Walls-v0")

``pandion/Walls-v0`` and ``pandion/Workspace-v0`` are the two cases of the paper with exact sensors:
the end-effector follows its reference, and margins, limits and collisions are judged by the referee
of every flight. They take ``vehicle=``, the name or file of another one than the paper's, and
``duration_s=``. Of the extra ``gym``: ``pip install gymnasium``.
"""

from __future__ import annotations

import math
from typing import Any, Final

import gymnasium
import numpy as np
from numpy.typing import NDArray

from pandion.scenarios import AnyScenario, load_scenario
from sitl.compiled import kernel
from sitl.plant.parameters import GRAVITY
from sitl.plant.state import Q_WB, THRUST, V_WB, W_WB_B
from sitl.plant.vector import Array
from sitl.result import EndKind
from sitl.scenario_file import ScenarioError
from sitl.simulation import Controls, Simulation
from sitl.world import fill_margins
from studies.flight.kernels import compile_first

Floats = NDArray[np.float32]

STEPS: Final = 10  # of 2 ms in one step of an environment
PLANT_S: Final = 0.002  # s, a plant step; twice that of a flight
EFFORT: Final = 0.01  # of the reward, per squared action
PENALTY: Final = 10.0  # of the reward, for an end before its time
_ARM: Final = 18  # where the joints are in an observation
_MOST: Final = 1e4  # of an observation; what is farther is cut off there
_IDS: Final = {"pandion/Walls-v0": "walls", "pandion/Workspace-v0": "workspace"}


class PandionEnv(gymnasium.Env[Floats, Floats]):
    """A scenario as an environment; a step is 20 ms.

    Action (r + j,), each −1 to 1, of r rotors and j joints in the order of the vehicle's file: at
    −1 a rotor is off, at 0 all of them carry the vehicle, at 1 it gives all it can; a joint gives
    that share of its largest torque. Of ``paper`` 0 to 17.1675 N and ±2 N m.

    Observation (21 + 2j + zones,), float32, NED and FRD: end-effector to its reference (3,) [m],
    velocity of the base (3,) [m/s], its rotation matrix body to world, row by row (9,), body rates
    (3,) [rad/s], joint angles (j,) [rad] and rates (j,) [rad/s], velocity of the reference (3,)
    [m/s], and the least margin to each zone [m].

    Reward: minus the distance to the reference [m], minus 0.01 times the squared length of the
    action, minus 10 where the episode ends before its time: a margin below 0, a collision, or a
    vehicle that diverges. Margins are looked at at the end of a step. ``info`` has ``margin_m``,
    ``error_m`` and at the end ``reason``.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        scenario: AnyScenario = "walls",
        *,
        duration_s: float = 20.0,
        vehicle: str | None = None,
    ) -> None:
        """Of a scenario that starts in the air, with exact sensors and actuators in still air.

        An episode takes ``duration_s`` [s]; ``vehicle`` names one or its file, None the scenario's.

        Raises:
            ScenarioError: The scenario cannot be flown so.
        """
        found = load_scenario(scenario, sensors="perfect", duration_s=duration_s, vehicle=vehicle)
        compile_first(halves=("sitl",))
        simulation = self._simulation = Simulation(found, 0)
        flown = simulation.vehicle
        self._rotors, self._joints = len(flown.rotors), len(flown.joints)
        full = sum(rotor.thrust_max for rotor in flown.rotors)
        self._carries = flown.mass * GRAVITY / full  # share of each rotor's thrust
        try:
            simulation.leap(self._controls([0.0] * (self._rotors + self._joints)), 1, PLANT_S)
        except ValueError as error:
            raise ScenarioError(f"{found.name}: {error}") from None
        self._scenario = found
        self._world = simulation.world
        zones = len(self._world.zones)
        bound = np.full(_ARM + 2 * self._joints + 3 + zones, _MOST, dtype=np.float32)
        self.observation_space = gymnasium.spaces.Box(-bound, bound, dtype=np.float32)
        one = np.ones(self._rotors + self._joints, dtype=np.float32)
        self.action_space = gymnasium.spaces.Box(-one, one, dtype=np.float32)
        self._margins = np.empty(len(self._world.keys))
        keys = [key.partition("/")[0] for key in self._world.keys]
        firsts = [keys.index(name) for name in dict.fromkeys(keys)]
        self._ends = np.array([*firsts, len(keys)])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode; its randomness is of ``seed``, or goes on from the last one."""
        super().reset(seed=seed)
        root = int(self.np_random.integers(2**31))
        self._simulation = Simulation(self._scenario, root)
        seen, error, margin = self._observe(self._simulation.places())
        return seen, {"error_m": error, "margin_m": margin, "seed": root}

    def step(self, action: Any) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Hold an action (r + j,) [1] for 20 ms."""
        wanted = np.asarray(action, dtype=np.float64).tolist()
        simulation = self._simulation
        places = simulation.leap(self._controls(wanted), STEPS, PLANT_S)
        seen, error, margin = self._observe(places)
        end = simulation.ended
        over = end is not None and end.kind is EndKind.DURATION
        failed = (end is not None and not over) or not margin >= 0.0
        effort = sum([one * one for one in wanted])
        reward = -error - EFFORT * effort - (PENALTY if failed else 0.0)
        info: dict[str, Any] = {"error_m": error, "margin_m": margin}
        if failed or over:
            info["reason"] = simulation.result().end_reason
        return seen, reward, failed, over and not failed, info

    def _controls(self, action: list[float]) -> Controls:
        h, rotors = self._carries, self._rotors
        thrust = [h + (1.0 - h if f > 0.0 else h) * f for f in action[:rotors]]
        return Controls(tuple(thrust), tuple(action[rotors:]), armed=True)

    def _observe(self, places: Array) -> tuple[Floats, float, float]:
        """The observation, the distance to the reference [m] and the least margin [m]."""
        simulation, world = self._simulation, self._world
        aim = simulation.clock.target_at(simulation.time_s)
        out = np.empty(self.observation_space.shape or (), dtype=np.float32)
        error, margin = _observe_into(
            world.table,
            world.parts,
            simulation.state,
            self._rotors,
            self._joints,
            places,
            simulation.time_s,
            aim.p,
            aim.v,
            self._margins,
            self._ends,
            out,
        )
        return out, error, margin


@kernel
def _observe_into(
    table: Any,
    parts: Any,
    state: Array,
    rotors: int,
    joints: int,
    places: Array,
    time_s: float,
    p: tuple[float, float, float],
    v: tuple[float, float, float],
    margins: Array,
    ends: NDArray[np.int64],
    out: Floats,
) -> tuple[float, float]:
    """Fill an observation ``out`` (21 + 2j + zones,); return the distance and least margin [m].

    Of a ``state`` (13 + r + 2j,) [SI] with so many ``rotors`` and ``joints``, and places
    (rows, 3) [m, NED], with a reference ``p`` [m, NED] and ``v`` [m/s]; margins (keys,) [m] are
    overwritten, ``ends`` (zones + 1,) [1] are theirs.
    """
    fill_margins(table, parts, places, time_s, p, margins)
    square, after_arm = 0.0, _ARM + 2 * joints
    for i in range(3):
        gap = p[i] - places[1 + joints, i]
        square += gap * gap
        out[i], out[3 + i] = gap, state[V_WB + i]
        out[15 + i], out[after_arm + i] = state[W_WB_B + i], v[i]
    w, x, y, z = state[Q_WB], state[Q_WB + 1], state[Q_WB + 2], state[Q_WB + 3]
    out[6], out[7], out[8] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    out[9], out[10], out[11] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    out[12], out[13], out[14] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    for i in range(2 * joints):
        out[_ARM + i] = state[THRUST + rotors + i]
    least = math.inf
    for k in range(len(ends) - 1):
        nearest = math.inf
        for i in range(ends[k], ends[k + 1]):
            nearest = min(nearest, margins[i])
        out[after_arm + 3 + k] = nearest
        least = min(least, nearest)
    for i in range(len(out)):
        out[i] = min(max(out[i], -_MOST), _MOST)
    return math.sqrt(square), least


for _id, _scenario in _IDS.items():
    gymnasium.register(
        _id,
        entry_point=f"{__name__}:PandionEnv",
        kwargs={"scenario": _scenario},
        order_enforce=False,
    )
