"""The record of a tick: what the fast loop starts from, is given, and leaves.

Its first part is given to each tick: the estimate, the plan's state and its input. The rest is the
memory of the loops. Which law reads and writes what says the law; their order is that of
``close_loops`` in ``fsw/control/cascade.py``.
"""

from __future__ import annotations

import math
import struct
from typing import Final

from fsw.record import (
    JOINTS,
    ROTORS,
    Nine,
    PerJoint,
    PerRotor,
    Record,
    Three,
    Two,
)
from fsw.signals import ActuatorCommand, PlanInput, PredictionState, StateEstimate, Vec2


class Estimate(Record):
    """``StateEstimate``, for kernels."""

    t_us: int
    p_WB: Three  # m, NED
    v_WB: Three  # m/s, NED
    R_WB: Nine
    w_WB_B: Three  # rad/s, FRD
    yaw: float  # rad
    q_arm: PerJoint  # rad
    qd_arm: PerJoint  # rad/s
    specific_force: float  # m/s^2, along -z of the body


class PlanState(Record):
    """``PredictionState``, for kernels."""

    p: Three  # m, NED
    v: Three  # m/s
    a: Three  # m/s^2
    j: Two  # m/s^3, horizontal
    s: Two  # m/s^4, horizontal
    yaw: float  # rad
    yaw_rate: float  # rad/s
    q_arm: PerJoint  # rad
    qd_arm: PerJoint  # rad/s


class Accelerations(Record):
    """``PlanInput``, for kernels."""

    a: Three  # m/s^2, NED
    yaw_acc: float  # rad/s^2
    qdd_arm: PerJoint  # rad/s^2


class Sent(Record):
    """``ActuatorCommand``, for kernels."""

    rotor_thrust: PerRotor  # N
    joint_torque: PerJoint  # N m


class Health(Record):
    """``ActuatorHealth``, for kernels."""

    effectiveness: PerRotor  # thrust over what is commanded
    least: PerRotor  # N
    most: PerRotor  # N, beside the rotor's own limit
    joints: PerJoint  # SOUND, STUCK or LIMP


class Observed(Record):
    """What the observer believes between two velocity readings."""

    v: Three  # m/s, NED
    d: Three  # m/s^2, NED, disturbance acceleration
    disturbance_bias: Two  # m/s^2, horizontal part of d that stays: wind
    recent: float  # m/s^2, largest horizontal d of late: at once up, slowly down


class Joints(Record):
    """What the joint loops carry from tick to tick."""

    reference: PerJoint  # rad, of the last tick
    reference_rate: PerJoint  # rad/s, of the last tick
    momentum: PerJoint  # N m s, as the observer believes
    disturbance: PerJoint  # N m, as the observer believes
    integral: PerJoint  # rad s, of the errors


FILTER_ACTED: Final = 1  # the safety filter changed the acceleration
GATE_NEEDED: Final = 2  # the command is beyond the actuators' limits, or no number
IMPAIRED: Final = 4  # a part has failed: ``health`` is not that of a healthy vehicle


class Tick(Record):
    """The whole state of the fast loop."""

    estimate: Estimate
    plan: PlanState  # where the running plan wants the vehicle now
    u: Accelerations  # the plan's input
    sent: Sent  # the last command; after a tick its own, which the safety gate has yet to pass
    rotors: PerRotor  # N, where the rotor model says they are
    mass: float  # kg, weighed in flight
    observed: Observed
    attitude: Three  # rad s, integrals
    height: float  # m s, integral
    joints: Joints
    off_plan: float  # m, largest deviation of late
    health: Health  # what has been found out about rotors and joints
    margin: float  # m, the least one that the safety filter saw in this tick
    flags: int  # what happened in this tick
    # What is flown: the plan's state and input, changed by the safety filter.
    flown: PlanState
    flown_u: Accelerations

    @property
    def commanded(self) -> ActuatorCommand:
        """The last command."""
        f1, f2, f3, f4, t1, t2 = _COMMAND.unpack_from(self.memory, _SENT_AT)
        return ActuatorCommand((f1, f2, f3, f4), (t1, t2))

    @commanded.setter
    def commanded(self, command: ActuatorCommand) -> None:
        _COMMAND.pack_into(self.memory, _SENT_AT, *command.rotor_thrust, *command.joint_torque)

    @property
    def wind(self) -> Vec2:
        """What lasts of the disturbance [m/s^2, NED]."""
        north, east = _TWO.unpack_from(self.memory, _WIND_AT)
        return north, east

    @property
    def joint_reference(self) -> Vec2:
        """What the joints were asked for [rad]."""
        first, second = _TWO.unpack_from(self.memory, _REFERENCE_AT)
        return first, second

    def give(self, x: StateEstimate, plan: PredictionState, u: PlanInput) -> None:
        """Write down what a tick is given."""
        _GIVEN.pack_into(
            self.memory,
            0,
            x.t_us,
            *x.p_WB,
            *x.v_WB,
            *x.R_WB,
            *x.w_WB_B,
            x.yaw,
            *x.q_arm,
            *x.qd_arm,
            x.specific_force,
            *plan.p,
            *plan.v,
            *plan.a,
            *plan.j,
            *plan.s,
            plan.yaw,
            plan.yaw_rate,
            *plan.q_arm,
            *plan.qd_arm,
            *u.a,
            u.yaw_acc,
            *u.qdd_arm,
        )

    def given(self) -> tuple[StateEstimate, PredictionState]:
        """The estimate and the plan's state."""
        t_us, *x = _GIVEN.unpack_from(self.memory, 0)
        R = (x[6], x[7], x[8], x[9], x[10], x[11], x[12], x[13], x[14])
        p, v, w = (x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[15], x[16], x[17])
        q, qd = (x[19], x[20]), (x[21], x[22])
        estimate = StateEstimate(t_us, p, v, R, w, x[18], q, qd, x[23])
        n = x[24:]
        plan = PredictionState(
            (n[0], n[1], n[2]),
            (n[3], n[4], n[5]),
            (n[6], n[7], n[8]),
            (n[9], n[10]),
            (n[11], n[12]),
            n[13],
            n[14],
            (n[15], n[16]),
            (n[17], n[18]),
        )
        return estimate, plan


FLOWN_ROTORS: Final = 4  # of the vehicle, of those that a record has room for
_FLOWN: Final = 2  # joints, the same
_OF_JOINTS: Final = f"{_FLOWN}d{8 * (JOINTS - _FLOWN)}x"
_GIVEN: Final = struct.Struct(
    f"<q19d{2 * _OF_JOINTS}d" + f"15d{2 * _OF_JOINTS}" + f"4d{_OF_JOINTS}"
)
_COMMAND: Final = struct.Struct(f"<4d{8 * (ROTORS - FLOWN_ROTORS)}x{_OF_JOINTS}")
_TWO: Final = struct.Struct("<2d")


def _place(*names: str) -> int:
    """Where a field is in a record, by its name and those of the records around it [byte]."""
    at, layout = 0, Tick.dtype
    for name in names:
        assert layout.fields is not None
        layout, offset = layout.fields[name][:2]
        at += offset
    return at


_SENT_AT: Final = _place("sent")
_WIND_AT: Final = _place("observed", "disturbance_bias")
_REFERENCE_AT: Final = _place("joints", "reference")
assert _GIVEN.size == _SENT_AT


def new_tick(mass: float) -> Tick:
    """One in which nothing is known yet, of a healthy vehicle of ``mass`` [kg]."""
    r = Tick()
    r.mass, r.margin = mass, math.inf
    r.health.effectiveness[:], r.health.most[:] = 1.0, math.inf
    r.observed.recent = _NOT_KNOWN
    return r


_NOT_KNOWN: Final = 1.0  # m/s^2; nothing was observed yet, and what is to come may be large
