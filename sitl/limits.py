"""The vehicle's limits, judged on the plant's truth at every step: how much of each was used.

Angles and the tilt are of the true state, rates too; what the flight software commands to rotors
and joints counts as it arrives, before the plant's own saturation: that could never be broken.

Source: Table I of the paper; docs/decisions/0027-limits-that-hold.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sitl.compiled import compiled
from sitl.plant.parameters import Vehicle
from sitl.plant.state import ARM, Q_WB, W_WB_B
from sitl.plant.vector import V4, Array

FIRST_JOINT_DEG, BOTH_JOINTS_DEG = 60.0, 90.0  # Table I, either way
# The servos': 2.5 N·m stall and 5.8 rad/s without load leave 5 rad/s against the arm's weight.
JOINT_RATE_MAX = 5.0  # rad/s
# The planner's pi / 10 of Table I, and what cancels 0.8 m/s² on both axes at once: 23.8 deg.
TILT_MAX_DEG = 25.0
ROLL_PITCH_RATE_MAX = 3.0  # rad/s; the fast loop's jerk limit on both axes turns a body at 2.9
YAW_RATE_MAX = 1.0  # rad/s; three times what a setpoint may turn


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
    largest: float  # magnitude
    at_s: float  # when
    beyond_s: float  # time spent beyond the limit
    kept: bool  # within the tolerance


def limits(vehicle: Vehicle) -> tuple[Limit, ...]:
    """Of a vehicle, in the order of ``record_use``."""
    return (
        Limit("joint_1_angle", "rad", math.radians(FIRST_JOINT_DEG), math.radians(0.5)),
        Limit("link_2_angle", "rad", math.radians(BOTH_JOINTS_DEG), math.radians(0.5)),
        Limit("joint_1_rate", "rad/s", JOINT_RATE_MAX, 0.1),
        Limit("joint_2_rate", "rad/s", JOINT_RATE_MAX, 0.1),
        Limit("tilt", "rad", math.radians(TILT_MAX_DEG), math.radians(0.5)),
        Limit("roll_pitch_rate", "rad/s", ROLL_PITCH_RATE_MAX, 0.1),
        Limit("yaw_rate", "rad/s", YAW_RATE_MAX, 0.05),
        # A share of 1e-6 for commands that travel as single precision.
        Limit("joint_torque", "N m", vehicle.joints.torque_max, 1e-6 * vehicle.joints.torque_max),
        Limit("rotor_thrust", "N", vehicle.rotors.thrust_max, 1e-6 * vehicle.rotors.thrust_max),
    )


def largest(
    thrust: V4, torque: tuple[float, ...], most: tuple[float, float]
) -> tuple[float, float]:
    """Largest magnitudes commanded, torque [N·m] and thrust [N].

    ``thrust`` and ``torque`` are shares [1] of the ``most`` of a rotor [N] and a joint [N·m].
    """
    weakest, strongest = min(thrust), max(thrust)
    # A thrust below zero is as far beyond its range as one that is as much too large.
    beyond = strongest if weakest >= 0.0 else max(strongest, 1.0 - weakest)
    return most[1] * max(max(torque), -min(torque)), most[0] * beyond


class Use(NamedTuple):
    """A record for kernels, an entry a limit."""

    largest: Array  # (limits,) magnitudes in the unit of each
    when_s: Array  # (limits,) s, when that was
    beyond_s: Array  # (limits,) s, spent beyond the limit
    steps: Array  # (1,) how many have been recorded


class LimitRecord:
    """The largest use of every limit, when it was, and how long each was exceeded."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.limits = limits(vehicle)
        self._most = np.array([limit.most for limit in self.limits])
        self._largest = np.zeros(len(self.limits))
        self._when_s = np.zeros(len(self.limits))
        self._beyond_s = np.zeros(len(self.limits))
        self._steps = np.zeros(1)

    @property
    def arrays(self) -> tuple[Array, Use]:
        """The limits and the memory behind the record, for ``record_use``."""
        return self._most, Use(self._largest, self._when_s, self._beyond_s, self._steps)

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


@compiled
def record_use(
    states: Array,
    sent: tuple[float, float],
    most: Array,
    instants: tuple[float, float],
    record: Use,
) -> None:
    """Take plant steps into a record.

    Args:
        states: (steps, 17 + 2j) [SI], see ``sitl.plant.state``.
        sent: Largest magnitudes commanded during them, torque [N·m] and thrust [N].
        most: (limits,) [unit of each], the limits.
        instants: Time one step before the first, and between two steps [s].
        record: Overwritten.
    """
    largest, when_s, beyond_s = record.largest, record.when_s, record.beyond_s
    record.steps[0] += states.shape[0]
    before_s, step_s = instants
    used = np.empty(most.shape[0])
    for k in range(states.shape[0]):
        x = states[k]
        joints = (x.shape[0] - ARM) // 2
        used[0], used[1] = abs(x[ARM]), abs(x[ARM] + x[ARM + 1])
        used[2], used[3] = abs(x[ARM + joints]), abs(x[ARM + joints + 1])
        # Half the tilt has the sine that the attitude has across the body's z axis.
        across = math.sqrt(x[Q_WB + 1] * x[Q_WB + 1] + x[Q_WB + 2] * x[Q_WB + 2])
        used[4] = 2.0 * math.asin(min(across, 1.0))
        used[5] = math.sqrt(x[W_WB_B] * x[W_WB_B] + x[W_WB_B + 1] * x[W_WB_B + 1])
        used[6] = abs(x[W_WB_B + 2])
        used[7], used[8] = sent
        for i in range(most.shape[0]):
            # Written so that what is not a number is recorded, and beyond.
            if not (used[i] <= largest[i]):
                largest[i] = used[i]
                when_s[i] = before_s + (k + 1) * step_s
            if not (used[i] <= most[i]):
                beyond_s[i] += step_s
