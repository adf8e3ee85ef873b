"""One simulated flight: sense, advance, judge. No sockets and no clock in here."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sitl.admission import check, check_start
from sitl.disturbances.items import push
from sitl.plant.aerial_manipulator import Inputs, plant
from sitl.plant.integrator import STEP_S, integrate
from sitl.plant.kinematics import places
from sitl.plant.parameters import Vehicle
from sitl.plant.state import StateView
from sitl.scenario import V3, Scenario
from sitl.sensors.suite import V4, SensorReadings, SensorSuite
from sitl.start import hovering, standing
from sitl.trajectory import TrajectoryPoint, reference
from sitl.verdict import EndKind, EndReason, MarginRecord, TrackingError, TruthResult, score
from sitl.world import World

STEP_US = 2000  # one exchange with the flight software
START_US = 1_000_000  # so that no stamp is 0
SUBSTEPS = 2  # plant steps per exchange
SAMPLE_STEPS = 50  # tracking error at 10 Hz, as the paper's TE
TOUCH_DOWN_MAX = 2.0  # m/s; a drop from 0.2 m


@dataclass(frozen=True, slots=True)
class Controls:
    """What the flight software commands for one step."""

    thrust: tuple[float, float, float, float]  # fraction of full thrust 0…1, rotors 1..4
    torque: tuple[float, ...]  # (j,) fraction of the torque limit −1…1
    armed: bool  # disarmed: rotors and joint drives are off, whatever the fractions


@dataclass(frozen=True, slots=True)
class Truth:
    """The plant's true state, for logs and tests; never for the flight software."""

    t_us: int
    p_WB: V3  # m, NED
    v_WB: V3  # m/s, NED
    q_WB: V4  # [w, x, y, z]
    w_WB_B: V3  # rad/s, B
    thrust: V4  # N
    q_arm: tuple[float, ...]  # rad
    qd_arm: tuple[float, ...]  # rad/s
    p_WE: V3  # m, NED, end-effector
    target: TrajectoryPoint  # its reference
    margins_m: tuple[float, ...]  # m, in the order of ``Simulation.margin_keys``


class Simulation:
    """The plant in its scenario.

    Args:
        scenario: What to fly.
        seed: Root of every random number of the run.

    Raises:
        ScenarioError: The scenario contradicts itself or starts outside its safe set.
    """

    step_us = STEP_US

    def __init__(self, scenario: Scenario, seed: int) -> None:
        check(scenario)
        self.scenario = scenario
        self.vehicle = _vehicle(scenario)
        self.reference = reference(scenario.trajectory)
        self.step = 0
        self.ended: EndReason | None = None
        self._world = World(scenario)
        self._plant = plant(self.vehicle)
        self._mass = self.vehicle.mass
        self._sensors = SensorSuite(scenario.sensors, seed, STEP_US)
        self._pushes = [push(item, seed, 1e-6 * STEP_US) for item in scenario.disturbances]
        self._trajectory_from_s: float | None = None
        self._trajectory_until_s = math.inf
        joints = len(self.vehicle.links)
        self._inputs = Inputs(np.zeros(4), np.zeros(joints), np.zeros(3), np.zeros(3))
        self._state = self._first_state()
        self._places = np.empty((SUBSTEPS, 2 + joints, 3))
        self._reading: SensorReadings | None = None
        # No steps: only what the accelerometer feels at the start.
        self._felt = integrate(
            self._plant, self._state, self._inputs, STEP_S, self._places[:0]
        ).felt
        self._error = TrackingError()
        self._record = MarginRecord(self._world.keys)
        self._judge_start()

    def _first_state(self) -> np.ndarray:
        scenario = self.scenario
        if scenario.start.kind == "ground":
            state, trim = standing(self.vehicle, scenario)
        else:
            self._trajectory_from_s = scenario.pilot.start_delay_s
            state, trim = hovering(self.vehicle, scenario, self.reference.at(0.0).p)
        self._inputs.thrust[:] = trim.thrust
        self._inputs.torque[:] = trim.torque
        return state

    @property
    def t_us(self) -> int:
        """Time stamp of the current state [µs]."""
        return START_US + STEP_US * self.step

    @property
    def time_s(self) -> float:
        """Seconds since the start of the simulation."""
        return 1e-6 * STEP_US * self.step

    @property
    def margin_keys(self) -> tuple[str, ...]:
        """Names of the margins, e.g. ``front/end_effector``."""
        return self._world.keys

    @property
    def min_margin_m(self) -> float | None:
        """Smallest margin so far [m], None without constraints."""
        worst = self._record.worst()
        return None if worst is None else self._record.minimum[worst]

    @property
    def trajectory_start_us(self) -> int | None:
        """Stamp at which the trajectory starts, None while that is open."""
        start = self._trajectory_from_s
        return None if start is None else START_US + round(1e6 * start)

    def start_trajectory(self, t_us: int) -> None:
        """The pilot starts the trajectory at the stamp ``t_us``; only before it has begun."""
        self._trajectory_from_s = 1e-6 * (t_us - START_US)

    def stop_trajectory(self, t_us: int) -> None:
        """The pilot leaves the trajectory at the stamp ``t_us``: no more error, no workspace."""
        self._trajectory_until_s = 1e-6 * (t_us - START_US)

    def end(self, kind: EndKind, sentence: str) -> None:
        """End the run from outside; the first reason stands."""
        if self.ended is None:
            self.ended = EndReason(kind, sentence, self.t_us)

    def target_at(self, time_s: float) -> TrajectoryPoint:
        """End-effector reference ``time_s`` after the start of the simulation."""
        start = self._trajectory_from_s
        return self.reference.at(0.0 if start is None else time_s - start)

    def sense(self) -> SensorReadings:
        """Measurements of the current state; asking twice in a step gives the same ones."""
        if self._reading is None or self._reading.t_us != self.t_us:
            self._reading = self._sensors.measure(self._exact_reading())
        return self._reading

    def advance(self, controls: Controls) -> None:
        """Integrate one step with ``controls`` held, judging every plant step.

        Raises:
            ValueError: A control is not finite or their number is wrong.
        """
        self._command(controls)
        self._disturb()
        arrival = integrate(self._plant, self._state, self._inputs, STEP_S, self._places)
        before = self.time_s
        self.step += 1
        for k, row in enumerate(self._places.tolist()):
            self._judge(_critical(row), before + (k + 1) * STEP_S)
        self._felt = arrival.felt
        self._judge_landing(arrival.landing_speed)
        self._judge_time()

    def truth(self) -> Truth:
        """The true state now."""
        view = StateView(self._state)
        points = self._points_now()
        target = self.target_at(self.time_s)
        return Truth(
            t_us=self.t_us,
            p_WB=_three(view.p_WB.tolist()),
            v_WB=_three(view.v_WB.tolist()),
            q_WB=_four(view.q_WB.tolist()),
            w_WB_B=_three(view.w_WB_B.tolist()),
            thrust=_four(view.thrust.tolist()),
            q_arm=tuple(view.q_arm.tolist()),
            qd_arm=tuple(view.qd_arm.tolist()),
            p_WE=points[2],
            target=target,
            margins_m=self._world.margins(points, self._workspace_target(self.time_s)),
        )

    def result(self) -> TruthResult:
        """The score so far, or of the whole run once ``ended`` is set."""
        hop = self.scenario.pilot.plan == "hop"
        return score(self.ended, self.time_s, self._error, self._record, hop)

    def _exact_reading(self) -> SensorReadings:
        view = StateView(self._state)
        w = _three(view.w_WB_B.tolist())
        return SensorReadings(
            t_us=self.t_us,
            p_WB=_three(view.p_WB.tolist()),
            v_WB=_three(view.v_WB.tolist()),
            q_WB=_four(view.q_WB.tolist()),
            w_WB_B=w,
            gyro_B=w,
            accel_B=self._felt,
            q_arm=tuple(view.q_arm.tolist()),
            qd_arm=tuple(view.qd_arm.tolist()),
            tau_arm=tuple(self._inputs.torque.tolist()),
        )

    def _command(self, controls: Controls) -> None:
        rotors, drives = self.vehicle.rotors, self.vehicle.joints
        joints = len(self.vehicle.links)
        if len(controls.thrust) != 4 or len(controls.torque) != joints:
            raise ValueError(f"{controls} at step {self.step}: expected 4 rotors, {joints} joints")
        if not all(map(math.isfinite, (*controls.thrust, *controls.torque))):
            raise ValueError(f"{controls} at step {self.step}: every control must be finite")
        live = 1.0 if controls.armed else 0.0
        for i, fraction in enumerate(controls.thrust):
            self._inputs.thrust[i] = live * rotors.thrust_max * min(max(fraction, 0.0), 1.0)
        for i, fraction in enumerate(controls.torque):
            self._inputs.torque[i] = live * drives.torque_max * min(max(fraction, -1.0), 1.0)

    def _disturb(self) -> None:
        force, torque = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        for item in self._pushes:
            total, unit = (torque, 1.0) if item.torque else (force, self._mass)
            for i, value in enumerate(item.sample(self.step)):
                total[i] += unit * value
        for i in range(3):
            self._inputs.force_W[i] = force[i]
            self._inputs.torque_B[i] = torque[i]

    def _on_trajectory(self, time_s: float) -> bool:
        """While airborne from the start, the wait before the trajectory counts as well."""
        if time_s >= self._trajectory_until_s:
            return False
        start = self._trajectory_from_s
        if self.scenario.start.kind == "airborne":
            return True
        return start is not None and time_s >= start

    def _workspace_target(self, time_s: float) -> V3 | None:
        if self._world.workspace is None or not self._on_trajectory(time_s):
            return None
        return self.target_at(time_s).p

    def _points_now(self) -> tuple[V3, V3, V3]:
        out = np.empty((1, *self._places.shape[1:]))
        places(self._plant, self._state, out)
        return _critical(out[0].tolist())

    def _judge_start(self) -> None:
        points = self._points_now()
        margins = self._world.margins(points, self._workspace_target(0.0))
        check_start(self._world.keys, margins)
        self._record.add(margins, 0.0)
        self._sample_error(points)

    def _judge(self, points: tuple[V3, V3, V3], time_s: float) -> None:
        if self.ended is not None:
            return
        if not math.isfinite(sum(map(sum, points))):
            self.end(EndKind.DIVERGED, f"the simulation diverged at {time_s:.3f} s")
            return
        margins = self._world.margins(points, self._workspace_target(time_s))
        self._record.add(margins, time_s)
        touched = self._world.collision(points, margins)
        if touched is not None:
            self.end(EndKind.COLLISION, f"{touched} at {time_s:.2f} s")
        # The last plant step of an exchange ends on the exchange's own time.
        if self.step % SAMPLE_STEPS == 0 and time_s >= self.time_s - 0.5 * STEP_S:
            self._sample_error(points)

    def _sample_error(self, points: tuple[V3, V3, V3]) -> None:
        if self._on_trajectory(self.time_s):
            self._error.add(points[2], self.target_at(self.time_s).p)

    def _judge_landing(self, speed: float) -> None:
        if not (speed <= TOUCH_DOWN_MAX):
            self.end(
                EndKind.CRASH,
                f"the legs hit the ground at {speed:.1f} m/s at {self.time_s:.2f} s, "
                f"{TOUCH_DOWN_MAX:.1f} m/s is the most they stand",
            )

    def _judge_time(self) -> None:
        if self.time_s >= self.scenario.duration_s - 0.5 * STEP_S:
            self.end(EndKind.DURATION, f"flew {self.time_s:.1f} s")


def _vehicle(scenario: Scenario) -> Vehicle:
    """The default vehicle, scaled as the scenario says."""
    scale = scenario.vehicle_scale
    vehicle = Vehicle().scaled(scale.mass, scale.inertia)
    rotors, joints = vehicle.rotors, vehicle.joints
    return replace(
        vehicle,
        rotors=replace(rotors, lag=scale.rotor_lag * rotors.lag),
        joints=replace(
            joints,
            viscous=scale.joint_friction * joints.viscous,
            coulomb=scale.joint_friction * joints.coulomb,
        ),
    )


def _critical(rows: list[list[float]]) -> tuple[V3, V3, V3]:
    """Base, joint 2 and end-effector out of base, joint 1, …, end-effector."""
    return _three(rows[0]), _three(rows[2]), _three(rows[-1])


def _three(values: list[float]) -> V3:
    return (values[0], values[1], values[2])


def _four(values: list[float]) -> V4:
    return (values[0], values[1], values[2], values[3])
