"""One simulated flight: sense, advance, judge. No sockets and no clock in here."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import mul
from typing import Any, NamedTuple, cast

import numpy as np

from sitl.air.wind import WindField
from sitl.compiled import machine_code
from sitl.disturbances.items import Push, push
from sitl.drives import Drives
from sitl.earth import DEFAULT_ORIGIN, Place
from sitl.faults.active import Faults
from sitl.faults.keys import Fault
from sitl.flight_evaluator import FlightEvaluator, Flown, row_of_three
from sitl.gripped import Gripped
from sitl.judged_step import watched_step
from sitl.mission_clock import MissionClock
from sitl.periods import STEP_US as STEP_US
from sitl.plant.aerial_manipulator import Plant, place_bodies
from sitl.plant.battery import open_circuit
from sitl.plant.integrator import STEP_S, held
from sitl.plant.integrator import places as places_into
from sitl.plant.lock import seize
from sitl.plant.parameters import GRAVITY, joint_axes, plant
from sitl.plant.places import rows_of
from sitl.plant.state import JOINTS_MAX, ROTORS_MAX, THRUST, taken_apart
from sitl.plant.stiffness import TooStiffError, check_stiffness
from sitl.plant.vector import V6, V8, Array
from sitl.result import EndKind, EndReason, TruthResult
from sitl.scenario import V3, Scenario, Sensors
from sitl.scenario_file import ScenarioError
from sitl.scenario_validation import check, fault_problem
from sitl.sensors.channel import Measurement
from sitl.sensors.exact import V4, ExactSensors, SensorReadings
from sitl.sensors.keys import MeasuredSensors
from sitl.sensors.suite import SensorSuite
from sitl.start import effects, first_state, flown_vehicle
from sitl.touch import TouchRecord
from sitl.trajectory import TrajectoryPoint
from sitl.world import World
from vehicles.description import Vehicle

START_US = 1_000_000  # so that no stamp is 0
# For which the vehicle's sensors have run when the flight begins.
SETTLED_STEPS = 500_000 // STEP_US
SETTLED_KEPT = 40_000 // STEP_US  # of these, whose measurements the flight software still gets
SETTLED_NEWEST = 2  # of each sensor, however long ago they came
SUBSTEPS = STEP_US // round(1e6 * STEP_S)  # plant steps per exchange
BATTERY_STEPS = 100_000 // STEP_US  # between two readings of the battery
_NONE: V3 = (0.0, 0.0, 0.0)
# Behind the commands of so many rotors and joints, for kernels that serve every vehicle.
_ROOM = tuple((0.0,) * (ROTORS_MAX - n) for n in range(ROTORS_MAX + 1))
_ARM_ROOM = tuple((0.0,) * (JOINTS_MAX - n) for n in range(JOINTS_MAX + 1))
SAMPLE_STEPS = 100_000 // STEP_US  # tracking error at 10 Hz, as the paper's TE


class Controls(NamedTuple):
    """What the flight software commands for one step."""

    thrust: tuple[float, ...]  # (r,) fraction of full thrust 0…1
    torque: tuple[float, ...]  # (j,) fraction of the torque limit −1…1
    armed: bool  # disarmed: rotors and joint drives are off, whatever the fractions
    gripper: float = 0.0  # 1 to close, -1 to open, 0 where it was never told

    @classmethod
    def off(cls, vehicle: Vehicle) -> Controls:
        """Of a vehicle that is disarmed."""
        return cls((0.0,) * len(vehicle.rotors), (0.0,) * len(vehicle.joints), armed=False)


@dataclass(frozen=True, slots=True)
class Truth:
    """The plant's true state, for logs and tests; never for the flight software."""

    t_us: int
    p_WB: V3  # m, NED
    v_WB: V3  # m/s, NED
    q_WB: V4  # [w, x, y, z]
    w_WB_B: V3  # rad/s, B
    thrust: tuple[float, ...]  # (r,) N
    q_arm: tuple[float, ...]  # rad
    qd_arm: tuple[float, ...]  # rad/s
    p_WE: V3  # m, NED, end-effector
    target: TrajectoryPoint  # its reference
    margins_m: tuple[float, ...]  # m, in the order of ``World.keys``


class Simulation:
    """The plant in its scenario; ``seed``, 0 or more, is the root of all randomness of the run.

    ``more`` pushes come on top of the scenario's disturbances. The local frame is at ``origin``.

    Raises:
        ScenarioError: The scenario contradicts itself or starts outside its safe set.
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        more: Sequence[Push] = (),
        *,
        origin: Place = DEFAULT_ORIGIN,
    ) -> None:
        if not (seed >= 0):
            raise ScenarioError(f"seed = {seed}: must be 0 or more")
        check(scenario)
        self.scenario = scenario
        self.vehicle = flown_vehicle(scenario)
        self.clock = MissionClock(scenario)
        self.step = 0
        try:
            met = effects(scenario)
            check_stiffness(self.vehicle, met)
        except TooStiffError as error:
            raise ScenarioError(str(error)) from error
        self._plant = plant(self.vehicle, met)
        self._plants = cast(Sequence[Plant], np.array([self._plant]))  # cheaper to hand over
        self._touch = TouchRecord(scenario, self.vehicle, self._plants)
        self.payload = Gripped(scenario, self.vehicle, self._plant, self._plants)
        self._mass = self.vehicle.mass
        self._rotors, self._joints = len(self.vehicle.rotors), len(self.vehicle.joints)
        self._full = tuple(rotor.thrust_max for rotor in self.vehicle.rotors)  # N
        self._full_torque = tuple(joint.torque_max for joint in self.vehicle.joints)  # N·m
        aboard = scenario.sensors
        # Whether anything aboard feels forces on the tool.
        self._feels = isinstance(aboard, MeasuredSensors) and aboard.force_torque is not None
        self._exact_sensors, self._suite = _sensors(scenario, self.vehicle, seed, origin)
        self._pushes = [push(item, seed, 1e-6 * STEP_US) for item in scenario.disturbances]
        self._pushes += more
        self._pushed: tuple[V3, V3] = (_NONE, _NONE)  # N, NED; N·m, B
        self._pushed_until = 0.0  # step
        self._state, trim = first_state(self.vehicle, scenario, self.clock.target_at(0.0).p)
        self.trim = trim  # that holds it there
        self._thrust, self._torque = trim.thrust, trim.torque
        step_s = 1e-6 * STEP_US
        self._drives: Drives | None = None
        if scenario.actuators.dead_time_ms > 0.0 or scenario.actuators.battery_a_h > 0.0:
            self._drives = Drives(
                scenario.actuators, self.vehicle, met.air.density, trim.thrust, step_s
            )
        self._play: Array | None = None  # rad, of motors against their links
        if met.backlash > 0.0:
            gears = cast(Array, self._plants)["gears"]  # type: ignore[call-overload]
            self._play = gears["position"][0][: self._joints]
        self._wind: tuple[WindField, Array] | None = None
        if met.air.active:
            moving = cast(Array, self._plants)["air"]["wind"][0]  # type: ignore[call-overload]
            self._wind = (WindField(scenario.air, seed, step_s), moving)
        self.faults = Faults(
            scenario.faults,
            seed,
            step_us=STEP_US,
            full=self._full,
            joints=self._joints,
            exact=self._suite is None,
            sags=self._drives is not None and self._drives.battery is not None,
        )
        self._locked = self.faults.locked
        axes = 3 if scenario.body == "full" else 0
        self._places = np.empty((SUBSTEPS, rows_of(self.vehicle) + axes, 3))
        self._states = np.empty((SUBSTEPS, len(self._state)))
        self._leaps: dict[int, tuple[Array, Array]] = {}  # the same of leaps, by their plant steps
        self._reading: SensorReadings | None = None  # of this step, once it has been asked for
        self._turning: tuple[float, ...] = ()  # (r,) N, of the rotors at that reading
        self._said: tuple[int, SensorReadings] | None = None
        self._measured: tuple[int, tuple[Measurement, ...]] = (-1, ())
        self._held = held()
        self._evaluator = FlightEvaluator(scenario, self.clock, self.places())
        # No steps: only what the accelerometer feels at the start.
        example = self._arguments(self._places[:0], self._states[:0])
        self._step = machine_code(watched_step, *example)
        _, self._felt, _ = self._step(*example)

    @property
    def t_us(self) -> int:
        """Time stamp of the current state [µs]."""
        return START_US + STEP_US * self.step

    @property
    def sensor_time_us(self) -> int:
        """Time stamp of the current state by the sensors' clock, which may fail [µs]."""
        self.faults.at(self.step)
        return self.t_us + self.faults.clock_us

    @property
    def time_s(self) -> float:
        """Seconds since the start of the simulation."""
        return 1e-6 * STEP_US * self.step

    @property
    def ended(self) -> EndReason | None:
        """Why the run is over, None while it is not."""
        return self._evaluator.ended

    @property
    def min_margin_m(self) -> float | None:
        """Smallest margin so far [m], None without constraints."""
        self._evaluator.catch_up()
        record = self._evaluator.record
        worst = record.worst()
        return None if worst is None else record.minimum[worst]

    @property
    def trajectory_start_us(self) -> int | None:
        """Stamp at which the trajectory starts, None if the flight has none."""
        start = self.clock.starts_s
        return None if start is None else START_US + round(1e6 * start)

    def leave_trajectory(self, t_us: int, why: str) -> None:
        """The vehicle left the trajectory at the stamp ``t_us``: no more error, no workspace.

        The run goes on, but not to completion; the first time counts.
        """
        time_s = 1e-6 * (t_us - START_US)
        if self._evaluator.left is None:
            self.clock.stop(time_s)
            self._evaluator.left = f"{why} at {time_s:.1f} s"

    def note_silence(self, step: int) -> None:
        """The vehicle has been silent since this step: the run does not count as flown."""
        if self.ended is None or self.ended.kind is not EndKind.STOPPED:  # which says it itself
            self._evaluator.silent = f"the flight software was silent since step {step}"

    def end(self, kind: EndKind, sentence: str) -> None:
        """End the run from outside; the first reason stands."""
        self._evaluator.end(kind, sentence, self.time_s)

    def sense(self) -> SensorReadings:
        """The suite ``perfect``'s readings of the current state, exact with any other suite.

        Asking twice in a step gives the same ones; no step may be left out while a sensor fails.
        """
        healthy = self.healthy()
        if not self.faults.at(self.step):
            return healthy
        if self._said is None or self._said[0] != self.step:
            self._said = (self.step, self.faults.frame(healthy))
        return self._said[1]

    def healthy(self) -> SensorReadings:
        """What :meth:`sense` would say if no sensor failed."""
        if self._reading is None:
            exact, self._turning = self._exact_reading()
            self._reading = self._exact_sensors.measure(exact)
        return self._reading

    @property
    def tells_its_state(self) -> bool:
        """Whether sensors say the exact state of every step, and nothing fails."""
        return self._suite is None and self._exact_sensors.exact and self.faults.none

    def exact_state(self, out: Array) -> None:
        """Write the numbers of :meth:`sense` where sensors tell the exact state.

        ``out`` (16 + 2 ``JOINTS_MAX``,) [SI]: position, velocity, attitude, rate, specific force,
        joints and their rates, both with room for those of any vehicle, which is left alone.
        """
        state, felt = self._state, self._felt
        out[:THRUST] = state[:THRUST]
        out[THRUST], out[THRUST + 1], out[THRUST + 2] = felt
        angles, joints = THRUST + self._rotors, self._joints
        at, rates_at = THRUST + 3, THRUST + 3 + JOINTS_MAX
        out[at : at + joints] = state[angles : angles + joints]
        out[rates_at : rates_at + joints] = state[angles + joints : angles + 2 * joints]

    def measurements(self) -> tuple[Measurement, ...] | None:
        """What arrives from the sensors in this step; None with the suite ``perfect``.

        Asking twice in a step gives the same ones; no step may be left out.
        """
        if self._suite is None:
            return None
        if self._measured[0] != self.step:
            exact = self.healthy()
            thrust = self._turning
            if self._play is not None:  # encoders are on the motors' side
                angles = np.array(exact.q_arm) + self._play
                exact = exact._replace(q_arm=tuple(angles.tolist()))
            before = self._settled(self._suite, thrust) if self.step == 0 else []
            arrived = (*before, *self._suite.step(exact, thrust))
            if self.faults.at(self.step):
                arrived = self.faults.suite(self.t_us, arrived)
            self._measured = (self.step, arrived)
        return self._measured[1]

    def battery(self) -> tuple[float, float] | None:
        """Voltage [V] and share of the charge [1] that the battery says in this step, if anything.

        Ten times a second where one is simulated, or has failed.
        """
        own = None if self._drives is None else self._drives.battery
        if self.step % BATTERY_STEPS or (own is None and not self.faults.of_battery):
            return None
        charge = self.faults.charge
        if own is not None:
            return own.voltage, min(own.charge, charge)
        return open_circuit(charge, self.vehicle.battery.full), charge

    def _settled(self, suite: SensorSuite, thrust: tuple[float, ...]) -> list[Measurement]:
        """What came before the first step, in which a flight software cannot wait for sensors.

        The vehicle has been where it starts for a while: the newest few of each sensor, and all of
        the last few steps.
        """
        exact, arrived = self.healthy(), list[tuple[int, Measurement]]()
        for k in range(-SETTLED_STEPS, 0):
            earlier = exact._replace(t_us=exact.t_us + k * STEP_US)
            arrived += [(k, one) for one in suite.step(earlier, thrust)]
        seen, kept = Counter[type](), list[Measurement]()
        for k, one in reversed(arrived):
            seen[type(one)] += 1
            if k >= -SETTLED_KEPT or seen[type(one)] <= SETTLED_NEWEST:
                kept.append(one)
        return kept[::-1]

    def inject(self, fault: Fault) -> str | None:
        """Let a fault begin with the next step; returns why it cannot, None if it can."""
        refusal = fault_problem(fault, self.scenario)
        if refusal is None:
            self.faults.inject(fault, self.step + 1)
        return refusal

    def advance(self, controls: Controls) -> None:
        """Integrate one step with ``controls`` held; every plant step is judged.

        Raises:
            ValueError: A control is not finite or their number is wrong.
        """
        evaluator, before_s = self._evaluator, self.time_s
        evaluator.catch_up()
        self._command(controls)
        wanted, torques, armed, gripper = controls
        fails = self.faults.at(self.step)
        if self._drives is not None:
            self._drive(self._drives)
        if fails or True in self._locked:
            self._fail()
        if self._wind is not None:
            field, moving = self._wind
            moving[0], moving[1], moving[2] = field.step()
        if self.step >= self._pushed_until:
            self._push()
        if self._touch:
            self._touch.place(before_s)
        if self.payload:
            self.payload.update(before_s, gripper, self._tip(), self._held, self._state)
        places, states = self._places, self._states
        speed, self._felt, clear = self._step(*self._arguments(places, states))
        self.step += 1
        self._reading = None
        flown = Flown(places, states, wanted, torques, armed, before_s, STEP_S)
        evaluator.judge_flown(flown, clear)
        time_s = self.time_s
        if self._touch:
            self._touch.add(self.asked_force(), 1e-6 * STEP_US)
        if self.step % SAMPLE_STEPS == 0:
            evaluator.sample_error(self._places[-1], time_s)
        evaluator.judge_landing(speed, time_s)
        evaluator.judge_time(time_s)

    def leap(self, controls: Controls, steps: int, plant_s: float = STEP_S) -> Array:
        """Integrate ``steps`` with ``controls`` held in as few calls as can be, or up to the end.

        For a vehicle whose sensors say the exact state, with nothing that changes by the step but
        disturbances. A plant step takes ``plant_s`` [s], 1 or 2 ms; each is judged. Returns the
        places (rows, 3) [m, NED] of the last one, as :meth:`places`.

        Raises:
            ValueError: A control is not finite or their number is wrong, or it is no such vehicle.
        """
        plain = not (self._drives or self._wind or self._touch or self.payload)
        if not (self.tells_its_state and plain):
            raise ValueError(
                "only with exact sensors and actuators, in still air, without faults, a payload or "
                "zones that may be touched"
            )
        evaluator, left = self._evaluator, steps
        now: Array = self._places[-1]
        self._command(controls)
        wanted, torques, armed, _ = controls
        while left and evaluator.ended is None:
            evaluator.catch_up()
            before_s = self.time_s
            if self.step >= self._pushed_until:
                self._push()
            n = min(left, SAMPLE_STEPS - self.step % SAMPLE_STEPS)
            n = int(min(n, self._pushed_until - self.step))
            rows = round(1e-6 * STEP_US * n / plant_s)
            places, states = self._leaps.get(rows) or self._room(rows)
            plants, blocks, state, thrust, torque, push, turn, *_ = self._arguments(places, states)
            motion = (thrust, torque, push, turn, plant_s)
            speed, self._felt, clear = self._step(
                plants, blocks, state, *motion, places, states, evaluator.free
            )
            self.step += n
            self._reading = None
            flown = Flown(places, states, wanted, torques, armed, before_s, plant_s)
            evaluator.judge_flown(flown, clear)
            if self.step % SAMPLE_STEPS == 0:
                evaluator.sample_error(places[-1], self.time_s)
            evaluator.judge_landing(speed, self.time_s)
            evaluator.judge_time(self.time_s)
            left, now = left - n, places[-1]
        return now

    def _room(self, rows: int) -> tuple[Array, Array]:
        """Memory for so many plant steps."""
        found = np.empty((rows, *self._places.shape[1:])), np.empty((rows, len(self._state)))
        self._leaps[rows] = found
        return found

    def catch_up(self) -> None:
        """Do what :meth:`advance` has left for a time in which nobody waits; else it is done later.

        That is to judge a step in which there can have been no incident, to compare a sample of the
        end-effector's place with the reference, and to measure what arrives in a later step.
        """
        self._evaluator.catch_up()
        if self._suite is not None:
            self._suite.catch_up()

    def truth(self) -> Truth:
        """The true state now."""
        exact, thrust = self._exact_reading()
        places = self.places()
        return Truth(
            t_us=self.t_us,
            p_WB=exact.p_WB,
            v_WB=exact.v_WB,
            q_WB=exact.q_WB,
            w_WB_B=exact.w_WB_B,
            thrust=thrust,
            q_arm=exact.q_arm,
            qd_arm=exact.qd_arm,
            p_WE=row_of_three(places, 1 + self._joints),
            target=self.clock.target_at(self.time_s),
            margins_m=self._evaluator.margins(places, self.time_s),
        )

    def meet(self, scenario: Scenario) -> None:
        """From now on surfaces are as another ``scenario`` has them, and the vehicle is not told.

        Force on the tool and margins count anew.

        Raises:
            TooStiffError: Contact is too stiff for the plant.
            ScenarioError: Something is outside the safe set now.
        """
        self._touch.meet(scenario)
        self._evaluator = FlightEvaluator(scenario, self.clock, self.places())

    @property
    def touch(self) -> TouchRecord:
        """What the tool may touch, and how it has."""
        return self._touch

    def _tool_axes(self) -> Array:
        """Axes (3, 3) [1, NED] of the last link, as the vehicle's file has them."""
        work = self._held[0].memory.work
        place_bodies(self._plant, self._state, work)
        turned: Array = work.rotation @ work.posture.axes[self._joints]
        return turned @ joint_axes(self.vehicle)[-1].T

    def _tip(self) -> V3:
        """Where the end-effector is now [m, NED]."""
        return row_of_three(self.places(), 1 + self._joints)

    def asked_force(self) -> float:
        """Normal force that the reference asks for now [N]."""
        counts = self.clock.counts(self.time_s)
        return self.clock.target_at(self.time_s).force if counts else 0.0

    @property
    def state(self) -> Array:
        """The true state (n,) [SI] now, see ``sitl.plant.state``; not to be changed."""
        return self._state

    def places(self) -> Array:
        """Rows of ``sitl.plant.places``, and the full body's axes, (rows, 3) [m, NED] now."""
        out = np.empty((1, *self._places.shape[1:]))
        places_into(self._plant, self._state, self._held, out)
        now: Array = out[0]
        return now

    @property
    def world(self) -> World:
        """Zones and ground, and what is kept clear of them."""
        return self._evaluator.world

    def state_bytes(self) -> bytes:
        """The true state now, for the log: position, velocity, attitude, rates, thrusts, arm."""
        return self._state.tobytes()

    def result(self) -> TruthResult:
        """The score so far, or of the whole run once ``ended`` is set."""
        found = self._evaluator.result(self.time_s, self._touch)
        return replace(found, payload=self.payload.use())

    def _exact_reading(self) -> tuple[SensorReadings, tuple[float, ...]]:
        """The true state as readings, and the rotors' thrusts [N]."""
        p, v, q, w, thrust, angles, rates = taken_apart(self._state, self._rotors)
        # By position: keywords would take as long again. Gyro and accelerometer are w and felt.
        felt, torque = self._felt, self._torque
        wrench = self._touch.wrench(self._tool_axes()) if self._feels else ()
        return SensorReadings(self.t_us, p, v, q, w, w, felt, angles, rates, torque, wrench), thrust

    def _command(self, controls: Controls) -> None:
        wanted, torques, armed, _ = controls
        if len(wanted) != self._rotors or len(torques) != self._joints:
            raise ValueError(
                f"{controls} at step {self.step}: expected {self._rotors} rotors, "
                f"{self._joints} joints"
            )
        # What is not a number hides from min and max.
        if not math.isfinite(sum(wanted) + sum(torques)):
            raise ValueError(f"{controls} at step {self.step}: every control must be finite")
        if not armed:
            wanted, torques = (0.0,) * self._rotors, (0.0,) * self._joints
        if not (min(wanted) >= 0.0 and max(wanted) <= 1.0):
            wanted = tuple(min(max(f, 0.0), 1.0) for f in wanted)
        if not (min(torques) >= -1.0 and max(torques) <= 1.0):
            torques = tuple(min(max(f, -1.0), 1.0) for f in torques)
        self._thrust = tuple(map(mul, wanted, self._full))
        self._torque = tuple(map(mul, torques, self._full_torque))

    def _drive(self, drives: Drives) -> None:
        """What of the command takes effect in this step."""
        if drives.battery is not None:
            drives.battery.at_most = self.faults.charge
        thrust = self._state[THRUST : THRUST + self._rotors].tolist()
        self._thrust = drives.rotors(self._thrust, tuple(thrust))

    def _fail(self) -> None:
        """What of the command takes effect, and which joints move, while something fails."""
        faults, locked = self.faults, self.faults.locked
        self._thrust = faults.motors(self._thrust, self.t_us)
        self._torque = faults.drives(self._torque)
        if locked != self._locked:
            newly = tuple(now and not was for now, was in zip(locked, self._locked, strict=True))
            self._locked = locked
            held_now = cast(Array, self._plants)["locked"][0]  # type: ignore[call-overload]
            held_now[: self._joints] = locked
            if any(newly):
                seize(self._plant, self._held, self._state, newly)

    def _arguments(self, places: Array, states: Array) -> tuple[Any, ...]:
        """Those of ``watched_step`` for this step."""
        return (
            self._plants,
            self._held,
            self._state,
            cast(V8, (*self._thrust, *_ROOM[self._rotors])),
            cast(V6, (*self._torque, *_ARM_ROOM[self._joints])),
            *self._pushed,
            STEP_S,
            places,
            states,
            self._evaluator.free,
        )

    def _push(self) -> None:
        """Force on the base [N, W] and torque [N·m, B], and until when both are held."""
        step, mass, until = self.step, self._mass, math.inf
        force = torque = (0.0, 0.0, 0.0)
        for item in self._pushes:
            x, y, z = item.sample(step)
            if item.torque:
                torque = (torque[0] + x, torque[1] + y, torque[2] + z)
            else:
                force = (force[0] + mass * x, force[1] + mass * y, force[2] + mass * z)
            until = min(until, item.held_until(step))
        self._pushed, self._pushed_until = (force, torque), until


def _sensors(
    scenario: Scenario, vehicle: Vehicle, seed: int, origin: Place
) -> tuple[ExactSensors, SensorSuite | None]:
    """What senses exactly, and the suite where there is one."""
    sensors = scenario.sensors
    if not isinstance(sensors, MeasuredSensors):
        return ExactSensors(sensors, seed, STEP_US), None
    suite = SensorSuite(
        sensors,
        seed,
        START_US - SETTLED_STEPS * STEP_US,
        vehicle=vehicle,
        hover_thrust=vehicle.mass * GRAVITY / len(vehicle.rotors),
        origin=origin,
    )
    return ExactSensors(Sensors(), seed, STEP_US), suite
