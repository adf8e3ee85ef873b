"""Planners, controllers and disturbances of a user in place of ours, and what watches them.

A part is an object, or named ``module:Name`` for flights that other processes fly. Whatever it is,
the referee, the limits and the failsafes are the same, and what it answers is checked: a wrong
shape, unit or type, a number that is none, and an answer that takes too long end the flight with
one sentence.

Our autopilot flies along with an own controller. The controller's command goes to the actuators as
long as the safety filter lets the acceleration pass that it gives; where not, and in every mode but
the trajectory's, ours does, for at least ``HANDOVER_S``.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import inspect
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any, Final, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.safety_gate import gate, stopped
from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.flight.fast_loop import loops_of
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.measurements import Sample
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.model.kinematics import end_effector
from fsw.autopilot.model.multibody import Bodies
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.ports import PlanningCycle
from fsw.autopilot.signals import (
    ActuatorCommand,
    EndEffectorTarget,
    Mode,
    Plan,
    PlanFailure,
    PlanInput,
    PlanRequest,
    PlanTimings,
    SolverStatus,
    StateEstimate,
    TickInputs,
    TickOutputs,
)
from fsw.frozen import replace
from sitl.mission_clock import MissionClock
from sitl.simulation import START_US, STEP_US
from studies.flight.mission import target
from studies.flight.own_filter import passes
from studies.flight.result import FlightRecorder, processor_time_us

Array: TypeAlias = NDArray[np.float64]
PushLaw: TypeAlias = Callable[[float], Any]
"""Acceleration (3,) [m/s², NED] that pushes the base at a time [s] since the start."""

HANDOVER_S: Final = 0.5  # for which our autopilot keeps a vehicle that it has caught
_CALLS: Final = 50  # of which the median time counts
_BASE_INPUTS: Final = 4  # numbers of a PlanInput beside the joints'
_MAX_A: Final = 50.0  # m/s^2 and rad/s^2; more is a slip of unit
_MAX_SHARE: Final = 3.0  # of a rotor's thrust or a joint's torque; the same
_MIN_LIFT: Final = 0.25  # of the weight, of the first command of a vehicle that hovers


class OwnPartError(ValueError):
    """A part of the user's that cannot be flown with, in one sentence."""


@dataclass(frozen=True, slots=True)
class Observation:
    """What an own controller knows in a tick. World W is NED, body B is FRD, E the end-effector."""

    t: float  # s, since the start
    p_WB: Array  # (3,) m
    v_WB: Array  # (3,) m/s
    R_WB: Array  # (3, 3), body to world
    w_WB_B: Array  # (3,) rad/s, written in B
    q_arm: Array  # (j,) rad, joints
    qd_arm: Array  # (j,) rad/s
    p_WE: Array  # (3,) m
    p_target: Array  # (3,) m, the end-effector's reference
    v_target: Array  # (3,) m/s
    a_target: Array  # (3,) m/s^2
    yaw_target: float  # rad
    samples: tuple[Sample, ...] = ()  # of a suite, where there is no estimate: all else is NaN

    @property
    def yaw(self) -> float:
        """Yaw [rad, ZYX]."""
        return math.atan2(self.R_WB[1, 0], self.R_WB[0, 0])

    @property
    def state(self) -> Array:
        """Position, velocity, rotation vector, body rates, joints, their rates (12 + 2j,) [SI]."""
        turn = Rotation.from_matrix(self.R_WB).as_rotvec()
        parts = self.p_WB, self.v_WB, turn, self.w_WB_B, self.q_arm, self.qd_arm
        return np.concatenate(parts)


class OwnPlanner(Protocol):
    """What ``planner=`` takes: ``plan`` answers a request, or says why not."""

    def plan(self, request: PlanRequest) -> Any:
        """Answer with a Plan, a PlanFailure, None, or inputs (n, 4 + j) [SI].

        Each row is ``[a_x, a_y, a_z, yaw acceleration, joint accelerations]`` of a period.
        """


OwnLaw: TypeAlias = Callable[[Observation], Any]
"""Thrusts (r,) [N] and joint torques (j,) [N m] for what is observed, or all in one array."""


@dataclass(frozen=True, slots=True)
class OwnParts:
    """What takes the place of ours in a flight; None: ours."""

    planner: Any = None  # OwnPlanner, or a class of them
    controller: Any = None  # OwnLaw, or a class of them
    disturbance: PushLaw | None = None  # on top of the scenario's
    allow_slow: bool = False  # fly with a part that could not keep up with a vehicle

    def pushes(self) -> tuple[Any, ...]:
        """The disturbance as the simulation takes it."""
        return () if self.disturbance is None else (_OwnPush(self.disturbance),)

    def planning(self, config: FlightConfig) -> PlanningCycle | None:
        """The planner, checked; None: ours."""
        planner = self.planner if self.planner is not None else _named(config.own_planner)
        if planner is None:
            return None
        return WatchedPlanner(_instance(planner), config, allow_slow=self.allow_slow)

    def law(
        self, autopilot: Autopilot, clock: MissionClock, recorder: FlightRecorder
    ) -> WatchedController | None:
        """The controller with our autopilot beside it; None: ours alone."""
        config = autopilot.config
        law = self.controller if self.controller is not None else _named(config.own_controller)
        if law is None:
            return None
        return WatchedController(
            _instance(law), autopilot, clock, recorder, allow_slow=self.allow_slow
        )


OURS: Final = OwnParts()


def planner_of(config: FlightConfig, parts: OwnParts = OURS) -> PlanningCycle:
    """The planner of a flight: that of the parts, the one that the configuration names, or ours.

    Raises:
        OwnPartError: It cannot be used.
    """
    import studies.flight.rival_planners  # noqa: F401 - whose names a configuration may have

    own = parts.planning(config)
    return own or Planner(config.planner, config.airframe, processor_time_us)


def with_parts(config: FlightConfig, planner: str, controller: str) -> FlightConfig:
    """A configuration that is flown with parts by their names, ``module:Name``; empty: ours.

    Raises:
        OwnPartError: There is no such part.
    """
    return dataclasses.replace(
        config,
        own_planner=named_part(planner) if planner else "",
        own_controller=named_part(controller) if controller else "",
    )


def named_part(path: str) -> str:
    """``module:Name`` with a digest of the module's text, by which other processes know it.

    Raises:
        OwnPartError: There is no such part.
    """
    _, module = _found(path)
    return f"{path.partition('@')[0]}@{_digest(module)}"


def _named(path: str) -> Any:
    """The part that a configuration names; None: none."""
    if not path:
        return None
    part, module = _found(path)
    known = path.partition("@")[2]
    if known and known != _digest(module):
        raise OwnPartError(f"{path}: the module is another one here; give all machines the same")
    return part


def _found(path: str) -> tuple[Any, Any]:
    module, colon, name = path.partition("@")[0].partition(":")
    if not (module and colon and name):
        raise OwnPartError(f'"{path}": must be module:Name, such as mymodule:MyPlanner')
    if str(Path.cwd()) not in sys.path:
        sys.path.append(str(Path.cwd()))
    try:
        found = importlib.import_module(module)
    except Exception as error:  # whatever a user's module raises
        raise OwnPartError(f"{module} cannot be imported: {_said(error)}") from error
    if not hasattr(found, name):
        raise OwnPartError(f"{module} has no {name}")
    return getattr(found, name), found


def _digest(module: Any) -> str:
    return hashlib.sha256(inspect.getsource(module).encode()).hexdigest()[:12]


def _instance(part: Any) -> Any:
    """A part of a class, made for this flight."""
    if isinstance(part, str):
        part = _named(part)
    if not inspect.isclass(part):
        return part
    try:
        return part()
    except Exception as error:  # whatever a user's class raises
        raise OwnPartError(f"{part.__name__} cannot be made: {_said(error)}") from error


def _said(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def numbers(what: str, given: Any, shape: tuple[int, ...]) -> Array:
    """What a part has ``given`` as floats of a ``shape`` [1].

    Raises:
        OwnPartError: It has another shape, or is not finite.
    """
    try:
        found = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise OwnPartError(
            f"{what}: must be {_shape(shape)} numbers, not {type(given).__name__}"
        ) from None
    if len(found.shape) != len(shape) or any(
        n not in (-1, m) for n, m in zip(shape, found.shape, strict=False)
    ):
        raise OwnPartError(f"{what}: must have shape {_shape(shape)}, has {found.shape}")
    if not np.isfinite(found).all():
        raise OwnPartError(f"{what}: {found.tolist()}: every number must be finite")
    return found


def _shape(shape: tuple[int, ...]) -> str:
    words = ["n" if one < 0 else str(one) for one in shape]
    return f"({words[0]},)" if len(words) == 1 else f"({', '.join(words)})"


@dataclass(slots=True)
class _Pace:
    """Whether a part keeps up: the median processor time of its calls."""

    what: str
    max_us: float
    allow_slow: bool
    took_us: list[float] = field(default_factory=list)

    def call(self, part: Callable[[Any], Any], given: Any, t: float) -> Any:
        """The part's answer at a time ``t`` [s].

        Raises:
            OwnPartError: It raises, or takes too long.
        """
        begun = processor_time_us()
        try:
            answer = part(given)
        except Exception as error:  # whatever a user's part raises
            raise OwnPartError(f"{self.what} at {t:.3f} s: {_said(error)}") from error
        if len(self.took_us) < _CALLS and not self.allow_slow:
            self.took_us.append(processor_time_us() - begun)
            if len(self.took_us) == _CALLS and median(self.took_us) > self.max_us:
                raise OwnPartError(
                    f"{self.what} is too slow: the median of {_CALLS} calls is "
                    f"{1e-3 * median(self.took_us):.2f} ms, must be within "
                    f"{1e-3 * self.max_us:g} ms; allow_slow=True flies it all the same"
                )
        return answer


class WatchedPlanner:
    """An own planner whose answers are checked; after a failsafe has ended the trajectory, ours."""

    def __init__(self, planner: OwnPlanner, config: FlightConfig, *, allow_slow: bool) -> None:
        plan: Any = getattr(planner, "plan", None)
        if not callable(plan):
            raise OwnPartError(f"planner {type(planner).__name__}: must have plan(request)")
        self._plan, self._period_us = plan, config.mpc_period_us
        self._ours = Planner(config.planner, config.airframe, processor_time_us)
        self._inputs = _BASE_INPUTS + config.airframe.bodies.joints
        self._begun = False
        self._pace = _Pace("planner", config.mpc_period_us, allow_slow)

    def plan(self, request: PlanRequest) -> Plan | PlanFailure:
        """See ``PlanningCycle``.

        Raises:
            OwnPartError: The answer cannot be flown.
        """
        self._begun = self._begun or request.mode is Mode.TRAJECTORY
        if self._begun and request.mode is not Mode.TRAJECTORY:
            return self._ours.plan(request)
        t = 1e-6 * (request.t_apply_us - START_US)
        begun = processor_time_us()
        answer = self._pace.call(self._plan, request, t)
        timings = PlanTimings(-1.0, -1.0, processor_time_us() - begun)
        if answer is None:
            answer = PlanFailure(request.plan_id, SolverStatus.UNKNOWN, "no plan", timings)
        if isinstance(answer, PlanFailure):
            return replace(answer, plan_id=request.plan_id, timings=timings)
        given = answer.inputs if isinstance(answer, Plan) else answer
        if isinstance(answer, Plan):
            given = [(*one.a, one.yaw_acc, *one.qdd_arm) for one in answer.inputs]
        found = numbers(f"plan for {t:.3f} s", given, (-1, self._inputs))
        if not len(found):
            raise OwnPartError(f"plan for {t:.3f} s: must have at least one input")
        if not np.abs(found).max() <= _MAX_A:
            raise OwnPartError(
                f"plan for {t:.3f} s: an acceleration of {np.abs(found).max():g}, must be within "
                f"±{_MAX_A:g} m/s² and rad/s²"
            )
        inputs = tuple([PlanInput((x, y, z), w, tuple(qdd)) for x, y, z, w, *qdd in found.tolist()])
        if isinstance(answer, Plan):
            return replace(
                answer,
                plan_id=request.plan_id,
                t_us=request.t_apply_us,
                start=request.start,
                period_us=self._period_us,
                inputs=inputs,
                timings=timings,
            )
        return Plan(
            request.plan_id,
            request.t_apply_us,
            self._period_us,
            request.start,
            inputs,
            SolverStatus.SOLVED,
            *(0.0, 0.0, (), 1, 1),
            timings,
        )


class WatchedController:
    """An own controller, with our autopilot beside it."""

    def __init__(
        self,
        law: OwnLaw,
        autopilot: Autopilot,
        clock: MissionClock,
        recorder: FlightRecorder,
        *,
        allow_slow: bool,
    ) -> None:
        if not callable(law):
            raise OwnPartError(f"controller {type(law).__name__}: must be callable")
        config = autopilot.config
        self._law, self._autopilot, self._clock, self._recorder = law, autopilot, clock, recorder
        self._airframe = config.airframe
        self._pace = _Pace("controller", config.tick_period_us, allow_slow)
        self._last = stopped(config.airframe)
        self._ours_until_us = 0
        self._cascade = loops_of(config)
        self._tick_s, self._first = 1e-6 * config.tick_period_us, True

    def tick(self, state: FlightState, inputs: TickInputs) -> tuple[FlightState, TickOutputs]:
        """A tick of our autopilot, with the own command in place of its where that may fly.

        Raises:
            OwnPartError: The command cannot be flown.
        """
        state, outputs = self._autopilot.tick(state, inputs)
        estimate = state.record.state_estimate
        if outputs.mode is not Mode.TRAJECTORY or estimate is None or not state.vehicle.flies:
            return state, outputs
        t_us = inputs.sensors.t_us
        seen = observed(estimate, target(self._clock, t_us), self._airframe.bodies)
        command = self._checked(self._pace.call(self._law, seen, seen.t), seen.t)
        command, _ = gate(self._airframe, command, self._last, armed=True)
        zones = self._autopilot.zones_now(state)
        if not passes(self._cascade, state.record, zones, command):
            if t_us > self._ours_until_us:
                text = "safety filter: own controller overridden"
                self._recorder.texts.append((seen.t, text))
            self._ours_until_us = t_us + round(1e6 * HANDOVER_S)
        if t_us < self._ours_until_us:
            self._recorder.overridden_s += self._tick_s
            self._last = outputs.actuators
            return state, outputs
        self._last = state.record.actuator_command = command
        # Our plans begin where this controller has led the vehicle, not where ours would have.
        if outputs.plan_request is not None:
            state = replace(state, safety=replace(state.safety, replan=True))
        return state, replace(outputs, actuators=command)

    def _checked(self, given: Any, t: float) -> ActuatorCommand:
        what, airframe = f"command at {t:.3f} s", self._airframe
        rotors, joints = airframe.rotors, airframe.bodies.joints
        if isinstance(given, tuple) and len(given) == 2:
            thrust, torque = numbers(what, given[0], (rotors,)), numbers(what, given[1], (joints,))
        else:
            found = numbers(what, given, (rotors + joints,))
            thrust, torque = found[:rotors], found[rotors:]
        for name, values, limits, unit in (
            ("thrust", thrust, airframe.rotor_thrust_max[:rotors], "N"),
            ("joint torque", torque, airframe.joint_torque_max[:joints], "N m"),
        ):
            k = int(np.argmax(np.abs(values) / limits))
            if not abs(values[k]) <= _MAX_SHARE * limits[k]:
                raise OwnPartError(
                    f"{what}: a {name} of {abs(values[k]):g}, a vehicle has {limits[k]:g} {unit}"
                )
        weight = airframe.mass * GRAVITY
        if self._first and not thrust.sum() >= _MIN_LIFT * weight:
            raise OwnPartError(
                f"{what}: {thrust.sum():g} N in all for a vehicle that hovers with {weight:.1f} N; "
                "thrusts are newtons, one a rotor"
            )
        self._first = False
        return ActuatorCommand(tuple(thrust.tolist()), tuple(torque.tolist()))


def observed(estimate: StateEstimate, aim: EndEffectorTarget, bodies: Bodies) -> Observation:
    """What is known in a tick, of a vehicle of ``bodies``."""
    return Observation(
        1e-6 * (aim.t_us - START_US),
        np.array(estimate.p_WB),
        np.array(estimate.v_WB),
        np.array(estimate.R_WB).reshape(3, 3),
        np.array(estimate.w_WB_B),
        np.array(estimate.q_arm),
        np.array(estimate.qd_arm),
        np.array(end_effector(bodies, estimate)[0]),
        np.array(aim.p_WE),
        np.array(aim.v_WE),
        np.array(aim.a_WE),
        aim.yaw,
    )


class _OwnPush:
    """An own disturbance as the simulation samples it; see ``sitl.disturbances.items``."""

    torque = False

    def __init__(self, law: PushLaw) -> None:
        self._law, self._step_s = law, 1e-6 * STEP_US

    def sample(self, step: int) -> tuple[float, float, float]:
        """The acceleration over a step [m/s², NED]."""
        t = step * self._step_s
        try:
            given = self._law(t)
        except Exception as error:  # whatever a user's law raises
            raise OwnPartError(f"disturbance at {t:.3f} s: {_said(error)}") from error
        x, y, z = numbers(f"disturbance at {t:.3f} s", given, (3,)).tolist()
        if not max(abs(x), abs(y), abs(z)) <= _MAX_A:
            raise OwnPartError(
                f"disturbance at {t:.3f} s: {[x, y, z]}, must be within ±{_MAX_A:g} m/s²"
            )
        return x, y, z

    def held_until(self, step: int) -> float:
        """It may be another one in every step."""
        return step + 1
