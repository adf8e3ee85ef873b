r"""Coordinates of the arm in which the limits of its angles do not depend on each other.

Limits hold for joints and for sums of joints. With one coordinate a joint,

.. math:: c_k = \sum_{i \le k} L_{ki} q_i,

the coupled limit that ends at joint k where there is one and the joint's own angle elsewhere, most
arms have nothing but bounds on c. Limits that are left over, the ``others``, are few.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fsw.autopilot.geometry.vectors import clamp
from fsw.autopilot.model.airframe import Airframe, AngleLimits
from fsw.autopilot.model.multibody import Several
from fsw.autopilot.signals import JointVector, Vec2
from fsw.compiled import compilable
from fsw.record import ANGLE_LIMITS, JOINTS, Floats, padded, padded_rows


@dataclass(frozen=True, slots=True)
class ArmCoordinates:
    """The coordinates of an arm, with room for ``JOINTS`` joints."""

    joints: int
    row: Several  # (JOINTS,) [1] a coordinate: L
    column: Several  # (JOINTS,) [1] a coordinate: how the joints turn with it alone, of L's inverse
    low: Several  # (JOINTS,) rad, minus infinity where there is no limit
    high: Several  # (JOINTS,) rad
    others: int  # limits beside those
    other_row: Several  # (JOINTS,) [1] each
    other_low: Several  # (ANGLE_LIMITS,) rad
    other_high: Several  # (ANGLE_LIMITS,) rad


@lru_cache(maxsize=8)
def arm_coordinates(airframe: Airframe) -> ArmCoordinates:
    """The coordinates of a vehicle's arm."""
    n, limits = airframe.bodies.joints, airframe.angle_limits
    rows = [limits.row[JOINTS * i : JOINTS * (i + 1)] for i in range(limits.rows)]
    chosen: dict[int, int] = {}
    for i, row in enumerate(rows):
        # Of those that end at the same joint the last: a joint's own limits come first.
        chosen[max(k for k in range(n) if row[k] != 0.0)] = i
    own = [tuple(float(i == k) for i in range(JOINTS)) for k in range(n)]
    left = [i for i in range(limits.rows) if i not in chosen.values()]
    low = [limits.low[chosen[k]] if k in chosen else -math.inf for k in range(n)]
    high = [limits.high[chosen[k]] if k in chosen else math.inf for k in range(n)]
    L = [rows[chosen[k]] if k in chosen else own[k] for k in range(n)]
    inverse = np.linalg.inv(np.array([row[:n] for row in L]))
    return ArmCoordinates(
        joints=n,
        row=padded_rows(L, JOINTS * JOINTS),
        column=padded_rows(
            [padded(tuple(one), JOINTS) for one in inverse.T.tolist()], JOINTS * JOINTS
        ),
        low=padded(tuple(low), JOINTS),
        high=padded(tuple(high), JOINTS),
        others=len(left),
        other_row=padded_rows([rows[i] for i in left], ANGLE_LIMITS * JOINTS),
        other_low=padded(tuple([limits.low[i] for i in left]), ANGLE_LIMITS),
        other_high=padded(tuple([limits.high[i] for i in left]), ANGLE_LIMITS),
    )


@compilable
def to_coordinates(arm: ArmCoordinates, q: Several | Floats, out: Floats) -> None:
    """What joints at ``q`` (j,) [rad] are in coordinates, into ``out`` (j,) [rad]; of rates too."""
    for k in range(int(arm.joints)):
        total = 0.0
        for i in range(k + 1):
            total += arm.row[JOINTS * k + i] * q[i]
        out[k] = total


@compilable
def to_joints(arm: ArmCoordinates, c: Several | Floats, out: Floats) -> None:
    """The joints (j,) [rad] of coordinates ``c`` (j,) [rad] into ``out``; of rates too."""
    for k in range(int(arm.joints)):
        rest = c[k]
        for i in range(k):
            rest -= arm.row[JOINTS * k + i] * out[i]
        out[k] = rest / arm.row[JOINTS * k + k]


@compilable
def along_other(arm: ArmCoordinates, other: int, q: Several | Floats) -> float:
    """The sum of joints (j,) [rad] that one of the ``others`` limits; of rates too."""
    total = 0.0
    for i in range(int(arm.joints)):
        total += arm.other_row[JOINTS * other + i] * q[i]
    return total


@compilable
def bounds_of(arm: ArmCoordinates, k: int, margin: float) -> Vec2:
    """Lowest and highest value [rad] of coordinate ``k``, a ``margin`` [rad] within its limits."""
    return arm.low[k] + margin, arm.high[k] - margin


def within_limits(arm: ArmCoordinates, q: JointVector, margin: float) -> JointVector:
    """The angles (j,) [rad] next to ``q`` [rad] that are a ``margin`` [rad] within limits."""
    c, found = np.zeros(arm.joints), np.zeros(arm.joints)
    to_coordinates(arm, q, c)
    for k in range(arm.joints):
        c[k] = clamp(float(c[k]), *bounds_of(arm, k, margin))
    to_joints(arm, c, found)
    return tuple(found.tolist())


class AngleRow(NamedTuple):
    """A limit of a joint's angle, or of a sum of them."""

    name: str  # "joint 1", or "joints 1 and 2 together"
    row: JointVector  # (j,) [1]
    low: float  # rad
    high: float  # rad


def angle_rows(limits: AngleLimits, joints: int) -> list[AngleRow]:
    """The limits of an arm of so many ``joints``."""
    found = []
    for i in range(limits.rows):
        row = limits.row[JOINTS * i : JOINTS * i + joints]
        names = [str(k) for k, share in enumerate(row, start=1) if share]
        name = f"joint {''.join(names)}"
        if len(names) > 1:
            name = f"joints {', '.join(names[:-1])} and {names[-1]} together"
        found.append(AngleRow(name, row, limits.low[i], limits.high[i]))
    return found


def first_beyond(limits: AngleLimits, q: JointVector, room: float) -> str | None:
    """The first joint, or sum of joints, that is more than ``room`` [rad] beyond its limits.

    As a sentence, of joints at ``q`` (j,) [rad].
    """
    for one in angle_rows(limits, len(q)):
        angle = sum(a * b for a, b in zip(one.row, q, strict=True) if a)
        if not one.low - room <= angle <= one.high + room:
            are = "are beyond their" if " and " in one.name else "is beyond its"
            return f"{one.name} at {math.degrees(angle):.0f} deg {are} limit"
    return None
