"""Descend: straight down without plans, where nothing else can be flown, until touch-down.

At rest across, the arm still: that needs attitude and height only. Where no position is measured,
the place is not held: the estimate's drift would be flown. For as long as speed across is known
well enough, the vehicle draws back from zones on what dead reckoning says, and comes to rest where
it is as far from them as they leave room for. Then it stays level: wind would carry it away, and so
would a speed that is wrong. Nor is wind leaned against then: what is observed by such a speed is
the error of who tells it.
"""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.barriers.safe_approach import stand_off
from fsw.autopilot.control.braking import Brake
from fsw.autopilot.flight.modes.base import FlightMode, ModeResult, Px4Mode, touch_down
from fsw.autopilot.flight.safety.retreat import retreat_place
from fsw.autopilot.flight.setpoints.generator import PositionGoal
from fsw.autopilot.flight.setpoints.reference_governor import max_lead
from fsw.autopilot.flight.state import Aiding, FlightState, SetpointMemory
from fsw.autopilot.geometry.vectors import clamp_magnitude
from fsw.autopilot.model.nominal import NominalModel
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import (
    Mode,
    MotionSetpoint,
    PlanInput,
    PredictionState,
    StateEstimate,
    Vec2,
    Vec3,
)
from fsw.autopilot.tick_record import Observed
from fsw.frozen import replace

_RATE: Final = 4.0  # 1/s, of the speed down
_MOST: Final = 1.0  # m/s^2
# Where no position or no attitude is measured the vehicle sinks faster: how far it is carried grows
# with the square of the time. Times the speed of landing near the ground and above, however wrong
# the height is: the legs stand eight times as much.
_HURRIED: Final = 2.0
_HURRIED_HIGH: Final = 4.0
_HIGH: Final = 1.0  # m above the legs; with _MOST the vehicle is slow again 0.6 m above them
# And faster still where the height is known to be enough to be slow again.
_FAST: Final = 1.5  # m/s, as PX4's MPC_Z_VEL_MAX_DN
_SLOW: Final = 0.3  # m above the legs, less ``_SIGMAS`` of the height
_SIGMAS: Final = 3.0
_MAX_HURRIED: Final = 2.0  # m/s^2
_BRAKING: Final = 1.2  # m/s^2 that are counted on; loops lag
_SPEED_KNOWN: Final = 1.0  # m/s, standard deviation; PX4's limit of a usable velocity
_SPEED_GOOD: Final = 0.5  # m/s; from here to there the vehicle draws back ever slower
_BACK: Final = 1.0  # m/s, as fast as it draws back at most
_BACK_RATE: Final = 1.5  # 1/s
# Legs that touch the ground as the vehicle draws back would trip it: it is at rest across by then.
_REST_ACROSS: Final = 2.0  # m/s^2 that are counted on
_RESTS_FOR: Final = 0.5  # s before legs touch; loops lag
# Where nothing but the rotors' model is left, it sinks ever faster from where the ground should be.
_THROUGH: Final = 10.0  # m/s


class Descend(FlightMode):
    """PX4's DESCEND, which it shows as AUTO.LAND; no command begins it."""

    mode = Mode.DESCEND
    px4 = Px4Mode(4, 6, 12, "descend", selectable=False, offered=False)

    def __init__(self, config: FlightConfig) -> None:
        super().__init__(config)
        self._room = stand_off(config.planner.walls)

    def update(self, state: FlightState, estimate: StateEstimate) -> tuple[FlightState, ModeResult]:
        """Down until the ground carries the vehicle."""
        return touch_down(self.config, state, estimate)

    def aim(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        """Where no position or attitude is measured, the place to draw back to.

        Clearances have grown by what the place is uncertain by, as far as there is room for.
        """
        safe_set, limits = state.kept.whole.safe_set, self.config.limits
        if not (is_hurried(state.aiding, limits.aiding_loss_us) and safe_set.zones):
            known = state.setpoint.goal is None
            return state if known else replace(state, setpoint=SetpointMemory())
        place = retreat_place(self.config, safe_set, estimate, self._room)
        goal = PositionGoal(MotionSetpoint(False, place))
        return replace(state, setpoint=SetpointMemory(goal=goal))


def is_hurried(aiding: Aiding, unaided_us: int) -> bool:
    """Whether the estimate gets worse with time: without a position for long, or an attitude."""
    return aiding.unaided_us >= unaided_us or not aiding.holds_attitude(unaided_us)


def forget_wind(observed: Observed, estimate: StateEstimate) -> None:
    """Observe the disturbance across anew from the ``estimate``: what is known, and no wind."""
    for axis in range(2):
        observed.v[axis], observed.d[axis] = estimate.v_WB[axis], observed.known[axis]
        observed.disturbance_bias[axis] = 0.0


class Descent:
    """The plan's state of a descent without plans, of one configuration."""

    def __init__(self, config: FlightConfig) -> None:
        self._model = NominalModel(config.airframe, config.tick)
        self._brake = Brake(config.airframe, config.planner.limits.tilt)
        self._speed = config.limits.land_speed
        self._legs_z = -config.airframe.leg_length
        self._unaided_us = config.limits.aiding_loss_us

    def step(
        self,
        nominal: PredictionState,
        estimate: StateEstimate,
        aiding: Aiding,
        ticks: int,
        place: Vec3 | None = None,
    ) -> tuple[PredictionState, PlanInput]:
        """The plan's state ``ticks`` [1] later, and the input that leads on from it.

        ``place`` [m, NED] is where the vehicle draws back to in a hurry.
        """
        blind = aiding.unaided_us >= self._unaided_us
        speed, most, across = self._speed, _MOST, (0.0, 0.0)
        if is_hurried(aiding, self._unaided_us):
            height = self._legs_z - estimate.p_WB[2]
            speed, most = self._hurried_speed(height, aiding)
            if place is not None:
                across = self._back(height, estimate, aiding, place)
        for _ in range(ticks):
            nominal = self._model.advance(nominal, self._input(nominal, speed, most, across))
        # What holds the vehicle up may go away: the plan waits for it.
        (px, py, pz), lowest = nominal.p, estimate.p_WB[2] + max_lead(speed)
        if pz > lowest:
            nominal = nominal._replace(p=(px, py, lowest))
        if blind:
            (x, y, _), (_, _, z) = estimate.p_WB, nominal.p
            nominal = nominal._replace(p=(x, y, z))
            if self.stays_level(aiding):
                (vx, vy, _), (_, _, vz) = estimate.v_WB, nominal.v
                _, _, az = nominal.a
                nominal = nominal._replace(
                    v=(vx, vy, vz), a=(0.0, 0.0, az), j=(0.0, 0.0), s=(0.0, 0.0)
                )
        return nominal, self._input(nominal, speed, most, across)

    def stays_level(self, aiding: Aiding) -> bool:
        """Whether neither place nor speed across is known."""
        unknown = not aiding.velocity_sigma <= _SPEED_KNOWN
        return unknown and aiding.unaided_us >= self._unaided_us

    def _hurried_speed(self, height: float, aiding: Aiding) -> Vec2:
        """How fast to sink in a hurry from a ``height`` [m], and to get there: [m/s], [m/s^2]."""
        if height < 0.0 and aiding.feels_nothing:
            return _THROUGH, _MOST
        slow = _HURRIED * self._speed
        sure = height - _SLOW - _SIGMAS * aiding.height_sigma
        usual = _HURRIED_HIGH * self._speed if height > _HIGH else slow
        if not sure > 0.0:
            return usual, _MOST
        braked = math.sqrt(slow * slow + 2.0 * _BRAKING * sure)
        return max(usual, min(_FAST, braked)), _MAX_HURRIED

    def _input(
        self, nominal: PredictionState, speed: float, most: float, across: Vec2
    ) -> PlanInput:
        vx, vy, vz = nominal.v
        u = self._brake(nominal._replace(v=(vx - across[0], vy - across[1], vz)))
        down = clamp_magnitude(_RATE * (speed - vz), most)
        return u._replace(a=(u.a[0], u.a[1], down))

    def _back(self, height: float, estimate: StateEstimate, aiding: Aiding, place: Vec3) -> Vec2:
        """Velocity across [m/s, NED] from a ``height`` [m] towards a place to draw back to.

        Slower the less it is known, and as the ground comes near.
        """
        known = (_SPEED_KNOWN - aiding.velocity_sigma) / (_SPEED_KNOWN - _SPEED_GOOD)
        left = height / max(estimate.v_WB[2], _HURRIED * self._speed) - _RESTS_FOR
        most = min(_BACK * min(known, 1.0), _REST_ACROSS * left)
        if not most > 0.0:
            return 0.0, 0.0
        dx, dy = place[0] - estimate.p_WB[0], place[1] - estimate.p_WB[1]
        share = _BACK_RATE * min(1.0, most / max(_BACK_RATE * math.hypot(dx, dy), 1e-9))
        return share * dx, share * dy
