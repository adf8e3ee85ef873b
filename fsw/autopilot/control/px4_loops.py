r"""PX4's loops in place of ours: what they are asked for, and what is known of them.

PX4 flies the vehicle, and is told where the plan wants it: position, velocity, acceleration and
yaw. Its position loop makes of that

.. math:: c = a_{sp} + K_v\,(v_{sp} + K_p (p_{sp} - p) - v) + z - K_a\,\dot v, \quad
          \dot z = K_i\,(v_{sp} + K_p (p_{sp} - p) - v),

and its attitude loop turns c into acceleration, :math:`\tau \dddot a + \ddot a = k_p(c - a) - k_d
\dot a`, with a delay in its own feedback, too. The plan is predicted with that lag. So PX4 follows
it where

.. math:: a_{sp} = u + K_a a_p - s\,\hat d,

u being the plan's input and s the share of the observed disturbance that is cancelled here, sooner
than the integral z does. The safety filter knows what PX4 makes of it and adds its push.

Source: docs/decisions/0046-the-planner-above-px4.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import NDArray

from fsw.autopilot.control.cascade import (
    Cascade,
    CascadeLaw,
    KeepClear,
    cascade_law,
    compare_with_plan,
    filter_asked,
    note_weight,
    refer_joints,
    settle_rotors,
)
from fsw.autopilot.control.gains import LoopGains, TrackingGains
from fsw.autopilot.control.safety_filter import FilterProbes
from fsw.autopilot.control.tracking import TrackingLaw, observe
from fsw.autopilot.control.tube import NO_TUBE, TubeAround
from fsw.autopilot.geometry.vectors import add_scaled, clamp_magnitude, subtract
from fsw.autopilot.model.airframe import GRAVITY, Airframe, AttitudeLag
from fsw.autopilot.model.body import body_of
from fsw.autopilot.model.multibody import move_bodies
from fsw.autopilot.model.rotors import MotionState, motion_state
from fsw.autopilot.shapes.zones import NO_ZONES, Zones
from fsw.autopilot.signals import Setpoint, Vec2, Vec3
from fsw.autopilot.tick_record import Tick
from fsw.compiled import compilable, kernel, machine_code, packed


@dataclass(frozen=True, slots=True)
class Px4Tuning:
    """PX4's loops as they are believed to be; `pandion px4 identify` finds them out.

    Gains are those of its parameters MPC_XY_P, MPC_XY_VEL_P_ACC, MPC_XY_VEL_I_ACC and
    MPC_XY_VEL_D_ACC, and the same along z.
    """

    position_gain: float = 1.8  # 1/s
    velocity_gain: float = 5.0  # 1/s
    velocity_integral: float = 1.0  # 1/s^2
    acceleration_gain: float = 0.6
    height_gain: float = 1.5  # 1/s
    climb_gain: float = 8.0  # 1/s
    climb_integral: float = 2.0  # 1/s^2
    # As identified of PX4 v1.17 with the gains of `pandion px4 params`. By those alone it would be
    # 103 1/s^2, 14.7 1/s and 24 ms: filters and the link make less of it.
    tilt_kp: float = 73.0  # 1/s^2
    tilt_kd: float = 12.5  # 1/s
    delay: float = 0.046  # s, of its feedback
    observer: float = 30.0  # rad/s, of the disturbance; PX4's estimate comes 125 times a second
    cancelled: float = 0.8  # share of the observed disturbance


def airframe_above_px4(airframe: Airframe, px4: Px4Tuning) -> Airframe:
    """The vehicle with the lag of PX4's loops in place of ours."""
    return replace(
        airframe, attitude_lag=AttitudeLag(px4.tilt_kp, px4.tilt_kd), rotor_lag=px4.delay
    )


class Px4Loops(Cascade):
    """What the tick has in place of the cascade: the same record in, a setpoint out."""

    def __init__(
        self,
        airframe: Airframe,
        tuning: LoopGains,
        px4: Px4Tuning,
        dt: float,
        keep_clear: KeepClear | None = None,
    ) -> None:
        """Of an airframe with PX4's lag, for a tick of ``dt`` [s]."""
        clear = keep_clear or KeepClear(body=body_of("points", airframe))
        tracking = replace(tuning.tracking, observer_bandwidth=px4.observer, wind_limit=0.0)
        # The law of the tracking loop is not flown.
        loop = TrackingLaw(airframe.attitude_lag, tracking, _NO_GAINS)
        lag = loop.lag.kd / loop.lag.kp + airframe.rotor_lag
        gains = replace(tuning, tracking=tracking)
        self.law = cascade_law(airframe, gains, loop, clear, lag, dt, follows_plan=True)
        self.px4, self._packed_px4 = px4, packed(px4)
        self._load(clear)
        models = self.packed, self._packed_px4
        self._ask = machine_code(_ask_px4, *models, Tick().array, 1, NO_ZONES, self.probes, NO_TUBE)

    def ask(self, r: Tick, ticks: int, zones: Zones, tube: TubeAround) -> None:
        """Close the loops of a record; rotors are PX4's, whatever their health."""
        r.flags = 0
        self._ask(self.packed, self._packed_px4, r.array, ticks, zones, self.probes, tube)

    def setpoint(self, r: Tick) -> Setpoint:
        """What PX4 is asked for by a record after its step."""
        p, a = r.flown, r.flown_u.a
        return Setpoint(
            (float(p.p[0]), float(p.p[1]), float(p.p[2])),
            (float(p.v[0]), float(p.v[1]), float(p.v[2])),
            (float(a[0]), float(a[1]), float(a[2])),
            p.yaw,
            p.yaw_rate,
            r.joint_reference,
        )


_MOST_CANCELLED = 1.5  # m/s^2 an axis
# m/s^2 an axis: what more takes from PX4's own law relies on a model of it that is late by then.
_MOST_PUSHED = 3.0
_NO_GAINS = TrackingGains((0.0,) * 5, 0.0, (0.0,) * 3, 0.0)


@compilable
def ask_px4(
    r: Tick, law: CascadeLaw, px4: Px4Tuning, ticks: int, zones: Zones, probes: FilterProbes
) -> None:
    """One tick: from estimate and plan to what PX4 is asked for, in ``flown`` and ``flown_u``."""
    airframe, dt = law.airframe, law.dt
    settle_rotors(r, law, ticks)
    move_bodies(r.bodies, airframe.bodies, airframe.joint_armature, r.estimate)
    motion = motion_state(airframe, r, r.rotors, r.sent.joint_torque)
    v = (r.estimate.v_WB[0], r.estimate.v_WB[1], r.estimate.v_WB[2])
    for _ in range(ticks):
        observe(r.observed, v, motion.a, law.tuning.tracking, dt)
    r.flown, r.flown_u = r.plan, r.u
    r.margin = math.inf
    for axis in range(2):
        r.flown_u.a[axis] += px4.acceleration_gain * r.plan.a[axis]
        r.flown_u.a[axis] -= px4.cancelled * clamp_magnitude(r.observed.d[axis], _MOST_CANCELLED)
    if zones.shape[0] != 0 and law.filter.tuning.enabled > 0:
        keep_off_zones(r, law, px4, motion, zones, probes)
    refer_joints(r, law, dt * ticks)
    for j in range(int(airframe.bodies.joints)):
        r.sent.joint_torque[j] = 0.0
    # What carries the vehicle as it leans, in equal parts: PX4 does not say.
    carried = airframe.mass * (GRAVITY - r.plan.a[2]) / max(r.estimate.R_WB[8], 0.5)
    for i in range(int(airframe.rotors)):
        r.sent.rotor_thrust[i] = min(carried / airframe.rotors, airframe.rotor_thrust_max[i])


@compilable
def keep_off_zones(
    r: Tick,
    law: CascadeLaw,
    px4: Px4Tuning,
    motion: MotionState,
    zones: Zones,
    probes: FilterProbes,
) -> None:
    """Add what the safety filter pushes beyond what PX4 will ask its attitude loop for."""
    a = add_scaled(motion.a, r.observed.d, 1.0)
    asked = asked_by_px4(r, px4, a)
    safe, changed = filter_asked(r, law, zones, probes, a, asked)
    if changed:
        push = subtract(safe, asked)
        for axis in range(3):
            r.flown_u.a[axis] += clamp_magnitude(push[axis], _MOST_PUSHED)


@compilable
def asked_by_px4(r: Tick, px4: Px4Tuning, a: Vec3) -> Vec3:
    """The acceleration [m/s^2, NED] that PX4's position loop makes of a setpoint.

    It accelerates by ``a`` [m/s^2, NED] now. Without its integral, which is for what lasts.
    """
    aside = px4.position_gain, px4.velocity_gain
    return (
        _asked_along(r, 0, aside) - px4.acceleration_gain * a[0],
        _asked_along(r, 1, aside) - px4.acceleration_gain * a[1],
        _asked_along(r, 2, (px4.height_gain, px4.climb_gain)),
    )


@compilable
def _asked_along(r: Tick, axis: int, gains: Vec2) -> float:
    """By position and velocity on an axis, with the ``gains`` [1/s] of both."""
    off = r.flown.p[axis] - r.estimate.p_WB[axis]
    wanted: float = r.flown.v[axis] + gains[0] * off
    asked: float = r.flown_u.a[axis] + gains[1] * (wanted - r.observed.v[axis])
    return asked


@kernel
def _ask_px4(
    laws: NDArray[Any],
    models: NDArray[Any],
    records: NDArray[Any],
    ticks: int,
    zones: Zones,
    probes: FilterProbes,
    tube: TubeAround,
) -> None:
    ask_px4(records[0], laws[0], models[0], ticks, zones, probes)
    compare_with_plan(records[0], tube)
    note_weight(records[0], laws[0].airframe)
