"""The plan's state of a descent without plans: straight down, at rest across, the arm still.

It needs attitude and height only. Where no position is measured, the place is not held: the
estimate's drift would be flown. Speed across is brought to zero for as long as it is known well
enough, because wind would carry a level vehicle away; then the vehicle stays level.
"""

from __future__ import annotations

from typing import Final

from fsw.control.braking import Brake
from fsw.flight.state import Aiding
from fsw.geometry.vectors import clamp_magnitude
from fsw.model.nominal import NominalModel
from fsw.parameters.flight_config import FlightConfig
from fsw.signals import PlanInput, PredictionState, StateEstimate

_RATE: Final = 4.0  # 1/s, of the speed down
_MOST: Final = 1.0  # m/s^2
# Times the speed of landing, where no position is measured: how far it is carried grows with the
# square of the time. The legs stand four times as much, so a height that is wrong does no harm.
_BLIND: Final = 2.0
_BLIND_HIGH: Final = 4.0
_HIGH: Final = 1.0  # m above the legs; with _MOST the vehicle is slow again 0.6 m above them
_SPEED_KNOWN: Final = 1.0  # m/s, standard deviation; PX4's limit of a usable velocity


class Descent:
    """The descent of one configuration."""

    def __init__(self, config: FlightConfig) -> None:
        self._model = NominalModel(config.airframe, config.tick_period_us * 1e-6)
        self._brake = Brake(config.airframe, config.planner.limits.tilt)
        self._speed = config.limits.land_speed
        self._high_z = -config.airframe.leg_length - _HIGH
        self._unaided_us = config.limits.aiding_loss_us

    def step(
        self, nominal: PredictionState, estimate: StateEstimate, aiding: Aiding, ticks: int
    ) -> tuple[PredictionState, PlanInput]:
        """The plan's state ``ticks`` [1] later, and the input that leads on from it."""
        blind = aiding.unaided_us >= self._unaided_us
        speed = self._speed
        if blind:
            speed *= _BLIND_HIGH if estimate.p_WB[2] < self._high_z else _BLIND
        for _ in range(ticks):
            nominal = self._model.step(nominal, self._input(nominal, speed))
        if blind:
            (x, y, _), (_, _, z) = estimate.p_WB, nominal.p
            nominal = nominal._replace(p=(x, y, z))
            if not aiding.velocity_sigma <= _SPEED_KNOWN:
                (vx, vy, _), (_, _, vz) = estimate.v_WB, nominal.v
                _, _, az = nominal.a
                nominal = nominal._replace(
                    v=(vx, vy, vz), a=(0.0, 0.0, az), j=(0.0, 0.0), s=(0.0, 0.0)
                )
        return nominal, self._input(nominal, speed)

    def _input(self, nominal: PredictionState, speed: float) -> PlanInput:
        u = self._brake(nominal)
        down = clamp_magnitude(_RATE * (speed - nominal.v[2]), _MOST)
        return u._replace(a=(u.a[0], u.a[1], down))
