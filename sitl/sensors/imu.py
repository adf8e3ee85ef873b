"""Inertial unit: noise, biases, scale, misalignment, range, digits, and the rotors' vibration.

Source: IEEE Std 952-1997, annex C, for noise and bias; docs/reference/sensors.md for the numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np

from sitl.compiled import compilable, kernel, machine_code
from sitl.plant.packing import pack_params
from sitl.plant.state import ROTORS_MAX
from sitl.plant.vector import V3, V6, V8, Array, times
from sitl.sensors.channel import Aboard, SensorModel
from sitl.sensors.exact import SensorReadings, Thrusts
from sitl.sensors.keys import Imu
from sitl.sensors.noise import GaussMarkov, normal

_BLOCK = 25  # samples for which a bias is held
_BLOCKS = 10  # drawn at once, in the order in which one by one would be
_SPIKE = 1e9  # rad/s or m/s², beyond every range


class ImuMeasurement(NamedTuple):
    """Gyro and accelerometer."""

    t_us: int
    gyro_B: V3  # rad/s
    accel_B: V3  # m/s², specific force


class _Errors(NamedTuple):
    """Numbers of one unit for the kernel, gyro's and accelerometer's in a pair."""

    gyro: Array  # (3, 3) [1] scale and misalignment
    accel: Array  # (3, 3) [1]
    limit: Array  # (2,) rad/s, m/s²
    resolution: Array  # (2,) rad/s, m/s²
    vibration: Array  # (2,) rad/s, m/s², of one rotor in hover
    hover_thrust: float  # N, of one rotor
    turn: float  # rad, of a rotor in hover from one sample to the next
    spin: Array  # (8,) 1 of a rotor that turns counter-clockwise, -1 clockwise, 0 where none is
    phase: Array  # (8,) rad, where each rotor stands; moved on by the kernel


@compilable
def vibrate(errors: _Errors, thrust: V8) -> V3:
    """Turn the rotors on by one sample; the unbalance of all, as a share of one in hover, B.

    An unbalance pulls outwards in the plane of the disc; the blades shake along the axis twice a
    turn, half as strongly. It grows with the square of the speed, as the ``thrust`` [N] does.
    """
    x, y, z = 0.0, 0.0, 0.0
    phase = errors.phase
    for i in range(ROTORS_MAX):
        if errors.spin[i] == 0.0:
            continue
        share = max(thrust[i], 0.0) / errors.hover_thrust
        at = phase[i] + errors.turn * np.sqrt(share)
        at -= 2.0 * np.pi * np.floor(at / (2.0 * np.pi))
        phase[i] = at
        c, s = np.cos(at), np.sin(at)
        x += share * c
        y += errors.spin[i] * share * s
        z += share * c * s  # half of sin 2φ
    return (x, y, z)


@compilable
def _digit(value: float, limit: float, resolution: float) -> float:
    """What the converter makes of a value [any unit]: on its grid, within its range."""
    if resolution > 0.0:
        value = resolution * np.rint(value / resolution)
    # Last, because the nearest step may lie beyond the range.
    return min(max(value, -limit), limit)


@kernel
def _measure(units: Sequence[_Errors], rate: V3, force: V3, thrust: V8, offset: V6) -> V6:
    """What a unit makes of the truth; ``offset`` is its bias and noise in this sample."""
    errors = units[0]
    w, a = times(errors.gyro, rate), times(errors.accel, force)
    turn, push = errors.vibration[0], errors.vibration[1]
    shake = (0.0, 0.0, 0.0)
    if turn > 0.0 or push > 0.0:
        shake = vibrate(errors, thrust)
    limit, grid = errors.limit, errors.resolution
    # A rotor beside the centre turns the base about the axis across its pull.
    return (
        _digit(w[0] + offset[0] + turn * shake[1], limit[0], grid[0]),
        _digit(w[1] + offset[1] + turn * shake[0], limit[0], grid[0]),
        _digit(w[2] + offset[2] + turn * shake[2], limit[0], grid[0]),
        _digit(a[0] + offset[3] + push * shake[0], limit[1], grid[1]),
        _digit(a[1] + offset[4] + push * shake[1], limit[1], grid[1]),
        _digit(a[2] + offset[5] + push * shake[2], limit[1], grid[1]),
    )


class ImuSensor(SensorModel):
    """One unit of one flight."""

    kind = Imu
    says = ImuMeasurement

    def __init__(
        self,
        keys: Imu,
        random: np.random.Generator,
        hover_thrust: float,
        spins: Sequence[float],
    ) -> None:
        """Draw what this flight's unit is like; a rotor gives ``hover_thrust`` [N] in hover.

        Of every rotor ``spins`` says 1 if it turns counter-clockwise, -1 if clockwise.
        """
        count = len(spins)
        self._room = (0.0,) * (ROTORS_MAX - count)
        self._random = random
        errors = _Errors(
            gyro=_distorted(random, keys.gyro_scale_share, math.radians(keys.misalignment_deg)),
            accel=_distorted(random, keys.accel_scale_share, math.radians(keys.misalignment_deg)),
            limit=np.array([keys.gyro_limit_rad_s, keys.accel_limit_m_s2]),
            resolution=np.array([keys.gyro_resolution_rad_s, keys.accel_resolution_m_s2]),
            vibration=np.array([keys.vibration_rad_s, keys.vibration_m_s2]),
            hover_thrust=hover_thrust,
            turn=2.0 * math.pi * keys.rotor_hz / keys.rate_hz,
            spin=np.array([*spins, *self._room]),
            phase=np.array([*random.uniform(0.0, 2.0 * math.pi, count), *self._room]),
        )
        turn_on = normal(random, keys.gyro_turn_on_rad_s, 3)
        turn_on += normal(random, keys.accel_turn_on_m_s2, 3)
        self._turn_on = np.array(turn_on)
        step_s = _BLOCK / keys.rate_hz
        gyro, accel = (keys.gyro_bias_rad_s,) * 3, (keys.accel_bias_m_s2,) * 3
        self._gyro_bias = GaussMarkov(gyro, keys.gyro_bias_time_s, step_s, random)
        self._accel_bias = GaussMarkov(accel, keys.accel_bias_time_s, step_s, random)
        white = np.sqrt(keys.rate_hz) * np.array([keys.gyro_density_rad_s, keys.accel_density_m_s2])
        self._white = np.repeat(white, 3)
        self._offsets: list[V6] = []  # of the samples to come, the next one last
        self._units = cast(Sequence[_Errors], np.array([pack_params(errors)]))
        none = (0.0, 0.0, 0.0)
        still = (0.0,) * ROTORS_MAX
        self._code = machine_code(_measure, self._units, none, none, still, (*none, *none))

    @classmethod
    def aboard(cls, keys: Imu, random: np.random.Generator, where: Aboard) -> ImuSensor:
        """One that the rotors of its vehicle shake."""
        spins = [1.0 if rotor.spin == "ccw" else -1.0 for rotor in where.vehicle.rotors]
        return cls(keys, random, where.hover_thrust, spins)

    def measure(
        self, exact: SensorReadings, thrust: Thrusts, stamp_us: int, outlier: bool
    ) -> ImuMeasurement:
        """A reading; an outlier is a spike to an end of the range.

        The rotors give ``thrust`` [N].
        """
        if not self._offsets:
            self._offsets = self._drawn()
        rate, force = exact.gyro_B, exact.accel_B
        if outlier:
            rate, force = (_SPIKE, -_SPIKE, _SPIKE), (_SPIKE, -_SPIKE, _SPIKE)
        code, units, offset = self._code, self._units, self._offsets.pop()
        every = cast(V8, (*thrust, *self._room))
        x, y, z, ax, ay, az = code(units, rate, force, every, offset)
        return ImuMeasurement(stamp_us, (x, y, z), (ax, ay, az))

    def _drawn(self) -> list[V6]:
        """Bias and noise of the samples to come."""
        white, gyro = 6 * _BLOCK, self._gyro_bias.draws
        drawn = self._random.standard_normal((_BLOCKS, white + gyro + self._accel_bias.draws))
        offsets = drawn[:, :white].reshape(_BLOCKS, _BLOCK, 6) * self._white
        for block, fresh in zip(offsets, drawn[:, white:], strict=True):
            bias = self._gyro_bias.moved(fresh[:gyro]) + self._accel_bias.moved(fresh[gyro:])
            block += self._turn_on + bias
        # The last one is taken first, block by block.
        turned = offsets[::-1].reshape(-1, 6)
        return cast(list[V6], list(map(tuple, turned.tolist())))


def _distorted(random: np.random.Generator, scale: float, turn: float) -> Array:
    """What makes the components along an instrument's own axes of those along the body's."""
    distortion: Array = turn * random.standard_normal((3, 3))
    np.fill_diagonal(distortion, scale * random.standard_normal(3))
    return np.eye(3) + distortion
