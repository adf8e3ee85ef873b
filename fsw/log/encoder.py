"""Inputs and outputs of a tick as records of the flight log.

The flight and ``pandion replay`` call the same encoder, so comparing their bytes compares every
field of every topic. Records that come with every tick are packed in one call: at 500 Hz a call
each would cost more than the numbers in them.
"""

from __future__ import annotations

import math
from functools import partial
from operator import attrgetter, is_not
from typing import Any, Final

from fsw.autopilot.flight.estimate.estimator_report import (
    ABOVE_GROUND,
    ABSOLUTE,
    HEIGHT,
    LEVEL_VELOCITY,
    RELATIVE,
    VERTICAL_VELOCITY,
)
from fsw.autopilot.flight.modes import NAV_STATES
from fsw.autopilot.geometry.geodesy import DEFAULT_ORIGIN
from fsw.autopilot.geometry.rotation import quaternion_from_matrix
from fsw.autopilot.measurements import ImuSample
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.kinematics import end_effector
from fsw.autopilot.periods import TICK_US
from fsw.autopilot.ports import GroupTiming
from fsw.autopilot.signals import (
    CommandRequest,
    ConstraintReport,
    EstimatorReport,
    FlightSnapshot,
    Origin,
    PlanRequest,
    PlanTimings,
    TestRatios,
    TickInputs,
    TickOutputs,
    is_frame_of,
)
from fsw.log import topics
from fsw.log.json_codec import JsonCodec
from fsw.log.packed import Packed, Samples, Timetable
from fsw.log.px4_records import Px4Records, validity
from messages.ulog import logged_text

TYPED: Final = "sensors"  # the inputs that have topics of their own
SAMPLES: Final = "samples"
STATUS_TICKS: Final = 1_000_000 // TICK_US
THIN, FULL = 0, 1  # values of LOG_PROFILE
# From one record of what follows from others to the next, in a thin log.
_DETAIL_US, _FAST_US, _PLAN_US = 20_000, 10_000, 50_000

_UNMEASURED: Final = PlanTimings(math.nan, math.nan, math.nan)
_NO_TIMES: Final = PlanTimings(-1.0, -1.0, -1.0)  # in inputs: JSON has no NaN
_NOWHERE: Final = (math.nan, math.nan, math.nan)
_U16, _U32 = 0xFFFF, 0xFFFFFFFF

_UNAIDED_US: Final = 1_000_000
# In the order of TestRatios.
_INNOVATION_BITS: Final = (0, 1, 2, 6, 9)
_ROTARY_WING: Final = 1  # VEHICLE_TYPE of PX4


_TOLD: Final = attrgetter("failsafe_from", "mode", "armed", "landed", "failures")
_PLAN: Final = attrgetter("plan", "counters", "plan_status")

# What tools look at the spectrum of.
_RATES: Final = Packed("vehicle_angular_velocity")
_PLANNING: Final = Packed("barrier_margin", "end_effector")
_MPC: Final = Packed("mpc_status")
_CONTACT: Final = Packed("tool_contact")
_PAYLOAD: Final = Packed("payload")
_ASKED: Final = Packed("vehicle_command")
_ANSWERED: Final = Packed("vehicle_command_ack")
_INPUT: Final = Packed("tick_input")
_TIMING: Final = Packed("loop_timing")
_ESTIMATOR: Final = Packed("estimator_status", "estimator_innovations", "estimator_sensor_bias")


class LogEncoder:
    """Turns ticks into bytes; remembers what it has written, to write changes only."""

    def __init__(
        self,
        *,
        measured: bool,
        airframe: Airframe,
        profile: int = FULL,
        origin: Origin = DEFAULT_ORIGIN,
    ) -> None:
        """Start a log; without times ``measured`` by the wall clock it repeats to the byte.

        Of a vehicle with this ``airframe``, THIN or FULL. The local frame begins at ``origin``.
        """
        self._px4 = Px4Records(airframe, origin)
        thin = profile != FULL
        self._timed = Timetable(
            (_DETAIL_US if thin else 1, self._detail),
            (_PLAN_US if thin else 1, self._in_flight),
            (_FAST_US if thin else 1, _rates),
            *self._px4.rows(),
        )
        joints = self._joints = airframe.bodies.joints
        # Records that are as long as a vehicle has joints and rotors.
        packed = partial(Packed, rotor=airframe.rotors, joint=joints)
        self._samples = Samples(joints)
        # What a replay needs and what it is compared by: every tick in every profile.
        self._short_tick_records = packed("tick", "actuator_command")
        self._whole_tick_records = packed("sensor_frame", "actuator_command")
        # What follows from that, for reading.
        self._detail_records = packed(
            "vehicle_attitude",
            "vehicle_local_position",
            "actuator_motors",
            "arm_joint_state",
        )
        self._in_flight_records = packed(
            "vehicle_local_position_setpoint", "arm_joint_setpoint", "plan_input"
        )
        self._request_records = packed("mpc_request")
        self._status_records = packed(
            "vehicle_status", "vehicle_land_detected", "failure_detector_status"
        )
        self._imu: ImuSample | None = None  # the last one
        self._took_over = False  # the pilot, from a failsafe whose condition still holds
        self.inputs = JsonCodec(TickInputs, {} if measured else {PlanTimings: _NO_TIMES})
        self._measured = measured
        self._airframe = airframe
        self._changing = tuple(name for name in self.inputs.names if name not in (TYPED, SAMPLES))
        self._changing_of = attrgetter(*self._changing)
        self._last_values: tuple[Any, ...] | None = None
        # Of the last tick.
        self._constraints: ConstraintReport | None = None
        self._plan: tuple[Any, ...] = (None, None, None)
        self._told: tuple[Any, ...] | None = None
        self._ticks_to_status = 0

    def add(self, inputs: TickInputs, outputs: TickOutputs, out: bytearray) -> None:
        """Append the records of one tick; the sensors' are the first."""
        snapshot = outputs.snapshot
        out += self._every_tick(inputs, outputs)
        for sample in inputs.samples:
            out += self._samples.record(inputs.sensors.t_us, sample)
        out += self._timed.due(snapshot.t_us, snapshot)
        told = _TOLD(snapshot)
        if told != self._told:
            out += self._px4.news(snapshot)
        self._add_inputs(inputs, out)
        constraints, plan = snapshot.constraints, _PLAN(snapshot)
        if constraints is not self._constraints:
            out += self._planning(snapshot)
        if any(map(is_not, plan, self._plan)):
            out += self._mpc(snapshot)
        self._constraints, self._plan = constraints, plan
        if outputs.plan_request is not None:
            out += _request(self._request_records, snapshot.t_us, outputs.plan_request)
        self._add_status(snapshot, told, out)
        for ack in outputs.acks:
            addressee = (ack.target_system & 0xFF, ack.target_component & _U16)
            values = (ack.command & _U32, ack.result & 0xFF, *addressee)
            out += _ANSWERED.pack(snapshot.t_us, values)
        for text in outputs.texts:
            out += logged_text(text.severity & 7, snapshot.t_us, text.text)

    def _add_status(self, snapshot: FlightSnapshot, told: tuple[Any, ...], out: bytearray) -> None:
        """Mode, landing and faults, as ``told`` now, on change and every second."""
        self._ticks_to_status -= 1
        before, self._told = self._told, told
        if self._ticks_to_status < 0 or told != before:
            self._ticks_to_status = STATUS_TICKS - 1
            if not snapshot.failures or snapshot.failsafe_from is not None:
                self._took_over = False
            elif before is not None and before[0] is not None:
                self._took_over = True
            out += self._status(snapshot)

    def _every_tick(self, inputs: TickInputs, outputs: TickOutputs) -> bytes:
        one, sent = inputs.sensors, outputs.actuators
        t_us = one.t_us
        for sample in inputs.samples:
            if type(sample) is ImuSample:
                self._imu = sample
                self._px4.vibration.add(sample.rate, sample.acceleration)
        if not inputs.samples:
            self._px4.vibration.add(one.gyro_B, one.accel_B)
        command = (*sent.rotor_thrust, *sent.joint_torque, outputs.armed)
        # Where sensors have times of their own, the frame has nothing that a sample does not say.
        if is_frame_of(one, self._imu):
            return self._short_tick_records.pack(t_us, (), command)
        arm = (*one.q_arm, *one.qd_arm)
        frame = (*one.p_WB, *one.v_WB, *one.q_WB, *one.gyro_B, *one.accel_B, *arm)
        return self._whole_tick_records.pack(t_us, frame, command)

    def _detail(self, snapshot: FlightSnapshot) -> bytes:
        x, sent, known = snapshot.estimate, snapshot.actuators, snapshot.estimator
        # Whether a distance to the ground is measured and used.
        ground = known is not None and bool(known.flags & ABOVE_GROUND)
        t_us, touching, payload = snapshot.t_us, snapshot.touching, snapshot.payload
        found = self._detail_records.pack(
            t_us,
            quaternion_from_matrix(x.R_WB),
            (*x.p_WB, *x.v_WB, x.yaw, *validity(snapshot), -x.p_WB[2], ground),
            self._airframe.shares(sent).rotor_thrust,
            (*x.q_arm, *x.qd_arm, *sent.joint_torque),
        )
        if touching is not None:
            contact, force, *numbers = touching
            found += _CONTACT.pack(t_us, (*force, *numbers, contact))
        if payload is not None:
            found += _PAYLOAD.pack(t_us, (payload.mass, payload.closed))
        return found

    def _in_flight(self, snapshot: FlightSnapshot) -> bytes:
        x, u = snapshot.plan_state, snapshot.plan_input
        if x is None:
            return b""
        a, yaw_acc, qdd = (
            ((0.0,) * 3, 0.0, (0.0,) * len(x.q_arm)) if u is None else (u.a, u.yaw_acc, u.qdd_arm)
        )
        body = (*x.p, *x.v, *x.a, x.yaw, x.yaw_rate)
        arm = (*x.q_arm, *x.qd_arm, *qdd)
        return self._in_flight_records.pack(snapshot.t_us, body, arm, (*a, yaw_acc))

    def _add_inputs(self, inputs: TickInputs, out: bytearray) -> None:
        """Every input that is not what it was on the tick before."""
        last, values = self._last_values, self._changing_of(inputs)
        # Identity first, and in one comparison: on most ticks nothing is new.
        if values == last:
            return
        t_us, self._last_values = inputs.sensors.t_us, values
        for k, (name, value) in enumerate(zip(self._changing, values, strict=True)):
            if last is not None and (value is last[k] or value == last[k]):
                continue
            _add_text(t_us, name, self.inputs.encode(name, value), out)
            if name == "commands":
                for command in inputs.commands:
                    out += _command(t_us, command.request)

    def _status(self, snapshot: FlightSnapshot) -> bytes:
        mode, failures, known = snapshot.mode, snapshot.failures, snapshot.actuators_found
        rotors = 1 << known.rotor >> 1  # from 1; 0: none
        joints = [round(kind) for kind in known.joints or (0.0,) * self._joints]
        return self._status_records.pack(
            snapshot.t_us,
            (
                *(2 if snapshot.armed else 1, NAV_STATES[mode], bool(failures)),
                *(mode.value.encode(), ",".join(failures).encode()),
                *(self._took_over, _ROTARY_WING, False),
            ),
            (snapshot.landed,),
            (rotors != 0, rotors, known.effect, known.lost, known.disobeys, *joints),
        )

    def _planning(self, snapshot: FlightSnapshot) -> bytes:
        t_us, report, target = snapshot.t_us, snapshot.constraints, snapshot.reference
        safety = snapshot.safety
        margins, barrier, smallest = report.shown(topics.MARGINS)
        least = min(report.margins, default=math.nan)
        argmin = 0xFF if smallest is None else smallest
        p, v = end_effector(self._airframe.bodies, snapshot.estimate)
        wanted = (
            (*_NOWHERE, *_NOWHERE, math.nan)
            if target is None
            else (*target.p_WE, *target.v_WE, target.yaw)
        )
        known = snapshot.estimator
        rest = b"" if known is None else _estimator(t_us, known)
        return rest + _PLANNING.pack(
            t_us,
            (
                *(*_filled(margins), *_filled(barrier), least),
                *(int(report.kind), len(margins), argmin),
                *(safety.breaches, safety.departures, safety.interventions),
                *(*_filled(report.added[: topics.MARGINS]), report.shortfall),
            ),
            (*p, *v, *wanted),
        )

    def _mpc(self, snapshot: FlightSnapshot) -> bytes:
        plan, counters = snapshot.plan, snapshot.counters
        counts = (counters.plans, counters.missed_deadlines, counters.fallbacks)
        about: tuple[float, ...] = (math.nan,) * 5 + (0, 0)
        t_plan = plan_id = 0
        if plan is not None:
            t_plan, plan_id = plan.t_us, plan.plan_id & _U32
            times = plan.timings if self._measured else _UNMEASURED
            about = (
                *(plan.cost, plan.slack_max, times.linearise_us, times.solve_us, times.total_us),
                *(min(plan.sqp_iterations, _U16), min(plan.solver_iterations, _U16)),
            )
        status = int(snapshot.plan_status)
        return _MPC.pack(snapshot.t_us, (t_plan, plan_id, *counts, *about, status))


def _rates(snapshot: FlightSnapshot) -> bytes:
    return _RATES.pack(snapshot.t_us, snapshot.estimate.w_WB_B)


def loop_timing(t_us: int, group: int, timing: GroupTiming) -> bytes:
    """A record of loop_timing for rate group 0, the tick, or 1, the planner."""
    return _TIMING.pack(t_us, (*timing.shown, group))


def _estimator(t_us: int, known: EstimatorReport) -> bytes:
    ratios, variance, motion = known.ratios, known.pose_covariance, known.velocity_covariance
    accuracy = (
        math.sqrt(max(motion[0], motion[6], motion[11])),
        math.sqrt(max(variance[15], variance[18])),
    )
    faults = ", ".join([f"{one.name}: {one.fault}" for one in known.sensors if one.fault])
    # Bits of velocity, position and height that nothing has corrected: one sensor corrects all.
    unaided = 0 if 0 <= known.unaided_us <= _UNAIDED_US else 7
    return _ESTIMATOR.pack(
        t_us,
        (
            *(known.level_accuracy, known.vertical_accuracy),
            *(ratios.heading, ratios.velocity, ratios.place, ratios.height, ratios.above_ground),
            *(*accuracy, math.nan if known.unaided_us < 0 else 1e-6 * known.unaided_us),
            *(known.pose_delay, known.resets & _U32, known.flags, faults.encode()),
            *(_unusable(known), unaided, _refused(ratios), 0.0),
        ),
        (*[x for name, count in topics.INNOVATIONS for x in known.innovation(name, count)],),
        (
            *(*known.gyro_bias, *known.gyro_bias_variance),
            *(*known.accel_bias, *known.accel_bias_variance),
        ),
    )


def _unusable(known: EstimatorReport) -> int:
    """Bits of velocity, position and height that are of no use."""
    flags = known.flags
    usable = (
        flags & LEVEL_VELOCITY and flags & VERTICAL_VELOCITY,
        flags & (RELATIVE | ABSOLUTE),
        flags & HEIGHT,
    )
    return sum(1 << bit for bit, well in enumerate(usable) if not well)


def _refused(ratios: TestRatios) -> int:
    """PX4's bits of innovations that were refused: velocity, place, height, heading, ground."""
    tested = zip(_INNOVATION_BITS, ratios, strict=True)
    return sum(1 << bit for bit, ratio in tested if ratio > 1.0)


def _request(packed: Packed, t_us: int, request: PlanRequest) -> bytes:
    x = request.start
    first = request.targets[0].p_WE if request.targets else _NOWHERE
    start = (*x.p, *x.v, *x.a, *x.j, *x.s, x.yaw, x.yaw_rate, *x.q_arm, *x.qd_arm)
    when = request.plan_id & _U32, request.t_apply_us
    return packed.pack(t_us, (*when, *start, *first, request.from_nominal))


def _command(t_us: int, request: CommandRequest) -> bytes:
    source = (request.source_system & 0xFF, request.source_component & _U16)
    number, again = request.command & _U32, request.confirmation & 0xFF
    return _ASKED.pack(t_us, (*request.params, number, *source, again))


def _add_text(t_us: int, name: str, text: bytes, out: bytearray) -> None:
    size = topics.TEXT_SIZE
    parts = max(-(-len(text) // size), 1)
    for part in range(parts):
        piece = text[part * size : (part + 1) * size]
        out += _INPUT.pack(t_us, (name.encode("ascii"), part, parts, piece))


def _filled(values: tuple[float, ...]) -> tuple[float, ...]:
    return values + (math.nan,) * (topics.MARGINS - len(values))
