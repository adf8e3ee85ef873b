"""The vehicle's limits, judged on the plant's truth at every step: how much of each was used.

Angles and the tilt are of the true state, rates too; what the flight software commands to rotors
and joints counts as it arrives, before the plant's own saturation: that could never be broken.

Source: the vehicle's file; docs/decisions/0027-limits-that-hold.md.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sitl.compiled import kernel
from sitl.plant.state import Q_WB, THRUST, W_WB_B
from sitl.plant.vector import Array
from vehicles.description import Vehicle

_ANGLE_KEPT = math.radians(0.5)  # rad, beyond an angle that still counts as kept
_RATE_KEPT = 0.02  # share of a joint's rate
_COMMAND_KEPT = 1e-6  # share of a command's most: commands travel as single precision


@dataclass(frozen=True, slots=True)
class Limit:
    """A quantity whose magnitude has a most, and how far beyond still counts as kept."""

    key: str
    unit: str
    most: float
    tolerance: float


@dataclass(frozen=True, slots=True)
class LimitUse:
    """What a run made of a limit."""

    unit: str
    most: float  # the limit
    largest: float  # magnitude; the value itself of an angle that is limited on one side
    at_s: float  # when
    beyond_s: float  # time spent beyond the limit
    kept: bool  # within the tolerance


class Bounds(NamedTuple):
    """The limits for kernels, in the order of ``limits``."""

    most: Array  # (limits,) in the unit of each
    share: Array  # (angles, j) of each joint in an angle that is limited
    signed: npt.NDArray[np.bool_]  # (angles,) whether it is limited on this side only
    command: Array  # (2,) what full torque and full thrust count, in the units of their limits
    angles: int  # entry of the first joint's angle in the state


def limits(vehicle: Vehicle) -> tuple[Limit, ...]:
    """Of a vehicle, in the order of ``record_use``."""
    own = vehicle.limits
    torques = {joint.torque_max for joint in vehicle.joints}
    thrusts = {rotor.thrust_max for rotor in vehicle.rotors}
    found = (
        *(Limit(key, "rad", most, _ANGLE_KEPT) for key, _, _, most in _angles(vehicle)),
        *(
            Limit(f"{_key(one.name)}_rate", "rad/s", one.rate_max, _RATE_KEPT * one.rate_max)
            for one in vehicle.joints
        ),
        Limit("tilt", "rad", own.tilt, _ANGLE_KEPT),
        Limit("roll_pitch_rate", "rad/s", own.roll_pitch_rate, 0.1),
        Limit("yaw_rate", "rad/s", own.yaw_rate, 0.05),
        _command("joint_torque", "N m", torques),
        _command("rotor_thrust", "N", thrusts),
    )
    # From the last, so that the base keeps its keys: a joint may be named as one of them.
    kept: dict[str, Limit] = {}
    for limit in reversed(found):
        key = limit.key
        while key in kept:
            key = f"joint_{key}"
        kept[key] = replace(limit, key=key)
    return tuple(reversed(kept.values()))


def _command(key: str, unit: str, most: set[float]) -> Limit:
    """Of drives that give the same; of others the share of each one's own."""
    value, unit = (most.pop(), unit) if len(most) == 1 else (1.0, "of full")
    return Limit(key, unit, value, _COMMAND_KEPT * value)


def _key(name: str) -> str:
    return re.sub(r"(?<=[^\d_])(\d+)$", r"_\1", name)


def _angles(vehicle: Vehicle) -> list[tuple[str, Array, bool, float]]:
    """Key, shares of the joints, whether on this side only, and most [rad] of every angle."""
    rows = [
        (joint.name, unit, joint.position_min, joint.position_max)
        for joint, unit in zip(vehicle.joints, np.eye(len(vehicle.joints)), strict=True)
    ]
    rows += [
        (one.name, np.array(one.row), one.minimum, one.maximum) for one in vehicle.coupled_limits
    ]
    found = []
    for name, row, least, most in rows:
        key = f"{_key(name)}_angle"
        if least == -most:
            found.append((key, row, False, most))
        else:
            found += [(f"{key}_max", row, True, most), (f"{key}_min", -row, True, -least)]
    return [one for one in found if math.isfinite(one[3])]


def bounds(vehicle: Vehicle) -> Bounds:
    """The limits of a vehicle for kernels."""
    found, angles = limits(vehicle), _angles(vehicle)
    return Bounds(
        most=np.array([limit.most for limit in found]),
        share=np.reshape([row for _, row, _, _ in angles], (-1, len(vehicle.joints))),
        signed=np.array([one_side for _, _, one_side, _ in angles], dtype=np.bool_),
        command=np.array([limit.most for limit in found[-2:]]),
        angles=THRUST + len(vehicle.rotors),
    )


def largest(thrust: tuple[float, ...], torque: tuple[float, ...]) -> tuple[float, float]:
    """Largest commanded, of the most of a joint and of a rotor [1].

    ``thrust`` (r,) [1] and ``torque`` (j,) [1] are shares of what each rotor and joint can give.
    """
    weakest, strongest = min(thrust), max(thrust)
    # A thrust below zero is as far beyond its range as one that is as much too large.
    beyond = strongest if weakest >= 0.0 else max(strongest, 1.0 - weakest)
    return max(max(torque), -min(torque)), beyond


class Use(NamedTuple):
    """A record for kernels, an entry a limit."""

    largest: Array  # (limits,) magnitudes in the unit of each
    when_s: Array  # (limits,) s, when that was
    beyond_s: Array  # (limits,) s, spent beyond the limit
    steps: Array  # (1,) how many have been recorded
    now: Array  # (limits,) magnitudes of one step


class LimitRecord:
    """The largest use of every limit, when it was, and how long each was exceeded."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.limits, self._bounds = limits(vehicle), bounds(vehicle)
        # Of an angle that is limited on one side the value counts, which may never be above 0.
        one_sided = np.pad(self._bounds.signed, (0, len(self.limits) - self._bounds.signed.size))
        self._largest = np.where(one_sided, -math.inf, 0.0)
        self._when_s = np.zeros(len(self.limits))
        self._beyond_s = np.zeros(len(self.limits))
        self._steps, self._now = np.zeros(1), np.zeros(len(self.limits))

    @property
    def arrays(self) -> tuple[Bounds, Use]:
        """The limits and the memory behind the record, for ``record_use``."""
        record = Use(self._largest, self._when_s, self._beyond_s, self._steps, self._now)
        return self._bounds, record

    def uses(self) -> dict[str, LimitUse]:
        """By the limit's key; empty before the first step."""
        if not self._steps[0]:
            return {}
        return {
            limit.key: LimitUse(
                unit=limit.unit,
                most=limit.most,
                largest=float(self._largest[i]),
                at_s=float(self._when_s[i]),
                beyond_s=float(self._beyond_s[i]),
                kept=bool(self._largest[i] <= limit.most + limit.tolerance),
            )
            for i, limit in enumerate(self.limits)
        }

    def flaws(self) -> tuple[str, ...]:
        """A sentence for each limit that was broken."""
        return tuple(
            f"{key.replace('_', ' ')} reached {spoken(use.largest, use.unit)} of "
            f"{spoken(use.most, use.unit)} at {use.at_s:.2f} s and was {use.beyond_s:.2f} s beyond"
            for key, use in self.uses().items()
            if not use.kept
        )


def spoken(value: float, unit: str) -> str:
    """A ``value`` [unit] as a reader wants it, angles in degrees."""
    if unit == "rad":
        return f"{math.degrees(value):.1f} deg"
    return f"{value:.2f} {unit}"


@kernel
def record_use(
    states: Array,
    sent: tuple[float, float],
    bounds: Bounds,
    instants: tuple[float, float],
    record: Use,
) -> None:
    """Take plant steps into a record.

    Args:
        states: (steps, n) [SI], see ``sitl.plant.state``.
        sent: Largest commanded during them, as of ``largest``.
        bounds: The limits.
        instants: Time one step before the first, and between two steps [s].
        record: Overwritten.
    """
    largest, when_s, beyond_s, used = record.largest, record.when_s, record.beyond_s, record.now
    record.steps[0] += states.shape[0]
    before_s, step_s = instants
    most, first, (angles, joints) = bounds.most, bounds.angles, bounds.share.shape
    for k in range(states.shape[0]):
        x = states[k]
        for i in range(angles):
            angle = 0.0
            for j in range(joints):
                angle += bounds.share[i, j] * x[first + j]
            used[i] = angle if bounds.signed[i] else abs(angle)
        for j in range(joints):
            used[angles + j] = abs(x[first + joints + j])
        at = angles + joints
        # Half the tilt has the sine that the attitude has across the body's z axis.
        across = math.sqrt(x[Q_WB + 1] * x[Q_WB + 1] + x[Q_WB + 2] * x[Q_WB + 2])
        used[at] = 2.0 * math.asin(min(across, 1.0))
        used[at + 1] = math.sqrt(x[W_WB_B] * x[W_WB_B] + x[W_WB_B + 1] * x[W_WB_B + 1])
        used[at + 2] = abs(x[W_WB_B + 2])
        for i in range(2):
            used[at + 3 + i] = bounds.command[i] * sent[i]
        for i in range(most.shape[0]):
            # Written so that what is not a number is recorded, and beyond.
            if not (used[i] <= largest[i]):
                largest[i] = used[i]
                when_s[i] = before_s + (k + 1) * step_s
            if not (used[i] <= most[i]):
                beyond_s[i] += step_s
