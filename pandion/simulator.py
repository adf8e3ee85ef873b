"""The simulator and the autopilot, stepped by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fsw.autopilot.estimation.estimator import estimate_state
from fsw.autopilot.model.airframe import airframe_of
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.signals import ActuatorCommand, StateEstimate, TickOutputs
from pandion.scenarios import AnyScenario, load_scenario
from sitl.plant.integrator import held, step
from sitl.plant.parameters import plant
from sitl.plant.places import rows_of
from sitl.result import TruthResult
from sitl.scenario import Scenario, vehicle_of
from sitl.simulation import Simulation, Truth
from sitl.start import effects, first_state, flown_vehicle
from studies.flight.closed_loop import ScenarioFlight, controls, readings
from studies.flight.kernels import compile_first
from studies.flight.mission import target
from studies.flight.own_parts import Observation, OwnParts, PushLaw, numbers, observed
from studies.flight.result import FlightResult
from vehicles.description import JOINTS_MAX, ROTORS_MAX

Array = NDArray[np.float64]
Floats = Array | Sequence[float]
_NAN3 = (math.nan,) * 3


class Simulator:
    """The vehicle in its scenario; a step is 2 ms, in which the plant takes two of its own.

    The referee looks at every one of these: it ends the flight at a collision, and keeps margins
    and the tracking error as it does for ``pandion fly``.
    """

    def __init__(
        self,
        scenario: AnyScenario = "walls",
        seed: int = 0,
        *,
        sensors: str | None = None,
        duration_s: float | None = None,
        vehicle: str | None = None,
        disturbance: PushLaw | None = None,
    ) -> None:
        """Load the scenario; :meth:`reset` begins a flight.

        Args:
            scenario: As of ``pandion.load_scenario``.
            seed: Root of all randomness of the flight, 0 or more.
            sensors: As of ``pandion.load_scenario``.
            duration_s: The same.
            vehicle: Name or file of the one that flies; None: the scenario's.
            disturbance: Acceleration (3,) [m/s², NED] of the base at a time [s], on top.

        Raises:
            ScenarioError: The scenario cannot be flown.
        """
        self.scenario: Scenario = load_scenario(
            scenario, sensors=sensors, duration_s=duration_s, vehicle=vehicle
        )
        self._airframe = airframe_of(vehicle_of(self.scenario))
        self.seed = seed
        self._parts = OwnParts(disturbance=disturbance)
        self._pilot: Autopilot | None = None
        compile_first(halves=("sitl",))
        self.reset()

    def reset(self, seed: int | None = None) -> Observation:
        """Begin the flight anew, with another ``seed`` if one is given; what is observed first."""
        self.seed = self.seed if seed is None else seed
        self.simulation = Simulation(self.scenario, self.seed, self._parts.pushes())
        self._pilot = None
        return self.observe()

    def observe(self) -> Observation:
        """What the sensors say in this step; with a suite only ``samples``, all else is NaN."""
        frame, samples = readings(self.simulation)
        estimate = None if samples else estimate_state(frame)
        aim = target(self.simulation.clock, self.simulation.t_us)
        bodies = self._airframe.bodies
        seen = observed(estimate or _unknown(bodies.joints), aim, bodies)
        return replace(seen, samples=samples) if samples else seen

    def step(self, thrust: Floats, torque: Floats, armed: bool = True) -> Observation:
        """Let rotors and joints do this for 2 ms; what is observed then.

        Args:
            thrust: Of the rotors (r,) [N], in the order of the vehicle's file.
            torque: Of the joints (j,) [N m].
            armed: Of a vehicle that is not, rotors and joints are off.

        Raises:
            OwnPartError: They have another shape or are not finite.
            RuntimeError: The flight is over.
        """
        if self.over:
            raise RuntimeError(f"the flight is over: {self.end_reason}; reset() begins another")
        airframe = self._airframe
        f = numbers("thrust", thrust, (airframe.rotors,)).tolist()
        t = numbers("torque", torque, (airframe.bodies.joints,)).tolist()
        command = ActuatorCommand(tuple(f), tuple(t))
        self.simulation.advance(controls(airframe, command, armed=armed))
        if self._pilot is not None:
            self._pilot.conclude()
        return self.observe()

    @property
    def over(self) -> bool:
        """Whether the flight has ended."""
        return self.simulation.ended is not None

    @property
    def end_reason(self) -> str:
        """Why, in a sentence; empty while it goes on."""
        return "" if self.simulation.ended is None else self.simulation.ended.sentence

    @property
    def time_s(self) -> float:
        """Since the start [s]."""
        return self.simulation.time_s

    @property
    def truth(self) -> Truth:
        """The true state now, with the margin of every part from every zone."""
        return self.simulation.truth()

    @property
    def hover(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Thrusts (r,) [N] and torques (j,) [N m] that hold the vehicle as it starts."""
        trim = self.simulation.trim
        return np.array(trim.thrust), np.array(trim.torque)

    @property
    def result(self) -> TruthResult:
        """The referee's verdict so far."""
        return self.simulation.result()

    def linear_model(self) -> tuple[Array, Array]:
        """A (12 + 2j, 12 + 2j) and B (12 + 2j, r + j) [SI] of a step of 2 ms about the first hover.

        Of ``Observation.state``, and of thrusts and joint torques; rotors without their lag.
        """
        vehicle, trim = flown_vehicle(self.scenario), self.simulation.trim
        model, blocks = plant(vehicle, effects(self.scenario)), held()
        plants: Any = np.array([model])
        rest, _ = first_state(vehicle, self.scenario, self.simulation.clock.target_at(0.0).p)
        rotors, joints = len(vehicle.rotors), len(vehicle.joints)
        places, states = np.empty((2, rows_of(vehicle), 3)), np.empty((2, len(rest)))
        motors, size = slice(13, 13 + rotors), 12 + 2 * joints
        out: list[Array] = []
        hover = np.array([*trim.thrust, *trim.torque])

        def moved(x: Array, u: Array) -> Array:
            state = rest.copy()
            state[:6] += x[:6]
            turn = Rotation.from_rotvec(x[6:9]) * Rotation.from_quat(rest[6:10], scalar_first=True)
            state[6:10] = turn.as_quat(scalar_first=True)
            state[10:13] += x[9:12]
            state[motors] = f = (hover + u)[:rotors]
            state[motors.stop :] += x[12:]
            torque = (*(hover + u)[rotors:].tolist(), *(0.0,) * (JOINTS_MAX - joints))
            none = (0.0, 0.0, 0.0)
            push = (*f.tolist(), *(0.0,) * (ROTORS_MAX - rotors)), torque, none, none, 0.001
            step(plants, blocks, state, *push, places, states)
            back = Rotation.from_quat(state[6:10], scalar_first=True)
            arm = state[motors.stop :]
            return np.concatenate([state[:6], back.as_rotvec(), state[10:13], arm])

        for k in range(size + rotors + joints):
            by = np.zeros(size + rotors + joints)
            by[k] = 1e-5
            more, less = moved(by[:size], by[size:]), moved(-by[:size], -by[size:])
            out.append((more - less) / 2e-5)
        both = np.array(out).T
        return both[:, :size], both[:, size:]


def _unknown(joints: int) -> StateEstimate:
    arm = (math.nan,) * joints
    return StateEstimate(0, _NAN3, _NAN3, (math.nan,) * 9, _NAN3, math.nan, arm, arm)


class Autopilot:
    """Our autopilot for a simulator that is stepped by hand: ``sim.step(*autopilot())``.

    It reads the simulator's sensors itself, and plans when it is time to.
    """

    def __init__(self, simulator: Simulator, config: FlightConfig | None = None) -> None:
        """Take over a flight that has just begun.

        Args:
            simulator: After its ``reset``; the scenario starts in the air with a trajectory.
            config: Configuration of the flight software; None: the scenario's.

        Raises:
            ScenarioError: The body of the configuration starts outside the safe set.
            RuntimeError: The flight has begun already.
        """
        if simulator.simulation.step:
            raise RuntimeError("the flight has begun: reset() the simulator first")
        compile_first(halves=("fsw",))
        config = config or flight_config(
            body=simulator.scenario.body, vehicle=vehicle_of(simulator.scenario)
        )
        self._flight = ScenarioFlight(simulator.simulation, config, simulator.seed)
        self._outputs: TickOutputs | None = None
        simulator._pilot = self

    def __call__(self, seen: Observation | None = None) -> tuple[Any, Any, bool]:
        """Thrusts (r,) [N], joint torques (j,) [N m] and whether the vehicle is armed."""
        self._outputs = self._flight.respond()
        (thrust, torque), mode = self._outputs.actuators, self._outputs.mode
        return thrust, torque, mode.armed

    def conclude(self) -> None:
        """Note what a step has brought; the simulator calls it."""
        if self._outputs is not None:
            outputs, self._outputs = self._outputs, None
            self._flight.conclude(outputs)

    @property
    def result(self) -> FlightResult:
        """The verdict, and what the planner did."""
        return self._flight.result()
